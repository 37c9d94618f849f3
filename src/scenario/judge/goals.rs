//! How far goals are.

use super::{Facts, Targets};
use crate::scenario::{Goal, GoalKind};
use bevy::reflect::Reflect;

/// A goal so far.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct GoalState {
    /// 0 to 1.
    pub progress: f32,
    /// Whether it is reached.
    pub is_reached: bool,
    /// How long something has lasted, seconds: of the whole goal, or of each lesion.
    held_s: Vec<f32>,
    /// How long it has been looked at, and how long of it was good, seconds.
    looked_s: f64,
    good_s: f64,
}

impl GoalState {
    /// Whether a goal can still be lost after it was reached.
    pub(super) fn can_be_lost(kind: &GoalKind) -> bool {
        matches!(kind, GoalKind::StopBleeding { .. } | GoalKind::KeepVisible { .. })
    }

    /// Looks at a step.
    pub(super) fn step(&mut self, goal: &Goal, targets: &Targets, facts: &Facts) {
        if self.is_reached && !Self::can_be_lost(&goal.kind) {
            return;
        }
        let structure = |name: &str| targets.structure(name).and_then(|place| facts.structures.get(place));
        let lesions = || targets.lesions_of(&format!("goal \"{}\"", goal.id)).and_then(|at| facts.lesions.get(at));
        let (progress, is_reached) = match &goal.kind {
            GoalKind::Reach { structure: name, within_m } => {
                let near = structure(name).is_some_and(|facts| {
                    let touches = facts.is_touched.iter().any(|&touches| touches);
                    touches || facts.distance_m.iter().flatten().any(|distance| distance <= within_m)
                });
                (f32::from(u8::from(near)), near)
            }
            GoalKind::Expose { structure: name, share, .. } => {
                let Some(exposed) = structure(name).and_then(|facts| facts.exposed_share) else { return };
                (exposed / share, exposed >= *share)
            }
            GoalKind::Remove { structure: name, share } => {
                let removed = structure(name).map_or(0.0, |facts| facts.removed_share);
                (removed / share, removed >= *share)
            }
            GoalKind::Mark { for_s, .. } => {
                let Some(lesions) = lesions() else { return };
                self.held_s.resize(lesions.is_touched.len(), 0.0);
                for (held_s, _) in self.held_s.iter_mut().zip(&lesions.is_touched).filter(|(_, touched)| **touched) {
                    *held_s += facts.dt_s;
                }
                // A sum of steps is a hair less than the time that they take together.
                let enough_s = for_s - 0.5 * facts.dt_s;
                let done = self.held_s.iter().filter(|held_s| **held_s > 0.0 && **held_s >= enough_s).count();
                (done as f32 / self.held_s.len().max(1) as f32, done == self.held_s.len())
            }
            GoalKind::Coagulate { share, .. } => {
                let Some(lesions) = lesions() else { return };
                let parts = lesions.coagulated.iter().map(|coagulated| (coagulated / share).min(1.0));
                let progress = parts.sum::<f32>() / lesions.coagulated.len().max(1) as f32;
                (progress, lesions.coagulated.iter().all(|coagulated| coagulated >= share))
            }
            GoalKind::StopBleeding { below_ml_s, for_s } => {
                self.held_s.resize(1, 0.0);
                let is_still = facts.bleeding_ml_s <= f64::from(*below_ml_s);
                self.held_s[0] = if is_still { self.held_s[0] + facts.dt_s } else { 0.0 };
                let done = is_still && self.held_s[0] >= for_s - 0.5 * facts.dt_s;
                (if done { 1.0 } else { (self.held_s[0] / for_s.max(1e-6)).min(0.99) }, done)
            }
            GoalKind::KeepVisible { share, of_time } => {
                if let Some(hidden) = facts.hidden {
                    self.looked_s += f64::from(facts.dt_s);
                    self.good_s += if 1.0 - hidden >= *share { f64::from(facts.dt_s) } else { 0.0 };
                }
                // Where nothing hides anything, all can be seen.
                let kept = if self.looked_s > 0.0 { (self.good_s / self.looked_s) as f32 } else { 1.0 };
                (kept / of_time, kept >= *of_time)
            }
        };
        self.progress = if is_reached { 1.0 } else { progress.clamp(0.0, 0.999) };
        if self.progress.is_nan() {
            self.progress = 0.0;
        }
        self.is_reached = is_reached;
    }
}
