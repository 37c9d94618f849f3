//! Numbers of cells, and what lies where.

use super::spans::Spans;
use glam::{UVec2, Vec2};
use rayon::prelude::*;

/// Rows of a length that a thread takes at once at least: fewer cells are not worth the handing over.
fn rows_at_once(stride: usize) -> usize {
    (4096 / stride).max(4)
}

/// A number per cell, with a frame of one cell around them that stays 0.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub size: UVec2,
    pub values: Vec<f32>,
}

impl Field {
    pub fn zero(size: UVec2) -> Self {
        Self { size, values: vec![0.0; ((size.x + 2) * (size.y + 2)) as usize] }
    }

    pub fn stride(&self) -> usize {
        self.size.x as usize + 2
    }

    /// Place in memory; also for one column and row more than the grid has.
    pub fn place(&self, cell: UVec2) -> usize {
        (cell.y as usize + 1) * self.stride() + cell.x as usize + 1
    }

    pub fn at(&self, cell: UVec2) -> f32 {
        self.values[self.place(cell)]
    }

    pub fn at_mut(&mut self, cell: UVec2) -> &mut f32 {
        let place = self.place(cell);
        &mut self.values[place]
    }

    /// 0 where another field is 0.
    pub fn keep(&mut self, where_: &Field) {
        self.values.par_iter_mut().zip(&where_.values).for_each(|(value, kept)| {
            if *kept == 0.0 {
                *value = 0.0;
            }
        });
    }

    /// Puts a function of the cell and its number in the number's place, over the spans.
    pub fn update(&mut self, spans: &Spans, of: impl Fn(UVec2, f32) -> f32 + Sync) {
        for_rows(self, spans, |y, row, start, end, _| {
            for x in start..end {
                let cell = UVec2::new(x as u32, y as u32);
                row[x + 1] = of(cell, row[x + 1]);
            }
        });
    }

    /// Sum over the spans, the same for any number of threads.
    pub fn sum(&self, spans: &Spans) -> f64 {
        let stride = self.stride();
        let rows: Vec<f64> = self
            .values
            .par_chunks(stride)
            .skip(1)
            .take(self.size.y as usize)
            .enumerate()
            .with_min_len(rows_at_once(stride))
            .map(|(y, row)| {
                let of_span = |span: &super::spans::Span| {
                    // Eight sums at a time: one after another would wait for each addition.
                    let mut sums = [0.0_f64; 8];
                    for (place, value) in row[span.start + 1..span.end + 1].iter().enumerate() {
                        sums[place % 8] += f64::from(*value);
                    }
                    sums.iter().sum::<f64>()
                };
                spans.of_row(y).iter().map(of_span).sum()
            })
            .collect();
        rows.iter().sum()
    }

    /// Multiplies all numbers.
    pub fn scale(&mut self, spans: &Spans, by: f32) {
        for_rows(self, spans, |_, row, start, end, _| {
            row[start + 1..end + 1].iter_mut().for_each(|value| *value *= by)
        });
    }
}

/// Calls a function for each span of each row: the row's number, its numbers with the frame, where the span begins and ends
/// (columns), and whether no wall is near it.
pub(super) fn for_rows(field: &mut Field, spans: &Spans, of: impl Fn(usize, &mut [f32], usize, usize, bool) + Sync) {
    let (stride, height) = (field.stride(), field.size.y as usize);
    let rows = field.values.par_chunks_mut(stride).skip(1).take(height).enumerate().with_min_len(rows_at_once(stride));
    rows.for_each(|(y, row)| {
        for span in spans.of_row(y) {
            of(y, row, span.start, span.end, span.is_deep);
        }
    });
}

/// The same for two fields of one size.
pub(super) fn for_rows_of_two(
    [a, b]: &mut [Field; 2],
    spans: &Spans,
    of: impl Fn(usize, [&mut [f32]; 2], usize, usize, bool) + Sync,
) {
    let (stride, height) = (a.stride(), a.size.y as usize);
    let rows = a.values.par_chunks_mut(stride).zip(b.values.par_chunks_mut(stride));
    rows.skip(1).take(height).enumerate().with_min_len(rows_at_once(stride)).for_each(|(y, (a, b))| {
        for span in spans.of_row(y) {
            of(y, [&mut *a, &mut *b], span.start, span.end, span.is_deep);
        }
    });
}

/// Where the numbers of a field lie in their cells.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum At {
    Left,
    Below,
    Middle,
}

impl At {
    /// From a cell's middle to the number, cells.
    pub fn offset(self) -> Vec2 {
        match self {
            Self::Left => Vec2::new(-0.5, 0.0),
            Self::Below => Vec2::new(0.0, -0.5),
            Self::Middle => Vec2::ZERO,
        }
    }
}

/// What is fluid and what is wall, as factors: 1 or 0.
#[derive(Clone, Debug)]
pub(super) struct Places {
    /// Cells with fluid.
    pub wet: Field,
    /// Left sides with fluid on both sides, and lower ones.
    pub open_x: Field,
    pub open_y: Field,
    /// Sides with fluid on at least one side: in walls there is no velocity to interpolate with.
    pub known_x: Field,
    pub known_y: Field,
    /// Cells from each cell to the nearest wall, along rows, columns and diagonals; 1 beside one, 255 at most. With the frame.
    pub clearance: Vec<u8>,
}

impl Places {
    pub fn new(size: UVec2) -> Self {
        let field = || Field::zero(size);
        let clearance = vec![0; field().values.len()];
        Self { wet: field(), open_x: field(), open_y: field(), known_x: field(), known_y: field(), clearance }
    }

    pub fn set(&mut self, is_wet: impl Fn(UVec2) -> bool) {
        let size = self.wet.size;
        for y in 0..size.y {
            for x in 0..size.x {
                let cell = UVec2::new(x, y);
                *self.wet.at_mut(cell) = f32::from(u8::from(is_wet(cell)));
            }
        }
        let stride = self.wet.stride();
        for place in stride..self.wet.values.len() {
            let wet = &self.wet.values;
            let (own, left, below) = (wet[place], wet[place - 1], wet[place - stride]);
            self.open_x.values[place] = own * left;
            self.open_y.values[place] = own * below;
            self.known_x.values[place] = own.max(left);
            self.known_y.values[place] = own.max(below);
        }
        self.measure_clearance();
    }

    /// For numbers at a place of their cells: which of them mean something, and which of them move.
    pub fn known_and_open(&self, at: At) -> [&Field; 2] {
        match at {
            At::Left => [&self.known_x, &self.open_x],
            At::Below => [&self.known_y, &self.open_y],
            At::Middle => [&self.wet, &self.wet],
        }
    }

    /// Once down and once up: each cell from the four neighbours that were looked at before it.
    fn measure_clearance(&mut self) {
        let stride = self.wet.stride();
        let (first, last) = (stride + 1, self.wet.values.len() - stride - 1);
        self.clearance.fill(0);
        for place in first..last {
            let above = &self.clearance[place - stride - 1..place - stride + 2];
            let least = above.iter().fold(self.clearance[place - 1], |least, other| least.min(*other));
            self.clearance[place] = if self.wet.values[place] > 0.0 { least.saturating_add(1) } else { 0 };
        }
        for place in (first..last).rev() {
            let below = &self.clearance[place + stride - 1..place + stride + 2];
            let least = below.iter().fold(self.clearance[place + 1], |least, other| least.min(*other));
            self.clearance[place] = self.clearance[place].min(least.saturating_add(1));
        }
    }
}
