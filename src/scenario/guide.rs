//! What a trainee is told while at work: warnings, meters, what comes next.
//!
//! Guidance that is always on does not teach (Andersen 2020): a scenario switches each kind, and the trainee or the program all of
//! it.

use super::{GoalKind, Guidance, RuleKind, RunPhase, ScenarioRun};
use bevy::prelude::*;

/// How near a critical structure is warned of, metres: the bands that experts name.
const NEAR_M: [f32; 2] = [2e-3, 4e-3];
/// Share of a limit of force from which on it is warned of.
const FORCE_SHARE: f32 = 0.8;

/// The guidance of the run that is performed. Written in [`ScenarioSystems::Judge`](super::ScenarioSystems::Judge).
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct Guide {
    /// Whether anything is told at all.
    pub is_on: bool,
    /// What comes next: the title of the first goal that is not reached.
    pub next_step: Option<String>,
    /// How far the nearest critical structure is from any tip, metres, where it is within 4 mm.
    pub critical_m: Option<f32>,
    /// The greatest force of any instrument, as a share of the least limit that a rule sets, where it is near that.
    pub force_share: Option<f32>,
    /// What was removed, mm³, and the share of it that goals ask for.
    pub removed: Option<(f32, f32)>,
    /// Share of the field that can be seen.
    pub visible: Option<f32>,
}

impl Default for Guide {
    fn default() -> Self {
        Self { is_on: true, next_step: None, critical_m: None, force_share: None, removed: None, visible: None }
    }
}

impl Guide {
    /// What is to be told, one thing a line; nothing where the guidance is off.
    pub fn lines(&self) -> Vec<String> {
        if !self.is_on {
            return Vec::new();
        }
        let mut lines = Vec::new();
        if let Some(critical_m) = self.critical_m {
            let urgent = if critical_m <= NEAR_M[0] { "Careful: " } else { "" };
            lines.push(format!("{urgent}{:.1} mm to a critical structure", critical_m * 1e3));
        }
        if let Some(share) = self.force_share {
            lines.push(format!("Force: {:.0} % of the limit", share * 100.0));
        }
        if let Some((mm3, share)) = self.removed {
            lines.push(format!("Removed: {mm3:.0} mm3, {:.0} % of the goal", share * 100.0));
        }
        if let Some(visible) = self.visible {
            lines.push(format!("In sight: {:.0} %", visible * 100.0));
        }
        lines.extend(self.next_step.as_ref().map(|next| format!("Next: {next}")));
        lines
    }
}

/// Looks at the step that has been judged.
pub(super) fn guide(run: Res<ScenarioRun>, mut guide: ResMut<Guide>) {
    let is_running = *run.phase() == RunPhase::Running;
    let Guidance { is_on, distances, forces, removed, visibility, next_step } = run.scenario().guidance;
    let mut told = Guide { is_on: guide.is_on, ..Guide::default() };
    if is_on && is_running {
        let facts = run.facts();
        let nearest_m = facts.tools.iter().filter_map(|tool| tool.critical_m).reduce(f32::min);
        told.critical_m = nearest_m.filter(|near_m| distances && *near_m <= NEAR_M[1]);
        let limits = run.scenario().rules.iter().filter_map(|rule| match rule.kind {
            RuleKind::Force { above_n, .. } if above_n > 0.0 => Some(above_n),
            _ => None,
        });
        let greatest_n = facts.tools.iter().map(|tool| tool.force_n).fold(0.0, f32::max);
        let share = limits.reduce(f32::min).map(|limit_n| greatest_n / limit_n);
        told.force_share = share.filter(|share| forces && *share >= FORCE_SHARE);
        let targets = run.judge().targets();
        told.removed = run.scenario().goals.iter().zip(run.goals()).find_map(|(goal, state)| {
            let GoalKind::Remove { structure, .. } = &goal.kind else { return None };
            let facts = facts.structures.get(targets.structure(structure)?)?;
            removed.then_some((facts.removed_mm3, state.progress))
        });
        told.visible = facts.hidden.filter(|_| visibility).map(|hidden| 1.0 - hidden);
        let open = (run.scenario().goals.iter().zip(run.goals()).enumerate())
            .find(|(place, (_, state))| !state.is_reached && run.judge().is_open(run.scenario(), *place));
        told.next_step = open.map(|(_, (goal, _))| goal.title.clone()).filter(|title| next_step && !title.is_empty());
    }
    guide.set_if_neq(told);
}
