//! What the render world takes of skins each frame.

use super::prepare::SkinUniform;
use super::textures::SkinTexture;
use crate::organ::{Organ, OrganModel};
use crate::skin::Skin;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;

/// A skin of this frame.
pub(super) struct ExtractedSkin {
    pub entity: MainEntity,
    pub model: AssetId<OrganModel>,
    pub tiles: AssetId<Image>,
    pub seed: u64,
    pub uniform: SkinUniform,
}

#[derive(Resource, Default)]
pub(super) struct ExtractedSkins {
    pub skins: Vec<ExtractedSkin>,
}

pub(super) fn extract_skins(
    mut extracted: ResMut<ExtractedSkins>,
    skins: Extract<Query<(Entity, &Organ, &Skin, &SkinTexture)>>,
) {
    extracted.skins.clear();
    extracted.skins.extend(skins.iter().map(|(entity, organ, skin, texture)| ExtractedSkin {
        entity: entity.into(),
        model: organ.0.id(),
        tiles: texture.tiles.id(),
        seed: skin.seed,
        uniform: SkinUniform {
            tint: skin.tint.to_linear().to_vec3(),
            mottle: skin.mottle,
            mottle_frequency_per_m: 1.0 / skin.mottle_size_m.max(1e-6),
            scatter: skin.scatter.clamp(0.0, 1.0),
            sheen: skin.sheen,
            // Blinn-Phong exponent of the same lobe width (Karis 2013).
            sheen_exponent: (2.0 / skin.sheen_roughness.clamp(0.05, 1.0).powi(4) - 2.0).max(0.5),
            relief_m: skin.relief_m,
        },
    }));
    extracted.skins.sort_by_key(|skin| skin.entity);
}
