//! What lies where in a pool: fluid and walls.

use super::MAX_CELLS_PER_STEP;
use super::field::{At, FRAME, Field, rows_at_once};
use super::spans::{self, Span, Spans};
use crate::pool::WetMask;
use glam::UVec2;
use rayon::prelude::*;
use std::ops::Range;

/// Farther walls make no difference: nothing is read from farther away than the longest way and two cells.
const FARTHEST: u8 = MAX_CELLS_PER_STEP as u8 + 3;

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
    /// Cells from each cell to the nearest wall, along rows, columns and diagonals; 1 beside one, [`FARTHEST`] at most. In the
    /// fields' order, with their frame.
    pub clearance: Vec<u8>,
    /// The same along rows only.
    clearance_in_row: Vec<u8>,
    pub spans: Spans,
}

impl Places {
    /// Walls all over.
    pub fn new(size: UVec2) -> Self {
        let field = || Field::zero(size);
        let clearance = vec![0; field().values().len()];
        Self {
            wet: field(),
            open_x: field(),
            open_y: field(),
            known_x: field(),
            known_y: field(),
            clearance_in_row: clearance.clone(),
            clearance,
            spans: Spans::none(size.y as usize),
        }
    }

    /// For numbers at a place of their cells: which of them mean something, and which of them move.
    pub fn known_and_open(&self, at: At) -> [&Field; 2] {
        match at {
            At::Left => [&self.known_x, &self.open_x],
            At::Below => [&self.known_y, &self.open_y],
            At::Middle => [&self.wet, &self.wet],
        }
    }

    /// Fluid is where a mask says, which differs in some rows only from what was. Returns these rows' spans as they were.
    pub fn set(&mut self, mask: &WetMask, rows: Range<usize>) -> Vec<Vec<Span>> {
        let (stride, height) = (self.wet.stride(), self.wet.size.y as usize);
        let at_once = rows_at_once(stride);
        let around = |more: usize| rows.start.saturating_sub(more)..(rows.end + more).min(height);

        let in_rows = self.clearance_in_row[stride..].par_chunks_exact_mut(stride);
        let wet = self.wet.rows_mut().zip(in_rows).enumerate().skip(rows.start).take(rows.len());
        wet.with_min_len(at_once).for_each(|(y, (wet, clearance))| {
            let is_wet = mask.row(y);
            wet[FRAME..].iter_mut().zip(is_wet).for_each(|(wet, is_wet)| *wet = f32::from(u8::from(*is_wet)));
            measure_row(is_wet, &mut clearance[FRAME..]);
        });

        // In memory from the first row's frame to the end of the row after the last, whose lower sides change too.
        let (first, end) = ((rows.start + 1) * stride, (rows.end + 2) * stride);
        let wet = self.wet.values();
        let [open_x, open_y, known_x, known_y] =
            [&mut self.open_x, &mut self.open_y, &mut self.known_x, &mut self.known_y]
                .map(|field| field.values_mut()[first..end].par_chunks_exact_mut(stride));
        let sides = open_x.zip(open_y).zip(known_x).zip(known_y).enumerate();
        sides.with_min_len(at_once).for_each(|(row, (((open_x, open_y), known_x), known_y))| {
            let first = first + row * stride;
            let (own, left) = (&wet[first..][..stride], &wet[first - 1..][..stride]);
            let below = &wet[first - stride..][..stride];
            for k in 0..stride {
                open_x[k] = own[k] * left[k];
                open_y[k] = own[k] * below[k];
                known_x[k] = own[k].max(left[k]);
                known_y[k] = own[k].max(below[k]);
            }
        });

        let far = around(usize::from(FARTHEST));
        let in_rows = &self.clearance_in_row;
        let clearance = self.clearance[stride..].par_chunks_exact_mut(stride).enumerate();
        clearance.skip(far.start).take(far.len()).with_min_len(at_once).for_each(|(y, clearance)| {
            measure_across(in_rows, stride, height, y, clearance);
        });

        let before = self.spans.rows_mut()[rows.clone()].iter_mut().map(std::mem::take).collect();
        let (wet, clearance, width) = (&self.wet, &self.clearance, stride - FRAME);
        for y in around(spans::DEEP) {
            let clearance = &clearance[(y + 1) * stride + FRAME..][..width];
            spans::join(&wet.row(y as isize)[FRAME..][..width], clearance, &mut self.spans.rows_mut()[y]);
        }
        self.spans.count();
        before
    }
}

/// Cells to the nearest wall of the row, where the grid ends at the latest.
fn measure_row(is_wet: &[bool], clearance: &mut [u8]) {
    let mut run = 0;
    for (clearance, is_wet) in clearance.iter_mut().zip(is_wet) {
        run = if *is_wet { FARTHEST.min(run + 1) } else { 0 };
        *clearance = run;
    }
    run = 0;
    for (clearance, is_wet) in clearance.iter_mut().zip(is_wet).rev() {
        run = if *is_wet { FARTHEST.min(run + 1) } else { 0 };
        *clearance = run.min(*clearance);
    }
}

/// Cells to the nearest wall from those within rows: the way to a wall of another row is the longer one of along and across.
fn measure_across(in_rows: &[u8], stride: usize, height: usize, y: usize, clearance: &mut [u8]) {
    let row = |y: usize| &in_rows[(y + 1) * stride..][..stride];
    clearance.copy_from_slice(row(y));
    // Beyond the grid there are walls.
    let edge = FARTHEST.min((y + 1).min(height - y).min(usize::from(FARTHEST)) as u8);
    clearance.iter_mut().for_each(|own| *own = edge.min(*own));
    for away in 1..edge {
        for other in [row(y - usize::from(away)), row(y + usize::from(away))] {
            for (own, other) in clearance.iter_mut().zip(other) {
                *own = (*other).max(away).min(*own);
            }
        }
    }
}
