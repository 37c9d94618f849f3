//! Spheres and ellipsoids: phantoms to test against, and the walls of cavities.

use super::mesh::SurfaceMesh;
use glam::{DVec3, Vec3};

/// Finest subdivision: some 41,000 vertices.
const MOST_SUBDIVISIONS: u32 = 64;

/// An ellipsoid about the origin with evenly spread vertices: an icosahedron whose edges are split into `subdivisions`
/// (1 to 64), stretched to the semi-axes in metres. Their signs do not count.
pub fn procedural_ellipsoid(semi_axes_m: Vec3, subdivisions: u32) -> SurfaceMesh {
    let (positions, triangles) = icosphere(subdivisions.clamp(1, MOST_SUBDIVISIONS) as usize);
    // A negative axis would turn the surface inside out.
    let positions_m = positions.iter().map(|place| place.as_vec3() * semi_axes_m.abs()).collect();
    SurfaceMesh { positions_m, triangles, uvs: None }
}

/// The unit sphere as an icosahedron whose edges are split into `n`.
pub(super) fn icosphere(n: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5f64.sqrt()) / 2.0;
    let corners: Vec<DVec3> = (0..3)
        .flat_map(|axis| {
            [(-1.0, -golden), (1.0, -golden), (-1.0, golden), (1.0, golden)].map(|(one, long)| (axis, one, long))
        })
        .map(|(axis, one, long)| {
            let mut corner = [0.0; 3];
            (corner[axis], corner[(axis + 1) % 3]) = (one, long);
            DVec3::from_array(corner)
        })
        .collect();
    let mut positions: Vec<DVec3> = Vec::new();
    let mut triangles = Vec::new();
    let is_near = |a: usize, b: usize| corners[a].distance_squared(corners[b]) < 4.5;
    // Neighbouring corners of the icosahedron are 2 apart, all others 3.2 or more.
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if !(is_near(a, b) && is_near(b, c) && is_near(c, a)) {
                    continue;
                }
                let (a, mut b, mut c) = (corners[a], corners[b], corners[c]);
                if a.dot(b.cross(c)) < 0.0 {
                    (b, c) = (c, b);
                }
                let mut index = |row: usize, column: usize| {
                    let place = (a * (n - row) as f64 + b * (row - column) as f64 + c * column as f64).normalize();
                    // Only the icosahedron's edges are shared, so looking through all is quick enough.
                    positions.iter().position(|other| other.distance_squared(place) < 1e-12).unwrap_or_else(|| {
                        positions.push(place);
                        positions.len() - 1
                    }) as u32
                };
                for row in 0..n {
                    for column in 0..=row {
                        let (top, left, right) =
                            (index(row, column), index(row + 1, column), index(row + 1, column + 1));
                        triangles.push([top, left, right]);
                        if column < row {
                            triangles.push([top, right, index(row, column + 1)]);
                        }
                    }
                }
            }
        }
    }
    (positions, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_closed_and_has_the_volume_of_an_ellipsoid() {
        let axes_m = Vec3::new(0.1, 0.2, 0.3);
        let mesh = procedural_ellipsoid(axes_m, 12);
        assert_eq!(mesh.positions_m.len(), 10 * 12 * 12 + 2);
        assert!(mesh.neighbours().iter().flatten().all(|face| *face != super::super::mesh::NO_FACE));
        let wanted = 4.0 / 3.0 * std::f64::consts::PI * 0.1 * 0.2 * 0.3;
        assert!((mesh.volume_m3() / wanted - 1.0).abs() < 0.02, "{}", mesh.volume_m3());
    }

    #[test]
    fn a_negative_axis_does_not_turn_it_inside_out() {
        let axes_m = Vec3::new(0.1, 0.2, 0.3);
        assert_eq!(procedural_ellipsoid(axes_m * Vec3::new(-1.0, 1.0, 1.0), 3), procedural_ellipsoid(axes_m, 3));
    }

    #[test]
    fn any_number_of_subdivisions_gives_a_mesh() {
        assert_eq!(procedural_ellipsoid(Vec3::ONE, 0).triangles.len(), 20);
        assert_eq!(procedural_ellipsoid(Vec3::ONE, 1).triangles.len(), 20);
    }
}
