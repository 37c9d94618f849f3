//! Pools look at their volumes: heights of the bone, column by column, where something changed.

use super::component::{Pool, PoolFault, PoolState};
use super::step::Shown;
use super::{Cavity, FluidSolver, PoolError, PoolGrid, PoolLevel, PoolSurface, WaterBudget, WetMask};
use crate::volume::pick::VolumePicker;
use crate::volume::structures::Structures;
use crate::volume::{CtVolume, CutVolume, PickedVolume, Volume, VoxelBox};
use bevy::math::{Affine3A, Vec3A};
use bevy::prelude::*;
use std::sync::Arc;
use tracing::error;

/// What a pool's columns were measured of.
#[derive(Component, Clone)]
pub(super) struct Measured {
    structures: Arc<Structures>,
    volume_from_pool: Affine3A,
    cut_revision: u64,
    grid: PoolGrid,
    /// Grows when the columns change.
    pub revision: u64,
}

type Body = (&'static CtVolume, &'static CutVolume, &'static PickedVolume);
type Bound = (
    Entity,
    &'static Pool,
    &'static PoolLevel,
    Option<&'static mut Measured>,
    Option<&'static mut Cavity>,
    Option<&'static PoolFault>,
    &'static mut WaterBudget,
);

/// Finds heights of bone along a pool's columns.
struct Columns<'a> {
    picker: &'a VolumePicker,
    volume_from_pool: Affine3A,
    /// From the pool's place in volume space, metres: how far a height in the pool is there.
    along: Vec3,
    per_m: f32,
    least_m: f32,
    most_m: f32,
}

impl<'a> Columns<'a> {
    fn new(picker: &'a VolumePicker, grid: &crate::volume::VolumeGrid, volume_from_pool: Affine3A) -> Option<Self> {
        let pool_from_volume = volume_from_pool.inverse();
        let along = Vec3::from(volume_from_pool.matrix3.z_axis);
        let per_m = along.length();
        if !(volume_from_pool.is_finite() && pool_from_volume.is_finite() && per_m > 0.0) {
            return None;
        }
        // Heights between which the volume lies.
        let middle = pool_from_volume.translation.z;
        let half: f32 =
            grid.half_axes_m().iter().map(|axis| (pool_from_volume.matrix3 * Vec3A::from(*axis)).z.abs()).sum();
        let (least_m, most_m) = (middle - half, middle + half);
        Some(Self { picker, volume_from_pool, along, per_m, least_m, most_m })
    }

    /// Height of the highest bone at a place of the pool's plane, metres.
    fn height_m(&self, place_m: Vec2, remaining: impl Fn(UVec3) -> f32) -> Option<f32> {
        let top_m = self.most_m + 1e-3;
        let origin = self.volume_from_pool.transform_point3(place_m.extend(top_m));
        let reach = (top_m - self.least_m) * self.per_m;
        let hit = self.picker.pick(origin, -self.along, reach, remaining)?;
        Some(top_m - hit.distance_m / self.per_m)
    }

    /// All columns, as they were and as they are.
    fn cavity(&self, grid: PoolGrid, cut: &CutVolume, volume: &Volume) -> Cavity {
        let mut cavity = Cavity::new(grid, self.least_m, |place_m| self.height_m(place_m, |_| 1.0));
        if !cut.is_untouched(volume.grid().bounds()) {
            cavity.measure([UVec2::ZERO, grid.size()], |place_m| self.height_m(place_m, |voxel| cut.remaining(voxel)));
        }
        cavity
    }
}

/// Whether any cell lies elsewhere in the volume than before, by more than a tenth of its side: less comes from rounding where
/// both turn together.
fn is_moved(before: &Affine3A, now: &Affine3A, grid: &PoolGrid) -> bool {
    let half_m = grid.size().as_vec2() * 0.5 * grid.cell_m();
    [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)].into_iter().any(|corner| {
        let at = (corner * half_m).extend(0.0);
        let moved = before.transform_point3(at).distance(now.transform_point3(at));
        let allowed = 0.1 * grid.cell_m() * Vec3::from(now.matrix3.x_axis).length();
        moved.is_nan() || moved > allowed
    })
}

/// Cells of a grid over a box of voxels.
fn cells_over(voxels: VoxelBox, pool_from_voxel: Affine3A, grid: &PoolGrid) -> [UVec2; 2] {
    // Interpolation reaches a voxel beyond.
    let (low, high) = (voxels.min.as_vec3() - 1.5, voxels.max.as_vec3() + 0.5);
    let corners = (0..8).map(|corner| {
        let side = |bit: usize| if corner >> bit & 1 == 1 { high[bit] } else { low[bit] };
        grid.cell_from_pool(pool_from_voxel.transform_point3(Vec3::new(side(0), side(1), side(2))).truncate())
    });
    let empty = (Vec2::INFINITY, Vec2::NEG_INFINITY);
    let (least, most) = corners.fold(empty, |(least, most), at| (least.min(at), most.max(at)));
    let inside = |at: Vec2| at.clamp(Vec2::ZERO, grid.size().as_vec2()).as_uvec2();
    [inside(least.floor()), inside(most.ceil() + 1.0)]
}

/// Binds pools to their volumes and follows what is cut.
pub(super) fn measure_columns(
    mut commands: Commands,
    mut pools: Query<Bound>,
    bodies: Query<Body>,
    sources: Query<&CtVolume>,
    volumes: Res<Assets<Volume>>,
    places: TransformHelper,
) {
    for (entity, pool, level, measured, cavity, fault, mut water) in &mut pools {
        let body = bodies.get(pool.volume).ok().and_then(|body| Some((body, volumes.get(&body.0.0)?)));
        let found = check(pool, level, &sources, &volumes).and_then(|grid| {
            let Some(((_, cut, picked), volume)) = body else { return Ok(None) };
            // What was spawned or moved in this frame is where it will be seen.
            let place = |entity| places.compute_global_transform(entity).map_err(|_| PoolError::Transform);
            let volume_from_pool = place(pool.volume)?.affine().inverse() * place(entity)?.affine();
            let columns = Columns::new(&picked.0, volume.grid(), volume_from_pool).ok_or(PoolError::Transform)?;
            if let PoolLevel::Fixed(level_m) = *level
                && !(columns.least_m..=columns.most_m).contains(&level_m)
            {
                return Err(PoolError::LevelOutside { level_m, least_m: columns.least_m, most_m: columns.most_m });
            }
            Ok(Some((grid, cut, columns, volume)))
        });
        let (grid, cut, columns, volume) = match found {
            Ok(Some(found)) => found,
            // Not loaded yet, or gone.
            Ok(None) => {
                forget(&mut commands, entity, measured.is_some(), &mut water);
                continue;
            }
            Err(fault_now) => {
                report(&mut commands, entity, fault, fault_now);
                forget(&mut commands, entity, measured.is_some(), &mut water);
                continue;
            }
        };
        let structures = columns.picker.structures();
        let pool_from_voxel = columns.volume_from_pool.inverse() * volume.grid().volume_from_voxel();
        let remaining = |voxel: UVec3| cut.remaining(voxel);
        if let (Some(mut measured), Some(mut cavity)) = (measured, cavity)
            && Arc::ptr_eq(&measured.structures, structures)
            && measured.grid == grid
        {
            if is_moved(&measured.volume_from_pool, &columns.volume_from_pool, &grid) {
                *cavity = columns.cavity(grid, cut, volume);
                if !cavity.has_bone() {
                    report(&mut commands, entity, fault, PoolError::Beside);
                    forget(&mut commands, entity, true, &mut water);
                    continue;
                }
                measured.volume_from_pool = columns.volume_from_pool;
                measured.cut_revision = cut.revision();
                measured.revision += 1;
            } else if measured.cut_revision != cut.revision() {
                let boxes = cut.changes_since(measured.cut_revision).unwrap_or(vec![volume.grid().bounds()]);
                for changed in boxes {
                    cavity.measure(cells_over(changed, pool_from_voxel, &grid), |place_m| {
                        columns.height_m(place_m, remaining)
                    });
                }
                measured.cut_revision = cut.revision();
                measured.revision += 1;
            }
            continue;
        }
        let fresh = columns.cavity(grid, cut, volume);
        if !fresh.has_bone() {
            report(&mut commands, entity, fault, PoolError::Beside);
            forget(&mut commands, entity, true, &mut water);
            continue;
        }
        let mut fluid = FluidSolver::new(grid);
        // Nothing is wet before the first level is known.
        let _ = fluid.set_mask(&WetMask::from_fn(&grid, |_| false));
        forget(&mut commands, entity, false, &mut water);
        *water = WaterBudget::default();
        commands.entity(entity).remove::<PoolFault>().insert((
            fresh,
            fluid,
            PoolState::default(),
            Shown::default(),
            PoolSurface::new(grid, 0.0),
            Measured {
                structures: structures.clone(),
                volume_from_pool: columns.volume_from_pool,
                cut_revision: cut.revision(),
                grid,
                revision: 1,
            },
        ));
    }
}

/// The grid, if pool and volume are what they should be.
fn check(
    pool: &Pool,
    level: &PoolLevel,
    sources: &Query<&CtVolume>,
    volumes: &Assets<Volume>,
) -> Result<PoolGrid, PoolError> {
    let grid = PoolGrid::new(pool.size, pool.cell_m)?;
    let source = sources.get(pool.volume).map_err(|_| PoolError::NoVolume { volume: pool.volume })?;
    if volumes.get(&source.0).is_some_and(|volume| volume.structures().is_none()) {
        return Err(PoolError::NoStructures { volume: pool.volume });
    }
    match *level {
        PoolLevel::Fixed(level_m) if !level_m.is_finite() => Err(PoolError::Level { level_m }),
        _ => Ok(grid),
    }
}

/// Says once what is wrong.
fn report(commands: &mut Commands, entity: Entity, before: Option<&PoolFault>, fault: PoolError) {
    if before.is_none_or(|before| before.0 != fault) {
        error!("pool {entity}: {fault}");
        commands.entity(entity).insert(PoolFault(fault));
    }
}

/// Takes away what belonged to a volume that is gone.
fn forget(commands: &mut Commands, entity: Entity, is_bound: bool, water: &mut Mut<WaterBudget>) {
    if is_bound {
        commands.entity(entity).remove::<(Cavity, FluidSolver, PoolState, Shown, PoolSurface, Measured)>();
        water.set_if_neq(WaterBudget::default());
    }
}
