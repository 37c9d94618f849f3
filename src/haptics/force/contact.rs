//! What an elastic body feels like around a tool, told in a few planes and balls that the simulation renews.

use super::SurfaceFeel;
use super::half_space::HalfSpace;
use super::proxy::Reach;
use crate::organ::closest::on_segment;
use glam::DVec3;

/// Outline of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactShape {
    /// A plane, solid behind it.
    Plane {
        /// A place on it, world, metres.
        point_m: DVec3,
        /// Away from the solid; of any length but 0.
        normal: DVec3,
        /// How far around the place it counts, metres.
        radius_m: f64,
    },
    /// A solid ball.
    Ball {
        /// Its middle, world, metres.
        centre_m: DVec3,
        /// Metres.
        radius_m: f64,
    },
}

/// One contact with an elastic body, from where it was a step ago to where it is now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPatch {
    /// Where it is now.
    pub shape: ContactShape,
    /// How far it has moved since the step before, metres.
    pub moved_m: DVec3,
    /// How it feels: the stiffness is the body's, there and in that direction.
    pub feel: SurfaceFeel,
}

impl ContactPatch {
    /// Where it lags behind its end, at a share of the way.
    fn lag_m(&self, share: f64) -> DVec3 {
        self.moved_m * (share - 1.0)
    }

    pub(super) fn motion(&self, shares: [f64; 2]) -> DVec3 {
        self.moved_m * (shares[1] - shares[0])
    }

    pub(super) fn gather(&self, reach: &Reach, into: &mut Vec<HalfSpace>) {
        let lag_m = self.lag_m(reach.share);
        let feel = self.feel.sane();
        let (normal, surface_m) = match self.shape {
            ContactShape::Plane { point_m, normal, radius_m } => {
                let (Some(normal), point_m) = (normal.try_normalize(), point_m + lag_m) else { return };
                let aside = reach.place_m - point_m;
                let height = normal.dot(aside);
                if aside.length_squared() - height * height > radius_m * radius_m {
                    return;
                }
                (normal, reach.place_m - normal * height)
            }
            ContactShape::Ball { centre_m, radius_m } => {
                let centre_m = centre_m + lag_m;
                let tool_m = on_segment(centre_m, reach.segment_m);
                let Some(normal) = (tool_m - centre_m).try_normalize() else { return };
                (normal, centre_m + normal * radius_m)
            }
        };
        let offset_m = normal.dot(surface_m) + reach.level_m(normal);
        if offset_m.is_finite() && normal.dot(reach.place_m) - offset_m <= reach.step_m {
            into.push(HalfSpace { normal, offset_m, feel, point_m: surface_m, obstacle: reach.obstacle, element: 0 });
        }
    }
}
