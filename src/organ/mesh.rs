//! The organ as a closed triangle surface, in metres, and who is whose neighbour on it.

use bevy::reflect::Reflect;
use glam::{DVec3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// Marks "no face" in neighbour lists of open surfaces.
pub const NO_FACE: u32 = u32::MAX;

/// An indexed triangle surface in the organ's own space (right-handed, metres).
///
/// Loaders hand these out welded, consistently oriented (counter-clockwise seen from outside) and with every
/// vertex in use. [`SurfaceMesh::neighbours`] lists who lies across each edge.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SurfaceMesh {
    /// Vertex positions in the organ's space, metres.
    pub positions_m: Vec<Vec3>,
    /// Three vertex indices per face, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// The file's own texture coordinates, one per vertex, where it had a single consistent set.
    pub uvs: Option<Vec<Vec2>>,
}

impl SurfaceMesh {
    /// For each face, the face across the edges (0,1), (1,2) and (2,0); [`NO_FACE`] at a border.
    pub fn neighbours(&self) -> Vec<[u32; 3]> {
        neighbours(&self.triangles)
    }

    /// Corners of a face in metres.
    pub fn corners(&self, face: u32) -> [DVec3; 3] {
        self.triangles[face as usize].map(|vertex| self.positions_m[vertex as usize].as_dvec3())
    }

    /// Area of a face in square metres.
    pub fn face_area_m2(&self, face: u32) -> f64 {
        let [a, b, c] = self.corners(face);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Total area in square metres.
    pub fn area_m2(&self) -> f64 {
        (0..self.triangles.len() as u32).map(|face| self.face_area_m2(face)).sum()
    }

    /// Enclosed volume in cubic metres; positive where the faces look outward. Means nothing for open surfaces.
    pub fn volume_m3(&self) -> f64 {
        // About a place of the surface itself: the origin may be far off and cost digits.
        let apex = self.positions_m.first().copied().unwrap_or_default().as_dvec3();
        (0..self.triangles.len() as u32)
            .map(|face| {
                let [a, b, c] = self.corners(face).map(|corner| corner - apex);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    /// Smallest and largest corner of the axis-aligned box around all vertices, metres.
    pub fn bounds_m(&self) -> (Vec3, Vec3) {
        self.positions_m.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// Area-weighted vertex normals, unit length.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; self.positions_m.len()];
        vertex_normals_into(&self.positions_m, &self.triangles, &mut normals);
        normals
    }
}

/// Area-weighted unit vertex normals of moved vertices, into a buffer that is kept between steps.
pub fn vertex_normals_into(positions_m: &[Vec3], triangles: &[[u32; 3]], normals: &mut [Vec3]) {
    normals.fill(Vec3::ZERO);
    for &[a, b, c] in triangles {
        let (a, b, c) = (a as usize, b as usize, c as usize);
        let normal = (positions_m[b] - positions_m[a]).cross(positions_m[c] - positions_m[a]);
        normals[a] += normal;
        normals[b] += normal;
        normals[c] += normal;
    }
    for normal in normals {
        *normal = normal.normalize_or_zero();
    }
}

/// Face across each directed edge, by sorting the edges (no hashing: the result depends on nothing but the input).
pub(crate) fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut edges: Vec<(u32, u32, u32, u32)> = Vec::with_capacity(triangles.len() * 3);
    for (face, triangle) in triangles.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (triangle[side], triangle[(side + 1) % 3]);
            edges.push((a.min(b), a.max(b), face as u32, side as u32));
        }
    }
    edges.sort_unstable();
    let mut neighbours = vec![[NO_FACE; 3]; triangles.len()];
    for pair in edges.windows(2) {
        let ((a0, b0, face0, side0), (a1, b1, face1, side1)) = (pair[0], pair[1]);
        if (a0, b0) == (a1, b1) {
            neighbours[face0 as usize][side0 as usize] = face1;
            neighbours[face1 as usize][side1 as usize] = face0;
        }
    }
    neighbours
}
