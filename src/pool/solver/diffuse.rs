//! Viscosity and diffusion: implicit, so that any strength is stable.

use super::field::{Field, for_rows};
use super::spans::Spans;

/// Solves `x - strength * sum over neighbours of (neighbour - x) = field` by rounds of Jacobi's iteration. Only what is 1 in
/// `there` takes part: nothing leaves through walls, and walls do not slow down what runs along them.
pub(super) fn diffuse(
    field: &mut Field,
    room: &mut [Field; 2],
    there: &Field,
    spans: &Spans,
    strength: f32,
    rounds: u32,
) {
    let stride = field.stride();
    let [now, next] = room;
    now.values.copy_from_slice(&field.values);
    for _ in 0..rounds {
        let (source, from, there) = (&field.values, &now.values, &there.values);
        for_rows(next, spans, |y, row, start, end, _| {
            let first = (y + 1) * stride + start + 1;
            for (k, out) in row[start + 1..end + 1].iter_mut().enumerate() {
                let place = first + k;
                let around = [place - 1, place + 1, place - stride, place + stride];
                let count: f32 = around.iter().map(|&place| there[place]).sum();
                let sum: f32 = around.iter().map(|&place| there[place] * from[place]).sum();
                *out = there[place] * (source[place] + strength * sum) / (1.0 + strength * count);
            }
        });
        std::mem::swap(now, next);
    }
    std::mem::swap(field, now);
}
