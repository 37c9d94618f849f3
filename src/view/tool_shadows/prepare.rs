//! What a camera needs to be darkened: kept depth, uniforms, pipelines, and the part of the picture that shadows can
//! reach.

use super::lens::ShadowLens;
use super::map::{Reach, ToolShadowMaps};
use crate::render::{Uploads, shader_path};
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    binding_types::{texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer},
    *,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, ViewDepthTexture};
use std::collections::BTreeMap;

/// A lamp in a view, as the shader reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq, ShaderType)]
pub struct ToolShadowUniform {
    /// Clip space of the view to clip space of the lamp.
    pub lamp_from_clip: Mat4,
    /// Texels beyond which nothing casts: least x, y, greatest x, y.
    pub reach_px: Vec4,
    /// Radius of the look-ups at the lamp's near distance, texels.
    pub radius_at_near_px: f32,
    /// Bounds of that radius, texels.
    pub least_radius_px: f32,
    /// See [`ToolShadowUniform::least_radius_px`].
    pub greatest_radius_px: f32,
    /// Share of the light that a full shadow takes.
    pub strength: f32,
    /// Width and height of the map, texels.
    pub resolution_px: f32,
}

#[derive(Resource)]
pub(super) struct ApplyPipeline {
    layout: BindGroupLayoutDescriptor,
    layout_multisampled: BindGroupLayoutDescriptor,
    variants: Variants<RenderPipeline, ApplySpecializer>,
}

struct ApplySpecializer {
    layout_multisampled: BindGroupLayoutDescriptor,
}

#[derive(PartialEq, Eq, Hash, Clone, Copy, SpecializerKey)]
struct ApplyKey {
    format: TextureFormat,
    samples: u32,
}

impl Specializer<RenderPipeline> for ApplySpecializer {
    type Key = ApplyKey;

    fn specialize(
        &self,
        key: ApplyKey,
        descriptor: &mut RenderPipelineDescriptor,
    ) -> Result<Canonical<ApplyKey>, BevyError> {
        descriptor.multisample.count = key.samples;
        if key.samples > 1 {
            descriptor.set_layout(0, self.layout_multisampled.clone());
            descriptor.vertex.shader_defs.push("MULTISAMPLED".into());
            descriptor.fragment_mut()?.shader_defs.push("MULTISAMPLED".into());
        }
        let component =
            |dst_factor| BlendComponent { src_factor: BlendFactor::Zero, dst_factor, operation: BlendOperation::Add };
        descriptor.fragment_mut()?.set_target(
            0,
            ColorTargetState {
                format: key.format,
                blend: Some(BlendState { color: component(BlendFactor::SrcAlpha), alpha: component(BlendFactor::One) }),
                write_mask: ColorWrites::ALL,
            },
        );
        Ok(key)
    }
}

pub(super) fn init_pipeline(mut commands: Commands, assets: Res<AssetServer>) {
    let layout = BindGroupLayoutDescriptor::new(
        "tool_shadows_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<ToolShadowUniform>(true).visibility(ShaderStages::VERTEX_FRAGMENT),
                texture_depth_2d(),
                texture_depth_2d(),
                texture_depth_2d(),
            ),
        ),
    );
    let layout_multisampled = BindGroupLayoutDescriptor::new(
        "tool_shadows_multisampled_layout",
        &BindGroupLayoutEntries::sequential(
            ShaderStages::FRAGMENT,
            (
                uniform_buffer::<ToolShadowUniform>(true).visibility(ShaderStages::VERTEX_FRAGMENT),
                texture_depth_2d(),
                texture_depth_2d_multisampled(),
                texture_depth_2d_multisampled(),
            ),
        ),
    );
    let shader: Handle<Shader> = assets.load(shader_path("view/tool_shadows.wgsl"));
    let descriptor = RenderPipelineDescriptor {
        label: Some("tool_shadows_pipeline".into()),
        layout: vec![layout.clone()],
        vertex: VertexState { shader: shader.clone(), entry_point: Some("vertex".into()), ..default() },
        fragment: Some(FragmentState { shader, entry_point: Some("fragment".into()), ..default() }),
        ..default()
    };
    let specializer = ApplySpecializer { layout_multisampled: layout_multisampled.clone() };
    commands.insert_resource(ApplyPipeline {
        layout,
        layout_multisampled,
        variants: Variants::new(specializer, descriptor),
    });
}

/// A lamp whose shadows a view may show.
pub(super) struct ViewLamp {
    pub lamp: MainEntity,
    pub group: BindGroup,
    pub offset: u32,
    /// The part of the target that its shadows can reach, pixels.
    pub scissor: URect,
}

/// A view in which there may be shadows.
pub(super) struct ViewShadows {
    pub pipeline: CachedRenderPipelineId,
    pub viewport: Option<Viewport>,
    /// The view's depth before anything of this crate was drawn.
    pub kept: Texture,
    pub lamps: Vec<ViewLamp>,
}

struct KeptDepth {
    texture: Texture,
    view: TextureView,
    is_used: bool,
}

/// The views of this frame in which there may be shadows.
#[derive(Resource, Default)]
pub(super) struct ToolShadowViews {
    pub views: BTreeMap<Entity, ViewShadows>,
    // By width, height and samples: cameras are drawn one after the other, so those of a kind share one.
    kept: BTreeMap<(u32, u32, u32), KeptDepth>,
    uniforms: DynamicUniformBuffer<ToolShadowUniform>,
}

type View = (
    Entity,
    &'static ExtractedView,
    &'static ExtractedCamera,
    &'static ViewDepthTexture,
    &'static Msaa,
    Option<&'static RenderLayers>,
    Option<&'static MainPassResolutionOverride>,
);

pub(super) fn prepare_views(
    mut shadows: ResMut<ToolShadowViews>,
    maps: Res<ToolShadowMaps>,
    mut pipeline: ResMut<ApplyPipeline>,
    views: Query<View>,
    cache: Res<PipelineCache>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) -> Result {
    let shadows = &mut *shadows;
    shadows.views.clear();
    shadows.uniforms.clear();
    shadows.kept.values_mut().for_each(|kept| kept.is_used = false);
    if maps.lamps.is_empty() {
        shadows.kept.clear();
        return Ok(());
    }
    // What each view shows, before the uniforms have a buffer.
    let mut found = Vec::new();
    for (entity, view, camera, depth, msaa, layers, resolution) in &views {
        let usage = depth.texture.usage();
        let layers = layers.unwrap_or_default();
        let viewport = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution);
        let area = viewport.as_ref().map(|viewport| {
            let least = viewport.physical_position;
            URect::from_corners(least, least + viewport.physical_size)
        });
        let size = depth.texture.size();
        let target = URect::new(0, 0, size.width, size.height);
        let area = area.unwrap_or(target).intersect(target);
        // A frame in which a camera learns that its depth is to be read still has the old texture.
        if !usage.contains(TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC) || area.is_empty() {
            continue;
        }
        let clip_from_world =
            view.clip_from_world.unwrap_or_else(|| view.clip_from_view * view.world_from_view.to_matrix().inverse());
        let reached = maps.lamps.iter().filter(|(_, map)| map.layers.intersects(layers)).filter_map(|(lamp, map)| {
            let scissor = scissor(&map.lens, &map.reach, clip_from_world, area)?;
            let (least_radius_px, greatest_radius_px) = map.lens.radius_bounds_px();
            let reach = map.reach.texels;
            let uniform = ToolShadowUniform {
                lamp_from_clip: map.lens.clip_from_view_clip(clip_from_world),
                reach_px: Vec4::from((reach.min, reach.max)),
                radius_at_near_px: map.lens.radius_at_near_px(),
                least_radius_px,
                greatest_radius_px,
                strength: map.lens.strength,
                resolution_px: map.lens.resolution_px as f32,
            };
            Some((*lamp, uniform, scissor, &map.view))
        });
        let lamps: Vec<_> = reached
            .map(|(lamp, uniform, scissor, map)| (lamp, shadows.uniforms.push(&uniform), scissor, map))
            .collect();
        if !lamps.is_empty() {
            let samples = msaa.samples();
            let id = pipeline.variants.specialize(&cache, ApplyKey { format: view.target_format, samples })?;
            found.push((entity, id, viewport, depth, samples, lamps));
        }
    }
    shadows.uniforms.write_buffer(&device, &queue);
    let Some(binding) = shadows.uniforms.binding() else { return Ok(()) };
    let mut count = 0;
    for (entity, id, viewport, depth, samples, lamps) in found {
        let size = depth.texture.size();
        let kept = shadows.kept.entry((size.width, size.height, samples)).or_insert_with(|| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some("tool_shadows_kept_depth"),
                size,
                mip_level_count: 1,
                sample_count: samples,
                dimension: TextureDimension::D2,
                format: CORE_3D_DEPTH_FORMAT,
                // A multisampled texture must be something to draw into.
                usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            KeptDepth { view: texture.create_view(&default()), texture, is_used: true }
        });
        kept.is_used = true;
        let layout = if samples > 1 { &pipeline.layout_multisampled } else { &pipeline.layout };
        let layout = cache.get_bind_group_layout(layout);
        let lamps = lamps.into_iter().map(|(lamp, offset, scissor, map)| {
            let entries = BindGroupEntries::sequential((binding.clone(), map, depth.view(), &kept.view));
            ViewLamp { lamp, group: device.create_bind_group("tool_shadows", &layout, &entries), offset, scissor }
        });
        let lamps: Vec<_> = lamps.collect();
        count += lamps.len() as u64;
        shadows.views.insert(entity, ViewShadows { pipeline: id, viewport, kept: kept.texture.clone(), lamps });
    }
    shadows.kept.retain(|_, kept| kept.is_used);
    if let Some(uploaded) = uploaded {
        uploaded.add(count * ToolShadowUniform::min_size().get());
    }
    Ok(())
}

/// The part of a view's area in which a lamp's shadows can lie, pixels; `None` where there are none.
fn scissor(lens: &ShadowLens, reach: &Reach, clip_from_world: Mat4, area: URect) -> Option<URect> {
    if reach.texels.is_empty() {
        return None;
    }
    let (least, greatest) = (reach.texels.min, reach.texels.max);
    let mut ndc = Rect::EMPTY;
    // Shadows fill a frustum: from the nearest caster to infinity, where its corners are directions.
    for texel in [least, greatest, Vec2::new(least.x, greatest.y), Vec2::new(greatest.x, least.y)] {
        let near = lens.point_world_m(texel, reach.nearest_m).extend(1.0);
        for corner in [near, lens.direction_world(texel).extend(0.0)] {
            let clip = clip_from_world * corner;
            // Towards or behind the eye: anywhere.
            if clip.w < 1e-6 {
                return Some(area);
            }
            ndc = ndc.union_point(clip.truncate().truncate() / clip.w);
        }
    }
    let size = area.size().as_vec2();
    let pixel = |ndc: Vec2| (ndc * Vec2::new(0.5, -0.5) + 0.5) * size;
    let pixels = Rect::from_corners(pixel(ndc.min), pixel(ndc.max)).intersect(Rect::from_corners(Vec2::ZERO, size));
    // One more on each side for rounding.
    let (from, to) = (pixels.min.floor() - 1.0, pixels.max.ceil() + 1.0);
    let to_target = |place: Vec2| area.min + place.clamp(Vec2::ZERO, size).as_uvec2();
    (!pixels.is_empty()).then(|| URect::from_corners(to_target(from), to_target(to)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scissor_holds_every_shadow_that_can_be_seen() {
        let lamp = Transform::from_xyz(0.05, 0.2, 0.1).looking_at(Vec3::ZERO, Vec3::Y);
        let lens = ShadowLens {
            world_from_lamp: lamp.compute_affine(),
            tan_half_angle: 0.3,
            near_m: 0.01,
            resolution_px: 256,
            softness_m: 0.001,
            strength: 1.0,
        };
        let texels = Rect::new(100.0, 90.0, 130.0, 160.0);
        let reach = Reach { texels, nearest_m: 0.12 };
        let area = URect::new(400, 10, 720, 250);
        let clip_from_view = Mat4::perspective_infinite_reverse_rh(1.0, 320.0 / 240.0, 0.01);
        let (mut inside, mut smaller) = (0, 0);
        for eye in [Vec3::new(0.0, 0.3, 0.1), Vec3::new(-0.2, 0.05, 0.3), Vec3::new(0.05, 0.19, 0.1), Vec3::Y] {
            let view = Transform::from_translation(eye).looking_at(Vec3::new(0.01, 0.0, 0.01), Vec3::X);
            let clip_from_world = clip_from_view * view.to_matrix().inverse();
            let found = scissor(&lens, &reach, clip_from_world, area);
            smaller += u32::from(found.is_some_and(|found| found.size().element_product() < 38_400));
            for step in 0..1000 {
                let share = |divisor: u32| (step / divisor % 10) as f32 / 9.0;
                let texel = texels.min + texels.size() * Vec2::new(share(1), share(10));
                let point = lens.point_world_m(texel, reach.nearest_m + 0.5 * share(100));
                let clip = clip_from_world * point.extend(1.0);
                let ndc = clip.truncate().truncate() / clip.w;
                if clip.w > 0.0 && ndc.abs().max_element() < 1.0 {
                    let pixel = (ndc * Vec2::new(0.5, -0.5) + 0.5) * area.size().as_vec2();
                    let pixel = area.min + pixel.as_uvec2();
                    assert!(found.is_some_and(|found| found.contains(pixel)), "{pixel} of {eye} is not in {found:?}");
                    inside += 1;
                }
            }
        }
        assert!(inside > 500 && smaller > 0, "{inside} points were seen, {smaller} scissors save work");
        let empty = Reach { texels: Rect::EMPTY, ..reach };
        assert_eq!(scissor(&lens, &empty, clip_from_view, area), None);
    }
}
