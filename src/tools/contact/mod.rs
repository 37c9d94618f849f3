//! What instruments touch: organs and what is left of volumes, at the tip and along the shaft, also where a tool moves so fast
//! that it would be through in one step.

mod bodies;
mod events;
mod search;
mod sweep;

pub use events::{ContactEvents, ContactPhase, ToolTouched};

use super::TouchTools;
use crate::organ::SurfacePoint;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Which part of a tool.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect, Serialize, Deserialize)]
pub enum ToolPart {
    /// The ball at its tip, or the burr.
    #[default]
    Tip,
    /// The rod behind it.
    Shaft,
}

/// What a tool touches there.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum ContactMatter {
    /// The surface of an organ.
    Organ {
        /// Face and weights of its corners.
        point: SurfacePoint,
        /// Texture coordinates.
        uv: Vec2,
    },
    /// Matter of a volume.
    Volume {
        /// The voxel; of a volume that a lattice deforms, that of the matter at rest.
        voxel: UVec3,
        /// Label of its structure, 0 for none.
        label: u8,
    },
}

/// A place at which a tool touches a body.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Contact {
    /// The body: an organ or a volume.
    pub body: Entity,
    /// Which part of the tool.
    pub part: ToolPart,
    /// Where on the body's surface, world, metres.
    pub point_world_m: Vec3,
    /// Unit normal out of the body (into a hollow one), in the world.
    pub normal_world: Vec3,
    /// How far that part of the tool is behind the surface, metres.
    pub depth_m: f32,
    /// What is there.
    pub matter: ContactMatter,
    /// Force of the body on the tool, newtons: as measured ([`ToolForce`](super::ToolForce)), else by depth and stiffness
    /// ([`SurfaceFeel`](crate::haptics::force::SurfaceFeel)).
    pub force_n: f32,
}

/// What a tool touches in this step: at most one place per body and part. Written in
/// [`SurgerySystems::Touch`](crate::schedule::SurgerySystems::Touch).
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolContacts {
    /// By body, the tip before the shaft.
    pub list: Vec<Contact>,
    /// Bodies whose surface is within [`NEAR_M`] of the tool, in the order of the list, whether touched or not.
    pub near: Vec<Entity>,
}

/// How near a body must be to be told of, metres.
pub const NEAR_M: f64 = 0.01;

impl ToolContacts {
    /// Where the tip touches, the firmest one first in case of several bodies.
    pub fn at_tip(&self) -> Option<&Contact> {
        let tips = self.list.iter().filter(|contact| contact.part == ToolPart::Tip);
        // Of equally firm ones the first.
        tips.reduce(|most, next| if next.force_n > most.force_n { next } else { most })
    }

    /// Where a part touches a body.
    pub fn of(&self, body: Entity, part: ToolPart) -> Option<&Contact> {
        self.list.iter().find(|contact| contact.body == body && contact.part == part)
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<Contact>()
        .register_type::<ContactMatter>()
        .register_type::<ToolPart>()
        .register_type::<ToolContacts>()
        .add_systems(FixedUpdate, search::find_contacts.in_set(TouchTools::Find));
    events::build(app);
}
