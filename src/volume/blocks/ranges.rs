//! Least and greatest value of every block.

use super::{BLOCK_SIDE, blocks_of, support_of};
use crate::volume::grid::linear_index;
use crate::volume::transfer::{TABLE_ENTRIES, TransferTable};
use crate::volume::{Volume, VoxelBox, Voxels};
use bevy::reflect::Reflect;
use glam::UVec3;
use rayon::prelude::*;

/// For every block the first and last entry of a lookup table that a sample in it can meet.
///
/// Some entries wider on both sides than the voxels' values are, so that it holds for values rounded to what a texture stores
/// and for an interpolation in single precision. It does not depend on the transfer function and not on the cut.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct BlockRanges {
    size: UVec3,
    blocks: UVec3,
    entries: Vec<[u16; 2]>,
}

impl BlockRanges {
    /// The ranges of a volume's values.
    pub fn new(volume: &Volume) -> Self {
        let size = volume.grid().size;
        let (slope, intercept) = volume.rescale();
        let [least, greatest] = volume.range();
        let normalized = |stored: f64| {
            let value = slope * stored + intercept;
            if greatest > least { ((value - least) / (greatest - least)) as f32 } else { 0.0 }
        };
        let entries = match volume.voxels() {
            // Eight bits of the share of the range are up to two entries off, and rounding one more.
            Voxels::U8(voxels) => entries_of(size, voxels, |&voxel| voxel, normalized, 3),
            Voxels::I16(voxels) => entries_of(size, voxels, |&voxel| voxel, normalized, 1),
            Voxels::U16(voxels) => entries_of(size, voxels, |&voxel| voxel, normalized, 1),
            Voxels::F32(voxels) => entries_of(size, voxels, |&voxel| voxel, normalized, 1),
            Voxels::Rgba(voxels) => entries_of(size, voxels, |voxel| voxel[3], normalized, 1),
        };
        Self { size, blocks: blocks_of(size), entries }
    }

    /// Voxels of the volume along each axis.
    pub fn size(&self) -> UVec3 {
        self.size
    }

    /// Blocks along each axis.
    pub fn blocks(&self) -> UVec3 {
        self.blocks
    }

    /// First and last entry that a block's samples can meet; `None` for a block outside the grid.
    pub fn entries(&self, block: UVec3) -> Option<[u16; 2]> {
        block.cmplt(self.blocks).all().then(|| self.entries[linear_index(self.blocks, block)])
    }

    /// The entries of all blocks, x fastest.
    pub(super) fn all(&self) -> &[[u16; 2]] {
        &self.entries
    }
}

/// The ranges by rows of blocks: first over the rows of voxels that a row of blocks needs, then along them.
fn entries_of<V: Sync, T: Copy + PartialOrd + Into<f64>>(
    size: UVec3,
    voxels: &[V],
    stored: impl Fn(&V) -> T + Sync,
    normalized: impl Fn(f64) -> f32 + Sync,
    margin: usize,
) -> Vec<[u16; 2]> {
    let blocks = blocks_of(size);
    let width = size.x as usize;
    let least_of = |a: T, b: T| if b < a { b } else { a };
    let greatest_of = |a: T, b: T| if b > a { b } else { a };
    let mut entries = vec![[0; 2]; blocks.x as usize * blocks.y as usize * blocks.z as usize];
    entries.par_chunks_mut(blocks.x as usize).enumerate().for_each(|(row, entries)| {
        let (y, z) = (row as u32 % blocks.y, row as u32 / blocks.y);
        let needed = support_of(VoxelBox { min: UVec3::new(0, y, z), max: UVec3::new(1, y + 1, z + 1) }, size);
        let line = |y: u32, z: u32| {
            let start = (z as usize * size.y as usize + y as usize) * width;
            &voxels[start..start + width]
        };
        let mut least: Vec<T> = line(needed.min.y, needed.min.z).iter().map(&stored).collect();
        let mut greatest = least.clone();
        for z in needed.min.z..needed.max.z {
            for y in needed.min.y..needed.max.y {
                for ((least, greatest), voxel) in least.iter_mut().zip(&mut greatest).zip(line(y, z)) {
                    let voxel = stored(voxel);
                    *least = least_of(*least, voxel);
                    *greatest = greatest_of(*greatest, voxel);
                }
            }
        }
        for (block, entries) in entries.iter_mut().enumerate() {
            let first = (block * BLOCK_SIDE as usize).saturating_sub(1);
            let last = ((block + 1) * BLOCK_SIDE as usize).min(width - 1);
            let low = least[first..=last].iter().copied().reduce(least_of).map_or(0.0, |low| normalized(low.into()));
            let high =
                greatest[first..=last].iter().copied().reduce(greatest_of).map_or(0.0, |high| normalized(high.into()));
            // A negative slope turns the order round.
            let (low, high) = (TransferTable::index(low.min(high)), TransferTable::index(low.max(high)));
            *entries = [low.saturating_sub(margin) as u16, (high + margin).min(TABLE_ENTRIES - 1) as u16];
        }
    });
    entries
}
