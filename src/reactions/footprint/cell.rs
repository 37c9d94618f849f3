//! Rectangles of a footprint, and how far each of their texels lies from the disk's middle.

use super::super::texels::TexelRect;
use glam::DVec2;

/// Both local coordinates over a rectangle of texels, in shares of the disk's radius: coefficients of 1, x, y and xy,
/// where x and y count texels from the centre of the rectangle's first one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Patch {
    pub(crate) s: [f32; 4],
    pub(crate) t: [f32; 4],
}

/// Squared distance along a row, in squared shares of the radius: `a + (b + c x) x`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowQuadratic {
    pub(crate) a: f32,
    pub(crate) b: f32,
    pub(crate) c: f32,
}

impl Patch {
    /// Between values at the corners (0, 0), (width, 0), (0, height) and (width, height), in texels.
    pub(super) fn between(corners: [DVec2; 4], width: u32, height: u32) -> Self {
        let (width, height) = (f64::from(width), f64::from(height));
        let coefficients = |[c00, c10, c01, c11]: [f64; 4]| {
            let (along_x, along_y) = ((c10 - c00) / width, (c01 - c00) / height);
            [c00, along_x, along_y, (c11 - c10 - c01 + c00) / (width * height)].map(|value| value as f32)
        };
        Self { s: coefficients(corners.map(|corner| corner.x)), t: coefficients(corners.map(|corner| corner.y)) }
    }

    /// The same function, counted from another texel.
    fn counted_from(self, x: u32, y: u32) -> Self {
        let (x, y) = (x as f32, y as f32);
        let shift = |[c, cx, cy, cxy]: [f32; 4]| [c + cx * x + (cy + cxy * x) * y, cx + cxy * y, cy + cxy * x, cxy];
        Self { s: shift(self.s), t: shift(self.t) }
    }

    /// Squared distance along the row `y`.
    #[inline(always)]
    pub(crate) fn row(&self, y: f32) -> RowQuadratic {
        let ([s, sx, sy, sxy], [t, tx, ty, txy]) = (self.s, self.t);
        let (s, ds) = (s + sy * y, sx + sxy * y);
        let (t, dt) = (t + ty * y, tx + txy * y);
        RowQuadratic { a: s * s + t * t, b: 2.0 * (s * ds + t * dt), c: ds * ds + dt * dt }
    }
}

/// How far rounding may move the ends of a row's span, texels.
const SPAN_SLACK_PX: f32 = 1.0 / 64.0;

impl RowQuadratic {
    #[inline(always)]
    pub(crate) fn at(&self, x: f32) -> f32 {
        self.a + (self.b + self.c * x) * x
    }

    /// For another unit of length: the squared distance times `factor`.
    #[inline(always)]
    pub(crate) fn scaled(&self, factor: f32) -> Self {
        Self { a: self.a * factor, b: self.b * factor, c: self.c * factor }
    }

    /// All texels of `0..width` with a squared distance below one lie in the range, but for those at the very border of
    /// the disk that rounding may hide.
    #[inline(always)]
    pub(crate) fn span(&self, width: i32) -> (i32, i32) {
        let discriminant = self.b * self.b - 4.0 * self.c * (self.a - 1.0);
        let per_slope = 0.5 / self.c.max(f32::MIN_POSITIVE);
        let (middle, half) = (-self.b * per_slope, discriminant.max(0.0).sqrt() * per_slope);
        let (start, end) = (middle - half + (1.0 - SPAN_SLACK_PX), middle + half + (1.0 + SPAN_SLACK_PX));
        // A row that shows a single place is all in or all out. All by selection and not by branches, and within what a
        // cast can hold: rows are done side by side. Written so that what is no number is out.
        let is_flat = self.c <= f32::MIN_POSITIVE;
        let is_in = if is_flat { self.a < 1.0 } else { discriminant >= 0.0 };
        let (start, end) = if is_flat { (0.0, width as f32) } else { (start, end) };
        // Unlike a clamp, a maximum takes what is no number to zero.
        let within = |column: f32| whole(column.max(0.0).min(width as f32));
        (within(start), if is_in { within(end) } else { 0 })
    }
}

/// A number of texels from 0 to 2^22, rounded down.
#[inline(always)]
fn whole(texels: f32) -> i32 {
    // The sum has one in its last place, rounded to nearest; a cast would look for numbers that do not fit.
    const ONES: f32 = 8_388_608.0;
    let nearest = texels + ONES;
    let nearest_bits = nearest.to_bits() as i32 - ONES.to_bits() as i32;
    nearest_bits - i32::from(nearest - ONES > texels)
}

/// How a cell knows the distance of its texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Shape {
    /// By bilinear interpolation of the local coordinates.
    Bilinear(Patch),
    /// Texel by texel: the squared shares of the radius, row by row from here in the footprint's list.
    Sampled { first: u32 },
}

/// A rectangle of a footprint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    pub(crate) rect: TexelRect,
    pub(crate) shape: Shape,
}

impl Cell {
    /// The part of a bilinear rectangle that texels of the disk touch; `None` where there are none.
    pub(super) fn cropped(rect: TexelRect, patch: Patch) -> Option<Self> {
        let mut bounds = TexelRect::default();
        for y in 0..rect.height {
            let row = patch.row(y as f32);
            let (start, end) = row.span(rect.width as i32);
            let is_in = |&x: &i32| row.at(x as f32) < 1.0;
            if let (Some(first), Some(last)) = ((start..end).find(is_in), (start..end).rev().find(is_in)) {
                bounds = bounds.union(TexelRect { x: first as u32, y, width: (last + 1 - first) as u32, height: 1 });
            }
        }
        (!bounds.is_empty()).then(|| Self {
            rect: TexelRect { x: rect.x + bounds.x, y: rect.y + bounds.y, ..bounds },
            shape: Shape::Bilinear(patch.counted_from(bounds.x, bounds.y)),
        })
    }

    /// Texel by texel: what is farther than the radius all round is left off, the rest goes to the end of `samples`.
    /// `None` where nothing is nearer.
    pub(super) fn sampled(rect: TexelRect, r_squared: &[f32], samples: &mut Vec<f32>) -> Option<Self> {
        let mut bounds = TexelRect::default();
        for (y, row) in (0..).zip(r_squared.chunks_exact(rect.width as usize)) {
            let is_in = |&r_squared: &f32| r_squared < 1.0;
            if let (Some(first), Some(last)) = (row.iter().position(is_in), row.iter().rposition(is_in)) {
                let (x, width) = (first as u32, (last + 1 - first) as u32);
                bounds = bounds.union(TexelRect { x, y, width, height: 1 });
            }
        }
        if bounds.is_empty() {
            return None;
        }
        let first = samples.len() as u32;
        let rows = r_squared.chunks_exact(rect.width as usize);
        for row in rows.skip(bounds.y as usize).take(bounds.height as usize) {
            samples.extend_from_slice(&row[bounds.x as usize..bounds.right() as usize]);
        }
        let rect = TexelRect { x: rect.x + bounds.x, y: rect.y + bounds.y, ..bounds };
        Some(Self { rect, shape: Shape::Sampled { first } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_takes_its_corners_and_is_the_same_from_any_texel() {
        let corners = [DVec2::new(-1.0, 0.5), DVec2::new(2.0, 0.0), DVec2::new(0.0, -3.0), DVec2::new(1.0, 1.0)];
        let patch = Patch::between(corners, 6, 3);
        for (corner, (x, y)) in corners.iter().zip([(0.0, 0.0), (6.0, 0.0), (0.0, 3.0), (6.0, 3.0)]) {
            let r_squared = patch.row(y).at(x);
            assert!((f64::from(r_squared) - corner.length_squared()).abs() < 1e-5, "{r_squared} at {corner}");
            let moved = patch.counted_from(2, 1).row(y - 1.0).at(x - 2.0);
            assert!((moved - r_squared).abs() < 1e-5);
        }
    }

    #[test]
    fn spans_hold_every_texel_of_the_disk() {
        for k in 0..2000 {
            let angle = k as f32 * 0.37;
            let (sin, cos) = angle.sin_cos();
            let (across, along) = (0.05 + 0.001 * k as f32, 0.9 / (1.0 + k as f32 * 0.01));
            let patch = Patch {
                s: [-0.7 - 0.01 * k as f32, cos * across, sin * across, 0.0],
                t: [0.3, -sin * along, cos * along, 0.0],
            };
            for y in 0..20 {
                let row = patch.row(y as f32);
                let (start, end) = row.span(40);
                for x in 0..40 {
                    assert!((start..end).contains(&x) || row.at(x as f32) > 1.0 - 1e-4, "{k}: {x}, {y}");
                }
                assert!((start..end).filter(|&x| row.at(x as f32) >= 1.0).count() <= 2, "{k}: {y}");
            }
        }
    }
}
