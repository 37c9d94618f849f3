//! What the render world takes of volumes each frame.

use super::gpu::VolumeTextures;
use super::lattices::{ExtractedLattice, shown_box, shown_boxes};
use super::shown::{ShownVolume, all_blocks};
use super::texels::{field_format, field_texels, gradient_texels};
use crate::deform::DeformLattice;
use crate::render::finite_within;
use crate::volume::deformed::DeformedVolume;
use crate::volume::grid::linear_index;
use crate::volume::software::plane_in_voxels;
use crate::volume::transfer::{ColourSource, colours};
use crate::volume::{CtVolume, CutVolume, Volume, VolumeLook, VoxelBox};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::TextureFormat;
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::MainEntity;

/// A volume of this frame.
pub(super) struct ExtractedVolume {
    pub entity: MainEntity,
    pub size: UVec3,
    pub world_from_voxel: Mat4,
    pub centre_world_m: Vec3,
    /// Voxel-space half spaces.
    pub clip_planes: Vec<Vec4>,
    pub look: VolumeLook,
    pub layers: RenderLayers,
    /// What can be seen at all, voxel coordinates.
    pub bounds: (Vec3, Vec3),
    /// By which it is deformed.
    pub lattice: Option<ExtractedLattice>,
    pub own_colours: bool,
    pub revision: u64,
    /// Whether this revision changed more than the voxels in `cut`.
    pub is_all_new: bool,
    /// Voxel coordinates between which this revision changed the picture.
    pub cut: Vec<(Vec3, Vec3)>,
    /// Whether `uploads` holds all of it, so that its textures are made anew.
    pub is_whole: bool,
    pub uploads: Vec<TexelUpload>,
}

/// Which texture texels are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TexelKind {
    Field(TextureFormat),
    Gradients,
    Colours,
    Blocks,
    Table,
}

/// Texels on their way to the GPU.
pub(super) struct TexelUpload {
    pub kind: TexelKind,
    pub of: VoxelBox,
    pub texels: Vec<u8>,
}

/// Every volume of this frame, in order of their entities.
#[derive(Resource, Default)]
pub(super) struct ExtractedVolumes(pub Vec<ExtractedVolume>);

impl ExtractedVolumes {
    pub fn get(&self, entity: MainEntity) -> Option<&ExtractedVolume> {
        self.0.binary_search_by_key(&entity, |volume| volume.entity).ok().map(|place| &self.0[place])
    }
}

type Shown = (
    Entity,
    &'static CtVolume,
    &'static CutVolume,
    &'static VolumeLook,
    &'static ShownVolume,
    &'static GlobalTransform,
    Option<&'static RenderLayers>,
    Option<(&'static DeformLattice, &'static DeformedVolume)>,
);

pub(super) fn extract_volumes(
    mut extracted: ResMut<ExtractedVolumes>,
    textures: Res<VolumeTextures>,
    shown: Extract<Query<Shown>>,
    volumes: Extract<Res<Assets<Volume>>>,
    device: Res<RenderDevice>,
    mut refused: Local<Vec<(MainEntity, UVec3)>>,
) {
    let limit = device.limits().max_texture_dimension_3d;
    extracted.0.clear();
    for (entity, source, cut, look, shown, transform, layers, deformed) in shown.iter() {
        let entity = MainEntity::from(entity);
        let Some(volume) = volumes.get(&source.0) else { continue };
        let grid = volume.grid();
        // A volume that took another's place is shown from the next frame on.
        if !shown.is_of(source.0.id(), grid.size) || cut.size() != grid.size {
            continue;
        }
        if grid.size.max_element() > limit {
            if !refused.contains(&(entity, grid.size)) {
                tracing::error!(
                    "a volume of {} voxels is not shown: this adapter takes {limit} along a side",
                    grid.size
                );
                refused.push((entity, grid.size));
            }
            continue;
        }
        let world_from_volume = transform.affine();
        let world_from_voxel = Mat4::from(world_from_volume * grid.volume_from_voxel());
        // A transform that is flat or not finite shows nothing.
        if !(world_from_voxel.is_finite() && world_from_voxel.determinant() != 0.0) {
            continue;
        }
        let known = textures.revision(entity);
        let is_whole = known != Some(shown.revision) && known != Some(shown.revision.wrapping_sub(1));
        let is_next = known == Some(shown.revision.wrapping_sub(1));
        let cut_voxels = if is_next { &shown.changes.voxels[..] } else { &[] };
        // The gradients around them changed too, and samples are interpolated.
        let changed = cut_voxels.iter().map(|of| (of.min.as_vec3() - 2.5, of.max.as_vec3() + 1.5));
        let (bounds, changed) = match deformed {
            None => (shown.bounds, changed.collect()),
            Some((lattice, _)) => (
                shown_box(lattice, grid, shown.bounds.0, shown.bounds.1),
                changed.flat_map(|(low, high)| shown_boxes(lattice, grid, low, high)).collect(),
            ),
        };
        extracted.0.push(ExtractedVolume {
            entity,
            size: grid.size,
            world_from_voxel,
            centre_world_m: transform.translation(),
            clip_planes: look.cutting_planes().map(|plane| plane_in_voxels(plane, &grid.volume_from_voxel())).collect(),
            look: sane(look),
            layers: layers.cloned().unwrap_or_default(),
            bounds,
            lattice: deformed
                .map(|(_, shown)| ExtractedLattice { lattice: shown.shared(), revision: shown.revision() }),
            own_colours: shown.colours == ColourSource::Voxels,
            revision: shown.revision,
            is_all_new: is_whole || (is_next && shown.changes.table),
            cut: changed,
            is_whole,
            uploads: if is_whole {
                all_texels(volume, cut, shown)
            } else if is_next {
                changed_texels(volume, cut, shown, textures.get(entity).is_some_and(|gpu| gpu.colours.is_some()))
            } else {
                Vec::new()
            },
        });
    }
    extracted.0.sort_by_key(|volume| volume.entity);
}

/// Everything that a volume has on the GPU.
fn all_texels(volume: &Volume, cut: &CutVolume, shown: &ShownVolume) -> Vec<TexelUpload> {
    let all = volume.grid().bounds();
    let mut uploads = voxel_texels(volume, cut, all);
    uploads.push(block_texels(shown, all_blocks(volume.grid().size)));
    uploads.push(table_texels(shown));
    uploads.extend(own_colours(volume, shown));
    uploads
}

/// What the last revision changed.
fn changed_texels(volume: &Volume, cut: &CutVolume, shown: &ShownVolume, has_colours: bool) -> Vec<TexelUpload> {
    let mut uploads = Vec::new();
    for &of in &shown.changes.voxels {
        uploads.extend(voxel_texels(volume, cut, of));
    }
    uploads.extend(shown.changes.blocks.map(|of| block_texels(shown, of)));
    if shown.changes.table {
        uploads.push(table_texels(shown));
        // A volume's own colours never change.
        if !has_colours {
            uploads.extend(own_colours(volume, shown));
        }
    }
    uploads
}

/// The field of a box, and the gradients that take part in it.
fn voxel_texels(volume: &Volume, cut: &CutVolume, of: VoxelBox) -> Vec<TexelUpload> {
    let around = of.grown(1, volume.grid().size);
    vec![
        TexelUpload { kind: TexelKind::Field(field_format(volume)), of, texels: field_texels(volume, cut, of) },
        TexelUpload { kind: TexelKind::Gradients, of: around, texels: gradient_texels(volume, cut, around) },
    ]
}

fn own_colours(volume: &Volume, shown: &ShownVolume) -> Option<TexelUpload> {
    (shown.colours == ColourSource::Voxels).then(|| TexelUpload {
        kind: TexelKind::Colours,
        of: volume.grid().bounds(),
        texels: bytemuck::cast_slice(&colours(volume, volume.structures().map(|structures| &**structures))).to_vec(),
    })
}

fn block_texels(shown: &ShownVolume, of: VoxelBox) -> TexelUpload {
    let blocks = shown.distances.blocks();
    let size = of.size();
    let mut texels = Vec::with_capacity(of.count());
    for z in of.min.z..of.max.z {
        for y in of.min.y..of.max.y {
            let first = linear_index(blocks, UVec3::new(of.min.x, y, z));
            texels.extend_from_slice(&shown.distances.distances()[first..first + size.x as usize]);
        }
    }
    TexelUpload { kind: TexelKind::Blocks, of, texels }
}

fn table_texels(shown: &ShownVolume) -> TexelUpload {
    let entries = shown.table.entries();
    TexelUpload {
        kind: TexelKind::Table,
        of: VoxelBox { min: UVec3::ZERO, max: UVec3::new(entries.len() as u32, 1, 1) },
        texels: bytemuck::cast_slice(entries).to_vec(),
    }
}

/// The look with all of its numbers in range.
fn sane(look: &VolumeLook) -> VolumeLook {
    let default = VolumeLook::default().wet;
    let mut sane = look.clone();
    sane.step_voxels = look.sane_step_voxels();
    sane.wet.passes = look.wet.passes.min(crate::volume::MAX_SMOOTHING_PASSES);
    sane.wet.edge_voxels = finite_within(look.wet.edge_voxels, 0.1, 1e3, default.edge_voxels);
    sane.wet.shine = finite_within(look.wet.shine, 0.0, 100.0, default.shine);
    sane.wet.shine_exponent = finite_within(look.wet.shine_exponent, 1.0, 1e4, default.shine_exponent);
    sane
}

/// Keeps the culling box around the grid.
pub(super) fn bound_volumes(
    mut commands: Commands,
    volumes: Res<Assets<Volume>>,
    shown: Query<(Entity, &CtVolume, Option<&DeformLattice>, Option<&Aabb>)>,
) {
    for (entity, source, lattice, bounded) in &shown {
        let Some(volume) = volumes.get(&source.0) else { continue };
        let half: Vec3 = volume.grid().half_axes_m().iter().map(|axis| axis.abs()).sum();
        let mut bounds = Aabb { center: Vec3::ZERO.into(), half_extents: half.into() };
        if let Some(lattice) = lattice {
            let size = volume.grid().size.as_vec3();
            let (low, high) = shown_box(lattice, volume.grid(), Vec3::splat(-0.5), size - 0.5);
            bounds = box_around(&volume.grid().volume_from_voxel(), low, high);
        }
        if bounded != Some(&bounds) {
            commands.entity(entity).try_insert(bounds);
        }
    }
}

/// The culling box of what lies between voxel coordinates.
fn box_around(volume_from_voxel: &bevy::math::Affine3A, low: Vec3, high: Vec3) -> Aabb {
    let (centre, half) = ((low + high) * 0.5, (high - low) * 0.5);
    let matrix = volume_from_voxel.matrix3;
    Aabb {
        center: volume_from_voxel.transform_point3(centre).into(),
        half_extents: (matrix.x_axis.abs() * half.x + matrix.y_axis.abs() * half.y + matrix.z_axis.abs() * half.z),
    }
}
