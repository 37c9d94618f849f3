//! What is drawn of a pool: the height of its surface and what is dissolved under it, as texels.

use super::component::{FoamPatch, MAX_FOAM};
use super::look::PoolLook;
use super::solver::FluidSolver;
use super::threads::for_cells;
use super::{PoolGrid, WetMask};
use bevy::prelude::*;
use half::f16;
use rayon::prelude::*;

/// Cells along the side of a tile; only tiles with fluid are drawn.
pub const SURFACE_TILE: u32 = 32;
/// The surface of a pool as it is drawn: the plane of the entity through its cells, lifted along its Z, which is up. The scale of
/// its transform does not count.
///
/// Call [`PoolSurface::update`] after the steps of a [`FluidSolver`]. It is drawn where it is nearer than what else is seen.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
#[require(Transform, PoolLook)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct PoolSurface {
    /// The cells.
    pub grid: PoolGrid,
    /// Height of the calm surface over the entity's origin, along its Z, metres. Where it is not finite nothing is drawn.
    pub level_m: f32,
    /// Half floats of each cell, row by row: height of the surface over the level in millimetres, share of blood, share of dust,
    /// and 1 where there is fluid. In walls all are 0, so that interpolated numbers are those of the fluid times the fourth.
    pub texels: Vec<[u16; 4]>,
    /// Tiles of [`SURFACE_TILE`] cells that hold fluid or lie beside a cell of it, row by row.
    pub wet_tiles: Vec<UVec2>,
    /// Foam; of more than [`MAX_FOAM`] the first.
    pub foam: Vec<FoamPatch>,
    /// Grows with every change of texels or tiles.
    pub revision: u64,
}

const ONE: u16 = f16::ONE.to_bits();

impl PoolSurface {
    /// A surface without fluid.
    pub fn new(grid: PoolGrid, level_m: f32) -> Self {
        let texels = vec![[0; 4]; grid.count()];
        Self { grid, level_m, texels, wet_tiles: Vec::new(), foam: Vec::new(), revision: 0 }
    }

    /// A calm surface of clear water where a mask says.
    pub fn calm(grid: PoolGrid, level_m: f32, mask: &WetMask) -> Self {
        let mut made = Self::new(grid, level_m);
        let width = grid.size().x as usize;
        made.texels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, texel) in row.iter_mut().enumerate() {
                texel[3] = if mask.is_wet(UVec2::new(x as u32, y as u32)) { ONE } else { 0 };
            }
        });
        made.find_tiles();
        made.revision = 1;
        made
    }

    /// Takes over what a solver worked out, when steps take so many seconds and gravity is so strong (metres per second squared):
    /// see [`FluidSolver::height_m`]. The grid becomes the solver's.
    pub fn update(&mut self, solver: &FluidSolver, level_m: f32, step_s: f32, gravity_m_s2: f32) {
        self.level_m = level_m;
        self.revision += 1;
        if self.grid != *solver.grid() || self.texels.len() != solver.grid().count() {
            self.grid = *solver.grid();
            self.texels = vec![[0; 4]; self.grid.count()];
        }
        let (width, tile) = (self.grid.size().x as usize, SURFACE_TILE as usize);
        let [of_blood, of_dust] = solver.share_factors();
        let mm_per_pressure = 1e3 * solver.height_per_pressure_m(step_s, gravity_m_s2);
        // A row of tiles at a time, and of it only the tiles in which there is or was fluid.
        let cells = self.wet_tiles.len() * tile * tile;
        let rows = self.texels.par_chunks_mut(width * tile).enumerate();
        let fill = || {
            rows.for_each(|(tile_y, texels)| {
                for (row, texels) in texels.chunks_mut(width).enumerate() {
                    let [wet, pressure, blood, dust] = solver.row((tile_y * tile + row) as u32);
                    for start in (0..width).step_by(tile) {
                        let cells = start..(start + tile).min(width);
                        let texels = &mut texels[cells.clone()];
                        let wet = &wet[cells.clone()];
                        if wet.iter().all(|wet| *wet == 0.0) {
                            texels.fill([0; 4]);
                            continue;
                        }
                        let shares = blood[cells.clone()].iter().zip(&dust[cells.clone()]);
                        let numbers = pressure[cells].iter().zip(shares);
                        for ((texel, wet), (pressure, (blood, dust))) in texels.iter_mut().zip(wet).zip(numbers) {
                            let half = |number: f32| f16::from_f32(number * wet).to_bits();
                            *texel = [
                                half(pressure * mm_per_pressure),
                                half(*blood * of_blood),
                                half(*dust * of_dust),
                                half(1.0),
                            ];
                        }
                    }
                }
            })
        };
        for_cells(cells, fill);
        for_cells(cells, || self.find_tiles());
    }

    /// Whether its numbers fit together, so that it can be drawn.
    pub fn is_good(&self) -> bool {
        self.level_m.is_finite() && self.texels.len() == self.grid.count()
    }

    /// The patches of foam that show.
    pub fn good_foam(&self) -> impl Iterator<Item = &FoamPatch> {
        let is_good = |patch: &&FoamPatch| {
            patch.place_m.is_finite() && patch.radius_m > 0.0 && patch.radius_m.is_finite() && patch.amount > 0.0
        };
        self.foam.iter().take(MAX_FOAM).filter(is_good)
    }

    fn find_tiles(&mut self) {
        let size = self.grid.size();
        let tiles = (size + SURFACE_TILE - 1) / SURFACE_TILE;
        let width = size.x as usize;
        // By rows of tiles: columns with fluid in it, and in the rows just above and below it.
        let found: Vec<Vec<UVec2>> = (0..tiles.y)
            .into_par_iter()
            .map(|tile_y| {
                let from = (tile_y * SURFACE_TILE).saturating_sub(1) as usize;
                let to = ((tile_y + 1) * SURFACE_TILE + 1).min(size.y) as usize;
                let mut is_wet = vec![false; tiles.x as usize];
                for row in self.texels[from * width..to * width].chunks(width) {
                    for (tile_x, is_wet) in is_wet.iter_mut().enumerate() {
                        let start = (tile_x * SURFACE_TILE as usize).saturating_sub(1);
                        let end = ((tile_x + 1) * SURFACE_TILE as usize + 1).min(width);
                        *is_wet = *is_wet || row[start..end].iter().any(|texel| texel[3] != 0);
                    }
                }
                let wet = is_wet.iter().enumerate().filter(|(_, is_wet)| **is_wet);
                wet.map(|(tile_x, _)| UVec2::new(tile_x as u32, tile_y)).collect()
            })
            .collect();
        self.wet_tiles = found.concat();
    }
}
