//! What the render world takes of skins each frame.

use super::prepare::SkinUniform;
use super::textures::SkinTexture;
use crate::organ::{Organ, OrganModel};
use crate::render::finite_within;
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
        uniform: uniform(skin),
    }));
    extracted.skins.sort_by_key(|skin| skin.entity);
}

/// One number that is not finite would spread: bloom and later passes blur it over the whole picture.
fn uniform(skin: &Skin) -> SkinUniform {
    let roughness = finite_within(skin.sheen_roughness, 0.05, 1.0, 0.3);
    SkinUniform {
        tint: Vec3::from(
            skin.tint.to_linear().to_f32_array_no_alpha().map(|channel| finite_within(channel, 0.0, 10.0, 1.0)),
        ),
        mottle: finite_within(skin.mottle, 0.0, 1.0, 0.0),
        mottle_frequency_per_m: 1.0 / finite_within(skin.mottle_size_m, 1e-6, 1e6, 0.035),
        scatter: finite_within(skin.scatter, 0.0, 1.0, 0.0),
        sheen: finite_within(skin.sheen, 0.0, 100.0, 0.0),
        // Blinn-Phong exponent of the same lobe width (Karis 2013).
        sheen_exponent: (2.0 / roughness.powi(4) - 2.0).max(0.5),
        relief_m: finite_within(skin.relief_m, -0.1, 0.1, 0.0),
    }
}
