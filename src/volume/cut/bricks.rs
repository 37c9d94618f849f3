//! Numbers per voxel, stored only where something was cut.

use super::super::grid::{VoxelBox, linear_index};
use glam::{IVec3, UVec3, Vec3};
use std::sync::Arc;

/// Voxels along each edge of a brick.
pub(super) const SIDE: usize = 16;
/// Voxels of a brick.
pub(super) const VOXELS: usize = SIDE * SIDE * SIDE;
/// Neighbours along x that are worked on at once: half a brick's row, so that no loop has a remainder.
pub(super) const LANES: usize = SIDE / 2;
/// A number for each of [`LANES`] neighbours.
pub(super) type Lanes = [f32; LANES];
/// Remaining opacity of a brick's voxels, x fastest.
pub(super) type Brick = Arc<[Lanes; VOXELS / LANES]>;
/// A brick of which nothing was cut.
pub(super) const WHOLE: [Lanes; VOXELS / LANES] = [[1.0; LANES]; VOXELS / LANES];

/// A grid of bricks; one that is absent is untouched, 1 everywhere. Voxels of a brick that lie outside the grid stay 1.
#[derive(Clone)]
pub(super) struct Bricks {
    pub size: UVec3,
    /// Bricks along each axis.
    pub counts: UVec3,
    pub list: Vec<Option<Brick>>,
}

impl Bricks {
    pub fn new(size: UVec3) -> Self {
        let counts =
            UVec3::new(size.x.div_ceil(SIDE as u32), size.y.div_ceil(SIDE as u32), size.z.div_ceil(SIDE as u32));
        let count = counts.x as usize * counts.y as usize * counts.z as usize;
        Self { size, counts, list: vec![None; count] }
    }

    /// Place in the list of a brick by its own coordinates.
    pub fn place(&self, brick: UVec3) -> usize {
        linear_index(self.counts, brick)
    }

    /// Voxels of a brick by its place in the list.
    pub fn bounds(&self, place: usize) -> VoxelBox {
        let (x, y) = (self.counts.x as usize, self.counts.y as usize);
        let brick = UVec3::new((place % x) as u32, (place / x % y) as u32, (place / (x * y)) as u32);
        let min = brick * SIDE as u32;
        VoxelBox { min, max: (min + SIDE as u32).min(self.size) }
    }

    /// Place of a voxel in its brick.
    pub fn offset(x: usize, y: usize, z: usize) -> usize {
        ((z % SIDE) * SIDE + y % SIDE) * SIDE + x % SIDE
    }

    pub fn get(&self, voxel: UVec3) -> f32 {
        if voxel.cmpge(self.size).any() {
            return 1.0;
        }
        match &self.list[self.place(voxel / SIDE as u32)] {
            Some(brick) => brick.as_flattened()[Self::offset(voxel.x as usize, voxel.y as usize, voxel.z as usize)],
            None => 1.0,
        }
    }

    /// Trilinear, clamped to the edge; 1 where a coordinate is not a number.
    pub fn sample(&self, voxel: Vec3) -> f32 {
        if !voxel.is_finite() || self.size.min_element() == 0 {
            return 1.0;
        }
        let last = self.size.as_ivec3() - 1;
        let voxel = voxel.clamp(Vec3::ZERO, last.as_vec3());
        let low = voxel.floor();
        let part = voxel - low;
        let (low, high) = (low.as_ivec3(), (low.as_ivec3() + 1).min(last));
        let at = |x, y, z| self.get(IVec3::new(x, y, z).as_uvec3());
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |y, z| mix(at(low.x, y, z), at(high.x, y, z), part.x);
        let plane = |z| mix(row(low.y, z), row(high.y, z), part.y);
        mix(plane(low.z), plane(high.z), part.z)
    }

    /// The voxels of a box as bytes, x fastest.
    pub fn copy(&self, of: VoxelBox, into: &mut [u8]) {
        if of.is_empty() {
            return;
        }
        let size = of.size();
        let rows = into.chunks_mut(size.x as usize);
        for (row, into) in rows.take(size.y as usize * size.z as usize).enumerate() {
            let y = of.min.y + row as u32 % size.y;
            let z = of.min.z + row as u32 / size.y;
            self.copy_row(of.min.x as usize, y, z, into);
        }
    }

    fn copy_row(&self, first: usize, y: u32, z: u32, into: &mut [u8]) {
        if y >= self.size.y || z >= self.size.z {
            into.fill(u8::MAX);
            return;
        }
        let bricks = self.place(UVec3::new(0, y, z) / SIDE as u32);
        let mut x = first;
        let mut rest = into;
        while !rest.is_empty() {
            if x >= self.size.x as usize {
                rest.fill(u8::MAX);
                return;
            }
            let length = (SIDE - x % SIDE).min(self.size.x as usize - x).min(rest.len());
            let (part, after) = rest.split_at_mut(length);
            match &self.list[bricks + x / SIDE] {
                Some(brick) => {
                    let offset = Self::offset(x, y as usize, z as usize);
                    for (byte, &remaining) in part.iter_mut().zip(&brick.as_flattened()[offset..offset + length]) {
                        *byte = (remaining * 255.0 + 0.5) as i32 as u8;
                    }
                }
                None => part.fill(u8::MAX),
            }
            rest = after;
            x += length;
        }
    }

    /// Whether no brick of a box was cut.
    pub fn is_untouched(&self, of: VoxelBox) -> bool {
        let of = of.intersection(&VoxelBox { min: UVec3::ZERO, max: self.size });
        if of.is_empty() {
            return true;
        }
        let (first, last) = (of.min / SIDE as u32, (of.max - 1) / SIDE as u32);
        (first.z..=last.z).all(|z| {
            (first.y..=last.y).all(|y| {
                let row = self.place(UVec3::new(0, y, z));
                self.list[row + first.x as usize..=row + last.x as usize].iter().all(Option::is_none)
            })
        })
    }

    /// Whether both hold the same numbers, stored or not.
    pub fn same(&self, other: &Self) -> bool {
        let is_whole = |brick: &Brick| **brick == WHOLE;
        self.size == other.size
            && self.list.iter().zip(&other.list).all(|pair| match pair {
                (Some(a), Some(b)) => Arc::ptr_eq(a, b) || a == b,
                (Some(brick), None) | (None, Some(brick)) => is_whole(brick),
                (None, None) => true,
            })
    }
}
