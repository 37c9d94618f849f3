//! Volumes from files: what independent readers say of real ones, round trips through every format, type, byte order and
//! encoding, and one clear error for everything that cannot be used.

#[path = "volume_load/broken.rs"]
mod broken;
#[cfg(feature = "dicom")]
#[path = "volume_load/dicom.rs"]
mod dicom;
#[path = "volume_load/memory.rs"]
mod memory;
#[path = "volume_load/metaimage.rs"]
mod metaimage;
#[path = "volume_load/mutations.rs"]
mod mutations;
#[path = "volume_load/nifti.rs"]
mod nifti;
#[path = "volume_load/nrrd.rs"]
mod nrrd;
#[path = "volume_load/real.rs"]
mod real;
#[path = "volume_load/stack.rs"]
mod stack;
#[path = "volume_load/write.rs"]
mod write;

use bevy_surgery::volume::error::VolumeError;
use bevy_surgery::volume::load::{LoadReport, VolumeLoadOptions, parse_with};
use bevy_surgery::volume::{Volume, Voxels};
use glam::{DVec3, UVec3};

/// A file beside another.
type Sibling<'a> = (&'a str, &'a [u8]);

/// Reads a file that lies beside others.
fn load_beside(
    bytes: &[u8],
    name: &str,
    siblings: &[(&str, Vec<u8>)],
    options: &VolumeLoadOptions,
) -> Result<(Volume, LoadReport), VolumeError> {
    let mut fetch = |wanted: &str| {
        let found = siblings.iter().find(|(name, _)| *name == wanted);
        found.map(|(_, bytes)| bytes.clone()).ok_or_else(|| "there is no such file".to_string())
    };
    parse_with(bytes, name, options, &mut fetch)
}

fn load(bytes: impl AsRef<[u8]>, name: &str) -> Result<Volume, VolumeError> {
    load_beside(bytes.as_ref(), name, &[], &VolumeLoadOptions::default()).map(|(volume, _)| volume)
}

/// The error of a file, which must name it and be one line that a person can read.
fn message(bytes: impl AsRef<[u8]>, name: &str) -> String {
    let error = load(bytes, name).map(|volume| volume.range()).expect_err(name);
    readable(&error)
}

fn readable(error: &VolumeError) -> String {
    let message = error.to_string();
    assert!(message.starts_with(&format!("{}: ", error.file)), "{message}");
    assert!(message.len() < 700 && !message.contains(|c: char| c.is_control()), "{message:?}");
    message[error.file.len() + 2..].to_string()
}

/// The place of voxel 0 and the three steps, LPS millimetres.
fn place(volume: &Volume) -> [DVec3; 4] {
    let affine = volume.grid().lps_mm_from_voxel;
    [affine.translation, affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis]
}

fn assert_place(volume: &Volume, expected: [[f64; 3]; 4]) {
    for (found, expected) in place(volume).into_iter().zip(expected.map(DVec3::from_array)) {
        assert!(found.distance(expected) < 1e-6, "{:?} instead of {expected:?}", place(volume));
    }
}

/// Numbers that a 3 x 2 x 2 volume holds in these tests.
const SIZE: UVec3 = UVec3::new(3, 2, 2);

/// All values of a volume.
fn values(volume: &Volume) -> Vec<f64> {
    (0..volume.voxels().count()).map(|index| volume.value(index)).collect()
}

fn kind(volume: &Volume) -> &'static str {
    match volume.voxels() {
        Voxels::U8(_) => "u8",
        Voxels::I16(_) => "i16",
        Voxels::U16(_) => "u16",
        Voxels::F32(_) => "f32",
        Voxels::Rgba(_) => "rgba",
    }
}
