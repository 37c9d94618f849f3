//! Air cells: a foam of rounded cells that grow towards a centre.

use super::noise::of_pair;
use super::shapes::blend;
use glam::{IVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// Distance over which corners of cells are rounded, millimetres.
const ROUNDING_MM: f32 = 0.45;

/// Where cells may lie and how they vary.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoamOptions {
    pub(super) low: Vec3,
    pub(super) high: Vec3,
    /// Cells are largest here.
    pub(super) centre: Vec3,
    /// Distance of neighbouring cells at the centre and far from it, millimetres.
    pub(super) spacing_mm: [f32; 2],
    /// Distance over which they shrink, millimetres.
    pub(super) shrink_mm: f32,
    /// Thickness of a wall between two cells, millimetres.
    pub(super) wall_mm: f32,
    /// Share of the walls that are missing.
    pub(super) open_share: f32,
    pub(super) seed: u64,
}

/// Feature points of Worley's cellular noise ("A cellular texture basis function", 1996), thrown so that they keep a distance
/// that depends on the place; the cells are their Voronoi regions.
#[derive(Clone, Debug)]
pub(super) struct Foam {
    options: FoamOptions,
    points: Vec<Vec3>,
    is_bone: Vec<bool>,
    bins: Bins,
}

/// Points sorted into cubes.
#[derive(Clone, Debug)]
struct Bins {
    low: Vec3,
    side: f32,
    count: IVec3,
    starts: Vec<u32>,
    members: Vec<u32>,
}

impl Bins {
    fn new(points: &[Vec3], low: Vec3, high: Vec3, side: f32) -> Self {
        let count = ((high - low) / side).ceil().as_ivec3().max(IVec3::ONE);
        let mut bins = Self { low, side, count, starts: vec![0], members: Vec::new() };
        let mut lists = vec![Vec::new(); count.element_product() as usize];
        for (index, &point) in points.iter().enumerate() {
            lists[bins.of(bins.cube(point))].push(index as u32);
        }
        for list in lists {
            bins.members.extend(list);
            bins.starts.push(bins.members.len() as u32);
        }
        bins
    }

    fn cube(&self, p: Vec3) -> IVec3 {
        ((p - self.low) / self.side).floor().as_ivec3().clamp(IVec3::ZERO, self.count - 1)
    }

    fn of(&self, cube: IVec3) -> usize {
        ((cube.z * self.count.y + cube.y) * self.count.x + cube.x) as usize
    }

    /// Members of all cubes that a ball touches.
    fn around(&self, p: Vec3, radius: f32) -> impl Iterator<Item = u32> {
        let (low, high) = (self.cube(p - radius), self.cube(p + radius));
        let cubes = (low.z..=high.z)
            .flat_map(move |z| (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| IVec3::new(x, y, z))));
        cubes.flat_map(|cube| {
            let bin = self.of(cube);
            self.members[self.starts[bin] as usize..self.starts[bin + 1] as usize].iter().copied()
        })
    }
}

/// The points that matter within a ball, as rows of coordinates.
#[derive(Clone, Debug, Default)]
pub(super) struct FoamPart {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    indices: Vec<u32>,
    squared: Vec<f32>,
}

impl Foam {
    /// `is_bone` says of which feature points the cells stayed bone; it is given a random number from 0 to 1 with each point.
    pub(super) fn new(options: FoamOptions, is_bone: impl Fn(Vec3, f32) -> bool) -> Self {
        let mut random = Pcg32::seed_from_u64(options.seed);
        let FoamOptions { low, high, spacing_mm, .. } = options;
        let side = spacing_mm[0].max(spacing_mm[1]);
        let empty = Bins::new(&[], low, high, side);
        let mut lists: Vec<Vec<Vec3>> = vec![Vec::new(); empty.count.element_product() as usize];
        let mut points = Vec::new();
        // Darts per least cell: enough that gaps which take another cell are rare.
        let darts = 6.0 * (high - low).element_product() / spacing_mm[0].min(spacing_mm[1]).powi(3);
        for _ in 0..darts as u32 {
            let share = Vec3::new(random.random(), random.random(), random.random());
            let dart = low + (high - low) * share;
            let spacing = options.spacing_at(dart);
            let (from, to) = (empty.cube(dart - spacing), empty.cube(dart + spacing));
            let is_free = (from.z..=to.z).all(|z| {
                (from.y..=to.y).all(|y| {
                    (from.x..=to.x).all(|x| {
                        let near = &lists[empty.of(IVec3::new(x, y, z))];
                        near.iter().all(|point| point.distance_squared(dart) > spacing * spacing)
                    })
                })
            });
            if is_free {
                lists[empty.of(empty.cube(dart))].push(dart);
                points.push(dart);
            }
        }
        let bins = Bins::new(&points, low, high, side);
        let is_bone = points.iter().map(|&point| is_bone(point, random.random())).collect();
        Self { options, points, is_bone, bins }
    }

    /// Gathers what matters for places within a ball into `part`.
    pub(super) fn gather(&self, centre: Vec3, radius: f32, part: &mut FoamPart) {
        let mut reach = self.bins.side;
        let nearest = loop {
            let distances = self.bins.around(centre, reach).map(|index| self.points[index as usize].distance(centre));
            let nearest = distances.fold(f32::INFINITY, f32::min);
            // Beyond the foam there is always some point, so this ends.
            if nearest <= reach || self.points.is_empty() || reach > 64.0 {
                break nearest;
            }
            reach *= 2.0;
        };
        // A wall that passes within `ROUNDING_MM` of a place in the ball parts two points that are not much farther.
        let limit = nearest + 2.0 * radius + 2.0 * (ROUNDING_MM + self.options.wall_mm);
        part.x.clear();
        part.y.clear();
        part.z.clear();
        part.indices.clear();
        if !limit.is_finite() {
            return;
        }
        for index in self.bins.around(centre, limit) {
            let point = self.points[index as usize];
            if point.distance(centre) <= limit {
                part.x.push(point.x);
                part.y.push(point.y);
                part.z.push(point.z);
                part.indices.push(index);
            }
        }
        part.squared.resize(part.x.len(), 0.0);
    }

    /// Distance to the air of the cells, negative within it, for a place in the ball that `part` was gathered for.
    pub(super) fn distance(&self, p: Vec3, part: &mut FoamPart) -> f32 {
        let FoamPart { x, y, z, indices, squared } = part;
        for (((out, x), y), z) in squared.iter_mut().zip(&*x).zip(&*y).zip(&*z) {
            let (dx, dy, dz) = (p.x - x, p.y - y, p.z - z);
            *out = dx * dx + dy * dy + dz * dz;
        }
        let least = squared.iter().copied().fold(f32::INFINITY, f32::min);
        let Some(own) = squared.iter().position(|&distance| distance == least) else { return f32::INFINITY };
        let options = &self.options;
        let seed = options.seed as u32;
        let own_is_bone = self.is_bone[indices[own] as usize];
        let centre = Vec3::new(x[own], y[own], z[own]);
        // In a cell the depth under its walls; in one that stayed bone the distance from the nearest cell's border.
        let mut inside = f32::INFINITY;
        for other in 0..squared.len() {
            // The wall is (b^2 - a^2) / (2 |ab|) away, and |ab| <= a + b.
            let bound = 0.5 * (squared[other].sqrt() - least.sqrt());
            if other == own || bound > inside + ROUNDING_MM {
                continue;
            }
            let other_is_bone = self.is_bone[indices[other] as usize];
            let is_open = !other_is_bone && of_pair(indices[own], indices[other], seed) < options.open_share;
            if if own_is_bone { other_is_bone } else { is_open } {
                continue;
            }
            let between = centre.distance(Vec3::new(x[other], y[other], z[other]));
            let wall = 0.5 * (squared[other] - least) / between;
            inside =
                if inside.is_finite() && !own_is_bone { blend(inside, wall, ROUNDING_MM) } else { inside.min(wall) };
        }
        if own_is_bone {
            return 0.5 * options.wall_mm + inside;
        }
        0.5 * options.wall_mm - inside
    }
}

impl FoamOptions {
    fn spacing_at(&self, p: Vec3) -> f32 {
        let [near, far] = self.spacing_mm;
        far + (near - far) * (-(p.distance(self.centre) / self.shrink_mm).powi(2)).exp()
    }
}
