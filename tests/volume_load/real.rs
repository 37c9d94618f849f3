//! Real files, held against what nibabel, pynrrd, SimpleITK and Pillow say of them.

use crate::support::real_file;
use bevy_surgery::volume::load::{LoadReport, VolumeLoadOptions, load_path};
use bevy_surgery::volume::{Volume, Voxels};
use glam::{DVec3, UVec3};

fn load_real(name: &str) -> Option<(Volume, LoadReport)> {
    let path = real_file(name)?;
    if cfg!(not(feature = "dicom")) && (name.contains("dicom") || name.ends_with(".dcm")) {
        println!("skipped: {name} needs the feature `dicom`");
        return None;
    }
    Some(load_path(path, &VolumeLoadOptions::default()).unwrap_or_else(|error| panic!("{error}")))
}

#[test]
fn real_volumes_agree_with_independent_readers() {
    let Some(reference) = real_file("reference.json") else { return };
    let reference: serde_json::Value = serde_json::from_slice(&std::fs::read(reference).unwrap()).unwrap();
    let volumes = reference["volumes"].as_object().unwrap();
    assert!(volumes.len() >= 11, "{}", volumes.len());
    for (name, expected) in volumes {
        let Some((volume, report)) = load_real(name) else { continue };
        println!("{name}: {report:?}");
        let numbers = |value: &serde_json::Value| -> Vec<f64> {
            value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
        };
        let grid = volume.grid();
        assert_eq!(grid.size.as_dvec3().to_array().to_vec(), numbers(&expected["size"]), "{name}");

        // The value at a voxel, or one of the channels of a colour.
        let value = |ijk: &[f64]| {
            let [i, j, k] = [ijk[0], ijk[1], ijk[2]].map(|number| number as u32);
            let index = grid.index(UVec3::new(i, j, k));
            match (volume.voxels(), ijk.get(3)) {
                (Voxels::Rgba(voxels), Some(channel)) => voxels[index][*channel as usize].into(),
                _ => volume.value(index),
            }
        };
        let samples = expected["samples"].as_array().unwrap();
        assert_eq!(samples.len(), 16, "{name}");
        for sample in samples {
            let ijk = numbers(&sample["ijk"]);
            let (found, expected) = (value(&ijk), sample["value"].as_f64().unwrap());
            assert!(
                (found - expected).abs() <= 1e-6 * expected.abs().max(1.0),
                "{name} {ijk:?}: {found} is {expected}"
            );
        }

        let all: Vec<f64> = match volume.voxels() {
            Voxels::Rgba(voxels) => voxels.iter().flatten().map(|channel| (*channel).into()).collect(),
            voxels => (0..voxels.count()).map(|index| volume.value(index)).collect(),
        };
        let least = all.iter().copied().fold(f64::INFINITY, f64::min);
        let greatest = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        for (field, found) in [("min", least), ("max", greatest), ("mean", mean)] {
            let expected = expected[field].as_f64().unwrap();
            assert!(
                (found - expected).abs() <= 1e-6 * expected.abs().max(1.0),
                "{name} {field}: {found} is {expected}"
            );
        }
        if !matches!(volume.voxels(), Voxels::Rgba(_)) {
            assert_eq!(volume.range(), [least, greatest], "{name}");
        }

        // Pictures have no place; NIfTI counts to the right and to the front, all others as we do.
        let Some(affine) = expected.get("affine") else { continue };
        let is_ras = expected["orientation"].as_str() == Some("RAS");
        let file_from_lps = if is_ras { DVec3::new(-1.0, -1.0, 1.0) } else { DVec3::ONE };
        let rows: Vec<Vec<f64>> = affine.as_array().unwrap().iter().map(numbers).collect();
        let ours = grid.lps_mm_from_voxel;
        for (at, column) in
            [ours.matrix3.x_axis, ours.matrix3.y_axis, ours.matrix3.z_axis, ours.translation].into_iter().enumerate()
        {
            let expected = DVec3::new(rows[0][at], rows[1][at], rows[2][at]);
            let found = column * file_from_lps;
            assert!(found.distance(expected) < 1e-4, "{name} column {at}: {found} is {expected}");
        }
    }
}

#[test]
fn reports_tell_what_was_read() {
    if let Some((volume, report)) = load_real("ct/temporal-bone-png") {
        assert_eq!((report.element.as_str(), report.files_ignored, report.is_placed), ("RGBA", 0, false));
        assert_eq!(volume.range(), [0.0, 255.0]);
        assert_eq!(volume.grid().spacing_mm(), DVec3::ONE);
    }
    if let Some((volume, report)) = load_real("ct/head.nii.gz") {
        assert_eq!((report.element.as_str(), report.frames, report.is_placed), ("u8", 1, true));
        assert!(matches!(volume.voxels(), Voxels::U8(_)), "values are scaled when they are asked for");
    }
    if let Some((volume, report)) = load_real("ct/abdomen.nii.gz") {
        assert_eq!(report.element, "i32");
        assert!(matches!(volume.voxels(), Voxels::I16(_)), "16 bits hold all of it");
    }
    if let Some((_, report)) = load_real("ct/tooth.nhdr") {
        assert_eq!((report.element.as_str(), report.is_placed), ("u16", false));
    }
    if let Some((volume, report)) = load_real("ct/abdomen-dicom") {
        let series = report.series.expect("a series");
        assert_eq!((series.slices, report.files_ignored), (20, 0));
        assert!(matches!(volume.voxels(), Voxels::I16(_) | Voxels::U16(_)));
    }
}

#[test]
fn a_pictures_spacing_is_the_callers() {
    let Some(path) = real_file("ct/temporal-bone-png") else { return };
    let spacing_mm = [49.2 / 256.0, 49.2 / 256.0, 48.5 / 252.0];
    let options = VolumeLoadOptions { spacing_mm: Some(spacing_mm), ..VolumeLoadOptions::default() };
    let (volume, _) = load_path(path, &options).unwrap();
    assert!(volume.grid().spacing_mm().distance(DVec3::from_array(spacing_mm)) < 1e-12);
    let [half_x, _, half_z] = volume.grid().half_axes_m();
    assert!((half_x.length() - 0.0246).abs() < 1e-6 && (half_z.length() - 0.02425).abs() < 1e-6);
    // Another spacing leaves the first voxel of a placed volume where it is.
    let Some(path) = real_file("ct/breast-mr.nrrd") else { return };
    let options = VolumeLoadOptions { spacing_mm: Some([1.0, 2.0, 3.0]), ..VolumeLoadOptions::default() };
    let (volume, _) = load_path(path, &options).unwrap();
    super::assert_place(&volume, [[-116.54304, -48.144654, 9.45], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]]);
}
