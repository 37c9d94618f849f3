//! Files that cannot be used: one clear error each, and never a panic.

use super::{all_formats, any_size, glb, gltf_parts, liver, obj, ply, stl_ascii, stl_binary};
use bevy_surgery::organ::clean::{Topology, Weld};
use bevy_surgery::organ::error::{MeshError, MeshFault};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit, parse};
use bevy_surgery::organ::mesh::SurfaceMesh;
use glam::Vec3;
use proptest::prelude::*;

fn fault(bytes: impl AsRef<[u8]>, name: &str) -> MeshFault {
    fault_with(bytes, name, &LoadOptions::default())
}

/// The error for a file, which must name it and be one line that a person can read.
fn fault_with(bytes: impl AsRef<[u8]>, name: &str, options: &LoadOptions) -> MeshFault {
    let MeshError { file, fault } =
        parse(bytes.as_ref(), name, options).map(|mesh| mesh.triangles.len()).expect_err(name);
    let message = MeshError::new(file, fault.clone()).to_string();
    assert!(message.starts_with(&format!("{name}: ")), "{message}");
    assert!(message.len() < 600 && !message.contains(|c: char| c.is_control()), "{message}");
    fault
}

/// A tetrahedron 0.1 m across.
fn tetrahedron() -> SurfaceMesh {
    SurfaceMesh {
        positions_m: [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 0.1).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        uvs: None,
    }
}

fn line(fault: &MeshFault) -> &str {
    match fault {
        MeshFault::Malformed { place, .. }
        | MeshFault::NotFinite { place }
        | MeshFault::IndexOutOfRange { place, .. }
        | MeshFault::NoUvs { place } => place,
        _ => "",
    }
}

#[test]
fn unknown_and_empty_files_say_so() {
    assert_eq!(fault("", "organ.fbx"), MeshFault::UnknownFormat { extension: "fbx".into() });
    assert_eq!(fault("", "organ"), MeshFault::UnknownFormat { extension: String::new() });
    for name in ["a.obj", "a.stl", "a.ply", "a.gltf", "a.glb"] {
        assert_eq!(fault("", name), MeshFault::Empty, "{name}");
    }
    assert_eq!(fault("v 0 0 0\n", "a.obj"), MeshFault::Empty);
    assert_eq!(fault(stl_binary(&SurfaceMesh::default(), ""), "a.stl"), MeshFault::Empty);
    assert_eq!(fault("solid a\nendsolid a\n", "a.stl"), MeshFault::Empty);
    assert_eq!(fault(ply(&SurfaceMesh::default(), "ascii"), "a.ply"), MeshFault::Empty);
    assert_eq!(fault(r#"{"asset":{"version":"2.0"}}"#, "a.gltf"), MeshFault::Empty);
}

#[test]
fn the_unit_is_checked_and_a_mistaken_one_is_pointed_out() {
    let bytes = obj(&tetrahedron());
    let with = |unit| LoadOptions { unit, ..Default::default() };
    for value in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        for unit in [MeshUnit::Metres(value), MeshUnit::LargestExtent(value)] {
            assert!(matches!(fault_with(&bytes, "a.obj", &with(unit)), MeshFault::BadOption { .. }));
        }
    }
    let fault = fault_with(&bytes, "a.obj", &with(MeshUnit::Metres(1000.0)));
    assert!(matches!(fault, MeshFault::TooLarge { extent_m, .. } if (extent_m - 100.0).abs() < 1e-3), "{fault}");
    let fault = fault_with(&bytes, "a.obj", &with(MeshUnit::Metres(0.001)));
    assert!(matches!(fault, MeshFault::TooSmall { extent_m, .. } if (extent_m - 1e-4).abs() < 1e-9), "{fault}");
    let mesh = parse(bytes.as_bytes(), "a.obj", &with(MeshUnit::LargestExtent(0.25))).unwrap();
    assert!((mesh.bounds_m().1 - mesh.bounds_m().0).abs_diff_eq(Vec3::splat(0.25), 1e-7));
}

#[test]
fn obj_errors_name_the_line() {
    let good = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nf 1 3 2\nf 1 2 4\nf -4 -1 -2\nf 2 3 4\n";
    assert!(parse(good.as_bytes(), "a.obj", &LoadOptions::default()).is_ok());
    for (from, to, expected, part) in [
        ("v 0 1 0", "v 0 1", "line 3", "3 numbers"),
        ("v 0 1 0", "v 0 one 0", "line 3", "3 numbers"),
        ("v 0 1 0", "v 0 nan 0", "line 3", "finite"),
        ("v 0 1 0", "v 0 1e39 0", "line 3", "finite"),
        ("f 1 2 4", "f 1 2 5", "line 7", "only 4"),
        ("f 1 2 4", "f 1 2 0", "line 7", "only 4"),
        ("f -4 -1 -2", "f -5 -1 -2", "line 8", "only 4"),
        ("f 1 2 4", "f 1 2 9223372036854775807", "line 7", "only 4"),
        ("f 1 2 4", "f 1 2 -9223372036854775808", "line 7", "only 4"),
        ("f 1 2 4", "f 1 2 four", "line 7", "corner"),
        ("f 1 2 4", "f 1/1/1/1 2 4", "line 7", "corner"),
        ("f 1 2 4", "f 1 2", "line 7", "2 corner"),
        ("f 1 2 4", "f", "line 7", "0 corner"),
        ("f 1 2 4", "f 1 2 \\", "line 7", "corner"),
        ("v 0 1 0", "v 0 1 0 \\", "line 3", "next line"),
    ] {
        let text = good.replacen(from, to, 1);
        let fault = fault(&text, "a.obj");
        assert_eq!(line(&fault), expected, "{to}: {fault}");
        assert!(fault.to_string().contains(part), "{to}: {fault}");
    }
    let own_uvs = any_size(Topology::Any, Weld::ByPositionAndUv);
    let textured = good.replace("f 1 3 2", "f 1/1 3/1 2/1");
    assert_eq!(line(&fault_with(&textured, "a.obj", &own_uvs)), "line 7");
    for index in ["2", "0", "-2", "-9223372036854775808"] {
        let text = good.replace("f 1 3 2", &format!("f 1/1 3/{index} 2/1"));
        let fault = fault_with(&text, "a.obj", &own_uvs);
        assert!(matches!(&fault, MeshFault::IndexOutOfRange { what, .. } if what == "texture coordinate"), "{fault}");
    }
}

#[test]
fn obj_polygons_polylines_weights_and_latin_1_are_read() {
    let cube = "# caf\u{e9}\nmtllib nothing.mtl\nv 0 0 0 1\nv 1 0 0 1\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\n\
                v 0 1 1\nv 9 9 9\nl 1 2 3 4\np 1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let latin_1: Vec<u8> = cube.chars().map(|c| c as u8).collect();
    let mesh = parse(&latin_1, "cube.OBJ", &LoadOptions::default()).unwrap();
    assert_eq!((mesh.positions_m.len(), mesh.triangles.len()), (8, 12));
    assert!((mesh.volume_m3() - 1.0).abs() < 1e-12);
}

#[test]
fn parts_are_chosen_by_name_and_a_wrong_name_lists_what_there_is() {
    let near = obj(&tetrahedron()).replace("o organ", "o near");
    let far = "o far\ng tumour capsule\nv 9 9 9\nv 9.5 9 9\nv 9 9.5 9\nv 9 9 9.5\nf -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n";
    let text = near + far;
    let with = |node: &str| LoadOptions { node: Some(node.into()), ..Default::default() };
    for (node, corner) in [("near", 0.0), ("far", 9.0), ("tumour", 9.0), ("capsule", 9.0), ("tumour capsule", 9.0)] {
        let mesh = parse(text.as_bytes(), "a.obj", &with(node)).unwrap();
        assert_eq!(mesh.bounds_m().0, Vec3::splat(corner), "{node}");
    }
    let fault = fault_with(&text, "a.obj", &with("spleen"));
    let names = ["near", "far", "tumour capsule"].map(String::from).to_vec();
    assert_eq!(fault, MeshFault::NoSuchNode { wanted: "spleen".into(), names });

    let solids = stl_ascii(&tetrahedron()) + &stl_ascii(&liver()).replace("organ of mine", "liver");
    assert_eq!(parse(solids.as_bytes(), "a.stl", &with("organ of mine")).unwrap().triangles.len(), 4);
    assert_eq!(parse(solids.as_bytes(), "a.stl", &with("liver")).unwrap().triangles.len(), 1280);
    assert_eq!(parse(solids.as_bytes(), "a.stl", &LoadOptions::default()).unwrap().triangles.len(), 1280);
    for (name, bytes) in all_formats(&tetrahedron()) {
        assert!(matches!(fault_with(bytes, name, &with("spleen")), MeshFault::NoSuchNode { .. }), "{name}");
    }
    let (json, buffer) = gltf_parts(&tetrahedron(), None);
    for node in ["outer", "inner", "organ"] {
        assert!(parse(&glb(&json, &buffer), "a.glb", &with(node)).is_ok(), "{node}");
    }
}

#[test]
fn headers_that_claim_more_than_there_is_are_refused_before_anything_is_read() {
    let claims = |fault: MeshFault| matches!(fault, MeshFault::Truncated { expected, found, .. } if expected > found);
    let mut stl = stl_binary(&tetrahedron(), "");
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(claims(fault(&stl, "a.stl")));
    assert!(claims(fault(&stl[..83], "a.stl")));
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let bytes = ply(&tetrahedron(), format);
        for (count, is_sensible) in
            [("4000000", true), ("18446744073709551615", false), ("99999999999999999999", false)]
        {
            for element in ["vertex 4", "face 4"] {
                let (name, _) = element.split_once(' ').unwrap();
                let header_length = bytes.windows(11).position(|window| window == b"end_header\n").unwrap();
                let header = std::str::from_utf8(&bytes[..header_length]).unwrap();
                let header = header.replace(element, &format!("{name} {count}"));
                let fault = fault([header.as_bytes(), &bytes[header_length..]].concat(), "a.ply");
                assert!(if is_sensible { claims(fault) } else { !claims(fault) }, "{format} {element} {count}");
            }
        }
    }
    let (json, buffer) = gltf_parts(&tetrahedron(), None);
    for (from, to) in [
        (r#""count":4"#, r#""count":4294967295"#),
        (r#""count":12"#, r#""count":18446744073709551615"#),
        (r#""byteOffset":48"#, r#""byteOffset":18446744073709551615"#),
        (r#""byteLength":48,"#, r#""byteLength":18446744073709551615,"#),
        (r#""byteLength":48}"#, r#""byteLength":18446744073709551615}"#),
        (r#""byteLength":96"#, r#""byteLength":97"#),
    ] {
        let claiming = json.replace(from, to);
        if claiming != json {
            assert!(claims(fault(glb(&claiming, &buffer), "a.glb")), "{to}");
        }
    }
    for length in [0u32, 11, 12, 27, u32::MAX] {
        let mut bytes = glb(&json, &buffer);
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        fault(&bytes, "a.glb");
    }
}

#[test]
fn stl_and_ply_errors_say_where() {
    let text = stl_ascii(&tetrahedron());
    let third = text.match_indices("vertex").nth(7).unwrap().0;
    let broken = format!("{}vertx{}", &text[..third], &text[third + 6..]);
    assert_eq!(line(&fault(&broken, "a.stl")), "facet 3 of the solid on line 1");
    assert!(fault(&text[..text.len() - 30], "a.stl").to_string().contains("endsolid"));
    assert!(fault(format!("{text}rubbish"), "a.stl").to_string().contains("rubbish"));

    let mut uncounted = stl_binary(&tetrahedron(), "");
    uncounted[80] = 0;
    assert!(fault(&uncounted, "a.stl").to_string().contains("counts 0 facets, but there are 4"));
    let mut nan = stl_binary(&tetrahedron(), "");
    nan[84 + 50 + 12..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(fault(&nan, "a.stl"), MeshFault::NotFinite { place: "facet 2".into() });

    let text = String::from_utf8(ply(&tetrahedron(), "ascii")).unwrap();
    for (from, to, expected) in [
        ("3 0 1 3", "3 0 1 4", "face 1: vertex 4 is used, but there are only 4"),
        ("3 0 1 3", "3 0 1 -1", "face 1: vertex -1 is used, but there are only 4"),
        ("3 0 1 3", "2 0 1", "face 1: it has 2 corner(s)"),
        ("3 0 1 3", "4 0 1 3", "element face"),
        ("3 0 1 3", "3 0 1 x", "3 0 1 x"),
        ("0.1 0 0 9", "0.1 zero 0 9", "element vertex"),
        ("0.1 0 0 9", "1e39 0 0 9", "vertex 1: a coordinate is not a finite number"),
        ("property float z", "property float w", "no number `z`"),
        ("property list uchar int vertex_indices", "property list uchar int corners", "no list `vertex_indices`"),
        ("element face 4", "element faces 4", "no element `face`"),
        ("format ascii", "format morse", "header"),
        ("ply\n", "plyed\n", "header"),
        ("end_header\n", "", "header"),
        ("element face 4", "element face 3", "7 bytes follow the last element"),
    ] {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text);
        let fault = fault(&broken, "a.ply");
        assert!(fault.to_string().contains(expected), "{to}: {fault}");
    }
    let no_properties = "ply\nformat binary_little_endian 1.0\nelement nothing 18446744073709551615\nelement vertex 0\n\
                         property float x\nproperty float y\nproperty float z\nelement face 0\n\
                         property list uchar int vertex_index\nend_header\n";
    assert!(fault(no_properties, "a.ply").to_string().contains("no properties"));
}

#[test]
fn gltf_errors_say_where() {
    let (json, buffer) = gltf_parts(&tetrahedron(), None);
    for (from, to, expected) in [
        (r#""scene":0"#, r#""scene":7"#, "scene: it does not exist"),
        (r#""children":[1]"#, r#""children":[0]"#, "node 0: it has two parents"),
        (r#""children":[1]"#, r#""children":[9]"#, "node 9: it does not exist"),
        (r#""mesh":0"#, r#""mesh":3"#, "mesh 3: it does not exist"),
        (r#""mesh":0"#, r#""mesh":0,"rotation":[0,0,0,0]"#, "node 1: its rotation"),
        (r#""mesh":0"#, r#""mesh":0,"scale":[1e39,1,1]"#, "number out of range"),
        (r#""POSITION":0"#, r#""NORMAL":0"#, "no POSITION"),
        (r#""POSITION":0"#, r#""POSITION":5"#, "accessor 5: it does not exist"),
        (r#""POSITION":0"#, r#""POSITION":1"#, "its type is Scalar where Vec3 belongs"),
        (r#""indices":1"#, r#""indices":1,"mode":9"#, "mode is unknown"),
        (r#""componentType":5125,"count":12"#, r#""componentType":5125,"count":11"#, "whole triangles"),
        (r#""componentType":5125"#, r#""componentType":5126"#, "unsigned integers"),
        (r#""componentType":5125"#, r#""componentType":1"#, "its type is unknown"),
        (r#"{"bufferView":0,"#, r#"{"#, "without data"),
        (r#"{"bufferView":0,"#, r#"{"bufferView":8,"#, "its buffer view does not exist"),
        (r#"{"buffer":0,"byteLength""#, r#"{"buffer":2,"byteLength""#, "its buffer 2 does not exist"),
        (r#"{"buffer":0,"byteLength""#, r#"{"buffer":0,"byteStride":4,"byteLength""#, "4 bytes apart"),
        (
            r#""type":"VEC3""#,
            r#""type":"VEC3","sparse":{"count":1,"indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":0}}"#,
            "sparse",
        ),
        (
            r#""scene":0"#,
            r#""extensionsRequired":["KHR_draco_mesh_compression"],"scene":0"#,
            "KHR_draco_mesh_compression",
        ),
        (r#""version":"2.0""#, r#""version":2"#, "JSON"),
    ] {
        let broken = json.replacen(from, to, 1);
        assert_ne!(broken, json, "{from}");
        let fault = fault(glb(&broken, &buffer), "a.glb");
        assert!(fault.to_string().contains(expected), "{to}: {fault}");
    }
    let mut far = buffer.clone();
    far[48] = 200;
    assert!(matches!(fault(glb(&json, &far), "a.glb"), MeshFault::IndexOutOfRange { index: 200, count: 4, .. }));
    far = buffer.clone();
    far[12..16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert!(line(&fault(glb(&json, &far), "a.glb")).ends_with("vertex 1"));
    assert!(fault(json, "a.gltf").to_string().contains("buffer 0 has no data"));
    let (json, _) = gltf_parts(&tetrahedron(), Some("data:application/octet-stream;base64,****"));
    assert!(fault(json, "a.gltf").to_string().contains("base64"));
    let own_uvs = any_size(Topology::Any, Weld::ByPositionAndUv);
    let (json, buffer) = gltf_parts(&tetrahedron(), None);
    assert!(matches!(fault_with(glb(&json, &buffer), "a.glb", &own_uvs), MeshFault::NoUvs { .. }));
}

/// What a number or a word in a file may be replaced by.
const NASTY: [&str; 14] = [
    "-1",
    "0",
    "4294967295",
    "-9223372036854775808",
    "18446744073709551615",
    "1e39",
    "nan",
    " ",
    "\n",
    "\\",
    "{",
    "]",
    "\"",
    "f 1 2 3\n",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Bytes changed, cut out and put in at random: an error or a surface that is as it should be, never a panic.
    #[test]
    fn mutated_files_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5u8), 1..12),
        format in any::<prop::sample::Index>(),
        weld in prop::sample::select(vec![Weld::ByPosition, Weld::ByPositionAndUv]),
    ) {
        let files = all_formats(&tetrahedron());
        let (name, mut bytes) = files[format.index(files.len())].clone();
        for (place, value, kind) in edits {
            let place = place.index(bytes.len().max(1));
            match kind {
                0 if place < bytes.len() => bytes[place] = value,
                1 if place < bytes.len() => bytes[place] ^= 1 << (value % 8),
                2 => bytes.insert(place, value),
                3 => drop(bytes.drain(place..(place + usize::from(value % 16)).min(bytes.len()))),
                _ => {
                    let word = NASTY[usize::from(value) % NASTY.len()].bytes();
                    drop(bytes.splice(place..(place + usize::from(value % 5)).min(bytes.len()), word));
                }
            }
        }
        if let Ok(mesh) = parse(&bytes, name, &any_size(Topology::Any, weld)) {
            let count = mesh.positions_m.len() as u32;
            prop_assert!(mesh.positions_m.iter().all(|position| position.is_finite()));
            prop_assert!(mesh.triangles.as_flattened().iter().all(|&vertex| vertex < count));
            let (low, high) = mesh.bounds_m();
            prop_assert!(((high - low).max_element() - 0.2).abs() < 1e-4);
        }
    }
}
