//! What a ray meets in a volume: the surface of what is left of its structures.

use super::grid::linear_index;
use super::structures::Structures;
use super::{VolumeGrid, VoxelBox};
use bevy::reflect::Reflect;
use glam::{DAffine3, DVec3, IVec3, Mat3, UVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Share of filling at which matter begins.
pub(super) const SURFACE: f64 = 0.5;
/// Cells along the side of the blocks that are passed over at once.
pub(super) const BLOCK_SIDE: u32 = 8;
/// How far behind a wall the next cell is looked for, voxels.
const NUDGE_VOXELS: f64 = 1e-7;

/// Finds surfaces along rays.
///
/// Matter is where the filling of the voxels (`Structures::solid` as a share, times the remaining opacity of the voxel),
/// interpolated trilinearly, is at least a half. Outside the grid there is none: where matter reaches the grid's side, that side
/// is its surface. The blocks that rays pass over are found once, from the structures alone, as drilling only takes away.
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug)]
pub struct VolumePicker {
    pub(super) grid: VolumeGrid,
    structures: Arc<Structures>,
    pub(super) volume_from_voxel: DAffine3,
    pub(super) voxel_from_volume: DAffine3,
    pub(super) volume_from_gradient: Mat3,
    blocks: UVec3,
    may_be_matter: Vec<bool>,
}

/// Where a ray meets matter.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct VolumeHit {
    /// Distance along the ray, metres.
    pub distance_m: f32,
    /// The place, in the volume's space.
    pub position_m: Vec3,
    /// The place in voxel coordinates.
    pub at_voxel: Vec3,
    /// Unit normal out of the matter, in the volume's space; against the ray where the filling does not change nearby.
    pub normal: Vec3,
    /// The voxel that fills the place most.
    pub voxel: UVec3,
    /// Its label, 0 for none.
    pub label: u8,
}

/// Filling of the eight voxels around a cell, x fastest, and where they are.
pub(super) struct Cell {
    voxels: [UVec3; 8],
    filling: [f64; 8],
    /// Voxel coordinates of its lower corner.
    low: DVec3,
}

impl Cell {
    /// Weights of its corners at a place in it.
    fn weights(&self, at_voxel: DVec3) -> [f64; 8] {
        let share = (at_voxel - self.low).clamp(DVec3::ZERO, DVec3::ONE);
        std::array::from_fn(|corner| {
            let along = |bit: usize, share: f64| if corner >> bit & 1 == 1 { share } else { 1.0 - share };
            along(0, share.x) * along(1, share.y) * along(2, share.z)
        })
    }

    pub(super) fn filling_at(&self, at_voxel: DVec3) -> f64 {
        self.weights(at_voxel).iter().zip(self.filling).map(|(weight, filling)| weight * filling).sum()
    }
}

impl VolumePicker {
    /// A picker for the structures of a grid. `None` if they belong to a grid of another size.
    pub fn new(grid: VolumeGrid, structures: Arc<Structures>) -> Option<Self> {
        if structures.solid().len() != grid.count() || grid.size.min_element() == 0 {
            return None;
        }
        let volume_from_voxel = grid.volume_from_voxel().as_daffine3();
        let voxel_from_volume = volume_from_voxel.inverse();
        // Cells are numbered from the one before the first voxel: cell `c` is between the voxels `c - 1` and `c`.
        let blocks = grid.size / BLOCK_SIDE + 1;
        let may_be_matter = (0..blocks.x * blocks.y * blocks.z).into_par_iter().map(|place| {
            let block = UVec3::new(place % blocks.x, place / blocks.x % blocks.y, place / (blocks.x * blocks.y));
            let min = (block * BLOCK_SIDE).saturating_sub(UVec3::ONE);
            let voxels = VoxelBox { min, max: (block * BLOCK_SIDE + BLOCK_SIDE).min(grid.size) };
            holds_matter(structures.solid(), &grid, voxels)
        });
        Some(Self {
            grid,
            volume_from_voxel,
            voxel_from_volume,
            volume_from_gradient: voxel_from_volume.matrix3.transpose().as_mat3(),
            blocks,
            may_be_matter: may_be_matter.collect(),
            structures,
        })
    }

    /// The grid.
    pub fn grid(&self) -> &VolumeGrid {
        &self.grid
    }

    /// The structures that are picked.
    pub fn structures(&self) -> &Arc<Structures> {
        &self.structures
    }

    /// The first matter on a ray within a distance; the ray is in the volume's space (metres), its direction of any length.
    /// `remaining` is the remaining opacity of a voxel, 0 to 1. A ray that begins in matter meets it at distance 0.
    pub fn pick(
        &self,
        origin_m: Vec3,
        direction: Vec3,
        max_distance_m: f32,
        remaining: impl Fn(UVec3) -> f32,
    ) -> Option<VolumeHit> {
        let direction = direction.as_dvec3().try_normalize()?;
        let (origin, along) = (
            self.voxel_from_volume.transform_point3(origin_m.as_dvec3()),
            self.voxel_from_volume.transform_vector3(direction),
        );
        let (mut from, mut to, mut side) = (0.0_f64, f64::from(max_distance_m), None);
        for axis in 0..3 {
            let (low, high) = (-0.5 - origin[axis], f64::from(self.grid.size[axis]) - 0.5 - origin[axis]);
            if along[axis] == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (a, b) = (low / along[axis], high / along[axis]);
            if a.min(b) > from {
                (from, side) = (a.min(b), Some(axis));
            }
            to = to.min(a.max(b));
        }
        // Also `false` for what is not a number.
        if !(origin.is_finite() && from <= to) {
            return None;
        }
        // Distances are counted from where the ray enters the grid, lest they lose digits for rays from far away.
        let (start, far) = (origin + along * from, to - from);
        let place = |distance: f64| start + along * distance;
        if self.cell(start, &remaining).filling_at(start) >= SURFACE {
            let normal = side.map(|axis| {
                // Through a side of the grid: the side is the surface.
                let mut out = Vec3::ZERO;
                out[axis] = -along[axis].signum() as f32;
                (self.volume_from_gradient * out).normalize_or_zero()
            });
            return Some(self.hit(from, start, direction, origin_m, normal, &remaining));
        }
        let nudge = NUDGE_VOXELS / along.length();
        let mut at = 0.0;
        while at <= far {
            let shifted = place(at) + 1.0;
            let block = (shifted / f64::from(BLOCK_SIDE)).floor();
            if !self.may_be_matter_in(block) {
                at = exit(start + 1.0, along, block * f64::from(BLOCK_SIDE), f64::from(BLOCK_SIDE)).max(at) + nudge;
                continue;
            }
            let leaves = exit(start + 1.0, along, shifted.floor(), 1.0).clamp(at, far);
            let cell = self.cell(place((at + leaves) * 0.5), &remaining);
            if cell.filling.iter().any(|&filling| filling >= SURFACE)
                && let Some(share) =
                    first_crossing(|share| cell.filling_at(place(at + (leaves - at) * share)) - SURFACE)
            {
                let distance = at + (leaves - at) * share;
                return Some(self.hit(from + distance, place(distance), direction, origin_m, None, &remaining));
            }
            at = leaves + nudge;
        }
        None
    }

    /// Filling at voxel coordinates, 0 to 1: matter from a half on; 0 outside the grid.
    pub fn filling_at(&self, at_voxel: Vec3, remaining: impl Fn(UVec3) -> f32) -> f32 {
        let is_inside = at_voxel.cmpge(Vec3::splat(-0.5)).all() && at_voxel.cmple(self.grid.size.as_vec3() - 0.5).all();
        if !is_inside {
            return 0.0;
        }
        let at = at_voxel.as_dvec3();
        self.cell(at, &remaining).filling_at(at) as f32
    }

    /// Unit normal out of the matter at voxel coordinates, in the volume's space: against the gradient of the filling by central
    /// differences over two voxels. `None` where the filling does not change.
    pub fn normal_at(&self, at_voxel: Vec3, remaining: impl Fn(UVec3) -> f32) -> Option<Vec3> {
        let filling = |at: DVec3| self.cell(at, &remaining).filling_at(at);
        let at = at_voxel.as_dvec3();
        let change = |axis: DVec3| filling(at + axis) - filling(at - axis);
        let gradient = DVec3::new(change(DVec3::X), change(DVec3::Y), change(DVec3::Z));
        if gradient.length() < 1e-6 {
            return None;
        }
        (self.volume_from_gradient * -gradient.as_vec3()).try_normalize()
    }

    pub(super) fn may_be_matter_in(&self, block: DVec3) -> bool {
        let block = block.as_ivec3().clamp(IVec3::ZERO, self.blocks.as_ivec3() - 1).as_uvec3();
        self.may_be_matter[linear_index(self.blocks, block)]
    }

    /// The cell around a place; beside the grid its outermost voxels continue.
    pub(super) fn cell(&self, at_voxel: DVec3, remaining: &impl Fn(UVec3) -> f32) -> Cell {
        let last = self.grid.size.as_ivec3() - 1;
        let low = at_voxel.floor().as_ivec3();
        let voxels = std::array::from_fn(|corner| {
            let offset = IVec3::new((corner & 1) as i32, (corner >> 1 & 1) as i32, (corner >> 2 & 1) as i32);
            (low + offset).clamp(IVec3::ZERO, last).as_uvec3()
        });
        let filling = voxels.map(|voxel| match self.structures.solid()[self.grid.index(voxel)] {
            0 => 0.0,
            solid => f64::from(solid) / 255.0 * f64::from(remaining(voxel)),
        });
        Cell { voxels, filling, low: low.as_dvec3() }
    }

    pub(super) fn hit(
        &self,
        distance: f64,
        at_voxel: DVec3,
        direction: DVec3,
        origin_m: Vec3,
        normal: Option<Vec3>,
        remaining: &impl Fn(UVec3) -> f32,
    ) -> VolumeHit {
        let cell = self.cell(at_voxel, remaining);
        let shares = cell.weights(at_voxel).into_iter().zip(cell.filling).map(|(weight, filling)| weight * filling);
        let most = shares.zip(cell.voxels).reduce(|most, next| if next.0 > most.0 { next } else { most });
        let voxel = most.map_or(UVec3::ZERO, |(_, voxel)| voxel);
        let normal = normal.or_else(|| self.normal_at(at_voxel.as_vec3(), remaining));
        VolumeHit {
            distance_m: distance as f32,
            position_m: (origin_m.as_dvec3() + direction * distance).as_vec3(),
            at_voxel: at_voxel.as_vec3(),
            normal: normal.unwrap_or(-direction.as_vec3()),
            voxel,
            label: self.structures.labels()[self.grid.index(voxel)],
        }
    }
}

/// Whether any voxel of a box is filled to a half.
fn holds_matter(solid: &[u8], grid: &VolumeGrid, voxels: VoxelBox) -> bool {
    let width = voxels.size().x as usize;
    (voxels.min.z..voxels.max.z).any(|z| {
        (voxels.min.y..voxels.max.y).any(|y| {
            let start = grid.index(UVec3::new(voxels.min.x, y, z));
            solid[start..start + width].iter().any(|&solid| f64::from(solid) >= SURFACE * 255.0)
        })
    })
}

/// Distance at which a ray leaves a cube.
fn exit(origin: DVec3, along: DVec3, low: DVec3, side: f64) -> f64 {
    (0..3).filter(|&axis| along[axis] != 0.0).fold(f64::INFINITY, |least, axis| {
        let wall = if along[axis] > 0.0 { low[axis] + side } else { low[axis] };
        least.min((wall - origin[axis]) / along[axis])
    })
}

/// The first place in 0..=1 where a cubic polynomial is not negative; exact to a millionth.
///
/// Along a ray a trilinear function is such a polynomial: it is found from four of its values, and searched between the places
/// where it turns.
fn first_crossing(value_at: impl Fn(f64) -> f64) -> Option<f64> {
    let [p, q, r, s] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(value_at);
    if p >= 0.0 {
        return Some(0.0);
    }
    let linear = (-11.0 * p + 18.0 * q - 9.0 * r + 2.0 * s) * 0.5;
    let square = (18.0 * p - 45.0 * q + 36.0 * r - 9.0 * s) * 0.5;
    let cube = (-9.0 * p + 27.0 * q - 27.0 * r + 9.0 * s) * 0.5;
    let polynomial = |x: f64| ((cube * x + square) * x + linear) * x + p;
    // Zeros of 3 cube x^2 + 2 square x + linear, in the form that does not cancel.
    let discriminant = square * square - 3.0 * cube * linear;
    let mut turns = [1.0, 1.0];
    if discriminant > 0.0 {
        let sum = -(square + discriminant.sqrt().copysign(square));
        turns = [sum / (3.0 * cube), linear / sum].map(|x| if x > 0.0 && x < 1.0 { x } else { 1.0 });
        turns.sort_by(f64::total_cmp);
    }
    let mut low = 0.0;
    for mut high in [turns[0], turns[1], 1.0] {
        if polynomial(high) >= 0.0 {
            while high - low > 1e-6 {
                let middle = 0.5 * (low + high);
                if polynomial(middle) >= 0.0 { high = middle } else { low = middle }
            }
            return Some(high);
        }
        low = high;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    /// Structures of a grid whose solid share is given per voxel; label 1 for x below a voxel, 2 beyond.
    fn picker(size: UVec3, spacing_mm: DVec3, border: u32, solid: impl Fn(Vec3) -> f32) -> VolumePicker {
        let grid = VolumeGrid::upright(size, spacing_mm);
        let voxels =
            (0..size.z).flat_map(|z| (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec3::new(x, y, z))));
        let (mut filled, mut labels) = (Vec::new(), Vec::new());
        for voxel in voxels {
            let share = (solid(voxel.as_vec3()).clamp(0.0, 1.0) * 255.0).round() as u8;
            filled.push(share);
            labels.push(if share == 0 { 0 } else { 1 + u8::from(voxel.x >= border) });
        }
        let named = |name: &str| super::super::structures::Structure {
            name: name.into(),
            colour: [255; 3],
            tissue: Default::default(),
            hardness: 1.0,
            bleeding_ml_per_s_mm3: 0.0,
            is_critical: false,
        };
        let structures = Structures::new(vec![named("left"), named("right")], labels, filled).expect("good structures");
        VolumePicker::new(grid, structures.into()).expect("of one size")
    }

    fn untouched(_: UVec3) -> f32 {
        1.0
    }

    fn random_direction(random: &mut Pcg32) -> Vec3 {
        let mut part = || random.random_range(-1.0..1.0_f32);
        Vec3::new(part(), part(), part()).normalize_or(Vec3::X)
    }

    #[test]
    fn a_ball_is_met_where_it_is() {
        let (size, middle, radius) = (UVec3::splat(64), Vec3::splat(31.5), 20.0);
        // A half at the radius, and no kink within reach of the differences.
        let ball = |voxel: Vec3| 0.5 + (radius - voxel.distance(middle)) / 5.0;
        let picker = picker(size, DVec3::ONE, 32, ball);
        let mut random = Pcg32::seed_from_u64(3);
        for _ in 0..500 {
            let (out, aim) = (random_direction(&mut random), random_direction(&mut random) * 0.008);
            let (origin, direction) = (out * 0.06, aim - out * 0.06);
            let hit = picker.pick(origin, direction, 1.0, untouched).expect("the ball");
            assert!((hit.position_m.length() - 0.02).abs() < 0.06e-3, "{} m from the middle", hit.position_m.length());
            assert!((origin + direction.normalize() * hit.distance_m - hit.position_m).length() < 1e-6);
            let cosine = hit.normal.dot(hit.position_m.normalize());
            assert!(cosine > 3_f32.to_radians().cos(), "{} degrees", cosine.acos().to_degrees());
            assert_eq!(hit.label, if hit.voxel.x < 32 { 1 } else { 2 });
            assert!(hit.voxel.as_vec3().distance(hit.at_voxel) < 1.75, "{} is not at {}", hit.voxel, hit.at_voxel);
            let too_short = picker.pick(origin, direction, hit.distance_m - 1e-5, untouched);
            assert_eq!(too_short, None);
        }
        assert_eq!(picker.pick(Vec3::new(0.0, 0.03, 0.1), Vec3::NEG_Z, 1.0, untouched), None);
        let inside = picker.pick(Vec3::new(0.0, 0.0, 0.0195), Vec3::X, 1.0, untouched).expect("matter at once");
        assert_eq!(inside.distance_m, 0.0);
        assert!(inside.normal.z > 0.99, "{}", inside.normal);
        // Deep in matter nothing tells a direction but the ray.
        let deep = picker.pick(Vec3::ZERO, Vec3::Y, 1.0, untouched).expect("matter at once");
        assert_eq!((deep.distance_m, deep.normal), (0.0, Vec3::NEG_Y));
    }

    #[test]
    fn normals_stand_on_surfaces_also_where_voxels_are_flat() {
        // A slope of 45 degrees in voxels, on voxels four times as high as wide.
        let plane = |voxel: Vec3| 20.5 - (voxel.x + voxel.y) * std::f32::consts::FRAC_1_SQRT_2;
        let picker = picker(UVec3::splat(32), DVec3::new(1.0, 4.0, 1.0), 99, plane);
        let hit = picker.pick(Vec3::splat(0.5), Vec3::NEG_ONE, 9.0, untouched).expect("the plane");
        let expected = Vec3::new(1.0, 0.25, 0.0).normalize();
        assert!(hit.normal.distance(expected) < 1e-2, "{} instead of {expected}", hit.normal);
    }

    #[test]
    fn matter_at_the_side_of_the_grid_ends_there() {
        let picker = picker(UVec3::new(5, 6, 7), DVec3::ONE, 2, |_| 1.0);
        let hit = picker.pick(Vec3::new(1.0, 0.0, 0.0), Vec3::NEG_X, 9.0, untouched).expect("the side");
        assert!((hit.position_m.x - 2.5e-3).abs() < 1e-8, "{}", hit.position_m);
        assert_eq!((hit.normal, hit.voxel.x, hit.label), (Vec3::X, 4, 2));
        assert_eq!(picker.filling_at(Vec3::new(-0.4, 5.4, 3.0), untouched), 1.0);
        assert_eq!(picker.filling_at(Vec3::new(-0.6, 5.4, 3.0), untouched), 0.0);
    }

    #[test]
    fn rays_that_are_none_meet_nothing() {
        let picker = picker(UVec3::splat(4), DVec3::ONE, 2, |_| 1.0);
        for (origin, direction, far) in [
            (Vec3::ZERO, Vec3::ZERO, 1.0),
            (Vec3::ZERO, Vec3::NAN, 1.0),
            (Vec3::NAN, Vec3::X, 1.0),
            (Vec3::INFINITY, Vec3::X, 1.0),
            (Vec3::ZERO, Vec3::X, f32::NAN),
            (Vec3::ZERO, Vec3::X, -1.0),
            (Vec3::ONE, Vec3::X, 1.0),
        ] {
            let hit = picker.pick(origin, direction, far, untouched);
            // Without a greatest distance the grid itself is the limit.
            assert!(hit.is_none() || far.is_nan(), "{origin} {direction} {far}: {hit:?}");
        }
        // From very far away numbers are coarse, but every ray ends.
        for far in [1e4_f32, 1e12, f32::MAX] {
            picker.pick(Vec3::X * far, Vec3::NEG_X, f32::MAX, untouched);
            picker.pick(Vec3::splat(far), Vec3::NEG_ONE, f32::INFINITY, |_| 0.4);
            picker.pick(Vec3::new(far, 0.1, 0.0), Vec3::new(-1.0, 1e-30, 1e-6), f32::INFINITY, |_| 0.4);
        }
        let grid = VolumeGrid::upright(UVec3::splat(5), DVec3::ONE);
        assert!(VolumePicker::new(grid, picker.structures().clone()).is_none());
    }

    /// The first place where a fine walk along the ray finds matter, voxels from its start.
    fn by_walking(
        picker: &VolumePicker,
        origin: Vec3,
        along: Vec3,
        far: f32,
        remaining: impl Fn(UVec3) -> f32,
    ) -> Option<f32> {
        (0..(far * 100.0) as u32)
            .map(|step| step as f32 * 0.01)
            .find(|&distance| picker.filling_at(origin + along * distance, &remaining) >= SURFACE as f32)
    }

    #[test]
    fn rays_meet_what_a_fine_walk_meets_also_after_cutting() {
        let mut random = Pcg32::seed_from_u64(11);
        let size = UVec3::new(21, 34, 18);
        // Lumps: most of it empty, with full, half full and thin places.
        let lumps: Vec<f32> = (0..size.element_product()).map(|_| random.random_range(0.0..1.0_f32)).collect();
        let grid = VolumeGrid::upright(size, DVec3::ONE);
        let is_lump = |voxel: Vec3| (voxel * 0.4).to_array().map(f32::sin).iter().product::<f32>() > 0.35;
        let picker =
            picker(
                size,
                DVec3::ONE,
                9,
                |voxel| {
                    if is_lump(voxel) { 0.4 + lumps[grid.index(voxel.as_uvec3())] } else { 0.0 }
                },
            );
        assert!(picker.may_be_matter.contains(&false) && picker.may_be_matter.contains(&true));
        let cut = |voxel: UVec3| if voxel.y.is_multiple_of(5) { 0.0 } else { (voxel.z % 4) as f32 / 3.0 };
        let volume_from_voxel: Affine3A = grid.volume_from_voxel();
        let mut met = [0; 2];
        for case in 0..1500 {
            let target = size.as_vec3() * Vec3::from_array(std::array::from_fn(|_| random.random_range(0.1..0.9_f32)));
            let along = if case % 7 == 0 { Vec3::AXES[case % 3] } else { random_direction(&mut random) };
            let start = target - along * 30.0;
            let origin_m = volume_from_voxel.transform_point3(start);
            let direction = volume_from_voxel.transform_vector3(along);
            for (kind, met) in met.iter_mut().enumerate() {
                let remaining = |voxel: UVec3| if kind == 1 { cut(voxel) } else { 1.0 };
                let expected = by_walking(&picker, start, along, 60.0, remaining);
                match picker.pick(origin_m, direction, 0.06, remaining) {
                    Some(hit) => {
                        *met += 1;
                        let distance = hit.distance_m * 1e3;
                        // The walk may step over a grazed corner that the picker rightly meets.
                        let filling = picker.filling_at(hit.at_voxel, remaining);
                        assert!(filling > 0.499, "ray {case} meets a filling of {filling}");
                        if let Some(expected) = expected {
                            assert!(distance < expected + 1e-3, "ray {case}: {distance} beyond {expected}");
                        }
                        let before = by_walking(&picker, start, along, distance - 1e-3, remaining);
                        assert_eq!(before, None, "ray {case} misses matter before {distance}");
                    }
                    None => assert_eq!(expected, None, "ray {case}"),
                }
            }
        }
        assert!(met[0] > 500 && met[1] > 200 && met[1] < met[0], "{met:?}");
    }

    #[test]
    fn first_crossings_of_cubics() {
        let of =
            |zeros: [f64; 3], sign: f64| first_crossing(|x| zeros.iter().map(|zero| x - zero).product::<f64>() * sign);
        let near = |found: Option<f64>, expected: f64| found.is_some_and(|found| (found - expected).abs() < 2e-6);
        assert!(near(of([0.2, 0.5, 0.9], 1.0), 0.2));
        assert!(near(of([-0.2, 0.5, 0.9], -1.0), 0.5));
        assert!(near(of([-0.9, -0.5, 0.9], 1.0), 0.9));
        assert!(near(of([0.98, 0.99, 7.0], 1.0), 0.98));
        assert_eq!(of([1.2, 1.5, 1.9], 1.0), None);
        assert!(near(first_crossing(|x| x - 0.3), 0.3));
        assert!(near(first_crossing(|x| 0.01 - (x - 0.5) * (x - 0.5)), 0.4));
        assert_eq!(first_crossing(|_| -1.0), None);
    }
}
