//! Instruments: what a hand holds, where it is, what it touches and does.

mod work;

pub use work::ToolWork;

use bevy::prelude::*;

/// Instruments. See the [module](self).
pub struct ToolsPlugin;

impl Plugin for ToolsPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<ToolWork>();
    }
}
