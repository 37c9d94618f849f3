//! A layer that is drawn on organs: its pipelines, and the pass itself.
//!
//! The crate's own layers are made of this, and so is one of yours (the example `own_layer`): name it with a marker
//! type, insert an [`OrganLayer`] in `RenderStartup` after [`PrepareOrgans`](super::PrepareOrgans), add
//! [`prepare_layer_pipelines`] to [`RenderSystems::PrepareResources`](bevy::render::RenderSystems::PrepareResources), and call [`OrganDraw::draw`] in a
//! system of `Core3d` between two of [`OrganPasses`](crate::render::OrganPasses).

use super::extract::{ExtractedOrgan, ExtractedOrgans};
use super::prepare::{
    GpuOrganModel, OrganBindGroups, OrganLayouts, OrganPipelineKey, OrganSides, organ_pipeline_descriptor,
};
use crate::organ::Organ;
use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ExtractedView, RenderVisibleEntities, ViewDepthTexture, ViewTarget, ViewUniformOffset};
use std::marker::PhantomData;

/// The pipelines of a layer, made as views ask for them. `L` names the layer.
#[derive(Resource)]
pub struct OrganLayer<L> {
    /// Layouts of its own bind groups, from group 2 on.
    pub own_groups: Vec<BindGroupLayoutDescriptor>,
    variants: Variants<RenderPipeline, LayerSpecializer>,
    marker: PhantomData<fn() -> L>,
}

struct LayerSpecializer {
    blend: Option<BlendState>,
}

impl Specializer<RenderPipeline> for LayerSpecializer {
    type Key = OrganPipelineKey;

    fn specialize(
        &self,
        key: OrganPipelineKey,
        descriptor: &mut RenderPipelineDescriptor,
    ) -> Result<Canonical<OrganPipelineKey>, BevyError> {
        key.apply(descriptor);
        let target = ColorTargetState { format: key.format, blend: self.blend, write_mask: ColorWrites::ALL };
        descriptor.fragment_mut()?.set_target(0, target);
        Ok(key)
    }
}

impl<L> OrganLayer<L> {
    /// A layer whose shader has the entry points `vertex` and `fragment`. Without `blend` it covers what is below and
    /// writes depth, as only the first layer should.
    pub fn new(
        label: &'static str,
        layouts: &OrganLayouts,
        own_groups: Vec<BindGroupLayoutDescriptor>,
        shader: Handle<Shader>,
        blend: Option<BlendState>,
    ) -> Self {
        let descriptor = organ_pipeline_descriptor(label, layouts, &own_groups, shader, blend.is_none());
        let variants = Variants::new(LayerSpecializer { blend }, descriptor);
        Self { own_groups, variants, marker: PhantomData }
    }
}

/// The pipelines of a layer in a view, one for each of [`OrganSides::ALL`].
#[derive(Component)]
pub struct OrganLayerPipelines<L> {
    ids: [CachedRenderPipelineId; 3],
    marker: PhantomData<fn() -> L>,
}

/// Asks for the pipelines that the views need.
pub fn prepare_layer_pipelines<L: Send + Sync + 'static>(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    mut layer: ResMut<OrganLayer<L>>,
    views: Query<(Entity, &ExtractedView, &ExtractedCamera, &Msaa, Option<&Tonemapping>)>,
) -> Result {
    for (entity, view, camera, msaa, tonemapping) in &views {
        let mut id = |sides| {
            let key = OrganPipelineKey::of_view(view, camera, msaa, tonemapping, sides);
            layer.variants.specialize(&cache, key)
        };
        let [outside, mirrored, both] = OrganSides::ALL;
        let ids = [id(outside)?, id(mirrored)?, id(both)?];
        commands.entity(entity).insert(OrganLayerPipelines::<L> { ids, marker: PhantomData });
    }
    Ok(())
}

/// What drawing a layer needs of a view.
#[derive(QueryData)]
pub struct OrganLayerView<L: Send + Sync + 'static> {
    camera: &'static ExtractedCamera,
    view: &'static ExtractedView,
    target: &'static ViewTarget,
    depth: &'static ViewDepthTexture,
    offset: &'static ViewUniformOffset,
    visible: &'static RenderVisibleEntities,
    pipelines: &'static OrganLayerPipelines<L>,
    resolution: Option<&'static MainPassResolutionOverride>,
}

/// What a layer draws on an organ.
#[derive(Clone, Copy)]
pub struct OrganPart<'a> {
    /// Group 2 of its pipeline.
    pub group: &'a BindGroup,
    /// Indices (`u32`, three per triangle) of the skin triangles that it covers, and how many; `None` for all of them.
    pub indices: Option<(&'a Buffer, u32)>,
}

impl<'a> From<&'a BindGroup> for OrganPart<'a> {
    fn from(group: &'a BindGroup) -> Self {
        Self { group, indices: None }
    }
}

/// Draws layers on the organs that a camera sees; a parameter of systems in `Core3d`.
#[derive(SystemParam)]
pub struct OrganDraw<'w> {
    organs: Res<'w, ExtractedOrgans>,
    models: Res<'w, RenderAssets<GpuOrganModel>>,
    groups: Res<'w, OrganBindGroups>,
    cache: Res<'w, PipelineCache>,
}

impl OrganDraw<'_> {
    /// Draws a layer on the organs of a view that have a part in it; near ones first, and what surrounds the camera
    /// last, so that hidden pixels cost a depth test and no shading.
    pub fn draw<'a, L: Send + Sync + 'static, P: Into<OrganPart<'a>>>(
        &'a self,
        label: &'static str,
        view: ViewQuery<OrganLayerView<L>>,
        ctx: &mut RenderContext,
        part_of: impl Fn(MainEntity) -> Option<P>,
    ) {
        let view_entity = view.entity();
        let view = view.into_inner();
        let (Some(view_group), Some(visible)) = (self.groups.view(view_entity), view.visible.get::<Organ>()) else {
            return;
        };
        let mut drawable: Vec<_> = visible
            .entities_cpu_culling
            .iter()
            .filter_map(|&(_, entity)| {
                let place = self.organs.organs.binary_search_by_key(&entity, |organ| organ.entity).ok()?;
                let organ = &self.organs.organs[place];
                let part: OrganPart = part_of(entity)?.into();
                let model = self.models.get(organ.model)?;
                let pipeline = self.cache.get_render_pipeline(view.pipelines.ids[organ.sides as usize])?;
                Some((organ, pipeline, model, self.groups.organ(entity)?, part))
            })
            .collect();
        if drawable.is_empty() {
            return;
        }
        let eye = view.view.world_from_view.translation();
        drawable.sort_by(|(a, ..), (b, ..)| {
            let distance = |organ: &ExtractedOrgan| organ.centre_world_m.distance_squared(eye);
            let surrounds = |organ: &ExtractedOrgan| organ.sides == OrganSides::Both;
            surrounds(a).cmp(&surrounds(b)).then(distance(a).total_cmp(&distance(b)))
        });
        let diagnostics = ctx.diagnostic_recorder();
        let diagnostics = diagnostics.as_deref();
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some(label),
            color_attachments: &[Some(view.target.get_color_attachment())],
            depth_stencil_attachment: Some(view.depth.get_attachment(StoreOp::Store)),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        let span = diagnostics.pass_span(&mut pass, label);
        if let Some(viewport) = Viewport::from_viewport_and_override(view.camera.viewport.as_ref(), view.resolution) {
            pass.set_camera_viewport(&viewport);
        }
        for (_, pipeline, model, (organ_group, organ_offset), part) in drawable {
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, view_group, &[view.offset.offset]);
            pass.set_bind_group(1, organ_group, &[organ_offset]);
            pass.set_bind_group(2, part.group, &[]);
            pass.set_vertex_buffer(0, model.corners.slice(..));
            let (indices, count) = part.indices.unwrap_or((&model.indices, model.index_count));
            pass.set_index_buffer(indices.slice(..), IndexFormat::Uint32);
            pass.draw_indexed(0..count, 0, 0..1);
        }
        span.end(&mut pass);
    }
}
