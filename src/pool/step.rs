//! One step of a pool: what flows in and out, how high it stands, what acts on it.

use super::backend::{Known, OnGpu, advance};
use super::bleeding::{Bleeder, BleedingRules};
use super::columns::Measured;
use super::component::{FoamPatch, MAX_FOAM, Pool, PoolFluid, PoolState};
use super::irrigator::{SuctionGurgled, SuctionIrrigator, SuctionState, fluid_share};
use super::{
    Cavity, Dissolved, FluidAction, FluidSolver, FluidSource, Hiding, PoolLevel, PoolSurface, SolverSettings,
    WaterBudget,
};
use crate::gravity::SurgeryGravity;
use crate::order::by_name;
use crate::volume::structures::Tissue;
use crate::volume::{CtVolume, DrillVolume, Volume, VoxelsRemoved};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use std::f32::consts::{PI, TAU};

/// Fluid is taken to be at least so deep where amounts are reckoned, metres.
const LEAST_DEPTH_M: f32 = 3e-4;
/// The mask is made again when the level has moved by so much, metres.
const LEVEL_STEP_M: f32 = 2e-5;
/// Steps between two looks for the rim while bone is drilled.
const RIM_STEPS: u64 = 6;
/// How far jets reach, metres.
const JET_REACH_M: f32 = 0.05;

/// What the level and the mask were last made of.
#[derive(Component, Clone, Default)]
pub(super) struct Shown {
    columns: u64,
    rim_columns: u64,
    mask_level_m: Option<f32>,
    /// Volume of a cell's fluid when amounts were last reckoned, millilitres.
    cell_ml: f64,
}

type Flowing = (
    Entity,
    &'static Pool,
    &'static Measured,
    &'static Cavity,
    (&'static PoolLevel, &'static PoolFluid, &'static SolverSettings, &'static BleedingRules),
    &'static mut FluidSolver,
    &'static mut WaterBudget,
    &'static mut PoolState,
    &'static mut Shown,
    &'static mut PoolSurface,
    OnGpu,
);
type Tool = (&'static SuctionIrrigator, &'static mut SuctionState);

/// What acts on pools.
#[derive(SystemParam)]
pub(super) struct Acting<'w, 's> {
    burrs: MessageReader<'w, 's, DrillVolume>,
    removals: MessageReader<'w, 's, VoxelsRemoved>,
    tools: Query<'w, 's, Tool>,
    names: Query<'w, 's, (Entity, Option<&'static Name>), With<SuctionIrrigator>>,
    bleeders: Query<'w, 's, (Entity, &'static mut Bleeder)>,
    places: TransformHelper<'w, 's>,
    bodies: Query<'w, 's, &'static CtVolume>,
    volumes: Res<'w, Assets<Volume>>,
    gurgles: MessageWriter<'w, SuctionGurgled>,
}

/// A pool in the middle of its step.
struct Step<'a> {
    pool_from_world: bevy::math::Affine3A,
    cavity: &'a Cavity,
    /// As at the end of the last step.
    level_m: Option<f32>,
    step_s: f32,
    water: &'a mut WaterBudget,
    action: FluidAction,
    /// Blood that enters, and clear water: where (none for anywhere), how wide, how much (millilitres).
    blood: Vec<(Vec2, f32, f64)>,
    foam: Vec<FoamPatch>,
    /// Share of the fluid that ran over.
    overflow: f64,
}

impl Step<'_> {
    fn in_pool(&self, world_m: Vec3) -> Vec3 {
        self.pool_from_world.transform_point3(world_m)
    }

    fn depth_m(&self, place_m: Vec2) -> f32 {
        let cell = self.cavity.grid().cell_from_pool(place_m).round();
        match self.level_m {
            Some(level_m) if cell.cmpge(Vec2::ZERO).all() => self.cavity.depth_m(cell.as_uvec2(), level_m),
            _ => 0.0,
        }
    }

    /// Whether a place lies over or beside the pool's grid.
    fn is_over(&self, place_m: Vec2) -> bool {
        let half_m = 0.5 * self.cavity.grid().cell_m() * self.cavity.grid().size().as_vec2();
        place_m.abs().cmple(half_m).all()
    }

    /// A burr that runs: stirs, and makes foam when it is fast.
    fn stir(&mut self, stroke: &DrillVolume, fluid: &PoolFluid, steps: u64) {
        let middle = self.in_pool(stroke.to_world.centre_m);
        let radius_m = 0.5 * stroke.burr.diameter_m;
        let is_wet = self.level_m.is_some_and(|level_m| middle.z - radius_m < level_m);
        let rim_m_s = PI * stroke.burr.diameter_m * stroke.speed_rpm.abs() / 60.0;
        if !(is_wet && rim_m_s.is_finite() && self.is_over(middle.truncate())) {
            return;
        }
        // The noise runs past, so that a burr that rests stirs new eddies all the time.
        let time = steps as f32;
        self.action.sources.push(FluidSource {
            place_m: middle.truncate(),
            radius_m: 1.5 * radius_m,
            stir_m_s: rim_m_s * fluid.stir_per_s * self.step_s,
            stir_offset_m: Vec2::new(time * 7.3e-4, time * 4.1e-4),
            ..FluidSource::default()
        });
        let excess = rim_m_s / fluid.foam_from_m_s.max(1e-3) - 1.0;
        // Foam needs air: the burr's back must be near the surface.
        let is_near_surface = self.level_m.is_some_and(|level_m| middle.z + 2.0 * radius_m > level_m);
        if excess > 0.0 && is_near_surface {
            let amount = 0.45 * excess.min(1.0);
            self.foam.push(FoamPatch { place_m: middle.truncate(), radius_m: 1.5 * radius_m, amount });
        }
    }

    /// What was drilled: dust, and blood in proportion.
    fn remove(&mut self, removal: &VoxelsRemoved, oozing_ml: f64, fluid: &PoolFluid) {
        let place_m = self.in_pool(removal.centroid_world_m).truncate();
        if !self.is_over(place_m) {
            return;
        }
        let radius_m = 1.2e-3;
        if oozing_ml > 0.0 {
            self.blood.push((place_m, radius_m, oozing_ml));
        }
        let milky_ml = removal.total_mm3 * 1e-3 * f64::from(fluid.dust_per_bone);
        self.action.sources.push(FluidSource {
            place_m,
            radius_m,
            amount: [0.0, self.cells_full(milky_ml, place_m)],
            ..FluidSource::default()
        });
    }

    /// Cells full of so many millilitres around a place.
    fn cells_full(&self, ml: f64, place_m: Vec2) -> f32 {
        let cell_m = self.cavity.grid().cell_m();
        (ml * 1e-6 / f64::from(cell_m * cell_m * self.depth_m(place_m).max(LEAST_DEPTH_M))) as f32
    }

    /// Water from a jet, and fluid into a sucker; what it took.
    fn irrigate_and_suck(&mut self, tool: &SuctionIrrigator, place: &GlobalTransform) -> SuctionState {
        let tip = self.in_pool(place.translation());
        let radius_m = tool.tip_radius_m.clamp(1e-4, 2e-2);
        if !tip.is_finite() {
            return SuctionState::default();
        }
        let irrigation_ml_s = positive(tool.irrigation_ml_s);
        if irrigation_ml_s > 0.0
            && let Some(target_m) = self.jet_target(tip, place)
        {
            let along = self.pool_from_world.transform_vector3(place.forward().into());
            let along = along.truncate() / along.length().max(1e-12);
            let ml = f64::from(irrigation_ml_s * self.step_s);
            let depth_m = self.depth_m(target_m).max(LEAST_DEPTH_M);
            let wide_m = 1.5 * radius_m;
            // Clear water takes the place of so much of what is there, and washes it away.
            let footprint_m3 = TAU * wide_m * wide_m * depth_m;
            self.water.irrigate(ml);
            self.action.sources.push(FluidSource {
                place_m: target_m,
                radius_m: wide_m,
                push_m_s: along * (positive(tool.jet_m_s) * 12.0 * self.step_s).min(1.0),
                flow_m2_s: irrigation_ml_s * 1e-6 / depth_m,
                clear: (ml as f32 * 1e-6 / footprint_m3).min(0.5),
                ..FluidSource::default()
            });
        }
        let wanted_ml = f64::from(positive(tool.suction_ml_s) * self.step_s);
        if !(tool.is_sucking && wanted_ml > 0.0) {
            return SuctionState::default();
        }
        let depth_m = self.depth_m(tip.truncate());
        let share = match self.level_m {
            Some(level_m) if depth_m > 0.0 => fluid_share(tip.z - level_m, radius_m),
            _ => 0.0,
        };
        // A film is drawn in with much air.
        let share = share * (depth_m / (0.5 * radius_m)).min(1.0);
        let taken_ml = self.water.suck(wanted_ml * f64::from(share));
        if taken_ml > 0.0 {
            let depth_m = depth_m.max(LEAST_DEPTH_M);
            let footprint_m3 = TAU * radius_m * radius_m * depth_m;
            self.action.sources.push(FluidSource {
                place_m: tip.truncate(),
                radius_m,
                flow_m2_s: -(taken_ml as f32) * 1e-6 / (depth_m * self.step_s),
                clear: (taken_ml as f32 * 1e-6 / footprint_m3).min(0.9),
                ..FluidSource::default()
            });
        }
        SuctionState {
            fluid_ml_s: (taken_ml / f64::from(self.step_s)) as f32,
            air_share: (1.0 - taken_ml / wanted_ml) as f32,
        }
    }

    /// Where in the pool's plane a jet meets the fluid, or what is below the pool.
    fn jet_target(&self, tip: Vec3, place: &GlobalTransform) -> Option<Vec2> {
        let along = self.pool_from_world.transform_vector3(place.forward().into());
        let surface_m = self.level_m.or(self.cavity.deepest().map(|(_, height_m)| height_m))?;
        let at = if tip.z <= surface_m {
            tip
        } else {
            let distance = (surface_m - tip.z) / along.z;
            if !(along.z < 0.0 && distance * along.length() <= JET_REACH_M) {
                return None;
            }
            tip + along * distance
        };
        self.is_over(at.truncate()).then(|| at.truncate())
    }

    fn bleed(&mut self, bleeder: &mut Bleeder, place: &GlobalTransform) {
        let at = self.in_pool(place.translation());
        if !(at.is_finite() && self.is_over(at.truncate())) {
            return;
        }
        let depth_m = self.level_m.map_or(0.0, |level_m| level_m - at.z);
        let ml = bleeder.bleed(depth_m, self.step_s);
        if ml > 0.0 {
            self.blood.push((at.truncate(), 1e-3, ml));
        }
    }
}

fn positive(number: f32) -> f32 {
    if number.is_finite() { number.max(0.0) } else { 0.0 }
}

/// One step of all pools.
pub(super) fn flow(mut pools: Query<Flowing>, mut acting: Acting, time: Res<Time>, gravity: Res<SurgeryGravity>) {
    let step_s = time.delta_secs();
    if !(step_s > 0.0 && step_s.is_finite()) {
        return;
    }
    let burrs: Vec<DrillVolume> = acting.burrs.read().cloned().collect();
    let removals: Vec<VoxelsRemoved> = acting.removals.read().cloned().collect();
    for (_, mut suction) in &mut acting.tools {
        suction.set_if_neq(SuctionState::default());
    }
    let irrigators = by_name(acting.names.iter());
    for (
        entity,
        pool,
        measured,
        cavity,
        settings,
        mut fluid,
        mut water,
        mut state,
        mut shown,
        mut surface,
        mut on_gpu,
    ) in &mut pools
    {
        let (level, mixing, solver, rules) = settings;
        let Ok(place) = acting.places.compute_global_transform(entity) else { continue };
        let mut step = Step {
            pool_from_world: place.affine().inverse(),
            cavity,
            level_m: state.level_m,
            step_s,
            water: &mut water,
            action: FluidAction::default(),
            blood: Vec::new(),
            foam: Vec::new(),
            overflow: 0.0,
        };
        if cavity.deepest().is_none() {
            rest(&mut state, &mut step, level);
            if !surface.wet_tiles.is_empty() {
                *surface = PoolSurface::new(*cavity.grid(), 0.0);
            }
            continue;
        }
        for stroke in burrs.iter().filter(|stroke| stroke.volume == pool.volume) {
            step.stir(stroke, mixing, state.steps);
        }
        for removal in removals.iter().filter(|removal| removal.volume == pool.volume) {
            let oozing_ml = oozing_ml(removal, rules, &acting.bodies, &acting.volumes);
            step.remove(removal, oozing_ml, mixing);
        }
        for &tool in &irrigators {
            let Ok((irrigator, mut suction)) = acting.tools.get_mut(tool) else { continue };
            let Ok(place) = acting.places.compute_global_transform(tool) else { continue };
            let took = step.irrigate_and_suck(irrigator, &place);
            if took != SuctionState::default() {
                *suction = took;
            }
            if took.air_share > 0.02 && took.fluid_ml_s > 0.0 {
                let place_world_m = place.translation();
                acting.gurgles.write(SuctionGurgled { tool, air_share: took.air_share, place_world_m });
            }
        }
        for (bleeding, mut bleeder) in &mut acting.bleeders {
            let Ok(place) = acting.places.compute_global_transform(bleeding) else { continue };
            step.bleed(&mut bleeder, &place);
        }
        let blood_ml: f64 = step.blood.iter().map(|(_, _, ml)| ml).sum();
        step.water.bleed(blood_ml);

        find_level(&mut state, &mut step, &mut shown, measured.revision, level);
        let level_m = state.level_m.unwrap_or_default();
        let is_new_mask = wet(&mut fluid, &mut state, &mut shown, cavity, measured.revision, level_m);

        state.foam = age_foam(&state.foam, std::mem::take(&mut step.foam), mixing, step_s);
        mix(&fluid, &mut step, &mut state, &mut shown, mixing);
        let gravity_m_s2 = gravity.world_m_per_s2.length();
        let hiding = Hiding::new(mixing, state.mean_depth_m);
        let known = advance(&mut fluid, &mut on_gpu, step_s, solver, &step.action, hiding, gravity_m_s2);
        read(&fluid, cavity, &known, &mut state, &shown, hiding);
        state.steps += 1;
        if state.wet_cells > 0 || !surface.wet_tiles.is_empty() {
            // The GPU writes the surfaces of pools that it moves; it is told which tiles there are.
            if known.is_on_processor || is_new_mask {
                surface.update(&fluid, level_m, step_s, gravity_m_s2);
            }
            surface.level_m = level_m;
            surface.foam.clone_from(&state.foam);
        }
    }
}

/// Nothing is drilled: there is no place for fluid, and what comes runs off.
fn rest(state: &mut PoolState, step: &mut Step, level: &PoolLevel) {
    if matches!(level, PoolLevel::Balanced) {
        step.water.overflow(0.0);
    } else {
        step.water.adjust(0.0);
    }
    if state.level_m.is_some() || state.wet_cells > 0 {
        *state = PoolState { steps: state.steps, ..PoolState::default() };
    }
}

/// Blood that oozes from what was removed of tissue that is no vessel, millilitres.
fn oozing_ml(
    removal: &VoxelsRemoved,
    rules: &BleedingRules,
    bodies: &Query<&CtVolume>,
    volumes: &Assets<Volume>,
) -> f64 {
    let volume = bodies.get(removal.volume).ok().and_then(|body| volumes.get(&body.0));
    let Some(structures) = volume.and_then(|volume| volume.structures()) else { return 0.0 };
    let of = |&(label, mm3): &(u8, f64)| {
        let structure = structures.of_label(label).filter(|structure| structure.tissue != Tissue::Vessel);
        structure.map_or(0.0, |structure| mm3 * f64::from(structure.bleeding_ml_per_s_mm3))
    };
    removal.by_label_mm3.iter().map(of).sum::<f64>() * f64::from(positive(rules.ooze_s))
}

/// The level from what is held, and what runs over.
fn find_level(state: &mut PoolState, step: &mut Step, shown: &mut Shown, columns: u64, level: &PoolLevel) {
    if shown.rim_columns != columns && (state.rim_m.is_none() || state.steps.is_multiple_of(RIM_STEPS)) {
        shown.rim_columns = columns;
        state.rim_m = step.cavity.rim_m();
        state.field_cells = step.cavity.drilled_count() as u32;
    }
    let rim_m = state.rim_m.unwrap_or_default();
    match *level {
        PoolLevel::Fixed(level_m) => {
            step.water.adjust(step.cavity.volume_ml(level_m));
            state.level_m = Some(level_m);
        }
        PoolLevel::Balanced => {
            let over_ml = step.water.overflow(step.cavity.volume_ml(rim_m));
            step.overflow = over_ml / (step.water.held_ml + over_ml).max(1e-12);
            let near_m = state.level_m.unwrap_or(rim_m);
            state.level_m = step.cavity.level_m(step.water.held_ml, rim_m, near_m);
        }
    }
}

/// A new mask where the cavity or the level has changed; whether it has.
fn wet(
    fluid: &mut FluidSolver,
    state: &mut PoolState,
    shown: &mut Shown,
    cavity: &Cavity,
    columns: u64,
    level_m: f32,
) -> bool {
    let is_same =
        shown.columns == columns && shown.mask_level_m.is_some_and(|shown_m| (shown_m - level_m).abs() < LEVEL_STEP_M);
    if is_same {
        return false;
    }
    let mask = cavity.mask(level_m);
    state.wet_cells = mask.count() as u32;
    // The sizes are the same: both are the grid's.
    let _ = fluid.set_mask(&mask);
    (shown.columns, shown.mask_level_m) = (columns, Some(level_m));
    true
}

fn age_foam(old: &[FoamPatch], fresh: Vec<FoamPatch>, mixing: &PoolFluid, step_s: f32) -> Vec<FoamPatch> {
    let keeps = (-step_s / mixing.foam_lasts_s.max(1e-3)).exp();
    let mut foam: Vec<FoamPatch> = old
        .iter()
        .map(|patch| FoamPatch {
            amount: patch.amount * keeps,
            radius_m: patch.radius_m * (1.0 + 0.2 * step_s),
            ..*patch
        })
        .filter(|patch| patch.amount > 0.02)
        .collect();
    for patch in fresh {
        // A burr that rests makes the same foam again.
        match foam.iter_mut().find(|old| old.place_m.distance(patch.place_m) < 0.5 * patch.radius_m) {
            Some(old) => {
                *old = FoamPatch {
                    amount: (old.amount + patch.amount * (1.0 - keeps) * 3.0).min(patch.amount.max(old.amount)),
                    ..patch
                }
            }
            None => foam.push(FoamPatch { amount: patch.amount * (1.0 - keeps).max(0.15), ..patch }),
        }
    }
    let excess = foam.len().saturating_sub(MAX_FOAM);
    foam.drain(..excess);
    foam
}

/// Blood enters, and what dilutes, runs over, clots and settles goes.
fn mix(fluid: &FluidSolver, step: &mut Step, state: &mut PoolState, shown: &mut Shown, mixing: &PoolFluid) {
    let cell_m2 = f64::from(fluid.grid().cell_m()).powi(2);
    let wet_m2 = f64::from(state.wet_cells) * cell_m2;
    state.mean_depth_m = if wet_m2 > 0.0 { (step.water.held_ml * 1e-6 / wet_m2) as f32 } else { 0.0 };
    let cell_ml = cell_m2 * f64::from(state.mean_depth_m.max(LEAST_DEPTH_M)) * 1e6;
    // The same amount in deeper fluid is a smaller share of it.
    let spread = if shown.cell_ml > 0.0 { shown.cell_ml / cell_ml } else { 1.0 };
    shown.cell_ml = cell_ml;
    let fades = |time_s: f32| if time_s > 0.0 { (-step.step_s / time_s).exp() } else { 1.0 };
    let fades = [fades(mixing.blood_clots_s), fades(mixing.dust_settles_s)];
    let stays = spread * (1.0 - step.overflow);
    step.action.keep = fades.map(|fade| stays as f32 * fade);
    for &(place_m, radius_m, ml) in &step.blood {
        let place_m = nearest_wet(fluid, place_m);
        step.action.sources.push(FluidSource {
            place_m,
            radius_m,
            amount: [(ml / cell_ml) as f32, 0.0],
            flow_m2_s: (ml * 1e-6) as f32 / (state.mean_depth_m.max(LEAST_DEPTH_M) * step.step_s),
            ..FluidSource::default()
        });
    }
}

/// Blood from a dry wall runs down into the fluid: the nearest wet cell in widening squares, or the place itself.
fn nearest_wet(fluid: &FluidSolver, place_m: Vec2) -> Vec2 {
    let grid = *fluid.grid();
    let middle = grid.cell_from_pool(place_m).round().as_ivec2();
    let is_wet = |cell: IVec2| cell.cmpge(IVec2::ZERO).all() && fluid.is_wet(cell.as_uvec2());
    if is_wet(middle) {
        return place_m;
    }
    for radius in 1..=80_i32 {
        let ring = (-radius..=radius).flat_map(|along| {
            [
                IVec2::new(along, -radius),
                IVec2::new(along, radius),
                IVec2::new(-radius, along),
                IVec2::new(radius, along),
            ]
        });
        let nearest = ring.filter(|offset| is_wet(middle + *offset)).min_by_key(|offset| offset.length_squared());
        if let Some(offset) = nearest {
            return grid.pool_from_cell((middle + offset).as_uvec2());
        }
    }
    place_m
}

/// What scores and panels want to know.
fn read(fluid: &FluidSolver, cavity: &Cavity, known: &Known, state: &mut PoolState, shown: &Shown, hiding: Hiding) {
    state.blood_ml = known.blood * shown.cell_ml;
    let hidden = known.hidden_cells.unwrap_or_else(|| {
        if known.blood <= 0.0 && fluid.total(Dissolved::Dust) <= 0.0 {
            return 0.0;
        }
        // The mask reaches a cell beyond what is drilled; that one hides nothing.
        let [low, high] = cavity.bounds();
        let hides = |x: u32, y: u32| {
            let cell = UVec2::new(x, y);
            let [blood, dust] = [Dissolved::Blood, Dissolved::Dust].map(|what| fluid.share(what, cell));
            fluid.is_wet(cell) && hiding.hides(blood, dust)
        };
        let rows = (low.y..high.y).map(|y| (low.x..high.x).filter(|x| hides(*x, y)).count());
        rows.sum::<usize>() as f32
    });
    state.hidden_share = if state.field_cells > 0 { (hidden / state.field_cells as f32).min(1.0) } else { 0.0 };
}
