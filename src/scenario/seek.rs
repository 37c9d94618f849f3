//! Going to any moment of a replay, forwards and backwards.
//!
//! Forwards its steps are performed as fast as they can, a share of each frame. Backwards the state of a moment before is put back,
//! of which copies are kept every few seconds ([`Checkpoint`]), and it goes forwards from there.

use super::hash::HashChain;
use super::judge::{Facts, Judge};
use super::log::CameraRecord;
use super::observe::Observed;
use super::{RunPhase, ScenarioError, ScenarioRun};
use crate::checkpoint::Checkpoint;
use bevy::app::FixedMain;
use bevy::prelude::*;
use std::time::{Duration, Instant};

/// For so long the steps of a frame are performed; the rest of the frame draws and answers.
const BUDGET: Duration = Duration::from_millis(25);
/// Seconds between two checkpoints at first.
const EVERY_S: f64 = 4.0;
/// Most checkpoints of a run, and most bytes of all of them; beyond that every second one goes.
const MOST: usize = 64;
const MOST_BYTES: usize = 512 << 20;

/// Where a replay is led to.
pub(super) struct Seek {
    target: u64,
    /// Whether the checkpoint from which it goes forwards has been chosen.
    has_begun: bool,
    /// Whether the steps that run now are those that lead there.
    is_performing: bool,
}

/// What a run knows of itself at a moment.
#[derive(Clone)]
struct RunState {
    step: u64,
    judge: Judge,
    observed: Option<Observed>,
    chain: HashChain,
    facts: Facts,
    eye: Option<CameraRecord>,
    led_eye: Option<CameraRecord>,
    place_in_log: usize,
}

struct Moment {
    run: RunState,
    world: Checkpoint,
    bytes: usize,
}

/// Moments of a replay to go back to, the first one that of its beginning.
pub(super) struct Checkpoints {
    list: Vec<Moment>,
    every_s: f64,
}

impl Default for Checkpoints {
    fn default() -> Self {
        Self { list: Vec::new(), every_s: EVERY_S }
    }
}

impl Checkpoints {
    /// Whether the moment before a step is to be kept.
    fn wants(&self, step: u64, steps_per_second: f64) -> bool {
        let every = (self.every_s * steps_per_second).round().max(1.0) as u64;
        step.is_multiple_of(every) && self.list.iter().all(|moment| moment.run.step != step)
    }

    fn add(&mut self, moment: Moment) {
        let place = self.list.partition_point(|before| before.run.step < moment.run.step);
        self.list.insert(place, moment);
        while self.list.len() > MOST || self.bytes() > MOST_BYTES && self.list.len() > 1 {
            let mut place = 0;
            self.list.retain(|_| {
                place += 1;
                place % 2 == 1
            });
            self.every_s *= 2.0;
        }
    }

    fn bytes(&self) -> usize {
        self.list.iter().map(|moment| moment.bytes).sum()
    }

    /// The one from which it is least far to a step, if it is less far than from where the run is.
    fn nearest(&self, target: u64, now: u64) -> Option<&Moment> {
        let before = self.list.partition_point(|moment| moment.run.step <= target).checked_sub(1)?;
        self.list.get(before).filter(|moment| target < now || moment.run.step > now)
    }
}

impl ScenarioRun {
    /// Goes to a time of a replay, forwards or backwards: over the next frames, also while [`Time<Virtual>`] is paused; how far it is
    /// says [`time_s`](Self::time_s), and [`seeking_to`](Self::seeking_to) until it is there. From there on it is performed as it would have
    /// been: the same to the bit. A time behind the replay's end means its end. Another call before it is there takes the place of this
    /// one.
    ///
    /// Forwards that takes as long as the steps between take; backwards no longer than those from one of its checkpoints, which it makes every
    /// few seconds while it is performed. An app whose own steps keep state names that
    /// ([`KeepState`](crate::checkpoint::KeepState)). Fluid that the GPU moves cannot be gone back to, and goes on as it is; that of the scenarios' own
    /// scenes is moved by the processor. A log that is written holds each step once, however often it was performed.
    ///
    /// # Errors
    /// The run replays nothing, it was refused, another hand has taken over, or the time is none.
    pub fn seek_to(&mut self, time_s: f64) -> Result<(), ScenarioError> {
        let refuse = |reason: &str| {
            Err(ScenarioError::Field { file: self.file.clone(), field: "seek to".into(), reason: reason.into() })
        };
        let Some(replay) = &self.replay else {
            return refuse("the run replays no log: only what has been performed can be gone to");
        };
        if let RunPhase::Refused(fault) = &self.phase {
            return Err(fault.clone());
        }
        if self.step > replay.end() {
            return refuse("another hand has taken over");
        }
        if !(time_s.is_finite() && time_s >= 0.0) {
            return refuse(&format!("{time_s} s is no time of a run"));
        }
        let target = ((time_s * replay.steps_per_second()).round() as u64).min(replay.end());
        self.seek = Some(Seek { target, has_begun: false, is_performing: false });
        Ok(())
    }

    /// The time to which the run is being led by [`seek_to`](Self::seek_to), seconds; none when it is there.
    pub fn seeking_to(&self) -> Option<f64> {
        let (seek, replay) = self.seek.as_ref().zip(self.replay.as_ref())?;
        Some(seek.target as f64 / replay.steps_per_second())
    }

    /// Of a replay, how long the log leads, seconds.
    pub fn replay_length_s(&self) -> Option<f64> {
        self.replay.as_ref().map(|replay| replay.end() as f64 / replay.steps_per_second())
    }

    /// Whether the world stands still between the frames in which the run is led elsewhere.
    pub(super) fn is_held(&self) -> bool {
        self.seek.as_ref().is_some_and(|seek| !seek.is_performing)
    }

    fn state(&self) -> RunState {
        RunState {
            step: self.step,
            judge: self.judge.clone(),
            observed: self.observed.clone(),
            chain: self.chain.clone(),
            facts: self.facts.clone(),
            eye: self.eye.clone(),
            led_eye: self.led_eye.clone(),
            place_in_log: self.replay.as_ref().map_or(0, |replay| replay.place()),
        }
    }

    fn restore(&mut self, state: RunState) {
        let RunState { step, judge, observed, chain, facts, eye, led_eye, place_in_log } = state;
        (self.step, self.judge, self.observed, self.chain) = (step, judge, observed, chain);
        (self.facts, self.eye, self.led_eye) = (facts, eye, led_eye);
        (self.phase, self.is_stopped) = (RunPhase::Running, false);
        if let Some(replay) = &mut self.replay {
            replay.go_to(place_in_log);
        }
    }
}

/// Keeps the moment before a step of a replay, every few seconds.
pub(super) fn keep_checkpoint(world: &mut World) {
    let Some(run) = world.get_resource::<ScenarioRun>() else { return };
    let is_led = run.replay.as_ref().is_some_and(|replay| replay.leads(run.step));
    let is_due = is_led && run.phase == RunPhase::Running && !run.is_held();
    if !is_due || !run.checkpoints.wants(run.step, run.steps_per_second) {
        return;
    }
    let begun = Instant::now();
    let state = run.state();
    let copy = Checkpoint::take(world);
    let bytes = copy.bytes() + state.observed.as_ref().map_or(0, Observed::bytes);
    let taken_ms = begun.elapsed().as_secs_f64() * 1e3;
    tracing::debug!("checkpoint before step {}: {} KiB in {taken_ms:.1} ms", state.step, bytes >> 10);
    if let Some(mut run) = world.get_resource_mut::<ScenarioRun>() {
        run.checkpoints.add(Moment { run: state, world: copy, bytes });
    }
}

/// Leads a run to where it is wanted, as far as it gets in a frame.
pub(super) fn seek(world: &mut World) {
    let begun = Instant::now();
    world.resource_scope(|world, mut run: Mut<ScenarioRun>| choose_moment(world, &mut run));
    while is_on_its_way(world) {
        perform_step(world);
        if begun.elapsed() >= BUDGET {
            break;
        }
    }
    *world.resource_mut::<Time>() = world.resource::<Time<Virtual>>().as_generic();
}

/// Goes to the checkpoint from which it goes forwards.
fn choose_moment(world: &mut World, run: &mut ScenarioRun) {
    let now = run.step;
    let is_ready = !matches!(run.phase, RunPhase::Waiting | RunPhase::Refused(_));
    let Some(seek) = run.seek.as_mut().filter(|seek| is_ready && !seek.has_begun) else { return };
    seek.has_begun = true;
    let Some(moment) = run.checkpoints.nearest(seek.target, now) else { return };
    moment.world.restore(world);
    let state = moment.run.clone();
    run.restore(state);
}

/// Whether steps are to be performed; ends what is there.
fn is_on_its_way(world: &mut World) -> bool {
    // A step may have taken the run away.
    let Some(mut run) = world.get_resource_mut::<ScenarioRun>() else { return false };
    let Some(seek) = &run.seek else { return false };
    if run.phase == RunPhase::Waiting {
        // Its scene is still being loaded.
        return false;
    }
    let goes_on = run.phase == RunPhase::Running && run.step < seek.target;
    if !goes_on {
        run.seek = None;
    }
    goes_on
}

/// Performs a step beside those for which Bevy's clock asks.
fn perform_step(world: &mut World) {
    let set_performing = |world: &mut World, is_performing: bool| {
        if let Some(seek) = world.get_resource_mut::<ScenarioRun>().and_then(|run| run.into_inner().seek.as_mut()) {
            seek.is_performing = is_performing;
        }
    };
    set_performing(world, true);
    let mut clock = world.resource_mut::<Time<Fixed>>();
    let timestep = clock.timestep();
    clock.advance_by(timestep);
    *world.resource_mut::<Time>() = world.resource::<Time<Fixed>>().as_generic();
    world.run_schedule(FixedMain);
    set_performing(world, false);
}

#[cfg(test)]
mod tests {
    use super::super::Scenario;
    use super::*;

    fn moment(step: u64, bytes: usize) -> Moment {
        let text = r#"(version: 1, name: "a", goals: [(id: "b", kind: Reach(structure: "c", within_m: 0.0))])"#;
        let scenario = Scenario::from_bytes(text.as_bytes(), "a").expect("it is good");
        let run = RunState { step, ..ScenarioRun::new(scenario).state() };
        Moment { run, world: Checkpoint::take(&mut World::new()), bytes }
    }

    fn steps(of: &Checkpoints) -> Vec<u64> {
        of.list.iter().map(|moment| moment.run.step).collect()
    }

    /// Those of a run at 60 steps a second.
    fn of_run(seconds: u64, bytes: usize) -> Checkpoints {
        let mut kept = Checkpoints::default();
        for step in 0..=seconds * 60 {
            if kept.wants(step, 60.0) {
                kept.add(moment(step, bytes));
            }
        }
        kept
    }

    #[test]
    fn they_are_bounded_in_number_and_in_bytes() {
        assert_eq!(steps(&of_run(20, 1)), [0, 240, 480, 720, 960, 1200]);
        let long = of_run(3600, 1);
        let kept = steps(&long);
        assert!((MOST / 2..=MOST).contains(&kept.len()), "{}", kept.len());
        assert_eq!(long.every_s, 64.0);
        // Evenly, from the beginning on.
        assert!(kept.iter().enumerate().all(|(place, step)| *step == place as u64 * 64 * 60), "{kept:?}");
        let large = of_run(600, MOST_BYTES / 5);
        assert!((3..=5).contains(&large.list.len()) && steps(&large)[0] == 0, "{:?}", steps(&large));
        assert!(large.bytes() <= MOST_BYTES);
        // Of those that are each too large the first stays: the way from the beginning is always there.
        assert_eq!(steps(&of_run(60, 2 * MOST_BYTES)), [0]);
    }

    #[test]
    fn the_nearest_before_is_taken_if_it_is_worth_it() {
        let kept = of_run(20, 1);
        let nearest = |target, now| kept.nearest(target, now).map(|moment| moment.run.step);
        assert_eq!(nearest(500, 1200), Some(480), "backwards");
        assert_eq!(nearest(480, 480), None, "it is there");
        assert_eq!(nearest(479, 480), Some(240));
        assert_eq!(nearest(700, 490), None, "forwards from where it is");
        assert_eq!(nearest(730, 490), Some(720), "forwards over one that has been performed");
        assert_eq!(nearest(5000, 490), Some(1200));
        assert!(Checkpoints::default().nearest(5, 9).is_none());
    }
}
