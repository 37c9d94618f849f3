//! PLY, ASCII and binary in both byte orders.

use super::{check_counts, finite, malformed, push_fan};
use crate::files::excerpt;
use crate::organ::clean::RawMesh;
use crate::organ::error::MeshFault;
use glam::{Vec2, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use std::io::ErrorKind;

/// Reads the elements `vertex` (`x y z`, and `s t`, `u v` or `texture_u texture_v`) and `face`
/// (`vertex_indices` or `vertex_index`). PLY has no names, so `wanted` is always an error.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>) -> Result<RawMesh, MeshFault> {
    if bytes.is_empty() {
        return Err(MeshFault::Empty);
    }
    if let Some(wanted) = wanted {
        return Err(MeshFault::NoSuchNode { wanted: wanted.into(), names: Vec::new() });
    }
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|error| parse_fault(&error, "header"))?;
    let count = |name: &str| header.elements.get(name).map_or(0, |element| element.count as u64);
    check_counts(count("vertex"), count("face"))?;
    for needed in ["vertex", "face"] {
        if !header.elements.contains_key(needed) {
            return Err(malformed("header", format!("there is no element `{needed}`")));
        }
    }

    let mut raw = RawMesh::default();
    let mut polygons = Vec::new();
    for element in header.elements.values() {
        check_length(element, header.encoding, reader.get_ref().len() as u64)?;
        let place = format!("element {}", excerpt(&element.name));
        let fault = |error| parse_fault(&error, &place);
        match element.name.as_str() {
            "vertex" => {
                let uv_names = uv_names(element)?;
                let vertices =
                    Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header).map_err(fault)?;
                for (number, vertex) in vertices.iter().enumerate() {
                    raw.positions.push(finite(vertex.position, || format!("vertex {number}"))?);
                }
                if uv_names.is_some() {
                    raw.uvs = Some(vertices.iter().map(|vertex| vertex.uv).collect());
                }
            }
            "face" => {
                if !element.properties.keys().any(|name| FACE_LISTS.contains(&name.as_str())) {
                    return Err(malformed(place, "it has no list `vertex_indices`"));
                }
                polygons =
                    Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(fault)?;
            }
            _ => {
                Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header).map_err(fault)?;
            }
        }
    }

    let left = reader.get_ref().trim_ascii().len();
    if left > 0 {
        return Err(malformed(
            "end of file",
            format!("{left} bytes follow the last element; a count in the header is wrong"),
        ));
    }

    let count = raw.positions.len() as u64;
    for (number, Face { corners }) in polygons.iter().enumerate() {
        let place = || format!("face {number}");
        if corners.len() < 3 {
            return Err(malformed(place(), format!("it has {} corner(s)", corners.len())));
        }
        let mut polygon = Vec::with_capacity(corners.len());
        for &index in corners {
            if index < 0 || index as u64 >= count {
                return Err(MeshFault::IndexOutOfRange { place: place(), what: "vertex".into(), index, count });
            }
            polygon.push(index as u32);
        }
        check_counts(0, (raw.triangles.len() + polygon.len()) as u64)?;
        push_fan(&mut raw, &polygon);
    }
    Ok(raw)
}

/// Refuses a count that the rest of the file cannot hold, before anything is read or reserved for it.
fn check_length(element: &ElementDef, encoding: Encoding, left: u64) -> Result<(), MeshFault> {
    let name = excerpt(&element.name);
    if element.properties.is_empty() && element.count > 0 {
        return Err(malformed("header", format!("the element `{name}` has no properties")));
    }
    let least: u64 = match encoding {
        // A digit and a blank or line end each; the very last line may lack its end.
        Encoding::Ascii => 2 * element.properties.len() as u64,
        _ => element.properties.values().map(|property| binary_len(&property.data_type)).sum(),
    };
    let expected = (element.count as u64).saturating_mul(least);
    if expected > left + u64::from(encoding == Encoding::Ascii) {
        return Err(MeshFault::Truncated { what: format!("bytes of element `{name}`"), expected, found: left });
    }
    Ok(())
}

/// Bytes of a scalar, or of an empty list.
fn binary_len(property: &PropertyType) -> u64 {
    let (PropertyType::Scalar(scalar) | PropertyType::List(scalar, _)) = property;
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// The two properties that hold texture coordinates; also checks that the position is there.
fn uv_names(element: &ElementDef) -> Result<Option<[&'static str; 2]>, MeshFault> {
    let is_scalar = |name: &str| {
        element.properties.get(name).is_some_and(|property| matches!(property.data_type, PropertyType::Scalar(_)))
    };
    if let Some(missing) = ["x", "y", "z"].into_iter().find(|name| !is_scalar(name)) {
        return Err(malformed("header", format!("the element `vertex` has no number `{missing}`")));
    }
    Ok(UV_NAMES.into_iter().find(|pair| pair.iter().all(|name| is_scalar(name))))
}

fn parse_fault(error: &ply_rs_bw::parser::ParseError, place: &str) -> MeshFault {
    let place = error.line().map_or_else(|| place.to_string(), |line| format!("{place} (line or record {line})"));
    // The message's first line says what is wrong; then it quotes the input, and goes on about its grammar.
    let message = error.to_string();
    let what = message.lines().next().unwrap_or_default();
    let what = what.strip_prefix("Line ").and_then(|rest| rest.split_once(": ")).map_or(what, |(_, what)| what);
    let input = message.split("String: '").nth(1).and_then(|rest| rest.lines().next()).unwrap_or_default();
    let reason = match error.kind() {
        ErrorKind::UnexpectedEof => "the file ends here; it is cut off".into(),
        _ if input.is_empty() => excerpt(what),
        _ => format!("{} `{}`", excerpt(what), excerpt(input.trim_end_matches('\''))),
    };
    malformed(place, reason)
}

const FACE_LISTS: [&str; 2] = ["vertex_indices", "vertex_index"];
const UV_NAMES: [[&str; 2]; 4] = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

#[derive(Default)]
struct Vertex {
    position: Vec3,
    uv: Vec2,
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(value) = property.to_f32_lossy() else { return PropertyAccessResult::Ignored };
        match name {
            "x" => self.position.x = value,
            "y" => self.position.y = value,
            "z" => self.position.z = value,
            _ if UV_NAMES.iter().any(|pair| pair[0] == name) => self.uv.x = value,
            _ if UV_NAMES.iter().any(|pair| pair[1] == name) => self.uv.y = value,
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

struct Face {
    corners: Vec<i64>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self { corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !FACE_LISTS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// An element that is read over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
