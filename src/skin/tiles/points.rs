//! Poisson-disk feature points for the four tiles, with one strip of points that every edge shares.
//!
//! A tile is the triangle (0,0), (1,0), (1/2, √3/2): one unit is a tile's edge. Any edge of any tile must be able to
//! meet any other, so there is one strip of points along all of them: it is drawn once, is its own image under the
//! half turn about the edge's middle (the neighbour looks at the edge from the other end), and a point sits on every
//! corner. All other points keep away from the edges so far that, along an edge, the nearest point is always one of
//! the shared ones. The cell of a point is star-shaped, so no cell from inside a tile can reach across its edge and the
//! pattern over many tiles is the exact Worley pattern of all their points together.

use super::{TILE_COUNT, TileError, TileOptions};
use bevy::reflect::Reflect;
use glam::DVec2;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Height of a tile over its edge, in edge lengths: √3/2.
pub(super) const TILE_HEIGHT: f64 = 0.866_025_403_784_438_6;

/// Mean distance of neighbouring points over the Poisson radius, for random sets that no further point fits into
/// (such sets cover 54.7 % of the plane with disks of half the radius, which leaves 0.696 points per squared radius).
const SPACING_PER_RADIUS: f64 = 1.2;

/// Half the width of the band that a strip is drawn in, over the Poisson radius. Points farther away than one radius
/// cannot be the nearest one for a place on the edge, but they push on those that can.
const BAND_HALF_WIDTH: f64 = 1.4;

/// Points of a strip lie within 30 degrees of their edge as seen from its ends; what lies beyond belongs to the next of
/// the six edges that can meet at a corner.
const STRIP_SLOPE: f64 = 0.577_350_269_189_625_8;

/// How much farther than the shared points every other point is from an edge, over the Poisson radius.
const EDGE_MARGIN: f64 = 0.05;

/// Mean distance to the nearest point over the Poisson radius, for random sets that no further point fits into.
pub(super) const MEAN_DISTANCE: f64 = 0.46;

/// How many strips are drawn to choose the best from; fewer for the second octave, which shows less.
const STRIP_TRIALS: [u64; 2] = [24, 6];

/// How often a whole set is drawn again before generation gives up.
const SET_TRIALS: u64 = 16;

/// One feature point: the middle of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct FeaturePoint {
    /// Place in the tile's plane, in edge lengths; shared points also lie outside the triangle.
    pub position: DVec2,
    /// The cell's own brightness and warmth, each in -1..=1, as seen from an edge.
    pub tint: [f64; 2],
    /// The same away from the edges: cells that all tiles share look alike only where they touch their edge.
    pub inner_tint: [f64; 2],
    /// True for points that belong to the strip along an edge, or to a corner.
    pub shared: bool,
}

/// The points of all tiles for one octave of noise.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct PointLayer {
    /// No two points of a tile lie closer than this, in edge lengths.
    pub poisson_radius: f64,
    /// Points of each tile: inside it, along its edges on both sides, and the strips that start at its corners.
    pub tiles: [Vec<FeaturePoint>; TILE_COUNT],
}

/// Everything random about a set of tiles.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct TilePoints {
    /// The cells.
    pub cells: PointLayer,
    /// The second, finer octave; absent where it is switched off or finer than the texture can show.
    pub detail: Option<PointLayer>,
}

impl TilePoints {
    /// Draws the points for the given options. The same options give the same points.
    ///
    /// # Errors
    /// [`TileError::Options`] for options out of range, [`TileError::NoPoints`] if no set keeps the edge rule.
    pub fn generate(options: &TileOptions) -> Result<Self, TileError> {
        options.validate()?;
        let steps = f64::from(super::steps_from_resolution(options.resolution_px));
        let layer = |cells_per_edge: f64, seed: u64, trials: u64| {
            let poisson_radius = 1.0 / (SPACING_PER_RADIUS * cells_per_edge);
            // The prefilter reads one texel to each side of an edge.
            let margin = (EDGE_MARGIN * poisson_radius).max(2.2 / steps);
            PointLayer::generate(poisson_radius, margin, seed, trials)
        };
        let cells_per_edge = f64::from(options.cells_per_edge);
        let detail_cells = cells_per_edge * f64::from(options.detail.cells_ratio);
        let with_detail = options.detail.is_visible() && detail_cells <= super::max_cells_per_edge(steps);
        let (cells, detail) = rayon::join(
            || layer(cells_per_edge, options.seed, STRIP_TRIALS[0]),
            || {
                with_detail
                    .then(|| layer(detail_cells, options.seed ^ 0x5851_f42d_4c95_7f2d, STRIP_TRIALS[1]))
                    .transpose()
            },
        );
        Ok(Self { cells: cells?, detail: detail? })
    }
}

impl PointLayer {
    fn generate(poisson_radius: f64, margin: f64, seed: u64, strip_trials: u64) -> Result<Self, TileError> {
        for trial in 0..SET_TRIALS {
            let mut random = Pcg32::seed_from_u64(seed.wrapping_add(trial.wrapping_mul(0x9e37_79b9_7f4a_7c15)));
            let strip = Strip::best(poisson_radius, margin, strip_trials, &mut random);
            let shared = strip.around_tile();
            let seeds: [u64; TILE_COUNT] = std::array::from_fn(|_| random.random());
            let mut tiles: [Vec<FeaturePoint>; TILE_COUNT] = Default::default();
            tiles.par_iter_mut().zip(seeds).for_each(|(tile, seed)| {
                *tile = fill_tile(&strip, &shared, margin, &mut Pcg32::seed_from_u64(seed));
            });
            let layer = Self { poisson_radius, tiles };
            if layer.edge_clearance() > 0.0 {
                return Ok(layer);
            }
        }
        Err(TileError::NoPoints { trials: SET_TRIALS as u32 })
    }

    /// By how much, at worst over all edges of all tiles, the nearest point that is not shared lies farther from a
    /// place on the edge than the nearest shared one, in edge lengths. Positive means that all edges are compatible.
    pub fn edge_clearance(&self) -> f64 {
        let samples = (64.0 / self.poisson_radius).ceil() as u32;
        let clearance = |tile: &Vec<FeaturePoint>| {
            let mut worst = f64::INFINITY;
            for edge in 0..3 {
                let frame = EdgeFrame::of_tile_edge(edge);
                let mut near: Vec<(DVec2, bool)> =
                    tile.iter().map(|point| (frame.local(point.position), point.shared)).collect();
                near.retain(|(local, _)| local.y.abs() < 3.0 * self.poisson_radius);
                for sample in 0..=samples {
                    let place = DVec2::new(f64::from(sample) / f64::from(samples), 0.0);
                    let nearest = |of_shared: bool| {
                        near.iter()
                            .filter(|(_, shared)| *shared == of_shared)
                            .map(|(local, _)| local.distance_squared(place))
                            .fold(f64::INFINITY, f64::min)
                    };
                    worst = worst.min(nearest(false).sqrt() - nearest(true).sqrt());
                }
            }
            worst
        };
        self.tiles.par_iter().map(clearance).collect::<Vec<_>>().into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// Turns a vector by a multiple of 60 degrees.
fn turned(v: DVec2, sixths: i32) -> DVec2 {
    let (c, s) = match sixths.rem_euclid(6) {
        0 => (1.0, 0.0),
        1 => (0.5, TILE_HEIGHT),
        2 => (-0.5, TILE_HEIGHT),
        3 => (-1.0, 0.0),
        4 => (-0.5, -TILE_HEIGHT),
        _ => (0.5, -TILE_HEIGHT),
    };
    DVec2::new(c * v.x - s * v.y, s * v.x + c * v.y)
}

/// Corners of a tile, counter-clockwise.
pub(super) const CORNERS: [DVec2; 3] = [DVec2::ZERO, DVec2::X, DVec2::new(0.5, TILE_HEIGHT)];

/// Coordinates along (x, 0..=1) and across (y, inside is positive) an edge of the tile.
struct EdgeFrame {
    origin: DVec2,
    sixths: i32,
}

impl EdgeFrame {
    fn of_tile_edge(edge: usize) -> Self {
        Self { origin: CORNERS[edge], sixths: 2 * edge as i32 }
    }

    fn local(&self, position: DVec2) -> DVec2 {
        turned(position - self.origin, -self.sixths)
    }
}

/// The points along one edge, in the edge's own frame from (0,0) to (1,0), without its corners.
struct Strip {
    poisson_radius: f64,
    points: Vec<FeaturePoint>,
    /// Distance to the nearest shared point at evenly spaced places along the edge, ends included.
    edge_distance: Vec<f64>,
}

fn random_tint(random: &mut Pcg32) -> [f64; 2] {
    [random.random_range(-1.0..=1.0), random.random_range(-1.0..=1.0)]
}

impl Strip {
    /// Draws several strips and keeps the most inconspicuous: all edges look alike, so they should be neither denser
    /// nor sparser than the rest, neither as a whole nor near the corners, and without holes.
    fn best(poisson_radius: f64, margin: f64, trials: u64, random: &mut Pcg32) -> Self {
        let first = random.random::<u64>();
        let strips: Vec<Self> = (0..trials)
            .into_par_iter()
            .map(|trial| Self::draw(poisson_radius, margin, &mut Pcg32::seed_from_u64(first.wrapping_add(trial))))
            .collect();
        let more_even = |a: Self, b: Self| if b.unevenness() < a.unevenness() { b } else { a };
        strips.into_iter().reduce(more_even).unwrap_or_else(|| Self::draw(poisson_radius, margin, random))
    }

    fn unevenness(&self) -> f64 {
        let radius = self.poisson_radius;
        let along_edge = self.edge_distance.iter().sum::<f64>() / self.edge_distance.len() as f64;
        let widest = self.edge_distance.iter().copied().fold(0.0, f64::max);
        (along_edge - MEAN_DISTANCE * radius).abs() / radius
            + (self.mean_distance_at_corner() / radius - MEAN_DISTANCE).abs()
            + 0.3 * (widest / radius - 0.85).max(0.0)
    }

    /// Mean distance to the nearest shared point over a disk around a corner, by polar samples in a sixth of it.
    fn mean_distance_at_corner(&self) -> f64 {
        let reach = 1.3 * self.poisson_radius;
        let near: Vec<DVec2> = self
            .points
            .iter()
            .filter(|point| point.position.length() < 2.5 * self.poisson_radius)
            .flat_map(|point| (0..6).map(|sixths| turned(point.position, sixths)))
            .collect();
        let (mut sum, mut weights) = (0.0, 0.0);
        for ring in 1..=8 {
            for spoke in 0..8 {
                let radius = reach * f64::from(ring) / 8.0;
                let place = radius * DVec2::from_angle(std::f64::consts::FRAC_PI_3 * f64::from(spoke) / 8.0);
                let nearest = near.iter().map(|point| point.distance(place)).fold(radius, f64::min);
                sum += radius * nearest;
                weights += radius;
            }
        }
        sum / weights
    }

    fn draw(poisson_radius: f64, margin: f64, random: &mut Pcg32) -> Self {
        let half_width = BAND_HALF_WIDTH * poisson_radius;
        let mut drawn: Vec<DVec2> = Vec::new();
        let darts = (100.0 / poisson_radius) as u32;
        for _ in 0..darts {
            let along = random.random_range(0.0..=1.0f64);
            let across = random.random_range(-half_width..=half_width);
            if across.abs() > STRIP_SLOPE * along.min(1.0 - along) {
                continue;
            }
            let dart = DVec2::new(along, across);
            let partner = DVec2::new(1.0 - along, -across);
            let too_near = |other: DVec2| other.distance_squared(dart) < poisson_radius * poisson_radius;
            let taken = too_near(DVec2::ZERO)
                || too_near(DVec2::X)
                || images(partner, poisson_radius).any(too_near)
                || images(dart, poisson_radius).skip(1).any(too_near)
                || drawn.iter().any(|&point| images(point, poisson_radius).any(too_near));
            if !taken {
                drawn.extend([dart, partner]);
            }
        }

        let samples = (48.0 / poisson_radius).ceil() as usize;
        let place = |sample: usize| DVec2::new(sample as f64 / samples as f64, 0.0);
        let mut edge_distance: Vec<f64> =
            (0..=samples).map(|sample| place(sample).x.min(1.0 - place(sample).x)).collect();
        let near_samples = |image: DVec2| {
            let first = ((image.x - 1.1 * poisson_radius) * samples as f64).clamp(0.0, samples as f64) as usize;
            let last = ((image.x + 1.1 * poisson_radius) * samples as f64).clamp(0.0, samples as f64) as usize;
            first..=last
        };
        for image in drawn.iter().flat_map(|&point| images(point, poisson_radius)) {
            for sample in near_samples(image) {
                edge_distance[sample] = edge_distance[sample].min(image.distance(place(sample)));
            }
        }
        // Only points that are the nearest one somewhere, or nearly, have to be shared. The tiles fill the rest on
        // their own: where the others lay there is room for some point, so no holes are left beside the edge.
        let is_needed = |point: DVec2| {
            images(point, poisson_radius).any(|image| {
                near_samples(image).any(|sample| image.distance(place(sample)) <= edge_distance[sample] + margin)
            })
        };
        let mut points = Vec::new();
        for pair in drawn.chunks_exact(2) {
            if pair.iter().any(|&point| is_needed(point)) {
                let tint = random_tint(random);
                points.extend(pair.iter().map(|&position| FeaturePoint {
                    position,
                    tint,
                    inner_tint: tint,
                    shared: true,
                }));
            }
        }
        Self { poisson_radius, points, edge_distance }
    }

    /// Every shared point near a tile: its corners and the strips of all edges that can start at them.
    fn around_tile(&self) -> Vec<FeaturePoint> {
        let corner = |position| FeaturePoint { position, tint: [0.0; 2], inner_tint: [0.0; 2], shared: true };
        let mut shared: Vec<FeaturePoint> = CORNERS.map(corner).to_vec();
        let mut place = |origin: DVec2, sixths: i32| {
            for point in &self.points {
                let position = origin + turned(point.position, sixths);
                if outside_distance(position) < 2.5 * self.poisson_radius {
                    shared.push(FeaturePoint { position, ..*point });
                }
            }
        };
        for (corner, &origin) in CORNERS.iter().enumerate() {
            let own = 2 * corner as i32;
            place(origin, own);
            // Of the six edges at a corner two are the tile's; the other one of those is placed from its own start.
            for other in 2..6 {
                place(origin, own + other);
            }
        }
        shared
    }

    /// True if a point at a place given in an edge's frame would be the nearest one for some place on the edge, or
    /// would be so after coming nearer by less than the margin.
    fn is_too_near_edge(&self, local: DVec2, margin: f64) -> bool {
        let reach = 1.5 * self.poisson_radius + margin;
        if local.y.abs() > reach {
            return false;
        }
        let samples = (self.edge_distance.len() - 1) as f64;
        let first = ((local.x - reach) * samples).floor().clamp(0.0, samples) as usize;
        let last = ((local.x + reach) * samples).ceil().clamp(0.0, samples) as usize;
        (first..=last).any(|sample| {
            let along = sample as f64 / samples - local.x;
            let limit = self.edge_distance[sample] + margin;
            along * along + local.y * local.y < limit * limit
        })
    }
}

/// A strip point, and its images under the turns about both ends of its edge that other edges can bring it to. Points
/// farther than four radii from an end have none that reach the band around the edge.
fn images(position: DVec2, poisson_radius: f64) -> impl Iterator<Item = DVec2> {
    let turns = move |corner: DVec2| {
        let sixths = if position.distance(corner) < 4.0 * poisson_radius { 1..6 } else { 0..0 };
        sixths.map(move |sixths| corner + turned(position - corner, sixths))
    };
    std::iter::once(position).chain(turns(DVec2::ZERO)).chain(turns(DVec2::X))
}

/// Distance outside the tile's triangle (to the lines through its edges), negative inside.
pub(super) fn outside_distance(position: DVec2) -> f64 {
    (0..3).map(|edge| -EdgeFrame::of_tile_edge(edge).local(position).y).fold(f64::NEG_INFINITY, f64::max)
}

/// Points sorted into squares, for "is anyone closer than the radius".
struct Buckets {
    cell: f64,
    width: i32,
    points: Vec<Vec<DVec2>>,
}

impl Buckets {
    fn new(cell: f64) -> Self {
        let width = (1.0 / cell).ceil() as i32 + 8;
        Self { cell, width, points: vec![Vec::new(); (width * width) as usize] }
    }

    fn column_row(&self, position: DVec2) -> (i32, i32) {
        ((position.x / self.cell).floor() as i32 + 4, (position.y / self.cell).floor() as i32 + 4)
    }

    fn insert(&mut self, position: DVec2) {
        let (column, row) = self.column_row(position);
        if (0..self.width).contains(&column) && (0..self.width).contains(&row) {
            self.points[(row * self.width + column) as usize].push(position);
        }
    }

    fn any_within(&self, position: DVec2, distance: f64) -> bool {
        let (column, row) = self.column_row(position);
        (row - 1..=row + 1).any(|row| {
            (column - 1..=column + 1).any(|column| {
                (0..self.width).contains(&column)
                    && (0..self.width).contains(&row)
                    && self.points[(row * self.width + column) as usize]
                        .iter()
                        .any(|other| other.distance_squared(position) < distance * distance)
            })
        })
    }
}

/// Slow waves that make neighbouring cells of a tile resemble one another: patches of a few cells.
struct Mottling {
    waves: [(DVec2, f64); 6],
}

impl Mottling {
    fn new(poisson_radius: f64, random: &mut Pcg32) -> Self {
        Self {
            waves: std::array::from_fn(|_| {
                let frequency = TAU / (poisson_radius * random.random_range(3.5..=7.0));
                (DVec2::from_angle(random.random_range(0.0..TAU)) * frequency, random.random_range(0.0..TAU))
            }),
        }
    }

    fn tint(&self, position: DVec2, random: &mut Pcg32) -> [f64; 2] {
        let sum: f64 = self.waves.iter().map(|&(frequency, phase)| (frequency.dot(position) + phase).sin()).sum();
        let slow = sum / (self.waves.len() as f64 / 2.0).sqrt();
        random_tint(random).map(|own| (0.65 * own + 0.4 * slow).clamp(-1.0, 1.0))
    }
}

/// Fills one tile's inside until nothing more fits.
fn fill_tile(strip: &Strip, shared: &[FeaturePoint], margin: f64, random: &mut Pcg32) -> Vec<FeaturePoint> {
    let radius = strip.poisson_radius;
    let mut buckets = Buckets::new(radius);
    let mut points: Vec<FeaturePoint> = shared.to_vec();
    for point in &points {
        buckets.insert(point.position);
    }
    let mottling = Mottling::new(radius, random);
    for point in &mut points {
        point.inner_tint = mottling.tint(point.position, random);
    }
    // The first rounds pack the rows of points next to the shared ones: points thrown anywhere would first take the
    // places farther in and leave gaps that no further point fits into.
    let too_near_edge = |dart: DVec2, margin: f64| {
        (0..3).any(|edge| strip.is_too_near_edge(EdgeFrame::of_tile_edge(edge).local(dart), margin))
    };
    for reach in [0.15 * radius, 0.35 * radius, f64::INFINITY, f64::INFINITY] {
        let step = radius / 6.0;
        let (columns, rows) = ((1.0 / step) as u32 + 1, (TILE_HEIGHT / step) as u32 + 1);
        let mut darts: Vec<DVec2> = (0..rows)
            .flat_map(|row| (0..columns).map(move |column| (column, row)))
            .map(|(column, row)| {
                step * DVec2::new(
                    f64::from(column) + random.random_range(0.0..1.0),
                    f64::from(row) + random.random_range(0.0..1.0),
                )
            })
            .filter(|&dart| {
                let outside = outside_distance(dart);
                outside < 0.0 && -outside < reach + 1.2 * radius
            })
            .collect();
        for last in (1..darts.len()).rev() {
            darts.swap(last, random.random_range(0..=last));
        }
        for dart in darts {
            let fits = !buckets.any_within(dart, radius)
                && !too_near_edge(dart, margin)
                && (reach.is_infinite() || too_near_edge(dart, margin + reach));
            if fits {
                buckets.insert(dart);
                let tint = mottling.tint(dart, random);
                points.push(FeaturePoint { position: dart, tint, inner_tint: tint, shared: false });
            }
        }
    }
    points
}
