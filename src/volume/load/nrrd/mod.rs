//! NRRD, versions 1 to 5, with the voxels behind the header or in files of their own.
//!
//! Format: <https://teem.sourceforge.net/nrrd/format.html>

mod header;
mod place;

use super::samples::{self, ByteOrder, Element};
use super::siblings::{gather, pattern_names};
use super::source::{Packing, Source};
use super::text::{product, sides, whole};
use super::{LoadReport, Parsed, VolumeFormat, VolumeLoadOptions, checked_size, choose_frame, malformed, unsupported};
use crate::files::{Fetch, excerpt};
use crate::volume::error::VolumeFault;
use header::{Attached, Header};
use place::Axis;
use std::borrow::Cow;

pub(super) fn read(bytes: &[u8], options: &VolumeLoadOptions, fetch: Fetch<'_>) -> Result<Parsed, VolumeFault> {
    let header = Header::parse(bytes)?;
    let element = element(&header)?;
    let dimension = whole("dimension", header.required("dimension")?)?;
    if !(1..=16).contains(&dimension) {
        return Err(malformed("dimension", format!("{dimension} is not a number from 1 to 16")));
    }
    let dimension = dimension as usize;
    if !(2..=4).contains(&dimension) {
        return Err(unsupported(format!("dimension {dimension}"), "save it as a volume of dimension 3"));
    }
    let sizes = sides("sizes", header.required("sizes")?, dimension)?;
    let axes = place::axes(&header, &sizes)?;
    let layout = Layout::of(&axes, element)?;
    let size = checked_size(layout.sides)?;
    let too_many = || malformed("sizes", format!("{sizes:?} voxels are more than any file holds"));
    let total = product(sizes.iter().copied().chain([element.bytes()])).ok_or_else(too_many)?;
    let frame_bytes = total / layout.frames;
    let frame = choose_frame(layout.frames, options)?;
    let (grid, is_placed) = place::grid(&header, &axes, size)?;

    let data = Data { encoding: Encoding::of(&header)?, element, header: &header };
    let order = data.order()?;
    let all = data.read(bytes, total, fetch)?;
    let start = (frame * frame_bytes) as usize;
    let of_frame = match all {
        Cow::Borrowed(all) => Cow::Borrowed(&all[start..start + frame_bytes as usize]),
        Cow::Owned(all) if layout.frames == 1 => Cow::Owned(all),
        Cow::Owned(all) => Cow::Owned(all[start..start + frame_bytes as usize].to_vec()),
    };
    let ((voxels, voxels_replaced), element) = match layout.channels {
        1 => (samples::decode(of_frame, element, order, false)?, element.name()),
        3 => ((samples::colours(&of_frame, 3), 0), "RGB"),
        _ => ((samples::colours(&of_frame, 4), 0), "RGBA"),
    };
    let report = LoadReport {
        format: VolumeFormat::Nrrd,
        element: element.into(),
        frames: u32::try_from(layout.frames).unwrap_or(u32::MAX),
        voxels_replaced,
        is_placed,
        ..LoadReport::default()
    };
    Ok(Parsed { grid, voxels, slope: 1.0, intercept: 0.0, report })
}

fn element(header: &Header) -> Result<Element, VolumeFault> {
    let named = header.required("type")?;
    Ok(match named.to_ascii_lowercase().split_whitespace().collect::<Vec<_>>().join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => Element::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Element::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Element::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Element::U16,
        "int" | "signed int" | "int32" | "int32_t" => Element::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Element::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Element::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Element::U64,
        "float" => Element::F32,
        "double" => Element::F64,
        "block" => return Err(unsupported("type block", "save it with one number per voxel")),
        _ => return Err(malformed("type", format!("`{}` is no type of a number", excerpt(named)))),
    })
}

/// How the axes in memory make a volume.
struct Layout {
    channels: u64,
    sides: [u64; 3],
    frames: u64,
}

impl Layout {
    fn of(axes: &[Axis], element: Element) -> Result<Self, VolumeFault> {
        let mut layout = Self { channels: 1, sides: [1; 3], frames: 1 };
        let mut spatial = 0;
        let last = axes.len() - 1;
        for (at, axis) in axes.iter().enumerate() {
            match axis {
                Axis::Space { size, .. } if spatial < 3 => {
                    layout.sides[spatial] = *size;
                    spatial += 1;
                }
                Axis::Space { .. } => {
                    return Err(unsupported("a fourth axis in space", "save it as a volume of dimension 3"));
                }
                Axis::Other { size: 1, .. } => {}
                Axis::Other { size: size @ (3 | 4), kind } if at == 0 && is_colour(kind) => {
                    if element != Element::U8 {
                        return Err(unsupported(
                            format!("colours of {}", element.name()),
                            "save them as unsigned char",
                        ));
                    }
                    layout.channels = *size;
                }
                Axis::Other { size, .. } if at == last && at > 0 => layout.frames = *size,
                Axis::Other { size, kind } => {
                    let kind = if kind.is_empty() { "none" } else { kind };
                    return Err(unsupported(
                        format!("axis {at} with {size} entries of kind {}", excerpt(kind)),
                        "save one number, RGB or RGBA per voxel",
                    ));
                }
            }
        }
        match spatial {
            2 | 3 => Ok(layout),
            _ => {
                Err(malformed("space directions", format!("{spatial} of the axes lie in space; a volume needs three")))
            }
        }
    }
}

fn is_colour(kind: &str) -> bool {
    matches!(kind, "rgb-color" | "rgba-color" | "3-color" | "4-color" | "" | "none" | "???" | "vector" | "list")
}

/// How the voxels are written.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    Text,
    Hex,
}

impl Encoding {
    fn of(header: &Header) -> Result<Self, VolumeFault> {
        let named = header.required("encoding")?;
        let advice = "save it with encoding gzip or raw";
        match named.to_ascii_lowercase().as_str() {
            "raw" => Ok(Self::Raw),
            "gz" | "gzip" => Ok(Self::Gzip),
            "txt" | "text" | "ascii" => Ok(Self::Text),
            "hex" => Ok(Self::Hex),
            "bz2" | "bzip2" | "zrl" => Err(unsupported(format!("encoding {named}"), advice)),
            _ => Err(malformed("encoding", format!("`{}` is not raw, gzip, text or hex", excerpt(named)))),
        }
    }
}

struct Data<'a> {
    encoding: Encoding,
    element: Element,
    header: &'a Header<'a>,
}

impl Data<'_> {
    fn order(&self) -> Result<ByteOrder, VolumeFault> {
        // Text is turned into little-endian bytes.
        if self.encoding == Encoding::Text || self.element.bytes() == 1 {
            return Ok(ByteOrder::Little);
        }
        match self.header.required("endian")?.to_ascii_lowercase().as_str() {
            "little" => Ok(ByteOrder::Little),
            "big" => Ok(ByteOrder::Big),
            other => Err(malformed("endian", format!("`{}` is neither little nor big", excerpt(other)))),
        }
    }

    /// All bytes of all voxels, from the file itself or from those that it names.
    fn read<'b>(&self, file: &'b [u8], total: u64, fetch: Fetch<'_>) -> Result<Cow<'b, [u8]>, VolumeFault> {
        let names = match &self.header.attached {
            Attached::At(start) => return self.piece(&file[*start..], total, "voxels"),
            Attached::File(name) => vec![name.to_string()],
            Attached::List(names) => names.iter().map(ToString::to_string).collect(),
            Attached::Pattern(pattern) => pattern_names("data file", pattern)?,
        };
        gather("data file", &names, total, self.element.bytes(), fetch, |bytes, expected, what| {
            self.piece(bytes, expected, what)
        })
        .map(Cow::Owned)
    }

    /// The bytes of voxels that one file holds; `expected` is how many.
    fn piece<'b>(&self, bytes: &'b [u8], expected: u64, what: &str) -> Result<Cow<'b, [u8]>, VolumeFault> {
        let mut rest = bytes;
        for line in 0..self.header.skip("line skip", 0)? {
            let Some(end) = rest.iter().position(|byte| *byte == b'\n') else {
                return Err(malformed("line skip", format!("there are only {line} lines in the {what}")));
            };
            rest = &rest[end + 1..];
        }
        let skipped = self.header.skip("byte skip", -1)?;
        if skipped < 0 {
            if self.encoding != Encoding::Raw {
                return Err(malformed("byte skip", "-1 has a meaning for raw encoding only"));
            }
            let start = rest.len().checked_sub(usize::try_from(expected).unwrap_or(usize::MAX));
            let found = rest.len() as u64;
            return match start {
                Some(start) => Ok(Cow::Borrowed(&rest[start..])),
                None => Err(VolumeFault::Truncated { what: what.into(), expected, found }),
            };
        }
        let skipped = skipped as u64;
        let packing = if self.encoding == Encoding::Gzip { Packing::Gzip } else { Packing::None };
        let mut source = Source::new(rest, packing, what);
        source.skip(skipped)?;
        let count = expected / self.element.bytes();
        match self.encoding {
            Encoding::Raw | Encoding::Gzip => {
                let voxels = source.take(expected)?;
                source.end(expected)?;
                Ok(voxels)
            }
            Encoding::Text => samples::from_text(&rest[skipped as usize..], self.element, count, what).map(Cow::Owned),
            Encoding::Hex => samples::from_hex(&rest[skipped as usize..], expected, what).map(Cow::Owned),
        }
    }
}
