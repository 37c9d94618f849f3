//! The pipelines that draw volumes, made when the first volume asks for them.

use super::lattices::DeformUniform;
use super::uniform::VolumeUniform;
use super::views::{COLOUR_FORMAT, DEPTH_FORMAT, RELIEF_FORMAT, START_FORMAT, depth_sum_format};
use crate::organ::render::{OrganLayouts, OrganPipelineKey};
use crate::render::{shader_path, tonemapping_definitions};
use crate::volume::VolumeMethod;
use bevy::core_pipeline::core_3d::CORE_3D_DEPTH_FORMAT;
use bevy::mesh::VertexBufferLayout;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::{
    binding_types::{sampler, texture_2d, texture_3d, texture_depth_2d, texture_depth_2d_multisampled, uniform_buffer},
    *,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderDefVal;

/// Kinds of a volume and of a view that walk through it differently.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) struct WalkVariant {
    /// The view has several samples per pixel.
    pub multisampled: bool,
    /// The voxels have colours of their own.
    pub own_colours: bool,
    /// A lattice deforms it.
    pub deformed: bool,
    /// Light falls on it.
    pub lit: bool,
}

/// What a pipeline is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum PipelineKey {
    /// How far squares of rays pass over nothing.
    Start(WalkVariant),
    /// Rays through the volume.
    March(WalkVariant),
    /// Slices of the volume.
    Slices(WalkVariant),
    /// From blended slices to what a ray leaves.
    Resolve { deformed: bool },
    /// One pass of smoothing.
    Smooth,
    /// Light and reflections.
    Wet,
    /// Into the picture: what is solid with its depth, or what is not.
    Composite { target: OrganPipelineKey, is_solid: bool },
}

/// Layouts and pipelines.
#[derive(Resource)]
pub(super) struct VolumePipelines {
    /// Group 0 of all of them: the view.
    view: BindGroupLayoutDescriptor,
    /// Group 1 of what walks through the volume: its uniform and its textures.
    pub walk: BindGroupLayoutDescriptor,
    /// Group 1 of what works in the picture's plane: its uniform.
    pub plane: BindGroupLayoutDescriptor,
    /// Group 2 of what walks: the scene's depth, of one sample or of several.
    pub scene: [BindGroupLayoutDescriptor; 2],
    /// Group 2 of rays: the scene's depth, and where they start.
    pub march_scene: [BindGroupLayoutDescriptor; 2],
    /// Group 3 of what is deformed: its lattice.
    pub lattice: BindGroupLayoutDescriptor,
    /// Group 2 of the others: as many textures.
    inputs: [BindGroupLayoutDescriptor; 5],
    pub sampler: Sampler,
    depth_sum: TextureFormat,
    shaders: [Handle<Shader>; 7],
    ids: HashMap<PipelineKey, CachedRenderPipelineId>,
}

fn unfiltered() -> BindGroupLayoutEntryBuilder {
    texture_2d(TextureSampleType::Float { filterable: false })
}

pub(super) fn init(
    mut commands: Commands,
    layouts: Res<OrganLayouts>,
    assets: Res<AssetServer>,
    device: Res<RenderDevice>,
) {
    let filtered = || texture_3d(TextureSampleType::Float { filterable: true });
    let uniform = || uniform_buffer::<VolumeUniform>(true);
    let in_fragments = ShaderStages::FRAGMENT;
    let walk = BindGroupLayoutEntries::sequential(
        in_fragments,
        (
            uniform(),
            filtered(),
            filtered(),
            sampler(SamplerBindingType::Filtering),
            unfiltered(),
            filtered(),
            texture_3d(TextureSampleType::Uint),
        ),
    );
    let textures = |count: usize| {
        let all = [unfiltered(); 4];
        let entries: Vec<_> = all[..count.min(4)]
            .iter()
            .enumerate()
            .map(|(binding, entry)| entry.build(binding as u32, in_fragments))
            .collect();
        BindGroupLayoutDescriptor::new("volume_inputs_layout", &entries)
    };
    let scene = |entry: BindGroupLayoutEntryBuilder| {
        BindGroupLayoutDescriptor::new("volume_scene_layout", &BindGroupLayoutEntries::single(in_fragments, entry))
    };
    let march_scene = |entry: BindGroupLayoutEntryBuilder| {
        let entries = BindGroupLayoutEntries::sequential(in_fragments, (entry, unfiltered()));
        BindGroupLayoutDescriptor::new("volume_march_scene_layout", &entries)
    };
    let plane = BindGroupLayoutEntries::single(in_fragments, uniform());
    let lattice = BindGroupLayoutEntries::sequential(
        in_fragments,
        (
            uniform_buffer::<DeformUniform>(false),
            filtered(),
            texture_3d(TextureSampleType::Float { filterable: false }),
        ),
    );
    let shader = |name: &str| assets.load(shader_path(&format!("volume/{name}.wgsl")));
    commands.insert_resource(VolumePipelines {
        view: layouts.view.clone(),
        walk: BindGroupLayoutDescriptor::new("volume_walk_layout", &walk),
        plane: BindGroupLayoutDescriptor::new("volume_plane_layout", &plane),
        scene: [scene(texture_depth_2d()), scene(texture_depth_2d_multisampled())],
        march_scene: [march_scene(texture_depth_2d()), march_scene(texture_depth_2d_multisampled())],
        lattice: BindGroupLayoutDescriptor::new("volume_lattice_layout", &lattice),
        inputs: std::array::from_fn(textures),
        sampler: device.create_sampler(&SamplerDescriptor {
            label: Some("volume"),
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            ..default()
        }),
        depth_sum: depth_sum_format(&device),
        shaders: ["march", "slices", "resolve", "smooth", "wet", "composite", "start"].map(shader),
        ids: HashMap::default(),
    });
}

/// Blending of premultiplied layers over one another, of any number of channels.
const OVER: BlendState = BlendState {
    color: BlendComponent {
        src_factor: BlendFactor::One,
        dst_factor: BlendFactor::OneMinusSrcAlpha,
        operation: BlendOperation::Add,
    },
    alpha: BlendComponent {
        src_factor: BlendFactor::One,
        dst_factor: BlendFactor::OneMinusSrcAlpha,
        operation: BlendOperation::Add,
    },
};

impl PipelineKey {
    /// Whether the pipeline reads a lattice.
    pub fn is_deformed(self) -> bool {
        match self {
            Self::Start(variant) | Self::March(variant) | Self::Slices(variant) => variant.deformed,
            Self::Resolve { deformed } => deformed,
            _ => false,
        }
    }

    /// All that a volume takes in a view.
    fn of_view(method: VolumeMethod, variant: WalkVariant, target: OrganPipelineKey) -> impl Iterator<Item = Self> {
        let (first, second) = match method {
            VolumeMethod::Rays => (Self::March(variant), Some(Self::Start(variant))),
            VolumeMethod::Slices => (Self::Slices(variant), Some(Self::Resolve { deformed: variant.deformed })),
            // Their own pipelines are beside these.
            VolumeMethod::PatchSlices => (Self::Resolve { deformed: variant.deformed }, None),
        };
        let composites = [true, false].map(|is_solid| Self::Composite { target, is_solid });
        [first, Self::Smooth, Self::Wet].into_iter().chain(second).chain(composites)
    }
}

impl VolumePipelines {
    /// Asks for the pipelines that a volume takes in a view, and says whether all of them are there.
    pub fn are_ready(
        &mut self,
        cache: &PipelineCache,
        method: VolumeMethod,
        variant: WalkVariant,
        target: OrganPipelineKey,
    ) -> bool {
        let mut are_ready = true;
        for key in PipelineKey::of_view(method, variant, target) {
            if !self.ids.contains_key(&key) {
                let id = cache.queue_render_pipeline(self.descriptor(key));
                self.ids.insert(key, id);
            }
            are_ready &= self.get(cache, key).is_some();
        }
        are_ready
    }

    /// A pipeline that was asked for, once it is ready.
    pub fn get<'a>(&self, cache: &'a PipelineCache, key: PipelineKey) -> Option<&'a RenderPipeline> {
        cache.get_render_pipeline(*self.ids.get(&key)?)
    }

    /// Layout of group 2 with a number of textures.
    pub fn inputs(&self, count: usize) -> &BindGroupLayoutDescriptor {
        &self.inputs[count]
    }

    fn descriptor(&self, key: PipelineKey) -> RenderPipelineDescriptor {
        let target = |format, blend| Some(ColorTargetState { format, blend, write_mask: ColorWrites::ALL });
        let plain = |format| target(format, None);
        let (label, shader, group_1, group_2, targets) = match key {
            PipelineKey::Start(_) => ("volume_start", 6, &self.walk, &self.inputs[0], vec![plain(START_FORMAT)]),
            PipelineKey::March(variant) => (
                "volume_march",
                0,
                &self.walk,
                &self.march_scene[usize::from(variant.multisampled)],
                vec![plain(COLOUR_FORMAT), plain(RELIEF_FORMAT), plain(DEPTH_FORMAT)],
            ),
            PipelineKey::Slices(variant) => {
                let over = |format| target(format, Some(OVER));
                (
                    "volume_slices",
                    1,
                    &self.walk,
                    &self.scene[usize::from(variant.multisampled)],
                    vec![over(COLOUR_FORMAT), over(COLOUR_FORMAT), over(self.depth_sum)],
                )
            }
            PipelineKey::Resolve { .. } => {
                ("volume_resolve", 2, &self.plane, &self.inputs[3], vec![plain(RELIEF_FORMAT), plain(DEPTH_FORMAT)])
            }
            PipelineKey::Smooth => ("volume_smooth", 3, &self.plane, &self.inputs[1], vec![plain(RELIEF_FORMAT)]),
            PipelineKey::Wet => ("volume_wet", 4, &self.plane, &self.inputs[4], vec![plain(COLOUR_FORMAT)]),
            PipelineKey::Composite { target: into, .. } => {
                ("volume_composite", 5, &self.plane, &self.inputs[2], vec![target(into.format, Some(OVER))])
            }
        };
        let mut definitions: Vec<ShaderDefVal> = Vec::new();
        let mut depth_stencil = None;
        let mut samples = 1;
        match key {
            PipelineKey::Start(variant) | PipelineKey::March(variant) | PipelineKey::Slices(variant) => {
                definitions.extend(variant.multisampled.then(|| "MULTISAMPLED".into()));
                definitions.extend(variant.own_colours.then(|| "OWN_COLOURS".into()));
                definitions.extend(variant.lit.then(|| "LIT".into()));
            }
            PipelineKey::Composite { target, is_solid } => {
                samples = target.samples;
                definitions.extend(tonemapping_definitions(target.tonemapping));
                definitions.extend(is_solid.then(|| "SOLID_PART".into()));
                depth_stencil = Some(DepthStencilState {
                    format: CORE_3D_DEPTH_FORMAT,
                    depth_write_enabled: Some(is_solid),
                    // Bevy's depth is reversed: nearer is greater.
                    depth_compare: Some(CompareFunction::GreaterEqual),
                    stencil: default(),
                    bias: default(),
                });
            }
            PipelineKey::Resolve { .. } | PipelineKey::Smooth | PipelineKey::Wet => {}
        }
        let mut layout = vec![self.view.clone(), group_1.clone(), group_2.clone()];
        if key.is_deformed() {
            definitions.push("DEFORMED".into());
            layout.push(self.lattice.clone());
        }
        let shader_handle = self.shaders[shader].clone();
        let corners = VertexBufferLayout::from_vertex_formats(VertexStepMode::Vertex, [VertexFormat::Float32x4]);
        RenderPipelineDescriptor {
            label: Some(label.into()),
            layout,
            vertex: VertexState {
                shader: shader_handle.clone(),
                shader_defs: definitions.clone(),
                entry_point: Some("vertex".into()),
                buffers: if shader == 1 { vec![corners] } else { Vec::new() },
            },
            fragment: Some(FragmentState {
                shader: shader_handle,
                shader_defs: definitions,
                entry_point: Some("fragment".into()),
                targets,
            }),
            depth_stencil,
            multisample: MultisampleState { count: samples, ..default() },
            ..default()
        }
    }
}
