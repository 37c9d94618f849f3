//! Rectangles and tiles of a reaction map's texels.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Side of the square tiles in which permanent effects and heat are stored and the map is restored, texels.
pub const TILE_PX: u32 = 32;

/// Size of a reaction map in texels. Both sides are multiples of [`TILE_PX`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct MapSize {
    /// Texels per row; `u` runs along it.
    pub width_px: u32,
    /// Rows; the first has the least `v`.
    pub height_px: u32,
}

impl MapSize {
    /// A map of this width, half as high as it is wide, as longitude over a full and colatitude over half a turn ask
    /// for. The width is brought between 64 and 8192 and to the next multiple of 64.
    pub fn from_width(width_px: u32) -> Self {
        let width_px = width_px.clamp(2 * TILE_PX, 8192).next_multiple_of(2 * TILE_PX);
        Self { width_px, height_px: width_px / 2 }
    }

    /// The whole map.
    pub fn rect(self) -> TexelRect {
        TexelRect { x: 0, y: 0, width: self.width_px, height: self.height_px }
    }

    /// Number of texels.
    pub fn area(self) -> usize {
        self.width_px as usize * self.height_px as usize
    }

    /// Tiles per row of tiles, and rows of tiles.
    pub fn tiles(self) -> (u32, u32) {
        (self.width_px / TILE_PX, self.height_px / TILE_PX)
    }
}

/// A rectangle of texels. It lies within the map: what goes over the date line is two of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect, Serialize, Deserialize)]
pub struct TexelRect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl TexelRect {
    /// Column after the last.
    pub fn right(self) -> u32 {
        self.x + self.width
    }

    /// Row after the last.
    pub fn bottom(self) -> u32 {
        self.y + self.height
    }

    /// Number of texels.
    pub fn area(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Whether it holds no texel.
    pub fn is_empty(self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// The smallest rectangle around both; an empty one does not count.
    pub fn union(self, other: Self) -> Self {
        if self.is_empty() {
            return other;
        }
        if other.is_empty() {
            return self;
        }
        let (x, y) = (self.x.min(other.x), self.y.min(other.y));
        let (right, bottom) = (self.right().max(other.right()), self.bottom().max(other.bottom()));
        Self { x, y, width: right - x, height: bottom - y }
    }

    /// What both have in common; empty where that is nothing.
    pub fn intersection(self, other: Self) -> Self {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let (right, bottom) = (self.right().min(other.right()), self.bottom().min(other.bottom()));
        Self { x, y, width: right.saturating_sub(x), height: bottom.saturating_sub(y) }
    }

    /// Whether all of `other` lies in it.
    pub fn contains(self, other: Self) -> bool {
        other.is_empty()
            || (self.x <= other.x
                && self.y <= other.y
                && other.right() <= self.right()
                && other.bottom() <= self.bottom())
    }
}

/// Which tiles of a map are marked: one bit each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
pub struct TileMask {
    size: MapSize,
    words_per_row: usize,
    words: Vec<u64>,
}

impl TileMask {
    /// No tile of a map of this size is marked.
    pub fn new(size: MapSize) -> Self {
        let (columns, rows) = size.tiles();
        let words_per_row = columns.div_ceil(64) as usize;
        Self { size, words_per_row, words: vec![0; words_per_row * rows as usize] }
    }

    /// Takes all marks away.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Whether no tile is marked.
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&word| word == 0)
    }

    /// Marks the tiles that a rectangle touches.
    pub fn mark(&mut self, rect: TexelRect) {
        let rect = rect.intersection(self.size.rect());
        if rect.is_empty() {
            return;
        }
        for row in rect.y / TILE_PX..=(rect.bottom() - 1) / TILE_PX {
            for column in rect.x / TILE_PX..=(rect.right() - 1) / TILE_PX {
                self.words[row as usize * self.words_per_row + column as usize / 64] |= 1 << (column % 64);
            }
        }
    }

    /// Marks a tile, or takes its mark away; outside the map nothing happens.
    pub fn set(&mut self, column: u32, row: u32, is_marked: bool) {
        let (columns, rows) = self.size.tiles();
        if column < columns && row < rows {
            let word = &mut self.words[row as usize * self.words_per_row + column as usize / 64];
            *word = *word & !(1 << (column % 64)) | u64::from(is_marked) << (column % 64);
        }
    }

    /// Whether the tile in this column and row of tiles is marked; outside the map none is.
    pub fn is_marked(&self, column: u32, row: u32) -> bool {
        let (columns, rows) = self.size.tiles();
        column < columns
            && row < rows
            && self.words[row as usize * self.words_per_row + column as usize / 64] >> (column % 64) & 1 == 1
    }

    /// The marked tiles as (column, row), row by row.
    pub fn marked(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let (columns, rows) = self.size.tiles();
        (0..rows).flat_map(move |row| {
            (0..columns).filter(move |&column| self.is_marked(column, row)).map(move |column| (column, row))
        })
    }

    /// The texels of a tile.
    pub fn tile_rect(column: u32, row: u32) -> TexelRect {
        TexelRect { x: column * TILE_PX, y: row * TILE_PX, width: TILE_PX, height: TILE_PX }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widths_become_whole_tiles() {
        assert_eq!(MapSize::from_width(1024), MapSize { width_px: 1024, height_px: 512 });
        assert_eq!(MapSize::from_width(1000), MapSize { width_px: 1024, height_px: 512 });
        assert_eq!(MapSize::from_width(0), MapSize { width_px: 64, height_px: 32 });
        assert_eq!(MapSize::from_width(u32::MAX), MapSize { width_px: 8192, height_px: 4096 });
    }

    #[test]
    fn unions_and_intersections_are_tight() {
        let a = TexelRect { x: 2, y: 3, width: 4, height: 5 };
        let b = TexelRect { x: 5, y: 1, width: 6, height: 3 };
        assert_eq!(a.union(b), TexelRect { x: 2, y: 1, width: 9, height: 7 });
        assert_eq!(a.intersection(b), TexelRect { x: 5, y: 3, width: 1, height: 1 });
        assert!(a.union(b).contains(a) && a.union(b).contains(b) && !a.contains(b));
        assert!(a.intersection(TexelRect { x: 6, y: 3, width: 2, height: 2 }).is_empty());
        assert_eq!(a.union(TexelRect::default()), a);
    }

    #[test]
    fn marks_cover_what_was_marked_and_nothing_beside_it() {
        let mut mask = TileMask::new(MapSize::from_width(4096));
        let rect = TexelRect { x: 2040, y: 31, width: 20, height: 2 };
        mask.mark(rect);
        let marked: Vec<_> = mask.marked().collect();
        assert_eq!(marked, [(63, 0), (64, 0), (63, 1), (64, 1)]);
        assert!(marked.iter().all(|&(x, y)| !TileMask::tile_rect(x, y).intersection(rect).is_empty()));
        mask.set(63, 1, false);
        assert!(!mask.is_marked(63, 1) && mask.is_marked(64, 1));
        mask.set(63, 1, true);
        mask.set(500, 1, true);
        assert_eq!(mask.marked().collect::<Vec<_>>(), marked);
        mask.clear();
        assert!(mask.is_empty());
        mask.mark(TexelRect { x: 5000, y: 0, width: 4, height: 4 });
        assert!(mask.is_empty(), "beside the map there is nothing to mark");
    }
}
