//! Scenes: saving what a designer set up, loading it again, and scenes that are ready.
mod components;
mod error;
mod load;
mod migrate;
mod ready;
mod save;
mod text;
mod version;

pub use components::SceneComponents;
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
            .init_asset_loader::<SceneLoader>();
    }
}
