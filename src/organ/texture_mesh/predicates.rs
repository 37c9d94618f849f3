//! Exact answers to "on which side?": the topology of the overlay rests on these signs alone.
//!
//! Directions are rounded to integers of 41 bits, so that a determinant of three fits in 128 bits and its sign is
//! exact. The rounding is 4e-12 of a unit direction, far below what a single-precision position can tell.

use super::{super::sphere::SphereMesh, TextureMeshError};
use glam::DVec3;

/// Integer steps per unit of a direction's coordinate.
const STEPS_PER_UNIT: f64 = (1u64 << 38) as f64;
/// Largest coordinate, in units, for which determinants stay within 128 bits.
const LARGEST_COORDINATE: f64 = 8.0;
/// Determinants larger than this are beyond the rounding error of double precision, so their sign is taken from there.
/// With coordinates below 2^41 the error is under 2^(123 - 53 + 3).
const SAFE_DETERMINANT: f64 = (1u128 << 76) as f64;

/// Directions with whole-numbered coordinates, in steps.
#[derive(Clone, Debug)]
pub(super) struct GridDirections(pub Vec<DVec3>);

impl GridDirections {
    /// Rounds directions to the grid.
    pub fn new(directions: &[DVec3]) -> Result<Self, TextureMeshError> {
        if directions.iter().any(|d| !d.is_finite() || d.abs().max_element() > LARGEST_COORDINATE) {
            return Err(TextureMeshError::InvalidChart);
        }
        Ok(Self(directions.iter().map(|d| (*d * STEPS_PER_UNIT).round()).collect()))
    }

    /// Sign of the determinant of three directions: positive where `c` is to the left of the arc from `a` to `b`,
    /// zero only where the three are on one great circle.
    pub fn orientation(a: DVec3, b: DVec3, c: DVec3) -> i32 {
        let determinant = a.cross(b).dot(c);
        if determinant.abs() > SAFE_DETERMINANT {
            return if determinant > 0.0 { 1 } else { -1 };
        }
        let [a, b, c] = [a, b, c].map(|v| v.to_array().map(|x| x as i128));
        let exact = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        exact.signum() as i32
    }

    /// Whether every face of a mesh with these directions is counter-clockwise.
    pub fn all_positive(&self, mesh: &SphereMesh) -> bool {
        mesh.triangles.iter().all(|t| {
            let [a, b, c] = t.map(|v| self.0[v as usize]);
            Self::orientation(a, b, c) > 0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_is_exact_where_doubles_cancel() {
        // Neighbouring grid points: the determinant is plus or minus one step cubed, far below double precision.
        let a = DVec3::new((1u64 << 38) as f64, ((1u64 << 37) + 1) as f64, 7.0);
        let b = a + DVec3::X;
        let c = a + DVec3::Y;
        let expected = |v: [DVec3; 3]| {
            let [[a, b, c], [d, e, f], [g, h, i]] = v.map(|x| x.to_array().map(|x| x as i128));
            (a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)).signum() as i32
        };
        assert_eq!(GridDirections::orientation(a, b, c), expected([a, b, c]));
        assert_eq!(GridDirections::orientation(a, b, c), -GridDirections::orientation(b, a, c));
        assert_ne!(GridDirections::orientation(a, b, c), 0);
        assert_eq!(GridDirections::orientation(a, b, a + b), 0);
    }

    #[test]
    fn directions_off_the_grid_are_refused() {
        assert!(GridDirections::new(&[DVec3::new(f64::NAN, 0.0, 1.0)]).is_err());
        assert!(GridDirections::new(&[DVec3::new(1e9, 0.0, 1.0)]).is_err());
    }
}
