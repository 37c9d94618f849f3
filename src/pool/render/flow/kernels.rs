//! The kernels of a step, and what each of them is bound to.

use super::uniform::FlowUniform;
use crate::render::shader_path;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderAdapter, RenderDevice};

/// Places of [`KERNELS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Settle,
    Reflect,
    CarryVelocity,
    CorrectVelocity,
    BlurVelocity,
    Push,
    FirstRound,
    Round,
    Subtract,
    Act,
    CarryDissolved,
    CorrectDissolved,
    BlurDissolved,
    CountAgain,
    Gather,
    FinishScale,
    Publish,
    GatherReadings,
    FinishReadings,
}

/// How a kernel uses what is bound.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    Reads,
    Writes,
    Surface,
}

use Use::{Reads, Surface, Writes};

struct KernelText {
    file: &'static str,
    entry: &'static str,
    definition: Option<&'static str>,
    /// Whether there is a faster one for tiles without walls within reach.
    has_deep: bool,
    /// Of group 1.
    bindings: &'static [(u32, Use)],
}

const fn kernel(file: &'static str, entry: &'static str, bindings: &'static [(u32, Use)]) -> KernelText {
    KernelText { file, entry, definition: None, has_deep: false, bindings }
}

const fn with_deep(entry: &'static str, bindings: &'static [(u32, Use)]) -> KernelText {
    KernelText { has_deep: true, ..kernel("carry", entry, bindings) }
}

const fn of_readings(entry: &'static str, bindings: &'static [(u32, Use)]) -> KernelText {
    KernelText { definition: Some("READINGS"), ..kernel("sums", entry, bindings) }
}

/// In the order of [`Kernel`].
const KERNELS: [KernelText; 19] = [
    kernel("settle", "settle", &[(0, Writes), (1, Writes), (2, Writes), (3, Surface)]),
    kernel("project", "reflect", &[(0, Reads), (1, Reads), (3, Reads), (5, Writes)]),
    with_deep("carry_velocity", &[(0, Reads), (1, Reads), (2, Writes)]),
    with_deep("correct_velocity", &[(0, Reads), (1, Reads), (2, Writes), (3, Reads)]),
    kernel("diffuse", "blur_velocity", &[(0, Reads), (1, Reads), (2, Writes)]),
    kernel("act", "push", &[(0, Reads), (1, Reads), (2, Writes), (5, Reads)]),
    kernel("project", "first_round", &[(0, Reads), (1, Reads), (2, Writes), (3, Reads), (4, Writes)]),
    kernel("project", "round", &[(0, Reads), (1, Reads), (2, Writes), (4, Reads)]),
    kernel("project", "subtract", &[(0, Reads), (1, Reads), (2, Writes), (3, Writes), (5, Reads)]),
    kernel("act", "act", &[(0, Reads), (2, Writes), (3, Writes), (4, Reads), (5, Reads)]),
    with_deep("carry_dissolved", &[(0, Reads), (1, Reads), (2, Writes), (4, Reads), (5, Writes)]),
    with_deep("correct_dissolved", &[(0, Reads), (1, Reads), (2, Writes), (3, Reads), (4, Reads), (5, Writes)]),
    kernel("diffuse", "blur_dissolved", &[(0, Reads), (1, Reads), (2, Writes)]),
    kernel("diffuse", "count_again", &[(0, Reads), (1, Writes)]),
    kernel("sums", "gather", &[(0, Reads), (1, Writes)]),
    kernel("sums", "finish", &[(1, Writes), (2, Writes)]),
    kernel("publish", "publish", &[(0, Reads), (1, Reads), (2, Reads), (3, Reads), (4, Writes), (5, Surface)]),
    of_readings("gather", &[(0, Reads), (1, Writes)]),
    of_readings("finish", &[(1, Writes), (2, Writes)]),
];

/// Format of the published texture.
pub(super) const SURFACE_FORMAT: TextureFormat = TextureFormat::Rgba16Float;

struct KernelPipelines {
    layout: BindGroupLayoutDescriptor,
    /// For all tiles, or for those beside walls.
    all: CachedComputePipelineId,
    /// For deep tiles.
    deep: Option<CachedComputePipelineId>,
}

#[derive(Resource)]
pub(super) struct FlowPipelines {
    /// Group 0 of all kernels.
    common: BindGroupLayoutDescriptor,
    kernels: Vec<KernelPipelines>,
}

/// The pipelines, when all are there.
pub(super) struct ReadyKernels<'a> {
    pub common: BindGroupLayout,
    cache: &'a PipelineCache,
    kernels: Vec<(&'a ComputePipeline, Option<&'a ComputePipeline>)>,
    pipelines: &'a FlowPipelines,
}

impl FlowPipelines {
    /// Nothing until every pipeline is made.
    pub fn ready<'a>(&'a self, cache: &'a PipelineCache) -> Option<ReadyKernels<'a>> {
        let pair = |kernel: &KernelPipelines| {
            let all = cache.get_compute_pipeline(kernel.all)?;
            match kernel.deep {
                Some(deep) => Some((all, Some(cache.get_compute_pipeline(deep)?))),
                None => Some((all, None)),
            }
        };
        let kernels = self.kernels.iter().map(pair).collect::<Option<Vec<_>>>()?;
        Some(ReadyKernels { common: cache.get_bind_group_layout(&self.common), cache, kernels, pipelines: self })
    }
}

impl ReadyKernels<'_> {
    /// The pipelines of a kernel: for all tiles or those beside walls, and for deep ones.
    pub fn get(&self, kernel: Kernel) -> (&ComputePipeline, Option<&ComputePipeline>) {
        self.kernels[kernel as usize]
    }

    pub fn layout(&self, kernel: Kernel) -> BindGroupLayout {
        self.cache.get_bind_group_layout(&self.pipelines.kernels[kernel as usize].layout)
    }

    /// Entries of a kernel's group 1 for resources in the order of its bindings.
    pub fn entries<'r>(kernel: Kernel, resources: &[BindingResource<'r>]) -> Vec<BindGroupEntry<'r>> {
        let bindings = KERNELS[kernel as usize].bindings;
        debug_assert_eq!(bindings.len(), resources.len(), "{kernel:?}");
        let pairs = bindings.iter().zip(resources);
        pairs.map(|((binding, _), resource)| BindGroupEntry { binding: *binding, resource: resource.clone() }).collect()
    }
}

pub(super) fn init_pipelines(
    mut commands: Commands,
    assets: Res<AssetServer>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    adapter: Res<RenderAdapter>,
) {
    // The main world says so.
    if super::check(&device, &adapter).is_err() {
        return;
    }
    let stage = ShaderStages::COMPUTE;
    let common = BindGroupLayoutDescriptor::new(
        "pool_flow_layout",
        &BindGroupLayoutEntries::sequential(
            stage,
            (
                uniform_buffer::<FlowUniform>(true),
                storage_buffer_read_only_sized(false, None),
                storage_buffer_read_only_sized(false, None),
            ),
        ),
    );
    let kernels = KERNELS.iter().map(|text| {
        let entries = text.bindings.iter().map(|(binding, used)| {
            let entry = match used {
                Reads => storage_buffer_read_only_sized(false, None),
                Writes => storage_buffer_sized(false, None),
                Surface => texture_storage_2d(SURFACE_FORMAT, StorageTextureAccess::WriteOnly),
            };
            entry.build(*binding, stage)
        });
        let layout = BindGroupLayoutDescriptor::new(text.entry, &entries.collect::<Vec<_>>());
        let queue = |definition: Option<&'static str>| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("pool_{}_pipeline", text.entry).into()),
                layout: vec![common.clone(), layout.clone()],
                shader: assets.load(shader_path(&format!("pool/{}.wgsl", text.file))),
                shader_defs: definition.iter().map(|name| (*name).into()).collect(),
                entry_point: Some(text.entry.into()),
                ..default()
            })
        };
        let all = queue(text.definition);
        let deep = text.has_deep.then(|| queue(Some("DEEP")));
        KernelPipelines { all, deep, layout }
    });
    let kernels = kernels.collect();
    commands.insert_resource(FlowPipelines { common, kernels });
}
