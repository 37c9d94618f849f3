//! From a log to a report, to JSON and back.

use super::*;
use bevy_surgery::scenario::Severity;
use bevy_surgery::scenario::report::{REPORT_VERSION, RunReport};

#[test]
fn a_report_says_what_the_log_says() {
    let mut run = empty_run(100.0, vec![remove_cells()], Vec::new(), Vec::new());
    run.header.scenario.rules = mastoid_run(1.0, 1, Vec::new()).header.scenario.rules;
    let goal = |progress, is_reached| LogRecord::Goal(GoalRecord { goal: "cells".into(), progress, is_reached });
    push(&mut run, 100, goal(0.5, false));
    push(&mut run, 250, goal(1.0, true));
    push(&mut run, 300, goal(1.0, true));
    let point_m = Some(Vec3::new(1.0, 2.0, 3.0));
    let violation = |rule: &str, severity| ViolationRecord {
        rule: rule.into(),
        severity,
        tool: Some(0),
        point_m,
        value: 2.5,
        penalty: 3.0,
    };
    push(&mut run, 310, LogRecord::Violation(violation("force", Severity::Error)));
    push(&mut run, 320, LogRecord::Violation(violation("unknown", Severity::Warning)));
    push(&mut run, 330, removal(0, 1, 12.0, Vec3::ONE * 1e-3, Some(1.0)));
    push(&mut run, 331, removal(0, 2, 4.0, Vec3::ONE * 1e-3, Some(0.0)));
    push(&mut run, 340, contact(0, 2, true));
    push(&mut run, 345, contact(0, 2, true));
    push(&mut run, 360, contact(0, 2, false));
    push(&mut run, 390, contact(1, 1, true));
    push(&mut run, 400, LogRecord::End(EndRecord { reason: EndReason::Done, score: 81.5, is_passed: true }));
    let report = RunReport::of(&run);
    assert_eq!(
        (report.outcome.score, report.outcome.is_passed, report.outcome.time_s),
        (Some(81.5), Some(true), Some(4.0))
    );
    assert_eq!((report.outcome.reason, report.outcome.time_limit_s), (Some(EndReason::Done), Some(600.0)));
    let goal = &report.goals[0];
    assert_eq!(
        (goal.title.as_str(), goal.progress, goal.reached_s, goal.is_reached),
        ("Remove the mastoid cells", 1.0, Some(2.5), true)
    );
    let [force, unknown] = &report.violations[..] else { panic!("two violations: {:?}", report.violations) };
    assert_eq!((force.message.as_str(), force.unit.as_str()), ("Too much force near the facial nerve", "N"));
    assert_eq!((force.time_s, force.value, force.penalty, force.point_m), (3.1, Some(2.5), 3.0, point_m));
    assert_eq!(
        (force.tool.as_deref(), unknown.message.as_str(), unknown.unit.as_str()),
        (Some("Drill, 4 mm cutting"), "unknown", "")
    );
    let structures: Vec<_> = report
        .structures
        .iter()
        .map(|s| (s.name.as_str(), s.removed_mm3, s.is_target, s.is_critical, s.before_mm3))
        .collect();
    assert_eq!(
        structures,
        [
            ("mastoid cells", 12.0, true, false, Some(6000.0)),
            ("facial nerve", 4.0, false, true, Some(55.0)),
            ("sigmoid sinus", 0.0, false, true, Some(900.0)),
        ]
    );
    // Both removals are of one place.
    let [dot] = &report.series.removals[..] else { panic!("one dot: {:?}", report.series.removals) };
    assert_eq!((dot.mm3, dot.seen, dot.inside), (16.0, Some(0.75), Some(0.75)));
    let spans: Vec<_> =
        report.series.contacts.iter().map(|s| (s.structure.as_str(), s.is_critical, s.from_s, s.to_s)).collect();
    assert_eq!(spans, [("facial nerve", true, 3.4, 3.6), ("mastoid cells", false, 3.9, 4.0)]);
}

#[test]
fn json_comes_back_as_it_was() {
    for run in [
        mastoid_run(0.7, 4, Vec::new()),
        hostile_run(),
        broken_run(),
        empty_run(60.0, Vec::new(), Vec::new(), Vec::new()),
    ] {
        let report = RunReport::of(&run);
        let json = report.to_json().expect("JSON");
        assert_eq!(RunReport::from_json(&json).expect("a report"), report);
    }
}

#[test]
fn what_is_no_report_is_told() {
    let newer = format!("{{\"version\": {}, \"other\": 1}}", REPORT_VERSION + 1);
    let error = RunReport::from_json(&newer).expect_err("a later version").to_string();
    assert!(error.contains(&format!("version {}", REPORT_VERSION + 1)), "{error}");
    for text in ["", "{}", "[]", "{\"version\": 1}", "{\"version\": -1}", "\u{0}"] {
        assert!(RunReport::from_json(text).is_err(), "{text:?}");
    }
}

#[test]
fn a_long_run_has_no_larger_report() {
    let mut run = empty_run(60.0, vec![remove_cells()], Vec::new(), Vec::new());
    for step in 0..60_000_u64 {
        let t = step as f32 / 60.0;
        let mut drill = sample(0, Vec3::new((t * 1.7).sin(), (t * 0.31).cos(), t * 1e-3) * 0.02);
        drill.contact_n = if step == 31_234 { 9.5 } else { 1.0 };
        drill.pose.is_tracked = step % 50 != 0;
        push(&mut run, step, LogRecord::Sample(drill));
        if step % 2 == 0 {
            let at_m = Vec3::new((t * 3.1).sin(), (t * 0.7).cos(), (t * 0.13).sin()) * 0.03;
            push(&mut run, step, removal(0, 1, 0.5, at_m, Some(1.0)));
            push(&mut run, step, contact(0, 1, step % 4 == 0));
            let bleeding = BleedingRecord { lost_ml: f64::from(t), rate_ml_s: 1.0, sources: 1, hidden: None };
            push(&mut run, step, LogRecord::Bleeding(bleeding));
        }
    }
    let report = RunReport::of(&run);
    let series = &report.series;
    assert!((1000..=1500).contains(&series.tools[0].track.len()), "{}", series.tools[0].track.len());
    assert_eq!(series.tools[0].force.len(), 600);
    assert!(
        series.bleeding.len() <= 600 && series.contacts.len() <= 400,
        "{} {}",
        series.bleeding.len(),
        series.contacts.len()
    );
    assert!((200..=1500).contains(&series.removals.len()), "{}", series.removals.len());
    // Nothing is lost by it: the sum of what was removed, and the one peak of force.
    let sum_mm3: f64 = series.removals.iter().map(|dot| dot.mm3).sum();
    assert!((sum_mm3 - 15_000.0).abs() < 1e-6, "{sum_mm3}");
    let peak_n = series.tools[0].force.iter().map(|point| point.max_n).fold(0.0, f64::max);
    assert_eq!(peak_n, 9.5);
    assert!(series.tools[0].track.iter().filter(|point| point.is_new).count() > 900, "the way is broken where it was");
    assert!(report.to_html(&[]).len() < 1_000_000, "{}", report.to_html(&[]).len());
}
