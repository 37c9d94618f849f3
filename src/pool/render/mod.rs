//! Pools on the GPU: what is drawn of them, and the flow for those that ask for it.

mod composite;
pub mod flow;

pub use composite::{PoolTextures, PoolUniform};

use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderSystems};
use flow::FlowSurfaces;

/// The surface of pools over everything opaque, drawn between the shadows of tools and Bevy's transparent pass: what is under it
/// is seen through it. It leaves the depth as it is.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PoolPasses;

/// Draws [`PoolSurface`](super::PoolSurface)s, and moves pools on the GPU that ask for it with [`GpuFlow`](flow::GpuFlow). A part of
/// [`PoolPlugin`](super::PoolPlugin).
pub struct PoolRenderPlugin;

impl Plugin for PoolRenderPlugin {
    fn build(&self, app: &mut App) {
        composite::build(app);
        flow::build(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app.add_systems(
            Render,
            show_flow
                .in_set(RenderSystems::PrepareResources)
                .after(flow::PrepareFlow)
                // What the GPU has is not uploaded.
                .before(composite::WriteSurfaces),
        );
    }

    fn finish(&self, app: &mut App) {
        flow::finish(app);
    }
}

/// Pools that the GPU moves are drawn as it left them.
fn show_flow(mut textures: ResMut<PoolTextures>, surfaces: Res<FlowSurfaces>) {
    textures.supply(surfaces.0.iter().map(|(entity, surface)| (*entity, surface.view.clone())));
}
