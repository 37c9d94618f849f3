//! What packed pixels claim to be, looked up before a decoder is let loose on them.
//!
//! The decoders reserve what the packed data claim, and write without asking where the picture is larger than the slice that
//! the file announces. So the claims are held against the file first.

use crate::volume::error::VolumeFault;
use crate::volume::load::malformed;

/// What a slice is to be.
pub(super) struct Expected {
    pub(super) columns: u32,
    pub(super) rows: u32,
    pub(super) bits_allocated: u16,
}

impl Expected {
    fn check(&self, field: &str, columns: u32, rows: u32, components: u32, bits: u32) -> Result<(), VolumeFault> {
        if (columns, rows) != (self.columns, self.rows) {
            let [width, height] = [self.columns, self.rows];
            let reason = format!("the packed picture is {columns} x {rows}, the file says {width} x {height}");
            return Err(malformed(field, reason));
        }
        if components != 1 {
            return Err(malformed(field, format!("the packed picture has {components} components, the file says 1")));
        }
        if bits > self.bits_allocated.into() || bits * 2 <= self.bits_allocated.into() {
            let allocated = self.bits_allocated;
            return Err(malformed(
                field,
                format!("the packed picture has {bits} bits, the file allocates {allocated}"),
            ));
        }
        Ok(())
    }

    /// JPEG: the frame header.
    pub(super) fn check_jpeg(&self, data: &[u8]) -> Result<(), VolumeFault> {
        let field = "PixelData (JPEG)";
        let broken = || malformed(field, "there is no frame header in it; the file is damaged");
        let mut rest = data.strip_prefix(&[0xff, 0xd8]).ok_or_else(broken)?;
        loop {
            let [0xff, marker, after @ ..] = rest else { return Err(broken()) };
            // Any number of fill bytes may stand before a marker.
            if *marker == 0xff {
                rest = &rest[1..];
                continue;
            }
            if matches!(marker, 0x01 | 0xd0..=0xd8) {
                rest = after;
                continue;
            }
            let [high, low, ..] = after else { return Err(broken()) };
            let length = usize::from(u16::from_be_bytes([*high, *low]));
            let segment = after.get(2..length).ok_or_else(broken)?;
            // All frame headers; c4, c8 and cc are tables.
            if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
                let [bits, y1, y0, x1, x0, components, ..] = *segment else { return Err(broken()) };
                let [columns, rows] = [[x1, x0], [y1, y0]].map(|side| u16::from_be_bytes(side).into());
                return self.check(field, columns, rows, components.into(), bits.into());
            }
            rest = &after[length..];
        }
    }

    /// JPEG 2000, bare or in its box: the size marker, and how finely the picture is cut up.
    pub(super) fn check_jpeg_2000(&self, data: &[u8]) -> Result<(), VolumeFault> {
        let field = "PixelData (JPEG 2000)";
        let broken = || malformed(field, "there is no size marker in it; the file is damaged");
        let start = match data.starts_with(&[0xff, 0x4f, 0xff, 0x51]) {
            true => 0,
            // In a box the codestream comes after some others.
            false => data.windows(4).position(|four| four == [0xff, 0x4f, 0xff, 0x51]).ok_or_else(broken)?,
        };
        let size = data.get(start + 4..).ok_or_else(broken)?;
        let long = |at: usize| -> Result<u32, VolumeFault> {
            let bytes = size.get(at..).and_then(|rest| rest.first_chunk()).ok_or_else(broken)?;
            Ok(u32::from_be_bytes(*bytes))
        };
        // Length and capabilities, then the far corner, the near corner, and the same of the first tile.
        let [x1, y1, x0, y0] = [long(4)?, long(8)?, long(12)?, long(16)?];
        let [tile_width, tile_height] = [long(20)?, long(24)?];
        let [high, low, depth] = *size.get(36..).and_then(|rest| rest.first_chunk()).ok_or_else(broken)?;
        let components = u16::from_be_bytes([high, low]);
        let bits = u32::from(depth & 0x7f) + 1;
        self.check(field, x1.saturating_sub(x0), y1.saturating_sub(y0), components.into(), bits)?;
        // Tables are kept for every tile and every precinct: a few bytes can ask for gigabytes of them.
        let tiles = u64::from(x1.div_ceil(tile_width.max(1))) * u64::from(y1.div_ceil(tile_height.max(1)));
        if x0 > 1 << 16 || y0 > 1 << 16 || tiles > 1024 {
            return Err(malformed(field, format!("it is cut into {tiles} tiles; at most 1024 are read")));
        }
        let mut rest = &data[start + 2..];
        while let [0xff, marker, high, low, ..] = *rest {
            // Tiles begin: the main header is over.
            if matches!(marker, 0x90 | 0x93 | 0xd9) {
                break;
            }
            let length = usize::from(u16::from_be_bytes([high, low]));
            let segment = rest.get(4..2 + length).ok_or_else(broken)?;
            if marker == 0x52 {
                self.check_precincts(field, segment)?;
            }
            rest = &rest[2 + length..];
        }
        Ok(())
    }

    fn check_precincts(&self, field: &str, coding: &[u8]) -> Result<(), VolumeFault> {
        // Style; progression, layers and transform; levels, blocks, their style, wavelet; then precincts, smallest first.
        let [style, _, _, _, _, _, _, _, _, _, precincts @ ..] = coding else {
            return Err(malformed(field, "its coding style is cut off; the file is damaged"));
        };
        if style & 1 == 1
            && precincts.iter().rev().zip(0_u32..).any(|(sides, level)| {
                let side = |exponent: u8, whole: u32| (whole >> level.min(31)) >> exponent;
                side(sides & 15, self.columns).max(side(sides >> 4, self.rows)) > 128
            })
        {
            return Err(malformed(field, "it is cut into more than 128 precincts along a side"));
        }
        Ok(())
    }

    /// Run lengths: the segments' table, one segment for each byte of a pixel.
    pub(super) fn check_runs(&self, data: &[u8]) -> Result<(), VolumeFault> {
        let field = "PixelData (RLE)";
        let head = data.first_chunk::<64>().ok_or_else(|| malformed(field, "its table of segments is cut off"))?;
        let long = |at: usize| u32::from_le_bytes([head[4 * at], head[4 * at + 1], head[4 * at + 2], head[4 * at + 3]]);
        let expected = u32::from(self.bits_allocated / 8);
        if long(0) != expected {
            return Err(malformed(field, format!("it has {} segments where {expected} belong", long(0))));
        }
        // A run of 128 bytes takes two; where more is missing than runs can make up for, the file is cut off.
        let (expected, most) =
            (u64::from(self.columns) * u64::from(self.rows) * u64::from(expected), data.len() as u64 * 64);
        match expected > most {
            true => Err(VolumeFault::Truncated { what: field.into(), expected, found: most }),
            false => Ok(()),
        }
    }
}
