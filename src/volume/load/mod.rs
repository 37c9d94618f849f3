//! Reads volumes: NRRD, NIfTI, MetaImage, DICOM series and stacks of pictures.
//!
//! Every reader takes whole files as bytes, holds what a header claims against the bytes that are there before it allocates, and
//! reports what it cannot use as one [`VolumeError`]. Numbers keep their values, but are stored as narrowly as they allow: whole
//! numbers that fit as 8 or 16 bits, everything else as 32-bit floating point (whole numbers beyond 2^24 are rounded to that).
//!
//! | name | format | place |
//! |---|---|---|
//! | `.nrrd`, `.nhdr` | NRRD; raw, gzip, text and hex; RGB and RGBA | `space`; LPS where there is none |
//! | `.nii`, `.nii.gz`, `.hdr` with `.img` | NIfTI-1 and NIfTI-2 | sform, else qform, else spacings; RAS |
//! | `.mhd`, `.mha` | MetaImage; raw, zlib and text; RGB and RGBA | LPS |
//! | `.dcm`, or a folder | DICOM, with the feature `dicom` | LPS |
//! | a folder | PNG or JPEG slices, by the last number in their names | see [`stack_grid`] |

mod dicom;
mod metaimage;
mod nifti;
mod nrrd;
mod samples;
mod siblings;
mod source;
mod stack;
mod text;

pub use stack::stack_grid;

use super::error::{DicomSeries, VolumeError, VolumeFault};
use super::{Volume, VolumeGrid, Voxels, check_size};
use crate::files::{Fetch, excerpt};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{DAffine3, DMat3, DVec3, UVec3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

/// What to read from a file or folder that holds more than one volume, and where its voxels lie if it does not say so rightly.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct VolumeLoadOptions {
    /// SeriesInstanceUID of the wanted DICOM series, for folders with several.
    pub series: Option<String>,
    /// Number of the wanted volume, from 0, for files with several one after another (time series).
    pub frame: Option<u32>,
    /// Distances between the centres of neighbouring voxels, millimetres, instead of what the file says. Pictures say nothing;
    /// for them 1 mm is assumed.
    pub spacing_mm: Option<[f64; 3]>,
}

/// Format of a volume file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub enum VolumeFormat {
    /// NRRD, with or without a separate data file.
    #[default]
    Nrrd,
    /// NIfTI-1.
    Nifti1,
    /// NIfTI-2.
    Nifti2,
    /// MetaImage.
    MetaImage,
    /// DICOM.
    Dicom,
    /// PNG or JPEG pictures.
    Stack,
}

impl fmt::Display for VolumeFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nrrd => "NRRD",
            Self::Nifti1 => "NIfTI-1",
            Self::Nifti2 => "NIfTI-2",
            Self::MetaImage => "MetaImage",
            Self::Dicom => "DICOM",
            Self::Stack => "stack of pictures",
        })
    }
}

/// What a loader found and did, beside the volume itself.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct LoadReport {
    /// Format of the file.
    pub format: VolumeFormat,
    /// Type of the numbers in the file, such as `u16` or `RGBA`.
    pub element: String,
    /// Volumes that the file holds; one of them was read.
    pub frames: u32,
    /// The DICOM series that was read.
    pub series: Option<DicomSeries>,
    /// Files of a folder that do not belong to the volume.
    pub files_ignored: usize,
    /// Voxels that were NaN or infinite and got the least value of the others.
    pub voxels_replaced: u64,
    /// Whether the file says where in the patient its voxels lie, and not only how far apart.
    pub is_placed: bool,
}

/// A volume as its reader hands it over.
struct Parsed {
    grid: VolumeGrid,
    voxels: Voxels,
    slope: f64,
    intercept: f64,
    report: LoadReport,
}

/// Reads a volume whose data are all in `bytes`; the format follows from the name's extension.
///
/// # Errors
/// Everything in [`VolumeFault`]; a header with a separate data file needs [`parse_with`].
pub fn parse(bytes: &[u8], file_name: &str, options: &VolumeLoadOptions) -> Result<Volume, VolumeError> {
    let mut no_siblings = |_: &str| Err("other files are not read here".to_string());
    parse_with(bytes, file_name, options, &mut no_siblings).map(|(volume, _)| volume)
}

/// Reads a volume, fetching separate data files through `fetch`, and tells what was found.
///
/// `fetch` gets paths relative to the file's folder with `/` between their parts, never absolute and never with `..`.
///
/// # Errors
/// Everything in [`VolumeFault`].
pub fn parse_with(
    bytes: &[u8],
    file_name: &str,
    options: &VolumeLoadOptions,
    fetch: Fetch<'_>,
) -> Result<(Volume, LoadReport), VolumeError> {
    let name = file_name.rsplit(['/', '\\']).next().unwrap_or_default();
    let mut read = || -> Result<(Volume, LoadReport), VolumeFault> {
        check_options(options)?;
        if bytes.is_empty() {
            return Err(VolumeFault::Empty);
        }
        let lower = name.to_ascii_lowercase();
        let plain = lower.strip_suffix(".gz").unwrap_or(&lower);
        let extension = plain.rsplit_once('.').map_or("", |(_, extension)| extension);
        let parsed = match extension {
            "nrrd" | "nhdr" => nrrd::read(bytes, options, fetch)?,
            "nii" | "hdr" => nifti::read(bytes, name, options, fetch)?,
            "img" => {
                return Err(VolumeFault::Unsupported {
                    what: "a NIfTI data file by itself".into(),
                    advice: "load the .hdr file beside it".into(),
                });
            }
            "mhd" | "mha" => metaimage::read(bytes, options, fetch)?,
            "png" | "jpg" | "jpeg" => {
                return Err(VolumeFault::Unsupported {
                    what: "a single picture".into(),
                    advice: "load the folder that holds all slices".into(),
                });
            }
            // Scanners name DICOM files by their UIDs, which end in anything.
            _ if extension == "dcm" || dicom::is_dicom(bytes) => dicom::read_file(bytes, name, options)?,
            _ => return Err(VolumeFault::UnknownFormat { extension: excerpt(extension) }),
        };
        finish(parsed, options)
    };
    read().map_err(|fault| VolumeError::new(file_name, fault))
}

/// Reads the DICOM series or the stack of pictures that the files of a folder make: names without the folder, and contents.
///
/// A folder with a DICOM file in it is taken as DICOM; whatever else lies there is ignored and counted.
///
/// # Errors
/// Everything in [`VolumeFault`], about the folder as a whole or about one of its files.
pub fn parse_folder(
    files: Vec<(String, Vec<u8>)>,
    folder_name: &str,
    options: &VolumeLoadOptions,
) -> Result<(Volume, LoadReport), VolumeError> {
    let in_folder = |fault| VolumeError::new(folder_name, fault);
    check_options(options).map_err(in_folder)?;
    let parsed = if files.iter().any(|(_, bytes)| dicom::is_dicom(bytes)) {
        dicom::read_folder(&files, options)
    } else if files.iter().any(|(name, _)| stack::is_picture(name)) {
        stack::read(files, options)
    } else {
        Err(SliceFault::from(match files.first() {
            None => VolumeFault::Empty,
            Some(_) => VolumeFault::Unsupported {
                what: "a folder without DICOM, PNG or JPEG files".into(),
                advice: "load a file in it by its own name".into(),
            },
        }))
    };
    let parsed = parsed.map_err(|SliceFault { slice, fault }| match slice {
        Some(slice) => VolumeError::new(format!("{}/{slice}", folder_name.trim_end_matches('/')), fault),
        None => in_folder(fault),
    })?;
    finish(parsed, options).map_err(in_folder)
}

/// Reads a file, or a folder of slices, from disk.
///
/// # Errors
/// Everything in [`VolumeFault`].
pub fn load_path(path: impl AsRef<Path>, options: &VolumeLoadOptions) -> Result<(Volume, LoadReport), VolumeError> {
    let path = path.as_ref();
    let named = path.display().to_string();
    let unreadable =
        |error: std::io::Error| VolumeError::new(&*named, VolumeFault::Unreadable { reason: error.to_string() });
    if !path.is_dir() {
        let bytes = read_regular(path).map_err(unreadable)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut fetch = |name: &str| read_regular(&folder.join(name)).map_err(|error| error.to_string());
        return parse_with(&bytes, &named, options, &mut fetch);
    }
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(path).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        // Follows links, unlike the entry's own type.
        if path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    // Strangers in a folder may be large: of them no more is read than what tells that they are none.
    let mut files = Vec::with_capacity(paths.len());
    for path in &paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut head = Vec::new();
        std::fs::File::open(path).and_then(|file| file.take(dicom::HEAD).read_to_end(&mut head)).map_err(unreadable)?;
        files.push((name, head));
    }
    let is_dicom = files.iter().any(|(_, head)| dicom::is_dicom(head));
    for ((name, bytes), path) in files.iter_mut().zip(&paths) {
        *bytes = match if is_dicom { dicom::is_dicom(bytes) } else { stack::is_picture(name) } {
            true => std::fs::read(path).map_err(unreadable)?,
            false => Vec::new(),
        };
    }
    parse_folder(files, &named, options)
}

/// The bytes of a file that ends: not those of a device or a pipe.
fn read_regular(path: &Path) -> std::io::Result<Vec<u8>> {
    match std::fs::metadata(path)?.is_file() {
        true => std::fs::read(path),
        false => Err(std::io::Error::other("it is not a regular file")),
    }
}

/// A fault of a folder, and the file in it that has it, if it is one file's alone.
struct SliceFault {
    slice: Option<String>,
    fault: VolumeFault,
}

impl From<VolumeFault> for SliceFault {
    fn from(fault: VolumeFault) -> Self {
        Self { slice: None, fault }
    }
}

impl SliceFault {
    fn of(slice: &str) -> impl Fn(VolumeFault) -> Self {
        move |fault| Self { slice: Some(slice.into()), fault }
    }
}

fn check_options(options: &VolumeLoadOptions) -> Result<(), VolumeFault> {
    let Some(spacing_mm) = options.spacing_mm else { return Ok(()) };
    if spacing_mm.iter().all(|spacing| STEPS_MM.contains(spacing)) {
        return Ok(());
    }
    let reason = format!("{spacing_mm:?} are not three numbers from 1e-6 to 1e6 millimetres");
    Err(VolumeFault::BadOption { field: "spacing_mm".into(), reason })
}

fn finish(parsed: Parsed, options: &VolumeLoadOptions) -> Result<(Volume, LoadReport), VolumeFault> {
    let Parsed { mut grid, voxels, slope, intercept, report } = parsed;
    if let Some(spacing_mm) = options.spacing_mm {
        let scale = DMat3::from_diagonal(DVec3::from_array(spacing_mm) / grid.spacing_mm());
        grid.lps_mm_from_voxel.matrix3 *= scale;
    }
    let volume = Volume::new(grid, voxels, slope, intercept)?;
    let [least, greatest] = volume.range();
    match (greatest - least).is_finite() {
        true => Ok((volume, report)),
        false => Err(malformed(
            "slope and intercept",
            format!("{slope:?} and {intercept:?} take the values beyond all numbers"),
        )),
    }
}

/// The frame that the options ask for, of so many.
fn choose_frame(frames: u64, options: &VolumeLoadOptions) -> Result<u64, VolumeFault> {
    match options.frame {
        None if frames == 1 => Ok(0),
        None => Err(VolumeFault::SeveralFrames { frames: u32::try_from(frames).unwrap_or(u32::MAX) }),
        Some(frame) if u64::from(frame) < frames => Ok(frame.into()),
        Some(frame) => Err(VolumeFault::BadOption {
            field: "frame".into(),
            reason: format!("{frame} is asked for, but there are only {frames}, counted from 0"),
        }),
    }
}

/// A size that a volume may have, from what a header says.
fn checked_size(sides: [u64; 3]) -> Result<UVec3, VolumeFault> {
    let size = UVec3::from_array(sides.map(|side| u32::try_from(side).unwrap_or(u32::MAX)));
    check_size(size)?;
    Ok(size)
}

/// A grid from the steps of its axes and the place of its first voxel, both in LPS millimetres; `field` is named where they are
/// no grid.
fn placed_grid(size: UVec3, steps_mm: [DVec3; 3], origin_mm: DVec3, field: &str) -> Result<VolumeGrid, VolumeFault> {
    let [i, j, k] = steps_mm;
    let matrix = DMat3::from_cols(i, j, k);
    for (step, axis) in steps_mm.into_iter().zip(["first", "second", "third"]) {
        if !STEPS_MM.contains(&step.length()) {
            let reason =
                format!("the {axis} axis has steps of {} mm; a length from 1e-6 to 1e6 mm is needed", shown(step));
            return Err(malformed(field, reason));
        }
    }
    // Beside one another within a thousandth of a degree.
    if matrix.determinant().abs() < 1e-5 * i.length() * j.length() * k.length() {
        return Err(malformed(field, "two of the three axes have the same direction"));
    }
    if !origin_mm.is_finite() || origin_mm.abs().max_element() > *STEPS_MM.end() {
        return Err(malformed(field, format!("the first voxel lies at {} mm, which is nowhere", shown(origin_mm))));
    }
    Ok(VolumeGrid { size, lps_mm_from_voxel: DAffine3::from_mat3_translation(matrix, origin_mm) })
}

/// Distances between voxels that are believed, millimetres; anything beyond is a mistake, and arithmetic with it would
/// overflow.
const STEPS_MM: RangeInclusive<f64> = 1e-6..=1e6;

/// A vector for a message. Extreme numbers are written with exponents.
fn shown(vector: DVec3) -> String {
    format!("({:?}, {:?}, {:?})", vector.x, vector.y, vector.z)
}

/// Turns RAS into LPS and back.
const LPS_FROM_RAS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

fn malformed(field: impl Into<String>, reason: impl Into<String>) -> VolumeFault {
    VolumeFault::Malformed { field: field.into(), reason: reason.into() }
}

fn unsupported(what: impl Into<String>, advice: impl Into<String>) -> VolumeFault {
    VolumeFault::Unsupported { what: what.into(), advice: advice.into() }
}
