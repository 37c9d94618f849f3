//! Scenes: ready ones, and saving and loading what a designer set up.
//!
//! - [`liver_scene`], [`mastoid_scene`] and [`soft_volume_scene`] are Bevy scenes to begin with: put them into `bsn!` and patch what
//!   is to be different.
//! - [`scene_text`] writes what was set up in a world, running or not, as Bevy's `.scn.ron`; [`SceneComponents`] says what that is.
//! - [`load_scene`] spawns it again, and the asset server loads files that end in `.surgery.scn.ron` ([`SceneLoader`]), to be spawned
//!   with a [`DynamicWorldRoot`]. Both read scenes of older minor versions ([`SceneVersion`]) and say with file, line and component
//!   what cannot be read; nothing is spawned then. Bevy's own loader reads today's `.scn.ron` too.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::prelude::*;
//! use bevy_surgery::testing::TestApp;
//!
//! let mut app = TestApp::cpu();
//! app.world_mut().spawn_scene(bsn! { liver_scene() Reactions { map_width_px: 512 } })?;
//! let text = scene_text(app.world())?;
//!
//! let mut another = TestApp::cpu();
//! load_scene(another.world_mut(), "liver.scn.ron", &text)?;
//! let reactions = another.world_mut().query::<&Reactions>().single(another.world())?.map_width_px;
//! assert_eq!(reactions, 512);
//!
//! // A file that is none says so.
//! let broken = text.replace("map_width_px: 512", "map_width_px: wide");
//! let told = load_scene(another.world_mut(), "liver.scn.ron", &broken).unwrap_err().to_string();
//! assert!(told.starts_with("liver.scn.ron, line "));
//! assert!(told.contains("in bevy_surgery::reactions::settings::Reactions: "));
//! # Ok::<(), bevy::ecs::error::BevyError>(())
//! ```
//!
//! What Bevy's scenes do not keep: a component that another one requires and that was removed comes back with it, where cameras show
//! their pictures is left to the program, and Bevy has no way to write their `Exposure` down.

mod components;
mod error;
mod load;
mod migrate;
mod ready;
mod save;
mod text;
mod version;

pub use components::{NotAuthored, SceneComponents};
pub use error::SceneError;
pub use load::{SceneLoader, load_scene, read_scene};
pub use ready::*;
pub use save::{author_scene, author_scene_of, scene_text};
pub use version::SceneVersion;

use bevy::prelude::*;
use bevy::scene::ScenePlugin;
use bevy::world_serialization::WorldSerializationPlugin;

/// Saves and loads scenes. Adds Bevy's plugins for scenes where nobody has.
pub struct ScenesPlugin;

impl Plugin for ScenesPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<WorldSerializationPlugin>() {
            app.add_plugins(WorldSerializationPlugin);
        }
        if !app.is_plugin_added::<ScenePlugin>() {
            app.add_plugins(ScenePlugin);
        }
        components::register(app);
        app.init_resource::<SceneComponents>()
            .register_type::<SceneVersion>()
            .register_type::<SceneError>()
            .register_type::<NotAuthored>()
            .init_asset_loader::<SceneLoader>();
    }
}
