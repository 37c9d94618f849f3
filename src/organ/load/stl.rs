//! STL, binary and ASCII.

use super::{check_counts, finite, malformed};
use crate::files::excerpt;
use crate::organ::clean::RawMesh;
use crate::organ::error::MeshFault;
use glam::Vec3;
use std::borrow::Cow;
use std::io::Cursor;

/// Bytes before the facets of a binary file: 80 of free text and the number of facets.
const HEADER_LEN: usize = 84;
/// Bytes of a binary facet: normal, three corners, two bytes of attributes.
const FACET_LEN: u64 = 50;

/// Reads all solids, or the ASCII solid called `wanted`.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>) -> Result<RawMesh, MeshFault> {
    if bytes.is_empty() {
        return Err(MeshFault::Empty);
    }
    // Programs write binary files whose free text starts with "solid", so the size decides before the text does.
    let claimed =
        bytes.get(80..HEADER_LEN).map(|count| u64::from(u32::from_le_bytes([count[0], count[1], count[2], count[3]])));
    let present = bytes.len().saturating_sub(HEADER_LEN) as u64;
    let fits_exactly = claimed.is_some_and(|facets| facets * FACET_LEN == present);
    let is_text = bytes.trim_ascii_start().get(..5).is_some_and(|start| start.eq_ignore_ascii_case(b"solid"));
    if is_text && !fits_exactly {
        return read_ascii(bytes, wanted);
    }
    let Some(facets) = claimed else {
        return Err(MeshFault::Truncated { what: "bytes of header".into(), expected: 84, found: bytes.len() as u64 });
    };
    if facets * FACET_LEN > present {
        return Err(MeshFault::Truncated {
            what: "bytes of facets".into(),
            expected: facets * FACET_LEN,
            found: present,
        });
    }
    // Programs that stream their facets may leave a count of zero behind. A few odd bytes at the end are common.
    if present - facets * FACET_LEN >= FACET_LEN {
        let reason = format!("it counts {facets} facets, but there are {}", present / FACET_LEN);
        return Err(malformed("header", reason));
    }
    if let Some(wanted) = wanted {
        return Err(MeshFault::NoSuchNode { wanted: wanted.into(), names: Vec::new() });
    }
    check_counts(0, facets)?;
    let mut raw = RawMesh::default();
    // stl_io goes by the first word alone.
    let mut bytes = Cow::Borrowed(bytes);
    if is_text {
        bytes.to_mut()[..5].fill(b' ');
    }
    append(&mut raw, &bytes, |facet| format!("facet {}", facet + 1))?;
    Ok(raw)
}

/// Reads the solids one by one, as stl_io stops after the first and takes only lower case.
fn read_ascii(bytes: &[u8], wanted: Option<&str>) -> Result<RawMesh, MeshFault> {
    let text = String::from_utf8_lossy(bytes);
    let mut raw = RawMesh::default();
    let mut names = Vec::new();
    let mut was_inside = wanted.is_none();
    let mut lines = text.lines().map(str::trim).enumerate().filter(|(_, line)| !line.is_empty()).peekable();
    while let Some((number, line)) = lines.next() {
        let at = format!("line {}", number + 1);
        if !first_word_is(line, "solid") {
            return Err(malformed(at, format!("`solid` belongs here, not `{}`", excerpt(line))));
        }
        let name = line[5..].trim();
        let mut solid = String::from("solid \n");
        let mut is_ended = false;
        for (_, line) in lines.by_ref() {
            is_ended = first_word_is(line, "endsolid");
            if is_ended {
                break;
            }
            solid.push_str(&line.to_ascii_lowercase());
            solid.push('\n');
        }
        if !is_ended {
            return Err(malformed(
                "end of file",
                format!("the solid that starts on {at} has no `endsolid`; the file is cut off"),
            ));
        }
        solid.push_str("endsolid\n");
        let inside = wanted.is_none_or(|wanted| wanted == name);
        was_inside |= inside;
        if !name.is_empty() {
            names.push(name.to_string());
        }
        if inside {
            append(&mut raw, solid.as_bytes(), |facet| format!("facet {} of the solid on {at}", facet + 1))?;
        }
    }
    match wanted {
        Some(wanted) if !was_inside => Err(MeshFault::NoSuchNode { wanted: wanted.into(), names }),
        _ => Ok(raw),
    }
}

fn first_word_is(line: &str, keyword: &str) -> bool {
    line.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case(keyword))
}

fn append(raw: &mut RawMesh, bytes: &[u8], place: impl Fn(usize) -> String) -> Result<(), MeshFault> {
    let mut cursor = Cursor::new(bytes);
    let facets = stl_io::create_stl_reader(&mut cursor).map_err(|error| malformed("header", error.to_string()))?;
    for (number, facet) in facets.enumerate() {
        let facet = facet.map_err(|error| malformed(place(number), excerpt(&error.to_string())))?;
        let first = raw.positions.len() as u32;
        for corner in facet.vertices {
            raw.positions.push(finite(Vec3::from_array(corner.0), || place(number))?);
        }
        raw.triangles.push([first, first + 1, first + 2]);
        check_counts(0, raw.triangles.len() as u64)?;
    }
    Ok(())
}
