//! A temporal bone under the operating microscope.

use super::rig_of;
use crate::pool::{Pool, SuctionIrrigator};
use crate::sound::ToolSound;
use crate::tools::{DrillHead, Tool, ToolControls, ToolHand, ToolKind, ToolRig};
#[cfg(feature = "render")]
use crate::view::{Microscope, MicroscopeLamp};
use crate::volume::phantom::PhantomOptions;
use bevy::ecs::template::EntityTemplate;
use bevy::prelude::*;

/// Where the bone's surface lies over its middle, metres.
const SURFACE_M: f32 = 0.02;
/// Metres at the burr per metre at the hand.
const FINE: f32 = 0.3;

/// A temporal bone to drill: the phantom that ships with the crate, with water over it, a drill, a suction-irrigator and, with the
/// feature `render`, a microscope with its lamp.
///
/// Its entity is the [`mastoid_bone`], whose mastoid faces +Z; the rest are children, so that all move with it. What is patched is patched
/// on the bone. The instruments lie aside until something writes their [`ToolPose`](crate::tools::ToolPose): a program, or a
/// device ([`HoldDevice`](crate::tools::HoldDevice)).
///
/// ```
/// use bevy::prelude::*;
/// use bevy_surgery::prelude::*;
/// # use bevy_surgery::testing::TestApp;
///
/// fn setup(mut commands: Commands) {
///     commands.spawn_scene(bsn! {
///         mastoid_scene()
///         // Another bone, coarser, with warnings from 3 mm on.
///         MakePhantom(PhantomOptions { size: 64, seed: 7 })
///         WatchCritical { band_mm: 3.0 }
///     });
/// }
/// # let mut app = TestApp::cpu();
/// # app.add_systems(Startup, setup).finish();
/// # app.update();
/// # let mut bones = app.world_mut().query::<(Entity, &MakePhantom, &WatchCritical)>();
/// # let (bone, phantom, watch) = bones.single(app.world())?;
/// # assert_eq!((phantom.0.size, phantom.0.seed, watch.band_mm), (64, 7, 3.0));
/// # assert_eq!(phantom.0.pneumatization, PhantomOptions::default().pneumatization);
/// # let mut pools = app.world_mut().query::<&Pool>();
/// # assert_eq!(pools.single(app.world())?.volume, bone);
/// # Ok::<(), bevy::ecs::error::BevyError>(())
/// ```
pub fn mastoid_scene() -> impl Scene {
    bsn! {
        #Mastoid
        mastoid_bone()
        Children [
            mastoid_pool(#Mastoid),
            mastoid_drill(#Mastoid),
            mastoid_suction(#Mastoid),
            {view()},
        ]
    }
}

#[cfg(feature = "render")]
fn view() -> impl SceneList {
    bsn_list![mastoid_microscope()]
}

#[cfg(not(feature = "render"))]
fn view() -> impl SceneList {
    bsn_list![]
}

/// The phantom of a temporal bone. Distances to what must not be drilled are known up to 6 mm.
pub fn mastoid_bone() -> impl Scene {
    let (phantom, watch) = crate::ready::mastoid_bone(PhantomOptions::default());
    bsn! {
        #Bone
        template_value(phantom)
        template_value(watch)
    }
}

/// Water, blood and bone dust over a bone that faces +Z, level under the microscope. A child of the bone.
pub fn mastoid_pool(bone: EntityTemplate) -> impl Scene {
    bsn! {
        #Pool
        Pool { volume: bone }
        template_value(crate::ready::over_mastoid())
    }
}

/// A drill in the right hand, over a bone that faces +Z.
pub fn mastoid_drill(bone: EntityTemplate) -> impl Scene {
    bsn! {
        #Drill
        instrument(Tool::new(ToolKind::Drill(DrillHead::default())), bone)
    }
}

/// A suction-irrigator in the left hand, over a bone that faces +Z.
pub fn mastoid_suction(bone: EntityTemplate) -> impl Scene {
    bsn! {
        #Suction
        instrument(Tool::new(ToolKind::SuctionIrrigator).in_hand(ToolHand::Left), bone)
        SuctionIrrigator
        ToolSound { seed: 1 }
    }
}

fn instrument(tool: Tool, bone: EntityTemplate) -> impl Scene {
    bsn! {
        template_value(tool)
        ToolSound
        ToolControls
        rig_of(bone)
        ToolRig { centre_in_frame_m: {Vec3::Z * SURFACE_M}, scale: FINE }
    }
}

/// A microscope before a bone that faces +Z, in focus between its surface and its middle. Its lamp shines from the upper right, so
/// that the shadow of a drill in the right hand falls beside it.
#[cfg(feature = "render")]
pub fn mastoid_microscope() -> impl Scene {
    let place = crate::ready::before_mastoid(Microscope::default().working_distance_m);
    bsn! {
        #Microscope
        Microscope
        template_value(place)
        Children [
            #Lamp
            MicroscopeLamp { offset_m: {Vec2::new(0.024, 0.026)} }
        ]
    }
}
