//! Relaxing a texture triangulation on the surface until its triangles are nearly equilateral.
//!
//! Long edges are split, short ones collapsed, edges flipped for larger angles and vertices moved to the middle of
//! their neighbours, in the manner of Botsch and Kobbelt (2004, "A remeshing approach to multiresolution modeling").
//! All lengths are taken along the surface, never through the organ.

use super::{super::sphere::SurfacePoint, sizing, triangulation::Triangulation, walk::ChartedSurface};
use glam::DVec3;

/// Edges longer than this many edge lengths are split.
const SPLIT_ABOVE: f64 = 4.0 / 3.0;
/// Edges shorter than this many edge lengths are collapsed.
const COLLAPSE_BELOW: f64 = 4.0 / 5.0;
/// A geometric vertex this many wanted lengths from all corners of its texture triangle sits on a bump. On a flat
/// surface even the largest triangles have no place farther than 0.77 from the nearest corner.
const BUMP_ABOVE: f64 = 0.9;
/// Splitting and collapsing leave edges that are shorter on average than the middle of their thresholds.
const LENGTH_CORRECTION: f64 = 1.1;
/// Iterations between looks at how thin the organ is around the vertices.
const SIZING_EVERY: u32 = 6;
/// Part of the way to the middle of its neighbours that a vertex goes.
const DAMPING: f64 = 0.8;

/// Relaxes the triangulation over a number of iterations, of which the first `resampling` may also add and remove
/// vertices.
pub(super) fn remesh(
    surface: &ChartedSurface,
    triangulation: &mut Triangulation,
    edge_length_m: f64,
    iterations: u32,
    resampling: u32,
) {
    let edge_length_m = edge_length_m * LENGTH_CORRECTION;
    for iteration in 0..iterations {
        if iteration < resampling {
            if iteration % SIZING_EVERY == 0 {
                size(surface, triangulation, edge_length_m);
                reach_into_bumps(surface, triangulation);
            }
            split_long(surface, triangulation);
            collapse_short(surface, triangulation);
        }
        flip_for_angles(surface, triangulation);
        relax(surface, triangulation);
    }
    flip_for_angles(surface, triangulation);
}

/// Length along the surface of the edge between two vertices, metres. The walk starts at the vertex with the smaller
/// index, so that both triangles of an edge see the same length.
fn edge_length_m(surface: &ChartedSurface, triangulation: &Triangulation, a: u32, b: u32) -> f64 {
    let (a, b) = (a.min(b) as usize, a.max(b) as usize);
    surface.walk(triangulation.points[a], triangulation.directions[a], triangulation.directions[b]).length_m
}

/// Lengths of the sides of every triangle, metres.
fn side_lengths_m(surface: &ChartedSurface, triangulation: &Triangulation) -> Vec<[f64; 3]> {
    let mut lengths = vec![[0.0; 3]; triangulation.triangles.len()];
    for (face, triangle) in triangulation.triangles.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (triangle[side], triangle[(side + 1) % 3]);
            if a < b {
                let length = edge_length_m(surface, triangulation, a, b);
                lengths[face][side] = length;
                let other = triangulation.neighbours[face][side] as usize;
                if let Some(k) = triangulation.triangles[other].iter().position(|&v| v == b) {
                    lengths[other][k] = length;
                }
            }
        }
    }
    lengths
}

/// Finds the edge length wanted at every vertex.
fn size(surface: &ChartedSurface, triangulation: &mut Triangulation, edge_length_m: f64) {
    for (wanted, &point) in triangulation.wanted_m.iter_mut().zip(&triangulation.points) {
        *wanted = sizing::edge_length_at(surface, point, edge_length_m);
    }
    let positions: Vec<DVec3> = triangulation.points.iter().map(|&point| surface.position_m(point)).collect();
    for _ in 0..3 {
        for triangle in &triangulation.triangles {
            for side in 0..3 {
                let (a, b) = (triangle[side] as usize, triangle[(side + 1) % 3] as usize);
                let grown = triangulation.wanted_m[a] + sizing::GROWTH * positions[a].distance(positions[b]);
                triangulation.wanted_m[b] = triangulation.wanted_m[b].min(grown);
            }
        }
    }
}

/// Puts a vertex on every bump that rises inside a single triangle: the end of a duct, say, whose triangle has short
/// sides but a large surface.
fn reach_into_bumps(surface: &ChartedSurface, triangulation: &mut Triangulation) {
    let mut farthest: Vec<Option<(f64, u32)>> = vec![None; triangulation.triangles.len()];
    let mut near = 0;
    let mut place_of = vec![0u32; surface.positions_m.len()];
    for (face, triangle) in surface.chart.triangles.iter().enumerate() {
        for &vertex in triangle {
            place_of[vertex as usize] = face as u32;
        }
    }
    let corners: Vec<DVec3> = triangulation.points.iter().map(|&point| surface.position_m(point)).collect();
    for (vertex, &position) in surface.positions_m.iter().enumerate() {
        let Some(triangle) = triangulation.locate(near, surface.chart.directions[vertex]) else { continue };
        near = triangle;
        let distance = triangulation.triangles[triangle as usize]
            .map(|v| corners[v as usize].distance(position) / triangulation.wanted_m[v as usize])
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        if distance > BUMP_ABOVE && farthest[triangle as usize].is_none_or(|(d, _)| distance > d) {
            farthest[triangle as usize] = Some((distance, vertex as u32));
        }
    }
    for (triangle, bump) in farthest.into_iter().enumerate() {
        if let Some((_, vertex)) = bump {
            // A little off the geometric vertex, where a direction belongs to one face only.
            let face = place_of[vertex as usize];
            let weights = surface.chart.triangles[face as usize].map(|v| if v == vertex { 0.98 } else { 0.01 });
            let point = SurfacePoint { face, barycentric: DVec3::from_array(weights) };
            triangulation.insert_into(triangle as u32, point, surface.chart.direction(point));
        }
    }
}

/// Length of an edge over the length wanted there.
fn relative_length(surface: &ChartedSurface, triangulation: &Triangulation, a: u32, b: u32) -> f64 {
    let wanted = 0.5 * (triangulation.wanted_m[a as usize] + triangulation.wanted_m[b as usize]);
    edge_length_m(surface, triangulation, a, b) / wanted
}

fn split_long(surface: &ChartedSurface, triangulation: &mut Triangulation) {
    for face in 0..triangulation.triangles.len() {
        for side in 0..3 {
            let triangle = triangulation.triangles[face];
            let (a, b) = (triangle[side] as usize, triangle[(side + 1) % 3] as usize);
            if relative_length(surface, triangulation, a as u32, b as u32) > SPLIT_ABOVE {
                let middle = (triangulation.directions[a] + triangulation.directions[b]).normalize_or_zero();
                let point = surface.chart.locate(triangulation.points[a].face, middle);
                triangulation.split(face as u32, side, point, surface.chart.direction(point));
                break;
            }
        }
    }
}

fn collapse_short(surface: &ChartedSurface, triangulation: &mut Triangulation) {
    let mut short = Vec::new();
    for triangle in &triangulation.triangles {
        for side in 0..3 {
            let (a, b) = (triangle[side], triangle[(side + 1) % 3]);
            if a < b {
                let length = relative_length(surface, triangulation, a, b);
                if length < COLLAPSE_BELOW {
                    short.push((length, a, b));
                }
            }
        }
    }
    short.sort_unstable_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)).then(x.2.cmp(&y.2)));
    let mut touched = vec![false; triangulation.directions.len()];
    let mut pairs = Vec::new();
    let mut ring = Vec::new();
    // Below sixteen triangles the arcs grow towards half circles.
    let mut left = triangulation.triangles.len().saturating_sub(16) / 2;
    for (_, a, b) in short {
        for (kept, gone) in [(a, b), (b, a)] {
            if left == 0 {
                break;
            }
            let mut around = Vec::new();
            for vertex in [kept, gone] {
                triangulation.ring(vertex, &mut ring);
                around.extend(ring.iter().flat_map(|&(face, _)| triangulation.triangles[face as usize]));
            }
            if around.iter().any(|&v| touched[v as usize]) || !triangulation.can_collapse(kept, gone, &mut ring) {
                continue;
            }
            triangulation.ring(gone, &mut ring);
            let grows_long = ring.iter().any(|&(face, corner)| {
                let far = triangulation.triangles[face as usize][(corner + 1) % 3];
                far != kept && relative_length(surface, triangulation, kept, far) > SPLIT_ABOVE
            });
            if grows_long {
                continue;
            }
            for v in around {
                touched[v as usize] = true;
            }
            pairs.push((kept, gone));
            left -= 1;
            break;
        }
    }
    triangulation.collapse(&pairs);
}

/// Cosine of the angle opposite the first of three sides.
fn cosine(opposite: f64, p: f64, q: f64) -> f64 {
    (p * p + q * q - opposite * opposite) / (2.0 * p * q).max(f64::MIN_POSITIVE)
}

/// Smallest angle of a triangle with the given sides, as its cosine (large means a small angle).
fn worst_cosine(x: f64, y: f64, z: f64) -> f64 {
    cosine(x, y, z).max(cosine(y, z, x)).max(cosine(z, x, y))
}

/// Flips edges wherever that makes the smallest angle of the two triangles larger.
fn flip_for_angles(surface: &ChartedSurface, triangulation: &mut Triangulation) {
    let mut lengths = side_lengths_m(surface, triangulation);
    for _ in 0..8 {
        let mut flips = 0;
        for face in 0..triangulation.triangles.len() as u32 {
            for side in 0..3 {
                let triangle = triangulation.triangles[face as usize];
                let (a, b, c) = (triangle[side], triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
                if a > b {
                    continue;
                }
                let other = triangulation.neighbours[face as usize][side] as usize;
                let Some(k) = triangulation.triangles[other].iter().position(|&v| v == b) else { continue };
                let [ab, bc, ca] = std::array::from_fn(|i| lengths[face as usize][(side + i) % 3]);
                let [_, ad, db] = std::array::from_fn(|i| lengths[other][(k + i) % 3]);
                // Angles opposite the edge that together stay under half a turn: the edge is locally Delaunay.
                if cosine(ab, bc, ca) + cosine(ab, ad, db) >= 0.0 || triangulation.flipped(face, side).is_none() {
                    continue;
                }
                let d = triangulation.opposite(face, side);
                let cd = edge_length_m(surface, triangulation, c, d);
                let before = worst_cosine(ab, bc, ca).max(worst_cosine(ab, ad, db));
                let after = worst_cosine(ca, ad, cd).max(worst_cosine(db, bc, cd));
                if after < before - 1e-6 {
                    triangulation.flip(face, side);
                    lengths[face as usize] = [ca, ad, cd];
                    lengths[other] = [db, bc, cd];
                    flips += 1;
                }
            }
        }
        if flips == 0 {
            break;
        }
    }
}

/// Moves every vertex towards the area-weighted middle of its triangles.
fn relax(surface: &ChartedSurface, triangulation: &mut Triangulation) {
    let mut ring = Vec::new();
    let mut spokes: Vec<DVec3> = Vec::new();
    for vertex in 0..triangulation.directions.len() as u32 {
        triangulation.ring(vertex, &mut ring);
        let from = triangulation.points[vertex as usize];
        let direction = triangulation.directions[vertex as usize];
        spokes.clear();
        spokes.extend(ring.iter().map(|&(face, corner)| {
            let end = triangulation.triangles[face as usize][(corner + 1) % 3];
            surface.walk(from, direction, triangulation.directions[end as usize]).displacement_m
        }));
        let mut moment = DVec3::ZERO;
        let mut area = 0.0;
        for k in 0..spokes.len() {
            let (p, q) = (spokes[k], spokes[(k + 1) % spokes.len()]);
            let triangle = triangulation.triangles[ring[k].0 as usize];
            let wanted = triangle.map(|v| triangulation.wanted_m[v as usize]).iter().sum::<f64>();
            let part = p.cross(q).length() / (wanted * wanted);
            moment += (p + q) / 3.0 * part;
            area += part;
        }
        if area <= 0.0 {
            continue;
        }
        let mut step = moment / area * DAMPING;
        for _ in 0..4 {
            let point: SurfacePoint = surface.go(from, step);
            if triangulation.try_move(vertex, point, surface.chart.direction(point), &ring) {
                break;
            }
            step *= 0.5;
        }
    }
}
