//! What is left of volumes around a tool, as the loop wants it.

use super::kept::Kept;
use crate::haptics::force::{BoneBrick, BonePatch, SurfaceFeel};
use crate::tools::bodies::TouchedVolume;
use crate::volume::{DeformedVolume, VoxelBox};
use bevy::math::{Affine3A, DAffine3, DVec3, UVec3};
use std::sync::Arc;

/// How far beyond a tip voxels are told of, metres: further than a hand gets between two steps at a surgeon's speeds.
const BEYOND_M: f64 = 3e-3;
/// Voxels on either side of the tip, at least and at most.
const HALF_VOXELS: [f64; 2] = [8.0, 24.0];
/// A patch is made anew when the tip has moved by this share of what it holds beyond it.
const STRAY_SHARE: f64 = 0.35;

/// A ball does not feel what is much finer than itself: its surface is made of voxels of up to this share of its radius.
const COARSEST_SHARE: f64 = 0.35;

/// What was told of a volume.
pub(super) struct ToldBone {
    of: Arc<crate::volume::structures::Structures>,
    cut: (u64, u64),
    lattice: u64,
    placed: Affine3A,
    tip: DVec3,
    feel: SurfaceFeel,
    voxels: VoxelBox,
    has_surface: bool,
    patch: Option<Arc<BonePatch>>,
}

/// From voxels at rest to the world around a tip, and the tip in voxels at rest. Through a lattice by its slope there.
fn map(bone: &TouchedVolume, tip_m: DVec3) -> (DAffine3, DVec3) {
    let volume_from_voxel = bone.picker.grid().volume_from_voxel().as_daffine3();
    let world_from_voxel = bone.world_from_volume.as_daffine3() * volume_from_voxel;
    let shown = world_from_voxel.inverse().transform_point3(tip_m);
    let Some(lattice) = bone.deformed.map(DeformedVolume::lattice) else { return (world_from_voxel, shown) };
    let rest = lattice.rest_from_shown(shown.as_vec3()).as_dvec3();
    let shown_per_rest = lattice.slope_at(shown.as_vec3()).inverse().as_dmat3();
    if !shown_per_rest.is_finite() {
        return (world_from_voxel, shown);
    }
    let shown_from_rest = DAffine3::from_mat3_translation(shown_per_rest, shown - shown_per_rest * rest);
    (world_from_voxel * shown_from_rest, rest)
}

impl Kept<ToldBone> {
    /// The voxels around a tip of a radius and, unless a burr turns, their surface. None where there is nothing to touch.
    pub(super) fn patch(
        &mut self,
        bone: &TouchedVolume,
        tip_m: DVec3,
        tip_radius_m: f64,
        with_surface: bool,
    ) -> Option<Arc<BonePatch>> {
        let (world_from_voxel, tip) = map(bone, tip_m);
        if !(world_from_voxel.is_finite() && tip.is_finite()) {
            return None;
        }
        let grid = bone.picker.grid();
        let axes = world_from_voxel.matrix3;
        let voxel_m = axes.x_axis.length().min(axes.y_axis.length()).min(axes.z_axis.length()).max(1e-6);
        // A burr that turns takes away whole voxels, and feels them.
        let stride = if with_surface { (tip_radius_m * COARSEST_SHARE / voxel_m).floor().clamp(1.0, 8.0) } else { 1.0 };
        let half =
            ((tip_radius_m + BEYOND_M) / (voxel_m * stride)).ceil().clamp(HALF_VOXELS[0], HALF_VOXELS[1]) * stride;
        let stray = (half - tip_radius_m / voxel_m).max(2.0) * STRAY_SHARE;
        let lattice = bone.deformed.map_or(0, DeformedVolume::revision);
        let cut = (bone.cut.lineage(), bone.cut.revision());
        if let Some(told) = self.get(bone.entity) {
            let is_whole = cut == told.cut
                || cut.0 == told.cut.0
                    && bone.cut.changes_since(told.cut.1).is_some_and(|changes| {
                        changes.iter().all(|change| change.intersection(&told.voxels).is_empty())
                    });
            let serves = is_whole
                && Arc::ptr_eq(&told.of, bone.picker.structures())
                && (told.lattice, told.placed, told.feel) == (lattice, bone.world_from_volume, bone.feel)
                && told.tip.distance(tip) <= stray
                && (told.has_surface || !with_surface);
            if serves {
                let told = self.keep(bone.entity)?;
                told.cut = cut;
                return told.patch.clone();
            }
        }
        let low = (tip - half).floor();
        let bounds = grid.size.as_dvec3();
        if low.cmpge(bounds).any() || (low + 2.0 * half + 1.0).cmple(DVec3::ZERO).any() {
            return None;
        }
        let min = low.max(DVec3::ZERO).as_uvec3();
        let max = (low + 2.0 * half + 2.0).min(bounds).as_uvec3();
        let voxels = VoxelBox { min, max };
        let patch = brick(bone, voxels, world_from_voxel, stride as u32).map(|brick| {
            Arc::new(if with_surface {
                BonePatch::new(brick, bone.feel)
            } else {
                BonePatch::voxels_only(brick, bone.feel)
            })
        });
        let told = ToldBone {
            of: bone.picker.structures().clone(),
            cut,
            lattice,
            placed: bone.world_from_volume,
            tip,
            feel: bone.feel,
            voxels,
            has_surface: with_surface,
            patch: patch.clone(),
        };
        self.insert(bone.entity, told);
        patch
    }
}

/// Voxels of a box, with what is left of them; none where that is nothing. Where the box reaches the grid's side, a layer of air
/// around it closes the surface.
fn brick(bone: &TouchedVolume, of: VoxelBox, world_from_voxel: DAffine3, stride: u32) -> Option<BoneBrick> {
    let (grid, structures) = (bone.picker.grid(), bone.picker.structures());
    let (size, margin) = (of.size(), UVec3::ONE);
    let mut left = vec![0; of.count()];
    bone.cut.copy_remaining(of, &mut left);
    let padded = size + 2 * margin;
    let count = padded.element_product() as usize;
    let (mut solid, mut label) = (vec![0_u8; count], vec![0_u8; count]);
    let mut any = 0_u8;
    for z in 0..size.z {
        for y in 0..size.y {
            let from = grid.index(of.min + UVec3::new(0, y, z));
            let row = ((z * size.y + y) * size.x) as usize;
            let to = (((z + 1) * padded.y + y + 1) * padded.x + 1) as usize;
            let width = size.x as usize;
            let sources = structures.solid()[from..from + width].iter().zip(&left[row..row + width]);
            for (into, (&filled, &left)) in solid[to..to + width].iter_mut().zip(sources) {
                // As a product of shares, to the nearest 255th.
                *into = ((u32::from(filled) * u32::from(left) + 127) / 255) as u8;
                any |= *into;
            }
            label[to..to + width].copy_from_slice(&structures.labels()[from..from + width]);
        }
    }
    if any == 0 {
        return None;
    }
    let mut hardness = [1.0; 256];
    for (label, structure) in (1..=255_usize).zip(structures.list()) {
        hardness[label] = structure.hardness;
    }
    let world_from_brick = world_from_voxel * DAffine3::from_translation(of.min.as_dvec3() - margin.as_dvec3());
    let (size, solid, label, map) = coarser(padded, solid, label, stride);
    BoneBrick::new(size, solid, label, hardness, world_from_brick * map)
}

/// Voxels joined to larger ones: how full these are in the mean, the label in their middle, and the map from their coordinates.
fn coarser(size: UVec3, solid: Vec<u8>, label: Vec<u8>, stride: u32) -> (UVec3, Vec<u8>, Vec<u8>, DAffine3) {
    if stride <= 1 {
        return (size, solid, label, DAffine3::IDENTITY);
    }
    let index = |at: UVec3| ((at.z * size.y + at.y) * size.x + at.x) as usize;
    let joined = size.map(|side| side.div_ceil(stride));
    let count = joined.element_product() as usize;
    let (mut sums, mut labels) = (vec![0_u32; count], Vec::with_capacity(count));
    let place = |at: UVec3| (((at.z / stride) * joined.y + at.y / stride) * joined.x) as usize;
    for z in 0..size.z {
        for y in 0..size.y {
            let row = place(UVec3::new(0, y, z));
            let from = index(UVec3::new(0, y, z));
            for (x, &solid) in (0..size.x).zip(&solid[from..from + size.x as usize]) {
                sums[row + (x / stride) as usize] += u32::from(solid);
            }
        }
    }
    for z in 0..joined.z {
        for y in 0..joined.y {
            for x in 0..joined.x {
                labels.push(label[index((UVec3::new(x, y, z) * stride + stride / 2).min(size - 1))]);
            }
        }
    }
    // What lies beyond the box is air.
    let solid = sums.iter().map(|&sum| (sum / stride.pow(3)) as u8).collect();
    let middle = DVec3::splat(0.5 * f64::from(stride - 1));
    let map = DAffine3::from_scale_rotation_translation(DVec3::splat(stride.into()), glam::DQuat::IDENTITY, middle);
    (joined, solid, labels, map)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_voxels_hold_as_much_and_lie_where_it_was() {
        // Full for x < 4 of 7 voxels: joined by two, half of them are full, and one beyond the box counts as air.
        let size = UVec3::new(7, 4, 4);
        let solid: Vec<u8> = (0..size.element_product()).map(|at| if at % 7 < 4 { 255 } else { 0 }).collect();
        let label: Vec<u8> = solid.iter().map(|&solid| u8::from(solid > 0)).collect();
        let (joined, coarse, labels, map) = coarser(size, solid.clone(), label.clone(), 2);
        assert_eq!(joined, UVec3::new(4, 2, 2));
        assert_eq!(coarse[..4], [255, 255, 0, 0]);
        assert_eq!(labels[..4], [1, 1, 0, 0]);
        // The middle of voxels 0 and 1 is at 0.5.
        assert_eq!(map.transform_point3(DVec3::ZERO), DVec3::splat(0.5));
        assert_eq!(map.transform_point3(DVec3::X), DVec3::new(2.5, 0.5, 0.5));
        assert_eq!(coarser(size, solid.clone(), label, 1).1, solid);
    }
}
