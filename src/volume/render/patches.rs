//! Pixels that are walked anew: rectangles that do not overlap, so that none is walked twice.

use bevy::prelude::*;

/// Pixels along the side of the tiles of which overlapping rectangles are put together.
const TILE: u32 = 32;

/// Any rectangles of a view, in pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Patches(Vec<URect>);

impl Patches {
    /// Adds a rectangle.
    pub fn add(&mut self, pixels: URect) {
        if !pixels.is_empty() {
            self.0.push(pixels);
        }
    }

    /// Of all of them only what lies within a rectangle.
    pub fn clip(&mut self, within: URect) {
        self.0 = self.0.iter().map(|pixels| pixels.intersect(within)).filter(|pixels| !pixels.is_empty()).collect();
    }

    /// The rectangle around all of them.
    pub fn bounds(&self) -> URect {
        self.0.iter().copied().reduce(|a, b| a.union(b)).unwrap_or(URect::EMPTY)
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Rectangles that hold the same pixels and some beside them, none of them in two.
    pub fn disjoint(&self) -> Vec<URect> {
        let bounds = self.bounds();
        if self.0.len() < 2 || self.0.contains(&bounds) {
            return if bounds.is_empty() { Vec::new() } else { vec![bounds] };
        }
        let (first, last) = (bounds.min / TILE, (bounds.max - 1) / TILE);
        let tiles = last - first + 1;
        let mut is_touched = vec![false; (tiles.x * tiles.y) as usize];
        for pixels in &self.0 {
            let (low, high) = (pixels.min / TILE - first, (pixels.max - 1) / TILE - first);
            for y in low.y..=high.y {
                is_touched[(y * tiles.x + low.x) as usize..=(y * tiles.x + high.x) as usize].fill(true);
            }
        }
        let mut found: Vec<URect> = Vec::new();
        for (y, row) in is_touched.chunks(tiles.x as usize).enumerate() {
            let mut x = 0;
            while x < row.len() {
                let run = row[x..].iter().take_while(|is_touched| **is_touched).count();
                if run > 0 {
                    let min = (first + UVec2::new(x as u32, y as u32)) * TILE;
                    let pixels = URect { min, max: min + UVec2::new(run as u32, 1) * TILE }.intersect(bounds);
                    // What goes on from the row above is one with it.
                    match found.iter_mut().find(|above| {
                        (above.min.x, above.max.x, above.max.y) == (pixels.min.x, pixels.max.x, pixels.min.y)
                    }) {
                        Some(above) => above.max.y = pixels.max.y,
                        None => found.push(pixels),
                    }
                }
                x += run + 1;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_pixel_is_in_one_rectangle(corners in prop::collection::vec((0_u32..300, 0_u32..200, 0_u32..150, 0_u32..150), 0..12)) {
            let mut patches = Patches::default();
            for (x, y, width, height) in corners {
                let min = UVec2::new(x, y);
                patches.add(URect { min, max: min + UVec2::new(width, height) });
            }
            let found = patches.disjoint();
            for y in 0..360 {
                for x in 0..460 {
                    let is_in = |pixels: &&URect| {
                        let at = UVec2::new(x, y);
                        at.cmpge(pixels.min).all() && at.cmplt(pixels.max).all()
                    };
                    let count = found.iter().filter(is_in).count();
                    prop_assert!(count <= 1);
                    prop_assert!(count == 1 || !patches.0.iter().any(|pixels| is_in(&pixels)));
                    prop_assert!(count == 0 || is_in(&&patches.bounds()));
                }
            }
        }
    }

    #[test]
    fn a_thin_diagonal_takes_little() {
        let mut patches = Patches::default();
        for k in 0..16 {
            let min = UVec2::splat(k * 32);
            patches.add(URect { min, max: min + 40 });
        }
        let area = |of: &[URect]| of.iter().map(|pixels| pixels.width() * pixels.height()).sum::<u32>();
        assert!(area(&patches.disjoint()) * 4 < area(&[patches.bounds()]));
    }
}
