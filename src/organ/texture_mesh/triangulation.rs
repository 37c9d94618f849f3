//! A triangulated sphere that can be changed: vertices are inserted, edges flipped, split and collapsed.

use super::super::{
    mesh,
    sphere::{SphereMesh, SurfacePoint},
};
use glam::DVec3;

/// How far from degenerate every triangle is kept, as its determinant over the square of its longest chord. An
/// equilateral triangle has 0.87.
const LEAST_FATNESS: f64 = 0.004;

/// The texture triangulation while it is being built: always a valid triangulation of the sphere.
#[derive(Clone, Debug)]
pub(super) struct Triangulation {
    pub points: Vec<SurfacePoint>,
    pub directions: Vec<DVec3>,
    /// Edge length wanted at each vertex, metres.
    pub wanted_m: Vec<f64>,
    pub triangles: Vec<[u32; 3]>,
    pub neighbours: Vec<[u32; 3]>,
    /// Some triangle at each vertex.
    pub triangle_at: Vec<u32>,
}

/// Determinant over the square of the longest chord; scale-free, positive where the triangle is not flipped.
fn fatness(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    // The determinant through differences: three nearly equal directions would cancel otherwise.
    a.dot((b - a).cross(c - a)) / longest.max(f64::MIN_POSITIVE)
}

impl Triangulation {
    /// Starts from the six vertices of an octahedron, in the order +x, +y, -x, -y, +z, -z.
    pub fn octahedron(points: [SurfacePoint; 6], directions: [DVec3; 6], wanted_m: f64) -> Self {
        let triangles = (0..4u32).flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]]).collect();
        let mut octahedron = Self {
            points: points.to_vec(),
            directions: directions.to_vec(),
            wanted_m: vec![wanted_m; 6],
            triangles,
            neighbours: Vec::new(),
            triangle_at: Vec::new(),
        };
        octahedron.relink();
        octahedron
    }

    /// Finds neighbours and triangles at vertices anew.
    fn relink(&mut self) {
        self.neighbours = mesh::neighbours(&self.triangles);
        self.triangle_at = vec![0; self.directions.len()];
        for (face, triangle) in self.triangles.iter().enumerate() {
            for &vertex in triangle {
                self.triangle_at[vertex as usize] = face as u32;
            }
        }
    }

    /// The triangulation as it is now.
    pub fn sphere(&self) -> SphereMesh {
        SphereMesh {
            directions: self.directions.clone(),
            triangles: self.triangles.clone(),
            neighbours: self.neighbours.clone(),
        }
    }

    /// Finds the vertices' places again after the chart has changed under their directions.
    pub fn relocate(&mut self, chart: &SphereMesh) {
        for (point, &direction) in self.points.iter_mut().zip(&self.directions) {
            *point = chart.locate(point.face, direction);
        }
    }

    fn is_left_of(&self, a: u32, b: u32, direction: DVec3) -> bool {
        self.directions[a as usize].cross(self.directions[b as usize]).dot(direction) >= 0.0
    }

    /// Triangle that a direction lies in, walking from a start; `None` if the walk does not settle.
    pub fn locate(&self, start: u32, direction: DVec3) -> Option<u32> {
        let mut face = start;
        for turn in 0..2 * self.triangles.len() + 8 {
            let triangle = self.triangles[face as usize];
            match (0..3)
                .map(|k| (k + turn) % 3)
                .find(|&k| !self.is_left_of(triangle[k], triangle[(k + 1) % 3], direction))
            {
                None => return Some(face),
                Some(side) => face = self.neighbours[face as usize][side],
            }
        }
        None
    }

    /// Whether the triangle of three vertices is far enough from degenerate.
    pub fn is_fat(&self, [a, b, c]: [u32; 3]) -> bool {
        fatness(self.directions[a as usize], self.directions[b as usize], self.directions[c as usize]) > LEAST_FATNESS
    }

    /// Triangles around a vertex with the vertex's corner in each, counter-clockwise, into a reused buffer.
    pub fn ring(&self, vertex: u32, ring: &mut Vec<(u32, usize)>) {
        ring.clear();
        let first = self.triangle_at[vertex as usize];
        let mut face = first;
        for _ in 0..self.triangles.len() {
            let corner = self.corner_of(face, vertex);
            ring.push((face, corner));
            face = self.neighbours[face as usize][(corner + 2) % 3];
            if face == first {
                break;
            }
        }
    }

    /// Number of edges at a vertex.
    pub fn valence(&self, vertex: u32, ring: &mut Vec<(u32, usize)>) -> usize {
        self.ring(vertex, ring);
        ring.len()
    }

    fn corner_of(&self, face: u32, vertex: u32) -> usize {
        self.triangles[face as usize].iter().position(|&v| v == vertex).unwrap_or(0)
    }

    fn replace_neighbour(&mut self, face: u32, old: u32, new: u32) {
        for neighbour in &mut self.neighbours[face as usize] {
            if *neighbour == old {
                *neighbour = new;
            }
        }
    }

    /// The vertex across an edge of a face.
    pub fn opposite(&self, face: u32, side: usize) -> u32 {
        let other = self.neighbours[face as usize][side];
        let b = self.triangles[face as usize][(side + 1) % 3];
        self.triangles[other as usize][(self.corner_of(other, b) + 2) % 3]
    }

    /// The two triangles that flipping an edge would make, or `None` where one would be flipped or too thin.
    pub fn flipped(&self, face: u32, side: usize) -> Option<[[u32; 3]; 2]> {
        let triangle = self.triangles[face as usize];
        let (a, b, c) = (triangle[side], triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
        let d = self.opposite(face, side);
        let pair = [[c, a, d], [d, b, c]];
        (c != d && pair.iter().all(|&t| self.is_fat(t))).then_some(pair)
    }

    /// Flips the edge on a side of a face; [`Triangulation::flipped`] says whether that is sound. Afterwards the face
    /// is `[c, a, d]` and its former neighbour `[d, b, c]`, the new edge between them being `c`-`d`.
    pub fn flip(&mut self, face: u32, side: usize) {
        let other = self.neighbours[face as usize][side];
        let triangle = self.triangles[face as usize];
        let (a, b, c) = (triangle[side], triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
        let other_side = self.corner_of(other, b);
        let d = self.triangles[other as usize][(other_side + 2) % 3];
        let beyond_bc = self.neighbours[face as usize][(side + 1) % 3];
        let beyond_ca = self.neighbours[face as usize][(side + 2) % 3];
        let beyond_ad = self.neighbours[other as usize][(other_side + 1) % 3];
        let beyond_db = self.neighbours[other as usize][(other_side + 2) % 3];
        self.triangles[face as usize] = [c, a, d];
        self.neighbours[face as usize] = [beyond_ca, beyond_ad, other];
        self.triangles[other as usize] = [d, b, c];
        self.neighbours[other as usize] = [beyond_db, beyond_bc, face];
        self.replace_neighbour(beyond_ad, other, face);
        self.replace_neighbour(beyond_bc, face, other);
        for (vertex, at) in [(a, face), (d, face), (c, face), (b, other)] {
            self.triangle_at[vertex as usize] = at;
        }
    }

    /// Inserts a vertex inside a face and restores the Delaunay property of the directions (Lawson's flips).
    /// Returns `false`, changing nothing, where a new triangle would be too thin.
    pub fn insert(&mut self, face: u32, point: SurfacePoint, direction: DVec3) -> bool {
        let vertex = self.directions.len() as u32;
        let first_new = self.triangles.len() as u32;
        let inserted = self.insert_into(face, point, direction);
        if inserted {
            self.legalise(vertex, vec![face, first_new, first_new + 1]);
        }
        inserted
    }

    /// Inserts a vertex inside a face, connected to the face's corners only. Returns `false`, changing nothing, where
    /// the direction is not inside or a new triangle would be too thin.
    pub fn insert_into(&mut self, face: u32, point: SurfacePoint, direction: DVec3) -> bool {
        let [a, b, c] = self.triangles[face as usize];
        let corners = [a, b, c].map(|v| self.directions[v as usize]);
        if (0..3).any(|k| fatness(corners[k], corners[(k + 1) % 3], direction) <= LEAST_FATNESS) {
            return false;
        }
        let vertex = self.directions.len() as u32;
        self.points.push(point);
        self.directions.push(direction);
        self.wanted_m.push([a, b, c].map(|v| self.wanted_m[v as usize]).iter().sum::<f64>() / 3.0);
        let [beyond_ab, beyond_bc, beyond_ca] = self.neighbours[face as usize];
        let second = self.triangles.len() as u32;
        let third = second + 1;
        self.triangles[face as usize] = [a, b, vertex];
        self.neighbours[face as usize] = [beyond_ab, second, third];
        self.triangles.push([b, c, vertex]);
        self.neighbours.push([beyond_bc, third, face]);
        self.triangles.push([c, a, vertex]);
        self.neighbours.push([beyond_ca, face, second]);
        self.replace_neighbour(beyond_bc, face, second);
        self.replace_neighbour(beyond_ca, face, third);
        self.triangle_at.push(face);
        for (v, at) in [(a, face), (b, face), (c, second)] {
            self.triangle_at[v as usize] = at;
        }
        true
    }

    /// Flips the edges opposite a new vertex until the directions around it are Delaunay.
    fn legalise(&mut self, vertex: u32, mut open: Vec<u32>) {
        while let Some(face) = open.pop() {
            let corner = self.corner_of(face, vertex);
            let side = (corner + 1) % 3;
            let [a, b, c] = self.triangles[face as usize].map(|v| self.directions[v as usize]);
            let d = self.directions[self.opposite(face, side) as usize];
            // On the sphere a vertex is in another three's circle where it lies above their plane.
            if (b - a).cross(c - a).dot(d - a) > 1e-12 && self.flipped(face, side).is_some() {
                let other = self.neighbours[face as usize][side];
                self.flip(face, side);
                open.push(face);
                open.push(other);
            }
        }
    }

    /// Puts a vertex on the edge on a side of a face. Returns `false`, changing nothing, where a new triangle would
    /// be too thin.
    pub fn split(&mut self, face: u32, side: usize, point: SurfacePoint, direction: DVec3) -> bool {
        let triangle = self.triangles[face as usize];
        let (a, b, c) = (triangle[side], triangle[(side + 1) % 3], triangle[(side + 2) % 3]);
        let other = self.neighbours[face as usize][side];
        let other_side = self.corner_of(other, b);
        let d = self.triangles[other as usize][(other_side + 2) % 3];
        let at = |v: u32| self.directions[v as usize];
        if [(b, c), (c, a), (a, d), (d, b)].iter().any(|&(p, q)| fatness(at(p), at(q), direction) <= LEAST_FATNESS) {
            return false;
        }
        let vertex = self.directions.len() as u32;
        self.points.push(point);
        self.directions.push(direction);
        self.wanted_m.push(0.5 * (self.wanted_m[a as usize] + self.wanted_m[b as usize]));
        let beyond_bc = self.neighbours[face as usize][(side + 1) % 3];
        let beyond_ca = self.neighbours[face as usize][(side + 2) % 3];
        let beyond_ad = self.neighbours[other as usize][(other_side + 1) % 3];
        let beyond_db = self.neighbours[other as usize][(other_side + 2) % 3];
        let at_c = self.triangles.len() as u32;
        let at_d = at_c + 1;
        self.triangles[face as usize] = [vertex, c, a];
        self.neighbours[face as usize] = [at_c, beyond_ca, other];
        self.triangles.push([vertex, b, c]);
        self.neighbours.push([at_d, beyond_bc, face]);
        self.triangles[other as usize] = [vertex, a, d];
        self.neighbours[other as usize] = [face, beyond_ad, at_d];
        self.triangles.push([vertex, d, b]);
        self.neighbours.push([other, beyond_db, at_c]);
        self.replace_neighbour(beyond_bc, face, at_c);
        self.replace_neighbour(beyond_db, other, at_d);
        self.triangle_at.push(face);
        for (v, near) in [(a, face), (b, at_c), (c, face), (d, other)] {
            self.triangle_at[v as usize] = near;
        }
        true
    }

    /// Whether the edge from `kept` to `gone` can be collapsed onto `kept`: the surface stays a sphere, no triangle
    /// becomes thin, and nobody ends with fewer than four edges.
    pub fn can_collapse(&self, kept: u32, gone: u32, ring: &mut Vec<(u32, usize)>) -> bool {
        self.ring(kept, ring);
        let around_kept: Vec<u32> = ring.iter().map(|&(f, k)| self.triangles[f as usize][(k + 1) % 3]).collect();
        self.ring(gone, ring);
        let around_gone: Vec<u32> = ring.iter().map(|&(f, k)| self.triangles[f as usize][(k + 1) % 3]).collect();
        let remaining_fat = ring.iter().all(|&(face, corner)| {
            let mut triangle = self.triangles[face as usize];
            triangle.contains(&kept) || {
                triangle[corner] = kept;
                self.is_fat(triangle)
            }
        });
        let shared: Vec<u32> = around_gone.iter().copied().filter(|v| around_kept.contains(v)).collect();
        remaining_fat && shared.len() == 2 && shared.iter().all(|&v| self.valence(v, ring) > 4)
    }

    /// Collapses edges given as (kept, gone) pairs; each must satisfy [`Triangulation::can_collapse`] and no two
    /// may share a vertex or a neighbour.
    pub fn collapse(&mut self, pairs: &[(u32, u32)]) {
        let mut target: Vec<u32> = (0..self.directions.len() as u32).collect();
        for &(kept, gone) in pairs {
            target[gone as usize] = kept;
        }
        let mut renamed = vec![u32::MAX; target.len()];
        let mut count = 0;
        for vertex in 0..target.len() {
            if target[vertex] == vertex as u32 {
                renamed[vertex] = count;
                self.points[count as usize] = self.points[vertex];
                self.directions[count as usize] = self.directions[vertex];
                self.wanted_m[count as usize] = self.wanted_m[vertex];
                count += 1;
            }
        }
        self.points.truncate(count as usize);
        self.directions.truncate(count as usize);
        self.wanted_m.truncate(count as usize);
        for triangle in &mut self.triangles {
            *triangle = triangle.map(|v| renamed[target[v as usize] as usize]);
        }
        self.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
        self.relink();
    }

    /// Moves a vertex unless a triangle around it would become thin; says whether it moved.
    pub fn try_move(&mut self, vertex: u32, point: SurfacePoint, direction: DVec3, ring: &[(u32, usize)]) -> bool {
        let old = self.directions[vertex as usize];
        self.directions[vertex as usize] = direction;
        let fine = ring.iter().all(|&(face, _)| self.is_fat(self.triangles[face as usize]));
        if fine {
            self.points[vertex as usize] = point;
        } else {
            self.directions[vertex as usize] = old;
        }
        fine
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    fn random_triangulation(vertices: usize) -> Triangulation {
        let axes = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut random = Pcg32::seed_from_u64(7);
        let mut triangulation = Triangulation::octahedron([SurfacePoint::default(); 6], axes, 1.0);
        while triangulation.directions.len() < vertices {
            let direction = DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0))).normalize();
            let face = triangulation.locate(0, direction).expect("the sphere is covered");
            triangulation.insert(face, SurfacePoint::default(), direction);
        }
        triangulation
    }

    fn assert_valid(triangulation: &Triangulation) {
        let sphere = triangulation.sphere();
        assert!(sphere.is_positive());
        assert_eq!(sphere.neighbours, mesh::neighbours(&sphere.triangles));
        for (vertex, &face) in triangulation.triangle_at.iter().enumerate() {
            assert!(sphere.triangles[face as usize].contains(&(vertex as u32)));
        }
        assert_eq!(triangulation.triangles.len() + 4, 2 * triangulation.directions.len());
    }

    #[test]
    fn inserted_vertices_are_delaunay_on_the_sphere() {
        let triangulation = random_triangulation(60);
        assert_valid(&triangulation);
        for face in 0..triangulation.triangles.len() as u32 {
            let [a, b, c] = triangulation.triangles[face as usize].map(|v| triangulation.directions[v as usize]);
            for &d in &triangulation.directions {
                assert!((b - a).cross(c - a).dot(d - a) < 1e-9, "a vertex is in another three's circle");
            }
        }
    }

    #[test]
    fn splits_flips_and_collapses_keep_a_valid_sphere() {
        let mut triangulation = random_triangulation(60);
        let mut ring = Vec::new();
        let mut done = [0; 3];
        for face in (0..60).step_by(7) {
            let [a, b, _] = triangulation.triangles[face].map(|v| triangulation.directions[v as usize]);
            done[0] += usize::from(triangulation.split(face as u32, 0, SurfacePoint::default(), (a + b).normalize()));
            assert_valid(&triangulation);
            if triangulation.flipped(face as u32, 1).is_some() {
                triangulation.flip(face as u32, 1);
                done[1] += 1;
                assert_valid(&triangulation);
            }
        }
        for _ in 0..20 {
            let edge = triangulation.triangles.iter().map(|t| (t[0], t[1])).collect::<Vec<_>>();
            let found = edge.into_iter().find(|&(kept, gone)| triangulation.can_collapse(kept, gone, &mut ring));
            if let Some(pair) = found {
                triangulation.collapse(&[pair]);
                done[2] += 1;
                assert_valid(&triangulation);
            }
        }
        assert!(done.iter().all(|&count| count > 3), "{done:?}");
    }
}
