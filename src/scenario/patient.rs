//! Patients: how one differs from another, and what happens in them.

use super::{GoalKind, Lesion, PatientEventKind, RuleKind, Scenario, ScenarioRun};
use crate::organ::sphere::SurfacePoint;
use crate::organ::{Organ, OrganModel, OrganShape};
use crate::reactions::kind::KindId;
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

/// Lesions that are shown in a step: an organ takes a bounded number of touches.
const LESIONS_PER_STEP: usize = 3;
/// Spots at the rim of a lesion, so that it is not round.
const LOBES: usize = 6;

impl Scenario {
    /// The lesions that are to be found, each once, with the organs that they are on.
    fn lesions(&self) -> Vec<(&str, Lesion)> {
        let mut all: Vec<(&str, Lesion)> = Vec::new();
        for goal in &self.goals {
            let (GoalKind::Mark { organ, lesions, .. } | GoalKind::Coagulate { organ, lesions, .. }) = &goal.kind
            else {
                continue;
            };
            for lesion in lesions {
                if !all.contains(&(organ, *lesion)) {
                    all.push((organ, *lesion));
                }
            }
        }
        all
    }
}

/// Draws the lesions on their organs in a run's first steps.
pub(super) fn show_lesions(
    run: Res<ScenarioRun>,
    organs: Query<(Entity, &Name, &Organ, &OrganShape)>,
    models: Option<Res<Assets<OrganModel>>>,
    mut touches: MessageWriter<OrganTouch>,
) {
    let (Some(models), Some(step)) = (models, run.running_step()) else { return };
    let lesions = run.played.lesions();
    for (wanted, lesion) in lesions.into_iter().skip(step as usize * LESIONS_PER_STEP).take(LESIONS_PER_STEP) {
        for (entity, name, organ, shape) in &organs {
            let Some(model) = models.get(&organ.0).filter(|model| name.as_str() == wanted && shape.is_of(model)) else {
                continue;
            };
            for (point, radius_m) in spots(&lesion, model, shape) {
                let action = ReactionAction::Start { kind: KindId::NODULE, radius_m, volume_m3: 0.0 };
                touches.write(OrganTouch { organ: entity, point, instrument: u32::MAX, action });
            }
        }
    }
}

/// A lesion as a spot in its middle and smaller ones round it, within its radius; another shape for each place.
fn spots(lesion: &Lesion, model: &OrganModel, shape: &OrganShape) -> Vec<(SurfacePoint, f32)> {
    let Some(middle) = model.atlas.locate_uv(lesion.uv.as_dvec2(), &model.table) else { return Vec::new() };
    let frame = model.surface(shape).frame(middle);
    let mut random = Pcg32::seed_from_u64(u64::from(lesion.uv.x.to_bits()) << 32 | u64::from(lesion.uv.y.to_bits()));
    let mut spots = vec![(middle, 0.8 * lesion.radius_m)];
    let (along, across) = frame.normal.any_orthonormal_pair();
    for lobe in 0..LOBES {
        let turn = std::f64::consts::TAU * (lobe as f64 + random.random_range(-0.4..0.4)) / LOBES as f64;
        let radius_m = lesion.radius_m * random.random_range(0.3..0.45);
        let away_m = f64::from(lesion.radius_m - radius_m);
        let by = frame.uv_velocity(away_m * (turn.cos() * along + turn.sin() * across));
        spots.extend(model.atlas.locate_uv(frame.uv + by, &model.table).map(|point| (point, radius_m)));
    }
    spots
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
