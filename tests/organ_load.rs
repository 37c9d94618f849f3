//! Organ meshes from files: what independent readers say of real ones, round trips through every format, and one
//! clear error for everything that cannot be used.

#[path = "organ_load/broken.rs"]
mod broken;
#[path = "organ_load/cleaning.rs"]
mod cleaning;

use bevy_surgery::organ::clean::{Topology, Weld};
use bevy_surgery::organ::error::MeshFault;
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse, parse_with};
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::organ::procedural::{ProceduralLiver, procedural_liver};
use glam::Vec3;
use std::fmt::Write;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/");
const MESHES: [&str; 6] = [
    "mesh/gallbladder.stl",
    "mesh/liver-smooth.obj",
    "mesh/liver-smoothUV.obj",
    "mesh/liver.obj",
    "mesh/liver2.obj",
    "mesh/spleen-parts.glb",
];

/// A real file, or nothing (and a line that says so) where the data are not there.
fn real(path: &str) -> Option<Vec<u8>> {
    let bytes = std::fs::read(format!("{DATA}{path}")).ok();
    if bytes.is_none() {
        println!("skipped: {path} is not here");
    }
    bytes
}

fn any_size(topology: Topology, weld: Weld) -> LoadOptions {
    LoadOptions { unit: MeshUnit::LargestExtent(0.2), topology, weld, ..Default::default() }
}

fn euler(mesh: &SurfaceMesh) -> i64 {
    let mut edges: Vec<[u32; 2]> = mesh
        .triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    mesh.positions_m.len() as i64 - edges.len() as i64 + mesh.triangles.len() as i64
}

// ------------------------------------------------------------------------------------------------- real files

#[test]
fn real_meshes_agree_with_an_independent_reader() {
    let Some(reference) = real("reference.json") else { return };
    let reference: serde_json::Value = serde_json::from_slice(&reference).unwrap();
    for (name, expected) in reference["meshes"].as_object().unwrap() {
        let (path, node) = name.split_once('#').map_or((name.as_str(), None), |(path, node)| (path, Some(node)));
        let Some(bytes) = real(path) else { return };
        let is_open = !expected["watertight"].as_bool().unwrap();
        // A thousandth keeps both the millimetre and the metre files within the limits; a metre file would be refused.
        let factor = if is_open { 1.0 } else { 0.001 };
        let options = LoadOptions {
            unit: MeshUnit::Metres(factor),
            node: node.map(str::to_string),
            weld: Weld::ByPosition,
            topology: if is_open { Topology::Any } else { Topology::Closed },
        };
        let mesh = parse(&bytes, path, &options).unwrap();
        let number = |key: &str| expected[key].as_f64().unwrap();
        let factor = f64::from(factor);
        assert_eq!(mesh.positions_m.len() as f64, number("vertices"), "{name}");
        assert_eq!(mesh.triangles.len() as f64, number("faces"), "{name}");
        assert_eq!(euler(&mesh) as f64, number("euler"), "{name}");
        let is_near = |found: f64, expected: f64, part: f64| (found / expected - 1.0).abs() < part;
        assert!(is_near(mesh.area_m2(), number("area") * factor.powi(2), 1e-6), "{name}: {}", mesh.area_m2());
        let (low, high) = mesh.bounds_m();
        for (axis, extent) in expected["extents"].as_array().unwrap().iter().enumerate() {
            let extent = extent.as_f64().unwrap() * factor;
            assert!((f64::from((high - low)[axis]) - extent).abs() < 1e-5 * factor.max(extent), "{name}");
        }
        assert!(mesh.uvs.is_none());
        if is_open {
            // The volume under an open surface depends on the origin and says nothing. These have seams and UVs.
            let with_uvs = parse(&bytes, path, &LoadOptions { weld: Weld::ByPositionAndUv, ..options }).unwrap();
            assert_eq!(with_uvs.uvs.as_ref().map(Vec::len), Some(with_uvs.positions_m.len()), "{name}");
            assert_eq!(surface(&with_uvs), surface(&mesh), "{name}");
        } else {
            assert!(is_near(mesh.volume_m3(), number("volume") * factor.powi(3), 1e-6), "{name}: {}", mesh.volume_m3());
        }
    }
}

#[test]
fn the_five_parts_of_the_spleen_close_when_they_are_welded() {
    let Some(bytes) = real("mesh/spleen-parts.glb") else { return };
    for node in [None, Some("VH_M_spleen".to_string())] {
        let options = LoadOptions { node, ..Default::default() };
        let (mesh, report) = parse_with(&bytes, "spleen-parts.glb", &options, &mut |_| Err("none".into())).unwrap();
        assert_eq!((mesh.triangles.len(), euler(&mesh), report.components), (16_872, 2, 1));
        // The sum of the parts' areas in reference.json; a spleen holds 0.1 to 0.3 litres.
        assert!((mesh.area_m2() - 0.027_473_247).abs() < 1e-8);
        assert!((1.0e-4..3.0e-4).contains(&mesh.volume_m3()), "{}", mesh.volume_m3());
        let uv = LoadOptions { weld: Weld::ByPositionAndUv, ..options };
        let with_seams = parse(&bytes, "spleen-parts.glb", &uv).unwrap();
        assert!(with_seams.positions_m.len() > mesh.positions_m.len());
        assert!((with_seams.volume_m3() / mesh.volume_m3() - 1.0).abs() < 1e-9);
    }
    let one = LoadOptions { node: Some("VH_M_hilum_of_spleen".into()), ..Default::default() };
    let error = parse(&bytes, "spleen-parts.glb", &one).unwrap_err();
    assert!(matches!(error.fault, MeshFault::NotClosed { border_edges: 173, .. }), "{error}");
}

#[test]
fn every_cut_through_a_real_file_is_an_error_that_names_it() {
    for path in MESHES {
        let Some(bytes) = real(path) else { return };
        for step in 0..200 {
            // The last few bytes may be normals and line ends that nobody misses.
            let length = (bytes.len() - 64) * step / 199;
            let parsed = parse(&bytes[..length], path, &any_size(Topology::Closed, Weld::ByPosition));
            let error = parsed.map(|_| length).unwrap_err();
            assert!(error.to_string().starts_with(&format!("{path}: ")), "{error}");
        }
    }
}

// ------------------------------------------------------------------------------------------------ round trips

fn liver() -> SurfaceMesh {
    procedural_liver(&ProceduralLiver::default())
}

/// Bits of the corners of all faces, each face from its smallest corner on, sorted: the same for the same surface.
fn surface(mesh: &SurfaceMesh) -> Vec<[[u32; 3]; 3]> {
    let corners = |face: &[u32; 3]| {
        let mut corners = face.map(|vertex| mesh.positions_m[vertex as usize].to_array().map(f32::to_bits));
        let smallest = (0..3).min_by_key(|&k| corners[k]).unwrap();
        corners.rotate_left(smallest);
        corners
    };
    let mut faces: Vec<_> = mesh.triangles.iter().map(corners).collect();
    faces.sort_unstable();
    faces
}

fn obj(mesh: &SurfaceMesh) -> String {
    let mut text = String::from("# a comment\nmtllib no such file.mtl\no organ\n");
    for p in &mesh.positions_m {
        writeln!(text, "v {} {} {}", p.x, p.y, p.z).unwrap();
    }
    for uv in mesh.uvs.iter().flatten() {
        writeln!(text, "vt {} {}", uv.x, uv.y).unwrap();
    }
    text.push_str("vn 0 0 1\nusemtl red\n");
    for face in &mesh.triangles {
        let corner = |v: u32| if mesh.uvs.is_some() { format!("{0}/{0}/1", v + 1) } else { format!("{}//1", v + 1) };
        writeln!(text, "f {} {} {}", corner(face[0]), corner(face[1]), corner(face[2])).unwrap();
    }
    text
}

fn stl_ascii(mesh: &SurfaceMesh) -> String {
    let mut text = String::from("solid organ of mine\n");
    for face in &mesh.triangles {
        text.push_str("facet normal 0 0 0\n outer loop\n");
        for p in face.map(|v| mesh.positions_m[v as usize]) {
            writeln!(text, "  vertex {:e} {:e} {:e}", p.x, p.y, p.z).unwrap();
        }
        text.push_str(" endloop\nendfacet\n");
    }
    text + "endsolid organ of mine\n"
}

fn stl_binary(mesh: &SurfaceMesh, free_text: &str) -> Vec<u8> {
    let mut bytes = format!("{free_text:80}").into_bytes();
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for face in &mesh.triangles {
        bytes.extend([0; 12]);
        bytes.extend(face.iter().flat_map(|&v| floats(&[mesh.positions_m[v as usize]])));
        bytes.extend([0; 2]);
    }
    bytes
}

fn floats(positions: &[Vec3]) -> Vec<u8> {
    positions.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect()
}

fn ply(mesh: &SurfaceMesh, format: &str) -> Vec<u8> {
    let (vertices, faces) = (mesh.positions_m.len(), mesh.triangles.len());
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment made for a test\nelement vertex {vertices}\nproperty float x\n\
         property float y\nproperty float z\nproperty uchar red\nelement face {faces}\n\
         property list uchar int vertex_indices\nend_header\n"
    )
    .into_bytes();
    let is_big = format == "binary_big_endian";
    for p in &mesh.positions_m {
        if format == "ascii" {
            bytes.extend(format!("{} {} {} 9\n", p.x, p.y, p.z).bytes());
        } else {
            bytes.extend(p.to_array().iter().flat_map(|x| if is_big { x.to_be_bytes() } else { x.to_le_bytes() }));
            bytes.push(9);
        }
    }
    for [a, b, c] in &mesh.triangles {
        if format == "ascii" {
            bytes.extend(format!("3 {a} {b} {c}\n").bytes());
        } else {
            bytes.push(3);
            bytes.extend([a, b, c].iter().flat_map(|x| if is_big { x.to_be_bytes() } else { x.to_le_bytes() }));
        }
    }
    bytes
}

/// JSON and buffer of a glTF file whose mesh hangs under a node that is turned, scaled and moved.
fn gltf_parts(mesh: &SurfaceMesh, uri: Option<&str>) -> (String, Vec<u8>) {
    let (vertices, corners) = (mesh.positions_m.len(), 3 * mesh.triangles.len());
    let mut buffer = floats(&mesh.positions_m);
    buffer.extend(mesh.triangles.iter().flatten().flat_map(|v| v.to_le_bytes()));
    let uri = uri.map(|uri| format!(r#""uri":"{uri}","#)).unwrap_or_default();
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[
        {{"name":"outer","translation":[8,0,0],"children":[1]}},
        {{"name":"inner","translation":[-8,0,0],"mesh":0}}],
        "meshes":[{{"name":"organ","primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{vertices},"type":"VEC3"}},
        {{"bufferView":1,"componentType":5125,"count":{corners},"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{0}}},{{"buffer":0,"byteOffset":{0},"byteLength":{1}}}],
        "buffers":[{{{uri}"byteLength":{2}}}]}}"#,
        12 * vertices,
        4 * corners,
        buffer.len()
    );
    (json, buffer)
}

fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let json = format!("{json:0$}", json.len().next_multiple_of(4));
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(json.bytes());
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let encode = |group: &[u8]| {
        let bits = group.iter().fold(0u32, |bits, &byte| bits << 8 | u32::from(byte)) << (8 * (3 - group.len()));
        let characters = (0..4).map(|k| ALPHABET[(bits >> (18 - 6 * k) & 63) as usize] as char);
        format!("{:=<4}", characters.take(group.len() + 1).collect::<String>())
    };
    bytes.chunks(3).map(encode).collect()
}

/// A file of every format, by name.
fn all_formats(mesh: &SurfaceMesh) -> Vec<(&'static str, Vec<u8>)> {
    let (json, buffer) = gltf_parts(mesh, None);
    let (inlined, _) = gltf_parts(mesh, Some(&format!("data:application/octet-stream;base64,{}", base64(&buffer))));
    vec![
        ("organ.obj", obj(mesh).into_bytes()),
        ("ascii.stl", stl_ascii(mesh).into_bytes()),
        ("loud.STL", stl_ascii(mesh).to_ascii_uppercase().into_bytes()),
        ("binary.stl", stl_binary(mesh, "made for a test")),
        ("treacherous.stl", stl_binary(mesh, "solid, but binary")),
        ("ascii.ply", ply(mesh, "ascii")),
        ("little.ply", ply(mesh, "binary_little_endian")),
        ("big.ply", ply(mesh, "binary_big_endian")),
        ("inlined.gltf", inlined.into_bytes()),
        ("organ.glb", glb(&json, &buffer)),
    ]
}

#[test]
fn every_format_gives_back_the_very_same_surface() {
    let mesh = liver();
    for (name, bytes) in all_formats(&mesh) {
        let (read, report) = parse_with(&bytes, name, &LoadOptions::default(), &mut |_| Err("none".into())).unwrap();
        assert_eq!(surface(&read), surface(&mesh), "{name}");
        assert_eq!(read.positions_m.len(), mesh.positions_m.len(), "{name}");
        assert_eq!((report.faces_turned, report.components, report.faces_degenerate), (0, 1, 0), "{name}");
    }
}

#[test]
fn a_gltf_buffer_is_fetched_from_beside_the_file() {
    let mesh = liver();
    let (json, buffer) = gltf_parts(&mesh, Some("my%20organ.bin"));
    let mut asked = Vec::new();
    let mut fetch = |path: &str| {
        asked.push(path.to_string());
        Ok(buffer.clone())
    };
    let (read, _) = parse_with(json.as_bytes(), "organ.gltf", &LoadOptions::default(), &mut fetch).unwrap();
    assert_eq!(surface(&read), surface(&mesh));
    assert_eq!(asked, ["my organ.bin"]);

    let error = parse(json.as_bytes(), "organ.gltf", &LoadOptions::default()).unwrap_err();
    assert!(matches!(&error.fault, MeshFault::MissingFile { path, .. } if path == "my organ.bin"), "{error}");
    let (json, _) = gltf_parts(&mesh, Some("..%2Forgan.bin"));
    let error = parse_with(json.as_bytes(), "organ.gltf", &LoadOptions::default(), &mut |_| Ok(buffer.clone()));
    assert!(matches!(error.unwrap_err().fault, MeshFault::ForbiddenPath { .. }));
}

#[test]
fn gltf_nodes_are_placed_and_mirrored_ones_keep_their_outside() {
    let mesh = liver();
    let (json, buffer) = gltf_parts(&mesh, None);
    let placed =
        json.replace(r#""translation":[-8,0,0]"#, r#""translation":[-8,0,0],"rotation":[0,0,1,0],"scale":[2,3,-1]"#);
    assert_ne!(placed, json);
    let options = LoadOptions { topology: Topology::Any, ..Default::default() };
    let (read, report) = parse_with(&glb(&placed, &buffer), "a.glb", &options, &mut |_| Err("none".into())).unwrap();
    // Half a turn about z negates x and y.
    for (found, p) in read.positions_m.iter().zip(&mesh.positions_m) {
        assert!(found.abs_diff_eq(*p * Vec3::new(-2.0, -3.0, -1.0), 1e-6));
    }
    assert_eq!(report.faces_turned, 0);
    assert!((read.volume_m3() / mesh.volume_m3() - 6.0).abs() < 1e-4);
}

#[test]
fn gltf_strips_fans_and_short_indices_are_triangles() {
    // A tetrahedron as a strip of all four faces; and as a fan of three with the fourth beside it.
    let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 0.1);
    let strip: &[u8] = &[0, 1, 2, 3, 0, 1];
    let fan: &[u8] = &[0, 1, 2, 3, 1, 0, 1, 3, 2];
    for (indices, primitives) in [
        (strip, r#"{"attributes":{"POSITION":0},"indices":1,"mode":5}"#),
        (fan, r#"{"attributes":{"POSITION":0},"indices":1,"mode":6},{"attributes":{"POSITION":0},"indices":2}"#),
    ] {
        let mut buffer = floats(&positions);
        buffer.extend(indices);
        let first = if indices.len() == 6 { 6 } else { 5 };
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{primitives}]}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
            {{"bufferView":0,"byteOffset":48,"componentType":5121,"count":{first},"type":"SCALAR"}},
            {{"bufferView":0,"byteOffset":54,"componentType":5121,"count":3,"type":"SCALAR"}}],
            "bufferViews":[{{"buffer":0,"byteLength":{0}}}],"buffers":[{{"byteLength":{0}}}]}}"#,
            buffer.len()
        );
        buffer.resize(buffer.len().next_multiple_of(4), 0);
        let mesh = parse(&glb(&json, &buffer), "tetrahedron.glb", &LoadOptions::default()).unwrap();
        assert_eq!(mesh.triangles.len(), 4);
        assert!((mesh.volume_m3() - 1e-3 / 6.0).abs() < 1e-9);
    }
}
