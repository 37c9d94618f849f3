//! What instruments sound like: a drill, suction, cautery, worked out sample by sample (after section 3 of the paper of 2009, which
//! plays recordings and raises the pitch with the pressure).
//!
//! A voice is an iterator of samples, so that it can be played, or written to a buffer and measured:
//!
//! ```
//! use bevy_surgery::sound::{DrillDials, DrillSound, DrillVoice, Voice};
//!
//! let mut voice = DrillVoice::new(DrillSound::default(), 48_000, 1);
//! voice.turn(DrillDials { speed_rpm: 40_000.0, force_n: 2.0, contact: 1.0, hardness: 1.0 });
//! let loudest = voice.by_ref().take(9600).fold(0.0_f32, |loudest, sample| loudest.max(sample.abs()));
//! assert!(loudest > 0.05 && loudest <= 1.0);
//! ```
//!
//! In an app a [`ToolSound`] beside a [`ToolWork`](crate::tools::ToolWork) is heard where the tool is. That needs the feature `sound`
//! and Bevy's `AudioPlugin`; without either, or without a device that plays, all is silent and nothing fails.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::sound::ToolSound;
//! use bevy_surgery::tools::ToolWork;
//!
//! fn setup(mut commands: Commands) {
//!     let work = ToolWork::Drilling { speed_rpm: 40_000.0, force_n: 0.0, contact: 0.0, hardness: 0.0 };
//!     commands.spawn((Transform::default(), work, ToolSound::default()));
//! }
//! # App::new().add_plugins(MinimalPlugins).add_systems(Startup, setup).update();
//! ```
//!
//! Ears are Bevy's `SpatialListener`, one in a scene; `ears_at_field` gives one for a camera, and says where they hang. Without a
//! listener tools are heard in the middle.

mod cautery;
mod dials;
mod drill;
mod parts;
#[cfg(feature = "sound")]
mod play;
mod suction;
mod tool;
mod voice;

pub use cautery::{CauteryDials, CauteryVoice};
pub use dials::{DialledVoice, VoiceDials};
pub use drill::{DrillDials, DrillSound, DrillVoice};
#[cfg(feature = "sound")]
pub use play::{VoiceSource, ears_at_field};
pub use suction::{SuctionDials, SuctionVoice};
pub use tool::{ToolDials, ToolSound, ToolVoice};
pub use voice::Voice;

use bevy::prelude::*;

/// Lets tools be heard. See the [module](self).
pub struct SoundPlugin;

impl Plugin for SoundPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<DrillSound>()
            .register_type::<DrillDials>()
            .register_type::<SuctionDials>()
            .register_type::<CauteryDials>()
            .register_type::<ToolSound>()
            .register_type::<ToolDials>();
    }

    #[cfg(feature = "sound")]
    fn finish(&self, app: &mut App) {
        play::add_to(app);
    }
}
