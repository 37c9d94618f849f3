//! Rounds of Jacobi's iteration, all in one go over the memory: while the first round is at a row, the second one follows a row
//! behind it, and so on. What lies between the first and the last stays in the cache.

use super::field::{FRAME, Field};
use super::spans::Spans;
use super::vectors::Lanes;
use std::ops::Range;

/// Most rounds of one go.
const MOST_ROUNDS: u32 = 12;

/// Rounds of each go, at most so many and about the same number in each.
pub(super) fn goes(rounds: u32) -> impl Iterator<Item = u32> {
    let count = rounds.div_ceil(MOST_ROUNDS);
    (0..count).map(move |go| rounds * (go + 1) / count - rounds * go / count)
}

/// What a round does with a row.
pub(super) trait Relaxation {
    /// Numbers of a row that all rounds need, over its spans.
    fn source(&self, y: usize, source: &mut [f32]);
    /// The next round's row over its spans, from the rows below, at and above it. All rows come with the frame on both sides.
    fn relax<L: Lanes>(&self, y: usize, below_own_above: [&[f32]; 3], source: &[f32], next: &mut [f32]);
    /// Takes a row of the last round, and of the one before.
    fn take(&mut self, y: usize, last: &[f32], before: &[f32]);
}

/// Rows in the work.
#[derive(Clone, Debug, Default)]
pub(super) struct Room(Vec<f32>);

/// Goes over some rows, for which the rounds' rows around them are worked out as well: bands do not wait for each other, and each
/// number comes out the same whatever the bands are.
#[inline(always)]
pub(super) fn relax<L: Lanes>(
    of: &mut impl Relaxation,
    from: &Field,
    spans: &Spans,
    rows: Range<usize>,
    rounds: u32,
    room: &mut Room,
) {
    let (rounds, height, length) = (rounds as usize, from.size.y as usize, from.stride() + FRAME);
    // A row of zeros, three rows for each round, and sources from the first to the last round.
    let sources = rounds + 1;
    room.0.resize(length * (1 + 3 * rounds + sources), 0.0);
    let (zeros, room) = room.0.split_at_mut(length);
    zeros.fill(0.0);
    let (slots, source_rows) = room.split_at_mut(length * 3 * rounds);
    // The frame is never written.
    let reads = FRAME + spans.columns.start.saturating_sub(1)..(FRAME + spans.columns.end + 1).min(length - FRAME);

    for time in rows.start.saturating_sub(rounds - 1) + 1..rows.end + rounds {
        for round in 1..=rounds {
            let Some(y) = time.checked_sub(round) else { break };
            // What the rounds that are left need around the rows.
            let left = rounds - round;
            if y + left < rows.start || y >= (rows.end + left).min(height) {
                continue;
            }
            let source = &mut source_rows[y % sources * length..][..length];
            if round == 1 {
                of.source(y, source);
            }
            let (earlier, now) = slots.split_at_mut((round - 1) * 3 * length);
            let row = |y: Option<usize>| match y.filter(|y| *y < height) {
                None => &*zeros,
                Some(y) if round == 1 => from.row(y as isize),
                Some(y) => &earlier[((round - 2) * 3 + y % 3) * length..][..length],
            };
            let next = &mut now[y % 3 * length..][..length];
            of.relax::<L>(y, [row(y.checked_sub(1)), row(Some(y)), row(Some(y + 1))], source, next);
            // Neighbours read beside the spans, where another row's numbers may lie.
            let mut gap = reads.start;
            for span in spans.of_row(y) {
                clear(&mut next[gap..FRAME + span.start]);
                gap = FRAME + span.end;
            }
            clear(&mut next[gap..reads.end]);
            if round == rounds {
                of.take(y, next, row(Some(y)));
            }
        }
    }
}

/// Most often there is nothing to clear.
#[inline(always)]
fn clear(gap: &mut [f32]) {
    if !gap.is_empty() {
        gap.fill(0.0);
    }
}
