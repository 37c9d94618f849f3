//! A deformed volume, voxel by voxel: what every way of drawing one is held against, and a way to keep a deformation.

use super::data::{Volume, Voxels};
use super::error::VolumeFault;
use super::grid::VolumeGrid;
use super::structures::Structures;
use crate::deform::{DeformLattice, LatticeError};
use glam::{Affine3A, DVec3, UVec3, Vec3};
use rayon::prelude::*;

impl VolumeGrid {
    /// A lattice at rest over the box of the grid, in the volume's own space; shares run along i, j and k.
    ///
    /// # Errors
    /// [`LatticeError::TooDeep`].
    pub fn lattice(&self, level: u32) -> Result<DeformLattice, LatticeError> {
        let size = self.size.as_vec3();
        let voxel_from_box = Affine3A::from_scale(size);
        let volume_from_corner = self.volume_from_voxel() * Affine3A::from_translation(Vec3::splat(-0.5));
        DeformLattice::over(volume_from_corner * voxel_from_box, level)
    }
}

impl Volume {
    /// The volume as a lattice over its box shows it, computed in double precision: each voxel gets the value at
    /// [`DeformLattice::rest_from_shown`] of its centre, interpolated between the eight voxels around that and rounded to what is
    /// stored. Beyond the grid the values of its outermost voxels go on. The same bits on any number of threads.
    ///
    /// Shares of the lattice's box are taken for those of the grid's, wherever it lies. Structures move along: a voxel belongs to
    /// what the nearest one belonged to. The least and greatest value may draw together.
    ///
    /// # Errors
    /// None for a volume that is one; [`VolumeFault`] is what [`Volume::new`] may say.
    pub fn warped(&self, lattice: &DeformLattice) -> Result<Self, VolumeFault> {
        let size = self.grid().size;
        let field = |voxels: &Voxels| match voxels {
            Voxels::U8(voxels) => Voxels::U8(warp(size, lattice, |at| (mixed(size, voxels, at) + 0.5) as u8)),
            Voxels::I16(voxels) => Voxels::I16(warp(size, lattice, |at| nearest(mixed(size, voxels, at)))),
            Voxels::U16(voxels) => Voxels::U16(warp(size, lattice, |at| (mixed(size, voxels, at) + 0.5) as u16)),
            Voxels::F32(voxels) => Voxels::F32(warp(size, lattice, |at| mixed(size, voxels, at) as f32)),
            Voxels::Rgba(voxels) => Voxels::Rgba(warp(size, lattice, |at| mixed_colour(size, voxels, at))),
        };
        let (slope, intercept) = self.rescale();
        let warped = Self::new(*self.grid(), field(self.voxels()), slope, intercept)?;
        let Some(structures) = self.structures() else { return Ok(warped) };
        let labels = structures.labels();
        let label = |at: DVec3| labels[super::grid::linear_index(size, (at + 0.5).as_uvec3().min(size - 1))];
        let solid = warp(size, lattice, |at| (mixed(size, structures.solid(), at) + 0.5) as u8);
        let moved = Structures::new(structures.list().to_vec(), warp(size, lattice, label), solid)?;
        warped.with_structures(moved)
    }

    /// The value that a lattice over the volume's box shows at the centre of a voxel, not rounded.
    pub fn warped_value(&self, lattice: &DeformLattice, voxel: UVec3) -> f64 {
        let size = self.grid().size;
        let rest = lattice.rest_from_shown((voxel.as_dvec3() + 0.5) / size.as_dvec3());
        let (slope, intercept) = self.rescale();
        slope * Cell::of(size, within(size, rest * size.as_dvec3() - 0.5)).mix(|place| self.voxels().stored(place))
            + intercept
    }
}

/// Voxel coordinates clamped to the centres of the outermost voxels.
#[inline]
fn within(size: UVec3, at: DVec3) -> DVec3 {
    at.clamp(DVec3::ZERO, size.as_dvec3() - 1.0)
}

/// What `sample` says at the place, in voxel coordinates of the grid, that each voxel shows.
fn warp<T: Copy + Default + Send>(size: UVec3, lattice: &DeformLattice, sample: impl Fn(DVec3) -> T + Sync) -> Vec<T> {
    let mut warped = vec![T::default(); size.x as usize * size.y as usize * size.z as usize];
    let scale = size.as_dvec3();
    let tree = lattice.tree();
    let row = |row: usize, into: &mut [T]| {
        let (y, z) = (row % size.y as usize, row / size.y as usize);
        let place_of = |x: usize| (DVec3::new(x as f64, y as f64, z as f64) + 0.5) / scale;
        let mut x = 0;
        while x < into.len() {
            let number = tree.patch_at(place_of(x));
            let patch = tree.patches()[number];
            let (low, high) = (patch.low().x, patch.low().x + patch.side());
            // Along a row the field of one patch is linear.
            let end = ((high * scale.x - 0.5).ceil() as usize).clamp(x + 1, into.len());
            let at = |share: f64| lattice.translation_in(number, DVec3 { x: share, ..place_of(x) });
            let (first, last) = (at(low), at(high));
            let step = ((last - first) / patch.side() + DVec3::X) * scale / scale.x;
            let start = (DVec3 { x: low, ..place_of(x) } + first) * scale - 0.5 + step * (0.5 - low * scale.x);
            for (x, into) in (x..end).zip(&mut into[x..end]) {
                *into = sample(within(size, start + step * x as f64));
            }
            x = end;
        }
    };
    warped.par_chunks_mut(size.x as usize).enumerate().for_each(|(number, into)| row(number, into));
    warped
}

/// The eight voxels around a place, and where between them it lies.
struct Cell {
    /// Place in memory of the first.
    first: usize,
    /// From one to the next along each axis; 0 along an axis with one voxel only.
    strides: [usize; 3],
    share: DVec3,
}

impl Cell {
    #[inline]
    fn of(size: UVec3, at: DVec3) -> Self {
        let low = at.as_uvec3().min(size.saturating_sub(UVec3::splat(2)));
        let (x, y) = (size.x as usize, size.y as usize);
        let stride = |count: u32, stride: usize| if count > 1 { stride } else { 0 };
        Self {
            first: (low.z as usize * y + low.y as usize) * x + low.x as usize,
            strides: [stride(size.x, 1), stride(size.y, x), stride(size.z, x * y)],
            share: at - low.as_dvec3(),
        }
    }

    #[inline]
    fn mix(&self, value: impl Fn(usize) -> f64) -> f64 {
        let [i, j, k] = self.strides;
        let lerp = |a: f64, b: f64, share: f64| a + (b - a) * share;
        let along_x = |place: usize| lerp(value(place), value(place + i), self.share.x);
        let along_y = |place: usize| lerp(along_x(place), along_x(place + j), self.share.y);
        lerp(along_y(self.first), along_y(self.first + k), self.share.z)
    }
}

/// The whole number nearest to one that an `i16` has room for. Rounding by casts: `f64::round` is a slow call on processors that
/// have no instruction for it.
#[inline]
fn nearest(number: f64) -> i16 {
    ((number + 32768.5) as i32 - 32768) as i16
}

#[inline]
fn mixed<T: Copy + Into<f64>>(size: UVec3, voxels: &[T], at: DVec3) -> f64 {
    Cell::of(size, at).mix(|place| voxels[place].into())
}

/// Colours count as much as they are opaque.
fn mixed_colour(size: UVec3, voxels: &[[u8; 4]], at: DVec3) -> [u8; 4] {
    let cell = Cell::of(size, at);
    let opacity = cell.mix(|place| voxels[place][3].into());
    let channel = |channel: usize| {
        let weighted = cell.mix(|place| f64::from(voxels[place][channel]) * f64::from(voxels[place][3]));
        if opacity > 0.0 { (weighted / opacity).round() as u8 } else { 0 }
    };
    [channel(0), channel(1), channel(2), opacity.round() as u8]
}
