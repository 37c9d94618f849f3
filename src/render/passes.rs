//! The order of a camera's passes.

use bevy::core_pipeline::{
    core_3d::{main_opaque_pass_3d, main_transparent_pass_3d},
    schedule::{Core3d, Core3dSystems},
};
use bevy::prelude::*;
use bevy::render::RenderApp;

/// The layers of an organ, drawn over one another in `Core3d` between Bevy's opaque and transparent passes.
///
/// To put a layer of your own between two of them, add a system to `Core3d` with
/// `.after(OrganPasses::Skin).before(OrganPasses::Reactions)`.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OrganPasses {
    /// Layer 1: the skin's colour and texture; writes depth.
    Skin,
    /// Layer 3 where it is to lie under the drops: reflections on the skin alone.
    HighlightsUnder,
    /// Layer 2: blood, burns, whitening; blends over what is there.
    Reactions,
    /// Layer 3: reflections of the lamp on skin and drops.
    Highlights,
}

/// Volumes, drawn between Bevy's opaque pass and the organs' first layer: what is opaque ends their rays, and they write depth.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct VolumePasses;

pub(super) fn order(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.configure_sets(
        Core3d,
        (
            VolumePasses,
            OrganPasses::Skin,
            OrganPasses::HighlightsUnder,
            OrganPasses::Reactions,
            OrganPasses::Highlights,
        )
            .chain()
            // Bevy's opaque pass clears the view and fills depth; transparent things must blend over organs.
            .after(main_opaque_pass_3d)
            .before(main_transparent_pass_3d)
            .in_set(Core3dSystems::MainPass),
    );
}
