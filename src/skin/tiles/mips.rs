//! From four tiles' texels to a mipmapped texture array without seams.
//!
//! The texels of a tile form a triangular lattice with the corners on texel centres, so the edges of all tiles use the
//! same places and the lattice is its own image under the tile's rotations. The mean of all tiles in all rotations,
//! laid over the whole plane, has every symmetry that the edges need (third turns about the middles of triangles, half
//! turns about the middles of edges, sixth turns about corners). It stands for the unknown neighbour: it fills the
//! texture beyond the edges, and in the coarser levels the texels whose bilinear footprint reaches an edge hold only it.

use super::ramp::{FIXED_ONE, bytes_from_fixed, fixed_from_bytes, smooth_step};
use super::worley::HEXAGON_WEIGHTS;
use super::{TILE_COUNT, padding_from_resolution, steps_from_resolution};
use rayon::prelude::*;

/// Colours on the triangular lattice of a tile in fixed-point linear light: rows of `steps + 1`, `steps`, .. 1.
#[derive(Clone)]
pub(super) struct Lattice {
    pub steps: i32,
    pub texels: Vec<[i32; 3]>,
}

impl Lattice {
    fn offset(steps: i32, i: i32, j: i32) -> usize {
        (j * (steps + 1) - j * (j - 1) / 2 + i) as usize
    }

    pub(super) fn at(&self, i: i32, j: i32) -> [i32; 3] {
        self.texels[Self::offset(self.steps, i, j)]
    }

    fn from_fn(steps: i32, texel: impl Fn(i32, i32) -> [i32; 3]) -> Self {
        let texels = (0..=steps).flat_map(|j| (0..=steps - j).map(move |i| (i, j))).map(|(i, j)| texel(i, j)).collect();
        Self { steps, texels }
    }

    fn is_inside(&self, i: i32, j: i32) -> bool {
        i >= 0 && j >= 0 && i + j <= self.steps
    }

    /// The lattice laid over the whole plane by half turns about the middles of edges.
    fn anywhere(&self, mut i: i32, mut j: i32) -> [i32; 3] {
        loop {
            if j < 0 {
                (i, j) = (self.steps - i, -j);
            } else if i < 0 {
                (i, j) = (-i, self.steps - j);
            } else if i + j > self.steps {
                (i, j) = (self.steps - i, self.steps - j);
            } else {
                return self.at(i, j);
            }
        }
    }

    /// Mean over all tiles and rotations.
    fn mean(tiles: &[Lattice; TILE_COUNT]) -> Self {
        let steps = tiles[0].steps;
        let count = 3 * TILE_COUNT as i32;
        Self::from_fn(steps, |i, j| {
            let k = steps - i - j;
            let mut sum = [count / 2; 3];
            for tile in tiles {
                for (i, j) in [(i, j), (j, k), (k, i)] {
                    let texel = tile.at(i, j);
                    sum = std::array::from_fn(|c| sum[c] + texel[c]);
                }
            }
            sum.map(|s| s / count)
        })
    }

    /// Prefiltered colour at a lattice point; places outside the tile come from `around`.
    fn filtered(&self, around: &Lattice, i: i32, j: i32) -> [i32; 3] {
        let mut sum = [32; 3];
        if i >= 2 && j >= 2 && i + j + 2 <= self.steps {
            let rows: [i32; 5] = std::array::from_fn(|row| Self::offset(self.steps, i, j + row as i32 - 2) as i32);
            for (di, dj, weight) in HEXAGON_WEIGHTS {
                let texel = self.texels[(rows[(dj + 2) as usize] + di) as usize];
                sum = std::array::from_fn(|c| sum[c] + weight * texel[c]);
            }
            return sum.map(|s| s >> 6);
        }
        for (di, dj, weight) in HEXAGON_WEIGHTS {
            let (i, j) = (i + di, j + dj);
            let texel = if self.is_inside(i, j) { self.at(i, j) } else { around.anywhere(i, j) };
            sum = std::array::from_fn(|c| sum[c] + weight * texel[c]);
        }
        sum.map(|s| s >> 6)
    }

    /// Half as many steps along an edge.
    fn halved(&self, around: &Lattice) -> Self {
        Self::from_fn(self.steps / 2, |i, j| self.filtered(around, 2 * i, 2 * j))
    }

    /// Prefiltered colour between lattice points, linear over the lattice's triangles.
    fn filtered_between(&self, around: &Lattice, x: f64, y: f64) -> [f64; 3] {
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let (i, j) = (i as i32, j as i32);
        let nodes = if u + v <= 1.0 {
            [(i, j, 1.0 - u - v), (i + 1, j, u), (i, j + 1, v)]
        } else {
            [(i + 1, j + 1, u + v - 1.0), (i, j + 1, 1.0 - u), (i + 1, j, 1.0 - v)]
        };
        let mut sum = [0.0; 3];
        for (i, j, weight) in nodes {
            if weight > 0.0 {
                let texel = self.filtered(around, i, j);
                sum = std::array::from_fn(|c| sum[c] + weight * f64::from(texel[c]));
            }
        }
        sum
    }

    /// Mean colour over the area: texels on edges and corners count for their half and sixth.
    fn mean_colour(&self) -> [i32; 3] {
        let (mut sum, mut weights) = ([0i64; 3], 0);
        for j in 0..=self.steps {
            for i in 0..=self.steps - j {
                let borders = [i, j, self.steps - i - j].iter().filter(|&&b| b == 0).count();
                let weight = [6, 3, 1][borders.min(2)];
                let texel = self.at(i, j);
                sum = std::array::from_fn(|c| sum[c] + weight * i64::from(texel[c]));
                weights += weight;
            }
        }
        sum.map(|s| ((s + weights / 2) / weights) as i32)
    }
}

/// Builds all levels, finest first; each holds the four tiles' square images one after another, sRGB RGBA8.
///
/// `tiles` are 8-bit sRGB colours on the lattice of each tile.
pub(super) fn build(resolution_px: u32, tiles: &[Vec<[u8; 3]>; TILE_COUNT]) -> Vec<Vec<u8>> {
    let steps = steps_from_resolution(resolution_px) as i32;
    let mut lattices: [Lattice; TILE_COUNT] = tiles
        .each_ref()
        .map(|texels| Lattice { steps, texels: texels.iter().copied().map(fixed_from_bytes).collect() });
    let mut mean = Lattice::mean(&lattices);
    let mut levels = vec![finest_level(resolution_px, &lattices, &mean)];
    let mut size = resolution_px as i32;
    while size > 1 {
        size /= 2;
        // Level k is sampled from the lattice of level k - 1; the coarsest lattice has 15 steps (level 4 of 256).
        if size * 2 >= 16 {
            levels.push(coarse_level(size, resolution_px as i32 / size, resolution_px, &lattices, &mean));
        } else {
            let [r, g, b] = bytes_from_fixed(mean.mean_colour());
            levels.push([r, g, b, 255].repeat((size * size) as usize * TILE_COUNT));
        }
        if mean.steps % 2 == 0 {
            let halves: Vec<Lattice> = lattices.par_iter().map(|tile| tile.halved(&mean)).collect();
            for (lattice, half) in lattices.iter_mut().zip(halves) {
                *lattice = half;
            }
            mean = mean.halved(&mean);
        }
    }
    levels
}

fn image_of(size: i32, texel: impl Fn(i32, i32) -> [u8; 3] + Sync) -> Vec<u8> {
    let mut bytes = vec![255; (size * size) as usize * 4];
    bytes.par_chunks_exact_mut(size as usize * 4).enumerate().for_each(|(y, row)| {
        for (x, rgba) in row.chunks_exact_mut(4).enumerate() {
            rgba[..3].copy_from_slice(&texel(x as i32, y as i32));
        }
    });
    bytes
}

fn finest_level(resolution_px: u32, tiles: &[Lattice; TILE_COUNT], mean: &Lattice) -> Vec<u8> {
    let padding = padding_from_resolution(resolution_px) as i32;
    let steps = mean.steps;
    let around = image_of(resolution_px as i32, |x, y| bytes_from_fixed(mean.anywhere(x - padding, y - padding)));
    let layers: Vec<Vec<u8>> = tiles
        .par_iter()
        .map(|tile| {
            let mut image = around.clone();
            let mut put = |i: i32, j: i32, colour: [i32; 3]| {
                let start = (((j + padding) * resolution_px as i32 + i + padding) * 4) as usize;
                image[start..start + 3].copy_from_slice(&bytes_from_fixed(colour));
            };
            for j in 0..=steps {
                for i in 0..=steps - j {
                    put(i, j, tile.at(i, j));
                }
            }
            // A bilinear footprint on the diagonal edge has one texel inside and one outside with equal weights; with
            // this colour outside, the two cancel and only the two on the edge count, as on the other edges.
            for i in 0..steps {
                let j = steps - 1 - i;
                let (inner, a, b) = (tile.at(i, j), tile.at(i + 1, j), tile.at(i, j + 1));
                put(i + 1, j + 1, std::array::from_fn(|c| (a[c] + b[c] - inner[c]).clamp(0, FIXED_ONE)));
            }
            image
        })
        .collect();
    layers.concat()
}

/// A level of `size` texels, `texel_px` finest texels each, from the lattices of the level before it.
fn coarse_level(
    size: i32,
    texel_px: i32,
    resolution_px: u32,
    tiles: &[Lattice; TILE_COUNT],
    mean: &Lattice,
) -> Vec<u8> {
    let padding = f64::from(padding_from_resolution(resolution_px));
    // Place of a texel's centre on the lattice, whose steps are half a texel (at the coarsest levels up to one).
    let lattice_per_px = f64::from(mean.steps) / f64::from(steps_from_resolution(resolution_px));
    let place = |texel: i32| ((f64::from(texel) + 0.5) * f64::from(texel_px) - 0.5 - padding) * lattice_per_px;
    let rows_per_step = 1.0 / (lattice_per_px * f64::from(texel_px));
    let round = |colour: [f64; 3]| bytes_from_fixed(colour.map(|c| (c + 0.5) as i32));

    let shared: Vec<[f64; 3]> = (0..size * size)
        .into_par_iter()
        .map(|texel| mean.filtered_between(mean, place(texel % size), place(texel / size)))
        .collect();
    let layers: Vec<Vec<u8>> = tiles
        .par_iter()
        .map(|tile| {
            image_of(size, |x, y| {
                let around = shared[(y * size + x) as usize];
                let (px, py) = (place(x), place(y));
                let rows = px.min(py).min(f64::from(mean.steps) - px - py) * rows_per_step;
                // The footprint of a place on the diagonal edge reaches two rows deep.
                let own = smooth_step(2.0, 4.0, rows);
                if own == 0.0 {
                    return round(around);
                }
                let texel = tile.filtered_between(mean, px, py);
                round(std::array::from_fn(|c| around[c] + (texel[c] - around[c]) * own))
            })
        })
        .collect();
    layers.concat()
}
