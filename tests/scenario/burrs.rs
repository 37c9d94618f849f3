//! Burrs that are changed within a run: logged, replayed, judged with the one that is on.

use super::{again, begin};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::log::{LogRecord, RunLog};
use bevy_surgery::scenario::{RunPhase, Scenario, ScenarioRun};
use bevy_surgery::testing::TestApp;

/// A drill with a burr that is too large, and one that is not.
const SCENARIO: &str = r#"(version: 1, name: "burrs", scene: TemporalBone,
    tools: [(name: "drill", tool: (kind: Drill((burr: (kind: Cutting, shape: Sphere, diameter_m: 0.006))),
        burrs: [(kind: Diamond, shape: Sphere, diameter_m: 0.003)]))],
    goals: [(id: "all", kind: Remove(structure: "Air cell walls", share: 1.0))],
    rules: [(id: "burr", kind: BurrTooLarge(structure: "Cortical bone", within_m: 0.05, above_m: 0.004), penalty: 10.0)])"#;

fn scenario(text: &str) -> Scenario {
    Scenario::from_bytes(text.as_bytes(), "burrs").expect("it is good")
}

/// Drills in the air close to the bone for a second with each burr, in this order of commands.
fn perform(changes: bool) -> RunLog {
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::new(scenario(SCENARIO)).kept());
    begin(&mut app);
    assert_eq!(*app.world().resource::<ScenarioRun>().phase(), RunPhase::Running);
    let drill = app.world_mut().query_filtered::<Entity, With<Tool>>().single(app.world()).expect("one drill");
    for step in 0..90 {
        let pedal = if step < 30 { 0.0 } else { 1.0 };
        let next_burr = changes && (10..15).contains(&step);
        let tip_m = Vec3::new(0.0, 0.0, 0.03);
        let pose = ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::Z);
        app.world_mut().entity_mut(drill).insert((pose, ToolCommand { pedal, next_burr, ..default() }));
        app.step(1);
    }
    app.world_mut().resource_mut::<ScenarioRun>().stop();
    app.step(1);
    app.world().resource::<ScenarioRun>().log().expect("it is kept").clone()
}

fn violations(log: &RunLog) -> usize {
    log.entries.iter().filter(|entry| matches!(entry.record, LogRecord::Violation(_))).count()
}

#[test]
fn the_burr_that_is_on_is_judged_logged_and_replayed() {
    let (stayed, changed) = (perform(false), perform(true));
    assert_eq!((violations(&stayed), violations(&changed)), (1, 0));
    let asked = |log: &RunLog| {
        let is_asked = |record: &LogRecord| matches!(record, LogRecord::Sample(sample) if sample.command.next_burr);
        log.entries.iter().filter(|entry| is_asked(&entry.record)).count()
    };
    assert_eq!((asked(&stayed), asked(&changed)), (0, 5));
    again(&changed);
    // A log without the command is another run: the burr that is too large is on.
    let mut forgetful = changed;
    for entry in &mut forgetful.entries {
        if let LogRecord::Sample(sample) = &mut entry.record {
            sample.command.next_burr = false;
        }
    }
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::replay(forgetful));
    begin(&mut app);
    while app.world().resource::<ScenarioRun>().end().is_none() {
        app.step(1);
    }
    assert_eq!(app.world().resource::<ScenarioRun>().diverged_s(), Some(1));
    assert_eq!(app.world().resource::<ScenarioRun>().rules()[0].count, 1);
}

#[test]
fn burrs_that_no_drill_takes_are_told_of() {
    let told = |from: &str, to: &str| {
        let text = SCENARIO.replacen(from, to, 1);
        assert_ne!(text, SCENARIO, "{from}");
        Scenario::from_bytes(text.as_bytes(), "a").expect_err("it is wrong").to_string()
    };
    assert_eq!(
        told("diameter_m: 0.003", "diameter_m: 0.03"),
        "a: tool \"drill\": burrs: a burr's diameter is 1 to 6 mm, not 30 mm"
    );
    assert!(told("diameter_m: 0.006", "diameter_m: 0.0").starts_with("a: tool \"drill\": burr: a burr's diameter"));
    let kind = "kind: Drill((burr: (kind: Cutting, shape: Sphere, diameter_m: 0.006)))";
    assert_eq!(told(kind, "kind: Probe"), "a: tool \"drill\": burrs: it is no drill");
}
