//! Which cells hold fluid (paper of 2009, section 4.1).

use super::PoolGrid;
use bevy::reflect::Reflect;
use glam::UVec2;
use rayon::prelude::*;

/// The cells of a pool that hold fluid; all others are walls.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct WetMask {
    size: UVec2,
    wet: Vec<bool>,
}

impl WetMask {
    /// The cells for which a function holds.
    pub fn from_fn(grid: &PoolGrid, is_wet: impl Fn(UVec2) -> bool + Sync) -> Self {
        let size = grid.size();
        let mut wet = vec![false; grid.count()];
        wet.par_chunks_mut(size.x as usize).enumerate().for_each(|(y, row)| {
            for (x, wet) in row.iter_mut().enumerate() {
                *wet = is_wet(UVec2::new(x as u32, y as u32));
            }
        });
        Self { size, wet }
    }

    /// Columns and rows.
    pub fn size(&self) -> UVec2 {
        self.size
    }

    /// Whether a cell holds fluid; none beyond the grid does.
    pub fn is_wet(&self, cell: UVec2) -> bool {
        cell.cmplt(self.size).all() && self.wet[(cell.y * self.size.x + cell.x) as usize]
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
        let (width, height) = (self.size.x as usize, self.size.y as usize);
        let mut wet = vec![false; self.wet.len()];
        wet.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let line = |y: usize| &self.wet[y * width..(y + 1) * width];
            let own = line(y);
            for (x, wet) in row.iter_mut().enumerate() {
                let sides = [
                    x > 0 && own[x - 1],
                    own.get(x + 1).is_some_and(|wet| *wet),
                    y > 0 && line(y - 1)[x],
                    y + 1 < height && line(y + 1)[x],
                ];
                let count = u32::from(own[x]) + sides.map(u32::from).iter().sum::<u32>();
                *wet = count >= threshold;
            }
        });
        Self { size: self.size, wet }
    }
}
