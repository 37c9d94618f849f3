//! Where there is anything to do: the cost of a step follows the cavity's area and not the grid's.

use super::field::Places;
use glam::UVec2;

/// Cells along the side of a tile.
pub(super) const TILE: usize = 32;

/// Columns of a row of tiles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub start: usize,
    pub end: usize,
    /// Whether there is fluid all over it and over all tiles around it.
    pub is_deep: bool,
}

/// The tiles with fluid, joined to spans by rows of tiles.
#[derive(Clone, Debug, Default)]
pub(super) struct Spans(Vec<Vec<Span>>);

impl Spans {
    pub fn new(places: &Places) -> Self {
        let size = places.wet.size.as_usizevec2();
        let tiles = (size + TILE - 1) / TILE;
        let mut counts = vec![0; tiles.x * tiles.y];
        for y in 0..size.y {
            for x in 0..size.x {
                if places.wet.at(UVec2::new(x as u32, y as u32)) > 0.0 {
                    counts[y / TILE * tiles.x + x / TILE] += 1;
                }
            }
        }
        let is_full = |x: Option<usize>, y: Option<usize>| {
            let (Some(x), Some(y)) = (x.filter(|x| *x < tiles.x), y.filter(|y| *y < tiles.y)) else { return false };
            counts[y * tiles.x + x] == TILE * TILE
        };
        let rows = (0..tiles.y).map(|y| {
            let mut spans: Vec<Span> = Vec::new();
            for x in 0..tiles.x {
                if counts[y * tiles.x + x] == 0 {
                    continue;
                }
                let around = |of: usize| [of.checked_sub(1), Some(of), Some(of + 1)];
                let is_deep = around(x).iter().all(|x| around(y).iter().all(|y| is_full(*x, *y)));
                let (start, end) = (x * TILE, ((x + 1) * TILE).min(size.x));
                match spans.last_mut().filter(|last| last.end == start && last.is_deep == is_deep) {
                    Some(last) => last.end = end,
                    None => spans.push(Span { start, end, is_deep }),
                }
            }
            spans
        });
        Self(rows.collect())
    }

    /// The spans of a row of cells.
    pub fn of_row(&self, y: usize) -> &[Span] {
        &self.0[y / TILE]
    }
}
