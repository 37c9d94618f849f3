//! Draws the highlights of the organs that a camera sees, under or over the drops.

use super::prepare::{HighlightViews, HighlightsLayer};
use crate::highlights::HighlightCover;
use crate::organ::render::{OrganDraw, OrganLayerView};
use bevy::prelude::*;
use bevy::render::renderer::{RenderContext, ViewQuery};

pub(super) fn draw_under_drops(
    view: ViewQuery<OrganLayerView<HighlightsLayer>>,
    organs: OrganDraw,
    views: Res<HighlightViews>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    organs.draw("highlights_under", view, &mut ctx, |organ| views.part(entity, organ, HighlightCover::UnderDrops));
}

pub(super) fn draw_over_drops(
    view: ViewQuery<OrganLayerView<HighlightsLayer>>,
    organs: OrganDraw,
    views: Res<HighlightViews>,
    mut ctx: RenderContext,
) {
    let entity = view.entity();
    organs.draw("highlights", view, &mut ctx, |organ| views.part(entity, organ, HighlightCover::OverDrops));
}
