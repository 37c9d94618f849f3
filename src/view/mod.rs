//! What the surgeon looks through: the endoscope with its light and its round picture.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_surgery::prelude::*;
//! # fn setup(mut commands: Commands) {
//! commands.spawn((Endoscope::default(), Transform::from_xyz(0.0, 0.1, 0.2).looking_at(Vec3::ZERO, Vec3::Y)));
//! # }
//! ```

mod endoscope;
mod mask;
mod mask_depth;
mod scope_light;

pub use endoscope::Endoscope;
pub use mask::{ScopeMask, ScopeMaskUniform};
pub use scope_light::ScopeLight;

use bevy::prelude::*;

/// The endoscope camera, its ring light and its circular mask.
pub struct SurgeryViewPlugin;

impl Plugin for SurgeryViewPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<Endoscope>().register_type::<ScopeLight>().register_type::<ScopeMask>();
        endoscope::build(app);
        scope_light::build(app);
        mask::build(app);
        mask_depth::build(app);
    }
}
