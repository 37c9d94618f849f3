//! Distance fields of structures, kept up to date while they are drilled.

use super::super::cut::CutVolume;
use super::super::grid::{VolumeGrid, VoxelBox, linear_index};
use super::super::structures::Structures;
use super::transform::{BEYOND, distances, grown, window};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Widest band, millimetres.
pub const MAX_BAND_MM: f32 = 600.0;

/// Distances from the voxels around a structure to the nearest of its voxels that is not drilled away (remaining opacity of
/// 0.5 or more), between centres, in steps of 0.01 mm, up to a band.
///
/// Exact on grids with perpendicular axes; on a skewed grid the distances are lower bounds, for warnings must not come late.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
pub struct StructureDistance {
    label: u8,
    band_mm: f32,
    size: UVec3,
    spacing_mm: Vec3,
    /// Around the structure's voxels.
    structure: VoxelBox,
    /// The same grown by the band.
    bounds: VoxelBox,
    hundredths_mm: Vec<u16>,
}

impl StructureDistance {
    /// The field of one structure; none if no voxel has the label, or the structures or the cut are another grid's. The band
    /// is taken between 0.01 mm and [`MAX_BAND_MM`].
    pub fn build(grid: &VolumeGrid, structures: &Structures, cut: &CutVolume, label: u8, band_mm: f32) -> Option<Self> {
        let structure = bounds_by_label(grid, structures, cut)?[usize::from(label)]?;
        Some(Self::build_within(grid, structures, cut, label, band_mm, structure))
    }

    fn build_within(
        grid: &VolumeGrid,
        structures: &Structures,
        cut: &CutVolume,
        label: u8,
        band_mm: f32,
        structure: VoxelBox,
    ) -> Self {
        let band_mm = if band_mm > 0.01 { band_mm.min(MAX_BAND_MM) } else { 0.01 };
        let spacing_mm = safe_spacing_mm(grid);
        let bounds = grown(structure, window(spacing_mm, band_mm), grid.size);
        let mut field =
            Self { label, band_mm, size: grid.size, spacing_mm, structure, bounds, hundredths_mm: Vec::new() };
        field.hundredths_mm = field.compute(structures, cut, bounds);
        field
    }

    /// Bytes of the field.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.hundredths_mm.as_slice())
    }

    fn compute(&self, structures: &Structures, cut: &CutVolume, of: VoxelBox) -> Vec<u16> {
        let is_there = |first: UVec3, there: &mut [bool]| {
            let row = VoxelBox { min: first, max: first + UVec3::new(there.len() as u32, 1, 1) };
            let labels = &structures.labels()[linear_index(self.size, first)..][..there.len()];
            for (there, &label) in there.iter_mut().zip(labels) {
                *there = label == self.label;
            }
            if cut.is_untouched(row) {
                return;
            }
            for (place, there) in there.iter_mut().enumerate().filter(|(_, there)| **there) {
                *there = is_left(cut, first + UVec3::new(place as u32, 0, 0));
            }
        };
        distances(of, self.size, self.spacing_mm, self.band_mm, &is_there)
    }

    /// The structure's label.
    pub fn label(&self) -> u8 {
        self.label
    }

    /// Distance up to which the field knows it, millimetres.
    pub fn band_mm(&self) -> f32 {
        self.band_mm
    }

    /// The voxels that the field covers: all within the band of the structure.
    pub fn bounds(&self) -> VoxelBox {
        self.bounds
    }

    /// Distance from a point in voxel coordinates, trilinear, millimetres; none beyond the band.
    ///
    /// Outside the grid, where the middle of a burr is that touches bone at the grid's side, it is a lower bound: as if the
    /// structure lay at a right angle to the way into the grid.
    pub fn distance_mm(&self, voxel: Vec3) -> Option<f32> {
        let inside = voxel.clamp(Vec3::ZERO, self.size.as_vec3() - 1.0);
        let outside_mm = ((voxel - inside) * self.spacing_mm).length();
        let (low, high) = (self.bounds.min.as_vec3() - 1.0, self.bounds.max.as_vec3());
        if voxel.is_nan() || inside.cmplt(low).any() || inside.cmpgt(high).any() {
            return None;
        }
        let voxel = inside;
        let low = voxel.floor();
        let part = voxel - low;
        let low = low.as_uvec3();
        let high = (low + 1).min(self.size - 1);
        let at = |x, y, z| self.at(UVec3::new(x, y, z));
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |y, z| mix(at(low.x, y, z), at(high.x, y, z), part.x);
        let plane = |z| mix(row(low.y, z), row(high.y, z), part.y);
        let inside_mm = mix(plane(low.z), plane(high.z), part.z);
        let mm = inside_mm.hypot(outside_mm);
        (mm < self.band_mm).then_some(mm)
    }

    /// Distance of a voxel, the band's width beyond it.
    fn at(&self, voxel: UVec3) -> f32 {
        if voxel.cmplt(self.bounds.min).any() || voxel.cmpge(self.bounds.max).any() {
            return self.band_mm;
        }
        match self.hundredths_mm[linear_index(self.bounds.size(), voxel - self.bounds.min)] {
            BEYOND => self.band_mm,
            hundredths => f32::from(hundredths) * 0.01,
        }
    }

    /// Takes over what changed in a box of the cut, drilled or brought back by an undo. Gives the box of voxels whose distance
    /// was found anew: around those that the structure lost or got back, and a band. None if there were none.
    pub fn update(&mut self, structures: &Structures, cut: &CutVolume, changed: VoxelBox) -> Option<VoxelBox> {
        let changed = changed.intersection(&self.structure);
        if changed.is_empty() || cut.size() != self.size || structures.labels().len() != count(self.size) {
            return None;
        }
        let (mut low, mut high) = (UVec3::MAX, UVec3::ZERO);
        for z in changed.min.z..changed.max.z {
            for y in changed.min.y..changed.max.y {
                let first = UVec3::new(changed.min.x, y, z);
                let labels = &structures.labels()[linear_index(self.size, first)..][..changed.size().x as usize];
                let known = &self.hundredths_mm[linear_index(self.bounds.size(), first - self.bounds.min)..];
                for (place, (&label, &known)) in labels.iter().zip(known).enumerate() {
                    let voxel = first + UVec3::new(place as u32, 0, 0);
                    if label == self.label && is_left(cut, voxel) != (known == 0) {
                        low = low.min(voxel);
                        high = high.max(voxel + 1);
                    }
                }
            }
        }
        if low.cmpge(high).any() {
            return None;
        }
        let lost = VoxelBox { min: low, max: high };
        let anew = grown(lost, window(self.spacing_mm, self.band_mm), self.size).intersection(&self.bounds);
        let found = self.compute(structures, cut, anew);
        let width = anew.size().x as usize;
        for (row, found) in found.chunks(width).enumerate() {
            let row = row as u32;
            let voxel = anew.min + UVec3::new(0, row % anew.size().y, row / anew.size().y);
            let first = linear_index(self.bounds.size(), voxel - self.bounds.min);
            self.hundredths_mm[first..first + width].copy_from_slice(found);
        }
        Some(anew)
    }
}

/// Distance fields of all critical structures of a volume.
#[derive(Clone, Component, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct CriticalDistances {
    fields: Vec<StructureDistance>,
    /// Of the cut that the fields are up to date with.
    revision: u64,
}

impl CriticalDistances {
    /// Fields of the structures that are marked as critical and have voxels, on all threads; none if the structures or the
    /// cut are another grid's. `band_mm` as for [`StructureDistance::build`].
    pub fn build(grid: &VolumeGrid, structures: &Structures, cut: &CutVolume, band_mm: f32) -> Self {
        let bounds = bounds_by_label(grid, structures, cut).unwrap_or([None; 256]);
        let critical = (1..=255u8).filter(|&label| structures.of_label(label).is_some_and(|it| it.is_critical));
        let wanted: Vec<(u8, VoxelBox)> =
            critical.filter_map(|label| Some((label, bounds[usize::from(label)]?))).collect();
        let build = |&(label, structure): &(u8, VoxelBox)| {
            StructureDistance::build_within(grid, structures, cut, label, band_mm, structure)
        };
        Self { fields: wanted.par_iter().map(build).collect(), revision: cut.revision() }
    }

    /// The fields, by ascending label.
    pub fn fields(&self) -> &[StructureDistance] {
        &self.fields
    }

    /// Takes over what changed in the cut since the last time; whether any distance did.
    pub fn update(&mut self, structures: &Structures, cut: &CutVolume) -> bool {
        if cut.revision() == self.revision {
            return false;
        }
        let everything = || vec![VoxelBox { min: UVec3::ZERO, max: cut.size() }];
        let changed = cut.changes_since(self.revision).unwrap_or_else(everything);
        self.revision = cut.revision();
        let mut is_changed = false;
        for field in &mut self.fields {
            for &changed in &changed {
                is_changed |= field.update(structures, cut, changed).is_some();
            }
        }
        is_changed
    }

    /// The critical structure nearest to a point in voxel coordinates and its distance in millimetres, if one is within the
    /// band; of several as near the one with the lowest label.
    pub fn nearest(&self, voxel: Vec3) -> Option<(u8, f32)> {
        let distances = self.fields.iter().filter_map(|field| Some((field.label, field.distance_mm(voxel)?)));
        distances.reduce(|nearest, other| if other.1 < nearest.1 { other } else { nearest })
    }
}

fn is_left(cut: &CutVolume, voxel: UVec3) -> bool {
    cut.remaining(voxel) >= 0.5
}

fn count(size: UVec3) -> usize {
    size.x as usize * size.y as usize * size.z as usize
}

/// The box around the voxels of each label.
fn bounds_by_label(grid: &VolumeGrid, structures: &Structures, cut: &CutVolume) -> Option<[Option<VoxelBox>; 256]> {
    if structures.labels().len() != grid.count() || cut.size() != grid.size {
        return None;
    }
    let width = grid.size.x as usize;
    let of_plane = |(z, plane): (usize, &[u8])| {
        let mut bounds = [None; 256];
        for (y, row) in plane.chunks(width).enumerate() {
            let mut first = 0;
            // Runs of one label.
            for run in row.chunk_by(|a, b| a == b) {
                let min = UVec3::new(first as u32, y as u32, z as u32);
                first += run.len();
                if run[0] > 0 {
                    let run_box = VoxelBox { min, max: UVec3::new(first as u32, y as u32 + 1, z as u32 + 1) };
                    unite(&mut bounds[usize::from(run[0])], run_box);
                }
            }
        }
        bounds
    };
    let planes = structures.labels().par_chunks(width * grid.size.y as usize).enumerate().map(of_plane);
    let all = planes.reduce(
        || [None; 256],
        |mut all, plane| {
            for (all, plane) in all.iter_mut().zip(plane) {
                if let Some(plane) = plane {
                    unite(all, plane);
                }
            }
            all
        },
    );
    Some(all)
}

fn unite(all: &mut Option<VoxelBox>, one: VoxelBox) {
    *all = Some(all.map_or(one, |all| all.union(&one)));
}

/// Spacings with which sums of squares along the axes are no longer than the distance: on a skewed grid the shortest that a
/// vector can come out, by Gershgorin's bound on the cosines between the axes.
fn safe_spacing_mm(grid: &VolumeGrid) -> Vec3 {
    let axes = grid.lps_mm_from_voxel.matrix3;
    let [x, y, z] = [axes.x_axis, axes.y_axis, axes.z_axis].map(|axis| axis.normalize());
    let [xy, xz, yz] = [x.dot(y).abs(), x.dot(z).abs(), y.dot(z).abs()];
    let skew = (xy + xz).max(xy + yz).max(xz + yz);
    // What the single precision of some headers leaves of a right angle is none.
    let shrink = if skew < 1e-4 { 1.0 } else { (1.0 - skew).max(0.01).sqrt() };
    (grid.spacing_mm() * shrink).as_vec3()
}
