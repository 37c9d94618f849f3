//! Metrics against published reference values and closed forms.

use super::short_run;
use bevy_surgery::scenario::log::LogRecord;
use bevy_surgery::scenario::metrics::motion::{depth_m, economy, path_length_m, speeds_m_per_s};
use bevy_surgery::scenario::metrics::smoothness::{dimensionless_jerk, log_dimensionless_jerk, sparc};
use bevy_surgery::scenario::metrics::{MetricChoice, MetricKind, measure, weighted_score};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn near(value: Option<f64>, expected: f64, within: f64) {
    let value = value.expect("there is a value");
    assert!((value - expected).abs() <= within, "{value} instead of {expected}");
}

/// The bell that the published implementation shows as its example.
fn bell() -> Vec<f64> {
    (0..200).map(|at| f64::from(at) * 0.01 - 1.0).map(|t| (-5.0 * t * t).exp()).collect()
}

#[test]
fn smoothness_is_that_of_the_published_implementation() {
    near(sparc(&bell(), 100.0), -1.41403, 2e-5);
    near(dimensionless_jerk(&bell(), 100.0), -335.74684, 2e-4);
    near(log_dimensionless_jerk(&bell(), 100.0), -5.81636, 2e-5);
    // A movement of least jerk, of which the integral is known: 204.8.
    let least: Vec<f64> = (0..1000).map(|at| f64::from(at) / 1e3).map(|t| 30.0 * (t * (1.0 - t)).powi(2)).collect();
    near(log_dimensionless_jerk(&least, 1000.0), -5.3200, 5e-5);
    near(sparc(&least, 1000.0), -1.40243, 2e-5);
}

#[test]
fn what_is_no_movement_has_no_smoothness() {
    for speeds in [vec![], vec![1.0], vec![0.0; 50], vec![f64::NAN; 50], vec![f64::INFINITY; 50]] {
        assert_eq!(sparc(&speeds, 60.0), None, "{speeds:?}");
        assert_eq!(log_dimensionless_jerk(&speeds, 60.0), None, "{speeds:?}");
    }
    assert_eq!(sparc(&bell(), 0.0), None);
    assert_eq!(sparc(&bell(), f64::NAN), None);
}

#[test]
fn paths_are_measured_as_geometry_has_it() {
    let turns = (0..=6000).map(|at| TAU * f64::from(at) / 6000.0);
    let circle: Vec<DVec3> = turns.map(|a| DVec3::new(a.cos(), a.sin(), 0.0)).collect();
    near(path_length_m(&circle), TAU, 1e-5);
    // Twice across, to and fro.
    near(depth_m(&circle, &vec![DVec3::X; circle.len()]), 4.0, 1e-5);
    near(economy(&circle[..=1500]), 2.0_f64.sqrt() / (0.25 * TAU), 1e-5);
    assert!(speeds_m_per_s(&circle, 100.0).iter().all(|speed| (speed - TAU / 60.0).abs() < 1e-6));
}

#[test]
fn a_run_is_measured() {
    let run = short_run();
    let metrics = measure(&run);
    assert_eq!(metrics.len(), MetricKind::ALL.len());
    let value = |kind: MetricKind| metrics.iter().find(|metric| metric.kind == kind).and_then(|metric| metric.value);
    let steps = run.entries.last().expect("it has an end").step;
    near(value(MetricKind::Time), steps as f64 / 60.0, 0.02);
    let tips: Vec<DVec3> = run
        .entries
        .iter()
        .filter_map(|entry| match &entry.record {
            LogRecord::Sample(sample) if sample.pose.is_tracked => Some(sample.pose.place.tip_in_world_m.as_dvec3()),
            _ => None,
        })
        .collect();
    near(value(MetricKind::PathLength), tips.windows(2).map(|pair| pair[0].distance(pair[1])).sum(), 1e-9);
    assert!(value(MetricKind::BloodLoss).is_some_and(|ml| ml > 0.0 && ml < 1.0));
    assert!(value(MetricKind::MaxForce) >= value(MetricKind::MeanForce));
    assert_eq!(value(MetricKind::SuctionDistance), None, "there is no drill");
    assert!(metrics.iter().all(|metric| metric.value.is_none_or(f64::is_finite)));
    assert_eq!(weighted_score(&metrics), None, "the scenario says of none what is good");
}

#[test]
fn metrics_are_named_switched_and_weighted() {
    let mut run = short_run();
    let time_s = measure(&run)[0].value.expect("it lasted") as f32;
    let time = MetricChoice { weight: 3.0, worst: 2.0 * time_s, ..MetricChoice::new(MetricKind::Time) };
    let force = MetricChoice { weight: 1.0, best: 100.0, worst: 1e3, ..MetricChoice::new(MetricKind::MaxForce) };
    run.header.scenario.metrics = vec![MetricChoice { name: Some("how long".into()), ..time }, force];
    let metrics = measure(&run);
    assert_eq!(metrics.len(), 2);
    assert_eq!(metrics[0].name, "how long");
    near(metrics[0].score, 0.5, 1e-6);
    near(metrics[1].score, 1.0, 1e-9);
    near(weighted_score(&metrics), (3.0 * 0.5 + 1.0) / 4.0, 1e-6);
}

#[test]
fn an_empty_run_is_measured_too() {
    let mut run = short_run();
    run.entries.clear();
    assert!(measure(&run).iter().all(|metric| metric.value.is_none_or(f64::is_finite)));
}

proptest! {
    #[test]
    fn paths_do_not_depend_on_where_and_how_one_stands(
        points in prop::collection::vec((-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64), 2..40),
        turn in (-3.0..3.0_f64, -3.0..3.0_f64, -3.0..3.0_f64),
    ) {
        let here: Vec<DVec3> = points.into_iter().map(DVec3::from).collect();
        let rotation = DQuat::from_scaled_axis(DVec3::from(turn));
        let there: Vec<DVec3> = here.iter().map(|tip_m| rotation * *tip_m + DVec3::from(turn)).collect();
        let length = |tips: &[DVec3]| path_length_m(tips).unwrap_or(-1.0);
        prop_assert!((length(&here) - length(&there)).abs() < 1e-9);
        let depth = |tips: &[DVec3], axis| depth_m(tips, &vec![axis; tips.len()]).unwrap_or(-1.0);
        prop_assert!((depth(&here, DVec3::Y) - depth(&there, rotation * DVec3::Y)).abs() < 1e-9);
        prop_assert!(depth(&here, DVec3::Y) <= length(&here) + 1e-12);
    }

    #[test]
    fn smoothness_does_not_depend_on_how_far_one_moves(speeds in prop::collection::vec(0.0..1.0_f64, 20..80), scale in 0.01..100.0_f64) {
        let scaled: Vec<f64> = speeds.iter().map(|speed| speed * scale).collect();
        let (a, b) = (sparc(&speeds, 60.0), sparc(&scaled, 60.0));
        prop_assert_eq!(a.is_some(), b.is_some());
        if let (Some(a), Some(b)) = (a, b) {
            prop_assert!((a - b).abs() < 1e-9 && a <= -1.0);
        }
    }
}
