//! A sequence of vertex removals from the full surface down to a tetrahedron, and their undoing one by one.
//!
//! Half-edge collapses ordered by quadric error (Garland and Heckbert 1997), as in the progressive meshes of Hoppe
//! (1996). The coarse levels serve to lay out the sphere roughly before details are added, so each coarse face also
//! carries the area of the full surface that it stands for: a thin duct keeps its share of the sphere even where the
//! coarse surface has cut it off.

use glam::{DMat3, DVec3};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Beyond this many neighbours a vertex is a poor parent: the faces round it become slivers.
const VALENCE_LIMIT: usize = 10;
/// Least shape quality (1 = equilateral) that a collapse may leave without being put off.
const QUALITY_LIMIT: f64 = 0.1;

/// A surface that was thinned to a tetrahedron and remembers how to grow back.
pub(super) struct Progressive {
    /// Corner positions (any unit; all of them, also of vertices that are away).
    pub positions: Vec<DVec3>,
    /// Corners of each face at the present level; meaningless for faces that are away.
    pub triangles: Vec<[u32; 3]>,
    /// Faces round each vertex at the present level.
    pub incident: Vec<Vec<u32>>,
    /// Area of the full surface that each face stands for at the present level.
    pub areas: Vec<f64>,
    removals: Vec<Removal>,
}

/// One collapse of `vertex` into its neighbour `parent`.
struct Removal {
    vertex: u32,
    parent: u32,
    /// The two faces that vanished, each with its corner that is neither of the two.
    vanished: [(u32, u32); 2],
    /// Areas of the faces round the vertex before, in the order of its incidence list.
    areas: Vec<f64>,
}

/// What came back with [`Progressive::restore`].
#[derive(Clone, Copy)]
pub(super) struct Restored {
    pub vertex: u32,
    pub parent: u32,
}

/// Squared distance to a set of planes, as a quadratic form.
#[derive(Clone, Copy)]
struct Quadric {
    square: DMat3,
    linear: DVec3,
    constant: f64,
}

impl Quadric {
    const ZERO: Self = Self { square: DMat3::ZERO, linear: DVec3::ZERO, constant: 0.0 };

    fn plane(normal: DVec3, point: DVec3, weight: f64) -> Self {
        let offset = -normal.dot(point);
        Self {
            square: DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z) * weight,
            linear: normal * (offset * weight),
            constant: offset * offset * weight,
        }
    }

    fn add(&mut self, other: &Self) {
        self.square += other.square;
        self.linear += other.linear;
        self.constant += other.constant;
    }

    fn at(&self, point: DVec3) -> f64 {
        (point.dot(self.square * point) + 2.0 * self.linear.dot(point) + self.constant).max(0.0)
    }
}

/// A collapse that waits for its turn; the cheapest comes first, ties go to the lower indices.
struct Candidate {
    cost: f64,
    vertex: u32,
    parent: u32,
    version: u32,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.vertex.cmp(&self.vertex)).then(other.parent.cmp(&self.parent))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl Progressive {
    /// Thins a closed genus-0 manifold surface. Whatever its shape, four vertices remain: every triangulated sphere
    /// with more has an edge that may be contracted.
    pub fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let mut incident = vec![Vec::new(); positions.len()];
        for (face, triangle) in triangles.iter().enumerate() {
            for &vertex in triangle {
                incident[vertex as usize].push(face as u32);
            }
        }
        let areas = triangles.iter().map(|&triangle| 0.5 * doubled_area(&positions, triangle).length()).collect();
        let mut surface = Self { positions, triangles, incident, areas, removals: Vec::new() };
        surface.thin();
        surface
    }

    /// The vertices that are left at the present level.
    pub fn remaining(&self) -> Vec<u32> {
        let mut present = vec![true; self.positions.len()];
        for removal in &self.removals {
            present[removal.vertex as usize] = false;
        }
        (0..self.positions.len() as u32).filter(|&vertex| present[vertex as usize]).collect()
    }

    /// Number of removals that are not undone yet.
    pub fn removed_count(&self) -> usize {
        self.removals.len()
    }

    fn thin(&mut self) {
        let count = self.positions.len();
        let mut quadrics = vec![Quadric::ZERO; count];
        for &triangle in &self.triangles {
            let normal = doubled_area(&self.positions, triangle);
            let plane =
                Quadric::plane(normal.normalize_or_zero(), self.positions[triangle[0] as usize], normal.length() / 6.0);
            for vertex in triangle {
                quadrics[vertex as usize].add(&plane);
            }
        }
        let mut alive = vec![true; count];
        let mut versions = vec![0u32; count];
        let mut heap = BinaryHeap::with_capacity(2 * count);
        let mut left = count;
        while left > 4 {
            // Filled anew when it ran dry: a collapse that the links forbade may be allowed by now.
            if heap.is_empty() {
                heap.extend((0..count as u32).filter(|&vertex| alive[vertex as usize]).filter_map(|vertex| {
                    let (cost, parent) = self.best_parent(vertex, &quadrics)?;
                    Some(Candidate { cost, vertex, parent, version: versions[vertex as usize] })
                }));
            }
            let Some(candidate) = heap.pop() else { break };
            let (vertex, parent) = (candidate.vertex, candidate.parent);
            if !alive[vertex as usize] || candidate.version != versions[vertex as usize] {
                continue;
            }
            if !alive[parent as usize] || !self.may_collapse(vertex, parent) {
                versions[vertex as usize] += 1;
                if let Some((cost, parent)) = self.best_parent(vertex, &quadrics) {
                    heap.push(Candidate { cost, vertex, parent, version: versions[vertex as usize] });
                }
                continue;
            }
            let quadric = quadrics[vertex as usize];
            quadrics[parent as usize].add(&quadric);
            self.collapse(vertex, parent);
            alive[vertex as usize] = false;
            left -= 1;
            let mut touched = self.ring(parent);
            touched.push(parent);
            for vertex in touched {
                versions[vertex as usize] += 1;
                if let Some((cost, parent)) = self.best_parent(vertex, &quadrics) {
                    heap.push(Candidate { cost, vertex, parent, version: versions[vertex as usize] });
                }
            }
        }
    }

    /// Neighbours of a vertex at the present level, in the order of its faces.
    pub fn ring(&self, vertex: u32) -> Vec<u32> {
        self.incident[vertex as usize].iter().map(|&face| next_corner(self.triangles[face as usize], vertex)).collect()
    }

    /// The surface stays a triangulated sphere if the two ends share exactly two neighbours.
    fn may_collapse(&self, vertex: u32, parent: u32) -> bool {
        let around_parent = self.ring(parent);
        let shared = self.ring(vertex).into_iter().filter(|other| around_parent.contains(other)).count();
        shared == 2 && around_parent.contains(&vertex)
    }

    fn best_parent(&self, vertex: u32, quadrics: &[Quadric]) -> Option<(f64, u32)> {
        let ring = self.ring(vertex);
        let mut best: Option<(f64, u32)> = None;
        for &parent in &ring {
            if let Some(cost) = self.cost(vertex, parent, &ring, quadrics)
                && best.is_none_or(|least| (cost, parent) < least)
            {
                best = Some((cost, parent));
            }
        }
        best
    }

    fn cost(&self, vertex: u32, parent: u32, ring: &[u32], quadrics: &[Quadric]) -> Option<f64> {
        let around_parent = &self.incident[parent as usize];
        let shared = ring
            .iter()
            .filter(|&&other| {
                around_parent.iter().any(|&face| next_corner(self.triangles[face as usize], parent) == other)
            })
            .count();
        if shared != 2 {
            return None;
        }
        let target = self.positions[parent as usize];
        let moved = target - self.positions[vertex as usize];
        // The length term orders collapses on flat parts, where every quadric is zero.
        let mut cost = quadrics[vertex as usize].at(target) + 1e-6 * moved.length_squared();
        let valence = ring.len() + around_parent.len() - 4;
        if valence > VALENCE_LIMIT {
            cost *= 4.0 + (valence - VALENCE_LIMIT) as f64;
        }
        for &face in &self.incident[vertex as usize] {
            let triangle = self.triangles[face as usize];
            if triangle.contains(&parent) {
                continue;
            }
            let after = triangle.map(|corner| if corner == vertex { parent } else { corner });
            let (old, new) = (doubled_area(&self.positions, triangle), doubled_area(&self.positions, after));
            let quality = quality(&self.positions, after, new.length());
            if quality < QUALITY_LIMIT {
                cost *= 1.0 + 10.0 * (1.0 - quality / QUALITY_LIMIT);
            }
            if old.dot(new) < 0.2 * old.length() * new.length() {
                cost = 20.0 * cost + 1e-3 * new.length();
            }
        }
        Some(cost)
    }

    fn collapse(&mut self, vertex: u32, parent: u32) {
        let faces = self.incident[vertex as usize].clone();
        let areas: Vec<f64> = faces.iter().map(|&face| self.areas[face as usize]).collect();
        let mut vanished = [(u32::MAX, u32::MAX); 2];
        let mut vanished_count = 0;
        let mut moved = Vec::with_capacity(faces.len());
        for &face in &faces {
            let triangle = self.triangles[face as usize];
            if triangle.contains(&parent) {
                let apex = third_corner(triangle, vertex, parent);
                self.incident[parent as usize].retain(|&other| other != face);
                self.incident[apex as usize].retain(|&other| other != face);
                vanished[vanished_count] = (face, apex);
                vanished_count += 1;
            } else {
                self.triangles[face as usize] = triangle.map(|corner| if corner == vertex { parent } else { corner });
                self.incident[parent as usize].push(face);
                moved.push(face);
            }
        }
        // What lay round the vertex is now covered by the faces that moved.
        let sizes: Vec<f64> =
            moved.iter().map(|&face| doubled_area(&self.positions, self.triangles[face as usize]).length()).collect();
        let (covered, size): (f64, f64) = (areas.iter().sum(), sizes.iter().sum());
        for (&face, face_size) in moved.iter().zip(&sizes) {
            let share = if size > 0.0 { face_size / size } else { 1.0 / moved.len() as f64 };
            // No face may stand for nothing, however thin it is.
            self.areas[face as usize] = covered * (0.98 * share + 0.02 / moved.len() as f64);
        }
        self.removals.push(Removal { vertex, parent, vanished, areas });
    }

    /// Undoes the last removal; `None` when the full surface is back.
    pub fn restore(&mut self) -> Option<Restored> {
        let Removal { vertex, parent, vanished, areas } = self.removals.pop()?;
        let faces = self.incident[vertex as usize].clone();
        for (&face, area) in faces.iter().zip(areas) {
            self.areas[face as usize] = area;
            if let Some(&(_, apex)) = vanished.iter().find(|(other, _)| *other == face) {
                self.incident[parent as usize].push(face);
                self.incident[apex as usize].push(face);
            } else {
                let triangle = self.triangles[face as usize];
                self.triangles[face as usize] = triangle.map(|corner| if corner == parent { vertex } else { corner });
                self.incident[parent as usize].retain(|&other| other != face);
            }
        }
        Some(Restored { vertex, parent })
    }
}

/// The corner after `vertex`, going round the face.
pub(super) fn next_corner(triangle: [u32; 3], vertex: u32) -> u32 {
    let corner = triangle.iter().position(|&other| other == vertex).unwrap_or(0);
    triangle[(corner + 1) % 3]
}

fn third_corner(triangle: [u32; 3], a: u32, b: u32) -> u32 {
    triangle.into_iter().find(|&corner| corner != a && corner != b).unwrap_or(a)
}

fn doubled_area(positions: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    (b - a).cross(c - a)
}

/// One for an equilateral triangle, zero for a degenerate one.
fn quality(positions: &[DVec3], triangle: [u32; 3], doubled_area: f64) -> f64 {
    let [a, b, c] = triangle.map(|vertex| positions[vertex as usize]);
    let edges = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    if edges > 0.0 { 2.0 * 3f64.sqrt() * doubled_area / edges } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An octahedron with every face cut into three from a raised middle: 14 vertices.
    fn spiky_octahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut positions = vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
        let octahedron = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
        let mut triangles = Vec::new();
        for [a, b, c] in octahedron {
            let top = positions.len() as u32;
            positions.push(0.4 * (positions[a as usize] + positions[b as usize] + positions[c as usize]));
            triangles.extend([[a, b, top], [b, c, top], [c, a, top]]);
        }
        (positions, triangles)
    }

    #[test]
    fn four_vertices_remain_and_all_comes_back() {
        let (positions, triangles) = spiky_octahedron();
        let mut surface = Progressive::new(positions.clone(), triangles.clone());
        assert_eq!(surface.remaining().len(), 4);
        let full: f64 = triangles.iter().map(|&t| 0.5 * doubled_area(&positions, t).length()).sum();
        let mut present = 4;
        loop {
            // At every level: a closed surface that stands for the whole area.
            let faces: Vec<u32> = {
                let mut faces: Vec<u32> =
                    surface.remaining().iter().flat_map(|&vertex| surface.incident[vertex as usize].clone()).collect();
                faces.sort_unstable();
                faces.dedup();
                faces
            };
            assert_eq!(faces.len(), 2 * present - 4);
            let area: f64 = faces.iter().map(|&face| surface.areas[face as usize]).sum();
            assert!((area - full).abs() < 1e-9 * full);
            for &face in &faces {
                for vertex in surface.triangles[face as usize] {
                    assert!(surface.incident[vertex as usize].contains(&face));
                }
            }
            let Some(restored) = surface.restore() else { break };
            assert!(surface.ring(restored.vertex).contains(&restored.parent));
            present += 1;
        }
        assert_eq!((present, surface.triangles), (positions.len(), triangles));
    }

    #[test]
    fn quadric_is_the_squared_distance() {
        let mut quadric = Quadric::plane(DVec3::Z, DVec3::new(3.0, 1.0, 2.0), 1.5);
        quadric.add(&Quadric::plane(DVec3::X, DVec3::ZERO, 1.0));
        assert!((quadric.at(DVec3::new(4.0, 9.0, 5.0)) - (1.5 * 9.0 + 16.0)).abs() < 1e-12);
    }
}
