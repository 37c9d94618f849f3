//! Pools on the GPU.

mod composite;

pub use composite::{PoolTextures, PoolUniform};

use bevy::prelude::*;

/// The surface of pools over everything opaque, drawn between the shadows of tools and Bevy's transparent pass: what is under it
/// is seen through it. It leaves the depth as it is.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PoolPasses;

/// Draws [`PoolSurface`](super::PoolSurface)s. A part of [`PoolPlugin`](super::PoolPlugin).
pub struct PoolRenderPlugin;

impl Plugin for PoolRenderPlugin {
    fn build(&self, app: &mut App) {
        composite::build(app);
    }
}
