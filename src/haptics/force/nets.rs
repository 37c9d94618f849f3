//! The surface of voxels: one place in each cell that it passes, joined across the edges that it cuts.
//!
//! A cell lies between eight voxels. Which of its corners are solid is kept as one bit each, a row of voxels in a few words, so that
//! the many cells through which no surface passes cost a part of a word and not a look each.

use super::BoneBrick;
use glam::{UVec3, Vec3};

/// Halfway between empty and solid.
const LEVEL: f32 = 127.5;

/// Places in the world and triangles, counterclockwise seen from outside. At the sides of the box it is open.
pub(super) fn surface(brick: &BoneBrick) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let size = brick.size();
    let mut net = Net { places_m: Vec::new(), triangles: Vec::new() };
    if size.min_element() < 2 {
        return (net.places_m, net.triangles);
    }
    let [cells_x, cells_y, cells_z] = (size - 1).to_array().map(|side| side as usize);
    let (width, height) = (size.x as usize, size.y as usize);
    let solid = brick.all_solid();
    let words = width.div_ceil(64);
    let bits: Vec<u64> = solid.chunks_exact(width).flat_map(|row| row.chunks(64).map(solid_bits)).collect();
    let row = |y: usize, z: usize| &bits[(z * height + y) * words..][..words];
    let corner_offsets: [usize; 8] =
        std::array::from_fn(|corner| (corner & 1) + (corner >> 1 & 1) * width + (corner >> 2) * width * height);
    let is_mirrored = brick.world_from_voxel().matrix3.determinant() < 0.0;
    // Places of cells in this layer and the one below. A cut edge asks for the cells around it alone, which all have one.
    let layer = cells_x * cells_y;
    let mut place_of = vec![0_u32; 2 * layer];
    for z in 0..cells_z {
        let (here, below) = ((z & 1) * layer, (!z & 1) * layer);
        for y in 0..cells_y {
            let rows = [row(y, z), row(y + 1, z), row(y, z + 1), row(y + 1, z + 1)];
            for word in 0..words {
                let pairs = rows.map(|row| [row[word], row.get(word + 1).copied().unwrap_or(0)]);
                let mut crossed = crossed_cells(pairs) & mask_below(cells_x - (word * 64).min(cells_x));
                while crossed != 0 {
                    let bit = crossed.trailing_zeros();
                    crossed &= crossed - 1;
                    let x = word * 64 + bit as usize;
                    let corners = corner_bits(pairs, bit);
                    let first = x + width * (y + height * z);
                    let place = middle_of_cuts(corners, corner_offsets.map(|offset| solid[first + offset]));
                    let cell = UVec3::new(x as u32, y as u32, z as u32);
                    let at = y * cells_x + x;
                    place_of[here + at] = net.places_m.len() as u32;
                    let place_m = brick.world_from_voxel().transform_point3((cell.as_vec3() + place).as_dvec3());
                    net.places_m.push(place_m.as_vec3());
                    // The three edges from the first corner: what lies around them is known by now.
                    let is_solid = corners & 1 == 1;
                    let is_cut = |other: u32| (corners >> other & 1 == 1) != is_solid;
                    let mut join = |around: [usize; 4]| {
                        net.join(around.map(|cell| place_of[cell]), is_solid != is_mirrored);
                    };
                    if is_cut(1) && y > 0 && z > 0 {
                        join([below + at - cells_x, below + at, here + at, here + at - cells_x]);
                    }
                    if is_cut(2) && z > 0 && x > 0 {
                        join([below + at - 1, here + at - 1, here + at, below + at]);
                    }
                    if is_cut(4) && x > 0 && y > 0 {
                        join([here + at - cells_x - 1, here + at - cells_x, here + at, here + at - 1]);
                    }
                }
            }
        }
    }
    (net.places_m, net.triangles)
}

struct Net {
    places_m: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl Net {
    /// Two triangles between the places around an edge.
    fn join(&mut self, [a, b, c, d]: [u32; 4], is_forward: bool) {
        self.triangles.extend(if is_forward { [[a, b, c], [a, c, d]] } else { [[d, c, b], [d, b, a]] });
    }
}

/// A bit for each of up to 64 voxels that is solid by more than half.
fn solid_bits(voxels: &[u8]) -> u64 {
    let mut bits = 0;
    let mut eights = voxels.chunks_exact(8);
    let mut place = 0;
    for eight in &mut eights {
        let upper = u64::from_le_bytes(std::array::from_fn(|i| eight[i])) >> 7 & 0x0101_0101_0101_0101;
        // Each of the eight bits lands in the top byte once, in its own place.
        bits |= (upper.wrapping_mul(0x0102_0408_1020_4080) >> 56) << place;
        place += 8;
    }
    for &voxel in eights.remainder() {
        bits |= u64::from(voxel >> 7) << place;
        place += 1;
    }
    bits
}

/// The lowest so many bits.
fn mask_below(count: usize) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

/// Which cells of a word have both solid and empty corners, from the four rows around them, each with the word that follows.
fn crossed_cells(rows: [[u64; 2]; 4]) -> u64 {
    let over =
        |join: fn(u64, u64) -> u64| [0, 1].map(|word| rows.iter().map(|row| row[word]).reduce(join).unwrap_or(0));
    let next = |[word, after]: [u64; 2]| word >> 1 | after << 63;
    let (any, all) = (over(|a, b| a | b), over(|a, b| a & b));
    (any[0] | next(any)) & !(all[0] & next(all))
}

/// Which corners of a cell are solid: bit 1 is one along X, 2 along Y, 4 along Z.
fn corner_bits(rows: [[u64; 2]; 4], bit: u32) -> u32 {
    let pair = |[word, after]: [u64; 2]| ((word >> bit | after << 1 << (63 - bit)) & 3) as u32;
    pair(rows[0]) | pair(rows[1]) << 2 | pair(rows[2]) << 4 | pair(rows[3]) << 6
}

/// Ends of the edges of a cell: four along X, four along Y, four along Z.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// For each choice of solid corners, which edges are cut.
const CUTS: [u16; 256] = {
    let mut cuts = [0; 256];
    let mut corners = 0;
    while corners < 256 {
        let mut edge = 0;
        while edge < 12 {
            let [from, to] = EDGES[edge];
            cuts[corners] |= (((corners >> from ^ corners >> to) & 1) << edge) as u16;
            edge += 1;
        }
        corners += 1;
    }
    cuts
};

/// For each choice of solid corners, the sum of what its cut edges have of the other two axes.
const ASIDE: [[u8; 3]; 256] = {
    let mut sums = [[0; 3]; 256];
    let mut corners = 0;
    while corners < 256 {
        let mut place = 0;
        while place < 36 {
            let (edge, axis) = (place / 3, place % 3);
            if CUTS[corners] >> edge & 1 == 1 && axis != edge / 4 {
                sums[corners][axis] += (EDGES[edge][0] >> axis & 1) as u8;
            }
            place += 1;
        }
        corners += 1;
    }
    sums
};

/// The mean of where the surface cuts the edges of a cell, from the cell's first corner.
fn middle_of_cuts(corners: u32, values: [u8; 8]) -> Vec3 {
    let corners = corners as usize & 255;
    let mut cuts = CUTS[corners];
    let count = cuts.count_ones() as f32;
    let mut sum = ASIDE[corners].map(f32::from);
    while cuts != 0 {
        let edge = cuts.trailing_zeros() as usize;
        cuts &= cuts - 1;
        let [from, to] = EDGES[edge].map(|corner| f32::from(values[corner]));
        sum[edge / 4] += (LEVEL - from) / (to - from);
    }
    Vec3::from_array(sum) / count
}
