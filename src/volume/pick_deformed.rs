//! Rays through a volume that a lattice deforms: where they meet the matter that is shown.

use super::VoxelLattice;
use super::pick::{BLOCK_SIDE, SURFACE, VolumeHit, VolumePicker};
use glam::{DVec3, UVec3, Vec3};

/// Longest way of the matter at rest between two looks at it, voxels.
const STEP_VOXELS: f64 = 0.25;

impl VolumePicker {
    /// As [`VolumePicker::pick`], through a lattice. Place and normal are those that are shown; the voxel and its coordinates are
    /// those of the matter at rest. What is thinner than a quarter of a voxel may be missed.
    pub fn pick_deformed(
        &self,
        origin_m: Vec3,
        direction: Vec3,
        max_distance_m: f32,
        lattice: &VoxelLattice,
        remaining: impl Fn(UVec3) -> f32,
    ) -> Option<VolumeHit> {
        let direction = direction.as_dvec3().try_normalize()?;
        let origin = self.voxel_from_volume.transform_point3(origin_m.as_dvec3());
        let along = self.voxel_from_volume.transform_vector3(direction);
        let (least, most) = lattice.translation_bounds();
        let (low, high) = (Vec3::splat(-0.5) - most, self.grid.size.as_vec3() - 0.5 - least);
        let (mut from, mut to) = (0.0_f64, f64::from(max_distance_m));
        for axis in 0..3 {
            let (low, high) = (f64::from(low[axis]) - origin[axis], f64::from(high[axis]) - origin[axis]);
            if along[axis] != 0.0 {
                let (a, b) = (low / along[axis], high / along[axis]);
                (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
            } else if low > 0.0 || high < 0.0 {
                return None;
            }
        }
        // Also `false` for what is not a number.
        if !(origin.is_finite() && from <= to) {
            return None;
        }
        let rest_at = |distance: f64| lattice.rest_from_shown((origin + along * distance).as_vec3()).as_dvec3();
        let filling = |distance: f64| {
            let rest = rest_at(distance);
            let is_inside = rest.cmpge(DVec3::splat(-0.5)).all() && rest.cmple(self.grid.size.as_dvec3() - 0.5).all();
            if is_inside { self.cell(rest, &remaining).filling_at(rest) } else { 0.0 }
        };
        let (slow, fast) = lattice.speeds(along.as_vec3());
        let (slow, fast) = (slow.as_dvec3(), fast.as_dvec3());
        let step = STEP_VOXELS / slow.abs().max(fast.abs()).max_element().max(1e-9);
        let mut at = from;
        let mut is_before = false;
        while at <= to {
            let rest = rest_at(at) + 1.0;
            let side = f64::from(BLOCK_SIDE);
            let block = (rest / side).floor();
            if !self.may_be_matter_in(block) {
                // So far no matter of another block can come by.
                let forth = ((block + 1.0) * side - rest) / fast.max(DVec3::splat(1e-9));
                let back = (block * side - rest) / slow.min(DVec3::splat(-1e-9));
                at += forth.min(back).min_element().max(step);
                // The way before it may have led through a corner of a block with matter.
                is_before = false;
                continue;
            }
            if filling(at) >= SURFACE {
                let distance = if is_before { first_filled(at - step, at, &filling) } else { at };
                return Some(self.hit_deformed(distance, origin_m, direction, lattice, &remaining));
            }
            is_before = true;
            at += step;
        }
        None
    }

    fn hit_deformed(
        &self,
        distance: f64,
        origin_m: Vec3,
        direction: DVec3,
        lattice: &VoxelLattice,
        remaining: &impl Fn(UVec3) -> f32,
    ) -> VolumeHit {
        let origin = self.voxel_from_volume.transform_point3(origin_m.as_dvec3());
        let shown = (origin + self.voxel_from_volume.transform_vector3(direction) * distance).as_vec3();
        let rest = lattice.rest_from_shown(shown).as_dvec3();
        let hit = self.hit(distance, rest, direction, origin_m, None, remaining);
        // A normal at rest is a gradient; the field turns gradients on their way to the picture.
        let at_rest = self.volume_from_gradient.inverse() * hit.normal;
        let normal = self.volume_from_gradient * (lattice.slope_at(shown).transpose() * at_rest);
        VolumeHit { normal: normal.try_normalize().unwrap_or(hit.normal), ..hit }
    }
}

/// Where between two distances the filling passes the surface.
fn first_filled(mut low: f64, mut high: f64, filling: &impl Fn(f64) -> f64) -> f64 {
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if filling(middle) >= SURFACE { high = middle } else { low = middle }
    }
    high
}
