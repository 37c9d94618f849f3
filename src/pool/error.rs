//! What is wrong with a pool that cannot be.

use bevy::reflect::Reflect;
use glam::UVec2;
use thiserror::Error;

/// Why there is no such pool.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
pub enum PoolError {
    /// The grid's size is out of range.
    #[error("size: a pool of {} x {} cells cannot be; each side takes from {least} to {most}", size.x, size.y)]
    Size {
        /// Cells that were asked for.
        size: UVec2,
        /// Fewest cells along a side.
        least: u32,
        /// Most cells along a side.
        most: u32,
    },
    /// The cells have no length that can be worked with.
    #[error("cell_m: {cell_m} m is no side of a cell; it must be a number from 1e-6 to 1")]
    Cell {
        /// Side of a cell that was asked for, metres.
        cell_m: f32,
    },
    /// A mask has another number of cells than the grid.
    #[error("a mask of {} x {} cells does not fit a pool of {} x {}", found.x, found.y, expected.x, expected.y)]
    MaskSize {
        /// Cells of the mask.
        found: UVec2,
        /// Cells of the grid.
        expected: UVec2,
    },
}
