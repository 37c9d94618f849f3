//! Pressure: what makes the flow free of divergence.

use super::field::{FRAME, Field, bands_of, for_rows_of_two, lines, lines_mut};
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
        wave::relax::<L>(&mut projection, from, &places.spans, reached, rounds, &mut room.wave);
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
    fn relax<L: Lanes>(&self, y: usize, [below, own, above]: [&[f32]; 3], divergence: &[f32], next: &mut [f32]) {
        for span in self.places.spans.of_row(y) {
            let columns = FRAME + span.start..FRAME + span.end;
            let (left, right) = (columns.start - 1..columns.end - 1, columns.start + 1..columns.end + 1);
            let around = [lines(own, left), lines(own, right.clone())];
            let around = [around[0], around[1], lines(below, columns.clone()), lines(above, columns.clone())];
            let divergence = lines(divergence, columns.clone());
            let next = lines_mut(next, columns.clone());
            if span.is_deep {
                let quarter = L::splat(0.25);
                for k in 0..next.len() {
                    for lane in (0..FRAME).step_by(L::COUNT) {
                        let sum = L::add(
                            L::add(L::load(&around[0][k][lane..]), L::load(&around[1][k][lane..])),
                            L::add(L::load(&around[2][k][lane..]), L::load(&around[3][k][lane..])),
                        );
                        let sum = L::sub(sum, L::load(&divergence[k][lane..]));
                        L::store(L::mul(quarter, sum), &mut next[k][lane..]);
                    }
                }
                continue;
            }
            let Places { open_x, open_y, .. } = self.places;
            let [open_x, open_y, open_above] =
                [open_x.row(y as isize), open_y.row(y as isize), open_y.row(y as isize + 1)];
            let open = [lines(open_x, columns.clone()), lines(open_x, right)];
            let open = [open[0], open[1], lines(open_y, columns.clone()), lines(open_above, columns)];
            for k in 0..next.len() {
                for lane in (0..FRAME).step_by(L::COUNT) {
                    let mut sides = [L::splat(0.0); 4];
                    let mut parts = sides;
                    for side in 0..4 {
                        sides[side] = L::load(&open[side][k][lane..]);
                        parts[side] = L::mul(sides[side], L::load(&around[side][k][lane..]));
                    }
                    let count = L::add(L::add(sides[0], sides[1]), L::add(sides[2], sides[3]));
                    let sum = L::add(L::add(parts[0], parts[1]), L::add(parts[2], parts[3]));
                    let sum = L::sub(sum, L::load(&divergence[k][lane..]));
                    // A cell without neighbours has no divergence either.
                    L::store(L::div(sum, L::max(count, L::splat(1.0))), &mut next[k][lane..]);
                }
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
