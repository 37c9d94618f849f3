//! Pressure: what makes the flow free of divergence.

use super::field::{FRAME, Field, bands_of, for_rows_of_two};
use super::places::Places;
use super::vectors::{Lanes, Vectors, Work};
use super::wave::{self, Relaxation};
use rayon::prelude::*;
use std::ops::Range;

/// Rows in the work of a band.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    pub wave: wave::Room,
    /// Means of the last two rounds in a row and in the one below it.
    means: [Vec<f32>; 2],
}

/// Makes a velocity from a carried one by taking its divergence off. The pressure begins as it was, is made better by rounds of
/// Jacobi's iteration, and its differences between neighbouring cells are subtracted.
#[expect(clippy::too_many_arguments, reason = "all of the solver's fields but those that are dissolved")]
pub(super) fn project(
    carried: &[Field; 2],
    velocity: &mut [Field; 2],
    pressure: &mut Field,
    next: &mut Field,
    places: &Places,
    vectors: Vectors,
    rounds: u32,
    rooms: &mut Vec<Room>,
) {
    let bands = places.spans.bands_for_threads();
    rooms.resize_with(bands.len().max(rooms.len()), Room::default);
    let mut left = rounds;
    for rounds in wave::goes(rounds) {
        left -= rounds;
        let [u, v] = velocity.each_mut().map(|field| bands_of(field, &bands));
        let into = bands_of(next, &bands).into_iter().zip(u.into_iter().zip(v));
        let work = bands.par_iter().zip(rooms.par_iter_mut()).zip(into.collect::<Vec<_>>()).with_max_len(1);
        let from = &*pressure;
        work.for_each(|((rows, room), (pressure, (u, v)))| {
            let into = Into { pressure, velocity: (left == 0).then_some([u, v]) };
            vectors.run(Band { carried, from, places, rounds, rows: rows.clone(), into, room });
        });
        std::mem::swap(pressure, next);
    }
}

/// Where the results of a band go.
struct Into<'a> {
    pressure: &'a mut [f32],
    /// After the last round.
    velocity: Option<[&'a mut [f32]; 2]>,
}

struct Band<'a> {
    carried: &'a [Field; 2],
    from: &'a Field,
    places: &'a Places,
    rounds: u32,
    rows: Range<usize>,
    into: Into<'a>,
    room: &'a mut Room,
}

impl Work for Band<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { carried, from, places, rounds, rows, into, room } = self;
        let length = from.stride() + FRAME;
        room.means.iter_mut().for_each(|mean| {
            mean.clear();
            mean.resize(length, 0.0);
        });
        // Lower sides need the pressure below them.
        let first = if into.velocity.is_some() { rows.start.saturating_sub(1) } else { rows.start };
        let reached = first..rows.end;
        let mut projection = Projection { carried, places, rows, into, means: &mut room.means };
        wave::relax(&mut projection, from, &places.spans, reached, rounds, &mut room.wave);
    }
}

struct Projection<'a> {
    carried: &'a [Field; 2],
    places: &'a Places,
    rows: Range<usize>,
    into: Into<'a>,
    means: &'a mut [Vec<f32>; 2],
}

impl Relaxation for Projection<'_> {
    /// The divergence.
    #[inline(always)]
    fn source(&self, y: usize, source: &mut [f32]) {
        let [u, v] = [self.carried[0].row(y as isize), self.carried[1].row(y as isize)];
        let above = self.carried[1].row(y as isize + 1);
        for span in self.places.spans.of_row(y) {
            let (first, count) = (FRAME + span.start, span.end - span.start);
            let (u, right) = (&u[first..][..count], &u[first + 1..][..count]);
            let (v, above) = (&v[first..][..count], &above[first..][..count]);
            let out = &mut source[first..][..count];
            for k in 0..count {
                out[k] = right[k] - u[k] + above[k] - v[k];
            }
        }
    }

    #[inline(always)]
    fn relax(&self, y: usize, [below, own, above]: [&[f32]; 3], divergence: &[f32], next: &mut [f32]) {
        for span in self.places.spans.of_row(y) {
            let (first, count) = (FRAME + span.start, span.end - span.start);
            let (left, right) = (&own[first - 1..][..count], &own[first + 1..][..count]);
            let (below, above) = (&below[first..][..count], &above[first..][..count]);
            let divergence = &divergence[first..][..count];
            let out = &mut next[first..][..count];
            if span.is_deep {
                for k in 0..count {
                    out[k] = 0.25 * ((left[k] + right[k]) + (below[k] + above[k]) - divergence[k]);
                }
                continue;
            }
            let (open_x, open_y) = (self.places.open_x.row(y as isize), self.places.open_y.row(y as isize));
            let (open_left, open_right) = (&open_x[first..][..count], &open_x[first + 1..][..count]);
            let (open_below, open_above) =
                (&open_y[first..][..count], &self.places.open_y.row(y as isize + 1)[first..][..count]);
            for k in 0..count {
                let sides = (open_left[k] + open_right[k]) + (open_below[k] + open_above[k]);
                let sum = (open_left[k] * left[k] + open_right[k] * right[k])
                    + (open_below[k] * below[k] + open_above[k] * above[k]);
                // A cell without neighbours has no divergence either.
                out[k] = (sum - divergence[k]) / sides.max(1.0);
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, y: usize, last: &[f32], before: &[f32]) {
        let spans = &self.places.spans;
        let stride = self.carried[0].stride();
        // In a band's rows; none for the row below the band.
        let row = y.checked_sub(self.rows.start).map(|row| row * stride..(row + 1) * stride);
        let Some([u, v]) = &mut self.into.velocity else {
            let into = &mut self.into.pressure[row.expect("none below")];
            for span in spans.of_row(y) {
                let columns = FRAME + span.start..FRAME + span.end;
                into[columns.clone()].copy_from_slice(&last[columns]);
            }
            return;
        };
        let [below, own] = self.means.each_mut();
        std::mem::swap(below, own);
        // A checkerboard of high and low cells would change its sign in every round and never fade, and as each step begins with
        // the last one's pressure it would grow from step to step: the mean of the last two rounds has none.
        let reads = FRAME + spans.columns.start - 1..FRAME + spans.columns.end;
        for ((mean, last), before) in own[reads.clone()].iter_mut().zip(&last[reads.clone()]).zip(&before[reads]) {
            *mean = 0.5 * (last + before);
        }
        let Some(row) = row else { return };
        let (pressure, u, v) = (&mut self.into.pressure[row.clone()], &mut u[row.clone()], &mut v[row]);
        for span in spans.of_row(y) {
            let columns = FRAME + span.start..FRAME + span.end;
            pressure[columns.clone()].copy_from_slice(&own[columns]);
        }
        let from = [self.carried[0].row(y as isize), self.carried[1].row(y as isize)];
        less_gradient(self.places, y, [below, own], from, [u, v]);
    }
}

/// A row of velocities without the differences of the pressure between neighbouring cells.
#[inline(always)]
fn less_gradient(places: &Places, y: usize, [below, own]: [&[f32]; 2], from: [&[f32]; 2], [u, v]: [&mut [f32]; 2]) {
    for span in places.spans.of_row(y) {
        let (first, count) = (FRAME + span.start, span.end - span.start);
        let (left, below) = (&own[first - 1..][..count], &below[first..][..count]);
        let own = &own[first..][..count];
        let (from_u, from_v) = (&from[0][first..][..count], &from[1][first..][..count]);
        let (u, v) = (&mut u[first..][..count], &mut v[first..][..count]);
        if span.is_deep {
            for k in 0..count {
                u[k] = from_u[k] - (own[k] - left[k]);
                v[k] = from_v[k] - (own[k] - below[k]);
            }
        } else {
            let [open_x, open_y] = [&places.open_x, &places.open_y].map(|open| &open.row(y as isize)[first..][..count]);
            for k in 0..count {
                u[k] = from_u[k] - open_x[k] * (own[k] - left[k]);
                v[k] = from_v[k] - open_y[k] * (own[k] - below[k]);
            }
        }
    }
}

/// Makes a velocity from another one by taking the differences of the pressure between neighbouring cells off.
pub(super) fn subtract_gradient(
    velocity: &[Field; 2],
    pressure: &Field,
    places: &Places,
    vectors: Vectors,
    into: &mut [Field; 2],
) {
    for_rows_of_two(into, |y, into| vectors.run(Reflection { velocity, pressure, places, y, into }));
}

struct Reflection<'a> {
    velocity: &'a [Field; 2],
    pressure: &'a Field,
    places: &'a Places,
    y: usize,
    into: [&'a mut [f32]; 2],
}

impl Work for Reflection<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let y = self.y as isize;
        let from = [self.velocity[0].row(y), self.velocity[1].row(y)];
        let pressure = [self.pressure.row(y - 1), self.pressure.row(y)];
        less_gradient(self.places, self.y, pressure, from, self.into);
    }
}
