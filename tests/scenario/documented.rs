//! The page about logs names everything that is written into one.

use super::short_run;
use bevy::math::{Quat, Vec2, Vec3};
use bevy_surgery::scenario::log::*;
use bevy_surgery::scenario::metrics::{MetricChoice, MetricKind};
use bevy_surgery::scenario::{READY_SCENARIOS, Severity};
use bevy_surgery::tools::{Electrodes, Jaws, Tool, ToolKind, ToolPart, ToolPose};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// One of each record, with all of its parts.
fn records() -> Vec<LogRecord> {
    let (here, tool, body) = (Vec3::ONE, Some(0), 0);
    let sample = ToolSample {
        tool: 0,
        pose: ToolPose::at(here, Quat::IDENTITY),
        is_dropped: true,
        command: Default::default(),
        forces_n: Some(vec![(0, here)]),
        drilling_n: Some(1.0),
        contact_n: 1.0,
        critical_m: Some(1e-3),
    };
    let contact = ContactRecord {
        tool: 0,
        body,
        label: Some(1),
        uv: Some(Vec2::ONE),
        part: ToolPart::Shaft,
        is_on: true,
        point_m: here,
        depth_m: 1e-3,
        force_n: 1.0,
    };
    let removal = RemovalRecord { tool, body, by_label_mm3: vec![(1, 2.0)], centroid_m: here, seen: Some(1.0) };
    let violation = ViolationRecord {
        rule: "r".into(),
        severity: Severity::Failure,
        tool,
        point_m: Some(here),
        value: 1.0,
        penalty: 1.0,
    };
    vec![
        LogRecord::Sample(sample),
        LogRecord::Contact(contact),
        LogRecord::Removal(removal),
        LogRecord::Reaction(ReactionRecord { body, what: "it bleeds".into(), uv: Some(Vec2::ONE) }),
        LogRecord::Bleeding(BleedingRecord { lost_ml: 1.0, rate_ml_s: 1.0, sources: 1, hidden: Some(0.5) }),
        LogRecord::Camera(CameraRecord { eye_world_m: here, world_from_eye: Quat::IDENTITY }),
        LogRecord::Goal(GoalRecord { goal: "g".into(), progress: 1.0, is_reached: true }),
        LogRecord::Violation(violation),
        LogRecord::Hash(HashRecord { second: 1, hash: "0".into() }),
        LogRecord::End(EndRecord { reason: EndReason::OutOfTime, score: 1.0, is_passed: true }),
    ]
}

/// Headers with every ready scenario, every kind of tool, and all that may be left out.
fn headers() -> Vec<LogHeader> {
    let kinds = [
        ToolKind::Probe,
        ToolKind::Grasper(Jaws::default()),
        ToolKind::BiopsyNeedle(Default::default()),
        ToolKind::CauteryHook(Electrodes::default()),
        ToolKind::Drill(Default::default()),
        ToolKind::SuctionIrrigator,
        ToolKind::Scope,
    ];
    let mut of_kinds = short_run().header;
    of_kinds.tools = kinds.map(|kind| LoggedTool { name: "tool".into(), tool: Tool::new(kind) }).into();
    of_kinds.scenario.metrics.push(MetricChoice { name: Some("m".into()), ..MetricChoice::new(MetricKind::Time) });
    of_kinds.branch = Some(LogBranch { file: "first.mcap".into(), step: 1 });
    let ready = READY_SCENARIOS
        .map(|ready| LogHeader { scenario: ready.scenario().expect("it is good"), ..short_run().header });
    [vec![of_kinds], ready.into()].concat()
}

/// The names of all fields of a value, and of choices with parts.
fn fields(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(parts) => {
            for (name, part) in parts {
                found.insert(name.clone());
                fields(part, found);
            }
        }
        Value::Array(parts) => parts.iter().for_each(|part| fields(part, found)),
        _ => {}
    }
}

fn page() -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/run-log.md");
    std::fs::read_to_string(file).expect("the page is there")
}

#[test]
fn every_field_is_named_in_the_page() {
    let page = page();
    let mut found = BTreeSet::new();
    for header in headers() {
        fields(&serde_json::to_value(header).expect("it is written"), &mut found);
    }
    let records = records();
    assert!(records.iter().map(std::mem::discriminant).collect::<std::collections::HashSet<_>>().len() == 10);
    for record in records {
        fields(&serde_json::to_value(LogEntry { step: 0, record }).expect("it is written"), &mut found);
    }
    assert!(found.len() > 80 && found.contains("tip_in_world_m") && found.contains("next_burr"), "{found:?}");
    // Kinds of goals and rules are those of scenarios; the page lists their fields.
    let scenario = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("src/scenario/asset.rs"));
    let scenario = scenario.expect("the source is there");
    let is_kind = |name: &str| scenario.contains(&format!("\n    {name} {{\n"));
    let is_named = |name: &str| page.contains(&format!("`{name}`")) || page.contains(&format!("[].{name}`"));
    let missing: Vec<&String> = found.iter().filter(|name| !is_named(name) && !is_kind(name)).collect();
    assert!(missing.is_empty(), "docs/run-log.md does not name {missing:?}");
    for choice in ["Tip", "Shaft", "Warning", "Error", "Failure", "Done", "OutOfTime", "Stopped"] {
        assert!(is_named(choice), "{choice}");
    }
    assert!(page.contains(&format!("| `version` | of these records, {LOG_VERSION} now |")));
}

#[test]
fn every_topic_is_named_in_the_page() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let mut writer = LogWriter::create(&file, &short_run().header).expect("it can be written");
    writer.write(records().into_iter().map(|record| LogEntry { step: 0, record }).collect()).expect("it is written");
    writer.finish().expect("it is ended");
    let bytes = std::fs::read(&file).expect("it is there");
    let summary = mcap::Summary::read(&bytes).expect("it is whole").expect("it has a summary");
    let page = page();
    assert_eq!(summary.channels.len(), 11);
    for channel in summary.channels.values() {
        assert!(page.contains(&format!("\n| `{}` | ", channel.topic)), "{}", channel.topic);
        assert_eq!(channel.message_encoding, "json");
        assert_eq!(channel.schema.as_ref().map(|schema| schema.encoding.as_str()), Some("jsonschema"));
    }
    let used: BTreeSet<String> = mcap::MessageStream::new(&bytes)
        .expect("it is whole")
        .map(|message| message.expect("a message").channel.topic.clone())
        .collect();
    assert_eq!(used.len(), 11, "each kind of record has its topic: {used:?}");
}
