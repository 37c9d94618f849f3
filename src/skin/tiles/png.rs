//! Tiles as four PNG files, and a designer's own files in their place.

use super::edges::{unify, worst_mismatch};
use super::{
    EDGE_TOLERANCE, MAX_RESOLUTION_PX, TILE_COUNT, TileError, TileSet, padding_from_resolution, steps_from_resolution,
    validate_resolution,
};
use image::{ImageFormat, ImageReader, Limits, RgbImage, RgbaImage};
use std::io::Cursor;
use std::path::{Path, PathBuf};

impl TileSet {
    /// Writes the finest level of the four tiles as `<prefix>-0.png` to `<prefix>-3.png` (RGBA8, sRGB) and returns
    /// their paths. A tile's corners are the texel centres (p, p), (p + s, p) and (p, p + s) from the top left, with
    /// p = size / 32 and s = size · 15 / 16; what lies outside the triangle is only a margin for filters.
    ///
    /// # Errors
    /// [`TileError::Png`] with the file's name if it cannot be written.
    pub fn save_png(&self, folder: &Path, prefix: &str) -> Result<[PathBuf; TILE_COUNT], TileError> {
        let paths = std::array::from_fn(|tile| folder.join(format!("{prefix}-{tile}.png")));
        for (tile, path) in paths.iter().enumerate() {
            let failed = |what: String| TileError::Png { name: path.display().to_string(), what };
            RgbaImage::from_raw(self.resolution_px, self.resolution_px, self.layer(0, tile).to_vec())
                .ok_or_else(|| failed("the tile set holds too few texels".into()))?
                .save_with_format(path, ImageFormat::Png)
                .map_err(|error| failed(error.to_string()))?;
        }
        Ok(paths)
    }

    /// Reads four PNG files laid out as [`TileSet::save_png`] writes them; see [`TileSet::from_png_bytes`].
    pub fn from_png_files(paths: [&Path; TILE_COUNT]) -> Result<Self, TileError> {
        let names = paths.map(|path| path.display().to_string());
        let mut files: [Vec<u8>; TILE_COUNT] = Default::default();
        for ((path, name), file) in paths.iter().zip(&names).zip(&mut files) {
            *file =
                std::fs::read(path).map_err(|error| TileError::Png { name: name.clone(), what: error.to_string() })?;
        }
        Self::from_png_bytes(std::array::from_fn(|tile| (names[tile].as_str(), files[tile].as_slice())))
    }

    /// Takes four (name, PNG file) pairs, one per tile. Only the texels of the triangle count; the margin around it
    /// and all coarser levels are made anew. Edges may differ by [`EDGE_TOLERANCE`] and are then made equal.
    ///
    /// # Errors
    /// [`TileError::Png`] for a file that is no PNG or of a size no tile can have, [`TileError::Sizes`] for files of
    /// different sizes, [`TileError::Edges`] naming the two edges that differ most.
    pub fn from_png_bytes(files: [(&str, &[u8]); TILE_COUNT]) -> Result<Self, TileError> {
        let mut images: Vec<RgbImage> = Vec::with_capacity(TILE_COUNT);
        for (name, bytes) in files {
            let image = decode(bytes).map_err(|what| TileError::Png { name: name.to_string(), what })?;
            if let Some(first) = images.first()
                && first.dimensions() != image.dimensions()
            {
                return Err(TileError::Sizes {
                    names: [files[0].0.to_string(), name.to_string()],
                    sizes_px: [first.width(), image.width()],
                });
            }
            images.push(image);
        }
        let resolution_px = images[0].width();
        let (steps, padding) = (steps_from_resolution(resolution_px), padding_from_resolution(resolution_px));
        let mut tiles: [Vec<[u8; 3]>; TILE_COUNT] = std::array::from_fn(|tile| {
            (0..=steps)
                .flat_map(|j| (0..=steps - j).map(move |i| (i, j)))
                .map(|(i, j)| images[tile].get_pixel(padding + i, padding + j).0)
                .collect()
        });
        let worst = worst_mismatch(steps as usize, &tiles);
        if worst.difference > EDGE_TOLERANCE {
            return Err(TileError::Edges { names: worst.tiles.map(|tile| files[tile as usize].0.to_string()), worst });
        }
        unify(steps as usize, &mut tiles);
        Ok(Self::from_texels(resolution_px, &tiles))
    }
}

fn decode(bytes: &[u8]) -> Result<RgbImage, String> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_RESOLUTION_PX);
    limits.max_image_height = Some(MAX_RESOLUTION_PX);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| error.to_string())?;
    if image.width() != image.height() {
        return Err(format!("is {} x {} pixels, not square", image.width(), image.height()));
    }
    validate_resolution(image.width())?;
    Ok(image.into_rgb8())
}
