//! MetaImage: every type and byte order, raw, packed and written; attached and detached; places.

use super::write::{kinds, metaimage, numbers, text, zlib};
use super::{SIZE, Sibling, assert_place, kind, load, load_beside, message, values};
use bevy_surgery::volume::Voxels;
use bevy_surgery::volume::load::VolumeLoadOptions;
use glam::UVec3;

#[test]
fn every_type_order_and_packing_is_read() {
    for number in kinds() {
        for met in number.met {
            for (is_big, field) in [
                (false, "BinaryDataByteOrderMSB = False"),
                (true, "BinaryDataByteOrderMSB = True"),
                (true, "ElementByteOrderMSB = true"),
                (false, "Comment = none said"),
            ] {
                let raw = numbers(number.name, &number.values, is_big);
                for (packing, data) in [
                    ("BinaryData = True", raw.clone()),
                    ("CompressedData = True\nCompressedDataSize = 1", zlib(&raw)),
                    ("BinaryData = False", text(&number.values)),
                ] {
                    let fields = format!("ElementType = {met}\n{field}\n{packing}");
                    let volume = load(metaimage(&fields, "LOCAL", &data), "a.mha")
                        .unwrap_or_else(|error| panic!("{fields}: {error}"));
                    assert_eq!((volume.grid().size, kind(&volume)), (SIZE, number.kept), "{fields}");
                    assert_eq!(values(&volume), number.values, "{fields}");
                }
            }
        }
    }
}

const BYTES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

#[test]
fn voxels_lie_in_other_files_behind_headers() {
    let cases: &[(&str, &str, &[Sibling])] = &[
        ("", "a.raw", &[("a.raw", &BYTES)]),
        ("", "./deep/a.raw", &[("deep/a.raw", &BYTES)]),
        ("HeaderSize = 3", "a.raw", &[("a.raw", &[&[9; 3], &BYTES[..]].concat())]),
        ("HeaderSize = -1", "a.raw", &[("a.raw", &[&[9; 500], &BYTES[..]].concat())]),
        ("HeaderSize = -1", "a.raw", &[("a.raw", &BYTES)]),
        ("CompressedData = True", "a.zraw", &[("a.zraw", &zlib(&BYTES))]),
        ("", "LIST\na\n\nb", &[("a", &BYTES[..6]), ("b", &BYTES[6..])]),
        ("", "LIST 2D\r\nb\r\na", &[("b", &BYTES[..6]), ("a", &BYTES[6..])]),
        (
            "HeaderSize = 1",
            "s%03d 7 8 1",
            &[("s007", &[&[9], &BYTES[..6]].concat()), ("s008", &[&[9], &BYTES[6..]].concat())],
        ),
    ];
    for (fields, file, siblings) in cases {
        let siblings: Vec<(&str, Vec<u8>)> = siblings.iter().map(|(name, bytes)| (*name, bytes.to_vec())).collect();
        let header = metaimage(&format!("ElementType = MET_UCHAR\n{fields}"), file, &[]);
        let read = load_beside(&header, "a.mhd", &siblings, &VolumeLoadOptions::default());
        let (volume, _) = read.unwrap_or_else(|error| panic!("{fields} {file}: {error}"));
        assert_eq!(values(&volume), BYTES.map(f64::from), "{fields} {file}");
    }
}

#[test]
fn rows_of_the_matrix_are_axes() {
    let read = |fields: &str| {
        load(metaimage(&format!("ElementType = MET_UCHAR\n{fields}"), "LOCAL", &BYTES), "a.mha").unwrap()
    };
    assert_place(&read(""), [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    for (origin, matrix, spacing) in [
        ("Offset", "TransformMatrix", "ElementSpacing"),
        ("Position", "Rotation", "ElementSize"),
        ("Origin", "Orientation", "ElementSpacing"),
    ] {
        let fields = format!("{origin} = 1 2 3\n{matrix} = 0 1 0 0 0 -1 1 0 0\n{spacing} = 2 3 4");
        assert_place(&read(&fields), [[1.0, 2.0, 3.0], [0.0, 2.0, 0.0], [0.0, 0.0, -3.0], [4.0, 0.0, 0.0]]);
    }
}

#[test]
fn colours_frames_and_pictures_find_their_axes() {
    let read = |fields: &str, data: &[u8], frame| {
        let options = VolumeLoadOptions { frame, ..VolumeLoadOptions::default() };
        load_beside(&metaimage(&format!("ElementType = MET_UCHAR\n{fields}"), "LOCAL", data), "a.mha", &[], &options)
    };
    let many: Vec<u8> = (0..48).collect();
    let (volume, _) = read("ElementNumberOfChannels = 4", &many, None).unwrap();
    assert!(matches!(volume.voxels(), Voxels::Rgba(voxels) if voxels[11] == [44, 45, 46, 47]));
    let (volume, report) = read("ElementNumberOfChannels = 3", &many[..36], None).unwrap();
    assert!(matches!(volume.voxels(), Voxels::Rgba(voxels) if voxels[11] == [33, 34, 35, 255]));
    assert_eq!(report.element, "RGB");
    let time = "NDims = 4\nDimSize = 3 2 2 4\nElementSpacing = 1 2 3 9\nOffset = 4 5 6 9\nTransformMatrix = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
    let (volume, report) = read(time, &many, Some(2)).unwrap();
    assert_eq!((values(&volume)[0], report.frames, volume.grid().size), (24.0, 4, SIZE));
    assert_place(&volume, [[4.0, 5.0, 6.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]);
    assert!(read(time, &many, None).is_err());
    let (volume, _) = read("NDims = 2\nDimSize = 4 3\nTransformMatrix = 0 1 -1 0", &BYTES, None).unwrap();
    assert_eq!(volume.grid().size, UVec3::new(4, 3, 1));
    assert_place(&volume, [[0.0; 3], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[test]
fn broken_headers_are_named_by_field_and_reason() {
    let good = "ElementType = MET_SHORT\nElementSpacing = 1 1 1\nOffset = 0 0 0";
    let data = [0; 24];
    assert!(load(metaimage(good, "LOCAL", &data), "a.mha").is_ok());
    for (from, to, expected) in [
        (
            "ObjectType = Image",
            "ObjectType = Tube",
            "ObjectType Tube is not supported; a volume has ObjectType = Image",
        ),
        ("ObjectType = Image", "no header", "line 1: `no header` is no field with a value"),
        ("NDims = 3\n", "", "NDims: this field is missing"),
        ("NDims = 3", "NDims = 7", "NDims 7 is not supported; save it as a volume with NDims = 3"),
        ("DimSize = 3 2 2", "DimSize = 3 2", "DimSize: there are 2 numbers where 3 belong"),
        ("DimSize = 3 2 2", "DimSize = 3 -2 2", "DimSize: `-2` is not a positive whole number"),
        ("DimSize = 3 2 2", "DimSize = 0 2 2", "DimSize: `0` is not a positive whole number"),
        ("DimSize = 3 2 2", "DimSize = 3 2 1e9", "DimSize: `1e9` is not a positive whole number"),
        ("DimSize = 3 2 2", "DimSize = 3 2 4294967298", "size: [3, 2, 4294967295]; a side has at most 2048 voxels"),
        (
            "NDims = 3\nDimSize = 3 2 2",
            "NDims = 4\nDimSize = 2000 2000 100 18446744073709551615",
            "DimSize: [2000, 2000, 100, 18446744073709551615] voxels are more than any file holds",
        ),
        (
            "DimSize = 3 2 2",
            "DimSize = 3 2 4",
            "voxels: 24 bytes found where 48 belong; the file is cut off or its header is wrong",
        ),
        (
            "DimSize = 3 2 2",
            "DimSize = 3 2 1",
            "voxels: more than the 12 bytes that belong there; the header names too small a size or type",
        ),
        ("ElementSpacing = 1 1 1", "ElementSpacing = 1 1", "ElementSpacing: there are 2 numbers where 3 belong"),
        ("ElementSpacing = 1 1 1", "ElementSpacing = 1 nan 1", "ElementSpacing: NaN is not a positive number"),
        ("ElementSpacing = 1 1 1", "ElementSize = 1 -1 1", "ElementSize: -1.0 is not a positive number"),
        ("Offset = 0 0 0", "Offset = 0 inf 0", "Offset: inf is not a finite number"),
        ("Offset = 0 0 0", "Rotation = 1 0 0 1 0 0 0 0 1", "Rotation: two of the three axes have the same direction"),
        (
            "Offset = 0 0 0",
            "Rotation = 1 0 0 0 0 0 0 0 1",
            "Rotation: the second axis has steps of (0.0, 0.0, 0.0) mm; a length from 1e-6 to 1e6 mm is needed",
        ),
        ("MET_SHORT", "MET_SHIRT", "ElementType: `MET_SHIRT` is no type of a number"),
        (
            "MET_SHORT",
            "MET_SHORT_ARRAY",
            "ElementType MET_SHORT_ARRAY is not supported; save one number per voxel, or ElementNumberOfChannels of them",
        ),
        (
            "Offset = 0 0 0",
            "ElementNumberOfChannels = 2",
            "ElementNumberOfChannels 2 is not supported; save 1, 3 (RGB) or 4 (RGBA) of them",
        ),
        ("Offset = 0 0 0", "ElementNumberOfChannels = 3", "colours of i16 is not supported; save them as MET_UCHAR"),
        ("Offset = 0 0 0", "HeaderSize = -2", "HeaderSize: -2 is less than -1"),
        (
            "Offset = 0 0 0",
            "HeaderSize = -1\nCompressedData = True",
            "HeaderSize: -1 has a meaning for raw voxels only, not for packed or written ones",
        ),
        ("Offset = 0 0 0", "CompressedData = maybe", "CompressedData: `maybe` is neither True nor False"),
        ("Offset = 0 0 0", "CompressedData = True", "voxels: the zlib data are damaged (corrupt deflate stream)"),
        ("Offset = 0 0 0", "NDims = 3", "NDims: it is given a second time in line 6"),
        ("ElementDataFile = LOCAL", "Comment = none", "ElementDataFile: this field is missing; it ends the header"),
        (
            "ElementDataFile = LOCAL",
            "ElementDataFile = a.raw",
            "its data file `a.raw` cannot be read: there is no such file",
        ),
        (
            "ElementDataFile = LOCAL",
            r"ElementDataFile = ..\..\a.raw",
            r"its data file `..\..\a.raw` lies outside the header's own folder; put it beside the header and name it relatively",
        ),
        (
            "ElementDataFile = LOCAL",
            r"ElementDataFile = C:\a.raw",
            r"its data file `C:\a.raw` lies outside the header's own folder; put it beside the header and name it relatively",
        ),
        (
            "ElementDataFile = LOCAL",
            "ElementDataFile = x%d 1 7 1",
            "ElementDataFile: it names 7 files, but the voxels cannot be shared out evenly among so many",
        ),
    ] {
        let file = String::from_utf8(metaimage(good, "LOCAL", &data)).unwrap();
        assert!(file.contains(from), "{from}");
        let mut broken = file.replace(from, to);
        if from.starts_with("ElementDataFile") {
            broken.truncate(broken.len() - data.len());
        }
        assert_eq!(message(broken, "a.mha"), expected, "{to}");
    }
    let header = metaimage("ElementType = MET_UCHAR", "a.raw", &[]);
    let read = load_beside(&header, "a.mhd", &[("a.raw", vec![0; 11])], &VolumeLoadOptions::default());
    assert_eq!(
        read.unwrap_err().to_string(),
        "a.mhd: voxels in `a.raw`: 11 bytes found where 12 belong; the file is cut off or its header is wrong"
    );
}
