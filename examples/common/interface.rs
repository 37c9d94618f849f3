//! Text on the screen.

use bevy::prelude::*;
use bevy::sprite::SpritePlugin;
use bevy::sprite_render::SpriteRenderPlugin;
use bevy::text::TextPlugin;
use bevy::ui::UiPlugin;
use bevy::ui_render::UiRenderPlugin;

/// Adds Bevy's user interface: its default plugins bring it along, a headless run has only what it was given.
pub fn add_interface(app: &mut App) {
    if !app.is_plugin_added::<UiPlugin>() {
        app.add_plugins((SpritePlugin, SpriteRenderPlugin, TextPlugin, UiPlugin, UiRenderPlugin));
    }
}
