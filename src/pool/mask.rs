//! Which cells hold fluid (paper of 2009, section 4.1).

use super::PoolGrid;
use bevy::reflect::Reflect;
use glam::{IVec2, UVec2};
use rayon::prelude::*;

/// The cells of a pool that hold fluid; all others are walls.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct WetMask {
    size: UVec2,
    wet: Vec<bool>,
    /// Cells between which all that are wet lie: from the first, up to but without the second.
    bounds: [UVec2; 2],
}

impl WetMask {
    /// The cells for which a function holds.
    pub fn from_fn(grid: &PoolGrid, is_wet: impl Fn(UVec2) -> bool + Sync) -> Self {
        Self::within(grid, [UVec2::ZERO, grid.size()], is_wet)
    }

    /// The same where it is known that no cell is wet but those from the first, up to but without the second.
    pub fn within(grid: &PoolGrid, bounds: [UVec2; 2], is_wet: impl Fn(UVec2) -> bool + Sync) -> Self {
        let bounds = bounds.map(|cell| cell.min(grid.size()));
        let mut made = Self { size: grid.size(), wet: vec![false; grid.count()], bounds };
        made.fill(is_wet);
        made
    }

    /// Sets the cells within the bounds.
    fn fill(&mut self, is_wet: impl Fn(UVec2) -> bool + Sync) {
        let [low, high] = self.bounds;
        let rows = self.wet.par_chunks_mut(self.size.x as usize).enumerate().with_min_len(16);
        rows.skip(low.y as usize).take(high.y.saturating_sub(low.y) as usize).for_each(|(y, row)| {
            for x in low.x..high.x {
                row[x as usize] = is_wet(UVec2::new(x, y as u32));
            }
        });
    }

    /// Columns and rows.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Whether a cell holds fluid; none beyond the grid does.
    pub fn is_wet(&self, cell: UVec2) -> bool {
        cell.cmplt(self.size).all() && self.wet[(cell.y * self.size.x + cell.x) as usize]
    }

    /// Whether the cells of a row hold fluid.
    pub(super) fn row(&self, y: usize) -> &[bool] {
        let width = self.size.x as usize;
        &self.wet[y * width..(y + 1) * width]
    }

    /// Number of cells that hold fluid.
    pub fn count(&self) -> usize {
        self.wet.iter().filter(|wet| **wet).count()
    }

    /// Without the grains of noise that projecting voxels leaves: first only cells stay of which four of the five in the cross
    /// around them are wet, then every cell becomes wet that has one such in its cross (the paper's thresholds 4 and 1).
    pub fn without_grains(&self) -> Self {
        self.by_cross(4).by_cross(1)
    }

    /// Wet where so many cells of the cross of five are; beyond the grid none is.
    fn by_cross(&self, threshold: u32) -> Self {
        let [low, high] = self.bounds;
        let bounds = [low.saturating_sub(UVec2::ONE), (high + 1).min(self.size)];
        let mut made = Self { size: self.size, wet: vec![false; self.wet.len()], bounds };
        let cross = [[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1]].map(IVec2::from_array);
        made.fill(|cell| {
            let count = cross.iter().filter(|offset| self.is_wet((cell.as_ivec2() + **offset).as_uvec2())).count();
            count as u32 >= threshold
        });
        made
    }
}
