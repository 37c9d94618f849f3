//! The skin's pattern: four equilateral triangular tiles of Worley noise that fit together along every edge.
//!
//! A texture mesh of nearly equilateral triangles covers the organ, and each triangle shows one of four tiles in one of
//! three rotations (Neyret and Cani 1999; "Realistic rendering of an organ surface in real-time for laparoscopic surgery
//! simulation", 2002, section 4.1). Any edge of any tile fits any other, so the choice is free and nothing repeats in
//! sight.
//!
//! * [`TilePoints`]: Poisson-disk feature points with one shared strip along every edge ([`points`]).
//! * The distance to the nearest point becomes a colour through a [`ColourRamp`], with a second octave, a tint per cell
//!   and bent borders (`worley`).
//! * [`TileSet`]: the four tiles as a mipmapped texture array without seams (`mips`), to and from PNG (`png`).
//! * [`assign_tiles`]: which tile goes on which triangle.
//!
//! # Layout of a tile's texture
//! Corners lie on texel centres: the first at (p, p), the second at (p + s, p), the third at (p, p + s), with the
//! padding p = size / 32 and s = size · 15 / 16 steps along an edge. The equilateral triangle is a right triangle in the
//! texture, and its texels form a lattice that the tile's rotations map onto itself, so the edges of all tiles have
//! their texels in the same places. [`tile_uv`] is the whole mapping.

pub mod assign;
mod edges;
mod mips;
mod png;
pub mod points;
mod presets;
pub mod ramp;
mod worley;

pub use assign::{TileChoice, assign_tiles};
pub use edges::EdgeMismatch;
pub use points::{FeaturePoint, PointLayer, TilePoints};
pub use ramp::{ColourRamp, RampStop};

use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// Number of tiles in a set.
pub const TILE_COUNT: usize = 4;

/// Largest side of a tile's texture.
pub const MAX_RESOLUTION_PX: u32 = 4096;

/// Smallest side of a tile's texture.
pub const MIN_RESOLUTION_PX: u32 = 64;

/// By how much, in 8-bit sRGB steps, edges in a designer's files may differ.
pub const EDGE_TOLERANCE: u8 = 2;

/// Texels a cell must at least be wide.
const MIN_CELL_PX: f64 = 8.0;

/// What the tiles look like.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct TileOptions {
    /// Side of each tile's square texture: a power of two, 64 to 4096.
    pub resolution_px: u32,
    /// Mean number of cells along a tile's edge: from 3 to one per 8 texels.
    pub cells_per_edge: f32,
    /// Colour over the distance to the nearest cell's middle.
    pub ramp: ColourRamp,
    /// How much cells differ from one another in brightness, 0..=1 (and, by a fifth of that, in warmth).
    pub cell_jitter: f32,
    /// How far borders between cells are bent, 0..=0.3 Poisson radii; none right at a tile's edge.
    pub wobble: f32,
    /// The second, finer octave.
    pub detail: TileDetail,
    /// Everything random follows from it.
    pub seed: u64,
}

/// A finer Worley pattern over the cells. Where its own cells would be less than 8 texels wide it is left out.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct TileDetail {
    /// How many fine cells fit along one cell, 1..=8.
    pub cells_ratio: f32,
    /// How far the fine pattern moves the ramp's position, 0..=1.
    pub relief: f32,
    /// Opacity of the net along the fine cells' borders, 0..=1.
    pub net: f32,
    /// Colour of the net, sRGB-encoded, each channel in 0..=1.
    pub net_srgb: [f32; 3],
}

impl Default for TileDetail {
    fn default() -> Self {
        Self { cells_ratio: 2.8, relief: 0.2, net: 0.0, net_srgb: [0.8, 0.6, 0.5] }
    }
}

impl TileDetail {
    fn is_visible(&self) -> bool {
        self.relief > 0.0 || self.net > 0.0
    }
}

impl Default for TileOptions {
    /// A plain brown tissue of 512 texels a side; the organs' presets start from it.
    fn default() -> Self {
        Self {
            resolution_px: 512,
            cells_per_edge: 16.0,
            ramp: ColourRamp::from_srgb8(&[(0.0, [96, 40, 32]), (1.0, [150, 84, 66])]),
            cell_jitter: 0.12,
            wobble: 0.15,
            detail: TileDetail::default(),
            seed: 1,
        }
    }
}

impl TileOptions {
    /// Refuses options that no tile can be made from.
    ///
    /// # Errors
    /// [`TileError::Options`] naming the field and what is wrong with it.
    pub fn validate(&self) -> Result<(), TileError> {
        let wrong = |field, what| Err(TileError::Options { field, what });
        if let Err(what) = validate_resolution(self.resolution_px) {
            return wrong("resolution_px", what);
        }
        let most_cells = max_cells_per_edge(f64::from(steps_from_resolution(self.resolution_px)));
        if !(3.0..=most_cells).contains(&f64::from(self.cells_per_edge)) {
            return wrong("cells_per_edge", format!("is {}, not in 3..={most_cells}", self.cells_per_edge));
        }
        let detail = &self.detail;
        for (field, value, low, high) in [
            ("cell_jitter", self.cell_jitter, 0.0, 1.0),
            ("wobble", self.wobble, 0.0, 0.3),
            ("detail.cells_ratio", detail.cells_ratio, 1.0, 8.0),
            ("detail.relief", detail.relief, 0.0, 1.0),
            ("detail.net", detail.net, 0.0, 1.0),
            ("detail.net_srgb", detail.net_srgb[0], 0.0, 1.0),
            ("detail.net_srgb", detail.net_srgb[1], 0.0, 1.0),
            ("detail.net_srgb", detail.net_srgb[2], 0.0, 1.0),
        ] {
            if !(low..=high).contains(&value) {
                return wrong(field, format!("is {value}, not in {low}..={high}"));
            }
        }
        self.ramp.validate()
    }
}

/// Why there are no tiles.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum TileError {
    /// An option is out of range.
    #[error("tile options: {field} {what}")]
    Options {
        /// The option's name.
        field: &'static str,
        /// What is wrong with it.
        what: String,
    },
    /// No random point set kept the rule that makes edges compatible.
    #[error("no set of feature points with compatible edges in {trials} trials; try another seed or cells_per_edge")]
    NoPoints {
        /// How many sets were drawn.
        trials: u32,
    },
    /// A PNG file could not be read or written, or has a size that no tile can have.
    #[error("{name}: {what}")]
    Png {
        /// The file.
        name: String,
        /// What is wrong with it.
        what: String,
    },
    /// Files of one set have different sizes.
    #[error("{} is {} pixels wide, but {} is {}", names[0], sizes_px[0], names[1], sizes_px[1])]
    Sizes {
        /// The two files.
        names: [String; 2],
        /// Their widths in pixels.
        sizes_px: [u32; 2],
    },
    /// Edges of a designer's tiles do not fit.
    #[error(
        "{} (tile {}, edge {}, {:.1} % along) and {} (tile {}, edge {}, {:.1} % along) differ by {}/255 where they \
         would meet; at most {EDGE_TOLERANCE}/255 is allowed",
        names[0], worst.tiles[0], worst.edges[0], 100.0 * worst.along[0],
        names[1], worst.tiles[1], worst.edges[1], 100.0 * worst.along[1], worst.difference
    )]
    Edges {
        /// The two files.
        names: [String; 2],
        /// Where the difference is largest.
        worst: EdgeMismatch,
    },
}

/// Steps of the texel lattice along a tile's edge.
pub fn steps_from_resolution(resolution_px: u32) -> u32 {
    resolution_px / 16 * 15
}

/// Texels between a texture's border and the tile's first corner.
pub fn padding_from_resolution(resolution_px: u32) -> u32 {
    resolution_px / 32
}

fn max_cells_per_edge(steps: f64) -> f64 {
    steps / MIN_CELL_PX
}

fn validate_resolution(resolution_px: u32) -> Result<(), String> {
    if resolution_px.is_power_of_two() && (MIN_RESOLUTION_PX..=MAX_RESOLUTION_PX).contains(&resolution_px) {
        Ok(())
    } else {
        Err(format!("is {resolution_px}, not a power of two from {MIN_RESOLUTION_PX} to {MAX_RESOLUTION_PX}"))
    }
}

/// Barycentric coordinates on a triangle turned into those on a tile that lies on it with a rotation (0..=2): the
/// triangle's corner `rotation` gets the tile's first corner.
pub fn rotate_barycentric(barycentric: Vec3, rotation: u8) -> Vec3 {
    match rotation % 3 {
        0 => barycentric,
        1 => Vec3::new(barycentric.y, barycentric.z, barycentric.x),
        _ => Vec3::new(barycentric.z, barycentric.x, barycentric.y),
    }
}

/// Texture coordinates, 0..=1 from the top left, of a place on a triangle that shows a tile with a rotation:
/// `1/32 + 1/(2 size) + 15/16 · (b.y, b.z)` with b from [`rotate_barycentric`].
pub fn tile_uv(barycentric: Vec3, rotation: u8, resolution_px: u32) -> Vec2 {
    let b = rotate_barycentric(barycentric, rotation);
    Vec2::splat(1.0 / 32.0 + 0.5 / resolution_px as f32) + 15.0 / 16.0 * Vec2::new(b.y, b.z)
}

/// Four tiles with all their levels, ready for the GPU as one sRGB texture array.
#[derive(Clone, Debug, PartialEq, Eq, Reflect)]
pub struct TileSet {
    /// Side of the finest level.
    pub resolution_px: u32,
    /// Levels, finest (`resolution_px`) to coarsest (one texel); each holds the four layers one after another in rows
    /// of sRGB RGBA8.
    pub mips: Vec<Vec<u8>>,
}

impl TileSet {
    /// Makes the tiles for the given options, in parallel. The same options give the same bytes.
    ///
    /// # Errors
    /// As [`TilePoints::generate`].
    pub fn generate(options: &TileOptions) -> Result<Self, TileError> {
        let points = TilePoints::generate(options)?;
        Self::from_points(options, &points)
    }

    /// Makes the tiles from given feature points. Their edges fit if [`PointLayer::edge_clearance`] is positive for
    /// every layer and shared points are where [`TilePoints::generate`] puts them; this is not checked.
    ///
    /// # Errors
    /// [`TileError::Options`].
    pub fn from_points(options: &TileOptions, points: &TilePoints) -> Result<Self, TileError> {
        options.validate()?;
        let steps = steps_from_resolution(options.resolution_px);
        let ramp = ramp::RampTable::new(&options.ramp);
        let tiles = worley::render_tiles(options, &ramp, points, steps as i32);
        Ok(Self::from_texels(options.resolution_px, &tiles))
    }

    fn from_texels(resolution_px: u32, tiles: &[Vec<[u8; 3]>; TILE_COUNT]) -> Self {
        Self { resolution_px, mips: mips::build(resolution_px, tiles) }
    }

    /// Side of a level.
    pub fn level_size_px(&self, level: usize) -> u32 {
        self.resolution_px >> level
    }

    /// One tile's image at a level: rows of sRGB RGBA8.
    pub fn layer(&self, level: usize, tile: usize) -> &[u8] {
        let length = self.mips[level].len() / TILE_COUNT;
        &self.mips[level][tile * length..(tile + 1) * length]
    }

    /// All texels in the order in which a texture array is uploaded at once: layer by layer, all levels of a layer
    /// together, finest first.
    pub fn gpu_bytes(&self) -> Vec<u8> {
        (0..TILE_COUNT)
            .flat_map(|tile| (0..self.mips.len()).map(move |level| (level, tile)))
            .flat_map(|(level, tile)| self.layer(level, tile))
            .copied()
            .collect()
    }

    /// The two edges that fit worst in the finest level.
    pub fn worst_edge(&self) -> EdgeMismatch {
        let (steps, padding) = (steps_from_resolution(self.resolution_px), padding_from_resolution(self.resolution_px));
        let tiles = std::array::from_fn(|tile| {
            let layer = self.layer(0, tile);
            (0..=steps)
                .flat_map(|j| (0..=steps - j).map(move |i| (i, j)))
                .map(|(i, j)| {
                    let start = (((padding + j) * self.resolution_px + padding + i) * 4) as usize;
                    [layer[start], layer[start + 1], layer[start + 2]]
                })
                .collect()
        });
        edges::worst_mismatch(steps as usize, &tiles)
    }

    /// Linear colour of a tile at barycentric coordinates and a level of detail, as a GPU samples the texture array:
    /// bilinear within a level, linear between levels, clamped at the borders.
    pub fn sample(&self, tile: usize, barycentric: Vec3, lod: f32) -> Vec3 {
        let coarsest = self.mips.len() - 1;
        let lod = lod.clamp(0.0, coarsest as f32);
        let level = lod as usize;
        let share = lod - level as f32;
        let fine = self.sample_level(tile, barycentric, level);
        if share == 0.0 { fine } else { fine.lerp(self.sample_level(tile, barycentric, level + 1), share) }
    }

    fn sample_level(&self, tile: usize, barycentric: Vec3, level: usize) -> Vec3 {
        let size = self.level_size_px(level);
        let layer = self.layer(level, tile);
        let place = tile_uv(barycentric, 0, self.resolution_px) * size as f32 - 0.5;
        let low = place.floor();
        let texel = |dx: f32, dy: f32| {
            let at = (low + Vec2::new(dx, dy)).clamp(Vec2::ZERO, Vec2::splat((size - 1) as f32));
            let start = (at.y as usize * size as usize + at.x as usize) * 4;
            let fixed = ramp::fixed_from_bytes([layer[start], layer[start + 1], layer[start + 2]]);
            Vec3::from(fixed.map(|c| c as f32 / ramp::FIXED_ONE as f32))
        };
        let part = place - low;
        let top = texel(0.0, 0.0).lerp(texel(1.0, 0.0), part.x);
        top.lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), part.x), part.y)
    }
}
