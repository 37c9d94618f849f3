//! Do the edges of four tiles fit one another, whichever meet?

use super::TILE_COUNT;
use bevy::reflect::Reflect;

/// The two edges that differ most where they would lie on each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct EdgeMismatch {
    /// The tiles, 0..=3.
    pub tiles: [u8; 2],
    /// Their edges: 0 from the first corner to the second, 1 from the second to the third, 2 back to the first.
    pub edges: [u8; 2],
    /// Where along each edge, 0..=1 counter-clockwise from its own start.
    pub along: [f32; 2],
    /// Largest difference of one 8-bit sRGB channel there.
    pub difference: u8,
}

/// Index, in rows of `steps + 1`, `steps`, .. 1 texels, of a texel on an edge, counted counter-clockwise.
pub(super) fn edge_texel(steps: usize, edge: usize, along: usize) -> usize {
    let (i, j) = match edge {
        0 => (along, 0),
        1 => (steps - along, along),
        _ => (0, steps - along),
    };
    j * (steps + 1) - j * j.saturating_sub(1) / 2 + i
}

/// Compares all edges of all tiles from both ends, texel by texel.
pub(super) fn worst_mismatch(steps: usize, tiles: &[Vec<[u8; 3]>; TILE_COUNT]) -> EdgeMismatch {
    let mut worst = EdgeMismatch::default();
    let fraction = |texel: usize| texel as f32 / steps as f32;
    for from_end in 0..=steps / 2 {
        for channel in 0..3 {
            let (mut low, mut high) = ((u8::MAX, 0, 0, 0), (u8::MIN, 0, 0, 0));
            for (tile, texels) in tiles.iter().enumerate() {
                for edge in 0..3 {
                    for along in [from_end, steps - from_end] {
                        let value = texels[edge_texel(steps, edge, along)][channel];
                        if value < low.0 || (tile, edge, along) == (0, 0, from_end) {
                            low = (value, tile, edge, along);
                        }
                        if value > high.0 || (tile, edge, along) == (0, 0, from_end) {
                            high = (value, tile, edge, along);
                        }
                    }
                }
            }
            let difference = high.0 - low.0;
            if difference > worst.difference {
                worst = EdgeMismatch {
                    tiles: [low.1 as u8, high.1 as u8],
                    edges: [low.2 as u8, high.2 as u8],
                    along: [fraction(low.3), fraction(high.3)],
                    difference,
                };
            }
        }
    }
    worst
}

/// Gives all edges the same texels: the mean over all of them, from both ends.
pub(super) fn unify(steps: usize, tiles: &mut [Vec<[u8; 3]>; TILE_COUNT]) {
    for from_end in 0..=steps / 2 {
        let places: Vec<(usize, usize)> = (0..TILE_COUNT * 3)
            .flat_map(|side| [from_end, steps - from_end].map(|along| (side / 3, edge_texel(steps, side % 3, along))))
            .collect();
        let count = places.len() as u32;
        let mean: [u8; 3] = std::array::from_fn(|channel| {
            let sum: u32 = places.iter().map(|&(tile, texel)| u32::from(tiles[tile][texel][channel])).sum();
            ((sum + count / 2) / count) as u8
        });
        for (tile, texel) in places {
            tiles[tile][texel] = mean;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEPS: usize = 6;
    const TEXELS: usize = (STEPS + 1) * (STEPS + 2) / 2;

    #[test]
    fn edges_run_around_the_triangle() {
        let ends = |edge| [edge_texel(STEPS, edge, 0), edge_texel(STEPS, edge, STEPS)];
        let corners = [0, STEPS, TEXELS - 1];
        assert_eq!(ends(0), [corners[0], corners[1]]);
        assert_eq!(ends(1), [corners[1], corners[2]]);
        assert_eq!(ends(2), [corners[2], corners[0]]);
        let mut all: Vec<usize> = (0..3).flat_map(|e| (0..STEPS).map(move |a| edge_texel(STEPS, e, a))).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 3 * STEPS);
    }

    #[test]
    fn one_wrong_texel_is_found_and_named_and_unifying_removes_it() {
        let mut tiles: [Vec<[u8; 3]>; TILE_COUNT] = std::array::from_fn(|_| vec![[100, 100, 100]; TEXELS]);
        assert_eq!(worst_mismatch(STEPS, &tiles).difference, 0);
        tiles[2][edge_texel(STEPS, 1, 2)][1] = 140;
        let worst = worst_mismatch(STEPS, &tiles);
        assert_eq!((worst.difference, worst.tiles[1], worst.edges[1], worst.along[1]), (40, 2, 1, 2.0 / 6.0));
        // Inside a tile anything goes.
        tiles[1][STEPS + 2] = [0; 3];
        assert_eq!(worst_mismatch(STEPS, &tiles), worst);
        unify(STEPS, &mut tiles);
        assert_eq!(worst_mismatch(STEPS, &tiles).difference, 0);
        assert_eq!(tiles[1][STEPS + 2], [0; 3]);
    }
}
