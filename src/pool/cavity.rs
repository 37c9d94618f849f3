//! What was drilled away under a pool, column by column (paper of 2009, section 4.1).

use super::threads::for_cells;
use super::{PoolGrid, WetMask};
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use glam::{UVec2, Vec2};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Height of a column in which there is no bone, metres.
pub const NO_BONE_M: f32 = f32::NEG_INFINITY;
/// What a burr took less of does not count as drilled, metres.
const LEAST_DEPTH_M: f32 = 2e-5;
/// Width of a gap in the rim through which water runs out; it hangs in narrower ones, metres.
const GAP_M: f32 = 5e-4;

/// Heights of the bone in the columns of a pool's cells over the origin of the pool, metres: as it was and as it is.
///
/// A column knows the highest bone only: what lies under an overhang counts as bone.
#[derive(Clone, Component, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct Cavity {
    grid: PoolGrid,
    floor_m: f32,
    original_m: Vec<f32>,
    cut_m: Vec<f32>,
    /// Cells between which all lie that are drilled: from the first, up to but without the second.
    bounds: [UVec2; 2],
    /// The columns that are drilled, row by row.
    drilled: Vec<Drilled>,
    looks: u64,
}

/// A column of which something was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Drilled {
    cell: UVec2,
    original_m: f32,
    cut_m: f32,
}

impl Cavity {
    /// Nothing drilled: a function gives the height of the bone in a column, by its place in the pool's plane in metres. Where
    /// bone is drilled through, the column is taken to end at `floor_m`.
    pub fn new(grid: PoolGrid, floor_m: f32, original_m: impl Fn(Vec2) -> Option<f32> + Sync) -> Self {
        let mut original = vec![NO_BONE_M; grid.count()];
        let width = grid.size().x as usize;
        original.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, height) in row.iter_mut().enumerate() {
                let cell = UVec2::new(x as u32, y as u32);
                *height =
                    original_m(grid.pool_from_cell(cell)).filter(|height| height.is_finite()).unwrap_or(NO_BONE_M);
            }
        });
        Self {
            grid,
            floor_m,
            cut_m: original.clone(),
            original_m: original,
            bounds: [UVec2::ZERO; 2],
            drilled: Vec::new(),
            looks: grid.count() as u64,
        }
    }

    /// The cells.
    pub fn grid(&self) -> &PoolGrid {
        &self.grid
    }

    /// Measures what is left in the columns of some cells: from the first, up to but without the second.
    pub fn measure(&mut self, cells: [UVec2; 2], cut_m: impl Fn(Vec2) -> Option<f32> + Sync) {
        let (grid, floor_m) = (self.grid, self.floor_m);
        let [low, high] = [cells[0].min(grid.size()), cells[1].min(grid.size())];
        if low.cmpge(high).any() {
            return;
        }
        self.looks += u64::from((high - low).element_product());
        let width = grid.size().x as usize;
        let rows = self.cut_m.par_chunks_mut(width).zip(self.original_m.par_chunks(width)).enumerate();
        rows.skip(low.y as usize).take((high.y - low.y) as usize).for_each(|(y, (cut, original))| {
            for x in low.x..high.x {
                let most = original[x as usize];
                if most > NO_BONE_M {
                    let height = cut_m(grid.pool_from_cell(UVec2::new(x, y as u32))).unwrap_or(floor_m);
                    cut[x as usize] = if height.is_nan() { most } else { height.clamp(floor_m.min(most), most) };
                }
            }
        });
        let [was_low, was_high] = self.bounds;
        self.bounds = match was_low.cmpge(was_high).any() {
            true => [low, high],
            false => [was_low.min(low), was_high.max(high)],
        };
        self.list_drilled();
    }

    /// Columns that were looked at so far, each as often as that: all of them once, then those under what was drilled.
    pub fn looks(&self) -> u64 {
        self.looks
    }

    fn list_drilled(&mut self) {
        let [low, high] = self.bounds;
        self.drilled.clear();
        for y in low.y..high.y {
            for x in low.x..high.x {
                let cell = UVec2::new(x, y);
                let (original_m, cut_m) = (self.original_m[self.index(cell)], self.cut_m[self.index(cell)]);
                if original_m - cut_m > LEAST_DEPTH_M {
                    self.drilled.push(Drilled { cell, original_m, cut_m });
                }
            }
        }
    }

    /// Cells between which all lie that are drilled: from the first, up to but without the second.
    pub fn bounds(&self) -> [UVec2; 2] {
        self.bounds
    }

    fn index(&self, cell: UVec2) -> usize {
        (cell.y * self.grid.size().x + cell.x) as usize
    }

    /// Height of the bone in a cell's column as it was, metres; none beyond the grid.
    pub fn original_m(&self, cell: UVec2) -> f32 {
        if cell.cmplt(self.grid.size()).all() { self.original_m[self.index(cell)] } else { NO_BONE_M }
    }

    /// Height of what is left in a cell's column, metres; none beyond the grid.
    pub fn cut_m(&self, cell: UVec2) -> f32 {
        if cell.cmplt(self.grid.size()).all() { self.cut_m[self.index(cell)] } else { NO_BONE_M }
    }

    /// Depth of the fluid over a cell at a level, metres; 0 where there is none.
    pub fn depth_m(&self, cell: UVec2, level_m: f32) -> f32 {
        let (original, cut) = (self.original_m(cell), self.cut_m(cell));
        if is_wet(original, cut, level_m) { level_m - cut } else { 0.0 }
    }

    /// Whether there is bone under any cell.
    pub fn has_bone(&self) -> bool {
        self.original_m.par_iter().any(|height| *height > NO_BONE_M)
    }

    /// Whether bone was taken from a cell's column.
    pub fn is_drilled(&self, cell: UVec2) -> bool {
        self.original_m(cell) - self.cut_m(cell) > LEAST_DEPTH_M
    }

    /// Number of cells from whose columns bone was taken.
    pub fn drilled_count(&self) -> usize {
        self.drilled.len()
    }

    /// Where the columns were cut deepest, and how high the bone is there; none if nothing was drilled.
    pub fn deepest(&self) -> Option<(UVec2, f32)> {
        let deepest = self.drilled.iter().reduce(|a, b| if b.cut_m < a.cut_m { b } else { a })?;
        Some((deepest.cell, deepest.cut_m))
    }

    /// The cells that hold fluid at a level: where the original bone lies above it and what is left below, without grains of
    /// noise ([`WetMask::without_grains`]).
    pub fn mask(&self, level_m: f32) -> WetMask {
        let is_wet = |cell| {
            let place = self.index(cell);
            is_wet(self.original_m[place], self.cut_m[place], level_m)
        };
        let area = (self.bounds[1] - self.bounds[0]).element_product() as usize;
        for_cells(area, || WetMask::within(&self.grid, self.bounds, is_wet).without_grains())
    }

    /// What the drilled columns hold up to a level, millilitres.
    pub fn volume_ml(&self, level_m: f32) -> f64 {
        self.volume_and_area(level_m)[0]
    }

    /// Volume below a level in millilitres, and by how much it grows with the level, millilitres per metre.
    fn volume_and_area(&self, level_m: f32) -> [f64; 2] {
        let cell_ml_per_m = f64::from(self.grid.cell_m()).powi(2) * 1e6;
        let (mut height_m, mut count) = (0.0, 0_u32);
        for &Drilled { original_m: original, cut_m: cut, .. } in &self.drilled {
            height_m += f64::from((level_m.min(original) - cut).max(0.0));
            count += u32::from(cut < level_m && level_m <= original);
        }
        [height_m * cell_ml_per_m, f64::from(count) * cell_ml_per_m]
    }

    /// The level at which the drilled columns hold so many millilitres, not above `most_m`; the deepest place for none. `near_m`
    /// is where it is looked for first. Nothing if nothing was drilled.
    pub fn level_m(&self, held_ml: f64, most_m: f32, near_m: f32) -> Option<f32> {
        let (_, deepest_m) = self.deepest()?;
        if held_ml <= 0.0 {
            return Some(deepest_m);
        }
        let (mut low, mut high) = (deepest_m, most_m.max(deepest_m));
        if self.volume_ml(high) <= held_ml {
            return Some(high);
        }
        let mut level = near_m.clamp(low, high);
        // Newton's method, kept within what is known to be too low and too high.
        for _ in 0..40 {
            let [volume, area] = self.volume_and_area(level);
            let missing = held_ml - volume;
            if missing.abs() <= held_ml * 1e-7 || high - low < 1e-9 {
                break;
            }
            if missing > 0.0 {
                low = level
            } else {
                high = level
            }
            let next = level + (missing / area.max(1e-12)) as f32;
            level = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        Some(level)
    }

    /// The level above which fluid runs over the rim around the deepest place. Nothing if nothing was drilled.
    ///
    /// Water rises from the deepest place into whatever is lowest beside it (Barnes et al. 2014, priority flood) until it reaches
    /// ground that was never above it, over a length that surface tension does not bridge.
    pub fn rim_m(&self) -> Option<f32> {
        let (start, deepest_m) = self.deepest()?;
        let gap = (GAP_M / self.grid.cell_m()).ceil().max(1.0) as u32;
        let size = self.grid.size();
        let mut seen = vec![false; self.grid.count()];
        let mut shore = BinaryHeap::new();
        let (mut level_m, mut lost) = (deepest_m, 0);
        let key = |height_m: f32| Reverse(ordered(height_m));
        seen[self.index(start)] = true;
        shore.push((key(deepest_m), Reverse((start.y, start.x))));
        while let Some((_, Reverse((y, x)))) = shore.pop() {
            let cell = UVec2::new(x, y);
            level_m = level_m.max(self.cut_m(cell));
            // Bone that was not cut, or was below the level before.
            let is_outside = !self.is_drilled(cell) || self.original_m(cell) < level_m;
            if is_outside {
                lost += 1;
                if lost >= gap {
                    break;
                }
                continue;
            }
            for offset in [[-1, 0], [1, 0], [0, -1], [0, 1]].map(glam::IVec2::from_array) {
                let next = cell.as_ivec2() + offset;
                if next.cmplt(glam::IVec2::ZERO).any() || next.as_uvec2().cmpge(size).any() {
                    // Over the side of the grid.
                    return Some(level_m);
                }
                let next = next.as_uvec2();
                let place = self.index(next);
                if !std::mem::replace(&mut seen[place], true) {
                    shore.push((key(self.cut_m[place]), Reverse((next.y, next.x))));
                }
            }
        }
        Some(level_m)
    }
}

/// The paper's rule.
fn is_wet(original_m: f32, cut_m: f32, level_m: f32) -> bool {
    original_m >= level_m && cut_m < level_m && original_m - cut_m > LEAST_DEPTH_M
}

/// Whole numbers in the order of the heights.
fn ordered(height_m: f32) -> i32 {
    let bits = height_m.to_bits() as i32;
    if bits < 0 { i32::MIN.wrapping_sub(bits).wrapping_sub(1) } else { bits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_of_heights() {
        let heights = [f32::NEG_INFINITY, -2.0, -1e-9, 0.0, 1e-9, 3.0, f32::INFINITY];
        assert!(heights.windows(2).all(|pair| ordered(pair[0]) < ordered(pair[1])));
    }
}
