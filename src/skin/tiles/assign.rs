//! Which tile, in which rotation, goes on which texture triangle.

use super::TILE_COUNT;
use bevy::reflect::Reflect;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// A tile and how it is turned on its triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect)]
pub struct TileChoice {
    /// Layer of the texture array, 0..=3.
    pub tile: u8,
    /// By how many corners the tile is turned, 0..=2; see [`super::tile_uv`].
    pub rotation: u8,
}

/// Chooses a tile and a rotation for every triangle of a texture mesh.
///
/// The choice is a seeded hash of the triangle's number, except that a triangle never gets the tile of a neighbour
/// with a smaller number: with three neighbours at most, one of the four tiles is always left. `triangle_neighbours`
/// are the triangles across each triangle's edges; numbers out of range (such as [`crate::organ::mesh::NO_FACE`])
/// mean that there is none. If the relation is mutual, no two neighbours show the same tile.
pub fn assign_tiles(triangle_neighbours: &[[u32; 3]], seed: u64) -> Vec<TileChoice> {
    let mut choices: Vec<TileChoice> = Vec::with_capacity(triangle_neighbours.len());
    for (triangle, neighbours) in triangle_neighbours.iter().enumerate() {
        let mut random = Pcg32::seed_from_u64(seed ^ (triangle as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let taken = |tile: u8| {
            neighbours.iter().any(|&other| choices.get(other as usize).is_some_and(|choice| choice.tile == tile))
        };
        let free: Vec<u8> = (0..TILE_COUNT as u8).filter(|&tile| !taken(tile)).collect();
        let pick = random.random_range(0..12usize);
        // Three neighbours leave at least one of four tiles, so `free` is never empty.
        let tile = free.get(pick % free.len().max(1)).copied().unwrap_or_default();
        choices.push(TileChoice { tile, rotation: random.random_range(0..3u8) });
    }
    choices
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring(count: u32) -> Vec<[u32; 3]> {
        (0..count).map(|t| [(t + 1) % count, (t + count - 1) % count, (t + count / 2) % count]).collect()
    }

    #[test]
    fn neighbours_never_show_the_same_tile() {
        let neighbours = ring(1000);
        let choices = assign_tiles(&neighbours, 7);
        for (triangle, others) in neighbours.iter().enumerate() {
            for &other in others {
                assert_ne!(choices[triangle].tile, choices[other as usize].tile);
            }
        }
    }

    #[test]
    fn all_tiles_and_rotations_are_used_about_equally() {
        let choices = assign_tiles(&vec![[u32::MAX; 3]; 12_000], 3);
        for tile in 0..4 {
            for rotation in 0..3 {
                let count = choices.iter().filter(|c| **c == TileChoice { tile, rotation }).count();
                assert!((850..1150).contains(&count), "{tile} {rotation}: {count}");
            }
        }
    }

    #[test]
    fn the_seed_decides() {
        let neighbours = ring(100);
        assert_eq!(assign_tiles(&neighbours, 1), assign_tiles(&neighbours, 1));
        assert_ne!(assign_tiles(&neighbours, 1), assign_tiles(&neighbours, 2));
        assert!(assign_tiles(&[], 1).is_empty());
    }
}
