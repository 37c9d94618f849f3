//! The heat map: how warm each texel of an organ is, and how much heat it has received for good.
//!
//! **Temperature.** A surface layer of thickness `h` takes up the heat. Its rise over the body, `T`, follows
//! `dT/dt = diffusivity * laplacian(T) - T / cooling_time + power per area / (h * density * heat capacity)`, with the
//! Laplacian of the curved surface as it is now. Constants and their sources: [`HeatSettings`].
//!
//! **Dose.** What a texel remembers is the heat per area (J/mm2) that arrived in it while it was above the threshold of
//! lasting damage, whether from the tool or by conduction: the sum of all upward changes of
//! `h * density * heat capacity * max(T, threshold)`. Heat that boils off (above the ceiling) counts: it dried the tissue. So a pass adds what the
//! tool laid down at once, further passes and standing still add up, cooling takes nothing away, and the steps' length
//! does not matter. The number reads as an enthalpy: with `h` = 1 mm and the other defaults, about 0.1 J/mm2 bring
//! tissue from the body's temperature to 60 degrees Celsius, 0.15 more to boiling, and near 2 boil its water off, after
//! which carbon forms. The Arrhenius integral, which the field uses for damage, grows by orders of magnitude within a
//! few kelvin: it tells dead cells from living ones, but all visible stages of a burn lie far beyond its one. The time
//! integral of the temperature goes on for seconds after the tool has left and depends mostly on how the layer cools.
//!
//! **Conduction** is a finite volume scheme on the texels: with areas and lengths of their sides from the chart's
//! Jacobian, over the date line like anywhere else. Near the poles of a spherical chart, where texels get much higher
//! than wide, as many of a row share one temperature as make a cell about as wide as high; heat passes the pole round
//! it, from one of at least four cells to the next. At the borders of a planar chart no heat gets through. Steps are
//! explicit, in as many stages as the smallest texels in reach ask for; exchange between texels too small even for ten
//! stages a sixtieth of a second (under about 0.026 mm) is bounded. What one texel loses another gets, whatever the
//! bounds. When the surface moves, texels keep their temperatures, as matter does, and neighbouring tiles disagree about
//! their common side until both are measured again.
//!
//! **Cost.** Tiles exist where there is heat, up to [`MOST_HOT_TILES`], and compute nothing when cold; a tile that was
//! burnt keeps its doses and looks, 5 KiB.

mod conductance;
mod metrics;
mod settings;
mod spread;
mod tile;

pub use settings::HeatSettings;

use super::burn::BurnRamp;
use super::texels::{MapSize, TILE_PX, TexelRect, TileMask};
use crate::organ::surface::Surface;
use bevy::reflect::Reflect;
use conductance::Stage;
use metrics::SIDE;
use rayon::prelude::*;
use tile::{Burn, HotTile};

/// Most tiles that can be warm at a time. Heat does not spread further, and what is laid beside them goes to the texels
/// that have room.
pub const MOST_HOT_TILES: usize = 1024;

/// Steps conduct for no longer than this, seconds; they cool for their whole length.
const LONGEST_CONDUCTION_S: f64 = 0.25;

/// Greatest rise that one deposit may ask for, kelvin; keeps sums finite.
const MOST_ADDED_K: f64 = 1e9;

/// From this number of warm tiles on, threads share them. Fewer are done before other threads have woken up.
const PARALLEL_TILES: usize = 64;

/// Slot of a tile that is not warm.
const NO_SLOT: u32 = u32::MAX;

/// Slot of a tile that was found to hold no surface.
const NO_SURFACE: u32 = u32::MAX - 1;

/// Heat and burns of an organ's surface in texture space. See the [module](self).
#[derive(Clone, Debug, Reflect)]
#[reflect(opaque)]
pub struct HeatMap {
    size: MapSize,
    settings: HeatSettings,
    hot: Vec<HotTile>,
    /// Where in `hot` each tile is.
    slots: Vec<u32>,
    /// Burns of the tiles that are not hot.
    burns: Vec<Option<Box<Burn>>>,
    /// Tiles that are not hot and whose doses changed since the looks were asked for.
    changed: Vec<u32>,
    surface_generation: u64,
    /// Where the next search for tiles to measure again starts.
    next_measured: usize,
    vented_j: f64,
}

impl HeatMap {
    /// A cold map. Its size should come from [`MapSize::from_width`]: only whole tiles can be heated.
    pub fn new(size: MapSize, settings: HeatSettings) -> Self {
        let (columns, rows) = size.tiles();
        let tiles = columns as usize * rows as usize;
        Self {
            size,
            settings: settings.clamped(),
            hot: Vec::new(),
            slots: vec![NO_SLOT; tiles],
            burns: vec![None; tiles],
            changed: Vec::new(),
            surface_generation: 0,
            next_measured: 0,
            vented_j: 0.0,
        }
    }

    /// Size of the map.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// The settings, brought into range.
    pub fn settings(&self) -> &HeatSettings {
        &self.settings
    }

    /// Exchanges the settings, brought into range. Heat that is there keeps its temperature; doses stay.
    pub fn set_settings(&mut self, settings: HeatSettings) {
        let settings = settings.clamped();
        if settings != self.settings {
            self.settings = settings;
            self.hot.iter_mut().for_each(|tile| tile.is_stale = true);
        }
    }

    /// Spreads an energy in joules over texels `(x, y, weight)`, in proportion to weight times area on the surface, so
    /// that all of it arrives whatever the map's resolution.
    ///
    /// Texels beside the map or the surface, and weights that are not positive numbers, do not count. Nothing happens
    /// where none is left, or with an energy that is not a positive number.
    pub fn deposit(&mut self, surface: &Surface, texels: &[(u32, u32, f32)], energy_j: f64) {
        if !(energy_j > 0.0 && energy_j.is_finite()) {
            return;
        }
        let (columns, rows) = self.size.tiles();
        let is_usable = |&&(x, y, weight): &&(u32, u32, f32)| {
            x < columns * TILE_PX && y < rows * TILE_PX && weight > 0.0 && weight.is_finite()
        };
        let usable = || texels.iter().filter(is_usable);
        let mut tiles: Vec<u32> = usable().map(|&(x, y, _)| y / TILE_PX * columns + x / TILE_PX).collect();
        tiles.sort_unstable();
        tiles.dedup();
        let warm_before = self.hot.len();
        self.warm(surface, &tiles);
        let stale: Vec<usize> = tiles
            .iter()
            .filter_map(|&tile| self.hot_slot(tile))
            .filter(|&slot| self.hot[slot].surface_generation != self.surface_generation)
            .collect();
        self.measure(surface, &stale);

        let place =
            |x: u32, y: u32| (y / TILE_PX * columns + x / TILE_PX, (x % TILE_PX) as usize, (y % TILE_PX) as usize);
        let weighted_m2 = |map: &Self, &(x, y, weight): &(u32, u32, f32)| {
            let (tile, x, y) = place(x, y);
            map.hot_slot(tile).map_or(0.0, |slot| f64::from(weight) * f64::from(map.hot[slot].area_m2(x, y)))
        };
        let total_m2: f64 = usable().map(|texel| weighted_m2(self, texel)).sum();
        if !(total_m2 > 0.0 && total_m2.is_finite()) {
            while self.hot.len() > warm_before {
                self.cool(self.hot.len() - 1);
            }
            return;
        }
        let capacity = self.settings.areal_capacity_j_per_m2_k();
        for &(x, y, weight) in usable() {
            let (tile, x, y) = place(x, y);
            let Some(slot) = self.hot_slot(tile) else { continue };
            let area_m2 = f64::from(self.hot[slot].area_m2(x, y));
            if area_m2 > 0.0 {
                let added_k = (energy_j * (f64::from(weight) / (capacity * total_m2))).min(MOST_ADDED_K);
                let lost_k = self.hot[slot].heat((x, y), added_k, &self.settings);
                self.vented_j += lost_k * area_m2 * capacity;
            }
        }
    }

    /// Conducts, cools and adds conducted heat to the dose, for a time in seconds that is a positive number; otherwise
    /// nothing happens. However long the time, the work is bounded: conduction beyond a quarter of a second is left out.
    pub fn step(&mut self, surface: &Surface, dt_s: f64) {
        let goes_on = dt_s > 0.0; // Not for what is no number.
        if !goes_on || self.hot.is_empty() {
            return;
        }
        self.measure_moved(surface);
        self.connect();
        let fastest_per_s = self.hot.iter().map(|tile| tile.conductances.fastest_per_s).fold(0.0, f64::max);
        let kept_share = (-dt_s / self.settings.cooling_time_s).exp() as f32;
        self.for_each_hot(|tile, _| tile.start());
        self.join_cells_over_tiles();
        for stage in Stage::all(dt_s.min(LONGEST_CONDUCTION_S), fastest_per_s) {
            self.exchange_rings();
            self.for_each_hot(|tile, _| tile.conduct(stage));
            self.join_cells_over_tiles();
        }
        self.for_each_hot(|tile, settings| tile.settle(settings, kept_share));
        self.spread_and_cool(surface);
    }

    /// Rise of a texel's temperature over the body, kelvin. Zero outside the map.
    pub fn temperature_rise_k(&self, x: u32, y: u32) -> f32 {
        let texel = self.tile_of(x, y).and_then(|tile| self.hot_slot(tile));
        texel.map_or(0.0, |slot| self.hot[slot].rise_k(x % TILE_PX, y % TILE_PX).max(0.0))
    }

    /// Heat per area that a texel has received for good, J/mm2; it never falls. Zero outside the map.
    pub fn dose(&self, x: u32, y: u32) -> f32 {
        let burn = self.tile_of(x, y).and_then(|tile| self.burn(tile));
        burn.map_or(0.0, |burn| burn.dose_j_per_mm2[(y % TILE_PX) as usize][(x % TILE_PX) as usize])
    }

    /// Texels that have received at least so much for good, J/mm2: tile by tile, each row by row. Tiles where nothing burnt cost
    /// nothing.
    pub fn burnt(&self, least_j_per_mm2: f32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let (columns, rows) = self.size.tiles();
        (0..columns * rows).filter_map(move |tile| Some((tile, self.burn(tile)?))).flat_map(move |(tile, burn)| {
            let (left, top) = (tile % columns * TILE_PX, tile / columns * TILE_PX);
            let texels = (0..TILE_PX).flat_map(move |y| (0..TILE_PX).map(move |x| (x, y)));
            let is_burnt = move |&(x, y): &(u32, u32)| burn.dose_j_per_mm2[y as usize][x as usize] >= least_j_per_mm2;
            texels.filter(is_burnt).map(move |(x, y)| (left + x, top + y))
        })
    }

    /// Heat that is in the layer now, joules.
    pub fn total_energy_j(&self) -> f64 {
        self.hot.iter().map(HotTile::heat_k_m2).sum::<f64>() * self.settings.areal_capacity_j_per_m2_k()
    }

    /// Heat that left with steam and smoke since the start, joules.
    pub fn vented_energy_j(&self) -> f64 {
        self.vented_j
    }

    /// Number of tiles that are warm and cost time.
    pub fn hot_tiles(&self) -> usize {
        self.hot.len()
    }

    /// Says that vertices have moved: warm tiles are measured again, a few per step.
    pub fn surface_moved(&mut self) {
        self.surface_generation += 1;
        for slot in &mut self.slots {
            if *slot == NO_SURFACE {
                *slot = NO_SLOT;
            }
        }
    }

    /// Takes away all heat and all burns; the next [`HeatMap::changed`] reports where there were some.
    pub fn clear(&mut self) {
        while !self.hot.is_empty() {
            self.cool(self.hot.len() - 1);
        }
        self.vented_j = 0.0;
        for (tile, burn) in self.burns.iter_mut().enumerate() {
            if let Some(burn) = burn {
                burn.dose_j_per_mm2 = [[0.0; SIDE]; SIDE];
                if !burn.is_changed {
                    burn.is_changed = true;
                    self.changed.push(tile as u32);
                }
            }
        }
    }

    /// Has the next [`HeatMap::changed`] report all that is burnt: for another ramp, or a map that was wiped.
    pub fn forget_looks(&mut self) {
        for tile in &mut self.hot {
            if let Some(burn) = &mut tile.burn {
                burn.is_forgotten = true;
                burn.is_changed = true;
            }
        }
        for (tile, burn) in self.burns.iter_mut().enumerate() {
            if let Some(burn) = burn {
                burn.is_forgotten = true;
                if !burn.is_changed {
                    burn.is_changed = true;
                    self.changed.push(tile as u32);
                }
            }
        }
    }

    /// What looks otherwise than when this was last asked: marks its tiles and appends one rectangle for each, as small
    /// as can be, in the order of the tiles. The look of a texel is the ramp's index for its dose.
    pub fn changed(&mut self, ramp: &BurnRamp, mask: &mut TileMask, rects: &mut Vec<TexelRect>) {
        let mut tiles = std::mem::take(&mut self.changed);
        let columns = self.size.tiles().0;
        let id = |tile: &HotTile| tile.place.1 * columns + tile.place.0;
        tiles.extend(self.hot.iter().filter(|tile| tile.burn.as_ref().is_some_and(|burn| burn.is_changed)).map(id));
        tiles.sort_unstable();
        tiles.dedup();
        for tile in tiles {
            let slot = self.hot_slot(tile);
            let burn = match slot {
                Some(slot) => &mut self.hot[slot].burn,
                None => &mut self.burns[tile as usize],
            };
            let Some(own) = burn else { continue };
            let rect = own.update_looks(ramp);
            if slot.is_none() && !own.is_needed() {
                *burn = None;
            }
            if !rect.is_empty() {
                let rect =
                    TexelRect { x: rect.x + tile % columns * TILE_PX, y: rect.y + tile / columns * TILE_PX, ..rect };
                mask.mark(rect);
                rects.push(rect);
            }
        }
    }

    /// Looks of a tile's texels (indices into the ramp) as [`HeatMap::changed`] last found them, one array per row;
    /// `None` where nothing is burnt, and outside the map.
    pub fn looks(&self, column: u32, row: u32) -> Option<&[[u8; TILE_PX as usize]; TILE_PX as usize]> {
        let tile = self.tile_of(column.checked_mul(TILE_PX)?, row.checked_mul(TILE_PX)?)?;
        self.burn(tile).map(|burn| &burn.looks)
    }

    fn tile_of(&self, x: u32, y: u32) -> Option<u32> {
        let ((columns, rows), (column, row)) = (self.size.tiles(), (x / TILE_PX, y / TILE_PX));
        (column < columns && row < rows).then_some(row * columns + column)
    }

    fn hot_slot(&self, tile: u32) -> Option<usize> {
        Some(self.slots[tile as usize]).filter(|&slot| slot < NO_SURFACE).map(|slot| slot as usize)
    }

    fn burn(&self, tile: u32) -> Option<&Burn> {
        match self.hot_slot(tile) {
            Some(slot) => self.hot[slot].burn.as_deref(),
            None => self.burns[tile as usize].as_deref(),
        }
    }

    fn for_each_hot(&mut self, work: impl Fn(&mut HotTile, &HeatSettings) + Sync) {
        let settings = &self.settings;
        if self.hot.len() < PARALLEL_TILES {
            self.hot.iter_mut().for_each(|tile| work(tile, settings));
        } else {
            self.hot.par_iter_mut().with_min_len(PARALLEL_TILES / 8).for_each(|tile| work(tile, settings));
        }
    }
}
