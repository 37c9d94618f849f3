//! How wet or dull organs are, texel by texel: written by the layer that knows, read by layers that reflect.

use crate::organ::surface::NEUTRAL_GLOSS;
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// A gloss map for each organ that has one (render world).
///
/// A map is an `R8Unorm` texture over `map_uv` of `shaders/organ.wgsl`: 0 is dull, 128 as the skin itself, 255 wet.
/// Who has one inserts it in [`RenderSystems::PrepareResources`](bevy::render::RenderSystems::PrepareResources); layers bind it in
/// [`RenderSystems::PrepareBindGroups`](bevy::render::RenderSystems::PrepareBindGroups).
#[derive(Resource)]
pub struct OrganGloss {
    /// The maps.
    pub maps: BTreeMap<MainEntity, TextureView>,
    /// For organs without a map: a single neutral texel.
    pub neutral: TextureView,
    /// Linear, repeating along `u`.
    pub sampler: Sampler,
}

impl OrganGloss {
    /// The map of an organ, or the neutral one.
    pub fn of(&self, entity: MainEntity) -> &TextureView {
        self.maps.get(&entity).unwrap_or(&self.neutral)
    }
}

pub(super) fn init(mut commands: Commands, device: Res<RenderDevice>, queue: Res<RenderQueue>) {
    let neutral = device.create_texture_with_data(
        &queue,
        &TextureDescriptor {
            label: Some("neutral_gloss"),
            size: Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::R8Unorm,
            usage: TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        TextureDataOrder::LayerMajor,
        &[NEUTRAL_GLOSS],
    );
    let sampler = device.create_sampler(&SamplerDescriptor {
        label: Some("organ_map_sampler"),
        address_mode_u: AddressMode::Repeat,
        address_mode_v: AddressMode::ClampToEdge,
        mag_filter: FilterMode::Linear,
        min_filter: FilterMode::Linear,
        ..default()
    });
    commands.insert_resource(OrganGloss { maps: BTreeMap::new(), neutral: neutral.create_view(&default()), sampler });
}
