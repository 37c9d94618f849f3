//! What a scenario names, in one list: so that a step looks at each thing once.

use crate::scenario::{GoalKind, Lesion, RuleKind, Scenario};
use bevy::reflect::Reflect;

/// Structures and sets of lesions that goals and rules name.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct Targets {
    /// Structures, in the order in which they are named first.
    pub structures: Vec<TargetStructure>,
    /// Sets of lesions, by goal, then by rule.
    pub lesions: Vec<TargetLesions>,
}

/// A structure that is named.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct TargetStructure {
    /// Its name.
    pub name: String,
    /// Who names it first, as errors say: `goal "antrum"`.
    pub named_by: String,
    /// How far away anyone asks for its distance, metres.
    pub band_m: f32,
    /// How much may cover it where it counts as seen, metres; none where nobody asks.
    pub cover_m: Option<f32>,
}

/// A set of lesions on an organ.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct TargetLesions {
    /// The organ's name.
    pub organ: String,
    /// Who names it.
    pub named_by: String,
    /// The lesions.
    pub lesions: Vec<Lesion>,
}

impl Targets {
    /// Of a scenario.
    pub fn of(scenario: &Scenario) -> Self {
        let mut targets = Self::default();
        for goal in &scenario.goals {
            let by = || format!("goal \"{}\"", goal.id);
            match &goal.kind {
                GoalKind::Reach { structure, within_m } => targets.name(structure, by(), *within_m, None),
                GoalKind::Expose { structure, cover_m, .. } => targets.name(structure, by(), 0.0, Some(*cover_m)),
                GoalKind::Remove { structure, .. } => targets.name(structure, by(), 0.0, None),
                GoalKind::Mark { organ, lesions, .. } | GoalKind::Coagulate { organ, lesions, .. } => {
                    targets.lesions(organ, by(), lesions);
                }
                GoalKind::StopBleeding { .. } | GoalKind::KeepVisible { .. } => {}
            }
        }
        for rule in &scenario.rules {
            let by = || format!("rule \"{}\"", rule.id);
            match &rule.kind {
                RuleKind::Touch { structure } | RuleKind::Cut { structure, .. } => {
                    targets.name(structure, by(), 0.0, None);
                }
                RuleKind::Force { structure, within_m, .. }
                | RuleKind::Speed { structure, within_m, .. }
                | RuleKind::Near { structure, within_m }
                | RuleKind::BurrTooLarge { structure, within_m, .. } => {
                    targets.name(structure, by(), *within_m, None);
                }
                RuleKind::BurntOutside { organ, lesions, .. } => targets.lesions(organ, by(), lesions),
                RuleKind::DrilledUnseen { .. }
                | RuleKind::Collision
                | RuleKind::BloodLoss { .. }
                | RuleKind::OutOfTime => {}
            }
        }
        targets
    }

    /// The place of a structure in the list.
    pub fn structure(&self, name: &str) -> Option<usize> {
        self.structures.iter().position(|structure| structure.name == name)
    }

    /// The place of a set of lesions.
    pub fn lesions_of(&self, named_by: &str) -> Option<usize> {
        self.lesions.iter().position(|lesions| lesions.named_by == named_by)
    }

    fn name(&mut self, name: &str, named_by: String, band_m: f32, cover_m: Option<f32>) {
        let place = self.structure(name).unwrap_or_else(|| {
            let new = TargetStructure { name: name.into(), named_by, band_m: 0.0, cover_m: None };
            self.structures.push(new);
            self.structures.len() - 1
        });
        let known = &mut self.structures[place];
        known.band_m = known.band_m.max(band_m);
        // Of two covers the thicker one would let pass what the thinner one asks for.
        known.cover_m = match (known.cover_m, cover_m) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        };
    }

    fn lesions(&mut self, organ: &str, named_by: String, lesions: &[Lesion]) {
        self.lesions.push(TargetLesions { organ: organ.into(), named_by, lesions: lesions.to_vec() });
    }
}
