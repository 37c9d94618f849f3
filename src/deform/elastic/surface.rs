//! The surface by which a body is touched, and how it rides in the lattice.

use super::solver::Solver;
use crate::deform::lattice::Tree;
use glam::{DVec3, Vec3};

/// A place that rides in a lattice: its patch's corners, with their weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Embedded {
    pub corners: [u32; 8],
    pub weights: [f32; 8],
    /// Its patch, by number.
    pub patch: u32,
}

impl Embedded {
    /// A place of the box, in shares of it; beyond the box it rides like the nearest place of it.
    pub fn new(tree: &Tree, place: DVec3) -> Self {
        let number = tree.patch_at(place);
        let patch = tree.patches()[number];
        let share = ((place - patch.low()) / patch.side()).clamp(DVec3::ZERO, DVec3::ONE);
        let weights = std::array::from_fn(|n| {
            let along = |axis: usize| if n >> axis & 1 == 1 { share[axis] } else { 1.0 - share[axis] };
            (along(0) * along(1) * along(2)) as f32
        });
        Self { corners: tree.corners(number).map(|vertex| vertex as u32), weights, patch: number as u32 }
    }

    /// How far it has moved, the solver's space.
    #[inline]
    pub fn displacement(&self, of: impl Fn(usize) -> Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        for (&corner, &weight) in self.corners.iter().zip(&self.weights) {
            sum += of(corner as usize) * weight;
        }
        sum
    }
}

/// Triangles over places that ride in the lattice; the solver's space, metres.
#[derive(Clone, Debug, Default)]
pub(crate) struct TouchSurface {
    pub points: Vec<Embedded>,
    pub rest_m: Vec<Vec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl TouchSurface {
    /// Where a point is now.
    #[inline]
    pub fn position(&self, point: u32, solver: &Solver) -> Vec3 {
        let point = point as usize;
        self.rest_m[point] + self.points[point].displacement(|node| solver.displacement(node))
    }

    /// The outside of what is filled at least by half, made of the patches' faces.
    pub fn of_cells(tree: &Tree, fills: impl Fn(usize) -> f32, box_sides_m: DVec3) -> Self {
        let mut made = Self::default();
        let mut point_of = vec![u32::MAX; tree.vertex_count()];
        for (number, patch) in tree.patches().iter().enumerate().filter(|(number, _)| fills(*number) >= 0.5) {
            let corners = tree.corners(number);
            for face in 0..6 {
                let (axis, is_high) = (face / 2, face % 2 == 1);
                // A little beyond the middle of the face.
                let mut beyond = patch.low() + DVec3::splat(0.5 * patch.side());
                beyond[axis] += patch.side() * if is_high { 0.51 } else { -0.51 };
                let is_side = !(0.0..=1.0).contains(&beyond[axis]);
                if !is_side && fills(tree.patch_at(beyond)) >= 0.5 {
                    continue;
                }
                let (right, up) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
                let first = if is_high { 1 << axis } else { 0 };
                let mut quad = [first, first | right, first | right | up, first | up].map(|corner| {
                    let vertex = corners[corner];
                    if point_of[vertex] == u32::MAX {
                        point_of[vertex] = made.points.len() as u32;
                        made.points.push(Embedded::new(tree, tree.place_of(vertex)));
                        made.rest_m.push((tree.place_of(vertex) * box_sides_m).as_vec3());
                    }
                    point_of[vertex]
                });
                if !is_high {
                    quad.reverse();
                }
                let [a, b, c, d] = quad;
                made.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        made
    }
}
