//! Folders of pictures.

use super::write::picture;
use super::{kind, readable, values};
use bevy_surgery::volume::error::VolumeError;
use bevy_surgery::volume::load::{LoadReport, VolumeFormat, VolumeLoadOptions, parse_folder, stack_grid};
use bevy_surgery::volume::{Volume, Voxels};
use glam::{DVec3, UVec3};
use image::ExtendedColorType::{L8, L16, La8, Rgb8, Rgba8};
use image::ImageFormat::{Jpeg, Png};

fn load(files: Vec<(&str, Vec<u8>)>) -> Result<(Volume, LoadReport), VolumeError> {
    let files = files.into_iter().map(|(name, bytes)| (name.to_string(), bytes)).collect();
    parse_folder(files, "folder/", &VolumeLoadOptions::default())
}

fn refused(files: Vec<(&str, Vec<u8>)>) -> String {
    load(files).map(|(volume, _)| volume.range()).unwrap_err().to_string()
}

/// A grey picture of 2 x 1 with one value.
fn grey(value: u8) -> Vec<u8> {
    picture(2, 1, &[value, value + 100], L8, Png)
}

#[test]
fn slices_follow_their_numbers_and_not_their_names() {
    let files =
        vec![("plane0010.png", grey(10)), ("plane009.png", grey(9)), ("plane8.PNG", grey(8)), ("notes.txt", vec![1])];
    let (volume, report) = load(files).unwrap();
    assert_eq!(values(&volume), [8.0, 108.0, 9.0, 109.0, 10.0, 110.0]);
    assert_eq!(*volume.grid(), stack_grid(UVec3::new(2, 1, 3), DVec3::ONE));
    assert_eq!((report.format, report.files_ignored, report.is_placed), (VolumeFormat::Stack, 1, false));
}

#[test]
fn every_kind_of_pixel_has_its_voxels() {
    let one = |pixels: &[u8], colour| load(vec![("1.png", picture(2, 1, pixels, colour, Png))]).unwrap().0;
    assert_eq!(values(&one(&[3, 200], L8)), [3.0, 200.0]);
    let grey = one(&[1_u16.to_ne_bytes(), 60_000_u16.to_ne_bytes()].concat(), L16);
    assert_eq!((kind(&grey), values(&grey)), ("u16", vec![1.0, 60_000.0]));
    let colours = |volume: &Volume| match volume.voxels() {
        Voxels::Rgba(voxels) => voxels.clone(),
        _ => panic!("no colours"),
    };
    assert_eq!(colours(&one(&[1, 2, 3, 4, 5, 6], Rgb8)), [[1, 2, 3, 255], [4, 5, 6, 255]]);
    assert_eq!(colours(&one(&[1, 2, 3, 9, 4, 5, 6, 0], Rgba8)), [[1, 2, 3, 9], [4, 5, 6, 0]]);
    assert_eq!(colours(&one(&[1, 9, 2, 0], La8)), [[1, 1, 1, 9], [2, 2, 2, 0]]);
    let jpeg = |colour, pixels: &[u8]| load(vec![("a1.jpeg", picture(8, 8, pixels, colour, Jpeg))]).unwrap().0;
    assert!(values(&jpeg(L8, &[90; 64])).iter().all(|value| (value - 90.0).abs() <= 1.0));
    assert_eq!(kind(&jpeg(Rgb8, &[90; 192])), "rgba");
}

#[test]
fn odd_slices_are_named() {
    let cut = grey(1)[..60].to_vec();
    for (files, expected) in [
        (
            vec![("a1.png", grey(1)), ("a3.png", grey(3))],
            "folder/: slice number 2 is missing: `a1.png` is followed by `a3.png`",
        ),
        (
            vec![("a01.png", grey(1)), ("a1.png", grey(3))],
            "folder/: file name: `a01.png` and `a1.png` have the same number 1; remove one of them",
        ),
        (
            vec![("a1.png", grey(1)), ("a2.png", picture(1, 2, &[0; 2], L8, Png)), ("a3.png", grey(1))],
            "folder/: slice `a2.png`: its size is 1 x 2, but 2 x 1 in `a1.png`; all slices must agree",
        ),
        (
            vec![("a1.png", grey(1)), ("a2.png", picture(2, 1, &[0; 6], Rgb8, Png))],
            "folder/: slice `a2.png`: its kind of pixels is RGBA, but 8-bit grey in `a1.png`; all slices must agree",
        ),
        (
            vec![("cover.png", grey(1)), ("a2.png", grey(1))],
            "folder/cover.png: file name: there is no number in it that says which slice it is; rename or remove it",
        ),
        (
            vec![("a1.png", grey(1)), ("a2.png", b"no picture".to_vec())],
            "folder/a2.png: PNG data: Format error decoding Png: ",
        ),
        (vec![("a1.png", grey(1)), ("a2.png", cut)], "folder/a2.png: PNG data: "),
        (vec![("a1.jpg", Vec::new())], "folder/a1.jpg: JPEG data: "),
        (vec![], "folder/: there is nothing in it"),
        (
            vec![("notes.txt", vec![1])],
            "folder/: a folder without DICOM, PNG or JPEG files is not supported; load a file in it by its own name",
        ),
    ] {
        let message = refused(files);
        match expected.ends_with([' ', ':']) {
            true => assert!(message.starts_with(expected), "{message}"),
            false => assert_eq!(message, expected),
        }
    }
    let options = VolumeLoadOptions { spacing_mm: Some([1.0, 0.0, 1.0]), ..VolumeLoadOptions::default() };
    let error = parse_folder(vec![("1.png".into(), grey(1))], "folder", &options).unwrap_err();
    assert_eq!(
        readable(&error),
        "load option `spacing_mm`: [1.0, 0.0, 1.0] are not three numbers from 1e-6 to 1e6 millimetres"
    );
}

#[test]
fn a_picture_is_not_unpacked_to_more_than_it_can_hold() {
    // The head of a picture of 2048 x 2048 with 16-bit RGBA, and nothing behind it.
    let mut head = picture(2, 1, &[0; 8], Rgba8, Png);
    head[16..24].copy_from_slice(&[0, 0, 8, 0, 0, 0, 8, 0]);
    head[24] = 16;
    let mut hasher = flate2::Crc::new();
    hasher.update(&head[12..29]);
    head[29..33].copy_from_slice(&hasher.sum().to_be_bytes());
    let message = refused(vec![("1.png", head.clone())]);
    assert_eq!(
        message,
        format!(
            "folder/1.png: pixels: {} bytes found where 33554432 belong; the file is cut off or its header is wrong",
            head.len() * 1100
        )
    );
}
