//! A piece of an organ's surface around the tool, that moves from where it was a step ago to where it is now.

use super::SurfaceFeel;
use super::bvh::{BoxTree, Look, NearLeaves};
use super::half_space::HalfSpace;
use super::proxy::Reach;
use crate::organ::closest::{of_segment_and_triangle, on_triangle};
use glam::{DVec3, Vec3, Vec3A};

/// Triangles of a surface in the world, at two times. The loop shows it moving from the one to the other, so that what the
/// simulation moves sixty times a second moves a thousand times. What was published as its end should be the start of the next.
///
/// Both sides of it are solid: a proxy stays on the side on which it is. It covers all of the surface within
/// [`reach_m`](Self::reach_m) of [`centre_m`](Self::centre_m); a proxy that touches it goes no further than that.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfacePatch {
    from_m: Vec<Vec3>,
    to_m: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    tree: BoxTree,
    is_moving: bool,
    /// How it feels.
    pub feel: SurfaceFeel,
    /// The middle of what it covers, world, metres.
    pub centre_m: DVec3,
    /// How far around that it covers the surface, metres.
    pub reach_m: f64,
    /// The triangles are those of a closed surface, counterclockwise seen from outside: a tool that begins inside is not held there.
    pub is_closed: bool,
}

impl Default for SurfaceFeel {
    fn default() -> Self {
        Self::LIVER
    }
}

impl SurfacePatch {
    /// A patch that stands still. Triangles with corners that are not there, or are no numbers, are left out.
    pub fn new(positions_m: Vec<Vec3>, triangles: Vec<[u32; 3]>, feel: SurfaceFeel) -> Self {
        Self::made(Vec::new(), positions_m, triangles, feel)
    }

    /// A patch that moves. It covers all that its triangles reach; set [`reach_m`](Self::reach_m) where they are part of more.
    pub fn moving(mut from_m: Vec<Vec3>, mut to_m: Vec<Vec3>, triangles: Vec<[u32; 3]>, feel: SurfaceFeel) -> Self {
        to_m.resize(from_m.len(), Vec3::NAN);
        if from_m == to_m {
            from_m.clear();
        }
        Self::made(from_m, to_m, triangles, feel)
    }

    /// From nothing where it stands still.
    fn made(mut from_m: Vec<Vec3>, to_m: Vec<Vec3>, mut triangles: Vec<[u32; 3]>, feel: SurfaceFeel) -> Self {
        let mut boxes = Vec::with_capacity(triangles.len());
        let mut is_moving = false;
        let (from, to) = (if from_m.is_empty() { &to_m } else { &from_m }, &to_m);
        triangles.retain(|corners| {
            let [a, b, c] = corners.map(|index| Vec3A::from(from.get(index as usize).copied().unwrap_or(Vec3::NAN)));
            // No number is greater than zero that comes of something that is none.
            let mut is_kept = (b - a).cross(c - a).length_squared() > 0.0;
            let (mut min, mut max) = (a.min(b).min(c), a.max(b).max(c));
            if is_kept && !from_m.is_empty() {
                let ends = corners.map(|index| Vec3A::from(to[index as usize]));
                is_kept = ends.iter().all(|end| end.is_finite());
                is_moving |= is_kept && ends != [a, b, c];
                let [a, b, c] = ends;
                (min, max) = (min.min(a).min(b).min(c), max.max(a).max(b).max(c));
            }
            is_kept &= min.is_finite() && max.is_finite();
            if is_kept {
                boxes.push([min, max]);
            }
            is_kept
        });
        if !is_moving {
            from_m.clear();
        }
        let tree = BoxTree::new(&boxes);
        let feel = feel.sane();
        let (centre_m, reach_m, is_closed) = (DVec3::ZERO, f64::INFINITY, false);
        Self { from_m, to_m, triangles, tree, is_moving, feel, centre_m, reach_m, is_closed }
    }

    /// How many triangles it has.
    pub fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    /// Corners of a triangle at a share of the way from start to end.
    pub(super) fn corners(&self, triangle: u32, share: f64) -> Option<[DVec3; 3]> {
        let corners = self.triangles.get(triangle as usize)?;
        Some(if self.is_moving {
            corners.map(|index| {
                let (from, to) = (self.from_m[index as usize].as_dvec3(), self.to_m[index as usize].as_dvec3());
                from + (to - from) * share
            })
        } else {
            corners.map(|index| self.to_m[index as usize].as_dvec3())
        })
    }

    /// How far the place of a triangle that is nearest to a point moves from one share to another.
    pub(super) fn motion_of(&self, triangle: u32, point_m: DVec3, shares: [f64; 2]) -> DVec3 {
        if !self.is_moving {
            return DVec3::ZERO;
        }
        let ends = shares.map(|share| self.corners(triangle, share));
        let [Some(before), Some(after)] = ends else { return DVec3::ZERO };
        let [u, v, w] = weights(on_triangle(point_m, before), before);
        (0..3).map(|corner| (after[corner] - before[corner]) * [u, v, w][corner]).sum()
    }

    /// Adds the half-spaces that the triangles near a tool leave free.
    pub(super) fn gather(&self, reach: &Reach, around: &mut Around, into: &mut Vec<HalfSpace>) {
        let Around { leaves, near, order } = around;
        near.clear();
        order.clear();
        let beyond_m = reach.radius_m + reach.step_m;
        let [a, b] = reach.segment_m;
        let is_ball = a == b;
        self.tree.visit_near(leaves, &Look::new(reach.segment_m, beyond_m), |triangle| {
            let Some(corners) = self.corners(triangle, reach.share) else { return };
            let (tool_m, surface_m) =
                if is_ball { (a, on_triangle(a, corners)) } else { of_segment_and_triangle(reach.segment_m, corners) };
            let distance2 = tool_m.distance_squared(surface_m);
            if distance2 <= beyond_m * beyond_m {
                let distance_m = distance2.sqrt();
                order.push((distance_m, triangle, near.len() as u32));
                near.push(Near { distance_m, triangle, corners, tool_m, surface_m });
            }
        });
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let first = into.len();
        let mut aim_m = reach.goal_m;
        for &(_, _, place) in order.iter() {
            let found = &near[place as usize];
            // What lies behind a half-space that is kept anyway forbids nothing more.
            let solid = |space: &HalfSpace| {
                let level = space.offset_m - reach.level_m(space.normal) + KEPT_M;
                found.corners.iter().all(|corner| space.normal.dot(*corner) <= level)
            };
            if into[first..].iter().any(solid) {
                continue;
            }
            let (feel, obstacle, element) = (self.feel, reach.obstacle, found.triangle);
            let space = |normal: DVec3, surface_m: DVec3| HalfSpace {
                normal,
                offset_m: normal.dot(surface_m) + reach.level_m(normal),
                feel,
                point_m: surface_m,
                obstacle,
                element,
            };
            let face = found.face_normal();
            let towards = if face.dot(reach.middle_m() - found.surface_m) < 0.0 { -face } else { face };
            // The tool lies beside the triangle's plane or on it: then that plane divides them, too.
            let flat = space(towards, found.corners[0]);
            let is_beside = flat.height_m(reach.place_m) >= -1e-7;
            let rounded = if found.distance_m > 1e-9 {
                space((found.tool_m - found.surface_m) / found.distance_m, found.surface_m)
            } else {
                space(towards, found.surface_m)
            };
            let chosen = if into.len() == first || !is_beside {
                rounded
            } else if flat.height_m(aim_m) > rounded.height_m(aim_m) {
                HalfSpace { point_m: found.surface_m, ..flat }
            } else {
                rounded
            };
            if into.len() == first {
                // Where the tool slides to along the nearest triangle: the others leave that free if they can.
                aim_m += chosen.normal * (-chosen.height_m(aim_m)).max(0.0);
            }
            into.push(chosen);
        }
    }

    /// Whether a point lies behind the surface, as far as the patch tells.
    pub(super) fn is_inside(&self, reach: &Reach) -> bool {
        if !self.is_closed {
            return false;
        }
        let [point, _] = reach.segment_m;
        let mut nearest = f64::INFINITY;
        let mut height = 0.0_f64;
        let mut look = |triangle: u32, nearest: &mut f64| {
            let Some(corners) = self.corners(triangle, reach.share) else { return };
            let surface = on_triangle(point, corners);
            let distance = point.distance(surface);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            let above = normal.dot(point - surface);
            // Of faces that share the nearest place the one seen most from the front tells the side.
            if distance < *nearest - 1e-9 {
                (*nearest, height) = (distance, above);
            } else if distance < *nearest + 1e-9 && above.abs() > height.abs() {
                height = above;
            }
        };
        // Ever further around, until what is nearest is surely among those seen.
        let mut radius_m = 1e-3;
        while radius_m < 1.0 && nearest > radius_m {
            self.tree.visit(&Look::new([point; 2], radius_m), |triangle| look(triangle, &mut nearest));
            radius_m *= 4.0;
        }
        height < 0.0
    }
}

/// How near a half-space must be to count as the same, metres.
const KEPT_M: f64 = 1e-9;

/// What is remembered of a patch around a tool.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    leaves: NearLeaves,
    near: Vec<Near>,
    /// Distance, triangle and place of what is near, the nearest first.
    order: Vec<(f64, u32, u32)>,
}

/// A triangle near a tool.
#[derive(Clone, Copy, Debug)]
struct Near {
    distance_m: f64,
    triangle: u32,
    corners: [DVec3; 3],
    tool_m: DVec3,
    surface_m: DVec3,
}

impl Near {
    fn face_normal(&self) -> DVec3 {
        let [a, b, c] = self.corners;
        (b - a).cross(c - a).normalize_or(DVec3::Y)
    }
}

/// Weights of a place in the corners of its triangle.
fn weights(place: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let normal = (b - a).cross(c - a);
    let area2 = normal.length_squared();
    if area2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let v = (place - a).cross(c - a).dot(normal) / area2;
    let w = (b - a).cross(place - a).dot(normal) / area2;
    [1.0 - v - w, v, w]
}
