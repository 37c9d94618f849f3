//! The two maps: what is shown, and what stays.

use super::super::texels::{MapSize, TILE_PX, TexelRect, TileMask};
use crate::organ::surface::NEUTRAL_GLOSS;
use bevy::reflect::Reflect;

/// Texels of a tile.
const TILE_AREA: usize = (TILE_PX * TILE_PX) as usize;

/// A reaction map as it is shown: permanent effects with the active sprites over them.
///
/// `colour` is premultiplied, sRGB-encoded RGBA, blended as it is encoded, as paint programs do. `gloss` is 128 where the
/// skin shines as it does dry, 255 where it is wet, 0 where it is burnt dull. Both are stored row by row.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct ReactionMap {
    size: MapSize,
    colour: Vec<[u8; 4]>,
    gloss: Vec<u8>,
}

impl ReactionMap {
    /// A transparent map with the gloss of dry skin. Sides that are not whole tiles lose the rest.
    pub fn new(size: MapSize) -> Self {
        let size = whole_tiles(size);
        Self { size, colour: vec![[0; 4]; size.area()], gloss: vec![NEUTRAL_GLOSS; size.area()] }
    }

    /// Size in texels.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// Premultiplied, sRGB-encoded RGBA, row by row.
    pub fn colour(&self) -> &[[u8; 4]] {
        &self.colour
    }

    /// Gloss, row by row.
    pub fn gloss(&self) -> &[u8] {
        &self.gloss
    }

    pub(super) fn planes_mut(&mut self) -> (&mut [[u8; 4]], &mut [u8]) {
        (&mut self.colour, &mut self.gloss)
    }
}

fn whole_tiles(size: MapSize) -> MapSize {
    let (columns, rows) = size.tiles();
    MapSize { width_px: columns * TILE_PX, height_px: rows * TILE_PX }
}

/// Both planes of one tile, row by row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tile {
    pub(super) colour: [[u8; 4]; TILE_AREA],
    pub(super) gloss: [u8; TILE_AREA],
}

impl Tile {
    /// What a tile that is not there holds.
    pub(super) const BLANK: Self = Self { colour: [[0; 4]; TILE_AREA], gloss: [NEUTRAL_GLOSS; TILE_AREA] };
}

/// Permanent effects, in tiles of 32 x 32 texels: a tile without any takes no memory.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
pub struct PermanentMap {
    size: MapSize,
    tiles: Vec<Option<Box<Tile>>>,
}

impl PermanentMap {
    /// A map without effects. Sides that are not whole tiles lose the rest.
    pub fn new(size: MapSize) -> Self {
        let size = whole_tiles(size);
        let (columns, rows) = size.tiles();
        Self { size, tiles: vec![None; columns as usize * rows as usize] }
    }

    /// Size in texels.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// Takes all effects away.
    pub fn clear(&mut self) {
        self.tiles.fill(None);
    }

    /// Tiles with effects.
    pub fn tiles_in_use(&self) -> usize {
        self.tiles.iter().flatten().count()
    }

    /// Memory that the map takes, bytes.
    pub fn bytes_in_use(&self) -> usize {
        self.tiles_in_use() * size_of::<Tile>() + size_of_val(self.tiles.as_slice())
    }

    /// Premultiplied colour and gloss of a texel; those of bare skin outside the map.
    pub fn texel(&self, x: u32, y: u32) -> ([u8; 4], u8) {
        let tile = self.slot(x, y).and_then(|slot| self.tiles[slot].as_deref()).unwrap_or(&Tile::BLANK);
        let texel = (y % TILE_PX * TILE_PX + x % TILE_PX) as usize;
        (tile.colour[texel], tile.gloss[texel])
    }

    /// Sets a texel's premultiplied colour and gloss; outside the map it does nothing. Colour components beyond alpha
    /// are brought down to it: no such colour exists.
    pub fn set_texel(&mut self, x: u32, y: u32, colour: [u8; 4], gloss: u8) {
        let Some(slot) = self.slot(x, y) else { return };
        let [r, g, b, a] = colour;
        let colour = [r.min(a), g.min(a), b.min(a), a];
        if self.tiles[slot].is_none() && colour == [0; 4] && gloss == NEUTRAL_GLOSS {
            return;
        }
        let tile = self.tiles[slot].get_or_insert_with(|| Box::new(Tile::BLANK));
        let texel = (y % TILE_PX * TILE_PX + x % TILE_PX) as usize;
        tile.colour[texel] = colour;
        tile.gloss[texel] = gloss;
    }

    fn slot(&self, x: u32, y: u32) -> Option<usize> {
        let is_inside = x < self.size.width_px && y < self.size.height_px;
        is_inside.then(|| (y / TILE_PX * self.size.tiles().0 + x / TILE_PX) as usize)
    }

    /// The tile in this column and row of tiles, where it has effects.
    pub(super) fn tile(&self, column: u32, row: u32) -> Option<&Tile> {
        self.slot(column * TILE_PX, row * TILE_PX).and_then(|slot| self.tiles[slot].as_deref())
    }

    /// Lets `draw` draw on the tiles that a rectangle touches. It gets each tile's texels with its planes; what stays
    /// blank is not kept.
    pub(super) fn draw_on(&mut self, rect: TexelRect, mut draw: impl FnMut(TexelRect, &mut Tile)) {
        let rect = rect.intersection(self.size.rect());
        if rect.is_empty() {
            return;
        }
        for row in rect.y / TILE_PX..=(rect.bottom() - 1) / TILE_PX {
            for column in rect.x / TILE_PX..=(rect.right() - 1) / TILE_PX {
                let tile_rect = TileMask::tile_rect(column, row);
                let slot = &mut self.tiles[(row * self.size.tiles().0 + column) as usize];
                if let Some(tile) = slot {
                    draw(tile_rect, tile);
                } else {
                    let mut tile = Box::new(Tile::BLANK);
                    draw(tile_rect, &mut tile);
                    *slot = (*tile != Tile::BLANK).then_some(tile);
                }
            }
        }
    }
}
