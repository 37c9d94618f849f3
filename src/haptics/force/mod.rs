//! Models of force: what a tool feels of the things around it.
//!
//! One proxy stands for the tool where it may be, outside of everything solid, while the device's handle goes where the hand
//! pushes it. Whatever is solid says which half-spaces it leaves free around the proxy ([`HalfSpace`]): triangles of an organ
//! ([`SurfacePatch`]), planes and balls ([`ContactPatch`]), bone as the triangles of its surface ([`BonePatch`]). A running burr
//! goes into bone, and feels how much of it that is ([`overlap`]).

mod bone;
mod burr;
mod bvh;
mod contact;
mod coupling;
mod half_space;
mod load;
mod nets;
mod proxy;
mod surface;

pub use bone::{BoneBrick, BonePatch, BurrOverlap, overlap};
pub use burr::{BurrContact, BurrPush, TurningBurr};
pub use contact::{ContactPatch, ContactShape};
pub use coupling::Coupling;
pub use half_space::{HalfSpace, Projection, nearest_in_all};
pub use load::ToolLoad;
pub use proxy::{MAX_CONTACTS, Obstacle, Proxy, ProxyContact, ProxyStep, ToolCapsule};
pub use surface::SurfacePatch;

use bevy::prelude::{Component, Reflect, ReflectComponent, ReflectDefault};
use serde::{Deserialize, Serialize};

/// How a surface feels. As a component beside an organ or a volume, how that feels; without it an organ feels like a liver and a
/// volume like bone.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct SurfaceFeel {
    /// Newtons per metre of depth; the loop takes no more than the device bears.
    pub stiffness_n_per_m: f64,
    /// Newton seconds per metre against motion along the normal; limited likewise.
    pub damping_n_s_per_m: f64,
    /// Tangential over normal force below which what rests stays at rest.
    pub static_friction: f64,
    /// The same while it slides.
    pub dynamic_friction: f64,
}

impl SurfaceFeel {
    /// Wet, soft, slippery.
    pub const LIVER: Self =
        Self { stiffness_n_per_m: 250.0, damping_n_s_per_m: 0.5, static_friction: 0.12, dynamic_friction: 0.08 };
    /// As hard as the device can.
    pub const BONE: Self =
        Self { stiffness_n_per_m: 5000.0, damping_n_s_per_m: 0.2, static_friction: 0.25, dynamic_friction: 0.2 };

    /// With numbers that make sense.
    pub(crate) fn sane(mut self) -> Self {
        let positive = |value: f64| if value.is_finite() { value.max(0.0) } else { 0.0 };
        self.stiffness_n_per_m = positive(self.stiffness_n_per_m);
        self.damping_n_s_per_m = positive(self.damping_n_s_per_m);
        self.dynamic_friction = positive(self.dynamic_friction);
        self.static_friction = positive(self.static_friction).max(self.dynamic_friction);
        self
    }
}
