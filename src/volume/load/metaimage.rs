//! MetaImage: `.mha` with its voxels behind the header, `.mhd` with a data file. Its space is LPS.

use super::samples::{self, ByteOrder, Element};
use super::siblings::{gather, pattern_names};
use super::source::{Packing, Source};
use super::text::{numbers, product, sides, spacing, whole};
use super::{LoadReport, Parsed, VolumeFormat, VolumeLoadOptions};
use super::{checked_size, choose_frame, malformed, placed_grid, unsupported};
use crate::files::{Fetch, excerpt};
use crate::volume::VolumeGrid;
use crate::volume::error::VolumeFault;
use glam::{DVec3, UVec3};
use std::borrow::Cow;

pub(super) fn read(bytes: &[u8], options: &VolumeLoadOptions, fetch: Fetch<'_>) -> Result<Parsed, VolumeFault> {
    let header = Header::parse(bytes)?;
    if let Some(other) = header.get("ObjectType").filter(|kind| !kind.eq_ignore_ascii_case("image")) {
        return Err(unsupported(format!("ObjectType {}", excerpt(other)), "a volume has ObjectType = Image"));
    }
    let dimension = whole("NDims", header.required("NDims")?)?;
    if !(2..=4).contains(&dimension) {
        return Err(unsupported(format!("NDims {dimension}"), "save it as a volume with NDims = 3"));
    }
    let dimension = dimension as usize;
    let sizes = sides("DimSize", header.required("DimSize")?, dimension)?;
    let side = |at: usize| sizes.get(at).copied().unwrap_or(1);
    let size = checked_size([side(0), side(1), side(2)])?;
    let frames = side(3);
    let channels = match header
        .get("ElementNumberOfChannels")
        .map_or(Ok(1), |text| whole("ElementNumberOfChannels", text))?
    {
        channels @ (1 | 3 | 4) => channels as u64,
        other => {
            return Err(unsupported(format!("ElementNumberOfChannels {other}"), "save 1, 3 (RGB) or 4 (RGBA) of them"));
        }
    };
    let element = element(&header)?;
    if channels > 1 && element != Element::U8 {
        return Err(unsupported(format!("colours of {}", element.name()), "save them as MET_UCHAR"));
    }
    let too_many = || malformed("DimSize", format!("{sizes:?} voxels are more than any file holds"));
    let total = product(sizes.iter().copied().chain([channels, element.bytes()])).ok_or_else(too_many)?;
    let frame_bytes = total / frames;
    let frame = choose_frame(frames, options)?;
    let grid = grid(&header, dimension, size)?;

    let data = Data::of(&header, element)?;
    let all = data.read(&header, bytes, total, fetch)?;
    let start = (frame * frame_bytes) as usize;
    let of_frame = match all {
        Cow::Borrowed(all) => Cow::Borrowed(&all[start..start + frame_bytes as usize]),
        Cow::Owned(all) if frames == 1 => Cow::Owned(all),
        Cow::Owned(all) => Cow::Owned(all[start..start + frame_bytes as usize].to_vec()),
    };
    let ((voxels, voxels_replaced), element) = match channels {
        1 => (samples::decode(of_frame, element, data.order, false)?, element.name()),
        3 => ((samples::colours(&of_frame, 3), 0), "RGB"),
        _ => ((samples::colours(&of_frame, 4), 0), "RGBA"),
    };
    let report = LoadReport {
        format: VolumeFormat::MetaImage,
        element: element.into(),
        frames: u32::try_from(frames).unwrap_or(u32::MAX),
        voxels_replaced,
        is_placed: header.first(&ORIGIN).is_some(),
        ..LoadReport::default()
    };
    Ok(Parsed { grid, voxels, slope: 1.0, intercept: 0.0, report })
}

/// Names of one and the same field, in different versions of the format.
const ORIGIN: [&str; 3] = ["Offset", "Position", "Origin"];
const AXES: [&str; 3] = ["TransformMatrix", "Rotation", "Orientation"];
const SPACING: [&str; 2] = ["ElementSpacing", "ElementSize"];
const ORDER: [&str; 2] = ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];

/// No sensible header is longer.
const LONGEST: usize = 1 << 20;

/// Fields up to `ElementDataFile`, which is the last.
struct Header<'a> {
    fields: Vec<(Cow<'a, str>, Cow<'a, str>)>,
    /// What follows the line of the data file.
    rest: &'a [u8],
}

impl<'a> Header<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Self, VolumeFault> {
        let mut header = Self { fields: Vec::new(), rest: bytes };
        let mut number = 0;
        while !header.rest.is_empty() && bytes.len() - header.rest.len() < LONGEST {
            number += 1;
            let searched = &header.rest[..header.rest.len().min(LONGEST)];
            let end = searched.iter().position(|byte| *byte == b'\n').unwrap_or(searched.len());
            let line = String::from_utf8_lossy(&searched[..end]);
            header.rest = header.rest.get(end + 1..).unwrap_or_default();
            if line.trim().is_empty() || line.starts_with('#') {
                continue;
            }
            let Some((name, value)) = line.split_once('=') else {
                // The first line of a file of another format is no field either.
                let reason = format!("`{}` is no field with a value", excerpt(&line));
                return Err(malformed(format!("line {number}"), reason));
            };
            let (name, value) = (name.trim().to_string(), value.trim().to_string());
            if header.get(&name).is_some() {
                return Err(malformed(excerpt(&name), format!("it is given a second time in line {number}")));
            }
            let is_last = name.eq_ignore_ascii_case("ElementDataFile");
            header.fields.push((name.into(), value.into()));
            if is_last {
                return Ok(header);
            }
        }
        Err(malformed("ElementDataFile", "this field is missing; it ends the header"))
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.fields.iter().find(|(other, _)| other.eq_ignore_ascii_case(name)).map(|(_, value)| &**value)
    }

    fn required(&self, name: &str) -> Result<&str, VolumeFault> {
        self.get(name).ok_or_else(|| malformed(name, "this field is missing"))
    }

    /// The field and its value, under whichever of its names it is there.
    fn first<'n>(&self, names: &[&'n str]) -> Option<(&'n str, &str)> {
        names.iter().find_map(|name| self.get(name).map(|value| (*name, value)))
    }

    fn is_true(&self, names: &[&str], otherwise: bool) -> Result<bool, VolumeFault> {
        let Some((name, value)) = self.first(names) else { return Ok(otherwise) };
        match value.to_ascii_lowercase().as_str() {
            "true" | "1" | "t" => Ok(true),
            "false" | "0" | "f" => Ok(false),
            _ => Err(malformed(name, format!("`{}` is neither True nor False", excerpt(value)))),
        }
    }
}

fn element(header: &Header) -> Result<Element, VolumeFault> {
    let named = header.required("ElementType")?;
    Ok(match named.to_ascii_uppercase().as_str() {
        "MET_CHAR" => Element::I8,
        "MET_UCHAR" | "MET_ASCII_CHAR" => Element::U8,
        "MET_SHORT" => Element::I16,
        "MET_USHORT" => Element::U16,
        // The format fixes the sizes: a long has four bytes on every machine.
        "MET_INT" | "MET_LONG" => Element::I32,
        "MET_UINT" | "MET_ULONG" => Element::U32,
        "MET_LONG_LONG" => Element::I64,
        "MET_ULONG_LONG" => Element::U64,
        "MET_FLOAT" => Element::F32,
        "MET_DOUBLE" => Element::F64,
        _ if named.ends_with("_ARRAY") => {
            return Err(unsupported(
                format!("ElementType {}", excerpt(named)),
                "save one number per voxel, or ElementNumberOfChannels of them",
            ));
        }
        _ => return Err(malformed("ElementType", format!("`{}` is no type of a number", excerpt(named)))),
    })
}

fn grid(header: &Header, dimension: usize, size: UVec3) -> Result<VolumeGrid, VolumeFault> {
    let mut spacing_mm = DVec3::ONE;
    if let Some((name, text)) = header.first(&SPACING) {
        for (at, value) in numbers(name, text, dimension)?.into_iter().enumerate().take(3) {
            spacing_mm[at] = spacing(name, value)?;
        }
    }
    let mut axes = DVec3::AXES;
    let mut field = "ElementSpacing";
    if let Some((name, text)) = header.first(&AXES) {
        field = name;
        // Written row after row, and each row is the direction of an axis. Time has a row and a column of its own.
        let matrix = numbers(name, text, dimension * dimension)?;
        for at in 0..dimension.min(3) {
            let row = &matrix[at * dimension..][..dimension.min(3)];
            axes[at] = DVec3::new(row[0], row[1], row.get(2).copied().unwrap_or_default());
        }
        if dimension == 2 {
            axes[2] = axes[0].cross(axes[1]);
        }
    }
    let mut origin_mm = DVec3::ZERO;
    if let Some((name, text)) = header.first(&ORIGIN) {
        for (at, value) in numbers(name, text, dimension)?.into_iter().enumerate().take(3) {
            if !value.is_finite() {
                return Err(malformed(name, format!("{value:?} is not a finite number")));
            }
            origin_mm[at] = value;
        }
    }
    let [i, j, k] = [0, 1, 2].map(|at| axes[at] * spacing_mm[at]);
    placed_grid(size, [i, j, k], origin_mm, field)
}

/// How the voxels are written.
struct Data {
    element: Element,
    order: ByteOrder,
    is_binary: bool,
    packing: Packing,
    /// Bytes before the voxels in a data file; -1: whatever the file has more than them.
    skipped: i64,
}

impl Data {
    fn of(header: &Header, element: Element) -> Result<Self, VolumeFault> {
        let is_binary = header.is_true(&["BinaryData"], true)?;
        let is_big = header.is_true(&ORDER, false)?;
        // Text is turned into little-endian bytes.
        let order = if is_big && is_binary { ByteOrder::Big } else { ByteOrder::Little };
        let packing = if header.is_true(&["CompressedData"], false)? { Packing::Zlib } else { Packing::None };
        if packing == Packing::Zlib && !is_binary {
            return Err(unsupported("packed text (BinaryData = False and CompressedData = True)", "save it as binary"));
        }
        let skipped = header.get("HeaderSize").map_or(Ok(0), |text| whole("HeaderSize", text))?;
        if skipped < -1 {
            return Err(malformed("HeaderSize", format!("{skipped} is less than -1")));
        }
        if skipped == -1 && (packing != Packing::None || !is_binary) {
            return Err(malformed(
                "HeaderSize",
                "-1 has a meaning for raw voxels only, not for packed or written ones",
            ));
        }
        Ok(Self { element, order, is_binary, packing, skipped })
    }

    /// All bytes of all voxels, from the file itself or from those that it names.
    fn read<'b>(
        &self,
        header: &Header<'b>,
        file: &'b [u8],
        total: u64,
        fetch: Fetch<'_>,
    ) -> Result<Cow<'b, [u8]>, VolumeFault> {
        let field = "ElementDataFile";
        let named = header.required(field)?;
        let names = match named {
            "LOCAL" | "Local" | "local" => {
                let start = file.len() - header.rest.len();
                return Self { skipped: 0, ..*self }.piece(&file[start..], total, "voxels");
            }
            _ if named.split_whitespace().next() == Some("LIST") => {
                let list = String::from_utf8_lossy(header.rest);
                list.lines().map(str::trim).filter(|line| !line.is_empty()).map(String::from).collect()
            }
            _ if named.contains('%') => pattern_names(field, named)?,
            _ => vec![named.to_string()],
        };
        gather(field, &names, total, self.element.bytes(), fetch, |bytes, expected, what| {
            self.piece(bytes, expected, what)
        })
        .map(Cow::Owned)
    }

    /// The bytes of voxels that one file holds; `expected` is how many.
    fn piece<'b>(&self, bytes: &'b [u8], expected: u64, what: &str) -> Result<Cow<'b, [u8]>, VolumeFault> {
        let found = bytes.len() as u64;
        let truncated = |expected| VolumeFault::Truncated { what: what.into(), expected, found };
        let start = match u64::try_from(self.skipped) {
            Ok(skipped) if skipped > found => return Err(truncated(expected.saturating_add(skipped))),
            Ok(skipped) => skipped,
            Err(_) => found.checked_sub(expected).ok_or_else(|| truncated(expected))?,
        };
        let rest = &bytes[start as usize..];
        if !self.is_binary {
            let count = expected / self.element.bytes();
            return samples::from_text(rest, self.element, count, what).map(Cow::Owned);
        }
        let mut source = Source::new(rest, self.packing, what);
        let voxels = source.take(expected)?;
        source.end(expected)?;
        Ok(voxels)
    }
}
