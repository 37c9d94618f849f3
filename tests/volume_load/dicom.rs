//! DICOM: syntaxes, bits and values; the order of slices, and series that are not whole.

use super::write::Dicom;
use super::{assert_place, kind, load, message, readable, values};
use crate::support::real_file;
use bevy_surgery::volume::error::{VolumeError, VolumeFault};
use bevy_surgery::volume::load::{LoadReport, VolumeFormat, VolumeLoadOptions, parse_folder};
use bevy_surgery::volume::{Volume, Voxels};
use glam::{DVec3, UVec3};

fn load_folder(files: &[(&str, Vec<u8>)], options: &VolumeLoadOptions) -> Result<(Volume, LoadReport), VolumeError> {
    let files = files.iter().map(|(name, bytes)| (name.to_string(), bytes.clone())).collect();
    parse_folder(files, "scan", options)
}

fn refused(files: &[(&str, Vec<u8>)]) -> String {
    load_folder(files, &VolumeLoadOptions::default()).map(|(volume, _)| volume.range()).unwrap_err().to_string()
}

/// Six pixels of 16 bits that count from a number.
fn counting(first: u16) -> Vec<u8> {
    (first..first + 6).flat_map(u16::to_le_bytes).collect()
}

fn at(z: f64) -> Dicom {
    Dicom { position: Some([10.0, 20.0, z]), ..Dicom::default() }
}

#[test]
fn every_uncompressed_syntax_is_read() {
    let big: Vec<u8> = (5_u16..11).flat_map(u16::to_be_bytes).collect();
    for (transfer_syntax, pixels) in [
        ("1.2.840.10008.1.2", counting(5)),
        ("1.2.840.10008.1.2.1", counting(5)),
        ("1.2.840.10008.1.2.1.99", counting(5)),
        ("1.2.840.10008.1.2.2", big),
    ] {
        let file = Dicom { transfer_syntax, ..at(7.0) }.file(&pixels);
        let volume = load(&file, "slice.dcm").unwrap_or_else(|error| panic!("{transfer_syntax}: {error}"));
        assert_eq!(values(&volume), [5, 6, 7, 8, 9, 10].map(|stored| f64::from(stored) - 1024.0), "{transfer_syntax}");
        // Rows are 0.5 mm apart, columns 0.25 mm; nothing says how thick the slice is.
        assert_place(&volume, [[10.0, 20.0, 7.0], [0.25, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]]);
        assert!(load(&file, "1.2.840.5").is_ok(), "its own magic tells what it is");
    }
    let wrapped =
        Dicom { transfer_syntax: "1.2.840.10008.1.2.1.98", is_encapsulated: true, ..at(7.0) }.file(&counting(5));
    assert_eq!(load(wrapped, "slice.dcm").unwrap().value(5), 10.0 - 1024.0);
}

#[test]
fn bits_are_cut_out_and_signs_extended() {
    let read =
        |slice: Dicom, pixels: &[u8]| load(Dicom { slope_intercept: None, ..slice }.file(pixels), "a.dcm").unwrap();
    let words = |words: [u16; 6]| words.into_iter().flat_map(u16::to_le_bytes).collect::<Vec<_>>();
    // An overlay in the bits above the twelve.
    let above = words([0xf001, 0xf002, 0x1fff, 0x2800, 4, 5]);
    assert_eq!(values(&read(at(0.0), &above)), [1.0, 2.0, 4095.0, 2048.0, 4.0, 5.0]);
    let signed = read(Dicom { is_signed: true, ..at(0.0) }, &above);
    assert_eq!((values(&signed), kind(&signed)), (vec![1.0, 2.0, -1.0, -2048.0, 4.0, 5.0], "i16"));
    let shifted = Dicom { bits: [16, 12, 15], ..at(0.0) };
    assert_eq!(values(&read(shifted, &words([0x001f, 0x0020, 0xffff, 0, 0x10, 0x100])))[..3], [1.0, 2.0, 4095.0]);
    let whole = Dicom { bits: [16, 16, 15], ..at(0.0) };
    let unsigned = read(whole.clone(), &words([65535, 0, 0, 0, 0, 0]));
    assert_eq!((unsigned.value(0), kind(&unsigned)), (65535.0, "u16"));
    assert_eq!(read(Dicom { is_signed: true, ..whole }, &words([65535, 0, 0, 0, 0, 0])).value(0), -1.0);
    let bytes = read(Dicom { bits: [8, 8, 7], ..at(0.0) }, &[0, 1, 2, 3, 254, 255]);
    assert_eq!((values(&bytes), kind(&bytes)), (vec![0.0, 1.0, 2.0, 3.0, 254.0, 255.0], "u8"));
    let long = |words: [u32; 6]| words.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<_>>();
    let wide = Dicom { bits: [32, 32, 31], ..at(0.0) };
    assert_eq!(read(wide.clone(), &long([4_000_000_000, 0, 0, 0, 0, 0])).range(), [0.0, 4e9]);
    let narrowed = read(Dicom { is_signed: true, ..wide }, &long([u32::MAX, 3000, 0, 0, 0, 0]));
    assert_eq!((narrowed.range(), kind(&narrowed)), ([-1.0, 3000.0], "i16"));
    let inverted = read(Dicom { photometric: "MONOCHROME1", ..at(0.0) }, &counting(0));
    assert_eq!(values(&inverted)[..2], [4095.0, 4094.0]);
    let inverted = read(Dicom { photometric: "MONOCHROME1", is_signed: true, ..at(0.0) }, &counting(0));
    assert_eq!(values(&inverted)[..2], [-1.0, -2.0]);
}

#[test]
fn slices_are_sorted_along_the_normal_and_not_by_name() {
    // Pictures taken from the right: rows run to the back, columns to the feet, so the normal points to the right.
    let orientation = Some([0.0, 1.0, 0.0, 0.0, 0.0, -1.0]);
    let slice = |x: f64| Dicom { orientation, position: Some([x, 1.0, 2.0]), ..Dicom::default() };
    let files = [
        ("a", slice(4.0).file(&counting(20))),
        ("b", slice(8.0).file(&counting(0))),
        ("c", slice(2.0).file(&counting(30))),
        ("d", slice(6.0).file(&counting(10))),
        ("DICOMDIR", Dicom::default().file(&[])),
        ("notes.txt", b"no DICOM".to_vec()),
    ];
    let (volume, report) = load_folder(&files, &VolumeLoadOptions::default()).unwrap();
    assert_eq!(volume.grid().size, UVec3::new(3, 2, 4));
    let first: Vec<f64> = (0..4).map(|k| volume.value(k * 6) + 1024.0).collect();
    assert_eq!(first, [0.0, 10.0, 20.0, 30.0]);
    assert_place(&volume, [[8.0, 1.0, 2.0], [0.0, 0.25, 0.0], [0.0, 0.0, -0.5], [-2.0, 0.0, 0.0]]);
    assert_eq!((report.format, report.files_ignored, report.is_placed), (VolumeFormat::Dicom, 2, true));
    assert_eq!(report.series.unwrap().slices, 4);
    // A gantry that leans shifts every slice a little further: the grid leans as well.
    let leaning = |k: f64| Dicom { position: Some([0.0, 0.05 * k, 2.0 * k]), ..Dicom::default() }.file(&counting(0));
    let files = [("a", leaning(0.0)), ("b", leaning(1.0)), ("c", leaning(2.0))];
    let (volume, _) = load_folder(&files, &VolumeLoadOptions::default()).unwrap();
    assert!(volume.grid().lps_mm_from_voxel.matrix3.z_axis.distance(DVec3::new(0.0, 0.05, 2.0)) < 1e-12);
}

#[test]
fn slices_with_scales_of_their_own_are_brought_to_one() {
    let slice = |z: f64, slope_intercept| Dicom { slope_intercept: Some(slope_intercept), ..at(z) }.file(&counting(0));
    let read = |second| {
        let files = [("a", slice(0.0, [1.0, -1000.0])), ("b", slice(1.0, second))];
        load_folder(&files, &VolumeLoadOptions::default()).unwrap().0
    };
    let whole = read([2.0, -1000.0]);
    assert_eq!((kind(&whole), whole.value(5), whole.value(11)), ("i16", -995.0, -990.0));
    let broken = read([0.25, 0.0]);
    assert_eq!((kind(&broken), broken.value(5), broken.value(11)), ("f32", -995.0, 1.25));
    let (volume, _) = load_folder(&[("a", slice(0.0, [0.5, 3.0]))], &VolumeLoadOptions::default()).unwrap();
    assert_eq!((volume.rescale(), volume.value(5)), ((0.5, 3.0), 5.5));
}

#[test]
fn several_series_are_the_callers_choice() {
    let of = |series, description, z| Dicom { series, description, ..at(z) }.file(&counting(0));
    let files = [("a", of("1.2.9", "thin", 0.0)), ("b", of("1.2.8", "", 0.0)), ("c", of("1.2.9", "thin", 1.0))];
    assert_eq!(
        refused(&files),
        "scan: there are 2 series in it, choose one with the load option `series`: 1.2.8 (no description, 1 slice), 1.2.9 \
         (\"thin\", 2 slices)"
    );
    let choose = |series: &str| {
        load_folder(&files, &VolumeLoadOptions { series: Some(series.into()), ..VolumeLoadOptions::default() })
    };
    let (volume, report) = choose("1.2.9").unwrap();
    let series = report.series.unwrap();
    assert_eq!((volume.grid().size.z, report.files_ignored), (2, 1));
    assert_eq!((series.uid.as_str(), series.description.as_str(), series.slices), ("1.2.9", "thin", 2));
    assert_eq!(
        readable(&choose("1.2.7").unwrap_err()),
        "there is no series `1.2.7` in it; there are: 1.2.8 (no description, 1 slice), 1.2.9 (\"thin\", 2 slices)"
    );
}

#[test]
fn series_that_are_not_whole_say_where() {
    let slice = |z: f64| at(z).file(&counting(0));
    let odd = |edit: &dyn Fn(&mut Dicom)| {
        let mut slice = at(2.0);
        edit(&mut slice);
        [("a", at(0.0).file(&counting(0))), ("b", at(1.0).file(&counting(0))), ("c", slice.file(&counting(0)))]
    };
    for (files, expected) in [
        (
            [0.0, 1.0, 3.0].map(|z| (["a", "b", "", "c"][z as usize], slice(z))).to_vec(),
            "scan: slices `a` and `b` lie 1.000 mm apart, but most neighbours 2.000 mm: the spacing is uneven; resample the series",
        ),
        (
            [0.0, 1.0, 2.0, 4.0].map(|z| (["a", "b", "c", "", "d"][z as usize], slice(z))).to_vec(),
            "scan: slices `c` and `d` lie 2.000 mm apart, but most neighbours 1.000 mm: 1 slice is missing between them",
        ),
        (
            [0.0, 1.0, 2.0, 6.0].map(|z| (["a", "b", "c", "", "", "", "d"][z as usize], slice(z))).to_vec(),
            "scan: slices `c` and `d` lie 4.000 mm apart, but most neighbours 1.000 mm: 3 slices are missing between them",
        ),
        (
            vec![("a", slice(0.0)), ("b", slice(1.0)), ("c", slice(2.3)), ("d", slice(3.3))],
            "scan: slices `b` and `c` lie 1.300 mm apart, but most neighbours 1.000 mm: the spacing is uneven; resample the series",
        ),
        (
            vec![("a", slice(0.0)), ("b", slice(1.0)), ("c", slice(1.0))],
            "scan: slices `b` and `c` lie in the same place (1.000 mm along the normal); remove one of them, or split the series",
        ),
        (
            odd(&|slice| slice.position = None).to_vec(),
            "scan/c: ImagePositionPatient: this field is missing; nothing says where the slice belongs",
        ),
        (
            odd(&|slice| slice.position = Some([11.0, 20.0, 2.0])).to_vec(),
            "scan/b: ImagePositionPatient: the slice lies 0.500 mm beside the line through the first and the last",
        ),
        (
            odd(&|slice| slice.columns = 2).to_vec(),
            "scan: slice `c`: its size is 2 x 2, but 3 x 2 in `a`; all slices must agree",
        ),
        (
            odd(&|slice| slice.pixel_spacing = Some([0.5, 0.26])).to_vec(),
            "scan: slice `c`: its PixelSpacing is 0.5 x 0.26, but 0.5 x 0.25 in `a`; all slices must agree",
        ),
        (
            odd(&|slice| slice.orientation = Some([0.0, 1.0, 0.0, 1.0, 0.0, 0.0])).to_vec(),
            "scan: slice `c`: its ImageOrientationPatient is (0.0, 1.0, 0.0) (1.0, 0.0, 0.0), but (1.0, 0.0, \
             0.0) (0.0, 1.0, 0.0) in `a`; all slices must agree",
        ),
        (
            odd(&|slice| slice.is_signed = true).to_vec(),
            "scan: slice `c`: its PixelRepresentation is 1, but 0 in `a`; all slices must agree",
        ),
        (vec![("DICOMDIR", at(0.0).file(&[]))], "scan: PixelData: not one DICOM file in it holds a picture"),
    ] {
        assert_eq!(refused(&files), expected);
    }
}

#[test]
fn broken_files_are_named_by_field_and_reason() {
    let good = at(0.0);
    let with = |edit: &dyn Fn(&mut Dicom)| {
        let mut slice = good.clone();
        edit(&mut slice);
        slice.file(&counting(0))
    };
    let extra = |group, number, vr, value: &[u8]| with(&|slice| slice.extra.push((group, number, vr, value.to_vec())));
    let whole = good.file(&counting(0));
    let cut = "the file is cut off or its header is wrong";
    let far = "ImagePositionPatient: (0.0, 1e300, 0.0) mm lies outside of any scanner".to_string();
    let cases: Vec<(Vec<u8>, String)> = vec![
        (extra(0x0020, 0x0032, "DS", br"0\1e300\0"), far),
        (b"DICM".to_vec(), "magic: there is no `DICM` behind the first 128 bytes".into()),
        (whole[..140].to_vec(), "file meta information: the file ends within it".into()),
        (
            [&whole[..132], &whole[132 + 28..]].concat(),
            "TransferSyntaxUID: this field is missing in the file meta information".into(),
        ),
        (
            with(&|slice| slice.transfer_syntax = "1.2.3"),
            "transfer syntax 1.2.3 is not supported; save it as Explicit VR Little Endian".into(),
        ),
        (good.file(&[]), "PixelData: this field is missing; it is no picture".into()),
        (good.file(&counting(0)[..8]), format!("PixelData: 8 bytes found where 12 belong; {cut}")),
        (whole[..whole.len() - 3].to_vec(), format!("element (7FE0,0010): 9 bytes found where 12 belong; {cut}")),
        (
            good.file(&[0; 20]),
            "PixelData: more than the 12 bytes that belong there; the header names too small a size or type".into(),
        ),
        (with(&|slice| slice.rows = 0), "size: [3, 0, 1]; no side may be 0".into()),
        (with(&|slice| slice.columns = 65535), "size: [65535, 2, 1]; a side has at most 2048 voxels".into()),
        (with(&|slice| slice.bits[0] = 12), "BitsAllocated 12 is not supported; save it with 8, 16 or 32 bits per pixel".into()),
        (with(&|slice| slice.bits[1] = 17), "BitsStored: 17 of 16 allocated bits cannot be stored".into()),
        (with(&|slice| slice.bits[1] = 0), "BitsStored: 0 of 16 allocated bits cannot be stored".into()),
        (with(&|slice| slice.bits[2] = 16), "HighBit: 16 is not the last of 12 stored bits".into()),
        (with(&|slice| slice.bits[2] = 65535), "HighBit: 65535 is not the last of 12 stored bits".into()),
        (
            with(&|slice| slice.photometric = "RGB"),
            "PhotometricInterpretation RGB is not supported; save it in grey, or as a folder of PNG pictures".into(),
        ),
        (
            extra(0x0028, 0x0008, "IS", b"7"),
            "a file with 7 frames is not supported; split it into files of one frame each, or convert it to NIfTI or NRRD".into(),
        ),
        (extra(0x0028, 0x0008, "IS", b"-7"), "NumberOfFrames: `-7` is no number of frames".into()),
        (extra(0x0028, 0x1053, "DS", b"0"), "RescaleSlope: values of 0.0 * stored mean nothing".into()),
        (extra(0x0028, 0x1053, "DS", b"steep"), "RescaleSlope: `steep` is not a number".into()),
        (extra(0x0028, 0x1052, "DS", b"nan"), "RescaleIntercept: `nan` are not 1 numbers".into()),
        (extra(0x0028, 0x0030, "DS", br"1\0"), "PixelSpacing: 1.0 x 0.0 are not two positive numbers".into()),
        (extra(0x0028, 0x0030, "DS", br"1\nan"), r"PixelSpacing: `1\nan` are not 2 numbers".into()),
        (
            with(&|slice| slice.pixel_spacing = None),
            "PixelSpacing: this field is missing; give the load option `spacing_mm`".into(),
        ),
        (extra(0x0020, 0x0032, "DS", br"1\2"), r"ImagePositionPatient: `1\2` are not 3 numbers".into()),
        (
            extra(0x0020, 0x0037, "DS", br"1\0\0\1\0\0"),
            "ImageOrientationPatient: (1.0, 0.0, 0.0) and (1.0, 0.0, 0.0) are not two directions at right angles".into(),
        ),
        (extra(0x0028, 0x0010, "US", &[1]), "size: [3, 8193, 1]; a side has at most 2048 voxels".into()),
        (
            extra(0x7fe0, 0x0008, "OW", &[0; 4]),
            "floating-point pixels is not supported; save them as 16-bit PixelData with RescaleSlope".into(),
        ),
        (
            with(&|slice| (slice.transfer_syntax, slice.is_encapsulated) = ("1.2.840.10008.1.2.4.80", true)),
            "transfer syntax 1.2.840.10008.1.2.4.80 is not supported; unpack it to Explicit VR Little Endian, with `gdcmconv \
             --raw` or `dcmdjpls`"
                .into(),
        ),
    ];
    for (file, expected) in cases {
        assert_eq!(message(file, "slice.dcm"), expected);
    }
    // Four gigabytes of a claim, as the first element and nested deeply.
    let claim = |group: u16, number: u16, vr: &str| {
        let mut file = good.file(&[]);
        for half in [group, number] {
            file.extend(half.to_le_bytes());
        }
        file.extend(vr.as_bytes());
        file.extend([0, 0, 0xfe, 0xff, 0xff, 0xff]);
        file
    };
    assert_eq!(
        message(claim(0x7fe0, 0x0010, "OW"), "a.dcm"),
        format!("element (7FE0,0010): 0 bytes found where 4294967294 belong; {cut}")
    );
    assert_eq!(
        message(claim(0x0029, 0x1010, "OB"), "a.dcm"),
        format!("element (0029,1010): 0 bytes found where 4294967294 belong; {cut}")
    );
    let mut nested = good.file(&[]);
    for _ in 0..200_000 {
        nested.extend(b"\x29\0\x10\x10SQ\0\0\xff\xff\xff\xff\xfe\xff\0\xe0\xff\xff\xff\xff");
    }
    assert_eq!(message(nested, "a.dcm"), "PixelData: this field is missing; it is no picture");
    let mut unpaired = good.file(&[]);
    unpaired.extend(b"\x29\0\x10\x10SQ\0\0\xff\xff\xff\xff\xfe\xff\xdd\xe0\0\0\0\0\xfe\xff\x0d\xe0\0\0\0\0\xfe\xff\0\xe0\xff\xff\xff\xff");
    assert!(message(unpaired, "a.dcm").starts_with("data set: "));
    let bomb = Dicom { transfer_syntax: "1.2.840.10008.1.2.1.99", ..at(0.0) }.file(&vec![0; 80 << 20]);
    assert_eq!(
        message(bomb, "a.dcm"),
        "a deflated data set of more than 64 MiB is not supported; save it as Explicit VR Little Endian"
    );
}

/// Run lengths of six pixels of 16 bits: the high bytes, then the low ones.
fn run_lengths() -> Vec<u8> {
    let segments: [&[u8]; 2] = [&[0xfb, 1], &[5, 0, 1, 2, 3, 4, 5]];
    let mut bytes = Vec::new();
    let mut table = [0_u32; 16];
    (table[0], table[1], table[2]) = (2, 64, 66);
    table.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    segments.iter().for_each(|segment| bytes.extend(*segment));
    bytes.push(0x80);
    bytes
}

#[test]
fn packed_pixels_are_held_against_the_file_before_they_are_unpacked() {
    let rle = Dicom { transfer_syntax: "1.2.840.10008.1.2.5", is_encapsulated: true, ..at(0.0) };
    let volume = load(rle.file(&run_lengths()), "a.dcm").unwrap();
    assert_eq!(values(&volume), [256, 257, 258, 259, 260, 261].map(|stored| f64::from(stored) - 1024.0));
    let mut greedy = run_lengths();
    greedy[..4].copy_from_slice(&[0xff; 4]);
    assert_eq!(message(rle.file(&greedy), "a.dcm"), "PixelData (RLE): it has 4294967295 segments where 2 belong");
    assert_eq!(message(rle.file(&greedy[..50]), "a.dcm"), "PixelData (RLE): its table of segments is cut off");
    let large = Dicom { columns: 2000, rows: 2000, ..rle.clone() };
    assert!(
        message(large.file(&run_lengths()), "a.dcm")
            .starts_with("PixelData (RLE): 4736 bytes found where 8000000 belong")
    );
    let mut short = run_lengths();
    short.truncate(66);
    let short = message(rle.file(&short), "a.dcm");
    assert!(short.starts_with("PixelData: its packed pixels are damaged ("), "{short}");

    let jpeg = Dicom {
        transfer_syntax: "1.2.840.10008.1.2.4.50",
        is_encapsulated: true,
        bits: [8, 8, 7],
        columns: 8,
        rows: 8,
        ..at(0.0)
    };
    let grey = |width, height| {
        let pixels = vec![90; (width * height) as usize];
        super::write::picture(width, height, &pixels, image::ExtendedColorType::L8, image::ImageFormat::Jpeg)
    };
    let volume = load(jpeg.file(&grey(8, 8)), "a.dcm").unwrap();
    assert!(values(&volume).iter().all(|value| (value + 934.0).abs() <= 1.0));
    assert_eq!(
        message(jpeg.file(&grey(16, 9)), "a.dcm"),
        "PixelData (JPEG): the packed picture is 16 x 9, the file says 8 x 8"
    );
    assert_eq!(
        message(Dicom { bits: [16, 12, 11], ..jpeg.clone() }.file(&grey(8, 8)), "a.dcm"),
        "PixelData (JPEG): the packed picture has 8 bits, the file allocates 16"
    );
    assert_eq!(
        message(jpeg.file(b"no JPEG"), "a.dcm"),
        "PixelData (JPEG): there is no frame header in it; the file is damaged"
    );

    // Of a real slice: its pixels under wrong sizes, and with precincts and tiles that would take gigabytes of tables.
    let Some(folder) = real_file("ct/abdomen-dicom") else { return };
    let path = std::fs::read_dir(folder).unwrap().next().unwrap().unwrap().path();
    let file = std::fs::read(path).unwrap();
    let start = file.windows(4).position(|four| four == [0xff, 0x4f, 0xff, 0x51]).unwrap();
    let with = |at: usize, bytes: &[u8]| {
        let mut file = file.clone();
        file[start + at..start + at + bytes.len()].copy_from_slice(bytes);
        load(file, "a.dcm").map(|volume| volume.range())
    };
    assert!(with(0, &[]).is_ok());
    let expected = "a.dcm: PixelData (JPEG 2000): the packed picture is 65535 x 512, the file says 512 x 512";
    assert_eq!(with(8, &[0, 0, 0xff, 0xff]).unwrap_err().to_string(), expected);
    let expected = "a.dcm: PixelData (JPEG 2000): it is cut into 262144 tiles; at most 1024 are read";
    assert_eq!(with(24, &[0, 0, 0, 1, 0, 0, 0, 1]).unwrap_err().to_string(), expected);
    assert!(matches!(with(0, &[0; 4]).unwrap_err().fault, VolumeFault::Malformed { .. }));
}

#[test]
fn a_real_series_tells_its_gaps_whatever_its_names() {
    let Some(folder) = real_file("ct/head-dicom") else { return };
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_string(), std::fs::read(path).unwrap()))
        .collect();
    files.sort();
    let read = |files: Vec<(String, Vec<u8>)>| parse_folder(files, "scan", &VolumeLoadOptions::default());
    let (whole, _) = read(files.clone()).unwrap();
    // Backwards, and under names that say nothing.
    let renamed =
        files.iter().rev().enumerate().map(|(at, (_, bytes))| (format!("{:02}", at * 37 % 93), bytes.clone()));
    let (again, _) = read(renamed.collect()).unwrap();
    assert_eq!(again.content_hash(), whole.content_hash());
    assert!(matches!(whole.voxels(), Voxels::I16(_)));
    let without: Vec<_> = files.iter().filter(|(name, _)| name != "CTHead40.dcm").cloned().collect();
    let message = readable(&read(without).unwrap_err());
    assert!(
        message.contains("lie 3.000 mm apart, but most neighbours 1.500 mm: 1 slice is missing between them"),
        "{message}"
    );
    assert!(message.contains("CTHead39.dcm") && message.contains("CTHead41.dcm"), "{message}");
    files.push(("copy".into(), files[0].1.clone()));
    let error = read(files).unwrap_err();
    assert!(matches!(error.fault, VolumeFault::DoubledSlices { .. }), "{error}");
}
