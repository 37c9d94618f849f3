//! What the surgeon looks through: the endoscope with its light and its round picture, the operating microscope for two
//! eyes with its lamp, further monitors, and the shadows that tools cast.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! # fn setup(mut commands: Commands) {
//! commands.spawn((Endoscope::default(), Transform::from_xyz(0.0, 0.1, 0.2).looking_at(Vec3::ZERO, Vec3::Y)));
//! # }
//! ```
//!
//! - An [`Endoscope`] carries its light; a [`Microscope`] has a [`MicroscopeLamp`] beside its view.
//! - A [`StereoPair`] splits a camera for two eyes, a [`MonitorView`] shows it on a further screen.
//! - Tools marked [`ToolShadow`] cast soft shadows from lamps with [`ToolShadows`].

mod endoscope;
mod mask;
mod mask_depth;
mod microscope;
mod scope_light;
mod stereo;
mod tool_shadows;

pub use endoscope::Endoscope;
pub use mask::{ScopeMask, ScopeMaskUniform};
pub use microscope::{Microscope, MicroscopeLamp};
pub use scope_light::ScopeLight;
pub use stereo::{MonitorView, ShiftedPerspective, StereoEye, StereoEyes, StereoPair};
pub use tool_shadows::{
    MAX_SHADOW_LAMPS, SHADOW_TAPS, ShadowLens, ShadowMapPlace, ToolCasterUniform, ToolShadow, ToolShadowMaps,
    ToolShadowPasses, ToolShadowUniform, ToolShadows, shadow_noise,
};

use bevy::camera::CameraUpdateSystems;
use bevy::prelude::*;

/// Cameras get their lenses; whoever copies a lens comes after.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct SetLenses;

/// Eyes and monitors take places and lenses of the cameras that they belong to.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct FollowCameras;

/// Endoscope and microscope cameras, their lights and masks, stereo pairs, monitors, shadows of tools.
pub struct SurgeryViewPlugin;

impl Plugin for SurgeryViewPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Endoscope>().register_type::<ScopeLight>().register_type::<ScopeMask>();
        app.configure_sets(PostUpdate, SetLenses.before(CameraUpdateSystems));
        endoscope::build(app);
        scope_light::build(app);
        mask::build(app);
        mask_depth::build(app);
        microscope::build(app);
        stereo::build(app);
        tool_shadows::build(app);
    }
}
