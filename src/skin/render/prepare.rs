//! Pipeline, buffers and bind groups of the skin pass.

use super::extract::ExtractedSkins;
use crate::organ::OrganModel;
use crate::organ::render::{ExtractedOrgans, GpuOrganModel, OrganLayer, OrganLayouts, layer_shader};
use crate::render::Uploads;
use crate::skin::tiles::assign_tiles;
use bevy::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    binding_types::{sampler, storage_buffer_read_only_sized, texture_2d_array, uniform_buffer},
    *,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::GpuImage;
use std::collections::BTreeMap;

/// A skin's parameters as the shader reads them (`shaders/skin/skin.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct SkinUniform {
    /// Linear colour that multiplies the tiles.
    pub tint: Vec3,
    /// Strength of the patches, 0 to 1.
    pub mottle: f32,
    /// One over the size of a patch, per metre.
    pub mottle_frequency_per_m: f32,
    /// How far light creeps into the shade, 0 to 1.
    pub scatter: f32,
    /// Strength of the sheen.
    pub sheen: f32,
    /// Blinn-Phong exponent of the sheen.
    pub sheen_exponent: f32,
    /// Height of the cells' relief per unit of the tiles' luminance, metres.
    pub relief_m: f32,
}

/// Names the layer.
pub(super) struct SkinLayer;

pub(super) fn init_pipeline(mut commands: Commands, layouts: Res<OrganLayouts>, assets: Res<AssetServer>) {
    let layout = BindGroupLayoutDescriptor::new(
        "skin_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<SkinUniform>(false).visibility(ShaderStages::VERTEX_FRAGMENT),
                storage_buffer_read_only_sized(false, None).visibility(ShaderStages::VERTEX),
                texture_2d_array(TextureSampleType::Float { filterable: true })
                    .visibility(ShaderStages::VERTEX_FRAGMENT),
                sampler(SamplerBindingType::Filtering),
            ),
        ),
    );
    let shader = layer_shader(&assets, "skin/skin.wgsl");
    commands.insert_resource(OrganLayer::<SkinLayer>::new("skin", &layouts, vec![layout], shader, None));
}

struct SkinInstance {
    uniform: UniformBuffer<SkinUniform>,
    /// Tile and rotation of each texture triangle: `tile * 3 + rotation`.
    choices: Buffer,
    chosen_for: (OrganModel, u64),
    bind_group: Option<BindGroup>,
}

/// Skins by organ, kept between frames.
#[derive(Resource, Default)]
pub(super) struct SkinInstances(BTreeMap<MainEntity, SkinInstance>);

impl SkinInstances {
    pub fn bind_group(&self, entity: MainEntity) -> Option<&BindGroup> {
        self.0.get(&entity)?.bind_group.as_ref()
    }
}

pub(super) fn write_buffers(
    mut instances: ResMut<SkinInstances>,
    extracted: Res<ExtractedSkins>,
    models: Res<RenderAssets<GpuOrganModel>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    uploaded: Option<Res<Uploads>>,
) {
    let mut bytes = 0;
    instances.0.retain(|entity, _| extracted.skins.binary_search_by_key(entity, |skin| skin.entity).is_ok());
    for skin in &extracted.skins {
        let Some(model) = models.get(skin.model) else { continue };
        let is_current = instances.0.get(&skin.entity).is_some_and(|instance| {
            let (chosen_for, seed) = &instance.chosen_for;
            chosen_for.is_same(&model.model) && *seed == skin.seed
        });
        if !is_current {
            let triangles = &model.model.texture_mesh.triangulation.neighbours;
            let model_choices: Vec<u32> = assign_tiles(triangles, skin.seed)
                .iter()
                .map(|choice| u32::from(choice.tile) * 3 + u32::from(choice.rotation))
                .collect();
            let choices = device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("skin_tile_choices"),
                usage: BufferUsages::STORAGE,
                contents: bytemuck::cast_slice(&model_choices),
            });
            bytes += size_of_val(model_choices.as_slice()) as u64 + SkinUniform::min_size().get();
            let mut uniform = UniformBuffer::from(skin.uniform);
            uniform.write_buffer(&device, &queue);
            let instance =
                SkinInstance { uniform, choices, chosen_for: (model.model.clone(), skin.seed), bind_group: None };
            instances.0.insert(skin.entity, instance);
        }
        if let Some(instance) = instances.0.get_mut(&skin.entity)
            && *instance.uniform.get() != skin.uniform
        {
            instance.uniform.set(skin.uniform);
            instance.uniform.write_buffer(&device, &queue);
            bytes += SkinUniform::min_size().get();
        }
    }
    if let Some(uploaded) = uploaded {
        uploaded.add(bytes);
    }
}

pub(super) fn prepare_bind_groups(
    mut instances: ResMut<SkinInstances>,
    extracted: Res<ExtractedSkins>,
    organs: Res<ExtractedOrgans>,
    layer: Res<OrganLayer<SkinLayer>>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
) {
    let layout = cache.get_bind_group_layout(&layer.own_groups[0]);
    for skin in &extracted.skins {
        let Some(instance) = instances.0.get_mut(&skin.entity) else { continue };
        instance.bind_group = None;
        let is_drawn = organs.organs.binary_search_by_key(&skin.entity, |organ| organ.entity).is_ok();
        let (true, Some(tiles), Some(uniform)) = (is_drawn, images.get(skin.tiles), instance.uniform.binding()) else {
            continue;
        };
        let entries = BindGroupEntries::sequential((
            uniform,
            instance.choices.as_entire_binding(),
            &tiles.texture_view,
            &tiles.sampler,
        ));
        instance.bind_group = Some(device.create_bind_group("skin", &layout, &entries));
    }
}
