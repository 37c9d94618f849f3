//! Lattices whose volumes are drawn as aligned slices, and their buffers, kept between frames.

use super::super::shown::ShownVolume;
use super::view::{PatchFramesTexel, PatchRectTexel};
use crate::deform::DeformLattice;
use crate::deform::lattice::Tree;
use crate::render::Uploads;
use crate::volume::aligned::{PatchPolygons, ShowingBlocks};
use crate::volume::lattice::voxel_from_box;
use crate::volume::{CtVolume, Volume, VolumeGrid, VolumeLook, VolumeMethod};
use bevy::math::{DAffine3, DVec3};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::encase::private::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// The lattice of a volume, or a single patch at rest where it has none.
pub(in super::super) struct AlignedBody {
    tree: Tree,
    pub translations: Vec<Vec3>,
    pub polygons: PatchPolygons,
    pub showing: ShowingBlocks,
    shown_revision: u64,
    pub voxel_from_box: DAffine3,
    has_new_tree: bool,
    has_moved: bool,
    pub gpu: Option<BodyBuffers>,
}

/// Its buffers: frames, rectangles, translations.
pub(in super::super) struct BodyBuffers {
    pub frames: Buffer,
    pub rects: Buffer,
    pub translations: Buffer,
}

/// Every volume that is drawn as aligned slices.
#[derive(Resource, Default)]
pub(in super::super) struct AlignedBodies {
    bodies: BTreeMap<MainEntity, AlignedBody>,
}

impl AlignedBodies {
    pub fn get(&self, entity: MainEntity) -> Option<&AlignedBody> {
        self.bodies.get(&entity)
    }
}

type Shown = (Entity, &'static CtVolume, &'static VolumeLook, &'static ShownVolume, Option<&'static DeformLattice>);

/// Takes over what changed of the lattices and of what their volumes show.
pub(in super::super) fn extract_bodies(
    mut kept: ResMut<AlignedBodies>,
    shown: Extract<Query<Shown>>,
    volumes: Extract<Res<Assets<Volume>>>,
) {
    let mut before = std::mem::take(&mut kept.bodies);
    for (entity, source, look, shown, lattice) in shown.iter() {
        let Some(volume) = volumes.get(&source.0) else { continue };
        let grid = volume.grid();
        if look.method != VolumeMethod::PatchSlices || !shown.is_of(source.0.id(), grid.size) {
            continue;
        }
        let entity = MainEntity::from(entity);
        let voxel_from_box = lattice.map_or_else(|| voxel_from_grid(grid), |lattice| voxel_from_box(lattice, grid));
        let mut body = before.remove(&entity);
        // A tree is only made anew where the body has none that fits.
        let is_same_tree = |body: &AlignedBody| match lattice {
            Some(lattice) => body.tree == *lattice.tree(),
            None => body.tree.patches().len() == 1,
        };
        if !body.as_ref().is_some_and(is_same_tree) {
            let Some(tree) = lattice.map(|own| own.tree().clone()).or_else(|| Tree::uniform(0).ok()) else { continue };
            body = Some(AlignedBody {
                translations: vec![Vec3::ZERO; tree.vertex_count()],
                polygons: PatchPolygons::new(&tree, 0.0),
                tree,
                showing: ShowingBlocks::default(),
                // Never that of a shown volume.
                shown_revision: u64::MAX,
                voxel_from_box,
                has_new_tree: true,
                has_moved: true,
                gpu: None,
            });
        }
        let Some(mut body) = body else { continue };
        let is_moved = match lattice {
            Some(lattice) => body.translations != lattice.translations(),
            None => body.translations.iter().any(|translation| *translation != Vec3::ZERO),
        };
        if is_moved || body.voxel_from_box != voxel_from_box {
            match lattice {
                Some(lattice) => body.translations.copy_from_slice(lattice.translations()),
                None => body.translations.fill(Vec3::ZERO),
            }
            (body.voxel_from_box, body.has_moved) = (voxel_from_box, true);
            let margin = margin_of(&body.tree, &body.translations);
            // It never shrinks: a lattice that swings would have its polygons made again and again.
            if margin > body.polygons.margin() {
                body.polygons = PatchPolygons::new(&body.tree, margin);
                body.has_new_tree = true;
            }
        }
        if body.shown_revision != shown.revision {
            body.showing = ShowingBlocks::new(&shown.distances);
            body.shown_revision = shown.revision;
        }
        kept.bodies.insert(entity, body);
    }
}

/// Leads from shares of the box to voxel coordinates where there is no lattice: the box then holds all voxels.
fn voxel_from_grid(grid: &VolumeGrid) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(grid.size.as_dvec3(), bevy::math::DQuat::IDENTITY, DVec3::splat(-0.5))
}

/// How far beyond the box matter is shown: as far as translations on its sides reach, in steps.
fn margin_of(tree: &Tree, translations: &[Vec3]) -> f32 {
    const STEPS: f32 = 16.0;
    let on_sides = translations.iter().enumerate().filter(|(vertex, _)| tree.is_on_side(*vertex));
    let most = on_sides.map(|(_, translation)| translation.abs().max_element()).fold(0.0, f32::max);
    (most * STEPS).ceil() / STEPS
}

/// Makes buffers for new trees and writes the translations of the lattices that moved.
pub(in super::super) fn write_bodies(
    mut kept: ResMut<AlignedBodies>,
    uploaded: Option<Res<Uploads>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    for body in kept.bodies.values_mut() {
        if !(body.has_moved || body.has_new_tree) {
            continue;
        }
        let texels: Vec<Vec4> = body.translations.iter().map(|translation| translation.extend(0.0)).collect();
        let bytes: &[u8] = bytemuck::cast_slice(&texels);
        match &body.gpu {
            Some(gpu) if !body.has_new_tree => queue.write_buffer(&gpu.translations, 0, bytes),
            _ => {
                let frames = body.polygons.frames().iter().map(PatchFramesTexel::from).collect();
                let rects = body.polygons.rects().iter().map(PatchRectTexel::from).collect();
                body.gpu = Some(BodyBuffers {
                    frames: stored::<PatchFramesTexel>(&device, "volume_patch_frames", frames),
                    rects: stored::<PatchRectTexel>(&device, "volume_patch_rects", rects),
                    translations: device.create_buffer_with_data(&BufferInitDescriptor {
                        label: Some("volume_translations"),
                        contents: bytes,
                        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                    }),
                });
            }
        }
        if let Some(uploaded) = &uploaded {
            uploaded.add_rectangles(1, bytes.len() as u64);
        }
        (body.has_moved, body.has_new_tree) = (false, false);
    }
}

fn stored<T: ShaderType + ShaderSize + WriteInto>(device: &RenderDevice, label: &'static str, of: Vec<T>) -> Buffer {
    let mut bytes = encase::StorageBuffer::new(Vec::<u8>::new());
    // Writing into memory does not fail.
    let _ = bytes.write(&of);
    let contents = bytes.into_inner();
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: &contents,
        usage: BufferUsages::STORAGE,
    })
}
