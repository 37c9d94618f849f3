//! Aligned slices in a view: which stack, which polygons, and the numbers that the shaders read.

use super::super::extract::ExtractedVolume;
use super::super::uniform::VolumeUniform;
use super::bodies::AlignedBody;
use crate::volume::aligned::{PatchFrames, PatchRect, SliceStack, visible_polygons};
use bevy::math::{DMat4, Mat3};
use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::RenderDevice;
use bevy::render::view::ExtractedView;
use std::ops::Range;

/// The aligned slices of a volume in a view. Twin in `shaders/volume/patches.wgsl`.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct AlignedUniform {
    /// Shares of the lattice's box to clip space.
    pub clip_from_box: Mat4,
    /// Shares of the lattice's box to texture coordinates.
    pub texture_from_box: Mat4,
    /// View depth in voxels from the volume's middle.
    pub depth_from_box: Vec4,
    /// Slices per step of the opacity table along a pixel's ray: constant, per pixel to the right, per pixel down.
    pub slices_per_step: Vec4,
    /// Number of the slice that is nearest to the eye.
    pub first: f32,
    /// 1 where the numbers grow away from it, -1 where they fall.
    pub direction: f32,
    /// Distance of the slices, shares of the box.
    pub spacing: f32,
    /// Axis of the box that they lie across.
    pub axis: u32,
}

/// A patch between its faces across an axis, as the vertex shader reads it. Twin in `shaders/volume/patches.wgsl`.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct PatchFramesTexel {
    /// Least place: `u`, `v`, along the axis.
    pub low_uva: Vec3,
    /// Length of its edges.
    pub side: f32,
    /// Vertices of the face on the low side.
    pub front: UVec4,
    /// Vertices of the face on the high side.
    pub back: UVec4,
}

/// A rectangle of a patch. Twin in `shaders/volume/patches.wgsl`.
#[derive(Clone, Copy, Debug, Default, ShaderType)]
pub struct PatchRectTexel {
    /// Least `u` and `v`, greatest `u` and `v`.
    pub span: Vec4,
    /// Number of its frames.
    pub frames: u32,
}

impl From<&PatchFrames> for PatchFramesTexel {
    fn from(of: &PatchFrames) -> Self {
        Self { low_uva: of.low_uva, side: of.side, front: of.front.into(), back: of.back.into() }
    }
}

impl From<&PatchRect> for PatchRectTexel {
    fn from(of: &PatchRect) -> Self {
        Self { span: Vec4::new(of.low.x, of.low.y, of.high.x, of.high.y), frames: of.frames }
    }
}

/// Slices that are drawn before pixels are hidden again.
const SLICES_AT_ONCE: usize = 16;

/// What is drawn of a volume in a view.
pub(in super::super) struct AlignedView {
    pub uniform: Buffer,
    /// Numbers of the polygons.
    pub polygons: Buffer,
    /// Those that are drawn at once, near ones first.
    pub batches: Vec<Range<u32>>,
}

impl AlignedView {
    /// `None` where nothing is seen.
    pub fn new(
        device: &RenderDevice,
        body: &AlignedBody,
        volume: &ExtractedVolume,
        view: &ExtractedView,
        uniform: &VolumeUniform,
        seen: URect,
    ) -> Option<Self> {
        let voxel_from_box = DMat4::from(body.voxel_from_box);
        let world_from_box = volume.world_from_voxel.as_dmat4() * voxel_from_box;
        let view_from_box = view.world_from_view.to_matrix().as_dmat4().inverse() * world_from_box;
        let box_from_voxel = voxel_from_box.inverse();
        let size = uniform.viewport.zw();
        let middle = (seen.min + seen.max).as_vec2() * 0.5;
        let ndc = middle / size * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
        let along = uniform.along.map(|part| box_from_voxel.transform_vector3(part.truncate().as_dvec3()).as_vec3());
        let box_from_world = Mat3::from_mat4(world_from_box.inverse().as_mat4());
        let margin = body.polygons.margin();
        let stack = SliceStack::new(
            along[0] + along[1] * ndc.x + along[2] * ndc.y,
            box_from_world,
            uniform.step_m,
            Vec3::splat(-margin),
            Vec3::splat(1.0 + margin),
        );
        let (polygons, slices) =
            visible_polygons(&body.polygons, &body.translations, &stack, body.voxel_from_box, &body.showing);
        if polygons.is_empty() {
            return None;
        }
        let sign = if stack.is_forward { 1.0 } else { -1.0 };
        let [constant, by_x, by_y] = along.map(|part| sign * part[stack.axis] * uniform.step_m / stack.spacing);
        let slices_per_step = Vec4::new(constant - by_x + by_y, by_x * 2.0 / size.x, by_y * -2.0 / size.y, 0.0);
        let texture_from_voxel =
            DMat4::from_scale(uniform.size.as_dvec3().recip()) * DMat4::from_translation(bevy::math::DVec3::splat(0.5));
        let depth = -view_from_box.row(2).as_vec4();
        let depth_from_box = (depth - Vec4::W * uniform.middle_m) / uniform.spacing_m;
        let numbers = AlignedUniform {
            clip_from_box: (view.clip_from_view.as_dmat4() * view_from_box).as_mat4(),
            texture_from_box: (texture_from_voxel * voxel_from_box).as_mat4(),
            depth_from_box,
            slices_per_step,
            first: stack.first as f32,
            direction: sign,
            spacing: stack.spacing,
            axis: stack.axis as u32,
        };
        let mut bytes = encase::UniformBuffer::new(Vec::<u8>::new());
        bytes.write(&numbers).ok()?;
        let buffer = |label, contents: &[u8], usage| {
            device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        Some(Self {
            uniform: buffer("volume_aligned", &bytes.into_inner(), BufferUsages::UNIFORM),
            polygons: buffer("volume_polygons", bytemuck::cast_slice(&polygons), BufferUsages::STORAGE),
            batches: batches(&slices),
        })
    }
}

/// The polygons of some slices at a time.
fn batches(slices: &[Range<u32>]) -> Vec<Range<u32>> {
    let showing: Vec<_> = slices.iter().filter(|of| !of.is_empty()).collect();
    showing.chunks(SLICES_AT_ONCE).filter_map(|some| Some(some.first()?.start..some.last()?.end)).collect()
}
