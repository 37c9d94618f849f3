//! Instruments: what a hand holds, where it is, what it touches and does.
//!
//! A [`Tool`] is an entity. Something writes its [`ToolPose`] and [`ToolCommand`] in
//! [`SurgerySystems::Sense`]: a program, or a [`ServoSession`] that joins it to a device of the hand. In
//! [`SurgerySystems::Touch`] its [`ToolContacts`] are found, and it does what its [`ToolKind`] can: it presses, burns, holds, bites,
//! drills, sucks. Nothing else has to be wired up.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::prelude::*;
//! use bevy_surgery::testing::TestApp;
//!
//! let mut app = TestApp::cpu();
//! let liver = OrganModel::procedural_liver(&OrganOptions::default())?;
//! let liver = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
//! app.world_mut().spawn((Organ(liver), Reactions::default()));
//! // An electrode a hand above the organ's middle, on its way down.
//! let hook = app.world_mut().spawn(Tool::new(ToolKind::CauteryHook(Electrodes::default()))).id();
//! for step in 0..200 {
//!     let tip_m = Vec3::Y * (0.1 - 0.001 * step as f32);
//!     app.world_mut().entity_mut(hook).insert((
//!         ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::Y),
//!         ToolCommand { pedal: 1.0, ..default() },
//!     ));
//!     app.step(1);
//!     if app.world().get::<ToolContacts>(hook).is_some_and(|contacts| contacts.at_tip().is_some()) {
//!         break;
//!     }
//! }
//! assert!(matches!(app.world().get::<ToolWork>(hook), Some(ToolWork::Burning { .. })));
//! # Ok::<(), bevy_surgery::organ::OrganError>(())
//! ```

mod act;
mod bodies;
mod contact;
mod force;
#[cfg(feature = "render")]
mod input;
mod order;
mod pose;
mod rig;
mod session;
mod state;
mod tool;
mod work;

pub use act::tool_number;
pub use bodies::Intangible;
pub use contact::{Contact, ContactEvents, ContactMatter, ContactPhase, NEAR_M, ToolContacts, ToolPart, ToolTouched};
pub use force::{BodyForce, ToolForce};
#[cfg(feature = "render")]
pub use input::{GamepadHand, MouseHand};
pub use order::ToolOrder;
pub use pose::{ToolCommand, ToolLimits, ToolMotion, ToolPlace, ToolPose};
pub use rig::{RigFrame, RigFrameTemplate, ToolClutch, ToolRig, ToolRigTemplate};
pub use session::{
    DeviceControl, DeviceRefused, Devices, HoldDevice, SenseDevices, ServoFaulted, ServoReading, ServoSession,
    ToolControls,
};
pub use state::ToolState;
pub use tool::{DrillHead, Electrodes, Jaws, Tool, ToolGeometry, ToolHand, ToolKind};
pub use work::ToolWork;

use crate::checkpoint::KeepState;
use crate::deform::elastic::{BodyContact, GraspBody, GraspSlipped, PressBody, TissueTorn};
use crate::organ::OrganModel;
use crate::pool::TreatBleeders;
use crate::reactions::OrganTouch;
use crate::schedule::SurgerySystems;
use crate::volume::{DrillVolume, Volume};
use bevy::prelude::*;

/// The order within [`SurgerySystems::Touch`]: a system of your own that changes what tools do goes in between.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TouchTools {
    /// Poses are looked at; tools move ([`ToolMotion`]).
    Move,
    /// What they touch is found ([`ToolContacts`]).
    Find,
    /// They do what they can: messages to organs, bodies and volumes.
    Act,
    /// Contacts are told of ([`ToolTouched`]).
    Tell,
}

/// Instruments. See the [module](self).
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        let has_bodies = resource_exists::<Assets<OrganModel>>.and_then(resource_exists::<Assets<Volume>>);
        app.configure_sets(
            FixedUpdate,
            (TouchTools::Move, TouchTools::Find, TouchTools::Act, TouchTools::Tell)
                .chain()
                .in_set(SurgerySystems::Touch)
                .run_if(has_bodies),
        );
        // Whatever plugin is left out, what is written to it goes nowhere.
        app.add_message::<BodyContact>()
            .add_message::<OrganTouch>()
            .add_message::<PressBody>()
            .add_message::<GraspBody>()
            .add_message::<GraspSlipped>()
            .add_message::<TissueTorn>()
            .add_message::<DrillVolume>()
            .add_message::<TreatBleeders>();
        app.register_type::<Tool>()
            .register_type::<ToolKind>()
            .register_type::<ToolHand>()
            .register_type::<ToolGeometry>()
            .register_type::<Jaws>()
            .register_type::<Electrodes>()
            .register_type::<DrillHead>()
            .register_type::<ToolForce>()
            .register_type::<BodyForce>()
            .register_type::<ToolWork>()
            .register_type::<Intangible>();
        // Its burr may be another one.
        app.keep_component::<Tool>()
            .keep_component::<ToolPose>()
            .keep_component::<ToolCommand>()
            .keep_component::<ToolMotion>()
            .keep_component::<ToolState>()
            .keep_component::<ToolForce>()
            .keep_component::<ToolContacts>()
            .keep_component::<ToolWork>();
        order::build(app);
        pose::build(app);
        contact::build(app);
        act::build(app);
        app.register_type::<ToolRig>().register_type::<ToolClutch>().register_type::<RigFrame>();
        session::build(app);
        #[cfg(feature = "render")]
        input::build(app);
    }
}
