//! A run in the ECS: begun, led, judged, written down.

use super::guide::guide;
use super::log::{CameraRecord, EndReason, HashRecord, LOG_VERSION, LogEntry, LogHeader, LogRecord};
use super::observe::{self, Events, Scene};
use super::patient::{let_happen, show_lesions};
use super::replay::lead_tools;
use super::scene::{SceneState, spawn_scene, spawn_tools};
use super::seek::{keep_checkpoint, seek};
use super::{RunPhase, ScenarioError, ScenarioRun};
use crate::checkpoint::BeginMessages;
use crate::schedule::SurgerySystems;
use crate::tools::SenseDevices;
use bevy::prelude::*;

/// What a run does within a step.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
pub enum ScenarioSystems {
    /// Before [`SurgerySystems::Sense`]: a run begins when its scene is there.
    Begin,
    /// In `Sense`, after the devices: a replay leads the tools.
    Lead,
    /// In `Judge`: goals and rules are looked at, and all is written down.
    Judge,
}

/// A record of a run, as it is made: goals, violations, the end. Written in [`ScenarioSystems::Judge`]; samples are only in the
/// log.
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
pub struct ScenarioTold {
    /// The step.
    pub step: u64,
    /// What.
    pub record: LogRecord,
}

pub(super) fn build(app: &mut App) {
    use SurgerySystems::{Cut, Deform, Flow, Judge, Publish, React, Sense, Touch};
    let waits = |run: Option<Res<ScenarioRun>>| run.is_some_and(|run| run.phase == RunPhase::Waiting || run.is_held());
    app.add_message::<ScenarioTold>()
        .configure_sets(FixedUpdate, (Sense, Touch, Cut, Deform, React, Flow, Judge, Publish).run_if(not(waits)))
        .configure_sets(
            FixedUpdate,
            (
                ScenarioSystems::Begin.before(BeginMessages),
                ScenarioSystems::Lead.in_set(Sense).after(SenseDevices),
                ScenarioSystems::Judge.in_set(Judge),
            ),
        )
        .add_systems(
            FixedUpdate,
            (
                (spawn_scene, spawn_tools, begin, keep_checkpoint).chain().in_set(ScenarioSystems::Begin),
                (lead_tools, show_lesions, let_happen).chain().in_set(ScenarioSystems::Lead),
                (judge, guide).chain().in_set(ScenarioSystems::Judge),
            )
                .run_if(resource_exists::<ScenarioRun>),
        )
        .add_systems(
            RunFixedMainLoop,
            seek.after(RunFixedMainLoopSystems::BeforeFixedMainLoop)
                .before(RunFixedMainLoopSystems::FixedMainLoop)
                .run_if(|run: Option<Res<ScenarioRun>>| run.is_some_and(|run| run.seek.is_some())),
        );
}

fn begin(run: ResMut<ScenarioRun>, scene: Scene, mut events: Events, time: Res<Time<Fixed>>) {
    if run.phase != RunPhase::Waiting || run.scene != SceneState::There || !scene.is_ready() {
        return;
    }
    let run = run.into_inner();
    let has_tools =
        run.scenario.tools.iter().all(|wanted| {
            scene.tools.iter().any(|(_, name, ..)| name.is_some_and(|name| name.as_str() == wanted.name))
        });
    if !has_tools {
        return;
    }
    events.clear();
    run.steps_per_second = 1.0 / time.timestep().as_secs_f64();
    if let Some(fault) = other_rate(run) {
        return refuse(run, fault);
    }
    let found = run
        .scenario
        .check(&run.file)
        .and_then(|()| observe::begin(&run.played, run.judge.targets(), &scene, &run.file));
    match found {
        Ok(observed) => {
            let header = LogHeader {
                version: LOG_VERSION,
                crate_version: env!("CARGO_PKG_VERSION").into(),
                scenario: run.scenario.clone(),
                seed: run.seed,
                steps_per_second: run.steps_per_second,
                tools: observed.logged_tools.clone(),
                bodies: observed.logged_bodies.clone(),
                trainee: run.trainee.clone(),
                began: run.began.clone(),
                branch: run.branch.clone(),
            };
            run.observed = Some(observed);
            run.open_log(header);
            run.phase = RunPhase::Running;
        }
        Err(fault) => refuse(run, fault),
    }
}

/// A replay at another rate would be another run.
fn other_rate(run: &ScenarioRun) -> Option<ScenarioError> {
    let of_log = run.replay.as_ref()?.steps_per_second();
    let differs = (of_log - run.steps_per_second).abs() > 1e-3 * of_log;
    differs.then(|| ScenarioError::Field {
        file: run.file.clone(),
        field: "steps_per_second".into(),
        reason: format!(
            "the run was of {of_log:.1} steps a second, and this program makes {:.1}",
            run.steps_per_second
        ),
    })
}

pub(super) fn refuse(run: &mut ScenarioRun, fault: ScenarioError) {
    tracing::error!("{fault}");
    run.phase = RunPhase::Refused(fault);
}

fn judge(
    run: ResMut<ScenarioRun>,
    scene: Scene,
    mut events: Events,
    mut told: MessageWriter<ScenarioTold>,
    time: Res<Time>,
) {
    let run = run.into_inner();
    if run.phase != RunPhase::Running {
        events.clear();
        return;
    }
    let has_events_left = run.has_events_left();
    let Some(observed) = &mut run.observed else { return };
    let step = run.step;
    let (facts, mut records) = observed.look(step, time.delta_secs(), &scene, &mut events);
    let is_led = run.replay.as_ref().is_some_and(|replay| replay.leads(step));
    let seen_from =
        scene.eye().map(|eye| CameraRecord { eye_world_m: eye.translation(), world_from_eye: eye.rotation() });
    let eye = run.led_eye.clone().filter(|_| is_led).or(seen_from);
    if eye.is_some() && run.eye != eye {
        // First in its step: a replay looks from there in the same one.
        records.splice(0..0, eye.clone().map(LogRecord::Camera));
        run.eye = eye;
    }
    let (judged, mut end) = run.judge.step(&run.played, &facts);
    run.facts = facts;
    records.extend(judged);
    if end == Some(EndReason::Done) && has_events_left {
        end = None;
    }
    run.chain.take_step(observed, &scene);
    let per_second = run.steps_per_second.round().max(1.0) as u64;
    if (step + 1).is_multiple_of(per_second) {
        let second = (step + 1) / per_second;
        let hash = run.chain.end_second(observed, &scene);
        if let Some(replay) = run.replay.as_mut().filter(|_| is_led) {
            replay.check(second, &hash);
        }
        records.push(LogRecord::Hash(HashRecord { second, hash }));
    }
    let is_over = run.replay.as_ref().is_some_and(|replay| replay.is_over(step));
    if end.is_none() && (run.is_stopped || is_over) {
        end = Some(EndReason::Stopped);
    }
    let is_news = |record: &&LogRecord| matches!(record, LogRecord::Goal(_) | LogRecord::Violation(_));
    let mut shown: Vec<LogRecord> = records.iter().filter(is_news).cloned().collect();
    if let Some(reason) = end {
        let ending = run.judge.end(&run.played, reason);
        shown.extend(ending.iter().cloned());
        records.extend(ending);
    }
    told.write_batch(shown.into_iter().map(|record| ScenarioTold { step, record }));
    let ended = records.last().and_then(|record| match record {
        LogRecord::End(end) => Some(end.clone()),
        _ => None,
    });
    run.write(records.into_iter().map(|record| LogEntry { step, record }).collect());
    run.step += 1;
    if let Some(ended) = ended {
        run.close_log();
        run.phase = RunPhase::Ended(ended);
    }
}
