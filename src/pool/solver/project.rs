//! Pressure: what makes the flow free of divergence.

use super::field::{Field, Places, for_rows, for_rows_of_two};
use super::spans::Spans;

/// Takes the divergence off a velocity. The pressure begins as it was, is made better by rounds of Jacobi's iteration, and its
/// differences between neighbouring cells are subtracted.
pub(super) fn project(
    velocity: &mut [Field; 2],
    pressure: &mut Field,
    next: &mut Field,
    divergence: &mut Field,
    places: &Places,
    spans: &Spans,
    rounds: u32,
) {
    let stride = pressure.stride();
    let [u, v] = &*velocity;
    for_rows(divergence, spans, |y, row, start, end, _| {
        let first = (y + 1) * stride + start + 1;
        let count = end - start;
        let (u, right) = (&u.values[first..first + count], &u.values[first + 1..][..count]);
        let (v, above) = (&v.values[first..first + count], &v.values[first + stride..][..count]);
        let out = &mut row[start + 1..end + 1];
        for k in 0..count {
            out[k] = right[k] - u[k] + above[k] - v[k];
        }
    });
    for _ in 0..rounds {
        jacobi(pressure, next, divergence, places, spans);
        std::mem::swap(pressure, next);
    }
    // A checkerboard of high and low cells would change its sign in every round and never fade, and as each step begins with the
    // last one's pressure it would grow from step to step: the mean of the last two rounds has none.
    mean_of(pressure, next, spans);
    subtract_gradient(velocity, pressure, places, spans);
}

/// Takes the differences of the pressure between neighbouring cells off a velocity.
pub(super) fn subtract_gradient(velocity: &mut [Field; 2], pressure: &Field, places: &Places, spans: &Spans) {
    let stride = pressure.stride();
    for_rows_of_two(velocity, spans, |y, [u, v], start, end, is_deep| {
        let first = (y + 1) * stride + start + 1;
        let count = end - start;
        let own = &pressure.values[first..first + count];
        let (left, below) = (&pressure.values[first - 1..][..count], &pressure.values[first - stride..][..count]);
        let (u, v) = (&mut u[start + 1..end + 1], &mut v[start + 1..end + 1]);
        if is_deep {
            for k in 0..count {
                u[k] -= own[k] - left[k];
                v[k] -= own[k] - below[k];
            }
        } else {
            let (open_x, open_y) = (&places.open_x.values[first..][..count], &places.open_y.values[first..][..count]);
            for k in 0..count {
                u[k] -= open_x[k] * (own[k] - left[k]);
                v[k] -= open_y[k] * (own[k] - below[k]);
            }
        }
    });
}

fn mean_of(pressure: &mut Field, other: &Field, spans: &Spans) {
    let stride = pressure.stride();
    for_rows(pressure, spans, |y, row, start, end, _| {
        let other = &other.values[(y + 1) * stride..][start + 1..end + 1];
        row[start + 1..end + 1].iter_mut().zip(other).for_each(|(own, other)| *own = 0.5 * (*own + other));
    });
}

fn jacobi(pressure: &Field, next: &mut Field, divergence: &Field, places: &Places, spans: &Spans) {
    let stride = pressure.stride();
    for_rows(next, spans, |y, row, start, end, is_deep| {
        let first = (y + 1) * stride + start + 1;
        let count = end - start;
        let p = &pressure.values;
        let (left, right) = (&p[first - 1..][..count], &p[first + 1..][..count]);
        let (below, above) = (&p[first - stride..][..count], &p[first + stride..][..count]);
        let divergence = &divergence.values[first..][..count];
        let out = &mut row[start + 1..end + 1];
        if is_deep {
            for k in 0..count {
                out[k] = 0.25 * ((left[k] + right[k]) + (below[k] + above[k]) - divergence[k]);
            }
            return;
        }
        let (x, y) = (&places.open_x.values, &places.open_y.values);
        let (open_left, open_right) = (&x[first..][..count], &x[first + 1..][..count]);
        let (open_below, open_above) = (&y[first..][..count], &y[first + stride..][..count]);
        for k in 0..count {
            let sides = (open_left[k] + open_right[k]) + (open_below[k] + open_above[k]);
            let sum = (open_left[k] * left[k] + open_right[k] * right[k])
                + (open_below[k] * below[k] + open_above[k] * above[k]);
            // A cell without neighbours has no divergence either.
            out[k] = (sum - divergence[k]) / sides.max(1.0);
        }
    });
}
