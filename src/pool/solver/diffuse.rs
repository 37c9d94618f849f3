//! Viscosity and diffusion: implicit, so that any strength is stable.

use super::field::{FRAME, Field, bands_of, lines, lines_mut};
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
        wave::relax::<L>(&mut self.band, self.from, spans, rows, self.rounds, self.room);
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
    fn relax<L: Lanes>(&self, y: usize, [below, own, above]: [&[f32]; 3], source: &[f32], next: &mut [f32]) {
        let Diffusion { there, spans, strength, .. } = self.diffusion;
        let (one, strength) = (L::splat(1.0), L::splat(strength));
        let whole = L::add(one, L::mul(strength, L::splat(4.0)));
        for span in spans.of_row(y) {
            let columns = FRAME + span.start..FRAME + span.end;
            let (left, right) = (columns.start - 1..columns.end - 1, columns.start + 1..columns.end + 1);
            let rows = [lines(own, left.clone()), lines(own, right.clone())];
            let around = [rows[0], rows[1], lines(below, columns.clone()), lines(above, columns.clone())];
            let source = lines(source, columns.clone());
            let next = lines_mut(next, columns.clone());
            if span.is_deep {
                for k in 0..next.len() {
                    for lane in (0..FRAME).step_by(L::COUNT) {
                        let mut sum = L::load(&around[0][k][lane..]);
                        for side in &around[1..] {
                            sum = L::add(sum, L::load(&side[k][lane..]));
                        }
                        let sum = L::add(L::load(&source[k][lane..]), L::mul(strength, sum));
                        L::store(L::div(sum, whole), &mut next[k][lane..]);
                    }
                }
                continue;
            }
            let y = y as isize;
            let [is_below, is_there, is_above] = [y - 1, y, y + 1].map(|y| there.row(y));
            let are = [lines(is_there, left), lines(is_there, right)];
            let are = [are[0], are[1], lines(is_below, columns.clone()), lines(is_above, columns.clone())];
            let is_there = lines(is_there, columns);
            for k in 0..next.len() {
                for lane in (0..FRAME).step_by(L::COUNT) {
                    let (mut count, mut sum) = (L::splat(0.0), L::splat(0.0));
                    for side in 0..4 {
                        let is_there = L::load(&are[side][k][lane..]);
                        count = L::add(count, is_there);
                        sum = L::add(sum, L::mul(is_there, L::load(&around[side][k][lane..])));
                    }
                    let sum = L::add(L::load(&source[k][lane..]), L::mul(strength, sum));
                    let sum = L::mul(L::load(&is_there[k][lane..]), sum);
                    L::store(L::div(sum, L::add(one, L::mul(strength, count))), &mut next[k][lane..]);
                }
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
