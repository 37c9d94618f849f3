//! Central projection: the organ seen from one point inside it, where all of it can be seen from one.

use crate::organ::mesh::SurfaceMesh;
use crate::organ::sphere::SphereMesh;
use glam::{DMat4, DVec3, DVec4};

/// Times that the barrier is weakened at most.
const PATH_STEPS: usize = 20;
/// Newton steps at most for each barrier.
const NEWTON_STEPS: usize = 12;

/// The point inside all face planes that is farthest from the nearest of them, in metres; `None` where the organ is
/// not star-shaped.
///
/// A small linear program, solved by Newton steps along the central path (logarithmic barrier). The number of faces
/// over the path's parameter bounds what is still to be gained, so organs that are not star-shaped are found early.
pub(super) fn star_centre(mesh: &SurfaceMesh) -> Option<DVec3> {
    let (low, high) = mesh.bounds_m();
    let (low, high) = (low.as_dvec3(), high.as_dvec3());
    let (middle, size) = (0.5 * (low + high), (high - low).max_element());
    // Half-spaces `normal . x <= offset` with the box about one wide, so that steps and tolerances have no unit.
    let planes: Vec<(DVec3, f64)> = (0..mesh.triangles.len() as u32)
        .filter_map(|face| {
            let [a, b, c] = mesh.corners(face).map(|corner| (corner - middle) / size);
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((normal, normal.dot(a)))
        })
        .collect();
    let count = planes.len() as f64;
    let slack = |x: DVec4, &(normal, offset): &(DVec3, f64)| offset - normal.dot(x.truncate()) - x.w;
    let barrier = |x: DVec4, weight: f64| {
        planes.iter().try_fold(-weight * x.w, |sum, plane| {
            let slack = slack(x, plane);
            (slack > 0.0).then(|| sum - slack.ln())
        })
    };
    let nearest = planes.iter().map(|&(_, offset)| offset).fold(f64::INFINITY, f64::min);
    let mut x = DVec4::new(0.0, 0.0, 0.0, nearest - 1.0);
    let mut weight = count;
    for _ in 0..PATH_STEPS {
        for _ in 0..NEWTON_STEPS {
            let mut gradient = DVec4::new(0.0, 0.0, 0.0, -weight);
            let mut hessian = DMat4::ZERO;
            for plane in &planes {
                let row = plane.0.extend(1.0) / slack(x, plane);
                gradient += row;
                hessian += DMat4::from_cols(row * row.x, row * row.y, row * row.z, row * row.w);
            }
            let step = -(hessian.inverse() * gradient);
            let decrement = -gradient.dot(step);
            if decrement.is_nan() || decrement <= 1e-6 {
                break;
            }
            let here = barrier(x, weight)?;
            let mut share = 1.0;
            while share > 1e-9
                && barrier(x + share * step, weight).is_none_or(|there| there > here - 0.1 * share * decrement)
            {
                share *= 0.5;
            }
            x += share * step;
        }
        if x.w + count / weight <= 0.0 {
            return None;
        }
        if count / weight < 1e-4 * x.w.abs() {
            break;
        }
        weight *= 6.0;
    }
    (x.w > 0.0).then(|| middle + size * x.truncate())
}

/// Directions of all vertices as seen from a point; `None` where that is not a chart.
pub(super) fn project(mesh: &SurfaceMesh, centre_m: DVec3) -> Option<SphereMesh> {
    let directions: Option<Vec<DVec3>> =
        mesh.positions_m.iter().map(|position| (position.as_dvec3() - centre_m).try_normalize()).collect();
    let chart = SphereMesh::new(directions?, mesh.triangles.clone());
    chart.is_positive().then_some(chart)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn pyramid(apex: Vec3) -> SurfaceMesh {
        let base = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let mut positions_m: Vec<Vec3> = base.iter().map(|&(x, y)| Vec3::new(x, y, 0.0)).collect();
        positions_m.push(apex);
        let triangles = vec![[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        SurfaceMesh { positions_m, triangles, uvs: None }
    }

    #[test]
    fn centre_of_a_pyramid_is_that_of_its_inscribed_sphere() {
        // Side planes rise 60 degrees from a base of width two: the sphere's radius is tan 30.
        let centre = star_centre(&pyramid(Vec3::new(0.0, 0.0, 3f32.sqrt()))).unwrap();
        let expected = DVec3::new(0.0, 0.0, 1.0 / 3f64.sqrt());
        assert!((centre - expected).length() < 1e-3, "{centre}");
    }

    #[test]
    fn inside_out_surfaces_have_no_centre() {
        let mut mesh = pyramid(Vec3::Z);
        for triangle in &mut mesh.triangles {
            triangle.swap(0, 1);
        }
        assert_eq!(star_centre(&mesh), None);
        // The apex pushed down through the base: the sides see each other from behind.
        assert_eq!(star_centre(&pyramid(Vec3::NEG_Z)), None);
    }
}
