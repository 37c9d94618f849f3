//! The pipelines of aligned slices.

use super::super::uniform::VolumeUniform;
use super::super::views::COLOUR_FORMAT;
use super::HIDDEN_FORMAT;
use super::view::AlignedUniform;
use crate::organ::render::OrganLayouts;
use crate::render::shader_path;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::{
    binding_types::{
        sampler, storage_buffer_read_only_sized, texture_2d, texture_3d, texture_depth_2d,
        texture_depth_2d_multisampled, uniform_buffer,
    },
    *,
};
use bevy::shader::ShaderDefVal;

/// What a pipeline is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in super::super) enum AlignedKey {
    /// Slices.
    Slices { own_colours: bool, clipped: bool, normals: bool },
    /// The depth of the scene.
    Scene { multisampled: bool },
    /// Pixels through which nothing shines any more.
    Finished,
}

/// Layouts and pipelines.
#[derive(Resource)]
pub(in super::super) struct AlignedPipelines {
    view: BindGroupLayoutDescriptor,
    /// Group 1 of the slices: uniforms, textures of the volume, polygons.
    pub body: BindGroupLayoutDescriptor,
    /// Group 1 of the others: the volume's uniform.
    pub plane: BindGroupLayoutDescriptor,
    /// Group 2: the scene's depth, of one sample or of several.
    pub scene: [BindGroupLayoutDescriptor; 2],
    /// Group 2: what was gathered.
    pub gathered: BindGroupLayoutDescriptor,
    shaders: [Handle<Shader>; 2],
    ids: HashMap<AlignedKey, CachedRenderPipelineId>,
    /// Four triangles around the middle of each polygon.
    pub indices: Buffer,
}

/// Polygons of a draw call: as many as 16 bits can number the vertices of.
pub(super) const POLYGONS_AT_ONCE: u32 = 13_107;

/// Vertices of a polygon's triangles.
const TRIANGLES: [u16; 12] = [0, 1, 4, 1, 3, 4, 3, 2, 4, 2, 0, 4];

pub(in super::super) fn init(
    mut commands: Commands,
    layouts: Res<OrganLayouts>,
    assets: Res<AssetServer>,
    device: Res<bevy::render::renderer::RenderDevice>,
) {
    let (in_both, in_fragments, in_vertices) =
        (ShaderStages::VERTEX_FRAGMENT, ShaderStages::FRAGMENT, ShaderStages::VERTEX);
    let filtered = || texture_3d(TextureSampleType::Float { filterable: true });
    let unfiltered = || texture_2d(TextureSampleType::Float { filterable: false });
    let stored = || storage_buffer_read_only_sized(false, None);
    let body = [
        uniform_buffer::<VolumeUniform>(true).build(0, in_both),
        filtered().build(1, in_fragments),
        filtered().build(2, in_fragments),
        sampler(SamplerBindingType::Filtering).build(3, in_fragments),
        unfiltered().build(4, in_fragments),
        filtered().build(5, in_fragments),
        uniform_buffer::<AlignedUniform>(false).build(7, in_both),
        stored().build(8, in_vertices),
        stored().build(9, in_vertices),
        stored().build(10, in_vertices),
        stored().build(11, in_vertices),
    ];
    let single = |label: &'static str, entry: BindGroupLayoutEntryBuilder| {
        BindGroupLayoutDescriptor::new(label, &BindGroupLayoutEntries::single(in_fragments, entry))
    };
    let indices: Vec<u16> =
        (0..POLYGONS_AT_ONCE as u16).flat_map(|polygon| TRIANGLES.map(|n| polygon * 5 + n)).collect();
    commands.insert_resource(AlignedPipelines {
        view: layouts.view.clone(),
        body: BindGroupLayoutDescriptor::new("volume_aligned_layout", &body),
        plane: single("volume_plane_layout", uniform_buffer::<VolumeUniform>(true)),
        scene: [
            single("volume_scene_layout", texture_depth_2d()),
            single("volume_scene_layout", texture_depth_2d_multisampled()),
        ],
        gathered: single("volume_gathered_layout", unfiltered()),
        shaders: ["aligned", "hidden"].map(|name| assets.load(shader_path(&format!("volume/{name}.wgsl")))),
        ids: HashMap::default(),
        indices: device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("volume_polygon_triangles"),
            contents: bytemuck::cast_slice(&indices),
            usage: BufferUsages::INDEX,
        }),
    });
}

/// Blending of premultiplied layers under those before them.
const UNDER: BlendState = {
    let component = BlendComponent {
        src_factor: BlendFactor::OneMinusDstAlpha,
        dst_factor: BlendFactor::One,
        operation: BlendOperation::Add,
    };
    BlendState { color: component, alpha: component }
};

impl AlignedPipelines {
    /// Asks for pipelines, and says whether all of them are there.
    pub fn are_ready(&mut self, cache: &PipelineCache, slices: AlignedKey, multisampled: bool) -> bool {
        let mut are_ready = true;
        for key in [slices, AlignedKey::Scene { multisampled }, AlignedKey::Finished] {
            if !self.ids.contains_key(&key) {
                let id = cache.queue_render_pipeline(self.descriptor(key));
                self.ids.insert(key, id);
            }
            are_ready &= self.get(cache, key).is_some();
        }
        are_ready
    }

    /// A pipeline that was asked for, once it is ready.
    pub fn get<'a>(&self, cache: &'a PipelineCache, key: AlignedKey) -> Option<&'a RenderPipeline> {
        cache.get_render_pipeline(*self.ids.get(&key)?)
    }

    fn descriptor(&self, key: AlignedKey) -> RenderPipelineDescriptor {
        let mut definitions: Vec<ShaderDefVal> = Vec::new();
        let mut define = |is_on: bool, name: &str| definitions.extend(is_on.then(|| name.into()));
        let under =
            || Some(ColorTargetState { format: COLOUR_FORMAT, blend: Some(UNDER), write_mask: ColorWrites::ALL });
        let (label, shader, group_1, group_2, targets) = match key {
            AlignedKey::Slices { own_colours, clipped, normals } => {
                define(own_colours, "OWN_COLOURS");
                define(clipped, "CLIPPED");
                define(normals, "NORMALS");
                ("volume_aligned", 0, &self.body, None, vec![under(); if normals { 3 } else { 2 }])
            }
            AlignedKey::Scene { multisampled } => {
                define(true, "SCENE");
                define(multisampled, "MULTISAMPLED");
                ("volume_hidden", 1, &self.plane, Some(&self.scene[usize::from(multisampled)]), Vec::new())
            }
            AlignedKey::Finished => ("volume_finished", 1, &self.plane, Some(&self.gathered), Vec::new()),
        };
        let is_slices = matches!(key, AlignedKey::Slices { .. });
        let shader = self.shaders[shader].clone();
        RenderPipelineDescriptor {
            label: Some(label.into()),
            layout: [&self.view, group_1].into_iter().chain(group_2).cloned().collect(),
            vertex: VertexState {
                shader: shader.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                buffers: Vec::new(),
            },
            fragment: Some(FragmentState {
                shader,
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets,
            }),
            depth_stencil: Some(DepthStencilState {
                format: HIDDEN_FORMAT,
                depth_write_enabled: Some(!is_slices),
                // Bevy's depth is reversed: nearer is greater.
                depth_compare: Some(if is_slices { CompareFunction::GreaterEqual } else { CompareFunction::Always }),
                stencil: default(),
                bias: default(),
            }),
            ..default()
        }
    }
}
