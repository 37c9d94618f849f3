//! Numbers of cells, in memory as vectors like it.

use super::spans::Spans;
use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec2};
use rayon::prelude::*;
use std::ops::Range;

/// Numbers in front of each row. The first of a row's cells begins a line of the cache, and the last one's right neighbour is the
/// next row's frame.
pub(super) const FRAME: usize = 16;

/// Rows of a length that a thread takes at once at least: fewer cells are not worth the handing over.
pub(super) fn rows_at_once(stride: usize) -> usize {
    (4096 / stride).max(4)
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; FRAME]);

/// A number per cell, with a frame around them that stays 0. Rows are filled up to whole lines with more of the frame.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub size: UVec2,
    lines: Vec<Line>,
}

/// Columns of a row that is filled up.
pub(super) fn filled_width(size: UVec2) -> usize {
    (size.x as usize).next_multiple_of(FRAME)
}

impl Field {
    pub fn zero(size: UVec2) -> Self {
        let stride = filled_width(size) + FRAME;
        // One line more: the last row's frame to the right.
        let lines = stride / FRAME * (size.y as usize + 2) + 1;
        Self { size, lines: vec![Line::zeroed(); lines] }
    }

    pub fn stride(&self) -> usize {
        filled_width(self.size) + FRAME
    }

    pub fn values(&self) -> &[f32] {
        bytemuck::cast_slice(&self.lines)
    }

    pub fn values_mut(&mut self) -> &mut [f32] {
        bytemuck::cast_slice_mut(&mut self.lines)
    }

    /// Place in memory; also for one column and row more than the grid has.
    pub fn place(&self, cell: UVec2) -> usize {
        (cell.y as usize + 1) * self.stride() + cell.x as usize + FRAME
    }

    pub fn at(&self, cell: UVec2) -> f32 {
        self.values()[self.place(cell)]
    }

    pub fn at_mut(&mut self, cell: UVec2) -> &mut f32 {
        let place = self.place(cell);
        &mut self.values_mut()[place]
    }

    /// The numbers of a row of cells with the frame on both sides; the frame's rows come before 0 and after the last.
    pub fn row(&self, y: isize) -> &[f32] {
        let stride = self.stride();
        &self.values()[(y + 1) as usize * stride..][..stride + FRAME]
    }

    /// The rows of cells, each with the frame before it.
    pub fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [f32]> {
        let (stride, height) = (self.stride(), self.size.y as usize);
        self.values_mut()[stride..stride * (height + 1)].par_chunks_exact_mut(stride)
    }

    /// Puts a function of the cell and its number in the number's place, over the spans.
    pub fn update(&mut self, spans: &Spans, of: impl Fn(UVec2, f32) -> f32 + Sync) {
        let width = self.size.x as usize;
        for_rows(self, |y, row| {
            for span in spans.of_row(y) {
                for x in span.start..span.end.min(width) {
                    let cell = UVec2::new(x as u32, y as u32);
                    row[FRAME + x] = of(cell, row[FRAME + x]);
                }
            }
        });
    }

    /// Sum over the spans, the same for any number of threads.
    pub fn sum(&self, spans: &Spans) -> f64 {
        let rows: Vec<f64> = (0..self.size.y as usize)
            .into_par_iter()
            .with_min_len(rows_at_once(self.stride()))
            .map(|y| row_sum(self.row(y as isize), spans, y))
            .collect();
        rows.iter().sum()
    }
}

/// Sum of a row over its spans.
#[inline(always)]
pub(super) fn row_sum(row: &[f32], spans: &Spans, y: usize) -> f64 {
    // Sixteen sums at a time: one after another would wait for each addition.
    let mut sums = [0.0_f64; FRAME];
    for span in spans.of_row(y) {
        for line in row[FRAME + span.start..FRAME + span.end].as_chunks::<FRAME>().0 {
            for (sum, value) in sums.iter_mut().zip(line) {
                *sum += f64::from(*value);
            }
        }
    }
    sums.iter().sum()
}

/// Some of a row's numbers, sixteen at a time.
#[inline(always)]
pub(super) fn lines(row: &[f32], columns: Range<usize>) -> &[[f32; FRAME]] {
    row[columns].as_chunks().0
}

#[inline(always)]
pub(super) fn lines_mut(row: &mut [f32], columns: Range<usize>) -> &mut [[f32; FRAME]] {
    row[columns].as_chunks_mut().0
}

/// Calls a function for each row of cells: its number, and its numbers with the frame before them.
pub(super) fn for_rows(field: &mut Field, of: impl Fn(usize, &mut [f32]) + Sync) {
    let at_once = rows_at_once(field.stride());
    field.rows_mut().enumerate().with_min_len(at_once).for_each(|(y, row)| of(y, row));
}

/// The same for two fields of one size.
pub(super) fn for_rows_of_two([a, b]: &mut [Field; 2], of: impl Fn(usize, [&mut [f32]; 2]) + Sync) {
    let at_once = rows_at_once(a.stride());
    let rows = a.rows_mut().zip(b.rows_mut());
    rows.enumerate().with_min_len(at_once).for_each(|(y, (a, b))| of(y, [a, b]));
}

/// The rows of cells of some bands one after another, each with the frame before it.
pub(super) fn bands_of<'a>(field: &'a mut Field, bands: &[Range<usize>]) -> Vec<&'a mut [f32]> {
    let stride = field.stride();
    let (mut rest, mut first) = (field.values_mut(), 0);
    let band = |rows: &Range<usize>| {
        let (start, end) = ((rows.start + 1) * stride, (rows.end + 1) * stride);
        let band;
        (band, rest) = std::mem::take(&mut rest)[start - first..].split_at_mut(end - start);
        first = end;
        band
    };
    bands.iter().map(band).collect()
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
