//! One DICOM file: the few attributes that a volume needs, and its pixels as they are packed.

use crate::files::excerpt;
use crate::volume::error::VolumeFault;
use crate::volume::load::text::number;
use crate::volume::load::{malformed, unsupported};
use dicom_core::Tag;
use dicom_core::header::{DataElementHeader, Header as _};
use dicom_encoding::Endianness;
use dicom_encoding::TransferSyntaxIndex;
use dicom_parser::StatefulDecode;
use dicom_parser::dataset::LazyDataToken;
use dicom_parser::dataset::lazy_read::LazyDataSetReader;
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use flate2::bufread::DeflateDecoder;
use glam::DVec3;
use std::borrow::Cow;
use std::io::{Cursor, Read};

/// A file without its preamble, meta group and deflation: what is left is a data set.
pub(super) struct DataSet<'a> {
    pub(super) transfer_syntax: String,
    bytes: Cow<'a, [u8]>,
}

/// The attributes of one slice.
#[derive(Clone, Debug, Default)]
pub(super) struct Slice<'a> {
    pub(super) transfer_syntax: String,
    pub(super) is_big_endian: bool,
    pub(super) series_uid: String,
    pub(super) description: String,
    pub(super) rows: u16,
    pub(super) columns: u16,
    pub(super) samples: u16,
    pub(super) bits_allocated: u16,
    pub(super) bits_stored: u16,
    pub(super) high_bit: u16,
    pub(super) is_signed: bool,
    pub(super) photometric: String,
    pub(super) frames: u32,
    pub(super) slope: f64,
    pub(super) intercept: f64,
    /// Place of the first pixel's centre, LPS millimetres.
    pub(super) position_mm: Option<DVec3>,
    /// Directions of rows (to the right in the picture) and columns (down).
    pub(super) orientation: Option<[DVec3; 2]>,
    /// Distances of pixels down and to the right, as the standard orders them.
    pub(super) pixel_spacing_mm: Option<[f64; 2]>,
    pub(super) thickness_mm: Option<f64>,
    pub(super) slice_spacing_mm: Option<f64>,
    pub(super) pixels: Pixels<'a>,
}

/// Pixels as they lie in the file.
#[derive(Clone, Debug, Default)]
pub(super) enum Pixels<'a> {
    /// There are none: a directory, a report, a plan.
    #[default]
    None,
    Native(&'a [u8]),
    Fragments(Vec<&'a [u8]>),
}

const DEFLATED: &str = "1.2.840.10008.1.2.1.99";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
/// A deflated data set is unpacked before its sizes are known: no picture of the greatest size with two bytes per pixel is
/// longer.
const MOST_DEFLATED: u64 = 64 << 20;

impl<'a> DataSet<'a> {
    pub(super) fn of(file: &'a [u8]) -> Result<Self, VolumeFault> {
        if !super::is_dicom(file) {
            return Err(malformed("magic", "there is no `DICM` behind the first 128 bytes"));
        }
        let (transfer_syntax, rest) = meta(&file[132..])?;
        if transfer_syntax != DEFLATED {
            return Ok(Self { transfer_syntax, bytes: Cow::Borrowed(rest) });
        }
        let mut bytes = Vec::new();
        let unpacked = DeflateDecoder::new(rest).take(MOST_DEFLATED + 1).read_to_end(&mut bytes);
        match unpacked {
            Err(error) => Err(malformed("deflated data set", excerpt(&error.to_string()))),
            Ok(_) if bytes.len() as u64 > MOST_DEFLATED => {
                Err(unsupported("a deflated data set of more than 64 MiB", "save it as Explicit VR Little Endian"))
            }
            Ok(_) => Ok(Self { transfer_syntax: EXPLICIT_LITTLE.into(), bytes: Cow::Owned(bytes) }),
        }
    }

    /// Reads the attributes. Values are borrowed, and nested data sets are passed over without building them: what
    /// `dicom-object` would do with the whole file reserves the lengths that its elements claim, and descends as deep as they
    /// nest.
    pub(super) fn slice(&'a self) -> Result<Slice<'a>, VolumeFault> {
        // dicom-parser takes for granted that delimiters match, and panics in a damaged file where they do not.
        std::panic::catch_unwind(|| self.read())
            .unwrap_or_else(|_| Err(malformed("data set", "its sequences and items do not match; the file is damaged")))
    }

    fn read(&'a self) -> Result<Slice<'a>, VolumeFault> {
        let uid = &self.transfer_syntax;
        let Some(syntax) = TransferSyntaxRegistry.get(uid) else {
            return Err(unsupported(
                format!("transfer syntax {}", excerpt(uid)),
                "save it as Explicit VR Little Endian",
            ));
        };
        let bytes: &'a [u8] = &self.bytes;
        let damaged = |error: String| malformed("data set", format!("it is damaged ({})", excerpt(&error)));
        let mut slice = Slice {
            transfer_syntax: self.transfer_syntax.clone(),
            is_big_endian: syntax.endianness() == Endianness::Big,
            samples: 1,
            frames: 1,
            slope: 1.0,
            ..Slice::default()
        };
        let mut reader =
            LazyDataSetReader::new_with_ts(Cursor::new(bytes), syntax).map_err(|error| damaged(error.to_string()))?;
        let mut depth = 0_usize;
        let mut fragments: Option<Vec<&'a [u8]>> = None;
        let mut is_offset_table = false;
        while let Some(token) = reader.advance() {
            match token.map_err(|error| damaged(error.to_string()))? {
                LazyDataToken::SequenceStart { .. } => depth += 1,
                LazyDataToken::PixelSequenceStart => {
                    depth += 1;
                    // The first item holds offsets of frames. An icon has pixels too, in a data set of its own.
                    (fragments, is_offset_table) = ((depth == 1).then(Vec::new), true);
                }
                LazyDataToken::SequenceEnd => {
                    depth = depth.saturating_sub(1);
                    if depth == 0
                        && let Some(fragments) = fragments.take()
                    {
                        slice.pixels = Pixels::Fragments(fragments);
                        return Ok(slice);
                    }
                }
                LazyDataToken::ItemEnd => is_offset_table = false,
                LazyDataToken::LazyItemValue { len, decoder } => {
                    let value = part(bytes, decoder.position(), len, "PixelData")?;
                    if let Some(fragments) = fragments.as_mut().filter(|_| !is_offset_table) {
                        fragments.push(value);
                    }
                    decoder.skip_bytes(len).map_err(|error| damaged(error.to_string()))?;
                }
                LazyDataToken::LazyValue { header, decoder } => {
                    let name = format!("element {}", header.tag());
                    let value = part(bytes, decoder.position(), header.len.0, &name)?;
                    if depth == 0 {
                        slice.take(&header, value)?;
                    }
                    if matches!(slice.pixels, Pixels::Native(_)) {
                        return Ok(slice);
                    }
                    decoder.skip_bytes(header.len.0).map_err(|error| damaged(error.to_string()))?;
                }
                _ => {}
            }
        }
        match fragments {
            // The file ends before the sequence does.
            Some(_) => Err(malformed("PixelData", "its last fragment is missing; the file is cut off")),
            None => Ok(slice),
        }
    }
}

impl<'a> Slice<'a> {
    fn take(&mut self, header: &DataElementHeader, value: &'a [u8]) -> Result<(), VolumeFault> {
        let Tag(group, element) = header.tag();
        let text = || String::from_utf8_lossy(value).trim_matches([' ', '\0']).to_string();
        let is_big_endian = self.is_big_endian;
        let short = |field: &str| match *value {
            [a, b, ..] if is_big_endian => Ok(u16::from_be_bytes([a, b])),
            [a, b, ..] => Ok(u16::from_le_bytes([a, b])),
            _ => Err(malformed(field, format!("it has {} bytes where 2 belong", value.len()))),
        };
        let numbers = |field: &str| text().split('\\').map(|part| number(field, part)).collect::<Result<Vec<f64>, _>>();
        let vectors = |field: &str, count: usize| -> Result<Option<Vec<f64>>, VolumeFault> {
            if text().is_empty() {
                return Ok(None);
            }
            let numbers = numbers(field)?;
            match numbers.len() == count && numbers.iter().all(|number| number.is_finite()) {
                true => Ok(Some(numbers)),
                false => Err(malformed(field, format!("`{}` are not {count} numbers", excerpt(&text())))),
            }
        };
        let one = |field: &str| vectors(field, 1).map(|numbers| numbers.map(|numbers| numbers[0]));
        match (group, element) {
            (0x0008, 0x103e) => self.description = text(),
            (0x0018, 0x0050) => self.thickness_mm = one("SliceThickness")?,
            (0x0018, 0x0088) => self.slice_spacing_mm = one("SpacingBetweenSlices")?,
            (0x0020, 0x000e) => self.series_uid = text(),
            (0x0020, 0x0032) => {
                self.position_mm = vectors("ImagePositionPatient", 3)?.map(|n| DVec3::new(n[0], n[1], n[2]));
            }
            (0x0020, 0x0037) => {
                let numbers = vectors("ImageOrientationPatient", 6)?;
                self.orientation = numbers.map(|n| [DVec3::new(n[0], n[1], n[2]), DVec3::new(n[3], n[4], n[5])]);
            }
            (0x0028, 0x0002) => self.samples = short("SamplesPerPixel")?,
            (0x0028, 0x0004) => self.photometric = text(),
            (0x0028, 0x0008) => {
                let frames = one("NumberOfFrames")?.unwrap_or(1.0);
                if frames.fract() != 0.0 || !(1.0..=1e6).contains(&frames) {
                    return Err(malformed("NumberOfFrames", format!("`{}` is no number of frames", excerpt(&text()))));
                }
                self.frames = frames as u32;
            }
            (0x0028, 0x0010) => self.rows = short("Rows")?,
            (0x0028, 0x0011) => self.columns = short("Columns")?,
            (0x0028, 0x0030) => self.pixel_spacing_mm = vectors("PixelSpacing", 2)?.map(|n| [n[0], n[1]]),
            (0x0028, 0x0100) => self.bits_allocated = short("BitsAllocated")?,
            (0x0028, 0x0101) => self.bits_stored = short("BitsStored")?,
            (0x0028, 0x0102) => self.high_bit = short("HighBit")?,
            (0x0028, 0x0103) => self.is_signed = short("PixelRepresentation")? == 1,
            (0x0028, 0x1052) => self.intercept = one("RescaleIntercept")?.unwrap_or(0.0),
            (0x0028, 0x1053) => self.slope = one("RescaleSlope")?.unwrap_or(1.0),
            (0x7fe0, 0x0008 | 0x0009) => {
                return Err(unsupported("floating-point pixels", "save them as 16-bit PixelData with RescaleSlope"));
            }
            (0x7fe0, 0x0010) => self.pixels = Pixels::Native(value),
            _ => {}
        }
        Ok(())
    }
}

/// Bytes that an element claims, if they are there.
fn part<'a>(bytes: &'a [u8], start: u64, length: u32, what: &str) -> Result<&'a [u8], VolumeFault> {
    let rest = usize::try_from(start).ok().and_then(|start| bytes.get(start..)).unwrap_or_default();
    rest.get(..length as usize).ok_or_else(|| VolumeFault::Truncated {
        what: what.into(),
        expected: length.into(),
        found: rest.len() as u64,
    })
}

/// The transfer syntax that the meta group names, and what follows that group, which is always Explicit VR Little Endian.
fn meta(mut rest: &[u8]) -> Result<(String, &[u8]), VolumeFault> {
    let mut transfer_syntax = None;
    let cut_off = || malformed("file meta information", "the file ends within it");
    while rest.starts_with(&[2, 0]) {
        let head = rest.first_chunk::<8>().ok_or_else(cut_off)?;
        let is_long =
            matches!(&head[4..6], b"OB" | b"OW" | b"UN" | b"SQ" | b"UT" | b"UC" | b"UR" | b"OF" | b"OD" | b"OL");
        let (start, length) = match is_long {
            true => {
                let head = rest.first_chunk::<12>().ok_or_else(cut_off)?;
                (12, u32::from_le_bytes([head[8], head[9], head[10], head[11]]))
            }
            false => (8, u16::from_le_bytes([head[6], head[7]]).into()),
        };
        let value = rest.get(start..).and_then(|rest| rest.get(..length as usize)).ok_or_else(cut_off)?;
        if head[2..4] == [0x10, 0] {
            transfer_syntax = Some(String::from_utf8_lossy(value).trim_matches([' ', '\0']).to_string());
        }
        rest = &rest[start + length as usize..];
    }
    match transfer_syntax {
        Some(transfer_syntax) => Ok((transfer_syntax, rest)),
        None => Err(malformed("TransferSyntaxUID", "this field is missing in the file meta information")),
    }
}
