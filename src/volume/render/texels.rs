//! What of a volume lies on the GPU: values with what drilling left, and gradients.
//!
//! Gradients are central differences of value times remaining opacity (paper of 2009, section 5.4). They are made here, once
//! per voxel and again near the burr, and not per pixel: to interpolate them is the same as to take differences of the
//! interpolated field, and a sample costs one look-up more instead of six.

use crate::volume::grid::linear_index;
use crate::volume::software::encoded;
use crate::volume::{CutVolume, Volume, VoxelBox, Voxels};
use bevy::render::render_resource::TextureFormat;
use glam::{UVec3, Vec3};
use half::f16;
use rayon::prelude::*;

/// The format of a volume's field: two channels, as many bits as its values need.
pub fn field_format(volume: &Volume) -> TextureFormat {
    if is_8_bit(volume) { TextureFormat::Rg8Unorm } else { TextureFormat::Rg16Float }
}

fn is_8_bit(volume: &Volume) -> bool {
    matches!(volume.voxels(), Voxels::U8(_) | Voxels::Rgba(_))
}

/// Texels of a box: normalized value and remaining opacity, in [`field_format`], x fastest.
pub fn field_texels(volume: &Volume, cut: &CutVolume, of: VoxelBox) -> Vec<u8> {
    let size = of.size();
    let bytes = if is_8_bit(volume) { 2 } else { 4 };
    let mut texels = vec![0; of.count() * bytes];
    let row = size.x as usize;
    let slice = row * size.y as usize;
    texels.par_chunks_mut((slice * bytes).max(1)).enumerate().for_each(|(z, texels)| {
        let plane = plane_of(of, z as u32);
        let mut remaining = vec![255; slice];
        if !cut.is_untouched(plane) {
            cut.copy_remaining(plane, &mut remaining);
        }
        for (y, (texels, remaining)) in texels.chunks_mut(row * bytes).zip(remaining.chunks(row)).enumerate() {
            let first = volume.grid().index(UVec3::new(of.min.x, of.min.y + y as u32, plane.min.z));
            for (x, (texel, &remaining)) in texels.chunks_exact_mut(bytes).zip(remaining).enumerate() {
                let value = volume.normalized(first + x);
                if bytes == 2 {
                    texel.copy_from_slice(&[(value * 255.0).round() as u8, remaining]);
                } else {
                    texel[..2].copy_from_slice(&f16::from_f32(value).to_le_bytes());
                    texel[2..].copy_from_slice(&f16::from_f32(f32::from(remaining) / 255.0).to_le_bytes());
                }
            }
        }
    });
    texels
}

/// Texels of a box: gradients as [`encoded`] writes them, `Rgba8Snorm`, x fastest.
pub fn gradient_texels(volume: &Volume, cut: &CutVolume, of: VoxelBox) -> Vec<u8> {
    let size = of.size();
    let (row, slice) = (size.x as usize, size.x as usize * size.y as usize);
    let mut texels = vec![0; of.count() * 4];
    // A few slices at a time, so that a slice is read three times at most and memory stays small.
    const SLICES: usize = 8;
    texels.par_chunks_mut((slice * 4 * SLICES).max(1)).enumerate().for_each(|(chunk, texels)| {
        let first = chunk as u32 * SLICES as u32;
        let count = texels.len().div_ceil(slice * 4) as u32;
        let own = VoxelBox {
            min: UVec3::new(of.min.x, of.min.y, of.min.z + first),
            max: UVec3::new(of.max.x, of.max.y, of.min.z + first + count),
        };
        let around = own.grown(1, volume.grid().size);
        let field = product(volume, cut, around);
        let span = around.size();
        // Beyond the grid there is nothing.
        let at = |voxel: UVec3| {
            let is_inside = voxel.cmpge(around.min).all() && voxel.cmplt(around.max).all();
            if is_inside { field[linear_index(span, voxel - around.min)] } else { 0.0 }
        };
        for z in 0..count {
            for y in 0..size.y {
                let start = ((z as usize * slice) + y as usize * row) * 4;
                for (x, texel) in texels[start..start + row * 4].chunks_exact_mut(4).enumerate() {
                    let voxel = own.min + UVec3::new(x as u32, y, z);
                    // Before the first voxel this goes round to the end of the numbers, which is outside as well.
                    let slope = |axis: UVec3| at(voxel + axis) - at(voxel.wrapping_sub(axis));
                    let difference = Vec3::new(slope(UVec3::X), slope(UVec3::Y), slope(UVec3::Z)) * 0.5;
                    texel.copy_from_slice(&encoded(difference).map(|part| part as u8));
                }
            }
        }
    });
    texels
}

fn plane_of(of: VoxelBox, z: u32) -> VoxelBox {
    VoxelBox {
        min: UVec3::new(of.min.x, of.min.y, of.min.z + z),
        max: UVec3::new(of.max.x, of.max.y, of.min.z + z + 1),
    }
}

/// Normalized value times remaining opacity in a box, x fastest.
fn product(volume: &Volume, cut: &CutVolume, of: VoxelBox) -> Vec<f32> {
    let size = of.size();
    let mut remaining = vec![255; of.count()];
    if !cut.is_untouched(of) {
        cut.copy_remaining(of, &mut remaining);
    }
    let mut field = Vec::with_capacity(of.count());
    for (line, remaining) in remaining.chunks(size.x as usize).enumerate() {
        let (y, z) = (line as u32 % size.y, line as u32 / size.y);
        let first = volume.grid().index(of.min + UVec3::new(0, y, z));
        let values = (first..).zip(remaining);
        field.extend(values.map(|(index, &remaining)| volume.normalized(index) * f32::from(remaining) / 255.0));
    }
    field
}
