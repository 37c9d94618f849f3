//! Normals evened out over the picture, but not over its edges (paper of 2009, section 5.4).

use super::{ViewRays, VolumeImage};
use bevy::reflect::Reflect;
use glam::{UVec2, Vec3, Vec4};
use rayon::prelude::*;

/// Depth of pixels that show nothing: so far from any other that their neighbours do not see them.
const NOTHING: f32 = 60_000.0;
/// Opacity from which on a pixel shows something.
const LEAST_OPACITY: f32 = 1.0 / 512.0;

/// Normals of a picture with their depths. One entry per pixel, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct NormalImage {
    /// Pixels.
    pub size_px: UVec2,
    /// Unit normal in the world, and the view depth in voxels from the volume's middle. Pixels that show nothing (an opacity below
    /// 1/512) have the normal 0 and the depth 60,000.
    pub texels: Vec<[f32; 4]>,
}

impl NormalImage {
    /// The normals of a picture.
    pub fn new(image: &VolumeImage, rays: &ViewRays) -> Self {
        let per_voxel = 1.0 / rays.voxel_edge_m();
        let pixels = image.colour.par_iter().zip(&image.normal).zip(&image.depth_m);
        let texels = pixels.map(|(([.., opacity], normal), depth_m)| {
            if *opacity < LEAST_OPACITY {
                return [0.0, 0.0, 0.0, NOTHING];
            }
            let [x, y, z] = *normal;
            [x, y, z, (depth_m - rays.middle_depth_m()) * per_voxel]
        });
        Self { size_px: image.size_px, texels: texels.collect() }
    }

    /// The normal of a pixel by its place in memory; `None` for pixels that show nothing.
    pub fn normal(&self, place: usize) -> Option<Vec3> {
        let [x, y, z, depth] = *self.texels.get(place)?;
        (depth != NOTHING).then_some(Vec3::new(x, y, z))
    }
}

/// Passes over the 3x3 pixels around each: the sum of their normals, each with a weight that falls linearly from 1 at the same
/// depth to 0 at a difference of `edge_voxels`, made a unit vector again. Depths stay as they are. The picture's outermost
/// pixels continue beyond it. With an edge that is not above 0 nothing changes.
pub fn smooth(normals: &NormalImage, passes: u32, edge_voxels: f32) -> NormalImage {
    let (width, height) = (normals.size_px.x as usize, normals.size_px.y as usize);
    let mut from: Vec<Vec4> = normals.texels.iter().copied().map(Vec4::from_array).collect();
    if edge_voxels > 0.0 && width > 0 {
        let steepness = 1.0 / edge_voxels;
        let mut to = from.clone();
        for _ in 0..passes {
            to.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
                // The lines above, at and below this one.
                let lines =
                    [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| &from[y * width..(y + 1) * width]);
                for (x, to) in row.iter_mut().enumerate() {
                    let own = lines[1][x];
                    if own.w == NOTHING {
                        continue;
                    }
                    let columns = [x.saturating_sub(1), x, (x + 1).min(width - 1)];
                    let mut sum = Vec4::ZERO;
                    for line in lines {
                        for column in columns {
                            let other = line[column];
                            sum += other * (1.0 - (other.w - own.w).abs() * steepness).max(0.0);
                        }
                    }
                    let sum = sum.truncate();
                    *to = if sum.length_squared() > 1e-12 { sum.normalize().extend(own.w) } else { own };
                }
            });
            std::mem::swap(&mut from, &mut to);
        }
    }
    NormalImage { size_px: normals.size_px, texels: from.into_iter().map(|texel| texel.to_array()).collect() }
}
