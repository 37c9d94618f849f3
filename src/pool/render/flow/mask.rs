//! What is fluid and what is wall, as the kernels read it.

use bevy::math::{Rect, UVec2};

/// Cells along the side of a tile.
const TILE: u32 = 32;
/// Numbers on the left of each row that stay 0.
const MARGIN: u32 = 4;

const WET: u32 = 1;
const OPEN_X: u32 = 2;
const OPEN_Y: u32 = 4;
const KNOWN_X: u32 = 8;
const KNOWN_Y: u32 = 16;

/// The cells of a pool that hold fluid, packed for the GPU; `shaders/pool/flow.wgsl` says how fields lie in memory.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PackedMask {
    /// Columns and rows of the grid.
    pub size: UVec2,
    /// Tiles along the sides, those without fluid among them.
    pub tiles_along: UVec2,
    /// Numbers from row to row.
    pub stride: u32,
    /// By place: bits of fluid and walls, and the distance to the nearest wall.
    pub words: Vec<u32>,
    /// By place / 4: the open sides of four cells.
    pub sides: Vec<u32>,
    /// First cells of the tiles with fluid, those without walls within reach first.
    pub tiles: Vec<u32>,
    /// How many of them have none.
    pub deep_tiles: u32,
    /// Cells with fluid.
    pub wet_cells: u32,
}

impl PackedMask {
    pub fn new(size: UVec2, is_wet: impl Fn(UVec2) -> bool) -> Self {
        let tiles_along = (size + TILE - 1) / TILE;
        let stride = tiles_along.x * TILE + MARGIN;
        // A frame of one row on both sides, one more for neighbours of what is clamped, and the margin after the last row.
        let count = ((tiles_along.y * TILE + 3) * stride + MARGIN) as usize;
        let place_of = |cell: UVec2| ((cell.y + 1) * stride + cell.x + MARGIN) as usize;
        let mut words = vec![0; count];
        let mut wet_of_tile = vec![0; (tiles_along.x * tiles_along.y) as usize];
        for y in 0..size.y {
            for x in 0..size.x {
                let cell = UVec2::new(x, y);
                if is_wet(cell) {
                    words[place_of(cell)] = WET;
                    wet_of_tile[(y / TILE * tiles_along.x + x / TILE) as usize] += 1;
                }
            }
        }
        let row = stride as usize;
        for place in (row..count).rev() {
            let is_wet = |place: usize| words[place] & WET == WET;
            let (own, left, below) = (is_wet(place), is_wet(place - 1), is_wet(place - row));
            let bit = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
            words[place] |= bit(own && left, OPEN_X)
                | bit(own && below, OPEN_Y)
                | bit(own || left, KNOWN_X)
                | bit(own || below, KNOWN_Y);
        }
        measure_clearance(&mut words, row);
        let sides = (0..count / 4).map(|four| sides_of_four(&words, four * 4, row)).collect();
        let (mut tiles, mut beside) = (Vec::new(), Vec::new());
        for y in 0..tiles_along.y {
            for x in 0..tiles_along.x {
                let wet = |x: u32, y: u32| wet_of_tile[(y * tiles_along.x + x) as usize];
                if wet(x, y) == 0 {
                    continue;
                }
                let within = |at: u32, end: u32| at > 0 && at + 1 < end;
                let is_deep = within(x, tiles_along.x)
                    && within(y, tiles_along.y)
                    && (y - 1..y + 2).all(|y| (x - 1..x + 2).all(|x| wet(x, y) == TILE * TILE));
                let list = if is_deep { &mut tiles } else { &mut beside };
                list.push((x * TILE) | ((y * TILE) << 16));
            }
        }
        let deep_tiles = tiles.len() as u32;
        tiles.append(&mut beside);
        let wet_cells = wet_of_tile.iter().sum();
        Self { size, tiles_along, stride, words, sides, tiles, deep_tiles, wet_cells }
    }

    /// The tiles with fluid that meet one of some rectangles, in cell coordinates.
    pub fn tiles_within(&self, reaches: &[Rect]) -> Vec<u32> {
        let is_within = |tile: &u32| {
            let low = UVec2::new(tile & 0xffff, tile >> 16).as_vec2();
            let cells = Rect::from_corners(low, low + (TILE - 1) as f32);
            reaches.iter().any(|reach| reach.min.cmple(cells.max).all() && reach.max.cmpge(cells.min).all())
        };
        self.tiles.iter().copied().filter(is_within).collect()
    }

    /// What of it travels to the GPU.
    pub fn bytes(&self) -> u64 {
        4 * (self.words.len() + self.sides.len() + self.tiles.len()) as u64
    }

    /// Numbers of a field with one number per place.
    pub fn places(&self) -> u64 {
        self.words.len() as u64
    }
}

/// Cells to the nearest wall along rows, columns and diagonals, 255 at most, into the second byte: once down and once up, each
/// cell from the four neighbours that were looked at before it.
fn measure_clearance(words: &mut [u32], stride: usize) {
    let clearance = |words: &[u32], place: usize| words[place] >> 8;
    let (first, last) = (stride + 1, words.len() - stride - 1);
    for place in first..last {
        let above = place - stride;
        let around = [place - 1, above - 1, above, above + 1].map(|place| clearance(words, place));
        let least = around.into_iter().min().unwrap_or(0);
        if words[place] & WET == WET {
            words[place] |= (least + 1).min(255) << 8;
        }
    }
    for place in (first..last).rev() {
        let below = place + stride;
        let around = [place + 1, below - 1, below, below + 1].map(|place| clearance(words, place));
        let least = around.into_iter().min().unwrap_or(0);
        let own = clearance(words, place).min(least + 1);
        words[place] = (words[place] & 255) | (own << 8);
    }
}

/// Open sides of four cells in a row, 4 bits each for left, right, below and above.
fn sides_of_four(words: &[u32], first: usize, stride: usize) -> u32 {
    let open = |place: usize, bit: u32| words.get(place).map_or(0, |word| u32::from(word & bit != 0));
    (0..4).fold(0, |bits, k| {
        let place = first + k;
        let own = open(place, OPEN_X)
            | open(place + 1, OPEN_X) << 4
            | open(place, OPEN_Y) << 8
            | open(place + stride, OPEN_Y) << 12;
        bits | own << k
    })
}
