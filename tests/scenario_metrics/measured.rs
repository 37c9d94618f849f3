//! Metrics of logs.

use super::near;
use crate::scenario_runs::*;
use bevy::math::Vec3;
use bevy_surgery::scenario::log::*;
use bevy_surgery::scenario::metrics::*;
use bevy_surgery::scenario::*;

fn one(run: &RunLog, kind: MetricKind) -> Metric {
    let mut run = run.clone();
    run.header.scenario.metrics = vec![MetricChoice::new(kind)];
    measure(&run).remove(0)
}

fn value(run: &RunLog, kind: MetricKind) -> Option<f64> {
    one(run, kind).value
}

fn parts(run: &RunLog, kind: MetricKind) -> Vec<(String, f64)> {
    one(run, kind).by.into_iter().map(|part| (part.name, part.value)).collect()
}

/// Ten seconds at 100 Hz: the drill goes 10 mm/s along x with 2 N for five seconds, then rests with the pedal up; the suction
/// stays 6 mm beside where the drill begins.
fn ten_seconds() -> RunLog {
    let mut run = empty_run(100.0, vec![remove_cells()], Vec::new(), Vec::new());
    for step in 0..=1000_u64 {
        let along = step.min(500) as f32 * 1e-4;
        let mut drill = sample(0, Vec3::X * along);
        if step < 500 {
            drill.command.pedal = 1.0;
            drill.contact_n = 2.0;
            drill.critical_m = Some(if step < 100 { 1e-3 } else { 3e-3 });
        }
        push(&mut run, step, LogRecord::Sample(drill));
        push(&mut run, step, LogRecord::Sample(sample(1, Vec3::Y * 6e-3)));
    }
    run
}

#[test]
fn motion_of_a_run() {
    let run = ten_seconds();
    near(value(&run, MetricKind::Time), 10.0, 1e-12);
    near(value(&run, MetricKind::PathLength), 0.05, 1e-5);
    let tools = parts(&run, MetricKind::PathLength);
    assert_eq!(tools.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["Drill, 4 mm cutting", "Suction"]);
    assert_eq!(tools[1].1, 0.0);
    near(value(&run, MetricKind::MeanSpeed), 0.05 / 20.0, 1e-4);
    near(value(&run, MetricKind::MaxSpeed), 0.01, 1e-2);
    near(value(&run, MetricKind::Idle), 5.0, 3e-3);
    near(Some(parts(&run, MetricKind::Idle)[1].1), 10.0, 1e-9);
    near(value(&run, MetricKind::Economy), 1.0, 1e-4);
    assert!(value(&run, MetricKind::Depth).expect("a depth") < 1e-9, "it points down and goes sideways");
}

#[test]
fn force_and_nearness_of_a_run() {
    let run = ten_seconds();
    near(value(&run, MetricKind::MeanForce), 2.0, 1e-12);
    near(value(&run, MetricKind::MaxForce), 2.0, 1e-12);
    near(value(&run, MetricKind::Impulse), 10.0, 1e-9);
    near(value(&run, MetricKind::TimeNear { within_m: 2e-3 }), 1.0, 1e-9);
    near(value(&run, MetricKind::TimeNear { within_m: 4e-3 }), 5.0, 1e-9);
    near(value(&run, MetricKind::TimeNear { within_m: 3e-3 }), 5.0, 1e-9);
    near(value(&run, MetricKind::MaxForceNear { within_m: 2e-3 }), 2.0, 1e-12);
    near(value(&run, MetricKind::MeanSpeedNear { within_m: 4e-3 }), 0.01, 1e-3);
    assert_eq!(value(&run, MetricKind::MaxForceNear { within_m: 5e-4 }), None);
    assert_eq!(value(&run, MetricKind::TimeNear { within_m: f32::NAN }), Some(0.0), "nothing is that near");
    // What a device measured counts before what contacts say.
    let mut run = ten_seconds();
    for entry in &mut run.entries {
        if let LogRecord::Sample(sample) = &mut entry.record
            && sample.contact_n > 0.0
        {
            (sample.forces_n, sample.drilling_n) = (Some(vec![(0, Vec3::X), (0, Vec3::Y)]), Some(1.0));
        }
    }
    near(value(&run, MetricKind::MaxForce), 2.0_f64.sqrt(), 1e-6);
}

#[test]
fn suction_of_a_run() {
    // The mean of the root of 6² + x² over x from 0 to 50 mm.
    let (side, reach) = (6e-3_f64, 0.05_f64);
    let root = side.hypot(reach);
    let expected = 0.5 * (root + side * side / reach * ((reach + root) / side).ln());
    near(value(&ten_seconds(), MetricKind::SuctionDistance), expected, 3e-3);
}

#[test]
fn strokes_count_only_under_the_pedal() {
    let mut run = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    for step in 0..=1200_u64 {
        let t = step as f32 / 60.0;
        // A stroke each half second, for twenty seconds; the pedal is down for the first ten.
        let mut drill = sample(0, Vec3::X * 4e-3 * (std::f32::consts::TAU * t).cos());
        drill.command.pedal = if step < 600 { 1.0 } else { 0.2 };
        drill.contact_n = 1.5;
        push(&mut run, step, LogRecord::Sample(drill));
    }
    near(value(&run, MetricKind::StrokeRate), 2.0, 1e-6);
    near(value(&run, MetricKind::StrokeTime), 0.5, 1e-2);
    near(value(&run, MetricKind::StrokeLength), 8e-3, 1e-2);
    near(value(&run, MetricKind::StrokeForce), 1.5, 1e-6);
    assert_eq!(value(&run, MetricKind::CurvedStrokes), Some(0.0));
    // Each stroke is a movement from rest to rest, and a smooth one.
    assert!((-1.6..-1.3).contains(&value(&run, MetricKind::Sparc).expect("movements")));
}

#[test]
fn smoothness_is_the_median_of_movements() {
    let mut run = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    let rise = |t: f32| t.powi(3) * (10.0 - 15.0 * t + 6.0 * t * t);
    for step in 0..600_u64 {
        // Each second 50 mm with the least jerk, after a rest of a second.
        let (turn, step_in) = (step / 120, step % 120);
        let t = (step_in as f32 / 60.0 - 1.0).max(0.0);
        let (from, to) = if turn % 2 == 0 { (0.0, 0.05) } else { (0.05, 0.0) };
        push(&mut run, step, LogRecord::Sample(sample(0, Vec3::Y * (from + (to - from) * rise(t)))));
    }
    // What the published implementation says of one such movement at this rate.
    near(value(&run, MetricKind::Sparc), -1.400407743, 0.01);
    near(value(&run, MetricKind::LogJerk), -5.287586538, 0.02);
    near(value(&run, MetricKind::Economy), 1.0, 1e-4);
    near(value(&run, MetricKind::Depth), 0.25, 1e-3);
}

#[test]
fn a_way_is_cut_where_it_does_not_hang_together() {
    let mut run = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    // A jump of a metre in a step, a pause in the log, a hand that lets go: none of them is a way.
    for (step, x_m, is_tracked) in [
        (0, 0.0, true),
        (1, 0.01, true),
        (2, 1.01, true),
        (3, 1.02, true),
        (50, 1.0, true),
        (51, 1.01, true),
        (52, 1.05, false),
        (53, 1.0, true),
    ] {
        let mut sample = sample(0, Vec3::X * x_m);
        sample.pose.is_tracked = is_tracked;
        push(&mut run, step, LogRecord::Sample(sample));
    }
    near(value(&run, MetricKind::PathLength), 0.03, 1e-4);
    near(value(&run, MetricKind::MaxSpeed), 0.6, 1e-4);
}

#[test]
fn removal_by_structure_and_target() {
    let mut run = empty_run(60.0, vec![remove_cells()], Vec::new(), Vec::new());
    for (label, mm3, seen) in
        [(1, 30.0, 1.0), (1, 10.0, 0.5), (0, 5.0, 0.0), (2, 1.0, 1.0), (9, 2.0, 1.0), (1, f64::NAN, 1.0)]
    {
        push(&mut run, 1, removal(0, label, mm3, Vec3::ZERO, Some(seen)));
    }
    assert_eq!(value(&run, MetricKind::Removed), Some(48.0));
    assert_eq!(parts(&run, MetricKind::RemovedInside), vec![("mastoid cells".to_string(), 40.0)]);
    assert_eq!(value(&run, MetricKind::RemovedOutside), Some(8.0));
    let outside = parts(&run, MetricKind::RemovedOutside);
    assert_eq!(
        outside.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(),
        ["Temporal bone", "facial nerve", "Temporal bone, label 9"]
    );
    near(value(&run, MetricKind::SeenRemoval), 38.0 / 48.0, 1e-12);
    // To show the nerve is not to drill it.
    run.header.scenario.goals[0].kind =
        GoalKind::Expose { structure: "facial nerve".into(), share: 0.5, cover_m: 1e-3 };
    assert_eq!(value(&run, MetricKind::RemovedInside), None, "nothing is to be removed");
    run.header.scenario.goals[0].kind =
        GoalKind::Expose { structure: "mastoid cells".into(), share: 0.5, cover_m: 1e-3 };
    assert_eq!(value(&run, MetricKind::RemovedInside), Some(40.0));
}

#[test]
fn contacts_with_critical_structures_are_counted_when_they_begin() {
    let mut run = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    for (step, label, is_on) in
        [(1, 2, true), (2, 2, true), (3, 2, false), (4, 2, true), (5, 1, true), (6, 3, true), (7, 3, false)]
    {
        push(&mut run, step, contact(0, label, is_on));
    }
    assert_eq!(value(&run, MetricKind::CriticalContacts), Some(3.0));
    let by = parts(&run, MetricKind::CriticalContacts);
    assert_eq!(by, vec![("facial nerve".to_string(), 2.0), ("sigmoid sinus".to_string(), 1.0)]);
    run.header.bodies.clear();
    assert_eq!(value(&run, MetricKind::CriticalContacts), None, "nothing is critical");
}

#[test]
fn blood_and_view() {
    let mut run = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    for (step, lost_ml, hidden) in
        [(0, 0.0, Some(0.0)), (60, 4.0, Some(1.0)), (120, 9.0, Some(0.25)), (180, f64::NAN, None)]
    {
        push(&mut run, step, LogRecord::Bleeding(BleedingRecord { lost_ml, rate_ml_s: 0.0, sources: 0, hidden }));
    }
    push(&mut run, 600, LogRecord::End(EndRecord { reason: EndReason::Done, score: 80.0, is_passed: true }));
    assert_eq!(value(&run, MetricKind::BloodLoss), Some(9.0));
    near(value(&run, MetricKind::HiddenView), (0.0 + 1.0 + 0.25) / 3.0, 1e-9);
}

#[test]
fn choices_switch_name_and_weigh() {
    let path = MetricChoice {
        name: Some("Way".into()),
        weight: 3.0,
        best: 0.0,
        worst: 0.2,
        ..MetricChoice::new(MetricKind::PathLength)
    };
    let time = MetricChoice { weight: 1.0, best: 5.0, worst: 9.0, ..MetricChoice::new(MetricKind::Time) };
    let mut run = ten_seconds();
    run.header.scenario.metrics = vec![path, time, MetricChoice::new(MetricKind::Idle)];
    let metrics = measure(&run);
    assert_eq!(metrics.len(), 3);
    assert_eq!(metrics[0].name, "Way");
    near(metrics[0].score, 0.75, 1e-4);
    assert_eq!(metrics[1].score, Some(0.0), "slower than the worst is as bad as the worst");
    assert_eq!(metrics[2].score, None, "for information");
    near(weighted_score(&metrics), 0.75 * 0.75, 1e-4);
    assert_eq!(weighted_score(&metrics[2..]), None);
    // More is better where best is above worst.
    let more = MetricChoice { best: 10.0, worst: 0.0, ..MetricChoice::new(MetricKind::Time) };
    assert_eq!((more.score(5.0), more.score(20.0), more.score(f64::NAN)), (Some(0.5), Some(1.0), None));
    run.header.scenario.metrics.clear();
    let all = measure(&run);
    assert_eq!(all.len(), MetricKind::ALL.len());
    assert!(all.iter().all(|metric| !metric.formula.is_empty() && metric.score.is_none()));
    let mut keys: Vec<String> = all.iter().map(|metric| metric.kind.key()).collect();
    keys.sort();
    keys.dedup();
    assert_eq!(keys.len(), all.len(), "each has its own key");
}

#[test]
fn an_unknown_metric_is_told_with_those_there_are() {
    let error =
        serde_json::from_str::<MetricChoice>(r#"{"metric": "PathLenght"}"#).expect_err("a misspelt metric").to_string();
    assert!(
        error.contains("PathLenght") && error.contains("PathLength") && error.contains("SuctionDistance"),
        "{error}"
    );
    let error =
        serde_json::from_str::<MetricChoice>(r#"{"metric": "Time", "wieght": 2}"#).expect_err("a misspelt field");
    assert!(error.to_string().contains("wieght"), "{error}");
    let near: MetricChoice =
        serde_json::from_str(r#"{"metric": {"MaxForceNear": {"within_m": 0.003}}}"#).expect("a choice");
    assert_eq!(near.metric.key(), "max_force_near_3mm");
    assert_eq!(MetricKind::TimeNear { within_m: 0.0025 }.name(), "Time within 2.5 mm of critical structures");
}

#[test]
fn runs_that_say_nothing_have_no_numbers_and_do_no_harm() {
    let empty = empty_run(60.0, vec![remove_cells()], Vec::new(), Vec::new());
    let mut single = empty.clone();
    push(&mut single, 0, LogRecord::Sample(sample(0, Vec3::ONE)));
    let mut broken = ten_seconds();
    for (index, entry) in broken.entries.iter_mut().enumerate() {
        let LogRecord::Sample(sample) = &mut entry.record else { continue };
        match index % 7 {
            0 => sample.pose.place.tip_in_world_m.y = f32::NAN,
            1 => sample.pose.place.world_from_tool = bevy::math::Quat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            2 => sample.contact_n = f32::INFINITY,
            3 => sample.critical_m = Some(f32::NAN),
            4 => sample.tool = 77,
            5 => sample.command.pedal = f32::NAN,
            _ => sample.forces_n = Some(vec![(3, Vec3::NAN)]),
        }
    }
    push(&mut broken, u64::MAX, removal(9, 200, f64::INFINITY, Vec3::NAN, Some(f32::NAN)));
    push(&mut broken, u64::MAX, contact(99, 255, true));
    for run in [empty, single, broken] {
        for rate in [60.0, 0.0, -1.0, f64::NAN, f64::INFINITY, 1e300, 1e-300] {
            let mut run = run.clone();
            run.header.steps_per_second = rate;
            for metric in measure(&run) {
                let numbers = metric.by.iter().map(|part| part.value).chain(metric.value).chain(metric.score);
                assert!(numbers.into_iter().all(f64::is_finite), "{metric:?}");
            }
        }
    }
    let nothing = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    let known: Vec<_> =
        measure(&nothing).into_iter().filter(|metric| metric.value.is_some()).map(|metric| metric.kind).collect();
    // The bone is there, and nothing of it was touched or removed.
    assert_eq!(known, vec![MetricKind::CriticalContacts, MetricKind::Removed]);
}

#[test]
fn a_realistic_run_has_every_metric() {
    let run = mastoid_run(0.6, 3, Vec::new());
    let metrics = measure(&run);
    let missing: Vec<_> = metrics.iter().filter(|metric| metric.value.is_none()).map(|metric| metric.kind).collect();
    assert_eq!(missing, Vec::new());
    assert_eq!(metrics, measure(&run), "the same log, the same numbers");
}
