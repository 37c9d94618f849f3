//! Cells of a pool.

use super::PoolError;
use bevy::reflect::Reflect;
use glam::{UVec2, Vec2};

/// Fewest cells along a side.
pub const MIN_CELLS: u32 = 4;
/// Most cells along a side.
pub const MAX_CELLS: u32 = 2048;

/// Square cells of a pool, in its own plane: the origin in the middle, x along the rows, y from row to row.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct PoolGrid {
    size: UVec2,
    cell_m: f32,
}

impl PoolGrid {
    /// A grid of so many cells (columns, rows) with sides of a length in metres.
    ///
    /// # Errors
    /// Sides beyond [`MIN_CELLS`] and [`MAX_CELLS`], and lengths that are no numbers from 1e-6 to 1.
    pub fn new(size: UVec2, cell_m: f32) -> Result<Self, PoolError> {
        if size.min_element() < MIN_CELLS || size.max_element() > MAX_CELLS {
            return Err(PoolError::Size { size, least: MIN_CELLS, most: MAX_CELLS });
        }
        match (1e-6..=1.0).contains(&cell_m) {
            true => Ok(Self { size, cell_m }),
            false => Err(PoolError::Cell { cell_m }),
        }
    }

    /// Columns and rows.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Side of a cell, metres.
    pub fn cell_m(&self) -> f32 {
        self.cell_m
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.size.as_usizevec2().element_product()
    }

    /// Middle of a cell in the pool's plane, metres.
    pub fn pool_from_cell(&self, cell: UVec2) -> Vec2 {
        (cell.as_vec2() - (self.size.as_vec2() - 1.0) * 0.5) * self.cell_m
    }

    /// Cell coordinates (middles at whole numbers) of a place in the pool's plane, metres.
    pub fn cell_from_pool(&self, place_m: Vec2) -> Vec2 {
        place_m / self.cell_m + (self.size.as_vec2() - 1.0) * 0.5
    }
}
