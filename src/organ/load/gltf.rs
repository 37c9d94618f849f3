//! glTF 2.0, as JSON with buffers beside it or inside it, and as GLB.
//!
//! The gltf crate reads the container and the JSON. Accessors are followed here with every index and length checked,
//! since the crate's own iterators trust offsets.

use super::{check_counts, finite, malformed};
use crate::files::{Fetch, excerpt};
use crate::organ::clean::{RawMesh, Weld};
use crate::organ::error::MeshFault;
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index, Root};
use std::borrow::Cow;
use std::collections::BTreeMap;

type Bytes<'a> = Cow<'a, [u8]>;

/// Required extensions that do not touch geometry, or that are handled.
const HARMLESS_EXTENSIONS: [&str; 5] =
    ["KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization"];

/// Reads the triangles of the default scene, or of what lies under the node or mesh called `wanted`.
pub(super) fn read(bytes: &[u8], wanted: Option<&str>, weld: Weld, fetch: Fetch) -> Result<RawMesh, MeshFault> {
    if bytes.is_empty() {
        return Err(MeshFault::Empty);
    }
    let (json, bin) = split_container(bytes)?;
    let root: Root =
        json::deserialize::from_slice(&json).map_err(|error| malformed("JSON", excerpt(&error.to_string())))?;
    let is_harmless = |name: &&String| HARMLESS_EXTENSIONS.iter().any(|prefix| name.starts_with(prefix));
    if let Some(extension) = root.extensions_required.iter().find(|name| !is_harmless(name)) {
        let what = format!("the glTF extension `{}`", excerpt(extension));
        return Err(MeshFault::Unsupported { what, advice: "export without compression or instancing".into() });
    }

    let mut first_with = BTreeMap::new();
    let uris = root.buffers.iter().map(|buffer| buffer.uri.as_deref());
    let contents_of = uris.enumerate().map(|(index, uri)| *first_with.entry(uri).or_insert(index)).collect();
    let buffers = root.buffers.iter().map(|_| None).collect();
    let raw = RawMesh { uvs: (weld == Weld::ByPositionAndUv).then(Vec::new), ..Default::default() };
    let mut reader = GltfReader { root: &root, bin, contents_of, buffers, fetch, raw };
    let mut names = Vec::new();
    let mut is_found = wanted.is_none();
    for Placed { mesh, name, world_from_node, inside } in placed_meshes(&root, wanted)? {
        names.extend(name.map(str::to_string));
        let Some(mesh) = mesh else {
            is_found |= inside;
            continue;
        };
        let mesh_name = root.meshes.get(mesh).and_then(|mesh| mesh.name.as_deref());
        names.extend(mesh_name.filter(|_| mesh_name != name).map(str::to_string));
        if inside || mesh_name.is_some_and(|name| Some(name) == wanted) {
            is_found = true;
            reader.append_mesh(mesh, world_from_node)?;
        }
    }
    match wanted {
        Some(wanted) if !is_found => Err(MeshFault::NoSuchNode { wanted: wanted.into(), names }),
        _ => Ok(reader.raw),
    }
}

/// JSON and binary chunk of a GLB; a text file is all JSON.
fn split_container(bytes: &[u8]) -> Result<(Bytes<'_>, Option<Bytes<'_>>), MeshFault> {
    const HEADER_LEN: u64 = 12;
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).into(), None));
    }
    let Some(length) = bytes.get(8..12).map(|length| u32::from_le_bytes([length[0], length[1], length[2], length[3]]))
    else {
        return Err(MeshFault::Truncated {
            what: "bytes of header".into(),
            expected: HEADER_LEN,
            found: bytes.len() as u64,
        });
    };
    // The crate subtracts the header's length unchecked.
    if u64::from(length) < HEADER_LEN || u64::from(length) > bytes.len() as u64 {
        let (what, expected, found) = ("bytes of file".into(), u64::from(length).max(HEADER_LEN), bytes.len() as u64);
        return Err(MeshFault::Truncated { what, expected, found });
    }
    let glb = gltf::Glb::from_slice(&bytes[..length as usize])
        .map_err(|error| malformed("GLB container", excerpt(&error.to_string())))?;
    Ok((glb.json, glb.bin))
}

/// A node of the scene, in the file's order.
struct Placed<'a> {
    mesh: Option<usize>,
    name: Option<&'a str>,
    world_from_node: DMat4,
    /// Whether it is the wanted node or lies under it.
    inside: bool,
}

/// Walks the default scene, or the first, or all nodes that have no parent, or bare meshes.
fn placed_meshes<'a>(root: &'a Root, wanted: Option<&str>) -> Result<Vec<Placed<'a>>, MeshFault> {
    if root.nodes.is_empty() {
        let bare =
            |mesh| Placed { mesh: Some(mesh), name: None, world_from_node: DMat4::IDENTITY, inside: wanted.is_none() };
        return Ok((0..root.meshes.len()).map(bare).collect());
    }
    let tops: Vec<usize> = match root.scene.map_or(root.scenes.first(), |scene| root.scenes.get(scene.value())) {
        Some(scene) => scene.nodes.iter().map(Index::value).collect(),
        None if root.scene.is_some() => return Err(malformed("scene", "it does not exist")),
        None => {
            let mut has_parent = vec![false; root.nodes.len()];
            for child in root.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
                if let Some(child) = has_parent.get_mut(child.value()) {
                    *child = true;
                }
            }
            (0..root.nodes.len()).filter(|&node| !has_parent[node]).collect()
        }
    };
    let mut visited = vec![false; root.nodes.len()];
    let mut placed = Vec::new();
    let mut open: Vec<_> = tops.into_iter().rev().map(|node| (node, DMat4::IDENTITY, wanted.is_none())).collect();
    while let Some((index, world_from_parent, inside)) = open.pop() {
        let (Some(node), Some(visited)) = (root.nodes.get(index), visited.get_mut(index)) else {
            return Err(malformed(format!("node {index}"), "it does not exist"));
        };
        if std::mem::replace(visited, true) {
            return Err(malformed(format!("node {index}"), "it has two parents or is its own ancestor"));
        }
        let name = node.name.as_deref();
        let inside = inside || name.is_some_and(|name| Some(name) == wanted);
        let world_from_node = world_from_parent * parent_from_node(node, index)?;
        placed.push(Placed { mesh: node.mesh.map(|mesh| mesh.value()), name, world_from_node, inside });
        let children = node.children.iter().flatten().rev();
        open.extend(children.map(|child| (child.value(), world_from_node, inside)));
    }
    Ok(placed)
}

fn parent_from_node(node: &json::Node, index: usize) -> Result<DMat4, MeshFault> {
    if let Some(matrix) = &node.matrix {
        return Ok(DMat4::from_cols_array(&matrix.map(f64::from)));
    }
    let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| Vec3::from_array(v).as_dvec3());
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| DQuat::from_array(q.0.map(f64::from)));
    let rotation = rotation / rotation.length();
    if !rotation.is_normalized() {
        return Err(malformed(format!("node {index}"), "its rotation is not a quaternion of length 1"));
    }
    let (scale, translation) = (vector(node.scale, DVec3::ONE), vector(node.translation, DVec3::ZERO));
    Ok(DMat4::from_scale_rotation_translation(scale, rotation, translation))
}

struct GltfReader<'a, 'f> {
    root: &'a Root,
    bin: Option<Bytes<'a>>,
    /// The first buffer with the same address, so that nothing is fetched or kept twice.
    contents_of: Vec<usize>,
    /// Contents of the buffers that were needed so far.
    buffers: Vec<Option<Bytes<'a>>>,
    fetch: Fetch<'f>,
    raw: RawMesh,
}

impl GltfReader<'_, '_> {
    fn append_mesh(&mut self, index: usize, world_from_node: DMat4) -> Result<(), MeshFault> {
        let root = self.root;
        let mesh = root.meshes.get(index).ok_or_else(|| malformed(format!("mesh {index}"), "it does not exist"))?;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place =
                format!("mesh `{}`, primitive {number}", excerpt(mesh.name.as_deref().unwrap_or(&index.to_string())));
            let mode = match primitive.mode {
                Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
                Checked::Valid(_) => continue,
                Checked::Invalid => return Err(malformed(place, "its mode is unknown")),
            };
            self.append_primitive(primitive, mode, world_from_node, &place)?;
        }
        Ok(())
    }

    fn append_primitive(
        &mut self,
        primitive: &Primitive,
        mode: Mode,
        world_from_node: DMat4,
        place: &str,
    ) -> Result<(), MeshFault> {
        let attribute = |semantic| primitive.attributes.get(&Checked::Valid(semantic)).map(Index::value);
        let positions = attribute(Semantic::Positions).ok_or_else(|| malformed(place, "it has no POSITION"))?;
        let positions = self.floats::<3>(positions, Type::Vec3, place)?;
        let first = self.raw.positions.len();
        check_counts((first + positions.len()) as u64, 0)?;
        for (number, position) in positions.iter().enumerate() {
            let position = world_from_node * Vec3::from_array(*position).as_dvec3().extend(1.0);
            self.raw.positions.push(finite(position.truncate().as_vec3(), || format!("{place}, vertex {number}"))?);
        }
        if self.raw.uvs.is_some() {
            let uvs = attribute(Semantic::TexCoords(0)).ok_or_else(|| MeshFault::NoUvs { place: place.into() })?;
            let uvs = self.floats::<2>(uvs, Type::Vec2, place)?;
            if uvs.len() != positions.len() {
                return Err(malformed(place, format!("{} TEXCOORD_0 for {} POSITION", uvs.len(), positions.len())));
            }
            for (number, &[u, v]) in uvs.iter().enumerate() {
                finite(Vec3::new(u, v, 0.0), || format!("{place}, texture coordinate {number}"))?;
            }
            self.raw.uvs.iter_mut().for_each(|all| all.extend(uvs.iter().map(|&uv| Vec2::from_array(uv))));
        }

        let count = positions.len() as u64;
        let corners = match primitive.indices {
            Some(accessor) => self.indices(accessor.value(), place)?,
            None => (0..count as u32).collect(),
        };
        if let Some(&index) = corners.iter().find(|&&index| u64::from(index) >= count) {
            let (place, index) = (place.into(), i64::from(index));
            return Err(MeshFault::IndexOutOfRange { place, what: "vertex".into(), index, count });
        }
        if mode == Mode::Triangles && !corners.len().is_multiple_of(3) {
            return Err(malformed(place, format!("{} indices do not make whole triangles", corners.len())));
        }
        check_counts(0, (self.raw.triangles.len() + corners.len() / 3) as u64)?;
        // A mirrored node shows its faces from behind.
        let is_mirrored = world_from_node.determinant() < 0.0;
        let mut push = |[a, b, c]: [u32; 3]| {
            let triangle = if is_mirrored { [a, c, b] } else { [a, b, c] };
            self.raw.triangles.push(triangle.map(|corner| corner + first as u32));
        };
        match mode {
            Mode::TriangleStrip => {
                let turned = |(number, w): (usize, &[u32])| {
                    if number % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }
                };
                corners.windows(3).enumerate().map(turned).for_each(&mut push);
            }
            Mode::TriangleFan => corners.windows(2).skip(1).for_each(|w| push([corners[0], w[0], w[1]])),
            _ => corners.as_chunks().0.iter().copied().for_each(&mut push),
        }
        check_counts(0, self.raw.triangles.len() as u64)
    }

    /// Vectors of an accessor as floats; integers are taken as they are or normalised (KHR_mesh_quantization).
    fn floats<const N: usize>(
        &mut self,
        accessor: usize,
        wanted: Type,
        place: &str,
    ) -> Result<Vec<[f32; N]>, MeshFault> {
        let place = format!("{place}, accessor {accessor}");
        let view = self.view(accessor, wanted, &place)?;
        let scale = if view.normalized {
            match view.component {
                ComponentType::I8 => 1.0 / 127.0,
                ComponentType::U8 => 1.0 / 255.0,
                ComponentType::I16 => 1.0 / 32767.0,
                ComponentType::U16 => 1.0 / 65535.0,
                _ => 1.0,
            }
        } else {
            1.0
        };
        let size = view.component.size();
        let component = |bytes: &[u8]| match (view.component, bytes) {
            (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
            (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])) * scale).max(-scale * 32767.0),
            (ComponentType::U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) * scale,
            (ComponentType::I8, &[a]) => (f32::from(a as i8) * scale).max(-scale * 127.0),
            (ComponentType::U8, &[a]) => f32::from(a) * scale,
            // Slices have the component's size.
            _ => f32::NAN,
        };
        Ok(view.items().map(|item| std::array::from_fn(|axis| component(&item[axis * size..][..size]))).collect())
    }

    fn indices(&mut self, accessor: usize, place: &str) -> Result<Vec<u32>, MeshFault> {
        let place = format!("{place}, accessor {accessor}");
        let view = self.view(accessor, Type::Scalar, &place)?;
        if !matches!(view.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(malformed(place, "indices must be unsigned integers"));
        }
        Ok(view.items().map(|item| item.iter().rev().fold(0, |index, &byte| index << 8 | u32::from(byte))).collect())
    }

    /// The bytes of an accessor, all of which are known to be there.
    fn view(&mut self, accessor: usize, wanted: Type, place: &str) -> Result<AccessorView<'_>, MeshFault> {
        let root = self.root;
        let missing = |what: &str| malformed(place, format!("its {what} does not exist"));
        let accessor = root.accessors.get(accessor).ok_or_else(|| malformed(place, "it does not exist"))?;
        if accessor.sparse.is_some() {
            let (what, advice) =
                (format!("a sparse accessor ({place})"), "export without sparse data or morph targets".into());
            return Err(MeshFault::Unsupported { what, advice });
        }
        let (Checked::Valid(component), Checked::Valid(dimensions)) = (&accessor.component_type, &accessor.type_)
        else {
            return Err(malformed(place, "its type is unknown"));
        };
        if *dimensions != wanted {
            return Err(malformed(place, format!("its type is {dimensions:?} where {wanted:?} belongs")));
        }
        let Some(view_index) = accessor.buffer_view else {
            let (what, advice) = (format!("an accessor without data ({place})"), "export without compression".into());
            return Err(MeshFault::Unsupported { what, advice });
        };
        let view = root.buffer_views.get(view_index.value()).ok_or_else(|| missing("buffer view"))?;
        let buffer = self.buffer(view.buffer.value(), place)?;

        let component = component.0;
        let size = component.size() as u64 * dimensions.multiplicity() as u64;
        let stride = view.byte_stride.map_or(size, |stride| stride.0 as u64);
        if stride < size {
            return Err(malformed(place, format!("its items of {size} bytes lie only {stride} bytes apart")));
        }
        let offset = |offset: Option<json::validation::USize64>| offset.map_or(0, |offset| offset.0);
        let start = offset(view.byte_offset);
        let truncated = |expected, found| MeshFault::Truncated { what: format!("{place}: bytes"), expected, found };
        let bytes = (start.checked_add(view.byte_length.0))
            .and_then(|end| buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?))
            .ok_or_else(|| truncated(start.saturating_add(view.byte_length.0), buffer.len() as u64))?;
        let count = accessor.count.0;
        let start = offset(accessor.byte_offset);
        let length = count.saturating_sub(1).saturating_mul(stride).saturating_add(if count > 0 { size } else { 0 });
        let bytes = (start.checked_add(length))
            .and_then(|end| bytes.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?))
            .ok_or_else(|| truncated(start.saturating_add(length), bytes.len() as u64))?;
        let (size, stride) = (size as usize, stride as usize);
        Ok(AccessorView { bytes, size, stride, component, normalized: accessor.normalized })
    }

    /// The contents of a buffer, fetched or decoded on first use.
    fn buffer(&mut self, index: usize, place: &str) -> Result<&[u8], MeshFault> {
        let missing = || malformed(place, format!("its buffer {index} does not exist"));
        let description = self.root.buffers.get(index).ok_or_else(missing)?;
        let slot = self.contents_of.get(index).and_then(|&first| self.buffers.get_mut(first)).ok_or_else(missing)?;
        let contents = match slot.take() {
            Some(contents) => contents,
            None => match description.uri.as_deref() {
                Some(uri) => Cow::Owned(load_uri(uri, index, self.fetch)?),
                None => self.bin.take().ok_or_else(|| malformed(place, format!("its buffer {index} has no data")))?,
            },
        };
        let (expected, found) = (description.byte_length.0, contents.len() as u64);
        if expected > found {
            return Err(MeshFault::Truncated { what: format!("bytes of buffer {index}"), expected, found });
        }
        Ok(slot.insert(contents))
    }
}

struct AccessorView<'a> {
    bytes: &'a [u8],
    size: usize,
    stride: usize,
    component: ComponentType,
    normalized: bool,
}

impl<'a> AccessorView<'a> {
    fn items(&self) -> impl Iterator<Item = &'a [u8]> {
        let size = self.size;
        self.bytes.chunks(self.stride).map(move |chunk| &chunk[..size])
    }
}

/// A `data:` URI decoded, or a sibling file fetched.
fn load_uri(uri: &str, buffer: usize, fetch: Fetch) -> Result<Vec<u8>, MeshFault> {
    if let Some(data) = uri.strip_prefix("data:") {
        return data
            .split_once(";base64,")
            .and_then(|(_, text)| decode_base64(text))
            .ok_or_else(|| malformed(format!("buffer {buffer}"), "its data URI is not valid base64"));
    }
    let path = decode_percent(uri);
    let is_outside =
        path.starts_with(['/', '\\']) || path.contains(':') || path.split(['/', '\\']).any(|part| part == "..");
    if is_outside {
        return Err(MeshFault::ForbiddenPath { path: excerpt(&path) });
    }
    fetch(&path).map_err(|reason| MeshFault::MissingFile { path: excerpt(&path), reason })
}

/// RFC 4648 with the standard alphabet; `None` for anything else. Padding may be missing.
fn decode_base64(text: &str) -> Option<Vec<u8>> {
    let text = text.trim_end_matches('=');
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3 + 2);
    for group in text.as_bytes().chunks(4) {
        let mut bits = 0u32;
        for &character in group {
            let value = match character {
                b'A'..=b'Z' => character - b'A',
                b'a'..=b'z' => character - b'a' + 26,
                b'0'..=b'9' => character - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => return None,
            };
            bits = bits << 6 | u32::from(value);
        }
        bits <<= 6 * (4 - group.len());
        let [_, whole @ ..] = bits.to_be_bytes();
        bytes.extend_from_slice(match group.len() {
            4 => &whole[..3],
            3 => &whole[..2],
            2 => &whole[..1],
            _ => return None,
        });
    }
    Some(bytes)
}

/// `%20` and the like; a `%` that starts no code stays as it is.
fn decode_percent(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = (*first == b'%').then(|| tail.get(..2)).flatten();
        let decoded = code.and_then(|code| u8::from_str_radix(std::str::from_utf8(code).ok()?, 16).ok());
        bytes.push(decoded.unwrap_or(*first));
        rest = if decoded.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test vectors of RFC 4648, section 10.
    #[test]
    fn base64_follows_the_rfc() {
        let vectors =
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob"), ("Zm9vYmFy", "foobar")];
        for (text, plain) in vectors {
            assert_eq!(decode_base64(text).as_deref(), Some(plain.as_bytes()));
        }
        assert_eq!(decode_base64("Zm9*"), None);
        assert_eq!(decode_base64("Zm9vY"), None);
    }

    #[test]
    fn percent_codes_are_decoded_before_paths_are_judged() {
        assert_eq!(decode_percent("my%20organ%2ebin"), "my organ.bin");
        assert_eq!(decode_percent("100%"), "100%");
        let mut fetch = |_: &str| Ok(Vec::new());
        for path in ["../a.bin", "/etc/passwd", "a/%2e%2e/b.bin", "..\\a.bin", "C:\\a.bin", "https://a.b/c.bin", "%2Fa"]
        {
            assert!(matches!(load_uri(path, 0, &mut fetch), Err(MeshFault::ForbiddenPath { .. })), "{path}");
        }
        assert!(load_uri("folder/a..b.bin", 0, &mut fetch).is_ok());
    }
}
