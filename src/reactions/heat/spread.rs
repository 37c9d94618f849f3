//! Which tiles of the heat map are warm, and how they hang together.

use super::conductance::Neighbourhood;
use super::metrics::{Metrics, texels_per_cell};
use super::tile::{HotTile, Mean};
use super::{HeatMap, MOST_HOT_TILES, NO_SLOT, NO_SURFACE};
use crate::organ::surface::Surface;
use crate::reactions::texels::{MapSize, TILE_PX};
use rayon::prelude::*;

/// Most tiles that heat spreads into within one step; more wait for the next. Each costs some 30 microseconds.
const MOST_WARMED_PER_STEP: usize = 32;

/// Most tiles that are measured again per step while the surface moves; those that the tool heats come on top.
const MOST_MEASURED_PER_STEP: usize = 2;

/// From this number of tiles to measure on, threads share them.
const PARALLEL_MEASURES: usize = 8;

/// A tile becomes warm when a neighbour's texels beside it reach this many times the cold rise.
const SPREAD_PER_COLD: f32 = 2.0;

/// Offsets of a tile's neighbours.
const AROUND: [(i32, i32); 8] = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];

impl HeatMap {
    /// The tile beside a tile; `None` beyond the first and last row. On a spherical chart rows go on at their other end.
    fn neighbour(&self, (column, row): (u32, u32), (dx, dy): (i32, i32), wraps: bool) -> Option<u32> {
        let (columns, rows) = self.size.tiles();
        let row = row.checked_add_signed(dy).filter(|&row| row < rows)?;
        let column = i64::from(column) + i64::from(dx);
        let column = if wraps { column.rem_euclid(columns.into()) } else { column };
        u32::try_from(column).ok().filter(|&column| column < columns).map(|column| row * columns + column)
    }

    /// Makes tiles warm that are not, as long as there is room and they hold some surface.
    pub(super) fn warm(&mut self, surface: &Surface, tiles: &[u32]) {
        let columns = self.size.tiles().0;
        let room = MOST_HOT_TILES.saturating_sub(self.hot.len());
        let new: Vec<u32> =
            tiles.iter().copied().filter(|&tile| self.slots[tile as usize] == NO_SLOT).take(room).collect();
        let places: Vec<(u32, u32)> = new.iter().map(|&tile| (tile % columns, tile / columns)).collect();
        let measured = measure(surface, self.size, &places);
        for (tile, metrics) in new.into_iter().zip(measured) {
            if !metrics.has_surface() {
                self.slots[tile as usize] = NO_SURFACE;
                continue;
            }
            let place = (tile % columns, tile / columns);
            let cells =
                std::array::from_fn(|y| texels_per_cell(surface.atlas, self.size, place.1 * TILE_PX + y as u32));
            let burn = self.burns[tile as usize].take();
            self.slots[tile as usize] = self.hot.len() as u32;
            self.hot.push(HotTile::new(place, metrics, cells, burn, self.surface_generation));
            self.disconnect(place);
        }
    }

    /// Drops the heat of a warm tile and keeps its burns.
    pub(super) fn cool(&mut self, slot: usize) {
        let columns = self.size.tiles().0;
        let id = |(column, row): (u32, u32)| (row * columns + column) as usize;
        let cooled = self.hot.swap_remove(slot);
        self.slots[id(cooled.place)] = NO_SLOT;
        if let Some(moved) = self.hot.get(slot) {
            self.slots[id(moved.place)] = slot as u32;
        }
        if let Some(burn) = cooled.burn {
            if burn.is_changed {
                self.changed.push(id(cooled.place) as u32);
            }
            self.burns[id(cooled.place)] = Some(burn);
        }
        self.disconnect(cooled.place);
    }

    /// The tiles about a place have to look again who is warm.
    fn disconnect(&mut self, place: (u32, u32)) {
        for offset in AROUND {
            if let Some(slot) = self.neighbour(place, offset, true).and_then(|tile| self.hot_slot(tile)) {
                self.hot[slot].is_stale = true;
            }
        }
    }

    /// Measures warm tiles anew, and has them and their neighbours connected again.
    pub(super) fn measure(&mut self, surface: &Surface, slots: &[usize]) {
        let places: Vec<(u32, u32)> = slots.iter().map(|&slot| self.hot[slot].place).collect();
        for (&slot, metrics) in slots.iter().zip(measure(surface, self.size, &places)) {
            let tile = &mut self.hot[slot];
            tile.metrics = metrics;
            tile.surface_generation = self.surface_generation;
            tile.is_stale = true;
        }
    }

    /// A few of the tiles that the surface moved under, in turn.
    pub(super) fn measure_moved(&mut self, surface: &Surface) {
        let count = self.hot.len();
        let slots: Vec<usize> = (0..count)
            .map(|k| (self.next_measured + k) % count)
            .filter(|&slot| self.hot[slot].surface_generation != self.surface_generation)
            .take(MOST_MEASURED_PER_STEP)
            .collect();
        if let Some(&last) = slots.last() {
            self.next_measured = last + 1;
        }
        self.measure(surface, &slots);
    }

    /// Conductances of tiles whose neighbourhood or metrics changed.
    pub(super) fn connect(&mut self) {
        let diffusivity = self.settings.diffusivity_m2_per_s;
        for slot in 0..self.hot.len() {
            if !self.hot[slot].is_stale {
                continue;
            }
            let mut warm: Neighbourhood = [[true; 3]; 3];
            for (dx, dy) in AROUND {
                let neighbour = self.neighbour(self.hot[slot].place, (dx, dy), true);
                let is_warm = neighbour.and_then(|tile| self.hot_slot(tile)).is_some_and(|other| other != slot);
                warm[(dy + 1) as usize][(dx + 1) as usize] = is_warm;
            }
            let tile = &mut self.hot[slot];
            tile.conductances.update(&tile.metrics, &warm, &tile.texels_per_cell, diffusivity);
            tile.is_stale = false;
        }
    }

    /// Temperatures along the sides, from tile to tile. What lies in the ring towards a cold tile does not matter.
    pub(super) fn exchange_rings(&mut self) {
        for slot in 0..self.hot.len() {
            for offset in AROUND {
                let neighbour = self.neighbour(self.hot[slot].place, offset, true);
                let Some(other) = neighbour.and_then(|tile| self.hot_slot(tile)) else { continue };
                if let Ok([own, other]) = self.hot.get_disjoint_mut([slot, other]) {
                    own.take_ring(other, offset);
                }
            }
        }
    }

    /// Cells that reach over tiles, in the rows about the poles: one temperature in all of their warm tiles.
    pub(super) fn join_cells_over_tiles(&mut self) {
        for tiles in self.cells_over_tiles() {
            let warm: Vec<usize> = tiles.tiles().filter_map(|tile| self.hot_slot(tile)).collect();
            let mean = warm.iter().fold(Mean::default(), |mean, &slot| self.hot[slot].add_row(tiles.y, mean));
            for slot in warm {
                self.hot[slot].fill_row(tiles.y, mean);
            }
        }
    }

    /// The cells that reach over tiles and have a warm one, each once, in the order of their places.
    fn cells_over_tiles(&self) -> Vec<WideCell> {
        let columns = self.size.tiles().0;
        let mut cells: Vec<WideCell> = Vec::new();
        for tile in &self.hot {
            for (y, &texels) in tile.texels_per_cell.iter().enumerate().filter(|(_, texels)| **texels > TILE_PX) {
                let count = texels / TILE_PX;
                let first = tile.place.1 * columns + tile.place.0 / count * count;
                cells.push(WideCell { y, first, count });
            }
        }
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    /// Warms the tiles that heat is about to reach, and lets go of those that are cold.
    pub(super) fn spread_and_cool(&mut self, surface: &Surface) {
        let wraps = surface.atlas.is_spherical();
        let cold_k = self.settings.cold_rise_k as f32;
        let spread_k = SPREAD_PER_COLD * cold_k;
        let mut wanted: Vec<u32> = Vec::new();
        for tile in &self.hot {
            for offset in AROUND {
                if tile.warmest_towards_k(offset) >= spread_k {
                    wanted.extend(self.neighbour(tile.place, offset, wraps));
                }
            }
        }
        for cell in self.cells_over_tiles() {
            let is_warm =
                |tile| self.hot_slot(tile).is_some_and(|slot| self.hot[slot].warmest_in_row_k(cell.y) >= spread_k);
            if cell.tiles().any(is_warm) {
                wanted.extend(cell.tiles());
            }
        }
        wanted.sort_unstable();
        wanted.dedup();
        let columns = self.size.tiles().0;
        for slot in (0..self.hot.len()).rev() {
            let tile = &self.hot[slot];
            let id = tile.place.1 * columns + tile.place.0;
            if tile.warmest_k() < cold_k && wanted.binary_search(&id).is_err() {
                self.cool(slot);
            }
        }
        wanted.retain(|&tile| self.slots[tile as usize] == NO_SLOT);
        wanted.truncate(MOST_WARMED_PER_STEP);
        self.warm(surface, &wanted);
    }
}

/// Metrics of tiles, given by column and row.
fn measure(surface: &Surface, size: MapSize, places: &[(u32, u32)]) -> Vec<Box<Metrics>> {
    let one = |&(column, row): &(u32, u32)| Metrics::measure(surface, size, column, row);
    if places.len() < PARALLEL_MEASURES {
        places.iter().map(one).collect()
    } else {
        places.par_iter().map(one).collect()
    }
}

/// A cell of a row of texels that reaches over several tiles.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct WideCell {
    /// Row within the tiles.
    y: usize,
    first: u32,
    count: u32,
}

impl WideCell {
    fn tiles(self) -> std::ops::Range<u32> {
        self.first..self.first + self.count
    }
}
