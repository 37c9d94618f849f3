//! Viscosity and diffusion: implicit, so that any strength is stable.

use super::field::{FRAME, Field, bands_of};
use super::project::Room;
use super::spans::Spans;
use super::vectors::{Lanes, Vectors, Work};
use super::wave::{self, Relaxation};
use rayon::prelude::*;
use std::ops::Range;

/// What diffuses, where and how much.
#[derive(Clone, Copy)]
pub(super) struct Diffusion<'a> {
    /// 1 for numbers that take part, and 0 for others: nothing leaves through walls, and walls do not slow down what runs along
    /// them.
    pub there: &'a Field,
    pub spans: &'a Spans,
    pub vectors: Vectors,
    pub strength: f32,
    pub rounds: u32,
}

impl Diffusion<'_> {
    /// Solves `x - strength * sum over neighbours of (neighbour - x) = field` by rounds of Jacobi's iteration.
    pub fn run(&self, field: &mut Field, [now, next]: &mut [Field; 2], rooms: &mut Vec<Room>) {
        let bands = self.spans.bands_for_threads();
        rooms.resize_with(bands.len().max(rooms.len()), Room::default);
        for (go, rounds) in wave::goes(self.rounds).enumerate() {
            let (source, from) = (&*field, if go == 0 { &*field } else { &*now });
            let work = bands.par_iter().zip(rooms.par_iter_mut()).zip(bands_of(next, &bands)).with_max_len(1);
            work.for_each(|((rows, room), into)| {
                let band = Band { diffusion: *self, source, rows: rows.clone(), into };
                self.vectors.run(Rounds { band, from, rounds, room: &mut room.wave });
            });
            std::mem::swap(now, next);
        }
        std::mem::swap(field, now);
    }
}

struct Rounds<'a> {
    band: Band<'a>,
    from: &'a Field,
    rounds: u32,
    room: &'a mut wave::Room,
}

impl Work for Rounds<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let (spans, rows) = (self.band.diffusion.spans, self.band.rows.clone());
        wave::relax(&mut self.band, self.from, spans, rows, self.rounds, self.room);
    }
}

struct Band<'a> {
    diffusion: Diffusion<'a>,
    source: &'a Field,
    rows: Range<usize>,
    into: &'a mut [f32],
}

impl Relaxation for Band<'_> {
    #[inline(always)]
    fn source(&self, y: usize, source: &mut [f32]) {
        source.copy_from_slice(self.source.row(y as isize));
    }

    #[inline(always)]
    fn relax(&self, y: usize, [below, own, above]: [&[f32]; 3], source: &[f32], next: &mut [f32]) {
        let Diffusion { there, spans, strength, .. } = self.diffusion;
        let y = y as isize;
        for span in spans.of_row(y as usize) {
            let (first, count) = (FRAME + span.start, span.end - span.start);
            let (left, right) = (&own[first - 1..][..count], &own[first + 1..][..count]);
            let (below, above) = (&below[first..][..count], &above[first..][..count]);
            let source = &source[first..][..count];
            let out = &mut next[first..][..count];
            if span.is_deep {
                let whole = 1.0 + strength * 4.0;
                for k in 0..count {
                    let sum = left[k] + right[k] + below[k] + above[k];
                    out[k] = (source[k] + strength * sum) / whole;
                }
                continue;
            }
            let is_there = there.row(y);
            let (is_left, is_right) = (&is_there[first - 1..][..count], &is_there[first + 1..][..count]);
            let (is_below, is_above) = (&there.row(y - 1)[first..][..count], &there.row(y + 1)[first..][..count]);
            let is_there = &is_there[first..][..count];
            for k in 0..count {
                let sides = is_left[k] + is_right[k] + is_below[k] + is_above[k];
                let sum =
                    is_left[k] * left[k] + is_right[k] * right[k] + is_below[k] * below[k] + is_above[k] * above[k];
                out[k] = is_there[k] * (source[k] + strength * sum) / (1.0 + strength * sides);
            }
        }
    }

    #[inline(always)]
    fn take(&mut self, y: usize, last: &[f32], _: &[f32]) {
        let into = &mut self.into[(y - self.rows.start) * self.source.stride()..];
        for span in self.diffusion.spans.of_row(y) {
            let columns = FRAME + span.start..FRAME + span.end;
            into[columns.clone()].copy_from_slice(&last[columns]);
        }
    }
}
