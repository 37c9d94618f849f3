//! NRRD: every type, byte order and encoding, attached and detached; axes, spaces and units.

use super::write::{gzip, hex, kinds, nrrd, numbers, text};
use super::{SIZE, Sibling, assert_place, kind, load, load_beside, message, readable, values};
use bevy_surgery::volume::Voxels;
use bevy_surgery::volume::load::{VolumeFormat, VolumeLoadOptions};
use glam::UVec3;

#[test]
fn every_type_order_and_encoding_is_read() {
    for number in kinds() {
        for (is_big, endian) in [(false, "little"), (true, "big")] {
            let raw = numbers(number.name, &number.values, is_big);
            for (encoding, data) in [
                ("raw", raw.clone()),
                ("gzip", gzip(&raw)),
                ("GZ", gzip(&raw)),
                ("text", text(&number.values)),
                ("txt", text(&number.values)),
                ("ascii", text(&number.values)),
                ("hex", hex(&raw)),
            ] {
                let fields = format!("type: {}\nendian: {endian}\nencoding: {encoding}", number.nrrd[0]);
                let volume = load(nrrd(&fields, &data), "a.nrrd").unwrap_or_else(|error| panic!("{fields}: {error}"));
                assert_eq!((volume.grid().size, kind(&volume)), (SIZE, number.kept), "{fields}");
                assert_eq!(values(&volume), number.values, "{fields}");
            }
        }
        for synonym in number.nrrd {
            let fields = format!("type:  {}\nencoding: text", synonym.to_uppercase());
            assert_eq!(
                values(&load(nrrd(&fields, &text(&number.values)), "a.nrrd").unwrap()),
                number.values,
                "{synonym}"
            );
        }
    }
}

const BYTES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

fn counted(volume: &bevy_surgery::volume::Volume) -> bool {
    values(volume) == BYTES.map(f64::from)
}

#[test]
fn voxels_lie_in_other_files_behind_lines_and_bytes() {
    let cases: &[(&str, &[Sibling])] = &[
        ("data file: a.raw", &[("a.raw", &BYTES)]),
        ("DataFile: ./deep/a b.raw", &[("deep/a b.raw", &BYTES)]),
        ("byte skip: 2\ndata file: a", &[("a", &[&[9; 2], &BYTES[..]].concat())]),
        ("byteskip: -1\ndata file: a", &[("a", &[&[9; 7], &BYTES[..]].concat())]),
        ("line skip: 2\nbyte skip: 1\ndata file: a", &[("a", &[b"one\ntwo\n9", &BYTES[..]].concat())]),
        ("data file: LIST\na\nb", &[("a", &BYTES[..6]), ("b", &BYTES[6..])]),
        ("data file: LIST 2\nb\na", &[("b", &BYTES[..6]), ("a", &BYTES[6..])]),
        ("data file: s%02d.raw 9 10 1", &[("s09.raw", &BYTES[..6]), ("s10.raw", &BYTES[6..])]),
        ("data file: s%d.raw 2 1 -1 2", &[("s2.raw", &BYTES[..6]), ("s1.raw", &BYTES[6..])]),
    ];
    for (fields, siblings) in cases {
        let siblings: Vec<(&str, Vec<u8>)> = siblings.iter().map(|(name, bytes)| (*name, bytes.to_vec())).collect();
        let header = format!("NRRD0005\ntype: uchar\ndimension: 3\nsizes: 3 2 2\nencoding: raw\n{fields}\n");
        let read = load_beside(header.as_bytes(), "a.nhdr", &siblings, &VolumeLoadOptions::default());
        assert!(counted(&read.unwrap_or_else(|error| panic!("{fields}: {error}")).0), "{fields}");
    }
    // Packed in a file of its own, with Windows' line ends, remarks and keys.
    let header = "NRRD0002\r\n# remark\r\nauthor:=a: b\r\ntype: uint8\r\ndimension: 3\r\nsizes: 3 2 2\r\nencoding: gzip\r\n\
                  byte skip: 3\r\ndata file: a.raw.gz\r\nwritten: by nobody\r\n";
    let packed = gzip(&[&[7; 3], &BYTES[..]].concat());
    let read = load_beside(header.as_bytes(), "a.nhdr", &[("a.raw.gz", packed)], &VolumeLoadOptions::default());
    assert!(counted(&read.unwrap().0));
}

#[test]
fn axes_are_turned_to_lps() {
    let place = |fields: &str| load(nrrd(&format!("type: uchar\nencoding: raw\n{fields}"), &BYTES), "a.nrrd").unwrap();
    let unit = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    assert_place(&place("content: nothing of the place"), unit);
    assert_place(&place("spacings: 2 0.5 3"), [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 3.0]]);
    let directions = "space directions: (1,2,3) (0,-2,0) (0,0,4)\nspace origin: (10,20,30)";
    let lps = [[10.0, 20.0, 30.0], [1.0, 2.0, 3.0], [0.0, -2.0, 0.0], [0.0, 0.0, 4.0]];
    let turned = |x: f64, y: f64| lps.map(|v| [v[0] * x, v[1] * y, v[2]]);
    for (space, expected) in [
        ("left-posterior-superior", lps),
        ("LPS", lps),
        ("right-anterior-superior", turned(-1.0, -1.0)),
        ("RAS", turned(-1.0, -1.0)),
        ("left-anterior-superior", turned(1.0, -1.0)),
        ("LAS", turned(1.0, -1.0)),
        ("scanner-xyz", lps),
    ] {
        assert_place(&place(&format!("space: {space}\n{directions}")), expected);
    }
    assert_place(&place(&format!("space dimension: 3\n{directions}")), lps);
    let centimetres = format!("space: LPS\n{directions}\nspace units: \"cm\" \"cm\" \"cm\"");
    assert_place(&place(&centimetres), lps.map(|v| v.map(|x| x * 10.0)));
}

#[test]
fn colours_frames_and_pictures_find_their_axes() {
    let read = |fields: &str, data: &[u8], frame| {
        let options = VolumeLoadOptions { frame, ..VolumeLoadOptions::default() };
        load_beside(&nrrd(&format!("type: uchar\nencoding: raw\n{fields}"), data), "a.nrrd", &[], &options)
    };
    let rgba: Vec<u8> = (0..48).collect();
    for fields in [
        "dimension: 4\nsizes: 4 3 2 2\nkinds: RGBA-color domain domain domain",
        "dimension: 4\nsizes: 4 3 2 2\nkinds: 4-color space space space\nspacings: NaN 1 1 1",
        "dimension: 4\nsizes: 4 3 2 2\nspace: LPS\nspace directions: none (1,0,0) (0,1,0) (0,0,1)",
        "dimension: 4\nsizes: 4 3 2 2",
    ] {
        let (volume, report) = read(fields, &rgba, None).unwrap_or_else(|error| panic!("{fields}: {error}"));
        let Voxels::Rgba(voxels) = volume.voxels() else { panic!("{fields}") };
        assert_eq!((voxels[0], voxels[11], voxels.len()), ([0, 1, 2, 3], [44, 45, 46, 47], 12), "{fields}");
        assert_eq!((report.element.as_str(), report.format), ("RGBA", VolumeFormat::Nrrd));
    }
    let (volume, _) =
        read("dimension: 4\nsizes: 3 3 2 2\nkinds: RGB-color domain domain domain", &rgba[..36], None).unwrap();
    let Voxels::Rgba(voxels) = volume.voxels() else { panic!("colours") };
    assert_eq!((voxels[1], voxels.len()), ([3, 4, 5, 255], 12));

    let time = "dimension: 4\nsizes: 3 2 2 4\nkinds: domain domain domain time";
    for (frame, first) in [(0, 0.0), (3, 36.0)] {
        let (volume, report) = read(time, &rgba, Some(frame)).unwrap();
        assert_eq!((values(&volume)[0], volume.grid().size, report.frames), (first, SIZE, 4));
    }
    let several = read(time, &rgba, None).unwrap_err();
    assert_eq!(
        readable(&several),
        "it holds 4 volumes one after another; choose one with the load option `frame` (0 to 3)"
    );
    assert_eq!(
        readable(&read(time, &rgba, Some(4)).unwrap_err()),
        "load option `frame`: 4 is asked for, but there are only 4, counted from 0"
    );
    let list = "dimension: 4\nsizes: 2 3 2 2\nkinds: list domain domain domain";
    assert_eq!(
        readable(&read(list, &rgba[..24], None).unwrap_err()),
        "axis 0 with 2 entries of kind list is not supported; save one number, RGB or RGBA per voxel"
    );
    // A picture, and one in colour.
    let (volume, _) = read("dimension: 2\nsizes: 4 3\nspacings: 2 3", &BYTES, None).unwrap();
    assert_eq!(volume.grid().size, UVec3::new(4, 3, 1));
    assert_place(&volume, [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.0]]);
    let (volume, _) = read("dimension: 3\nsizes: 3 2 2\nkinds: RGB-color domain domain", &BYTES, None).unwrap();
    assert_eq!((volume.grid().size, kind(&volume)), (UVec3::new(2, 2, 1), "rgba"));
}

#[test]
fn broken_headers_are_named_by_field_and_reason() {
    let good = "type: short\nencoding: raw\nendian: little\nspacings: 1 1 1";
    let data = [0; 24];
    assert!(load(nrrd(good, &data), "a.nrrd").is_ok());
    let broken = |from: &str, to: &str| {
        let file = String::from_utf8(nrrd(good, &data)).unwrap();
        assert!(file.contains(from), "{from}");
        message(file.replace(from, to), "a.nrrd")
    };
    for (from, to, expected) in [
        ("NRRD0004", "NRRD0009", "magic: version `9` of NRRD is not known"),
        ("NRRD0004", "nrrd", "magic: the file does not begin with NRRD0001 to NRRD0005"),
        ("type: short", "type: shirt", "type: `shirt` is no type of a number"),
        ("type: short\n", "", "type: this field is missing"),
        ("type: short", "type: block", "type block is not supported; save it with one number per voxel"),
        ("dimension: 3", "dimension: 0", "dimension: 0 is not a number from 1 to 16"),
        ("dimension: 3", "dimension: 5", "dimension 5 is not supported; save it as a volume of dimension 3"),
        ("dimension: 3", "dimension: three", "dimension: `three` is not a whole number"),
        ("sizes: 3 2 2", "sizes: 3 2", "sizes: there are 2 numbers where 3 belong"),
        ("sizes: 3 2 2", "sizes: 3 -2 2", "sizes: `-2` is not a positive whole number"),
        ("sizes: 3 2 2", "sizes: 3 0 2", "sizes: `0` is not a positive whole number"),
        (
            "sizes: 3 2 2",
            "sizes: 3 2 99999999999999999999",
            "sizes: `99999999999999999999` is not a positive whole number",
        ),
        ("sizes: 3 2 2", "sizes: 4294967295 2 2", "size: [4294967295, 2, 2]; a side has at most 2048 voxels"),
        (
            "sizes: 3 2 2",
            "sizes: 2048 2048 2048",
            "size: [2048, 2048, 2048] are 8589934592 voxels; at most 536870912 are read",
        ),
        (
            "sizes: 3 2 2",
            "sizes: 3 2 3",
            "voxels: 24 bytes found where 36 belong; the file is cut off or its header is wrong",
        ),
        (
            "sizes: 3 2 2",
            "sizes: 3 2 1",
            "voxels: more than the 12 bytes that belong there; the header names too small a size or type",
        ),
        ("spacings: 1 1 1", "spacings: 1 NaN 1", "spacings: NaN is not a positive number"),
        ("spacings: 1 1 1", "spacings: 1 0 1", "spacings: 0.0 is not a positive number"),
        ("spacings: 1 1 1", "spacings: 1 -1 1", "spacings: -1.0 is not a positive number"),
        ("spacings: 1 1 1", "spacings: 1 inf 1", "spacings: inf is not a positive number"),
        ("spacings: 1 1 1", "spacings: 1 x 1", "spacings: `x` is not a number"),
        (
            "spacings: 1 1 1",
            "space directions: (1,0,0) (2,0,0) (0,0,1)",
            "space directions: two of the three axes have the same direction",
        ),
        (
            "spacings: 1 1 1",
            "space directions: (1,0,0) (0,0,0) (0,0,1)",
            "space directions: the second axis has steps of (0.0, 0.0, 0.0) mm; a length from 1e-6 to 1e6 mm is needed",
        ),
        (
            "spacings: 1 1 1",
            "space directions: (1,0,0) (0,nan,0) (0,0,1)",
            "space directions: `(0,nan,0)` is not finite",
        ),
        (
            "spacings: 1 1 1",
            "space directions: (1,0,0) (0,1,0)",
            "space directions: there are 2 vectors where 3 belong",
        ),
        (
            "spacings: 1 1 1",
            "space directions: 1 0 0",
            "space directions: `1 0 0` is neither a vector like (1,0,0) nor none",
        ),
        (
            "spacings: 1 1 1",
            "space directions: (1,0,0) none (0,0,1)",
            "axis 1 with 2 entries of kind none is not supported; save one number, RGB or RGBA per voxel",
        ),
        ("spacings: 1 1 1", "space: somewhere", "space: `somewhere` is not known"),
        (
            "spacings: 1 1 1",
            "space: RAST",
            "space RAST is not supported; save one time of it, in space left-posterior-superior",
        ),
        ("spacings: 1 1 1", "space units: \"mile\"", "space units: `mile` is not mm, cm, m or um"),
        ("spacings: 1 1 1", "kinds: domain domain", "kinds: there are 2 for 3 axes"),
        ("endian: little\n", "", "endian: this field is missing"),
        ("endian: little", "endian: middle", "endian: `middle` is neither little nor big"),
        ("encoding: raw", "encoding: bzip2", "encoding bzip2 is not supported; save it with encoding gzip or raw"),
        ("encoding: raw", "encoding: morse", "encoding: `morse` is not raw, gzip, text or hex"),
        ("encoding: raw", "encoding: gzip", "voxels: the gzip data are damaged (invalid gzip header)"),
        ("encoding: raw", "encoding: raw\nencoding: raw", "encoding: it is given a second time in line 7"),
        ("encoding: raw", "no field", "line 6: `no field` is neither a field nor a comment"),
        ("encoding: raw", "encoding: raw\nbyte skip: -2", "byte skip: -2 is less than -1"),
        ("encoding: raw", "encoding: raw\nline skip: 99", "line skip: there are only 0 lines in the voxels"),
        (
            "encoding: raw",
            "encoding: raw\nbyte skip: 9223372036854775807",
            "voxels: 24 bytes found where 9223372036854775807 belong; the file is cut off or its header is wrong",
        ),
        ("encoding: raw", "encoding: text\nbyte skip: -1", "byte skip: -1 has a meaning for raw encoding only"),
        (
            "encoding: raw",
            "encoding: raw\ndata file: a.raw",
            "its data file `a.raw` cannot be read: there is no such file",
        ),
        (
            "encoding: raw",
            "encoding: raw\ndata file: ../../a.raw",
            "its data file `../../a.raw` lies outside the header's own folder; put it beside the header and name it relatively",
        ),
        (
            "encoding: raw",
            "encoding: raw\ndata file: /etc/passwd",
            "its data file `/etc/passwd` lies outside the header's own folder; put it beside the header and name it relatively",
        ),
        (
            "encoding: raw",
            "encoding: raw\ndata file: x%d 1 5 1",
            "data file: it names 5 files, but the voxels cannot be shared out evenly among so many",
        ),
        (
            "encoding: raw",
            "encoding: raw\ndata file: x%d 1 5000000 1",
            "data file: `x%d 1 5000000 1` stands for 5000000 files; at most 16384 are read",
        ),
    ] {
        assert_eq!(broken(from, to), expected, "{to}");
    }
}
