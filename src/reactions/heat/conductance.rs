//! Conductances between a tile's texels, and the stages of an explicit step of conduction with them.

use super::metrics::{Metrics, PADDED, Padded, SIDE};

/// Greatest share of its temperature over the neighbours' that a texel gives away per second, 1/s, whatever its shape:
/// each of the eight exchanges is bounded to an eighth of it. Conduction is slower than asked for where texels are
/// smaller than about 0.026 mm (for the diffusivity of tissue).
pub(super) const FASTEST_PER_S: f64 = 1650.0;

/// Product of step and fastest rate that one plain explicit step may have. At one a texel would forget its own
/// temperature; at a half stages stay free of undershoots but for those of single texels.
const PLAIN_STEP: f64 = 0.5;

/// Least diffusivity that the limit above is computed for, m2/s.
const LEAST_DIFFUSIVITY: f64 = 1e-15;

/// Conductance (per diffusivity) of every edge and corner between two texels of a tile or its ring.
///
/// Both texels' tiles compute it from the same numbers in the same way, so that what one loses the other gets.
#[derive(Clone, Debug)]
pub(super) struct Conductances {
    /// Between `(x - 1, y)` and `(x, y)`.
    left: [[f32; SIDE + 1]; SIDE],
    /// Between `(x, y - 1)` and `(x, y)`.
    above: [[f32; SIDE]; SIDE + 1],
    /// Between `(x - 1, y - 1)` and `(x, y)`.
    falling: [[f32; SIDE + 1]; SIDE + 1],
    /// Between `(x - 1, y)` and `(x, y - 1)`.
    rising: [[f32; SIDE + 1]; SIDE + 1],
    /// Diffusivity over area, 1/s; zero where there is no surface.
    rate_per_s: [[f32; SIDE]; SIDE],
    /// Greatest share of its temperature over the neighbours' that a texel gives away per second.
    pub fastest_per_s: f64,
}

/// Which of the tiles about a tile take part: rows above, at and below it, from left to right.
pub(super) type Neighbourhood = [[bool; 3]; 3];

impl Conductances {
    pub fn zero() -> Box<Self> {
        Box::new(Self {
            left: [[0.0; SIDE + 1]; SIDE],
            above: [[0.0; SIDE]; SIDE + 1],
            falling: [[0.0; SIDE + 1]; SIDE + 1],
            rising: [[0.0; SIDE + 1]; SIDE + 1],
            rate_per_s: [[0.0; SIDE]; SIDE],
            fastest_per_s: 0.0,
        })
    }

    /// Conductances between texels that exist and whose tiles are warm; no heat goes to cold tiles.
    ///
    /// `texels_per_cell` has one entry per row of the tile, see [`super::metrics::texels_per_cell`]: the distance
    /// between neighbouring cells of a row is that many texels.
    pub fn update(
        &mut self,
        metrics: &Metrics,
        warm: &Neighbourhood,
        texels_per_cell: &[u32; SIDE],
        diffusivity_m2_per_s: f64,
    ) {
        let mut area_m2 = metrics.area_m2;
        let part = |k: usize| usize::from(k > 0) + usize::from(k > SIDE);
        for (y, row) in area_m2.iter_mut().enumerate() {
            let tiles = warm[part(y)];
            for (x, area_m2) in row.iter_mut().enumerate() {
                *area_m2 = if tiles[part(x)] { *area_m2 } else { 0.0 };
            }
        }
        let most_per_m2 = (FASTEST_PER_S / 8.0 / diffusivity_m2_per_s.max(LEAST_DIFFUSIVITY)) as f32;
        // Texels without area close all edges that they have.
        let edge = |conductances: [f32; 2], areas_m2: [f32; 2], cell: f32| {
            let mean = 0.5 * (conductances[0] + conductances[1]) / cell;
            mean.min(cell * most_per_m2 * areas_m2[0].min(areas_m2[1]))
        };
        let Metrics { along_u, along_v, shear, .. } = metrics;
        let rows = |y: usize| [&area_m2[y], &area_m2[y + 1]];
        for y in 0..SIDE {
            let (areas, along_u) = (&area_m2[y + 1], &along_u[y + 1]);
            let cell = texels_per_cell[y] as f32;
            for x in 0..=SIDE {
                self.left[y][x] = edge([along_u[x], along_u[x + 1]], [areas[x], areas[x + 1]], cell);
            }
        }
        for y in 0..=SIDE {
            let [areas, areas_below] = rows(y);
            let (along_v, along_v_below) = (&along_v[y], &along_v[y + 1]);
            let (shear, shear_below) = (&shear[y], &shear[y + 1]);
            for x in 0..SIDE {
                let (conductances, areas) =
                    ([along_v[x + 1], along_v_below[x + 1]], [areas[x + 1], areas_below[x + 1]]);
                self.above[y][x] = edge(conductances, areas, 1.0);
            }
            for x in 0..=SIDE {
                let falling = [shear[x].max(0.0), shear_below[x + 1].max(0.0)];
                self.falling[y][x] = edge(falling, [areas[x], areas_below[x + 1]], 1.0);
                let rising = [(-shear[x + 1]).max(0.0), (-shear_below[x]).max(0.0)];
                self.rising[y][x] = edge(rising, [areas[x + 1], areas_below[x]], 1.0);
            }
        }
        let mut fastest_per_s = 0.0f32;
        for y in 0..SIDE {
            let cell = texels_per_cell[y] as f32;
            for x in 0..SIDE {
                let area_m2 = area_m2[y + 1][x + 1];
                let rate_per_s = if area_m2 > 0.0 { diffusivity_m2_per_s as f32 / area_m2 } else { 0.0 };
                self.rate_per_s[y][x] = rate_per_s;
                // Only the ends of a cell give heat along the row, and all of the cell shares the loss.
                let along_row = (self.left[y][x] + self.left[y][x + 1]) / cell;
                let to_rows = self.above[y][x] + self.above[y + 1][x];
                let to_corners =
                    self.falling[y][x] + self.falling[y + 1][x + 1] + self.rising[y][x + 1] + self.rising[y + 1][x];
                fastest_per_s = fastest_per_s.max(rate_per_s * (along_row + to_rows + to_corners));
            }
        }
        self.fastest_per_s = fastest_per_s.into();
    }

    /// One stage of conduction: from the temperatures of the tile and its ring at the last stage, and at the one
    /// before, to the tile's new ones.
    pub fn conduct(&self, last_k: &Padded, before_k: &Padded, next_k: &mut Padded, stage: Stage) {
        for y in 0..SIDE {
            let (up, own, down): (&[f32; PADDED], _, _) = (&last_k[y], &last_k[y + 1], &last_k[y + 2]);
            let (left, above, below) = (&self.left[y], &self.above[y], &self.above[y + 1]);
            let (falling, falling_below) = (&self.falling[y], &self.falling[y + 1]);
            let (rising, rising_below) = (&self.rising[y], &self.rising[y + 1]);
            let rate_per_s = &self.rate_per_s[y];
            let (before, next) = (&before_k[y + 1], &mut next_k[y + 1]);
            for x in 0..SIDE {
                let t = own[x + 1];
                let straight = left[x] * (own[x] - t)
                    + left[x + 1] * (own[x + 2] - t)
                    + above[x] * (up[x + 1] - t)
                    + below[x] * (down[x + 1] - t);
                let diagonal = falling[x] * (up[x] - t)
                    + falling_below[x + 1] * (down[x + 2] - t)
                    + rising[x + 1] * (up[x + 2] - t)
                    + rising_below[x] * (down[x] - t);
                let gained = stage.dt_s * rate_per_s[x] * (straight + diagonal);
                next[x + 1] = t + stage.momentum * (t - before[x + 1]) + gained;
            }
        }
    }
}

/// One stage of a step of the Runge-Kutta-Legendre method of first order (Meyer, Balsara and Aslam 2012).
///
/// `n` stages carry a step `(n^2 + n) / 2` times as long as a plain one, where `n` plain steps carry `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stage {
    /// How much of the last stage's change is carried on.
    momentum: f32,
    /// Time of conduction at the last stage's temperatures, seconds.
    dt_s: f32,
}

impl Stage {
    /// The stages of a step, as many as the fastest rate asks for.
    pub fn all(dt_s: f64, fastest_per_s: f64) -> impl Iterator<Item = Self> {
        let wanted = dt_s * fastest_per_s.min(FASTEST_PER_S) / PLAIN_STEP;
        // The least n with (n^2 + n) / 2 of at least that.
        let count = (((8.0 * wanted + 1.0).sqrt() - 1.0) / 2.0).ceil().max(1.0);
        let share = 2.0 / (count * (count + 1.0));
        (1..=count as u32).map(f64::from).map(move |stage| Self {
            momentum: ((stage - 1.0) / stage) as f32,
            dt_s: (dt_s * share * (2.0 * stage - 1.0) / stage) as f32,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stages_are_as_many_as_needed_and_end_at_the_steps_end() {
        for (dt_s, fastest_per_s, count) in
            [(0.01, 10.0, 1), (0.01, 0.0, 1), (0.02, 75.0, 2), (0.02, 150.0, 3), (1.0 / 60.0, 1e30, 10)]
        {
            let stages: Vec<Stage> = Stage::all(dt_s, fastest_per_s).collect();
            assert_eq!(stages.len(), count, "{dt_s} {fastest_per_s}");
            // A temperature that rises at a constant rate is carried exactly to the end.
            let (mut before, mut last) = (0.0f32, 0.0f32);
            for stage in stages {
                (before, last) = (last, last + stage.momentum * (last - before) + stage.dt_s);
            }
            assert!((f64::from(last) / dt_s - 1.0).abs() < 1e-5, "{last} {dt_s}");
        }
    }
}
