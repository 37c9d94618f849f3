//! Scenes that are ready: what a lesson starts from.

mod liver;
mod mastoid;
mod soft_volume;

pub use liver::{abdominal_wall, liver, liver_scene};
pub use mastoid::{mastoid_bone, mastoid_drill, mastoid_pool, mastoid_scene, mastoid_suction};
pub use soft_volume::{soft_volume, soft_volume_scene};
#[cfg(feature = "render")]
pub use {liver::liver_endoscope, mastoid::mastoid_microscope, soft_volume::soft_volume_camera};

use crate::tools::{RigFrameTemplate, ToolRig};
use bevy::ecs::template::EntityTemplate;
use bevy::prelude::*;

/// A [`ToolRig`] that moves with another entity of the scene, by its name: `bsn!` takes names as fields and arguments, but not within
/// a choice.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_surgery::{prelude::*, scenes::rig_of, tools::ToolRig};
/// fn table() -> impl Scene {
///     bsn! {
///         #Table
///         Transform
///         Children [
///             (Tool rig_of(#Table) ToolRig { scale: 0.5 })
///         ]
///     }
/// }
/// ```
pub fn rig_of(frame: EntityTemplate) -> impl Scene {
    ToolRig::patch(move |rig, _| rig.frame = RigFrameTemplate::Of(frame))
}
