//! What each view shows of the pools: uniforms, the picture's copy, bind groups.

use super::extract::ExtractedPools;
use super::pipeline::{PoolPipelineKey, PoolPipelines};
use super::textures::PoolTextures;
use super::uniform::{PoolUniform, PoolView};
use crate::organ::render::{OrganPipelineKey, OrganSides};
use crate::render::{SceneLights, Uploads, strongest_lights, viewport_of};
use bevy::camera::MainPassResolutionOverride;
use bevy::camera::visibility::RenderLayers;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy::render::view::{ExtractedView, ViewDepthTexture};
use std::collections::BTreeMap;

/// A pool in a view.
pub(super) struct SeenPool {
    pub entity: MainEntity,
    pub pipeline: CachedRenderPipelineId,
    pub group: BindGroup,
    pub offset: u32,
    /// The part of the target that is copied for it, pixels.
    pub pixels: URect,
}

/// The pools of a view, far ones first.
pub(super) struct SeenPools {
    pub viewport: URect,
    /// Takes up the picture as it was before a pool.
    pub copy: Texture,
    pub pools: Vec<SeenPool>,
}

struct Copy {
    texture: Texture,
    view: TextureView,
    is_used: bool,
}

/// The views of this frame that show pools.
#[derive(Resource, Default)]
pub(super) struct PoolViews {
    pub views: BTreeMap<Entity, SeenPools>,
    // Cameras are drawn one after the other, so those of a kind share one.
    copies: HashMap<(UVec2, TextureFormat), Copy>,
    uniforms: DynamicUniformBuffer<PoolUniform>,
}

type View = (
    Entity,
    &'static ExtractedView,
    &'static ExtractedCamera,
    &'static ViewDepthTexture,
    &'static Msaa,
    Option<&'static Tonemapping>,
    Option<&'static RenderLayers>,
    Option<&'static MainPassResolutionOverride>,
);

pub(super) fn prepare_views(
    mut kept: ResMut<PoolViews>,
    mut pipelines: ResMut<PoolPipelines>,
    extracted: Res<ExtractedPools>,
    textures: Res<PoolTextures>,
    scene: Option<Res<SceneLights>>,
    images: Res<RenderAssets<GpuImage>>,
    fallback: Res<FallbackImage>,
    views: Query<View>,
    cache: Res<PipelineCache>,
    uploaded: Option<Res<Uploads>>,
    (device, queue): (Res<RenderDevice>, Res<RenderQueue>),
) -> Result {
    let kept = &mut *kept;
    kept.views.clear();
    kept.uniforms.clear();
    kept.copies.values_mut().for_each(|copy| copy.is_used = false);
    if extracted.pools.is_empty() {
        kept.copies.clear();
        return Ok(());
    }
    // What each view shows, before the uniforms have a buffer.
    let mut found = Vec::new();
    for (view_entity, view, camera, depth, msaa, tonemapping, layers, resolution) in &views {
        // A frame in which a camera learns that its depth is to be read still has the old texture.
        let Some(viewport) = viewport_of(camera, resolution) else { continue };
        if !depth.texture.usage().contains(TextureUsages::TEXTURE_BINDING) {
            continue;
        }
        let seen_from = PoolView {
            clip_from_view: view.clip_from_view,
            world_from_view: view.world_from_view.to_matrix(),
            viewport,
        };
        let around = extracted.surroundings.get(&view_entity);
        let around = around.and_then(|around| Some((around, images.get(around.map)?)));
        let around = around.filter(|(_, map)| is_cube(map));
        let layers = layers.unwrap_or_default();
        let mut pools = Vec::new();
        for pool in extracted.pools.iter().filter(|pool| pool.layers.intersects(layers)) {
            let pixels = seen_from.pixels(pool);
            if pixels.is_empty() || !seen_from.is_above(pool) || textures.get(pool.entity).is_none() {
                continue;
            }
            let middle_m = pool.world_from_pool.transform_point3(pool.wet_m.center().extend(pool.level_m));
            let lights =
                scene.as_ref().map(|scene| strongest_lights(scene, middle_m, &pool.layers)).unwrap_or_default();
            let Some(uniform) = seen_from.uniform(pool, lights, around.map(|(around, _)| around), pixels) else {
                continue;
            };
            let key = PoolPipelineKey {
                target: OrganPipelineKey::of_view(view, camera, msaa, tonemapping, OrganSides::default()),
                has_map: around.is_some(),
                has_foam: !pool.foam.is_empty(),
            };
            let pipeline = pipelines.variants.specialize(&cache, key)?;
            let offset = kept.uniforms.push(&uniform);
            let depth_m = -view.world_from_view.affine().inverse().transform_point3(middle_m).z;
            pools.push((depth_m, pool.entity, pipeline, offset, pixels));
        }
        pools.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        if !pools.is_empty() {
            let map = around.map_or(&fallback.cube, |(_, map)| map);
            found.push((view_entity, view.target_format, viewport, depth, msaa.samples() > 1, map, pools));
        }
    }
    kept.uniforms.write_buffer(&device, &queue);
    let Some(uniforms) = kept.uniforms.binding() else { return Ok(()) };
    let mut count = 0;
    for (view_entity, format, viewport, depth, multisampled, map, pools) in found {
        let copy = copy_of(&mut kept.copies, &device, &depth.texture, format);
        let layout = cache.get_bind_group_layout(&pipelines.layouts[usize::from(multisampled)]);
        let pools = pools.into_iter().filter_map(|(_, entity, pipeline, offset, pixels)| {
            let (surface, ..) = textures.get(entity)?;
            let entries = BindGroupEntries::sequential((
                uniforms.clone(),
                surface,
                &pipelines.sampler,
                &copy.view,
                depth.view(),
                &map.texture_view,
                &map.sampler,
            ));
            let group = device.create_bind_group("pool", &layout, &entries);
            Some(SeenPool { entity, pipeline, group, offset, pixels })
        });
        let pools: Vec<_> = pools.collect();
        count += pools.len() as u64;
        kept.views.insert(view_entity, SeenPools { viewport, copy: copy.texture.clone(), pools });
    }
    kept.copies.retain(|_, copy| copy.is_used);
    if let Some(uploaded) = uploaded {
        uploaded.add(count * PoolUniform::min_size().get());
    }
    Ok(())
}

fn is_cube(map: &GpuImage) -> bool {
    let view = map.texture_view_descriptor.as_ref();
    view.and_then(|view| view.dimension) == Some(TextureViewDimension::Cube)
}

/// The copy for pictures as large as a depth texture.
fn copy_of<'a>(
    copies: &'a mut HashMap<(UVec2, TextureFormat), Copy>,
    device: &RenderDevice,
    depth: &Texture,
    format: TextureFormat,
) -> &'a Copy {
    let size = depth.size();
    let copy = copies.entry((UVec2::new(size.width, size.height), format)).or_insert_with(|| {
        let texture = device.create_texture(&TextureDescriptor {
            label: Some("pool_scene"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format,
            usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Copy { view: texture.create_view(&default()), texture, is_used: true }
    });
    copy.is_used = true;
    copy
}
