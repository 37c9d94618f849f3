//! The hand of a log.

use super::ScenarioRun;
use super::log::{CameraRecord, LogRecord, RunLog, ToolSample};
use super::observe::ScenarioEye;
use crate::tools::{BodyForce, Tool, ToolCommand, ToolForce, ToolPose};
use bevy::prelude::*;

/// A log that leads a run.
pub(super) struct Replay {
    log: RunLog,
    /// The step at which another hand takes over.
    until: Option<u64>,
    /// The first entry that has not been looked at.
    next: usize,
    /// The last step that the log has.
    last: u64,
    pub diverged_s: Option<u64>,
}

impl Replay {
    pub fn new(log: RunLog, until: Option<u64>) -> Self {
        let samples = log.entries.iter().filter(|entry| matches!(entry.record, LogRecord::Sample(_)));
        let last = samples.map(|entry| entry.step).max().unwrap_or(0);
        Self { log, until, next: 0, last, diverged_s: None }
    }

    /// Whether the log leads in a step.
    pub fn leads(&self, step: u64) -> bool {
        step <= self.last && self.until.is_none_or(|until| step < until)
    }

    /// Whether the log has ended before a step, and nobody takes over.
    pub fn is_over(&self, step: u64) -> bool {
        self.until.is_none() && step >= self.last
    }

    /// The step after the last one in which the log leads.
    pub fn end(&self) -> u64 {
        self.until.map_or(self.last + 1, |until| until.min(self.last + 1))
    }

    /// How far in the log it is.
    pub fn place(&self) -> usize {
        self.next
    }

    /// Goes on from a place in the log.
    pub fn go_to(&mut self, place: usize) {
        self.next = place;
    }

    /// Steps per second of the log.
    pub fn steps_per_second(&self) -> f64 {
        self.log.header.steps_per_second
    }

    /// What the hand and the eye did in a step; steps are asked for in order.
    fn step(&mut self, step: u64) -> (Vec<ToolSample>, Option<CameraRecord>) {
        let (mut samples, mut eye) = (Vec::new(), None);
        while let Some(entry) = self.log.entries.get(self.next).filter(|entry| entry.step <= step) {
            match &entry.record {
                LogRecord::Sample(sample) if entry.step == step => samples.push(sample.clone()),
                LogRecord::Camera(camera) => eye = Some(camera.clone()),
                _ => {}
            }
            self.next += 1;
        }
        (samples, eye)
    }

    /// Compares the hash of a second with the log's.
    pub fn check(&mut self, second: u64, hash: &str) {
        if self.diverged_s.is_some() {
            return;
        }
        let told = self.log.entries.iter().find_map(|entry| match &entry.record {
            LogRecord::Hash(told) if told.second == second => Some(&told.hash),
            _ => None,
        });
        if told.is_some_and(|told| told != hash) {
            tracing::warn!("the replay is another run from second {second} on");
            self.diverged_s = Some(second);
        }
    }
}

type Led = (&'static mut ToolPose, &'static mut ToolCommand, &'static mut ToolForce);

/// Tools do what the log says; tools that the scenario does not allow lie aside.
pub(super) fn lead_tools(
    run: ResMut<ScenarioRun>,
    mut tools: Query<(Entity, Led), With<Tool>>,
    mut eyes: Query<(&mut Transform, Option<&ChildOf>, &mut GlobalTransform), With<ScenarioEye>>,
) {
    let run = run.into_inner();
    let Some(observed) = &run.observed else { return };
    for (entity, (mut pose, ..)) in &mut tools {
        if !observed.tools.contains(&entity) {
            pose.set_if_neq(ToolPose { is_tracked: false, ..*pose });
        }
    }
    let Some(replay) = run.replay.as_mut().filter(|replay| replay.leads(run.step)) else { return };
    let (samples, eye) = replay.step(run.step);
    for sample in samples {
        let Some(&entity) = observed.tools.get(sample.tool as usize) else { continue };
        let Ok((_, (mut pose, mut command, mut force))) = tools.get_mut(entity) else { continue };
        let mut said = sample.pose;
        if sample.is_dropped {
            said.place.tip_in_world_m = Vec3::NAN;
        }
        *pose = said;
        *command = sample.command;
        let body = |&(body, force_world_n): &(u32, Vec3)| {
            Some(BodyForce { body: *observed.bodies.get(body as usize)?, force_world_n })
        };
        *force = ToolForce {
            is_known: sample.forces_n.is_some(),
            by_body: sample.forces_n.iter().flatten().filter_map(body).collect(),
            drilling_n: sample.drilling_n,
        };
    }
    let Some(eye) = eye else { return };
    run.led_eye = Some(eye.clone());
    let Some((mut transform, parent, mut global)) = eyes.iter_mut().next() else { return };
    let placed = Transform::from_translation(eye.eye_world_m).with_rotation(eye.world_from_eye);
    // What looks at it in this step must see it there.
    *global = placed.into();
    if parent.is_none() {
        *transform = Transform { scale: transform.scale, ..placed };
    }
}
