//! What the render world takes of reaction maps each frame: the texels that changed.

use super::prepare::ReactionTextures;
use crate::organ::{Organ, OrganModel};
use crate::reactions::ReactionModel;
use crate::reactions::texels::{MapSize, TexelRect, TileMask};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;

/// Texels of one rectangle, row by row.
pub(super) struct ExtractedRect {
    pub rect: TexelRect,
    pub colour: Vec<u8>,
    pub gloss: Vec<u8>,
}

/// A reaction map of this frame.
pub(super) struct ExtractedMap {
    pub entity: MainEntity,
    pub size: MapSize,
    /// Which model it is of: another one begins with a new texture.
    pub model: u64,
    pub revision: u64,
    pub organ: AssetId<OrganModel>,
    /// Tiles in which something can be seen, where the GPU's list of triangles is for others.
    pub seen: Option<TileMask>,
    pub rects: Vec<ExtractedRect>,
}

#[derive(Resource, Default)]
pub(super) struct ExtractedReactions {
    pub maps: Vec<ExtractedMap>,
}

pub(super) fn extract_reactions(
    mut extracted: ResMut<ExtractedReactions>,
    textures: Res<ReactionTextures>,
    models: Extract<Query<(Entity, &Organ, &ReactionModel)>>,
) {
    extracted.maps.clear();
    for (entity, organ, model) in models.iter().filter(|(_, _, model)| !model.is_blank()) {
        let entity = MainEntity::from(entity);
        let size = model.size();
        let known = textures.revision(entity, model.number(), size);
        let changes = model.uploads().since(known.unwrap_or(0));
        let rects = changes.into_rects(size).into_iter().map(|rect| cut_out(model, rect)).collect();
        let revision = model.uploads().revision();
        let seen = (textures.seen(entity) != Some(model.seen_tiles())).then(|| model.seen_tiles().clone());
        extracted.maps.push(ExtractedMap {
            entity,
            size,
            model: model.number(),
            revision,
            organ: organ.0.id(),
            seen,
            rects,
        });
    }
    extracted.maps.sort_by_key(|map| map.entity);
}

fn cut_out(model: &ReactionModel, rect: TexelRect) -> ExtractedRect {
    let row_px = model.size().width_px as usize;
    let rows = (rect.y as usize..rect.bottom() as usize).map(|y| {
        let start = y * row_px + rect.x as usize;
        start..start + rect.width as usize
    });
    let area = rect.area() as usize;
    let (mut colour, mut gloss) = (Vec::with_capacity(4 * area), Vec::with_capacity(area));
    for row in rows {
        colour.extend_from_slice(model.map().colour()[row.clone()].as_flattened());
        gloss.extend_from_slice(&model.map().gloss()[row]);
    }
    ExtractedRect { rect, colour, gloss }
}
