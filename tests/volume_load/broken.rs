//! Files that no reader takes, and what is said of files and folders on disk.

use super::write::{metaimage, nrrd};
use super::{load, message};
use bevy_surgery::volume::error::VolumeFault;
use bevy_surgery::volume::load::{VolumeLoadOptions, load_path};

#[test]
fn unknown_and_empty_files_say_so() {
    assert_eq!(load("x", "scan.fbx").unwrap_err().fault, VolumeFault::UnknownFormat { extension: "fbx".into() });
    assert_eq!(
        message("x", "scan"),
        "`` is not a volume format that can be read; use nrrd, nhdr, nii, nii.gz, hdr, mhd, mha, dcm, or a folder of DICOM, \
         PNG or JPEG slices"
    );
    for name in ["a.nrrd", "a.nhdr", "a.nii", "a.nii.gz", "a.hdr", "a.mhd", "a.mha", "a.dcm", "a.png", "a"] {
        assert_eq!(message("", name), "there is nothing in it", "{name}");
    }
    assert_eq!(message("x", "1.png"), "a single picture is not supported; load the folder that holds all slices");
}

#[cfg(not(feature = "dicom"))]
#[test]
fn without_its_feature_dicom_is_refused_with_the_way_out() {
    let mut file = vec![0; 128];
    file.extend(b"DICM");
    let expected = "DICOM in this build is not supported; build with the feature `dicom` of this crate";
    assert_eq!(message(&file, "a.dcm"), expected);
    assert_eq!(message(&file, "CT.1.2.840"), expected);
    let folder = vec![("a".to_string(), file)];
    let error = bevy_surgery::volume::load::parse_folder(folder, "scan", &VolumeLoadOptions::default()).unwrap_err();
    assert_eq!(super::readable(&error), expected);
}

#[test]
fn files_of_one_format_under_the_name_of_another_are_told_from_it() {
    let (nrrd, meta) =
        (nrrd("type: uchar\nencoding: raw", &[0; 12]), metaimage("ElementType = MET_UCHAR", "LOCAL", &[0; 12]));
    assert_eq!(message(&meta, "a.nrrd"), "magic: the file does not begin with NRRD0001 to NRRD0005");
    assert_eq!(message(&nrrd, "a.mha"), "line 1: `NRRD0004` is no field with a value");
    assert_eq!(
        message([nrrd, vec![0; 400]].concat(), "a.nii"),
        "sizeof_hdr: 1146245710, but a NIfTI file begins with 348 or 540"
    );
}

#[test]
fn files_and_folders_are_read_from_disk() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let options = VolumeLoadOptions::default();
    let error = load_path(place("none.nrrd"), &options).unwrap_err();
    assert!(error.to_string().contains("none.nrrd: it cannot be read: "), "{error}");

    std::fs::write(place("secret.raw"), [7; 12]).unwrap();
    std::fs::create_dir(place("scan")).unwrap();
    let header = |file: &str| metaimage("ElementType = MET_UCHAR", file, &[]);
    for (file, data) in [("a.raw", "scan/a.raw"), ("deep/a.raw", "scan/deep/a.raw")] {
        std::fs::create_dir_all(place(data).parent().unwrap()).unwrap();
        std::fs::write(place(data), [3; 12]).unwrap();
        std::fs::write(place("scan/a.mhd"), header(file)).unwrap();
        assert_eq!(load_path(place("scan/a.mhd"), &options).unwrap().0.range(), [3.0, 3.0]);
    }
    for file in ["../secret.raw".to_string(), place("secret.raw").display().to_string()] {
        std::fs::write(place("scan/a.mhd"), header(&file)).unwrap();
        let error = load_path(place("scan/a.mhd"), &options).unwrap_err();
        assert!(matches!(error.fault, VolumeFault::ForbiddenPath { .. }), "{error}");
    }
    let error = load_path(place("scan"), &options).unwrap_err();
    assert!(matches!(error.fault, VolumeFault::Unsupported { .. }), "{error}");
    // Folders within a folder are not looked into.
    let picture = super::write::picture(2, 1, &[1, 2], image::ExtendedColorType::L8, image::ImageFormat::Png);
    std::fs::write(place("scan/deep/1.png"), &picture).unwrap();
    std::fs::write(place("scan/7.png"), &picture).unwrap();
    let (volume, report) = load_path(place("scan"), &options).unwrap();
    assert_eq!((volume.range(), report.files_ignored), ([1.0, 2.0], 2));
}

#[cfg(unix)]
#[test]
fn what_never_ends_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let options = VolumeLoadOptions::default();
    for name in ["zero.nrrd", "a.raw", "2.png"] {
        std::os::unix::fs::symlink("/dev/zero", place(name)).unwrap();
    }
    let error = load_path(place("zero.nrrd"), &options).unwrap_err();
    assert!(error.to_string().ends_with("zero.nrrd: it cannot be read: it is not a regular file"), "{error}");
    std::fs::write(place("a.mhd"), metaimage("ElementType = MET_UCHAR", "a.raw", &[])).unwrap();
    let error = load_path(place("a.mhd"), &options).unwrap_err();
    assert!(matches!(error.fault, VolumeFault::MissingFile { .. }), "{error}");
    assert!(error.to_string().contains("it is not a regular file"), "{error}");
    // In a folder they are passed over, as folders are.
    let picture = super::write::picture(2, 1, &[1, 2], image::ExtendedColorType::L8, image::ImageFormat::Png);
    std::fs::write(place("1.png"), &picture).unwrap();
    assert_eq!(load_path(folder.path(), &options).unwrap().0.grid().size.z, 1);
}
