//! Draws the skins of the organs that a camera sees.

use super::prepare::{SkinInstances, SkinLayer};
use crate::organ::render::{OrganDraw, OrganLayerView};
use bevy::prelude::*;
use bevy::render::renderer::{RenderContext, ViewQuery};

pub(super) fn draw_skins(
    view: ViewQuery<OrganLayerView<SkinLayer>>,
    organs: OrganDraw,
    skins: Res<SkinInstances>,
    mut ctx: RenderContext,
) {
    organs.draw("skin", view, &mut ctx, |entity| skins.bind_group(entity));
}
