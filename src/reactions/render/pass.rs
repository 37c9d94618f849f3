//! Draws the reactions of the organs that a camera sees.

use super::prepare::{ReactionLayer, ReactionTextures};
use crate::organ::render::{OrganDraw, OrganLayerView};
use bevy::prelude::*;
use bevy::render::renderer::{RenderContext, ViewQuery};

pub(super) fn draw_reactions(
    view: ViewQuery<OrganLayerView<ReactionLayer>>,
    organs: OrganDraw,
    textures: Res<ReactionTextures>,
    mut ctx: RenderContext,
) {
    organs.draw("reactions", view, &mut ctx, |entity| textures.part(entity));
}
