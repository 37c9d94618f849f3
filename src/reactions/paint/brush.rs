//! A stroke made ready for painting, and the rows of texels that it is painted on.

use super::super::footprint::{Cell, Patch, RowQuadratic, Shape};
use super::super::texels::{MapSize, TILE_PX};
use super::{Profile, Stroke};

/// Texels that are blended at a time. Rows begin at multiples of it: every map and tile is a multiple of it wide.
pub(super) const CHUNK_PX: usize = 16;

/// Steps of a profile over the squared share of the radius.
pub(super) const PROFILE_STEPS: usize = 1024;

/// Entries of a profile's table: a power of two, so that a mask keeps every index inside. Those from
/// [`PROFILE_STEPS`] on are zero.
pub(super) const TABLE_LEN: usize = 2 * PROFILE_STEPS;

/// Full opacity. Fifteen bits: the largest number of which a signed 16-bit product keeps the high part.
pub(super) const OPAQUE: i16 = i16::MAX;

/// `a * b / 32768`, rounded to nearest, for numbers whose product stays below 2^30: what the processors' own instruction
/// for it does.
#[inline(always)]
pub(super) fn scaled(a: i16, b: i16) -> i16 {
    ((((i32::from(a) * i32::from(b)) >> 14) + 1) >> 1) as i16
}

/// Opacity from 0 to 1 in fifteen bits; what is no number is transparent.
pub(super) fn opacity_bits(opacity: f32) -> i16 {
    // The cast takes NaN to zero.
    (opacity.clamp(0.0, 1.0) * f32::from(OPAQUE)).round() as i16
}

/// A stroke as the inner loops want it.
#[derive(Clone, Copy)]
pub(super) struct Brush<'a> {
    cells: &'a [Cell],
    samples: &'a [f32],
    /// From squared shares of the footprint's radius to those of its own.
    squares_per_square: f32,
    pub(super) table: &'a [i32; TABLE_LEN],
    pub(super) opacity: i16,
    /// Red, green, blue and full opacity.
    pub(super) colour: [u8; 4],
    pub(super) gloss: u8,
    /// Rows that it touches, the last excluded.
    pub(super) rows: (u32, u32),
    /// Texels of its cells: what painting it costs, roughly.
    pub(super) area: u64,
}

impl<'a> Brush<'a> {
    /// `None` for a stroke that leaves no trace on a map of this size.
    pub(super) fn new(stroke: &Stroke<'a>, size: MapSize) -> Option<Self> {
        let Stroke { footprint, radius_m, profile, colour: [r, g, b], gloss, opacity } = *stroke;
        let Profile { table } = profile;
        let opacity = opacity_bits(opacity);
        if footprint.size() != size || opacity == 0 || radius_m.is_nan() || radius_m <= 0.0 {
            return None;
        }
        let cells = footprint.cells();
        let shrink = footprint.radius_m() / radius_m.min(footprint.radius_m());
        let squares_per_square = (shrink * shrink).min(1e30);
        let rows = cells.iter().map(|cell| (cell.rect.y, cell.rect.bottom()));
        let rows = rows.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let area = cells.iter().map(|cell| cell.rect.area()).sum();
        let colour = [r, g, b, u8::MAX];
        Some(Self {
            cells,
            samples: footprint.samples(),
            squares_per_square,
            table,
            opacity,
            colour,
            gloss,
            rows,
            area,
        })
    }
}

/// Whole rows of a map or a tile.
pub(super) struct Rows<'a> {
    pub(super) colour: &'a mut [[u8; 4]],
    pub(super) gloss: &'a mut [u8],
    /// Texels per row.
    pub(super) stride: usize,
    /// First column and row, texels of the map.
    pub(super) x: u32,
    pub(super) y: u32,
}

impl Rows<'_> {
    /// First column and row, the row after the last, and texels per row.
    pub(super) fn place(&self) -> (u32, u32, u32, usize) {
        (self.x, self.y, self.y + (self.gloss.len() / self.stride) as u32, self.stride)
    }

    /// Colours and glosses a chunk at a time.
    pub(super) fn chunks(&mut self) -> (&mut [[[u8; 4]; CHUNK_PX]], &mut [[u8; CHUNK_PX]]) {
        (self.colour.as_chunks_mut().0, self.gloss.as_chunks_mut().0)
    }
}

/// Rows whose spans are found side by side.
const BLOCK: usize = 8;

/// Distances and spans of a block of rows.
#[derive(Clone, Copy)]
struct Block {
    a: [f32; BLOCK],
    b: [f32; BLOCK],
    c: [f32; BLOCK],
    start: [i32; BLOCK],
    end: [i32; BLOCK],
}

impl Block {
    /// Rows of a patch from `first` on, squared distances times `factor`.
    #[inline(always)]
    fn new(patch: &Patch, width: i32, first: u32, factor: f32) -> Self {
        let mut block = Self { a: [0.0; BLOCK], b: [0.0; BLOCK], c: [0.0; BLOCK], start: [0; BLOCK], end: [0; BLOCK] };
        for k in 0..BLOCK {
            let row = patch.row((first as i32 + k as i32) as f32).scaled(factor);
            (block.a[k], block.b[k], block.c[k]) = (row.a, row.b, row.c);
            (block.start[k], block.end[k]) = row.span(width);
        }
        block
    }
}

/// How the texels of a chunk know their step of the profile.
pub(super) enum Steps {
    /// By the column from the cell's first one on: that of the chunk's first texel, the columns in between which texels
    /// may be painted, and the steps as a function of the column.
    Quadratic { column: f32, start: f32, end: f32, row: RowQuadratic },
    /// One by one.
    Listed([f32; CHUNK_PX]),
}

impl Steps {
    /// Step of a texel; [`PROFILE_STEPS`] where it is to be left alone.
    pub(super) fn at(&self, lane: usize) -> f32 {
        match *self {
            Self::Quadratic { column, start, end, row } => {
                let column = column + lane as f32;
                let step = row.at(column);
                // Written so that what is no number lies outside.
                let is_in = step < PROFILE_STEPS as f32 && column >= start && column < end;
                if is_in { step.max(0.0) } else { PROFILE_STEPS as f32 }
            }
            Self::Listed(steps) => steps[lane],
        }
    }
}

/// Walks the texels that a brush touches in the rows of one row of tiles, a chunk at a time. `allowed` are the ranges of
/// columns that may be painted, within the rows' own. `blend` gets the number of the chunk within
/// the rows and its steps.
#[inline(always)]
pub(super) fn for_each_chunk(
    brush: &Brush,
    (x, y, bottom, stride): (u32, u32, u32, usize),
    allowed: &[(u32, u32)],
    mut blend: impl FnMut(usize, Steps),
) {
    for cell in brush.cells {
        let rect = cell.rect;
        let (top, bottom) = (rect.y.max(y), rect.bottom().min(bottom));
        if top >= bottom {
            continue;
        }
        let count = (bottom - top).min(TILE_PX) as usize;
        // Column of the cell's first texel within the rows; tiles may begin beyond it.
        let left = rect.x as i32 - x as i32;
        let offset = (top - y) as usize * stride;
        match &cell.shape {
            Shape::Bilinear(patch) => {
                let mut block = Block::new(patch, rect.width as i32, top - rect.y, brush.squares_per_square);
                for k in 0..count {
                    let within = k % BLOCK;
                    if within == 0 && k > 0 {
                        let first = top - rect.y + k as u32;
                        block = Block::new(patch, rect.width as i32, first, brush.squares_per_square);
                    }
                    let row = RowQuadratic { a: block.a[within], b: block.b[within], c: block.c[within] };
                    let row = row.scaled(PROFILE_STEPS as f32);
                    let (start, end) = (block.start[within], block.end[within]);
                    for &(from, to) in allowed {
                        let (start, end) = (start.max(from as i32 - left), end.min(to as i32 - left));
                        let first = (start + left) as usize / CHUNK_PX * CHUNK_PX;
                        for chunk in (first..(end + left).max(0) as usize).step_by(CHUNK_PX) {
                            // Small whole numbers are exact as floating-point ones.
                            let [column, start, end] = [chunk as i32 - left, start, end].map(|column| column as f32);
                            blend(
                                (offset + k * stride + chunk) / CHUNK_PX,
                                Steps::Quadratic { column, start, end, row },
                            );
                        }
                    }
                }
            }
            &Shape::Sampled { first: sample } => {
                let sample = sample as usize + ((top - rect.y) * rect.width) as usize;
                let samples = brush.samples[sample..].chunks_exact(rect.width as usize).take(count);
                for (k, samples) in samples.enumerate() {
                    for &(from, to) in allowed {
                        let (start, end) = (left.max(from as i32), (left + rect.width as i32).min(to as i32));
                        let first = start / CHUNK_PX as i32 * CHUNK_PX as i32;
                        for chunk in (first..end).step_by(CHUNK_PX) {
                            let mut steps = [PROFILE_STEPS as f32; CHUNK_PX];
                            let (start, end) = (start.max(chunk), end.min(chunk + CHUNK_PX as i32));
                            let samples = &samples[(start - left) as usize..(end - left) as usize];
                            for (to, from) in steps[(start - chunk) as usize..].iter_mut().zip(samples) {
                                let step = from * brush.squares_per_square * PROFILE_STEPS as f32;
                                *to = step.min(PROFILE_STEPS as f32);
                            }
                            blend((offset + k * stride + chunk as usize) / CHUNK_PX, Steps::Listed(steps));
                        }
                    }
                }
            }
        }
    }
}
