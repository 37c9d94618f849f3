//! How much a flat triangle is stretched against its place in the tile: an energy to go down.
//!
//! The shape part is the square of `(s1/s2 + s2/s1) / 2` of the singular values (Hormann and Greiner 2000, "MIPS";
//! squared, so that the worst places count most); the area part is `s1 s2 + 1 / (s1 s2)`. Both grow without bound
//! towards a flip.

use glam::{DMat2, DVec2, DVec3};

/// Area weight for shape alone.
pub(super) const MIPS_ONLY: f64 = 0.0;
/// Triangles with a smaller area, in squares of a texture edge, do not count: rounding decides their shape.
const SMALLEST_AREA: f64 = 1e-9;

/// A flat triangle of the surface as the relaxation needs it: lengths in texture edges.
pub(super) struct Element {
    area: f64,
    /// Gradients of the three corners' hat functions in the plane of the face.
    gradients: [DVec2; 3],
}

impl Element {
    /// From the corners in texture edges; `None` where the triangle is too small to count.
    pub fn new([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let x = (b - a).normalize_or_zero();
        let normal = (b - a).cross(c - a);
        let y = normal.cross(x).normalize_or_zero();
        let flat = [DVec2::ZERO, DVec2::new((b - a).dot(x), 0.0), DVec2::new((c - a).dot(x), (c - a).dot(y))];
        let twice_area = flat[1].perp_dot(flat[2]);
        (twice_area > SMALLEST_AREA).then(|| Self {
            area: 0.5 * twice_area,
            gradients: std::array::from_fn(|k| (flat[(k + 2) % 3] - flat[(k + 1) % 3]).perp() / twice_area),
        })
    }

    /// Columns: how the place in the tile changes along the face's two axes.
    fn jacobian(&self, places: [DVec2; 3]) -> DMat2 {
        let [p, q, r] = places;
        let [g, h, i] = self.gradients;
        DMat2::from_cols(p * g.x + q * h.x + r * i.x, p * g.y + q * h.y + r * i.y)
    }

    /// Area in the tile per area on the surface; negative where flipped.
    pub fn determinant(&self, places: [DVec2; 3]) -> f64 {
        self.jacobian(places).determinant()
    }

    /// The energy of a map to these places; infinite where it flips.
    pub fn energy(&self, places: [DVec2; 3], area_weight: f64) -> f64 {
        let jacobian = self.jacobian(places);
        let determinant = jacobian.determinant();
        if determinant <= 0.0 {
            return f64::INFINITY;
        }
        let square = jacobian.x_axis.length_squared() + jacobian.y_axis.length_squared();
        let shape = 0.5 * square / determinant;
        self.area * (shape * shape + area_weight * (determinant + 1.0 / determinant))
    }

    /// Gradient of the energy in the place of corner `k`, and the stiffness that turns it into a step.
    pub fn slope(&self, places: [DVec2; 3], k: usize, area_weight: f64) -> (DVec2, f64) {
        let jacobian = self.jacobian(places);
        let determinant = jacobian.determinant();
        let square = jacobian.x_axis.length_squared() + jacobian.y_axis.length_squared();
        let g = self.gradients[k];
        let of_square = 2.0 * (jacobian * g);
        let of_determinant = DVec2::new(
            g.x * jacobian.y_axis.y - g.y * jacobian.x_axis.y,
            g.y * jacobian.x_axis.x - g.x * jacobian.y_axis.x,
        );
        let shape = 0.5 * square / determinant;
        let slope = (of_square * determinant - square * of_determinant) * (shape / (determinant * determinant))
            + of_determinant * (area_weight * (1.0 - 1.0 / (determinant * determinant)));
        let stiffness = 2.0 * shape * g.length_squared() / determinant;
        (slope * self.area, stiffness * self.area)
    }
}

/// Whether a triangle in a face is counter-clockwise and not too small to tell.
pub(super) fn is_upright([a, b, c]: [DVec3; 3], face_normal: DVec3) -> bool {
    (b - a).cross(c - a).dot(face_normal) > SMALLEST_AREA
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [DVec3; 3] = [DVec3::new(0.1, 0.0, 0.3), DVec3::new(0.9, 0.2, 0.1), DVec3::new(0.3, 0.7, 0.6)];
    const PLACES: [DVec2; 3] = [DVec2::new(0.1, 0.1), DVec2::new(0.8, 0.2), DVec2::new(0.4, 0.5)];

    #[test]
    fn a_similar_triangle_has_the_least_energy() {
        let flat = [DVec2::ZERO, DVec2::X, DVec2::new(0.2, 0.6)];
        let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.0, 2.0);
        let element = Element::new(flat.map(|p| turn * p.extend(0.0))).unwrap();
        assert!((element.energy(flat, 0.5) - 0.3 * (1.0 + 0.5 * 2.0)).abs() < 1e-12);
        assert!((element.energy(flat.map(|p| 3.0 * p), MIPS_ONLY) - 0.3).abs() < 1e-12);
        // Stretched by two: ((2 + 1/2) / 2) squared.
        let stretched = flat.map(|p| DVec2::new(2.0 * p.x, p.y));
        assert!((element.energy(stretched, MIPS_ONLY) - 0.3 * 1.25 * 1.25).abs() < 1e-12);
        assert_eq!(element.energy([flat[0], flat[2], flat[1]], MIPS_ONLY), f64::INFINITY);
    }

    #[test]
    fn the_slope_is_the_derivative_of_the_energy() {
        let element = Element::new(CORNERS).unwrap();
        for k in 0..3 {
            let (slope, _) = element.slope(PLACES, k, 0.2);
            for axis in [DVec2::X, DVec2::Y] {
                let at = |offset: f64| {
                    let mut places = PLACES;
                    places[k] += axis * offset;
                    element.energy(places, 0.2)
                };
                let numeric = (at(1e-6) - at(-1e-6)) / 2e-6;
                assert!((slope.dot(axis) - numeric).abs() < 1e-6 * (1.0 + numeric.abs()), "{slope} and {numeric}");
            }
        }
    }
}
