//! The colour of every voxel, for renderers that take colours from the voxels.

use crate::volume::structures::Structures;
use crate::volume::{Volume, Voxels};
use glam::{IVec3, UVec3};
use rayon::prelude::*;

/// Colour of voxels that nothing is known about, sRGB.
const UNNAMED: [u8; 3] = [205, 200, 192];
/// How many voxels colours reach into what is empty.
const DILATION: usize = 2;

/// The colour texture of a volume: one sRGB colour per voxel, `i` running fastest, not multiplied by anything, with an alpha of
/// 255 throughout (the opacity comes from the values and the cut).
///
/// A voxel with a structure has the colour of its structure; without structures, or where only one is named and so nothing is
/// told apart, a coloured volume keeps its own colours. Voxels without a colour take that of the nearest coloured voxel within
/// two voxels, so that interpolation at a surface mixes in no foreign colour, and a light grey beyond.
pub fn colours(volume: &Volume, structures: Option<&Structures>) -> Vec<[u8; 4]> {
    let grid = volume.grid();
    let count = grid.count();
    let named = structures.filter(|structures| structures.labels().len() == count);
    let own = match volume.voxels() {
        Voxels::Rgba(voxels) => Some(voxels),
        _ => None,
    };
    let named = named.filter(|structures| own.is_none() || structures.list().len() > 1);
    let mut of_label = [None; 256];
    for (place, structure) in named.iter().flat_map(|structures| structures.list()).enumerate() {
        of_label[place + 1] = Some(structure.colour);
    }
    let colour = |index: usize| -> Option<[u8; 3]> {
        let of_structure = named.and_then(|structures| of_label[usize::from(structures.labels()[index])]);
        of_structure.or_else(|| {
            own.and_then(|voxels| {
                let [r, g, b, opacity] = voxels[index];
                (opacity > 0).then_some([r, g, b])
            })
        })
    };
    let [width, height, _] = grid.size.to_array().map(|side| side as usize);
    let slice = width * height;
    let mut out = vec![[UNNAMED[0], UNNAMED[1], UNNAMED[2], 255]; count];
    let mut is_coloured = vec![0; count];
    out.par_chunks_mut(slice).zip(is_coloured.par_chunks_mut(slice)).enumerate().for_each(|(k, (out, is_coloured))| {
        for (offset, (out, is_coloured)) in out.iter_mut().zip(is_coloured).enumerate() {
            if let Some([r, g, b]) = colour(k * slice + offset) {
                (*out, *is_coloured) = ([r, g, b, 255], 1);
            }
        }
    });
    for _ in 0..DILATION {
        spread(grid.size, &mut out, &mut is_coloured);
    }
    out
}

/// Gives every voxel without a colour that of its nearest coloured neighbour among the 26 around it.
fn spread(size: UVec3, out: &mut [[u8; 4]], is_coloured: &mut [u8]) {
    let neighbours = neighbours_by_distance();
    let [width, height, depth] = size.to_array().map(|side| side as usize);
    let slice = width * height;
    let (from, known) = (&*out, &*is_coloured);
    let new: Vec<Vec<(u32, [u8; 4])>> = (0..depth)
        .into_par_iter()
        .map(|k| {
            let mut new = Vec::new();
            // Whether anything in the three by three rows around is coloured: most rows need no closer look.
            let mut around = vec![0u8; width + 2];
            for j in 0..height {
                around.fill(0);
                for near_k in k.saturating_sub(1)..(k + 2).min(depth) {
                    for near_j in j.saturating_sub(1)..(j + 2).min(height) {
                        let start = near_k * slice + near_j * width;
                        around[1..=width].iter_mut().zip(&known[start..start + width]).for_each(|(a, k)| *a |= k);
                    }
                }
                let start = k * slice + j * width;
                for i in 0..width {
                    if known[start + i] == 1 || around[i] | around[i + 1] | around[i + 2] == 0 {
                        continue;
                    }
                    let place = UVec3::new(i as u32, j as u32, k as u32).as_ivec3();
                    let nearest = neighbours.iter().find_map(|&step| {
                        let near = place + step;
                        let is_inside = near.cmpge(IVec3::ZERO).all() && near.cmplt(size.as_ivec3()).all();
                        let index = || near.z as usize * slice + near.y as usize * width + near.x as usize;
                        (is_inside && known[index()] == 1).then(|| from[index()])
                    });
                    new.extend(nearest.map(|colour| ((j * width + i) as u32, colour)));
                }
            }
            new
        })
        .collect();
    out.par_chunks_mut(slice).zip(is_coloured.par_chunks_mut(slice)).zip(new).for_each(|((out, is_coloured), new)| {
        for (offset, colour) in new {
            (out[offset as usize], is_coloured[offset as usize]) = (colour, 1);
        }
    });
}

/// The steps to the 26 neighbours, the nearest ones first.
fn neighbours_by_distance() -> Vec<IVec3> {
    let line = [0, -1, 1];
    let cube = line.into_iter().flat_map(|z| line.into_iter().flat_map(move |y| line.map(|x| IVec3::new(x, y, z))));
    let mut steps: Vec<IVec3> = cube.filter(|&step| step != IVec3::ZERO).collect();
    // Stable: equally near ones keep a fixed order.
    steps.sort_by_key(|step| step.length_squared());
    steps
}
