//! Patients: how one differs from another, and what happens in them.

use super::{GoalKind, Lesion, PatientEventKind, RuleKind, Scenario, ScenarioRun};
use crate::organ::{Organ, OrganModel, OrganShape};
use crate::reactions::{OrganTouch, ReactionAction};
use bevy::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// How far places differ at most between patients, in texture coordinates.
const MOST_SHIFT: f32 = 0.04;
/// By how much rates of bleeding and sizes differ at most, as a share.
const MOST_SHARE: f32 = 0.4;

impl Scenario {
    /// The scenario for one patient: places and sizes of lesions, places and rates of what bleeds are another's. The same seed gives
    /// the same patient; without [variation](super::PatientVariation::amount) all are alike.
    pub fn for_patient(&self, seed: u64) -> Self {
        let mut scenario = self.clone();
        scenario.patient.seed = seed;
        let amount = self.patient.amount;
        if amount <= 0.0 {
            return scenario;
        }
        let mut random = Pcg32::seed_from_u64(seed);
        let mut shifts = Shifts { random: &mut random, amount };
        // Lesions that are named twice, to be marked and then coagulated, are the same lesions.
        let mut moved: Vec<(Lesion, Lesion)> = Vec::new();
        let lesions = scenario.goals.iter_mut().filter_map(|goal| match &mut goal.kind {
            GoalKind::Mark { lesions, .. } | GoalKind::Coagulate { lesions, .. } => Some(lesions),
            _ => None,
        });
        let forbidden = scenario.rules.iter_mut().filter_map(|rule| match &mut rule.kind {
            RuleKind::BurntOutside { lesions, .. } => Some(lesions),
            _ => None,
        });
        for lesion in lesions.chain(forbidden).flatten() {
            let known = moved.iter().find(|(before, _)| before.uv == lesion.uv);
            let (shift, share) = match known {
                Some((before, after)) => (after.uv - before.uv, after.radius_m / before.radius_m),
                None => (shifts.shift(), shifts.share()),
            };
            let before = *lesion;
            lesion.uv = (lesion.uv + shift).clamp(Vec2::ZERO, Vec2::ONE);
            lesion.radius_m *= share;
            if known.is_none() {
                moved.push((before, *lesion));
            }
        }
        for event in &mut scenario.events {
            let PatientEventKind::Bleed { uv, wound, .. } = &mut event.what;
            *uv = (*uv + shifts.shift()).clamp(Vec2::ZERO, Vec2::ONE);
            wound.rate_m3_per_s *= f64::from(shifts.share());
        }
        scenario
    }
}

struct Shifts<'a> {
    random: &'a mut Pcg32,
    amount: f32,
}

impl Shifts<'_> {
    fn shift(&mut self) -> Vec2 {
        let mut part = || self.random.random_range(-MOST_SHIFT..=MOST_SHIFT) * self.amount;
        Vec2::new(part(), part())
    }

    fn share(&mut self) -> f32 {
        1.0 + self.random.random_range(-MOST_SHARE..=MOST_SHARE) * self.amount
    }
}

/// What happens in the patient in this step.
pub(super) fn let_happen(
    run: Res<ScenarioRun>,
    organs: Query<(Entity, &Name, &Organ, &OrganShape)>,
    models: Option<Res<Assets<OrganModel>>>,
    mut touches: MessageWriter<OrganTouch>,
) {
    let (Some(models), Some(step)) = (models, run.running_step()) else { return };
    for event in run.played.events.iter().filter(|event| run.step_of(event.at_s) == step) {
        let PatientEventKind::Bleed { organ: wanted, uv, wound } = &event.what;
        for (entity, name, organ, shape) in &organs {
            let model = models.get(&organ.0).filter(|model| name.as_str() == wanted && shape.is_of(model));
            let Some(point) = model.and_then(|model| model.atlas.locate_uv(uv.as_dvec2(), &model.table)) else {
                continue;
            };
            let action = ReactionAction::Wound(*wound);
            touches.write(OrganTouch { organ: entity, point, instrument: u32::MAX, action });
        }
    }
}
