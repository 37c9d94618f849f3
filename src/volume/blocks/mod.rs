//! Which parts of a volume can show anything: what lets rays pass over the rest.
//!
//! The grid is divided into blocks of [`BLOCK_SIDE`]^3 voxels. Block `b` holds the samples with voxel coordinates from
//! `4 b - 0.5` up to `4 b + 3.5`; interpolating them also takes the voxels next to the block, so everything said of a block is
//! said of its voxels and those one step beyond it.
//!
//! [`BlockRanges`] knows the values (once per volume), [`BlockDistances`] what of it shows with a transfer function and a cut,
//! and how far the nearest block that shows is. Drilling updates the distances near the burr.

mod distances;
mod ranges;

pub use distances::BlockDistances;
pub use ranges::BlockRanges;

use super::VoxelBox;
use glam::UVec3;

/// Voxels along the side of a block.
pub const BLOCK_SIDE: u32 = 4;
/// Greatest distance that is told apart, blocks.
pub const MAX_BLOCK_DISTANCE: u8 = 15;

/// Blocks along each axis of a grid with a number of voxels along each axis.
pub fn blocks_of(size: UVec3) -> UVec3 {
    (size + (BLOCK_SIDE - 1)) / BLOCK_SIDE
}

/// The voxels that samples in some blocks are interpolated from.
fn support_of(blocks: VoxelBox, size: UVec3) -> VoxelBox {
    VoxelBox { min: blocks.min * BLOCK_SIDE, max: (blocks.max * BLOCK_SIDE).min(size) }.grown(1, size)
}

/// The blocks with samples that some voxels take part in.
fn touched_by(voxels: VoxelBox, size: UVec3) -> VoxelBox {
    let voxels = voxels.intersection(&VoxelBox { min: UVec3::ZERO, max: size });
    if voxels.is_empty() {
        return VoxelBox { min: UVec3::ZERO, max: UVec3::ZERO };
    }
    let min = blocks_of(voxels.min.saturating_sub(UVec3::splat(BLOCK_SIDE)));
    VoxelBox { min, max: (voxels.max / BLOCK_SIDE + 1).min(blocks_of(size)) }
}

#[cfg(test)]
mod tests;
