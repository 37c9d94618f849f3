//! How long the stages of a step take and how many steps a frame runs, as Bevy diagnostics.

use crate::pacing::Pacing;
use crate::schedule::SurgerySystems;
use crate::tools::ServoReading;
use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::prelude::*;
use std::time::Instant;

const STAGES: [(SurgerySystems, DiagnosticPath); 8] = [
    (SurgerySystems::Sense, DiagnosticPath::const_new("surgery/sense")),
    (SurgerySystems::Touch, DiagnosticPath::const_new("surgery/touch")),
    (SurgerySystems::Cut, DiagnosticPath::const_new("surgery/cut")),
    (SurgerySystems::Deform, DiagnosticPath::const_new("surgery/deform")),
    (SurgerySystems::React, DiagnosticPath::const_new("surgery/react")),
    (SurgerySystems::Flow, DiagnosticPath::const_new("surgery/flow")),
    (SurgerySystems::Judge, DiagnosticPath::const_new("surgery/judge")),
    (SurgerySystems::Publish, DiagnosticPath::const_new("surgery/publish")),
];

/// What is measured of the servo loop: path, and how it is read in the unit of its name.
const SERVO: [(DiagnosticPath, fn(&ServoReading) -> f64); 8] = [
    (DiagnosticPath::const_new("servo/rate_hz"), |servo| servo.state.timing.rate_hz),
    (DiagnosticPath::const_new("servo/late_p50_us"), |servo| servo.state.timing.late_p50_s * 1e6),
    (DiagnosticPath::const_new("servo/late_p99_us"), |servo| servo.state.timing.late_p99_s * 1e6),
    (DiagnosticPath::const_new("servo/late_max_us"), |servo| servo.state.timing.late_max_s * 1e6),
    (DiagnosticPath::const_new("servo/missed_ticks"), |servo| servo.state.timing.missed as f64),
    (DiagnosticPath::const_new("servo/compute_p50_us"), |servo| servo.state.timing.compute_p50_s * 1e6),
    (DiagnosticPath::const_new("servo/compute_p99_us"), |servo| servo.state.timing.compute_p99_s * 1e6),
    (DiagnosticPath::const_new("servo/compute_max_us"), |servo| servo.state.timing.compute_max_s * 1e6),
];

const STEPS: DiagnosticPath = DiagnosticPath::const_new("surgery/steps_per_frame");
const LOST: DiagnosticPath = DiagnosticPath::const_new("surgery/lost_time");

/// Measures every stage of [`SurgerySystems`] in milliseconds, under `surgery/<stage>` in Bevy's `DiagnosticsStore`; and
/// from [`Pacing`] the steps of each frame, under `surgery/steps_per_frame`, and the milliseconds that it gave up because the
/// machine was too slow, under `surgery/lost_time`. Of the first tool with a [`ServoSession`](crate::tools::ServoSession), how its loop
/// keeps time, under `servo/...`: rate, how late ticks begin, how many came a whole period late, and how long they compute.
///
/// Not in [`SurgeryPlugins`](crate::SurgeryPlugins): add it where the times are wanted.
pub struct SurgeryDiagnosticsPlugin;

/// When each stage began, and when the last one ended.
#[derive(Resource, Default)]
struct StageTimes([Option<Instant>; 9]);

impl SurgeryDiagnosticsPlugin {
    /// Path of a stage's diagnostic.
    pub fn path(stage: SurgerySystems) -> DiagnosticPath {
        STAGES[stage as usize].1.clone()
    }
}

impl Plugin for SurgeryDiagnosticsPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<StageTimes>();
        for (place, (stage, path)) in STAGES.iter().enumerate() {
            app.register_diagnostic(Diagnostic::new(path.clone()).with_suffix(" ms"));
            let mark = move |mut times: ResMut<StageTimes>| times.0[place] = Some(Instant::now());
            let mark = mark.before(*stage);
            match place.checked_sub(1) {
                Some(before) => app.add_systems(FixedUpdate, mark.after(STAGES[before].0)),
                None => app.add_systems(FixedUpdate, mark),
            };
        }
        app.add_systems(FixedUpdate, report.after(SurgerySystems::Publish));
        app.register_diagnostic(Diagnostic::new(STEPS))
            .register_diagnostic(Diagnostic::new(LOST).with_suffix(" ms"))
            .add_systems(Last, (report_pace, report_servo));
        for (path, _) in SERVO {
            app.register_diagnostic(Diagnostic::new(path));
        }
    }
}

fn report_pace(pacing: Option<Res<Pacing>>, mut diagnostics: Diagnostics) {
    let Some(pacing) = pacing else { return };
    diagnostics.add_measurement(&STEPS, || f64::from(pacing.steps));
    diagnostics.add_measurement(&LOST, || pacing.lost_last_frame_s * 1e3);
}

fn report_servo(readings: Query<(Entity, &ServoReading)>, mut diagnostics: Diagnostics) {
    let measured = readings.iter().filter(|(_, reading)| reading.state.timing.ticks > 0);
    let Some((_, first)) = measured.min_by_key(|(entity, _)| *entity) else { return };
    for (path, read) in &SERVO {
        diagnostics.add_measurement(path, || read(first));
    }
}

fn report(mut times: ResMut<StageTimes>, mut diagnostics: Diagnostics) {
    times.0[STAGES.len()] = Some(Instant::now());
    for (place, (_, path)) in STAGES.iter().enumerate() {
        if let (Some(begin), Some(end)) = (times.0[place], times.0[place + 1]) {
            diagnostics.add_measurement(path, || (end - begin).as_secs_f64() * 1e3);
        }
    }
}
