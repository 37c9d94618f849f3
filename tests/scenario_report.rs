//! Reports: what is in them, and that no text of a log does harm in them.

#[path = "scenario_report/data.rs"]
mod data;
#[path = "scenario_report/page.rs"]
mod page;
#[path = "scenario_report/statements.rs"]
mod statements;
#[path = "scenario_report/table.rs"]
mod table;

use crate::scenario_runs::*;
use bevy::math::Vec3;
use bevy_surgery::scenario::log::*;
use bevy_surgery::scenario::metrics::{MetricChoice, MetricKind};

/// A text that is markup, a formula, and a few things more.
const HOSTILE: &str = "=A1\"</title><script>alert('x&y')</script>\u{202e}\u{0}\n\"><img src=x onerror=y>";

/// A run in which every text that a log has is hostile.
fn hostile_run() -> RunLog {
    let mut run = mastoid_run(0.2, 1, Vec::new());
    let header = &mut run.header;
    header.trainee = Some(HOSTILE.into());
    header.began = Some(HOSTILE.into());
    header.crate_version = HOSTILE.into();
    header.branch = Some(LogBranch { file: HOSTILE.into(), step: 3 });
    header.tools.iter_mut().for_each(|tool| tool.name = HOSTILE.into());
    for body in &mut header.bodies {
        body.name = HOSTILE.into();
        body.structures.iter_mut().for_each(|name| *name = HOSTILE.into());
    }
    let scenario = &mut header.scenario;
    (scenario.name, scenario.description) = (HOSTILE.into(), HOSTILE.into());
    scenario.goals.iter_mut().for_each(|goal| (goal.id, goal.title) = (HOSTILE.into(), HOSTILE.into()));
    scenario.rules.iter_mut().for_each(|rule| (rule.id, rule.message) = (HOSTILE.into(), HOSTILE.into()));
    for entry in &mut run.entries {
        match &mut entry.record {
            LogRecord::Goal(goal) => goal.goal = HOSTILE.into(),
            LogRecord::Violation(violation) => violation.rule = HOSTILE.into(),
            _ => {}
        }
    }
    let named = |kind| MetricChoice {
        name: Some(HOSTILE.into()),
        weight: 1.0,
        best: 0.0,
        worst: 9.0,
        ..MetricChoice::new(kind)
    };
    run.header.scenario.metrics = vec![named(MetricKind::PathLength), named(MetricKind::MaxForce)];
    run
}

/// A run whose numbers are none.
fn broken_run() -> RunLog {
    let none = MetricChoice {
        weight: f32::NAN,
        best: f32::NAN,
        worst: f32::INFINITY,
        ..MetricChoice::new(MetricKind::Removed)
    };
    let nowhere = MetricChoice::new(MetricKind::TimeNear { within_m: f32::NAN });
    let mut metrics: Vec<_> = MetricKind::ALL.into_iter().map(MetricChoice::new).collect();
    metrics.extend([none, nowhere]);
    let mut run = mastoid_run(0.2, 2, metrics);
    run.header.steps_per_second = f64::NAN;
    run.header.bodies[0].box_world_m = [Vec3::NAN, Vec3::INFINITY];
    run.header.bodies[0].volumes_mm3 = vec![f64::NAN; 9];
    run.header.scenario.pass_score = f32::NAN;
    run.header.scenario.time_limit_s = Some(f32::INFINITY);
    run.header.scenario.goals[0].weight = f32::NAN;
    for (index, entry) in run.entries.iter_mut().enumerate() {
        match &mut entry.record {
            LogRecord::Sample(sample) if index % 3 == 0 => sample.pose.place.tip_in_world_m = Vec3::NAN,
            LogRecord::Sample(sample) if index % 3 == 1 => sample.pose.place.tip_in_world_m *= f32::MAX,
            LogRecord::Removal(removal) => {
                removal.centroid_m = if index % 2 == 0 { Vec3::NAN } else { Vec3::splat(f32::MAX) * index as f32 };
                removal.seen = Some(f32::NAN);
                removal.by_label_mm3[0].1 = 1e300;
            }
            LogRecord::Violation(violation) => {
                (violation.value, violation.penalty) = (f32::NAN, f32::NEG_INFINITY);
                (violation.tool, violation.point_m) = (Some(u32::MAX), Some(Vec3::NAN));
            }
            LogRecord::Goal(goal) => goal.progress = f32::NAN,
            LogRecord::Bleeding(bleeding) => (bleeding.lost_ml, bleeding.rate_ml_s) = (f64::NAN, f64::INFINITY),
            LogRecord::End(end) => end.score = f32::NAN,
            _ => {}
        }
    }
    run
}
