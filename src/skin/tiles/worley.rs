//! Evaluating a tile: the distance to the nearest feature point (Worley's F1, 1996) and the colour it makes.

use super::points::{CORNERS, FeaturePoint, MEAN_DISTANCE, PointLayer, TILE_HEIGHT, TilePoints, outside_distance};
use super::ramp::{RampTable, bytes_from_fixed, fixed_from_linear, linear_from_srgb, mix, smooth_step};
use super::{TILE_COUNT, TileOptions};
use glam::DVec2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How far outside the tile the nearest point is still found, over the Poisson radius.
const MARGIN_PER_RADIUS: f64 = 0.6;

/// For every square of a grid, the points that can be the nearest one somewhere in the square.
pub(super) struct NearestGrid {
    low: DVec2,
    squares_per_unit: f64,
    columns: usize,
    rows: usize,
    starts: Vec<u32>,
    candidates: Vec<(DVec2, u32)>,
}

impl NearestGrid {
    pub(super) fn new(points: &[FeaturePoint], poisson_radius: f64) -> Self {
        let side = 0.35 * poisson_radius;
        let low = DVec2::splat(-MARGIN_PER_RADIUS * poisson_radius);
        let high = DVec2::new(1.0, TILE_HEIGHT) - low;
        let columns = ((high.x - low.x) / side).ceil() as usize;
        let rows = ((high.y - low.y) / side).ceil() as usize;
        // Nearly every place has a point within a little over one radius; the square's diagonal comes on top.
        let reach = 1.9 * poisson_radius;
        let mut bins: Vec<Vec<u32>> = vec![Vec::new(); columns * rows];
        let bin_range = |from: f64, count: usize| {
            let first = ((from - reach) / side).floor().clamp(0.0, count as f64) as usize;
            let last = ((from + reach) / side).ceil().clamp(0.0, count as f64) as usize;
            first..last
        };
        for (index, point) in points.iter().enumerate() {
            let local = point.position - low;
            for row in bin_range(local.y, rows) {
                for column in bin_range(local.x, columns) {
                    bins[row * columns + column].push(index as u32);
                }
            }
        }
        let half_diagonal = side * std::f64::consts::FRAC_1_SQRT_2;
        let mut starts = vec![0];
        let mut candidates = Vec::new();
        for row in 0..rows {
            for column in 0..columns {
                let middle = low + side * DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
                if outside_distance(middle) > MARGIN_PER_RADIUS * poisson_radius + half_diagonal {
                    starts.push(candidates.len() as u32);
                    continue;
                }
                let distance = |&index: &u32| points[index as usize].position.distance(middle);
                let bin = &bins[row * columns + column];
                let mut nearest = bin.iter().map(distance).fold(f64::INFINITY, f64::min);
                let everyone: Vec<u32>;
                let pool = if nearest + 2.0 * half_diagonal < reach {
                    bin
                } else {
                    everyone = (0..points.len() as u32).collect();
                    nearest = everyone.iter().map(distance).fold(f64::INFINITY, f64::min);
                    &everyone
                };
                let limit = nearest + 2.0 * half_diagonal + 1e-9;
                candidates.extend(
                    pool.iter()
                        .filter(|&index| distance(index) <= limit)
                        .map(|&index| (points[index as usize].position, index)),
                );
                starts.push(candidates.len() as u32);
            }
        }
        Self { low, squares_per_unit: 1.0 / side, columns, rows, starts, candidates }
    }

    /// Distance to the nearest point and its index, for places in and just around the tile.
    #[inline]
    pub(super) fn nearest(&self, position: DVec2) -> (f64, u32) {
        let local = (position - self.low) * self.squares_per_unit;
        let column = (local.x.max(0.0) as usize).min(self.columns - 1);
        let row = (local.y.max(0.0) as usize).min(self.rows - 1);
        let square = row * self.columns + column;
        let mut best = (f64::INFINITY, 0);
        for &(point, index) in &self.candidates[self.starts[square] as usize..self.starts[square + 1] as usize] {
            let distance = point.distance_squared(position);
            if distance < best.0 {
                best = (distance, index);
            }
        }
        (best.0.sqrt(), best.1)
    }
}

/// A smooth random displacement that bends the straight borders between cells; none along the tile's edges.
struct Wobble {
    steps: usize,
    offsets: Vec<DVec2>,
}

impl Wobble {
    const WAVES: usize = 10;

    fn new(amplitude: f64, wavelength: f64, random: &mut Pcg32) -> Self {
        let waves: Vec<(DVec2, DVec2, f64)> = (0..Self::WAVES)
            .map(|_| {
                let frequency = TAU / (wavelength * random.random_range(0.7..=1.5));
                (
                    DVec2::from_angle(random.random_range(0.0..TAU)) * frequency,
                    DVec2::from_angle(random.random_range(0.0..TAU)) * amplitude / (Self::WAVES as f64).sqrt(),
                    random.random_range(0.0..TAU),
                )
            })
            .collect();
        let steps = (6.0 / wavelength).ceil() as usize;
        let mut offsets = Vec::with_capacity((steps + 2) * (steps + 2));
        for j in 0..steps + 2 {
            for i in 0..steps + 2 {
                let place = DVec2::new(i as f64 + 0.5 * j as f64, TILE_HEIGHT * j as f64) / steps as f64;
                offsets.push(waves.iter().map(|&(k, d, phase)| d * (k.dot(place) + phase).sin()).sum());
            }
        }
        Self { steps, offsets }
    }

    /// Displacement at barycentric coordinates (towards the second and the third corner) inside the tile.
    fn at(&self, b1: f64, b2: f64) -> DVec2 {
        let (x, y) = (b1 * self.steps as f64, b2 * self.steps as f64);
        let (i, j) = ((x as usize).min(self.steps), (y as usize).min(self.steps));
        let (fx, fy) = (x - i as f64, y - j as f64);
        let node = |i: usize, j: usize| self.offsets[j * (self.steps + 2) + i];
        let low = node(i, j).lerp(node(i + 1, j), fx);
        low.lerp(node(i, j + 1).lerp(node(i + 1, j + 1), fx), fy)
    }
}

/// One octave ready for evaluation.
struct Octave<'a> {
    points: &'a [FeaturePoint],
    grid: NearestGrid,
    poisson_radius: f64,
}

impl<'a> Octave<'a> {
    fn new(layer: &'a PointLayer, tile: usize) -> Self {
        let points = &layer.tiles[tile];
        Self { points, grid: NearestGrid::new(points, layer.poisson_radius), poisson_radius: layer.poisson_radius }
    }
}

/// Colours of one tile as a function of place.
struct TilePainter<'a> {
    options: &'a TileOptions,
    ramp: &'a RampTable,
    net_linear: [f64; 3],
    cells: Octave<'a>,
    detail: Option<Octave<'a>>,
    wobble: Wobble,
    /// Heights over the edge between which a tile's own variation fades in.
    fade_in: (f64, f64),
}

impl<'a> TilePainter<'a> {
    fn new(options: &'a TileOptions, ramp: &'a RampTable, points: &'a TilePoints, tile: usize) -> Self {
        let radius = points.cells.poisson_radius;
        let texel = 1.0 / f64::from(super::steps_from_resolution(options.resolution_px));
        let fade_start = (0.1 * radius).max(1.1 * texel);
        let mut random = Pcg32::seed_from_u64(options.seed.wrapping_mul(TILE_COUNT as u64).wrapping_add(tile as u64));
        Self {
            options,
            ramp,
            net_linear: options.detail.net_srgb.map(|c| linear_from_srgb(f64::from(c))),
            cells: Octave::new(&points.cells, tile),
            detail: points.detail.as_ref().map(|layer| Octave::new(layer, tile)),
            wobble: Wobble::new(f64::from(options.wobble) * radius, 1.6 * radius, &mut random),
            fade_in: (fade_start, fade_start + 0.4 * radius),
        }
    }

    /// Linear colour at barycentric coordinates towards the second and third corner, which may lie a little outside.
    fn colour(&self, b1: f64, b2: f64) -> [f64; 3] {
        let place = CORNERS[1] * b1 + CORNERS[2] * b2;
        let height = TILE_HEIGHT * b1.min(b2).min(1.0 - b1 - b2);
        let inner = smooth_step(self.fade_in.0, self.fade_in.1, height);
        let bent = if inner > 0.0 { place + inner * self.wobble.at(b1, b2) } else { place };

        let (distance, cell) = self.cells.grid.nearest(bent);
        let distance = distance / self.cells.poisson_radius;
        let cell = &self.cells.points[cell as usize];
        let options = self.options;
        let mut shade = distance;
        let mut net = 0.0;
        if let Some(detail) = &self.detail {
            let fine = detail.grid.nearest(place).0 / detail.poisson_radius;
            // Six edges bring six equal strips to every corner, which would show as little stars.
            let to_corner_squared =
                CORNERS.iter().map(|&corner| corner.distance_squared(place)).fold(f64::INFINITY, f64::min);
            let whole = 0.4 * self.cells.poisson_radius;
            let share = if to_corner_squared < whole * whole {
                smooth_step(0.125, 1.0, to_corner_squared.sqrt() / whole)
            } else {
                1.0
            };
            shade += share * f64::from(options.detail.relief) * (fine - MEAN_DISTANCE);
            net = share * f64::from(options.detail.net) * smooth_step(0.4, 0.8, fine);
        }

        // A cell's own tint is strongest in its middle: borders lie at half a radius and beyond.
        let strength = f64::from(options.cell_jitter) * (1.0 - 0.75 * smooth_step(0.25, 0.6, distance));
        let tint = |index: usize| cell.tint[index] + (cell.inner_tint[index] - cell.tint[index]) * inner;
        let (brightness, warmth) = (1.0 + strength * tint(0), 0.2 * strength * tint(1));
        let ramp = self.ramp.colour(shade);
        let tinted =
            [ramp[0] * brightness * (1.0 + warmth), ramp[1] * brightness, ramp[2] * brightness * (1.0 - warmth)];
        mix(tinted, self.net_linear, net)
    }
}

/// Weights of the prefilter over a lattice point and its neighbours: (1 2 1)/4 along each of the lattice's three
/// directions, which treats all six alike. In units of the whole sum of 64.
pub(super) const HEXAGON_WEIGHTS: [(i32, i32, i32); 19] = [
    (0, 0, 10),
    (1, 0, 6),
    (0, 1, 6),
    (-1, 1, 6),
    (-1, 0, 6),
    (0, -1, 6),
    (1, -1, 6),
    (1, 1, 2),
    (-1, 2, 2),
    (-2, 1, 2),
    (-1, -1, 2),
    (1, -2, 2),
    (2, -1, 2),
    (2, 0, 1),
    (0, 2, 1),
    (-2, 2, 1),
    (-2, 0, 1),
    (0, -2, 1),
    (2, -2, 1),
];

/// Renders one tile on the lattice of its texels: rows of `steps + 1`, `steps`, .. 1 colours, 8-bit sRGB.
/// Four places per texel are evaluated and filtered in linear light.
fn render(painter: &TilePainter, steps: i32) -> Vec<[u8; 3]> {
    const ROWS_PER_TASK: i32 = 12;
    let fine_steps = 2 * steps;
    let tasks = (steps + 1 + ROWS_PER_TASK - 1) / ROWS_PER_TASK;
    let parts: Vec<Vec<[u8; 3]>> = (0..tasks)
        .into_par_iter()
        .map(|task| {
            let rows = task * ROWS_PER_TASK..((task + 1) * ROWS_PER_TASK).min(steps + 1);
            let width = (fine_steps + 5) as usize;
            let first_fine = 2 * rows.start - 2;
            let fine_rows = 2 * (rows.end - 1) + 2 - first_fine + 1;
            // Four channels, so that one colour is one vector register.
            let mut fine = vec![[0; 4]; width * fine_rows as usize];
            for row in 0..fine_rows {
                let j = first_fine + row;
                for i in -2..=fine_steps - j.max(0) + 2 {
                    let colour =
                        painter.colour(f64::from(i) / f64::from(fine_steps), f64::from(j) / f64::from(fine_steps));
                    let [r, g, b] = fixed_from_linear(colour);
                    fine[row as usize * width + (i + 2) as usize] = [r, g, b, 0];
                }
            }
            let mut texels = Vec::new();
            for j in rows {
                for i in 0..=steps - j {
                    let middle = (2 * j - first_fine) * width as i32 + 2 * i + 2;
                    let mut sum = [32; 4];
                    for (di, dj, weight) in HEXAGON_WEIGHTS {
                        let colour = fine[(middle + dj * width as i32 + di) as usize];
                        sum = std::array::from_fn(|c| sum[c] + weight * colour[c]);
                    }
                    let [r, g, b, _] = sum;
                    texels.push(bytes_from_fixed([r >> 6, g >> 6, b >> 6]));
                }
            }
            texels
        })
        .collect();
    parts.concat()
}

/// Renders all tiles in parallel, 8-bit sRGB on each tile's lattice.
pub(super) fn render_tiles(
    options: &TileOptions,
    ramp: &RampTable,
    points: &TilePoints,
    steps: i32,
) -> [Vec<[u8; 3]>; TILE_COUNT] {
    let mut tiles: [Vec<[u8; 3]>; TILE_COUNT] = Default::default();
    tiles.par_iter_mut().enumerate().for_each(|(tile, texels)| {
        let painter = TilePainter::new(options, ramp, points, tile);
        *texels = render(&painter, steps);
    });
    tiles
}
