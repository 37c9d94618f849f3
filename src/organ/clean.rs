//! From a heap of triangles to a surface: weld, drop what has no area, keep one piece, orient, and check.

mod weld;

use crate::organ::error::MeshFault;
use crate::organ::mesh::SurfaceMesh;
use bevy::ecs::VariantDefaults;
use bevy::reflect::Reflect;
use glam::{DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use weld::{weld_points, weld_seams};

/// More faces than this are refused.
pub const MAX_FACES: u64 = 5_000_000;
/// More vertices than this, before welding, are refused.
pub const MAX_VERTICES: u64 = 3 * MAX_FACES;
/// Vertices closer than this part of the box's diagonal become one. Ten times the rounding of 32-bit coordinates.
pub const WELD_TOLERANCE: f64 = 1e-6;
/// A triangle lower than this part of its longest side has no area.
const FLATNESS: f64 = 1e-6;
/// Largest share of faces without area that is cleaned away without complaint.
const MAX_DEGENERATE_SHARE: f64 = 0.01;
/// A surface whose volume is less than this part of its cubed diagonal encloses nothing.
const MIN_VOLUME_SHARE: f64 = 1e-9;

/// Which vertices of a file become one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum Weld {
    /// All at one place; texture coordinates are dropped.
    #[default]
    ByPosition,
    /// Those at one place with the same texture coordinates: seams stay open in the index, but not for the checks.
    ByPositionAndUv,
}

/// What a surface must be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum Topology {
    /// Closed and of genus 0, as a chart over the sphere needs.
    #[default]
    Closed,
    /// With or without borders and handles; every edge still has at most two faces.
    Any,
}

/// Triangles as they come from a file: unwelded, in any order and orientation. Indices are in range.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct RawMesh {
    /// Vertex positions in file units.
    pub positions: Vec<Vec3>,
    /// Texture coordinates, one per vertex.
    pub uvs: Option<Vec<Vec2>>,
    /// Vertex indices of each face.
    pub triangles: Vec<[u32; 3]>,
}

/// What cleaning changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct CleanReport {
    /// Vertices that were joined with another one.
    pub vertices_welded: u64,
    /// Vertices that no kept face uses. Those of an OBJ file that no face at all uses are not even read.
    pub vertices_unused: u64,
    /// Faces without area that were dropped.
    pub faces_degenerate: u64,
    /// Edges flipped because a face's third corner lay on them.
    pub edges_flipped: u64,
    /// Faces on the same three vertices as another one.
    pub faces_duplicate: u64,
    /// Unconnected pieces that were found.
    pub components: u64,
    /// Faces of the pieces that were not kept.
    pub faces_in_other_components: u64,
    /// Faces that were turned round.
    pub faces_turned: u64,
}

/// Makes a surface of a heap of triangles, still in file units.
///
/// Vertices are welded ([`WELD_TOLERANCE`]), faces without area and repeated faces go, of several pieces the one with
/// the largest area stays, and all faces are turned the same way: outward where the surface is closed, else as most
/// of its area was. Kept vertices and faces keep their order.
///
/// # Errors
/// Everything in [`MeshFault`] that is about the surface rather than the file.
pub fn clean(raw: RawMesh, weld: Weld, topology: Topology) -> Result<(SurfaceMesh, CleanReport), MeshFault> {
    let diagonal = check_raw(&raw, weld)?;
    let mut report = CleanReport::default();
    let mut is_used = vec![false; raw.positions.len()];
    raw.triangles.as_flattened().iter().for_each(|&vertex| is_used[vertex as usize] = true);
    let point_of = weld_points(&raw.positions, &is_used, diagonal * WELD_TOLERANCE);
    let vertex_of = match (&raw.uvs, weld) {
        (Some(uvs), Weld::ByPositionAndUv) => weld_seams(&point_of, uvs),
        _ => point_of.clone(),
    };
    report.vertices_welded =
        vertex_of.iter().enumerate().filter(|&(vertex, &kept)| vertex as u32 != kept).count() as u64;

    let look_up = |of: &[u32]| raw.triangles.iter().map(|face| face.map(|v| of[v as usize])).collect();
    let mut faces = Faces { positions: &raw.positions, points: look_up(&point_of), vertices: look_up(&vertex_of) };
    faces.drop_degenerate(&mut report)?;
    faces.drop_duplicates(&mut report);
    faces.keep_largest_component(&mut report);
    if faces.points.is_empty() {
        return Err(MeshFault::Empty);
    }

    let edges = faces.edges();
    let border_edges = faces.check_edges(&edges, topology)?;
    faces.orient(&edges, border_edges == 0, &mut report)?;
    faces.check_fans()?;
    if topology == Topology::Closed {
        faces.check_sphere(&edges, diagonal)?;
    }
    let uvs = raw.uvs.as_deref().filter(|_| weld == Weld::ByPositionAndUv);
    let mesh = faces.compact(&point_of, uvs);
    let kept = mesh.positions_m.len() as u64;
    report.vertices_unused = (raw.positions.len() as u64).saturating_sub(report.vertices_welded + kept);
    Ok((mesh, report))
}

/// Checks what does not depend on connections; the diagonal of the bounding box in file units.
fn check_raw(raw: &RawMesh, weld: Weld) -> Result<f64, MeshFault> {
    let (vertices, faces) = (raw.positions.len() as u64, raw.triangles.len() as u64);
    if faces == 0 {
        return Err(MeshFault::Empty);
    }
    let too_many = |what: &str, count, limit| Err(MeshFault::TooMany { what: what.into(), count, limit });
    if faces > MAX_FACES {
        return too_many("faces", faces, MAX_FACES);
    }
    if vertices > MAX_VERTICES {
        return too_many("vertices", vertices, MAX_VERTICES);
    }
    for (number, face) in raw.triangles.iter().enumerate() {
        if let Some(&index) = face.iter().find(|&&index| u64::from(index) >= vertices) {
            let (place, index) = (format!("face {number}"), i64::from(index));
            return Err(MeshFault::IndexOutOfRange { place, what: "vertex".into(), index, count: vertices });
        }
    }
    if let Some(number) = raw.positions.iter().position(|position| !position.is_finite()) {
        return Err(MeshFault::NotFinite { place: format!("vertex {number}") });
    }
    if weld == Weld::ByPositionAndUv {
        let uvs = raw.uvs.as_ref().filter(|uvs| uvs.len() == raw.positions.len());
        let uvs = uvs.ok_or_else(|| MeshFault::NoUvs { place: "mesh".into() })?;
        if let Some(number) = uvs.iter().position(|uv| !uv.is_finite()) {
            return Err(MeshFault::NotFinite { place: format!("texture coordinate {number}") });
        }
    }
    let used = || raw.triangles.as_flattened().iter().map(|&vertex| raw.positions[vertex as usize].as_dvec3());
    let low = used().fold(DVec3::INFINITY, DVec3::min);
    let high = used().fold(DVec3::NEG_INFINITY, DVec3::max);
    let diagonal = low.distance(high);
    if diagonal > 0.0 { Ok(diagonal) } else { Err(MeshFault::Flat { extent: Vec3::ZERO }) }
}

/// One side of a face, smaller point first; sorting these brings the sides of an edge together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    points: [u32; 2],
    face: u32,
    /// Whether the face runs through it from the smaller to the larger point.
    is_forward: bool,
}

/// The sides that lie on one edge.
fn by_edge(sides: &[Side]) -> impl Iterator<Item = &[Side]> {
    sides.chunk_by(|a, b| a.points == b.points)
}

/// Faces under work. Topology goes by place ([`Faces::points`]), so that texture seams are no borders.
struct Faces<'a> {
    positions: &'a [Vec3],
    points: Vec<[u32; 3]>,
    /// The vertices that end up in the index: as the points, but apart at texture seams.
    vertices: Vec<[u32; 3]>,
}

impl Faces<'_> {
    fn position(&self, point: u32) -> DVec3 {
        self.positions[point as usize].as_dvec3()
    }

    fn cross(&self, face: usize) -> DVec3 {
        let [a, b, c] = self.points[face].map(|point| self.position(point));
        (b - a).cross(c - a)
    }

    /// Keeps the faces for which `is_kept` is true; how many went.
    fn retain(&mut self, is_kept: &[bool]) -> u64 {
        let before = self.points.len();
        for list in [&mut self.points, &mut self.vertices] {
            let mut flags = is_kept.iter();
            list.retain(|_| flags.next().copied().unwrap_or(true));
        }
        (before - self.points.len()) as u64
    }

    fn edges(&self) -> Vec<Side> {
        let mut sides = Vec::with_capacity(3 * self.points.len());
        for (face, points) in self.points.iter().enumerate() {
            for side in 0..3 {
                let (a, b) = (points[side], points[(side + 1) % 3]);
                sides.push(Side { points: [a.min(b), a.max(b)], face: face as u32, is_forward: a < b });
            }
        }
        sides.sort_unstable();
        sides
    }

    fn is_collapsed(&self, face: usize) -> bool {
        let [a, b, c] = self.points[face];
        a == b || b == c || c == a
    }

    /// Whether the third corner lies on the longest side, as good as.
    fn is_flat(&self, face: usize) -> bool {
        let [a, b, c] = self.points[face].map(|point| self.position(point));
        let longest_squared = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        self.cross(face).length() <= FLATNESS * longest_squared
    }

    /// Drops faces with a repeated corner and flips away those whose corners lie on a line: dropping the latter would
    /// tear a crack. Only what cannot be flipped is dropped.
    fn drop_degenerate(&mut self, report: &mut CleanReport) -> Result<(), MeshFault> {
        let faces = self.points.len();
        let bad: Vec<usize> = (0..faces).filter(|&face| self.is_collapsed(face) || self.is_flat(face)).collect();
        if let Some(&first) = bad.first().filter(|_| bad.len() as f64 > MAX_DEGENERATE_SHARE * faces as f64) {
            let at = self.positions[self.points[first][0] as usize];
            return Err(MeshFault::Degenerate { degenerate: bad.len() as u64, faces: faces as u64, at });
        }
        if bad.is_empty() {
            return Ok(());
        }
        let is_kept: Vec<bool> = (0..faces).map(|face| !self.is_collapsed(face)).collect();
        report.faces_degenerate += self.retain(&is_kept);
        // Flipping one may flatten the next in a row of them; rows are short.
        for _ in 0..8 {
            let flips = self.flip_flat();
            report.edges_flipped += flips;
            if flips == 0 {
                break;
            }
        }
        let is_kept: Vec<bool> = (0..self.points.len()).map(|face| !self.is_flat(face)).collect();
        report.faces_degenerate += self.retain(&is_kept);
        Ok(())
    }

    /// Flips the longest side of each flat face once; how many flips there were.
    fn flip_flat(&mut self) -> u64 {
        let flat: Vec<usize> = (0..self.points.len()).filter(|&face| self.is_flat(face)).collect();
        if flat.is_empty() {
            return 0;
        }
        let edges = self.edges();
        let sides_of = |a: u32, b: u32| {
            let key = [a.min(b), a.max(b)];
            let start = edges.partition_point(|side| side.points < key);
            let length = edges[start..].iter().take_while(|side| side.points == key).count();
            &edges[start..start + length]
        };
        let mut is_touched = vec![false; self.points.len()];
        let mut added: BTreeSet<[u32; 2]> = BTreeSet::new();
        let mut flips = 0;
        for face in flat {
            let points = self.points[face];
            let length = |k: usize| self.position(points[k]).distance_squared(self.position(points[(k + 1) % 3]));
            let longest = (1..3).fold(0, |best, k| if length(k) > length(best) { k } else { best });
            let [a, b, c] = [0, 1, 2].map(|k| points[(longest + k) % 3]);
            let [va, vb, vc] = [0, 1, 2].map(|k| self.vertices[face][(longest + k) % 3]);
            let &[first, second] = sides_of(a, b) else { continue };
            let other = if first.face as usize == face { second.face } else { first.face } as usize;
            let Some(far) = self.points[other].iter().position(|&point| point != a && point != b) else { continue };
            let (d, vd) = (self.points[other][far], self.vertices[other][far]);
            let new_edge = [c.min(d), c.max(d)];
            let is_seam = [va, vb].iter().any(|vertex| !self.vertices[other].contains(vertex));
            let is_taken = c == d || !sides_of(c, d).is_empty() || added.contains(&new_edge);
            if is_seam || is_taken || is_touched[face] || is_touched[other] {
                continue;
            }
            (self.points[face], self.points[other]) = ([a, d, c], [d, b, c]);
            (self.vertices[face], self.vertices[other]) = ([va, vd, vc], [vd, vb, vc]);
            (is_touched[face], is_touched[other]) = (true, true);
            added.insert(new_edge);
            flips += 1;
        }
        flips
    }

    fn drop_duplicates(&mut self, report: &mut CleanReport) {
        let mut keys: Vec<([u32; 3], u32)> = self.points.iter().copied().zip(0..).collect();
        keys.iter_mut().for_each(|(points, _)| points.sort_unstable());
        keys.sort_unstable();
        let mut is_kept = vec![true; keys.len()];
        for pair in keys.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            is_kept[pair[1].1 as usize] = false;
        }
        report.faces_duplicate = self.retain(&is_kept);
    }

    /// Keeps the piece (faces connected over edges) with the largest area, the first one where two are equal.
    fn keep_largest_component(&mut self, report: &mut CleanReport) {
        let mut pieces = UnionFind::new(self.points.len());
        for sides in by_edge(&self.edges()) {
            sides.windows(2).for_each(|pair| pieces.join(pair[0].face, pair[1].face));
        }
        let mut areas = vec![0.0; self.points.len()];
        let roots: Vec<u32> = (0..self.points.len() as u32).map(|face| pieces.root(face)).collect();
        for (face, &root) in roots.iter().enumerate() {
            areas[root as usize] += self.cross(face).length();
        }
        // A root is the first face of its piece.
        let best = (0..areas.len()).fold(0, |best, root| if areas[root] > areas[best] { root } else { best });
        report.components = (0..).zip(&roots).filter(|&(face, &root)| face == root).count() as u64;
        let is_kept: Vec<bool> = roots.iter().map(|&root| root as usize == best).collect();
        report.faces_in_other_components = self.retain(&is_kept);
    }

    /// Number of border edges; an error where an edge has more than two faces or a border must not be.
    fn check_edges(&self, edges: &[Side], topology: Topology) -> Result<u64, MeshFault> {
        let ends = |side: &Side| side.points.map(|point| self.positions[point as usize]);
        let crowded = || by_edge(edges).filter(|sides| sides.len() > 2);
        if let Some(first) = crowded().next() {
            let [from, to] = ends(&first[0]);
            let (edges, faces_there) = (crowded().count() as u64, first.len() as u64);
            return Err(MeshFault::NotManifoldEdge { edges, faces_there, from, to });
        }
        let border = || by_edge(edges).filter(|sides| sides.len() == 1);
        let border_edges = border().count() as u64;
        match border().next() {
            Some(first) if topology == Topology::Closed => {
                let [from, to] = ends(&first[0]);
                Err(MeshFault::NotClosed { border_edges, from, to })
            }
            _ => Ok(border_edges),
        }
    }

    /// Turns all faces the same way, by flood fill over the edges.
    fn orient(&mut self, edges: &[Side], is_closed: bool, report: &mut CleanReport) -> Result<(), MeshFault> {
        // Across each side of a face: the other face, and whether both run through the edge in the same direction.
        let mut across: Vec<Vec<(u32, bool)>> = vec![Vec::with_capacity(3); self.points.len()];
        for sides in by_edge(edges) {
            if let [a, b] = sides {
                let disagree = a.is_forward == b.is_forward;
                across[a.face as usize].push((b.face, disagree));
                across[b.face as usize].push((a.face, disagree));
            }
        }
        let mut is_turned: Vec<Option<bool>> = vec![None; self.points.len()];
        let mut open = vec![0u32];
        is_turned[0] = Some(false);
        while let Some(face) = open.pop() {
            for &(other, disagree) in &across[face as usize] {
                if is_turned[other as usize].is_none() {
                    is_turned[other as usize] = is_turned[face as usize].map(|turned| turned != disagree);
                    open.push(other);
                }
            }
        }
        let mut is_turned: Vec<bool> = is_turned.into_iter().map(|turned| turned == Some(true)).collect();
        let is_wrong = |sides: &&[Side]| match sides {
            [a, b] => (a.is_forward == b.is_forward) != (is_turned[a.face as usize] != is_turned[b.face as usize]),
            _ => false,
        };
        if let Some(sides) = by_edge(edges).find(is_wrong) {
            let [from, to] = sides[0].points.map(|point| self.positions[point as usize]);
            return Err(MeshFault::NotOrientable { from, to });
        }

        let sign = |turned: bool| if turned { -1.0 } else { 1.0 };
        let balance: f64 = match is_closed {
            true => (0..).zip(&is_turned).map(|(face, &turned)| sign(turned) * self.volume(face)).sum(),
            false => (0..).zip(&is_turned).map(|(face, &turned)| sign(turned) * self.cross(face).length()).sum(),
        };
        if balance < 0.0 {
            is_turned.iter_mut().for_each(|turned| *turned = !*turned);
        }
        for face in (0..is_turned.len()).filter(|&face| is_turned[face]) {
            self.points[face].swap(1, 2);
            self.vertices[face].swap(1, 2);
            report.faces_turned += 1;
        }
        Ok(())
    }

    /// Volume between a face and a corner of the surface (the origin may be far off and cost digits).
    fn volume(&self, face: usize) -> f64 {
        let origin = self.position(self.points[0][0]);
        let [a, b, c] = self.points[face].map(|point| self.position(point) - origin);
        a.dot(b.cross(c)) / 6.0
    }

    /// The faces at a vertex must form one fan. Needs oriented faces.
    fn check_fans(&self) -> Result<(), MeshFault> {
        let mut fans = UnionFind::new(3 * self.points.len());
        let corner = |face: u32, point: u32| {
            let points = self.points[face as usize];
            3 * face
                + if points[0] == point {
                    0
                } else if points[1] == point {
                    1
                } else {
                    2
                }
        };
        for sides in by_edge(&self.edges()) {
            if let [a, b] = sides {
                a.points.iter().for_each(|&point| fans.join(corner(a.face, point), corner(b.face, point)));
            }
        }
        let mut fans_at: Vec<u32> = (0..3 * self.points.len() as u32)
            .filter(|&corner| fans.root(corner) == corner)
            .map(|corner| self.points[corner as usize / 3][corner as usize % 3])
            .collect();
        fans_at.sort_unstable();
        let shared = || fans_at.chunk_by(|a, b| a == b).filter(|fans| fans.len() > 1);
        match shared().next() {
            Some(first) => {
                let at = self.positions[first[0] as usize];
                Err(MeshFault::NotManifoldVertex { vertices: shared().count() as u64, at })
            }
            None => Ok(()),
        }
    }

    /// A closed, connected, manifold surface must have Euler number 2 and enclose something.
    fn check_sphere(&self, edges: &[Side], diagonal: f64) -> Result<(), MeshFault> {
        let mut points = self.points.as_flattened().to_vec();
        points.sort_unstable();
        points.dedup();
        let euler = points.len() as i64 - by_edge(edges).count() as i64 + self.points.len() as i64;
        if euler != 2 {
            return Err(MeshFault::Genus { genus: (2 - euler).unsigned_abs() / 2 });
        }
        let volume: f64 = (0..self.points.len()).map(|face| self.volume(face)).sum();
        if volume < MIN_VOLUME_SHARE * diagonal.powi(3) {
            let used = || points.iter().map(|&point| self.positions[point as usize]);
            let low = used().fold(Vec3::INFINITY, Vec3::min);
            let high = used().fold(Vec3::NEG_INFINITY, Vec3::max);
            return Err(MeshFault::Flat { extent: high - low });
        }
        Ok(())
    }

    /// The vertices in use, in their order, and the faces on them.
    fn compact(&self, point_of: &[u32], uvs: Option<&[Vec2]>) -> SurfaceMesh {
        let mut is_used = vec![false; self.positions.len()];
        self.vertices.iter().flatten().for_each(|&vertex| is_used[vertex as usize] = true);
        let mut new_index = vec![0; self.positions.len()];
        let mut mesh = SurfaceMesh { uvs: uvs.map(|_| Vec::new()), ..Default::default() };
        for vertex in (0..is_used.len()).filter(|&vertex| is_used[vertex]) {
            new_index[vertex] = mesh.positions_m.len() as u32;
            mesh.positions_m.push(self.positions[point_of[vertex] as usize]);
            if let (Some(kept), Some(uvs)) = (&mut mesh.uvs, uvs) {
                kept.push(uvs[vertex]);
            }
        }
        mesh.triangles = self.vertices.iter().map(|face| face.map(|vertex| new_index[vertex as usize])).collect();
        mesh
    }
}

/// Sets of indices; the smallest member of a set stands for it.
struct UnionFind(Vec<u32>);

impl UnionFind {
    fn new(length: usize) -> Self {
        Self((0..length as u32).collect())
    }

    fn root(&mut self, mut index: u32) -> u32 {
        while self.0[index as usize] != index {
            // Halving the path keeps the next search short.
            self.0[index as usize] = self.0[self.0[index as usize] as usize];
            index = self.0[index as usize];
        }
        index
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}
