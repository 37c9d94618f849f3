//! A pool in the world.

use super::bleeding::BleedingRules;
use super::{PoolBackend, PoolError, PoolLevel, PoolLook, SolverSettings, WaterBudget};
use bevy::ecs::template::{EntityTemplate, FromTemplate, Template, TemplateContext};
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// A pool of fluid over a volume that is drilled.
///
/// It lies in a plane of its entity: x along the rows of its cells, y from row to row, z up, out of the cavity. Turn z against
/// gravity ([`Pool::upright`]), or towards the microscope ([`Pool::facing`]). Cells are there in the world and not on the screen:
/// cameras do not disturb them.
///
/// When its volume is there, a [`Cavity`](super::Cavity), a [`FluidSolver`](super::FluidSolver), a [`PoolState`] and a
/// [`PoolSurface`](super::PoolSurface) are inserted beside it; when the volume is exchanged or goes, they begin anew or go with it. What is wrong is said once in the log and
/// by [`PoolFault`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone)]
#[require(Transform, PoolLevel, PoolFluid, PoolBackend, SolverSettings, BleedingRules, WaterBudget, PoolLook)]
pub struct Pool {
    /// The volume; an entity with a [`CtVolume`](crate::volume::CtVolume).
    #[entities]
    pub volume: Entity,
    /// Cells along the rows and across, 4 to 2048 each.
    pub size: UVec2,
    /// Side of a cell, metres.
    pub cell_m: f32,
}

/// Cells of a pool unless others are asked for, and their side, metres.
const CELLS: UVec2 = UVec2::new(512, 384);
const CELL_M: f32 = 1.25e-4;

/// Makes a [`Pool`] of a scene, whose volume may be another entity of the scene by its name. The cells are those of
/// [`Pool::new`] unless others are given.
pub struct PoolTemplate {
    /// The volume.
    pub volume: EntityTemplate,
    /// As in [`Pool`].
    pub size: UVec2,
    /// As in [`Pool`].
    pub cell_m: f32,
}

impl Default for PoolTemplate {
    fn default() -> Self {
        Self { volume: EntityTemplate::None, size: CELLS, cell_m: CELL_M }
    }
}

impl Template for PoolTemplate {
    type Output = Pool;

    fn build_template(&self, context: &mut TemplateContext) -> Result<Pool> {
        Ok(Pool { volume: self.volume.build_template(context)?, size: self.size, cell_m: self.cell_m })
    }

    fn clone_template(&self) -> Self {
        Self { ..*self }
    }
}

impl FromTemplate for Pool {
    type Template = PoolTemplate;
}

impl Pool {
    /// A pool of 512 x 384 cells of 0.125 mm, 64 x 48 mm, over a volume.
    pub fn new(volume: Entity) -> Self {
        Self { volume, size: CELLS, cell_m: CELL_M }
    }

    /// Where a pool lies whose middle is at a place in the world and whose fluid is level under a gravity; its rows run as nearly
    /// along the world's x as they can. Upright where there is no gravity.
    pub fn upright(middle_world_m: Vec3, gravity_m_s2: Vec3) -> Transform {
        Self::facing(middle_world_m, -gravity_m_s2)
    }

    /// Where a pool lies whose z axis points along a direction in the world.
    pub fn facing(middle_world_m: Vec3, up_world: Vec3) -> Transform {
        let up = up_world.try_normalize().unwrap_or(Vec3::Y);
        let along = if up.x.abs() > 0.99 { Vec3::NEG_Z } else { Vec3::X };
        let across = up.cross(along).normalize();
        let rotation = Quat::from_mat3(&Mat3::from_cols(across.cross(up), across, up));
        Transform::from_translation(middle_world_m).with_rotation(rotation)
    }
}

/// How what is in a [`Pool`] behaves.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[serde(default)]
pub struct PoolFluid {
    /// Speed that a running burr gives to the fluid at its rim per second, as a share of the speed of its own surface.
    pub stir_per_s: f32,
    /// Share of a burr's surface speed at which foam begins, metres per second.
    pub foam_from_m_s: f32,
    /// Time in which foam falls to 1/e, seconds.
    pub foam_lasts_s: f32,
    /// Volume of milky water per volume of drilled bone.
    pub dust_per_bone: f32,
    /// Time in which dust settles to 1/e, seconds.
    pub dust_settles_s: f32,
    /// Time in which blood in the fluid clots and sinks to 1/e, seconds.
    pub blood_clots_s: f32,
    /// Depth of blood without water that hides what lies under it, metres. The default lets a seventh of green light through, by the
    /// absorption of [`PoolLook`](super::PoolLook).
    pub hides_from_m: f32,
    /// How much a paste of bone dust hides, where blood hides 1: by default, too, what those optics say of green light.
    pub dust_hides: f32,
}

impl Default for PoolFluid {
    fn default() -> Self {
        Self {
            stir_per_s: 1.2,
            foam_from_m_s: 8.0,
            foam_lasts_s: 0.6,
            dust_per_bone: 3.0,
            dust_settles_s: 8.0,
            blood_clots_s: 240.0,
            hides_from_m: 3.5e-4,
            dust_hides: 0.45,
        }
    }
}

/// A pool's fluid now. Inserted beside a [`Pool`] when its volume is there.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct PoolState {
    /// Height of the calm surface over the pool's origin, metres; none while nothing is drilled.
    pub level_m: Option<f32>,
    /// The level above which it runs over, metres; none while nothing is drilled.
    pub rim_m: Option<f32>,
    /// Number of cells with fluid.
    pub wet_cells: u32,
    /// Number of cells from which bone was taken: the operating field.
    pub field_cells: u32,
    /// Mean depth of the fluid, metres.
    pub mean_depth_m: f32,
    /// Blood in the fluid, millilitres.
    pub blood_ml: f64,
    /// Share of the operating field that blood and bone dust hide, 0 to 1.
    pub hidden_share: f32,
    /// Foam, oldest first.
    pub foam: Vec<FoamPatch>,
    /// Steps that were taken.
    pub steps: u64,
}

/// Most patches of foam in a pool.
pub const MAX_FOAM: usize = 16;

/// Foam where a burr ran fast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct FoamPatch {
    /// Its middle in the pool's plane, metres.
    pub place_m: Vec2,
    /// Its radius, metres.
    pub radius_m: f32,
    /// How much of it is left, 0 to 1.
    pub amount: f32,
}

/// What is wrong with a [`Pool`]; on its entity as long as it is.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone)]
pub struct PoolFault(pub PoolError);
