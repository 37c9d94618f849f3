//! Lattices that deform volumes, on their way to the GPU: each frame only what moved of them, some kilobytes.

use super::extract::ExtractedVolumes;
use crate::deform::{DeformLattice, NormalDeformation};
use crate::render::Uploads;
use crate::volume::lattice::voxel_from_box;
use crate::volume::{VolumeGrid, VoxelLattice};
use bevy::math::{DAffine3, DVec3};
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use half::f16;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Voxel coordinates between which a lattice shows some of the matter that rests in a box.
pub(super) fn shown_box(lattice: &DeformLattice, grid: &VolumeGrid, low: Vec3, high: Vec3) -> (Vec3, Vec3) {
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    shown_boxes(lattice, grid, low, high).fold(none, |all, one| (all.0.min(one.0), all.1.max(one.1)))
}

/// The same as one box for each patch that may show some of it.
pub(super) fn shown_boxes(
    lattice: &DeformLattice,
    grid: &VolumeGrid,
    low: Vec3,
    high: Vec3,
) -> impl Iterator<Item = (Vec3, Vec3)> {
    let voxel_from_box = voxel_from_box(lattice, grid);
    let around = |matrix: &DAffine3, low: DVec3, high: DVec3| {
        let corners = (0..8).map(|n: usize| {
            let side = |axis: usize| if n >> axis & 1 == 0 { low[axis] } else { high[axis] };
            matrix.transform_point3(DVec3::new(side(0), side(1), side(2)))
        });
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |all, at| (all.0.min(at), all.1.max(at)))
    };
    let is_empty = low.cmpgt(high).any();
    let (low, high) = around(&voxel_from_box.inverse(), low.as_dvec3(), high.as_dvec3());
    let (low, high) = if is_empty { (DVec3::INFINITY, DVec3::NEG_INFINITY) } else { (low, high) };
    lattice.shown_bounds(low, high).map(move |(low, high)| {
        let (low, high) = around(&voxel_from_box, low, high);
        (low.as_vec3(), high.as_vec3())
    })
}

/// A lattice of this frame.
pub(super) struct ExtractedLattice {
    pub lattice: Arc<VoxelLattice>,
    pub revision: u64,
}

/// A lattice as the shaders read it. Twin in `shaders/volume/deform.wgsl`.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct DeformUniform {
    /// Voxel coordinates to those in which the nodes are at whole numbers.
    pub node_from_voxel: Mat4,
    /// Least slopes of the place at rest by the place that is shown, voxels, in columns by axis.
    pub slope_low: [Vec4; 3],
    /// Their greatest values.
    pub slope_high: [Vec4; 3],
    /// Cells along a side.
    pub cells: f32,
    /// Which matrix leads gradients to the picture.
    pub normals: u32,
}

/// A lattice on the GPU.
pub(super) struct GpuLattice {
    revision: u64,
    cells: u32,
    normals: NormalDeformation,
    /// Nodes and matrices.
    textures: [Texture; 2],
    pub nodes: TextureView,
    pub matrices: TextureView,
    uniform: UniformBuffer<DeformUniform>,
}

impl GpuLattice {
    pub fn uniform(&self) -> Option<BindingResource<'_>> {
        self.uniform.binding()
    }
}

/// Every lattice on the GPU.
#[derive(Resource, Default)]
pub(super) struct VolumeLattices(BTreeMap<MainEntity, GpuLattice>);

impl VolumeLattices {
    pub fn get(&self, entity: MainEntity) -> Option<&GpuLattice> {
        self.0.get(&entity)
    }
}

const NODE_FORMAT: TextureFormat = TextureFormat::Rgba16Float;
const MATRIX_FORMAT: TextureFormat = TextureFormat::Rgba32Float;

/// Three layers of columns, one over the other along z; one texel where there are none.
fn size_of_matrices(cells: u32, normals: NormalDeformation) -> UVec3 {
    let side = match normals {
        NormalDeformation::Exact => return UVec3::ONE,
        NormalDeformation::PerPatch => cells,
        NormalDeformation::Smoothed => cells + 1,
    };
    UVec3::new(side, side, 3 * side)
}

fn matrix_texels(lattice: &VoxelLattice) -> Vec<u8> {
    let column = |axis: usize| lattice.matrices().iter().map(move |matrix| matrix.col(axis).extend(0.0));
    let texels: Vec<Vec4> = (0..3).flat_map(column).collect();
    bytemuck::cast_slice(&texels).to_vec()
}

fn write(queue: &RenderQueue, texture: &Texture, texels: &[u8]) {
    let size = texture.size();
    let bytes_per_texel = texture.format().block_copy_size(None).unwrap_or(1);
    let rows = TexelCopyBufferLayout {
        offset: 0,
        bytes_per_row: Some(size.width * bytes_per_texel),
        rows_per_image: Some(size.height),
    };
    queue.write_texture(texture.as_image_copy(), texels, rows, size);
}

fn create(device: &RenderDevice, size: UVec3, format: TextureFormat) -> Texture {
    device.create_texture(&TextureDescriptor {
        label: Some("volume_lattice"),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Translations as texture coordinates of the field.
fn node_texels(lattice: &VoxelLattice, size: UVec3) -> Vec<u8> {
    let per_voxel = 1.0 / size.as_vec3();
    let texel = |node: &Vec3| (*node * per_voxel).extend(0.0).to_array().map(f16::from_f32);
    let texels: Vec<[f16; 4]> = lattice.nodes().iter().map(texel).collect();
    texels.iter().flatten().flat_map(|part| part.to_le_bytes()).collect()
}

/// Writes the lattices that moved, and forgets those that left.
pub(super) fn write_lattices(
    mut kept: ResMut<VolumeLattices>,
    extracted: Res<ExtractedVolumes>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    kept.0.retain(|&entity, _| extracted.get(entity).is_some_and(|volume| volume.lattice.is_some()));
    for volume in &extracted.0 {
        let Some(ExtractedLattice { lattice, revision }) = &volume.lattice else { continue };
        let (cells, revision) = (lattice.cells(), *revision);
        if kept.0.get(&volume.entity).is_some_and(|gpu| gpu.revision == revision) {
            continue;
        }
        let normals = lattice.normals();
        let was = kept.0.remove(&volume.entity).filter(|gpu| gpu.cells == cells && gpu.normals == normals);
        let mut gpu = was.unwrap_or_else(|| {
            let textures = [
                create(&device, UVec3::splat(cells + 1), NODE_FORMAT),
                create(&device, size_of_matrices(cells, normals), MATRIX_FORMAT),
            ];
            let [nodes, matrices] = [0, 1].map(|n: usize| textures[n].create_view(&default()));
            GpuLattice { revision, cells, normals, textures, nodes, matrices, uniform: default() }
        });
        gpu.revision = revision;
        let texels = node_texels(lattice, volume.size);
        write(&queue, &gpu.textures[0], &texels);
        let mut bytes = texels.len() as u64;
        if normals != NormalDeformation::Exact {
            let columns = matrix_texels(lattice);
            bytes += columns.len() as u64;
            write(&queue, &gpu.textures[1], &columns);
        }
        let (low, high) = lattice.slopes();
        let columns = |matrix: Mat3| [0, 1, 2].map(|axis| matrix.col(axis).extend(0.0));
        gpu.uniform.set(DeformUniform {
            node_from_voxel: Mat4::from(lattice.node_from_voxel()),
            slope_low: columns(low),
            slope_high: columns(high),
            cells: cells as f32,
            normals: normals as u32,
        });
        gpu.uniform.write_buffer(&device, &queue);
        if let Some(uploaded) = uploaded.as_ref() {
            uploaded.add_rectangles(2, bytes + DeformUniform::min_size().get());
        }
        kept.0.insert(volume.entity, gpu);
    }
}
