//! The organ that ships with the crate: a liver made from a formula, free of anybody's rights.
//!
//! A subdivided icosahedron is drawn onto an implicit liver (rounded ellipsoids joined and scooped out) while the
//! implicit surface morphs from a ball into that shape. Its vertices slide within the surface meanwhile, and edges are
//! flipped, so that the triangles stay even. Genus 0 holds by construction.

use super::ellipsoid::icosphere;
use crate::organ::mesh::{self, SurfaceMesh};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{DVec3, Vec3};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

/// Each icosahedron edge is split into this many: 20 * 8 * 8 = 1,280 triangles.
const SUBDIVISIONS: usize = 8;
/// Steps in which the wrapping shrinks onto the liver.
const SHRINK_STEPS: usize = 60;
/// Steps in which the vertices spread evenly afterwards.
const SETTLE_STEPS: usize = 60;
/// Spacing of the differences that give the field's gradient, field units (centimetres).
const GRADIENT_STEP: f64 = 1e-3;

/// Which liver to make. Values that are not positive numbers count as the default.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct ProceduralLiver {
    /// Picks one of many slightly different livers; the same seed gives the same bits.
    pub seed: u64,
    /// From the right lobe (-x) to the tip of the left lobe (+x), metres.
    pub width_m: f32,
    /// From back (-z) to front (+z), metres.
    pub depth_m: f32,
    /// From the lower (-y) to the upper (+y) end, metres.
    pub height_m: f32,
}

impl Default for ProceduralLiver {
    fn default() -> Self {
        Self { seed: 0, width_m: 0.22, depth_m: 0.15, height_m: 0.12 }
    }
}

/// Makes a liver: 1,280 triangles, closed, genus 0, not star-shaped, centred on the origin, +y up, front at +z.
///
/// A large right lobe with a domed top, a thinner left lobe that tapers to an edge, a notch between them in the front
/// margin, a hollow underside with a hilum, and a back that bends round the spine.
pub fn procedural_liver(options: &ProceduralLiver) -> SurfaceMesh {
    let field = LiverField::new(options.seed);
    let (mut positions, mut triangles) = icosphere(SUBDIVISIONS);
    for position in &mut positions {
        *position *= START_RADII;
    }
    for step in 1..=SHRINK_STEPS + SETTLE_STEPS {
        let offset = START_OFFSET * (1.0 - step as f64 / SHRINK_STEPS as f64).max(0.0);
        relax(&mut positions, &triangles, &|p| field.distance(p) - offset);
        if step % 2 == 0 {
            flip_edges(&positions, &mut triangles);
        }
    }
    fit_box(&positions, triangles, options)
}

/// An ellipsoid round the whole liver to start from, and its least distance from it, centimetres.
const START_RADII: DVec3 = DVec3::new(16.0, 11.0, 12.0);
const START_OFFSET: f64 = 4.0;

/// The liver as a field: about the distance to its surface in centimetres, negative inside.
struct LiverField {
    right_lobe: Ellipsoid,
    /// The part of the right lobe that hangs down at the side.
    right_tail: Ellipsoid,
    left_lobe: Ellipsoid,
    /// What stomach and bowel press into the underside.
    stomach: Ellipsoid,
    /// What the right kidney presses into the underside.
    kidney: Ellipsoid,
    /// Bed of the spine and the vena cava in the back.
    spine: Ellipsoid,
    /// Notch of the round ligament in the front margin.
    notch: Ellipsoid,
    hilum: Ellipsoid,
    caudate_lobe: Ellipsoid,
}

impl LiverField {
    fn new(seed: u64) -> Self {
        let mut random = Pcg32::seed_from_u64(seed);
        // Up to 2.5 mm of shift and 2.5 % of size: individual, still a liver.
        let mut ellipsoid = |centre: [f64; 3], radii: [f64; 3]| {
            let mut signed = || f64::from(random.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0;
            let mut vary = |scale: f64| DVec3::new(signed(), signed(), signed()) * scale;
            let centre = DVec3::from_array(centre) + vary(0.25);
            Ellipsoid { centre, radii: DVec3::from_array(radii) * (DVec3::ONE + vary(0.025)) }
        };
        Self {
            right_lobe: ellipsoid([-4.4, 0.4, 0.6], [6.4, 6.8, 6.8]),
            right_tail: ellipsoid([-6.6, -4.4, 2.4], [3.4, 4.6, 4.6]),
            left_lobe: ellipsoid([4.4, 3.2, 0.4], [7.8, 3.0, 6.2]),
            stomach: ellipsoid([6.6, -12.3, -5.2], [15.5, 15.0, 12.5]),
            kidney: ellipsoid([-3.4, -8.4, -4.4], [5.6, 6.6, 6.4]),
            spine: ellipsoid([2.5, 0.0, -7.2], [3.2, 12.0, 5.8]),
            notch: ellipsoid([2.2, -1.6, 5.8], [1.0, 4.6, 4.2]),
            hilum: ellipsoid([-1.0, 0.4, -0.8], [3.0, 2.2, 1.3]),
            caudate_lobe: ellipsoid([-1.2, 2.4, -4.8], [1.6, 2.6, 2.0]),
        }
    }

    fn distance(&self, p: DVec3) -> f64 {
        // Both ends bend back and down, as the organ lies round the spine under the diaphragm.
        let p = p + DVec3::new(0.0, 0.012, 0.024) * (p.x - 0.5).powi(2);
        let lobes = smooth_min(self.right_lobe.distance(p), self.left_lobe.distance(p), 6.0);
        let lobes = smooth_min(lobes, self.right_tail.distance(p), 4.0);
        let scooped = smooth_max(lobes, -self.stomach.distance(p), 1.4);
        let scooped = smooth_max(scooped, -self.kidney.distance(p), 1.6);
        let bent = smooth_max(scooped, -self.spine.distance(p), 2.2);
        let with_caudate = smooth_min(bent, self.caudate_lobe.distance(p), 1.8);
        let notched = smooth_max(with_caudate, -self.notch.distance(p), 1.4);
        smooth_max(notched, -self.hilum.distance(p), 1.6)
    }
}

struct Ellipsoid {
    centre: DVec3,
    radii: DVec3,
}

impl Ellipsoid {
    /// Distance to first order.
    fn distance(&self, p: DVec3) -> f64 {
        let scaled = (p - self.centre) / self.radii;
        let (length, slope) = (scaled.length(), (scaled / self.radii).length());
        // At the very centre the slope vanishes.
        if slope > 0.0 { length * (length - 1.0) / slope } else { -self.radii.min_element() }
    }
}

/// Minimum with a round transition of the given width (quadratic).
fn smooth_min(a: f64, b: f64, width: f64) -> f64 {
    let overlap = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - overlap * overlap * width / 4.0
}

fn smooth_max(a: f64, b: f64, width: f64) -> f64 {
    -smooth_min(-a, -b, width)
}

fn gradient(value: &impl Fn(DVec3) -> f64, p: DVec3) -> DVec3 {
    let slope =
        |axis: DVec3| (value(p + axis * GRADIENT_STEP) - value(p - axis * GRADIENT_STEP)) / (2.0 * GRADIENT_STEP);
    DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z))
}

/// Moves every vertex to the centre of its fan, weighted by area, within the surface, and then onto the surface.
fn relax(positions: &mut [DVec3], triangles: &[[u32; 3]], value: &impl Fn(DVec3) -> f64) {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    let mut weights = vec![0.0; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
        let area = (b - a).cross(c - a).length();
        for vertex in triangle.map(|vertex| vertex as usize) {
            sums[vertex] += area * (a + b + c) / 3.0;
            weights[vertex] += area;
        }
    }
    for (position, (sum, weight)) in positions.iter_mut().zip(sums.into_iter().zip(weights)) {
        let slope = gradient(value, *position);
        let normal = slope.normalize_or_zero();
        let pull = if weight > 0.0 { sum / weight - *position } else { DVec3::ZERO };
        *position += 0.7 * (pull - normal * pull.dot(normal));
        // Where the field folds its slope is small and a full Newton step would shoot off.
        let step = value(*position) / slope.length_squared().max(0.25);
        *position -= slope * step.clamp(-1.0, 1.0);
    }
}

/// Flips edges whose two opposite angles sum to more than half a turn (Delaunay), at most one per face and call.
fn flip_edges(positions: &[DVec3], triangles: &mut [[u32; 3]]) {
    let neighbours = mesh::neighbours(triangles);
    let mut is_touched = vec![false; triangles.len()];
    let mut edges: Vec<[u32; 2]> =
        triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).filter(|[from, to]| from < to).collect();
    edges.sort_unstable();
    let mut added: Vec<[u32; 2]> = Vec::new();
    for face in 0..triangles.len() {
        for side in 0..3 {
            let other = neighbours[face][side] as usize;
            if is_touched[face] || is_touched[other] {
                continue;
            }
            let [a, b, c] = [0, 1, 2].map(|k| triangles[face][(side + k) % 3]);
            let Some(d) = triangles[other].into_iter().find(|&vertex| vertex != a && vertex != b) else { continue };
            let edge = [c.min(d), c.max(d)];
            let [pa, pb, pc, pd] = [a, b, c, d].map(|vertex| positions[vertex as usize]);
            let cosine = |p: DVec3| (pa - p).normalize_or_zero().dot((pb - p).normalize_or_zero());
            // cos x + cos y < 0 is x + y > pi for angles of triangles.
            let is_worth = cosine(pc) + cosine(pd) < -1e-3;
            let (first, second) = ((pd - pa).cross(pc - pa), (pb - pd).cross(pc - pd));
            let keeps_shape = first.dot(second) > 0.5 * first.length() * second.length();
            if is_worth && keeps_shape && edges.binary_search(&edge).is_err() && !added.contains(&edge) {
                (triangles[face], triangles[other]) = ([a, d, c], [d, b, c]);
                (is_touched[face], is_touched[other]) = (true, true);
                added.push(edge);
            }
        }
    }
}

/// Centres the liver and stretches it to the wanted box; metres.
fn fit_box(positions: &[DVec3], triangles: Vec<[u32; 3]>, options: &ProceduralLiver) -> SurfaceMesh {
    let fallback = ProceduralLiver::default();
    let valid = |value: f32, default: f32| f64::from(if value.is_finite() && value > 0.0 { value } else { default });
    let size = DVec3::new(
        valid(options.width_m, fallback.width_m),
        valid(options.height_m, fallback.height_m),
        valid(options.depth_m, fallback.depth_m),
    );
    let low = positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let place = |&p: &DVec3| -> Vec3 { ((p - (low + high) / 2.0) / (high - low) * size).as_vec3() };
    SurfaceMesh { positions_m: positions.iter().map(place).collect(), triangles, uvs: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::organ::clean::{RawMesh, Topology, Weld, clean};

    fn liver(seed: u64) -> SurfaceMesh {
        procedural_liver(&ProceduralLiver { seed, ..Default::default() })
    }

    /// How far the best point fails to see all faces, metres: no point has all faces' inner half-spaces round it if
    /// this is positive.
    ///
    /// With weights `w >= 0`, sum 1, over four faces whose unit normals `n` cancel (`sum w n = 0`), the largest height
    /// `n . x - d` of any point x above the four faces is at least `-sum w d` (Farkas). Which four is found by walking
    /// to a point that is low above all; the bound holds whichever they are.
    fn blindness_m(mesh: &SurfaceMesh) -> f64 {
        let planes: Vec<(DVec3, f64)> = (0..mesh.triangles.len() as u32)
            .map(|face| {
                let [a, b, c] = mesh.corners(face);
                let normal = (b - a).cross(c - a).normalize();
                (normal, normal.dot(a))
            })
            .collect();
        let mut point = DVec3::ZERO;
        for step in 0..20_000 {
            let height = |plane: &&(DVec3, f64)| plane.0.dot(point) - plane.1;
            let highest = planes.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("there are faces");
            point -= highest.0 * 0.02 * 0.5f64.powi(step / 1_500);
        }
        let mut near = planes;
        near.sort_by(|a, b| (b.0.dot(point) - b.1).total_cmp(&(a.0.dot(point) - a.1)));
        near.truncate(32);
        let mut best = f64::NEG_INFINITY;
        for i in 0..near.len() {
            for j in 0..i {
                for k in 0..j {
                    for l in 0..k {
                        let [a, b, c, d] = [i, j, k, l].map(|index| near[index]);
                        let triple = |x: DVec3, y: DVec3, z: DVec3| x.dot(y.cross(z));
                        let weights = [
                            triple(b.0, c.0, d.0),
                            -triple(a.0, c.0, d.0),
                            triple(a.0, b.0, d.0),
                            -triple(a.0, b.0, c.0),
                        ];
                        let sum: f64 = weights.iter().sum();
                        if sum.abs() > 1e-6 && weights.iter().all(|weight| weight / sum >= 0.0) {
                            let bound =
                                [a, b, c, d].into_iter().zip(weights).map(|(plane, weight)| -plane.1 * weight / sum);
                            best = best.max(bound.sum());
                        }
                    }
                }
            }
        }
        best
    }

    fn smallest_angle_degrees(mesh: &SurfaceMesh) -> f64 {
        let angles = (0..mesh.triangles.len() as u32).flat_map(|face| {
            let corners = mesh.corners(face);
            [0, 1, 2].map(|k| (corners[(k + 1) % 3] - corners[k]).angle_between(corners[(k + 2) % 3] - corners[k]))
        });
        angles.fold(f64::INFINITY, f64::min).to_degrees()
    }

    /// Number of edges that run through a face they do not touch.
    fn piercings(mesh: &SurfaceMesh) -> usize {
        let mut count = 0;
        for &[i, j, k] in &mesh.triangles {
            for (from, to) in [(i, j), (j, k), (k, i)].into_iter().filter(|(from, to)| from < to) {
                let (p, q) = (mesh.positions_m[from as usize].as_dvec3(), mesh.positions_m[to as usize].as_dvec3());
                count += (0..mesh.triangles.len() as u32)
                    .filter(|&face| !mesh.triangles[face as usize].iter().any(|&v| v == from || v == to))
                    .filter(|&face| {
                        let [a, b, c] = mesh.corners(face);
                        let volume = |x: DVec3, y: DVec3, z: DVec3, w: DVec3| (y - x).dot((z - x).cross(w - x));
                        let sides = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)];
                        (volume(a, b, c, p) > 0.0) != (volume(a, b, c, q) > 0.0)
                            && (sides.iter().all(|side| *side > 0.0) || sides.iter().all(|side| *side < 0.0))
                    })
                    .count();
            }
        }
        count
    }

    #[test]
    fn is_a_clean_sphere_of_even_triangles_for_many_seeds() {
        for seed in 0..8 {
            let mesh = liver(seed);
            let raw = RawMesh { positions: mesh.positions_m.clone(), uvs: None, triangles: mesh.triangles.clone() };
            let (cleaned, _) = clean(raw, Weld::ByPosition, Topology::Closed).expect("it is closed and of genus 0");
            assert_eq!(cleaned, mesh, "seed {seed}: cleaning finds nothing to do, so all faces look outward");
            assert_eq!(mesh.triangles.len(), 1280);
            assert!(smallest_angle_degrees(&mesh) > 12.0, "seed {seed}: {}", smallest_angle_degrees(&mesh));
            assert_eq!(piercings(&mesh), 0, "seed {seed} cuts through itself");
            // A real liver has 1.2 to 1.8 litres.
            assert!((1.0e-3..1.8e-3).contains(&mesh.volume_m3()), "seed {seed}: {} m3", mesh.volume_m3());
        }
    }

    #[test]
    fn is_not_star_shaped() {
        for seed in 0..8 {
            let blindness_m = blindness_m(&liver(seed));
            assert!(blindness_m > 0.002, "seed {seed}: {blindness_m} m");
        }
        // The measure itself: the ball that the liver starts from is star-shaped, by its whole inner radius.
        let (positions, triangles) = icosphere(4);
        let ball = SurfaceMesh { positions_m: positions.iter().map(|p| p.as_vec3()).collect(), triangles, uvs: None };
        assert!((-1.0..-0.9).contains(&blindness_m(&ball)), "{}", blindness_m(&ball));
    }

    #[test]
    fn seed_and_size_decide_everything() {
        assert_eq!(liver(7), liver(7));
        assert_ne!(liver(7), liver(8));
        let options = ProceduralLiver { width_m: 0.3, depth_m: f32::NAN, height_m: -1.0, ..Default::default() };
        let (low, high) = procedural_liver(&options).bounds_m();
        assert!((high - low).abs_diff_eq(Vec3::new(0.3, 0.12, 0.15), 1e-6));
    }
}
