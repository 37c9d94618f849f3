//! What instruments do to a body: pressing, and holding.

use bevy::prelude::*;

/// Shape of an instrument where it touches tissue.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum ToolShape {
    /// A ball.
    Sphere {
        /// Its centre, metres.
        centre_m: Vec3,
        /// Its radius, metres.
        radius_m: f32,
    },
    /// A rod with round ends.
    Capsule {
        /// Middle of the round end that touches first, metres.
        tip_m: Vec3,
        /// Middle of the other end, metres.
        back_m: Vec3,
        /// Its radius, metres.
        radius_m: f32,
    },
}

impl ToolShape {
    /// Ends of its axis, from the tip back, and its radius.
    pub(crate) fn axis(&self) -> (Vec3, Vec3, f32) {
        match *self {
            Self::Sphere { centre_m, radius_m } => (centre_m, centre_m, radius_m),
            Self::Capsule { tip_m, back_m, radius_m } => (tip_m, back_m, radius_m),
        }
    }

    /// The same shape in another space, which must not be sheared.
    pub fn transformed(&self, by: &bevy::math::Affine3A) -> Self {
        let scale = by.matrix3.determinant().abs().cbrt();
        match *self {
            Self::Sphere { centre_m, radius_m } => {
                Self::Sphere { centre_m: by.transform_point3(centre_m), radius_m: radius_m * scale }
            }
            Self::Capsule { tip_m, back_m, radius_m } => Self::Capsule {
                tip_m: by.transform_point3(tip_m),
                back_m: by.transform_point3(back_m),
                radius_m: radius_m * scale,
            },
        }
    }

    /// Whether all of it is a number, and there is a radius.
    pub fn is_sound(&self) -> bool {
        let (tip, back, radius) = self.axis();
        tip.is_finite() && back.is_finite() && radius.is_finite() && radius > 0.0
    }

    /// Between this one and a later one of the same kind.
    pub(crate) fn lerp(&self, later: &Self, share: f32) -> Self {
        match (*self, *later) {
            (Self::Sphere { centre_m: from, .. }, Self::Sphere { centre_m, radius_m }) => {
                Self::Sphere { centre_m: from.lerp(centre_m, share), radius_m }
            }
            (Self::Capsule { tip_m: tip, back_m: back, .. }, Self::Capsule { tip_m, back_m, radius_m }) => {
                Self::Capsule { tip_m: tip.lerp(tip_m, share), back_m: back.lerp(back_m, share), radius_m }
            }
            _ => *later,
        }
    }
}

/// An instrument that may touch the body in this step; the body's space, metres.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Press {
    /// Which instrument.
    pub tool: u32,
    /// Its shape at the end of the step. It came straight from where it was in the step before, if it was there.
    pub shape: ToolShape,
    /// Friction between it and the tissue (force along per force across); wet metal on tissue has 0.05 to 0.2.
    pub friction: f32,
}

/// Jaws that are closed in this step; the body's space, metres.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Hold {
    /// Which instrument.
    pub tool: u32,
    /// Middle of the jaws at the end of the step.
    pub position_m: Vec3,
    /// How the jaws are turned; tissue between them turns along.
    pub rotation: Quat,
    /// What they hold: the surface within this distance of them as they close, metres.
    pub radius_m: f32,
    /// Pull that they hold before the tissue slips out, newtons: grip times friction.
    pub most_pull_n: f32,
}

/// What happened to a body in a step; the body's space.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum BodyEvent {
    /// An instrument touches.
    Touched {
        /// Which one.
        tool: u32,
        /// Force on the instrument, newtons.
        force_n: Vec3,
        /// How far the surface gives way, metres.
        depth_m: f32,
        /// Where, metres.
        position_m: Vec3,
    },
    /// Jaws hold.
    Held {
        /// Which instrument.
        tool: u32,
        /// Force on the instrument, newtons.
        force_n: Vec3,
        /// Greatest stretch of the tissue where it is held.
        stretch: f32,
    },
    /// Tissue slipped out of jaws, which have to be opened before they can grasp anew.
    Slipped {
        /// Which instrument.
        tool: u32,
        /// Pull at that moment, newtons.
        pull_n: f32,
        /// Where, metres.
        position_m: Vec3,
    },
    /// Tissue tore where it was held, and is held no longer.
    Torn {
        /// Which instrument.
        tool: u32,
        /// Pull at that moment, newtons.
        pull_n: f32,
        /// Its stretch at that moment.
        stretch: f32,
        /// Where, metres.
        position_m: Vec3,
    },
}
