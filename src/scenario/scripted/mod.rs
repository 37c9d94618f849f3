//! A hand that performs any scenario by itself, well or badly: for tests of scenarios, for demonstrations, and to see whether a
//! score tells one from the other.

mod drilling;
mod plan;
mod skill;
mod touching;

pub use skill::Skill;

use super::{RunPhase, ScenarioRun, ScenarioSystems};
use crate::organ::{Organ, OrganModel, OrganShape};
use crate::schedule::SurgerySystems;
use crate::tools::{SenseDevices, Tool, ToolCommand, ToolPose};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use plan::{Task, plan};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::collections::VecDeque;
use std::f32::consts::TAU;

/// Insert it beside a [`ScenarioRun`], and that is performed.
#[derive(Resource, Clone, Debug)]
pub struct ScriptedHand {
    skill: Skill,
    random: Pcg32,
    tasks: Option<VecDeque<Task>>,
    /// How long the present task has lasted, seconds.
    task_s: f32,
    /// Where the tip is, but for its tremor.
    tip_m: Option<Vec3>,
    touching: touching::Touching,
    drilling: drilling::Drilling,
}

impl ScriptedHand {
    /// A hand with a skill. The same seed does the same.
    pub fn new(skill: Skill, seed: u64) -> Self {
        Self {
            skill,
            random: Pcg32::seed_from_u64(seed ^ 0x5c1e_9e2a),
            tasks: None,
            task_s: 0.0,
            tip_m: None,
            touching: touching::Touching::default(),
            drilling: drilling::Drilling::default(),
        }
    }

    /// Something between -1 and 1.
    fn any(&mut self) -> f32 {
        self.random.random_range(-1.0..=1.0)
    }

    /// The tremor of a moment: two waves an axis, some ten times a second.
    fn tremor_m(&self, time_s: f32) -> Vec3 {
        let wave = |hz: f32, phase: f32| (TAU * (hz * time_s + phase)).sin();
        let axis = |at: f32| 0.6 * wave(8.3 + at, 0.13 * at) + 0.4 * wave(11.1 - 0.7 * at, 0.31 * at);
        Vec3::new(axis(0.0), axis(1.0), axis(2.0)) * self.skill.tremor_m
    }

    /// Goes towards a place for a step; whether it is there.
    fn go(&mut self, to_m: Vec3, speed_m_per_s: f32, dt_s: f32) -> bool {
        let at_m = self.tip_m.unwrap_or(to_m);
        let way_m = to_m - at_m;
        let step_m = speed_m_per_s * dt_s;
        let is_there = way_m.length() <= step_m;
        self.tip_m = Some(if is_there { to_m } else { at_m + way_m.normalize_or_zero() * step_m });
        is_there
    }
}

/// What a hand sees.
#[derive(SystemParam)]
struct Sight<'w, 's> {
    run: Res<'w, ScenarioRun>,
    organs: Query<'w, 's, (&'static Name, &'static Organ, &'static OrganShape, &'static GlobalTransform)>,
    models: Option<Res<'w, Assets<OrganModel>>>,
    time: Res<'w, Time>,
}

/// What it does in a step: with which tool, where, what is pressed. The first is the right hand's.
struct Deed {
    tool: usize,
    pose: ToolPose,
    command: ToolCommand,
}

pub(super) fn build(app: &mut App) {
    app.register_type::<Skill>().add_systems(
        FixedUpdate,
        perform
            .in_set(SurgerySystems::Sense)
            .after(SenseDevices)
            .before(ScenarioSystems::Lead)
            .run_if(resource_exists::<ScriptedHand>.and_then(resource_exists::<ScenarioRun>)),
    );
}

fn perform(mut hand: ResMut<ScriptedHand>, sight: Sight, mut tools: Query<(&Tool, &mut ToolPose, &mut ToolCommand)>) {
    let run = &*sight.run;
    if *run.phase() != RunPhase::Running || run.is_replaying() {
        return;
    }
    let Some(observed) = &run.observed else { return };
    let hand = &mut *hand;
    let (skill, dt_s) = (hand.skill, sight.time.delta_secs());
    let mut tasks = hand.tasks.take().unwrap_or_else(|| plan(run.scenario(), skill.burn_s).into());
    let mut deeds = Vec::new();
    while let Some(task) = tasks.front() {
        let number = observed.logged_tools.iter().position(|tool| task.is_for(&tool.tool.kind));
        let done = match (task, number) {
            // What no instrument can do is left undone.
            (_, None) => true,
            (Task::Touch { .. }, Some(tool)) => touching::touch(hand, task, tool, &sight, &mut deeds, dt_s),
            (Task::Drill { .. }, Some(tool)) => drilling::drill(hand, task, tool, &sight, &mut deeds, dt_s),
        };
        hand.task_s += dt_s;
        if !done {
            break;
        }
        tasks.pop_front();
        hand.task_s = 0.0;
        (hand.touching, hand.drilling) = Default::default();
    }
    hand.tasks = Some(tasks);
    let tremor_m = hand.tremor_m(run.time_s() as f32);
    for (number, &entity) in observed.tools.iter().enumerate() {
        let Ok((_, mut pose, mut command)) = tools.get_mut(entity) else { continue };
        match deeds.iter().find(|deed| deed.tool == number) {
            Some(deed) => {
                let mut shaken = deed.pose;
                shaken.place.tip_in_world_m += tremor_m;
                (*pose, *command) = (shaken, deed.command);
            }
            None => {
                pose.set_if_neq(ToolPose { is_tracked: false, ..*pose });
                command.set_if_neq(ToolCommand::default());
            }
        }
    }
}
