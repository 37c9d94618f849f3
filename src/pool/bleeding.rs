//! Places that bleed (paper of 2009, section 8): vessels that were opened bleed until they are sealed, packed, clotted, or
//! have no pressure left.

use super::Pool;
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use crate::volume::structures::Tissue;
use crate::volume::{CtVolume, Volume, VoxelsRemoved};
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// What was done about a bleeder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum BleedingControl {
    /// Nothing: it bleeds.
    #[default]
    Open,
    /// Packed: it bleeds again when the packing is taken out.
    Packed,
    /// Cauterized, for good.
    Cauterized,
}

/// A place that bleeds into the pool around it. On an entity with a transform, which for what a burr opened is a child of the
/// volume.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
pub struct Bleeder {
    /// Blood per second at full pressure with nothing clotted, millilitres.
    pub rate_ml_s: f32,
    /// Pressure in the vessel before it bled, millimetres of mercury.
    pub full_pressure_mmhg: f32,
    /// Pressure now; without any it no longer bleeds.
    pub pressure_mmhg: f32,
    /// Blood after whose loss no pressure is left, millilitres.
    pub reserve_ml: f32,
    /// Time in which what runs falls to 1/e by clotting, seconds; infinite where nothing clots. Grows with the vessel.
    pub clotting_s: f32,
    /// What was done about it.
    pub control: BleedingControl,
    /// Share that is still open.
    pub open_share: f32,
    /// Blood that it has lost, millilitres.
    pub lost_ml: f64,
    /// The structure's label, 0 for none.
    pub label: u8,
}

impl Default for Bleeder {
    /// A small vein.
    fn default() -> Self {
        Self {
            rate_ml_s: 0.05,
            full_pressure_mmhg: 12.0,
            pressure_mmhg: 12.0,
            reserve_ml: 400.0,
            clotting_s: 90.0,
            control: BleedingControl::Open,
            open_share: 1.0,
            lost_ml: 0.0,
            label: 0,
        }
    }
}

/// Millimetres of mercury under a metre of blood, or of the water over it, which is as good as the same.
const MMHG_PER_M: f32 = 1e3 * 9.81 / 133.322;

impl Bleeder {
    /// Blood that runs now under so much fluid, millilitres per second.
    pub fn flow_ml_s(&self, depth_m: f32) -> f32 {
        if self.control != BleedingControl::Open || !(self.rate_ml_s > 0.0 && self.full_pressure_mmhg > 0.0) {
            return 0.0;
        }
        let pressure = (self.pressure_mmhg - depth_m.max(0.0) * MMHG_PER_M).max(0.0);
        let flow = self.rate_ml_s * self.open_share.clamp(0.0, 1.0) * pressure / self.full_pressure_mmhg;
        if flow.is_finite() { flow } else { 0.0 }
    }

    /// Bleeds for so many seconds; returns the blood in millilitres.
    pub fn bleed(&mut self, depth_m: f32, step_s: f32) -> f64 {
        let lost_ml = f64::from(self.flow_ml_s(depth_m) * step_s);
        if lost_ml > 0.0 {
            self.lost_ml += lost_ml;
            if self.reserve_ml > 0.0 {
                let lost_mmhg = self.full_pressure_mmhg * (lost_ml as f32 / self.reserve_ml);
                self.pressure_mmhg = (self.pressure_mmhg - lost_mmhg).max(0.0);
            }
            // What is under packing or sealed does not run, and what runs clots.
            if self.clotting_s > 0.0 {
                self.open_share *= (-step_s / self.clotting_s).exp();
            }
        }
        lost_ml
    }
}

/// How tissue bleeds that a burr has opened. Beside a [`Pool`]; rates are those of the volume's structures.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[serde(default)]
pub struct BleedingRules {
    /// Seconds for which cut tissue that is no vessel oozes; what it lets out in them enters at once.
    pub ooze_s: f32,
    /// Pressure in vessels, millimetres of mercury.
    pub vessel_pressure_mmhg: f32,
    /// Blood after whose loss a vessel has no pressure left, millilitres.
    pub vessel_reserve_ml: f32,
    /// Time in which a vessel clots to 1/e if it lets out a tenth of a millilitre per second, seconds. Larger ones take longer in
    /// proportion.
    pub clotting_s: f32,
    /// A vessel that was opened nearer than that to a place where it bleeds already is opened wider there, metres.
    pub merge_m: f32,
    /// The most that one place lets out, millilitres per second.
    pub most_ml_s: f32,
}

impl Default for BleedingRules {
    fn default() -> Self {
        Self {
            ooze_s: 20.0,
            vessel_pressure_mmhg: 12.0,
            vessel_reserve_ml: 400.0,
            clotting_s: 60.0,
            merge_m: 4e-3,
            most_ml_s: 8.0,
        }
    }
}

/// Does something about all bleeders around a place. Written before [`SurgerySystems::Flow`].
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct TreatBleeders {
    /// The place in the world, metres.
    pub place_world_m: Vec3,
    /// How far it reaches, metres.
    pub radius_m: f32,
    /// What is done. Cauterized ones stay so.
    pub control: BleedingControl,
}

/// A burr has opened a vessel, or one that bled already wider. Written in [`SurgerySystems::React`].
#[derive(Message, Clone, Copy, Debug, PartialEq, Reflect)]
pub struct VesselOpened {
    /// The bleeder.
    pub bleeder: Entity,
    /// The volume.
    pub volume: Entity,
    /// The vessel's label.
    pub label: u8,
    /// Where, in the world, metres.
    pub place_world_m: Vec3,
    /// By how much more it bleeds now, millilitres per second.
    pub more_ml_s: f32,
}

pub(super) fn build(app: &mut App) {
    app.register_type::<Bleeder>()
        .register_type::<BleedingControl>()
        .register_type::<BleedingRules>()
        .register_type::<TreatBleeders>()
        .register_type::<VesselOpened>()
        .add_message::<TreatBleeders>()
        .add_message::<VesselOpened>()
        .keep_births::<Bleeder>()
        .add_systems(FixedUpdate, (open_vessels, treat).chain().in_set(SurgerySystems::React));
}

/// What was removed of vessels bleeds from now on.
fn open_vessels(
    mut commands: Commands,
    mut removals: MessageReader<VoxelsRemoved>,
    mut opened: MessageWriter<VesselOpened>,
    bodies: Query<(&CtVolume, &GlobalTransform)>,
    volumes: Res<Assets<Volume>>,
    pools: Query<(&Pool, &BleedingRules)>,
    mut bleeders: Query<(Entity, &mut Bleeder, &Transform, &ChildOf)>,
) {
    // Vessels opened twice in one step are not yet to be found by the query.
    let mut fresh: Vec<(Entity, Entity, Vec3, Bleeder)> = Vec::new();
    for removal in removals.read() {
        let Ok((body, world_from_volume)) = bodies.get(removal.volume) else { continue };
        let Some(rules) = pools.iter().find(|(pool, _)| pool.volume == removal.volume).map(|(_, rules)| rules) else {
            continue;
        };
        let Some(structures) = volumes.get(&body.0).and_then(|volume| volume.structures()) else { continue };
        let place_m = world_from_volume.affine().inverse().transform_point3(removal.centroid_world_m);
        for &(label, mm3) in &removal.by_label_mm3 {
            let Some(structure) = structures.of_label(label).filter(|it| it.tissue == Tissue::Vessel) else { continue };
            let more_ml_s = structure.bleeding_ml_per_s_mm3 * mm3 as f32;
            if !(more_ml_s > 0.0 && more_ml_s.is_finite()) {
                continue;
            }
            let is_near = |of: &Bleeder, volume: Entity, at_m: Vec3| {
                of.label == label && volume == removal.volume && at_m.distance(place_m) < rules.merge_m
            };
            let widen = |bleeder: &mut Bleeder| {
                let before = bleeder.rate_ml_s;
                bleeder.rate_ml_s = (before + more_ml_s).min(rules.most_ml_s.max(before));
                bleeder.clotting_s = rules.clotting_s * (bleeder.rate_ml_s / 0.1).max(1.0);
                // A clot is drilled away, and so is a seal.
                (bleeder.open_share, bleeder.control) = (1.0, BleedingControl::Open);
                bleeder.rate_ml_s - before
            };
            let mut old =
                bleeders.iter_mut().filter(|(_, of, at, parent)| is_near(of, parent.parent(), at.translation));
            let (bleeder, more_ml_s) = if let Some((entity, mut bleeder, ..)) = old.next() {
                (entity, widen(&mut bleeder))
            } else if let Some((entity, _, _, bleeder)) =
                fresh.iter_mut().find(|(_, volume, at_m, of)| is_near(of, *volume, *at_m))
            {
                (*entity, widen(bleeder))
            } else {
                let mut bleeder = Bleeder {
                    rate_ml_s: 0.0,
                    full_pressure_mmhg: rules.vessel_pressure_mmhg,
                    pressure_mmhg: rules.vessel_pressure_mmhg,
                    reserve_ml: rules.vessel_reserve_ml,
                    label,
                    ..Bleeder::default()
                };
                let more_ml_s = widen(&mut bleeder);
                let entity = commands.spawn_empty().id();
                fresh.push((entity, removal.volume, place_m, bleeder));
                (entity, more_ml_s)
            };
            if more_ml_s > 0.0 {
                let (volume, place_world_m) = (removal.volume, removal.centroid_world_m);
                opened.write(VesselOpened { bleeder, volume, label, place_world_m, more_ml_s });
            }
        }
    }
    for (entity, volume, place_m, bleeder) in fresh {
        commands.entity(entity).insert((bleeder, Transform::from_translation(place_m), ChildOf(volume)));
    }
}

fn treat(
    mut treatments: MessageReader<TreatBleeders>,
    mut bleeders: Query<(Entity, &mut Bleeder)>,
    places: TransformHelper,
) {
    for treatment in treatments.read() {
        for (entity, mut bleeder) in &mut bleeders {
            let Ok(place) = places.compute_global_transform(entity) else { continue };
            let is_reached = place.translation().distance(treatment.place_world_m) <= treatment.radius_m;
            let is_sealed = bleeder.control == BleedingControl::Cauterized;
            if is_reached && !is_sealed && bleeder.control != treatment.control {
                bleeder.control = treatment.control;
            }
        }
    }
}
