//! NIfTI: both versions, byte orders and kinds of files; values, places and units.

use super::write::{Nifti, gzip, kinds, numbers};
use super::{SIZE, assert_place, kind, load, load_beside, message, readable, values};
use bevy_surgery::volume::Voxels;
use bevy_surgery::volume::load::{VolumeFormat, VolumeLoadOptions};

/// A file of bytes from 0 to 11.
fn counting() -> Nifti {
    Nifti::default()
}

const BYTES: [u8; 12] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];

#[test]
fn every_type_order_and_version_is_read_from_one_file_or_two() {
    for number in kinds() {
        for (is_big, is_version_2) in [(false, false), (true, false), (false, true), (true, true)] {
            let voxels = numbers(number.name, &number.values, is_big);
            let voxel_offset = if is_version_2 { 544 } else { 352 };
            let bitpix = voxels.len() as i16 / 12 * 8;
            let single = Nifti { is_version_2, is_big, voxel_offset, datatype: number.nifti, bitpix, ..counting() };
            let pair = Nifti { is_single: false, voxel_offset: 5, ..single.clone() };
            let data = [&[9; 5], &voxels[..]].concat();
            for (name, file, siblings) in [
                ("a.nii", single.file(&voxels), vec![]),
                ("a.nii.gz", gzip(&single.file(&voxels)), vec![]),
                ("a.nii", gzip(&single.file(&voxels)), vec![]),
                ("folder/a.hdr", pair.file(&[]), vec![("a.img", data.clone())]),
                ("a.hdr.gz", gzip(&pair.file(&[])), vec![("a.img.gz", gzip(&data))]),
            ] {
                let read = load_beside(&file, name, &siblings, &VolumeLoadOptions::default());
                let (volume, report) = read.unwrap_or_else(|error| panic!("{}: {error}", number.name));
                assert_eq!((volume.grid().size, kind(&volume)), (SIZE, number.kept), "{name} {}", number.name);
                assert_eq!(values(&volume), number.values, "{name} {}", number.name);
                let format = if is_version_2 { VolumeFormat::Nifti2 } else { VolumeFormat::Nifti1 };
                assert_eq!((report.format, report.element.as_str()), (format, number.name));
            }
        }
    }
}

#[test]
fn values_are_scaled_and_colours_are_not() {
    let read = |nifti: &Nifti, voxels: &[u8]| load(nifti.file(voxels), "a.nii").unwrap();
    let scaled = read(&Nifti { slope: 0.5, intercept: -3.0, ..counting() }, &BYTES);
    assert_eq!((scaled.value(10), scaled.range()), (2.0, [-3.0, 2.5]));
    let unscaled = read(&Nifti { slope: 0.0, intercept: -3.0, ..counting() }, &BYTES);
    assert_eq!(unscaled.range(), [0.0, 11.0]);
    let many: Vec<u8> = (0..48).collect();
    let rgb = read(&Nifti { datatype: 128, bitpix: 24, slope: 2.0, ..counting() }, &many[..36]);
    assert!(matches!(rgb.voxels(), Voxels::Rgba(voxels) if voxels[1] == [3, 4, 5, 255]));
    let rgba = read(&Nifti { datatype: 2304, bitpix: 32, slope: 2.0, ..counting() }, &many);
    assert!(matches!(rgba.voxels(), Voxels::Rgba(voxels) if voxels[1] == [4, 5, 6, 7]));
    assert_eq!(rgba.rescale(), (1.0, 0.0));

    // Voxels that are no numbers get the dark end, which for a falling scale is the greatest number.
    let mut floats = [0.5; 12];
    [floats[0], floats[1], floats[2], floats[3]] = [f64::NAN, f64::INFINITY, -2.0, 7.5];
    for (slope, least) in [(1.0, -2.0), (-1.0, -7.5)] {
        let nifti = Nifti { datatype: 16, bitpix: 32, slope, ..counting() };
        let file = nifti.file(&numbers("f32", &floats, false));
        let (volume, report) = load_beside(&file, "a.nii", &[], &VolumeLoadOptions::default()).unwrap();
        assert_eq!((report.voxels_replaced, volume.value(0), volume.value(1)), (2, least, least));
        assert_eq!(volume.range()[0], least);
    }
}

#[test]
fn sform_comes_before_qform_before_spacings() {
    let read = |nifti: Nifti| load(nifti.file(&BYTES), "a.nii").unwrap();
    let spaced = Nifti { pixdim: [1.0, 2.0, 3.0, 4.0, 1.0, 1.0, 1.0, 1.0], ..counting() };
    // RAS: right and front are negative in LPS.
    assert_place(&read(spaced.clone()), [[0.0; 3], [-2.0, 0.0, 0.0], [0.0, -3.0, 0.0], [0.0, 0.0, 4.0]]);
    // Half a right angle about the patient's axis: c and d are 0, b is 0 as well.
    let quarter = Nifti { qform_code: 1, quaternion: [0.0, 0.0, 0.5_f64.sqrt()], offset: [10.0, 20.0, 30.0], ..spaced };
    // A quarter turn about the third axis takes right to front and front to left.
    let turned = [[-10.0, -20.0, 30.0], [0.0, -2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 4.0]];
    let near = |nifti: Nifti, expected: [[f64; 3]; 4]| {
        let volume = read(nifti);
        for (found, expected) in super::place(&volume).into_iter().zip(expected) {
            assert!(found.distance(glam::DVec3::from_array(expected)) < 1e-6, "{:?}", super::place(&volume));
        }
    };
    near(quarter.clone(), turned);
    let mut mirrored = quarter.clone();
    mirrored.pixdim[0] = -1.0;
    let mut expected = turned;
    expected[3] = [0.0, 0.0, -4.0];
    near(mirrored, expected);
    let placed =
        Nifti { sform_code: 2, srow: [[1.0, 0.0, 0.5, -5.0], [0.0, 2.0, 0.0, 6.0], [0.0, 0.0, 3.0, 7.0]], ..quarter };
    let by_sform = [[5.0, -6.0, 7.0], [-1.0, 0.0, 0.0], [0.0, -2.0, 0.0], [-0.5, 0.0, 3.0]];
    near(placed.clone(), by_sform);
    for (units, scale) in [(0, 1.0), (2, 1.0), (10, 1.0), (1, 1e3), (3, 1e-3)] {
        let volume = read(Nifti { units, ..placed.clone() });
        let expected = by_sform.map(|column| column.map(|number| number * scale));
        for (found, expected) in super::place(&volume).into_iter().zip(expected) {
            assert!(found.distance(glam::DVec3::from_array(expected)) < 1e-9 * scale.max(1.0), "{units}");
        }
    }
}

#[test]
fn one_frame_of_several_is_chosen() {
    let many: Vec<u8> = (0..48).collect();
    for dim in [[4, 3, 2, 2, 4, 1, 1, 1], [5, 3, 2, 2, 1, 4, 1, 1], [5, 3, 2, 2, 2, 2, 0, 0]] {
        let file = gzip(&Nifti { dim, ..counting() }.file(&many));
        let read =
            |frame| load_beside(&file, "a.nii.gz", &[], &VolumeLoadOptions { frame, ..VolumeLoadOptions::default() });
        let (volume, report) = read(Some(2)).unwrap();
        assert_eq!((values(&volume)[0], values(&volume)[11], report.frames), (24.0, 35.0, 4));
        assert_eq!(
            readable(&read(None).unwrap_err()),
            "it holds 4 volumes one after another; choose one with the load option `frame` (0 to 3)"
        );
    }
    let flat = load(Nifti { dim: [2, 4, 3, 0, 0, 0, 0, 0], ..counting() }.file(&BYTES), "a.nii").unwrap();
    assert_eq!(flat.grid().size, glam::UVec3::new(4, 3, 1));
}

#[test]
fn broken_headers_are_named_by_field_and_reason() {
    let nan = f64::NAN;
    let cut = "the file is cut off or its header is wrong";
    for is_version_2 in [false, true] {
        let voxel_offset = if is_version_2 { 544 } else { 352 };
        let good = Nifti { is_version_2, voxel_offset, ..counting() };
        assert!(load(good.file(&BYTES), "a.nii").is_ok());
        let with = |edit: &dyn Fn(&mut Nifti)| {
            let mut nifti = good.clone();
            edit(&mut nifti);
            nifti.file(&BYTES)
        };
        let cases: Vec<(Vec<u8>, String)> = vec![
            (with(&|n| n.dim[0] = 0), "dim[0]: 0 is not a number of axes from 1 to 7".into()),
            (with(&|n| n.dim[0] = 8), "dim[0]: 8 is not a number of axes from 1 to 7".into()),
            (with(&|n| n.dim[2] = 0), "dim[2]: 0 is not a positive number".into()),
            (with(&|n| n.dim[3] = -2), "dim[3]: -2 is not a positive number".into()),
            (with(&|n| n.dim[1] = 32767), "size: [32767, 2, 2]; a side has at most 2048 voxels".into()),
            (
                with(&|n| n.dim[3] = 200),
                format!("voxels: 12 bytes found where 1200 belong; {cut}"),
            ),
            (
                with(&|n| n.dim[3] = 1),
                "voxels: more than the 6 bytes that belong there; the header names too small a size or type".into(),
            ),
            (
                with(&|n| n.datatype = 32),
                "datatype 32 (complex numbers) is not supported; save it as 16-bit integer or 32-bit floating point".into(),
            ),
            (
                with(&|n| n.datatype = 77),
                "datatype 77 is not supported; save it as 16-bit integer or 32-bit floating point".into(),
            ),
            (with(&|n| n.bitpix = 16), "bitpix: 16 contradicts datatype 2, which has 8 bits".into()),
            (with(&|n| n.pixdim[2] = nan), "pixdim[2]: NaN is not a positive number".into()),
            (with(&|n| n.pixdim[3] = 0.0), "pixdim[3]: 0.0 is not a positive number".into()),
            (with(&|n| n.pixdim[1] = -1.0), "pixdim[1]: -1.0 is not a positive number".into()),
            (with(&|n| n.slope = nan), "scl_slope: NaN is not a finite number".into()),
            (
                with(&|n| (n.slope, n.intercept) = (1.0, f64::INFINITY)),
                "scl_inter: inf is not a finite number".into(),
            ),
            (with(&|n| n.units = 5), "xyzt_units: 5 is no unit of length".into()),
            (
                with(&|n| n.sform_code = 1),
                "srow_x, srow_y, srow_z: the first axis has steps of (-0.0, -0.0, 0.0) mm; a length from 1e-6 to 1e6 mm is needed".into(),
            ),
            (
                with(&|n| (n.qform_code, n.quaternion) = (1, [1.0, 1.0, 0.0])),
                "quatern_b, quatern_c, quatern_d: (1.0, 1.0, 0.0) is longer than 1, which is no rotation".into(),
            ),
            (
                with(&|n| n.voxel_offset = 100),
                format!("vox_offset: 100 lies within the header, which has {} bytes", voxel_offset - 4),
            ),
            (with(&|n| n.voxel_offset = -8), "vox_offset: -8 is no place in the file".into()),
            (
                {
                    let mut file = good.file(&BYTES);
                    file[0] = 7;
                    file
                },
                format!(
                    "sizeof_hdr: {}, but a NIfTI file begins with 348 or 540",
                    if is_version_2 { 519 } else { 263 }
                ),
            ),
            (
                {
                    let mut file = good.file(&BYTES);
                    let magic = if is_version_2 { 4 } else { 344 };
                    file[magic..magic + 4].copy_from_slice(b"no\x01\0");
                    file
                },
                r"magic: `no\x01\x00` is not that of NIfTI (n+1, ni1, n+2 or ni2)".into(),
            ),
            (good.file(&BYTES[..5]), format!("voxels: 5 bytes found where 12 belong; {cut}")),
            (good.file(&BYTES)[..200].to_vec(), format!("NIfTI file: 200 bytes found where 348 belong; {cut}")),
        ];
        for (file, expected) in cases {
            assert_eq!(message(file, "a.nii"), expected);
        }
    }
    let mut as_text = Nifti { is_version_2: true, voxel_offset: 544, ..counting() }.file(&BYTES);
    as_text.remove(8);
    assert_eq!(message(as_text, "a.nii"), "magic: the line ends in it are damaged; the file was copied as text");
    let overflowing =
        Nifti { is_version_2: true, voxel_offset: 544, dim: [7, 3, 2, 2, 1 << 40, 1 << 40, 1, 1], ..counting() };
    assert_eq!(
        message(overflowing.file(&BYTES), "a.nii"),
        "dim: [3, 2, 2, 1099511627776, 1099511627776, 1, 1] voxels are more than any file holds"
    );
    let pair = Nifti { is_single: false, voxel_offset: 0, ..counting() }.file(&[]);
    assert_eq!(message(&pair, "a.hdr"), "its data file `a.img` cannot be read: there is no such file");
    assert_eq!(message(&pair, "a.img"), "a NIfTI data file by itself is not supported; load the .hdr file beside it");
    let siblings = [("a.img", vec![0; 11])];
    let short = load_beside(&pair, "folder/a.hdr", &siblings, &VolumeLoadOptions::default()).unwrap_err();
    assert_eq!(readable(&short), format!("voxels in `a.img`: 11 bytes found where 12 belong; {cut}"));
    // A bomb: ten megabytes of zeros behind a header that wants twelve bytes, and a header that wants far more than can come.
    let bomb = gzip(&counting().file(&vec![0; 10_000_000]));
    assert_eq!(
        message(bomb, "a.nii.gz"),
        "voxels: more than the 12 bytes that belong there; the header names too small a size or type"
    );
    let greedy = gzip(&Nifti { dim: [3, 800, 800, 800, 1, 1, 1, 1], ..counting() }.file(&BYTES));
    let claimed = message(greedy, "a.nii.gz");
    assert!(claimed.ends_with(&format!("bytes found where 512000000 belong; {cut}")), "{claimed}");
}
