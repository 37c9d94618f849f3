//! Blending in plain Rust: what it does, and what any processor can do.

use super::brush::{Brush, Rows, TABLE_LEN, for_each_chunk, scaled};

/// Paints a brush's texels in some rows and ranges of columns.
pub(super) fn paint(rows: &mut Rows, brush: &Brush, allowed: &[(u32, u32)]) {
    let place = rows.place();
    let (colours, glosses) = rows.chunks();
    for_each_chunk(brush, place, allowed, |chunk, steps| {
        for (lane, (colour, gloss)) in colours[chunk].iter_mut().zip(&mut glosses[chunk]).enumerate() {
            let alpha = scaled(brush.table[steps.at(lane) as usize % TABLE_LEN] as i16, brush.opacity);
            for (to, from) in colour.iter_mut().zip(brush.colour) {
                *to = lerp(*to, from, alpha);
            }
            *gloss = lerp(*gloss, brush.gloss, alpha);
        }
    });
}

/// The share `alpha` of the way from one byte to another, to the nearest. It never falls as either byte rises, so a
/// premultiplied colour never gets brighter than its alpha.
fn lerp(from: u8, to: u8, alpha: i16) -> u8 {
    (i16::from(from) + scaled(i16::from(to) - i16::from(from), alpha)) as u8
}

#[cfg(test)]
mod tests {
    use super::super::brush::OPAQUE;
    use super::*;

    #[test]
    fn lerp_is_monotone_and_exact_at_both_ends() {
        for alpha in [0, 1, 63, 64, 4000, 16384, 32000, OPAQUE - 1, OPAQUE] {
            for from in 0..=255u8 {
                for to in 0..=255u8 {
                    let blended = lerp(from, to, alpha);
                    let exact = f64::from(from) + (f64::from(to) - f64::from(from)) * f64::from(alpha) / 32768.0;
                    assert!((f64::from(blended) - exact).abs() < 0.5001, "{from} {to} {alpha}");
                    assert!(from == 255 || blended <= lerp(from + 1, to, alpha));
                    assert!(to == 255 || blended <= lerp(from, to + 1, alpha));
                }
            }
            assert_eq!(lerp(7, 7, alpha), 7);
        }
        assert_eq!((lerp(3, 250, 0), lerp(3, 250, OPAQUE), lerp(250, 3, OPAQUE)), (3, 250, 3));
    }
}
