//! What can be wrong with a volume, said to the person who has to fix the file.

use crate::files::excerpt;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// A volume file that cannot be used: which file, and why.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
#[error("{file}: {fault}")]
pub struct VolumeError {
    /// The file or folder as it was named to the loader.
    pub file: String,
    /// What is wrong with it.
    pub fault: VolumeFault,
}

impl VolumeError {
    /// Names the file that a fault was found in.
    pub fn new(file: impl Into<String>, fault: VolumeFault) -> Self {
        Self { file: file.into(), fault }
    }
}

/// A DICOM series, as a message or a menu lists it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect, Serialize, Deserialize)]
pub struct DicomSeries {
    /// Its SeriesInstanceUID, which the load option `series` takes.
    pub uid: String,
    /// Its SeriesDescription; empty where the scanner wrote none.
    pub description: String,
    /// Number of files that belong to it.
    pub slices: usize,
}

/// Why a volume cannot be used. One variant per reason; places are the first.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum VolumeFault {
    /// The grid or the numbers in it make no volume.
    #[error("{field}: {reason}")]
    BadGrid {
        /// Which property of the volume, or field of the header.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The name ends in nothing that a reader exists for, and the first bytes tell no format either.
    #[error(
        "`{extension}` is not a volume format that can be read; use nrrd, nhdr, nii, nii.gz, hdr, mhd, mha, dcm, or a folder \
         of DICOM, PNG or JPEG slices"
    )]
    UnknownFormat {
        /// What follows the last dot of the name.
        extension: String,
    },
    /// Nothing in it.
    #[error("there is nothing in it")]
    Empty,
    /// The system does not give the file out.
    #[error("it cannot be read: {reason}")]
    Unreadable {
        /// What the system says.
        reason: String,
    },
    /// The file ends before what its header announces.
    #[error("{what}: {found} bytes found where {expected} belong; the file is cut off or its header is wrong")]
    Truncated {
        /// What falls short, and where it ought to be.
        what: String,
        /// Bytes that ought to be there.
        expected: u64,
        /// Bytes that are there; of packed data the most that can come out of them.
        found: u64,
    },
    /// More bytes than the header announces.
    #[error("{what}: more than the {expected} bytes that belong there; the header names too small a size or type")]
    Oversized {
        /// What is too long, and where it is.
        what: String,
        /// Bytes that ought to be there.
        expected: u64,
    },
    /// A field that does not follow the format, or that nothing sensible can be made of.
    #[error("{field}: {reason}")]
    Malformed {
        /// Name of the field as the format calls it.
        field: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Valid, but not read here.
    #[error("{what} is not supported; {advice}")]
    Unsupported {
        /// The feature.
        what: String,
        /// What to do instead.
        advice: String,
    },
    /// A file that belongs to this one could not be fetched.
    #[error("its data file `{path}` cannot be read: {reason}")]
    MissingFile {
        /// Path as the header gives it.
        path: String,
        /// Why not.
        reason: String,
    },
    /// A header refers to something outside its own folder.
    #[error(
        "its data file `{path}` lies outside the header's own folder; put it beside the header and name it relatively"
    )]
    ForbiddenPath {
        /// Path as the header gives it.
        path: String,
    },
    /// A load option that makes no sense, or does not fit the file.
    #[error("load option `{field}`: {reason}")]
    BadOption {
        /// Name of the option.
        field: String,
        /// What is wrong with its value.
        reason: String,
    },
    /// A series in time where one volume is wanted.
    #[error("it holds {frames} volumes one after another; choose one with the load option `frame` (0 to {})", frames - 1)]
    SeveralFrames {
        /// How many.
        frames: u32,
    },
    /// A folder that holds more than one DICOM series.
    #[error("there are {} series in it, choose one with the load option `series`: {}", .series.len(), list(.series))]
    SeveralSeries {
        /// The series, by their UIDs in ascending order.
        series: Vec<DicomSeries>,
    },
    /// The wanted DICOM series is not there.
    #[error("there is no series `{wanted}` in it; there are: {}", list(.series))]
    NoSuchSeries {
        /// What was asked for.
        wanted: String,
        /// The series, by their UIDs in ascending order.
        series: Vec<DicomSeries>,
    },
    /// A slice that does not fit the others.
    #[error("slice `{slice}`: its {field} is {found}, but {expected}; all slices must agree")]
    SliceDiffers {
        /// File of the odd one.
        slice: String,
        /// Which property.
        field: String,
        /// Its value in the odd slice.
        found: String,
        /// Its value in the slice it was held against, and which that is.
        expected: String,
    },
    /// Slices that do not follow one another at equal distances.
    #[error(
        "slices `{before}` and `{after}` lie {gap_mm:.3} mm apart, but most neighbours {spacing_mm:.3} mm: {}",
        missing(*.gap_mm, *.spacing_mm)
    )]
    UnevenSlices {
        /// File of the slice before the gap.
        before: String,
        /// File of the slice behind it.
        after: String,
        /// Distance between them along the normal, millimetres.
        gap_mm: f64,
        /// The median distance of neighbours, millimetres.
        spacing_mm: f64,
    },
    /// Two slices in the same place.
    #[error(
        "slices `{first}` and `{second}` lie in the same place ({position_mm:.3} mm along the normal); remove one of them, or \
         split the series"
    )]
    DoubledSlices {
        /// One of them.
        first: String,
        /// The other.
        second: String,
        /// Their place along the normal, millimetres.
        position_mm: f64,
    },
    /// A number that no picture of a stack has.
    #[error("slice number {number} is missing: `{before}` is followed by `{after}`")]
    MissingSlice {
        /// The first number that is missing.
        number: u64,
        /// Picture before the gap.
        before: String,
        /// Picture behind the gap.
        after: String,
    },
}

/// What the size of a gap says about the slices that ought to fill it.
fn missing(gap_mm: f64, spacing_mm: f64) -> String {
    let steps = gap_mm / spacing_mm;
    if steps > 1.5 && (steps - steps.round()).abs() < 0.05 {
        match steps.round() - 1.0 {
            1.0 => "1 slice is missing between them".into(),
            many => format!("{many} slices are missing between them"),
        }
    } else {
        "the spacing is uneven; resample the series".into()
    }
}

/// Series for a message; the tail of a long list only adds noise.
fn list(series: &[DicomSeries]) -> String {
    const SHOWN: usize = 8;
    let one = |series: &DicomSeries| {
        let description = match series.description.as_str() {
            "" => "no description".into(),
            text => format!("\"{}\"", excerpt(text)),
        };
        let plural = if series.slices == 1 { "" } else { "s" };
        format!("{} ({description}, {} slice{plural})", excerpt(&series.uid), series.slices)
    };
    let shown: Vec<String> = series.iter().take(SHOWN).map(one).collect();
    match series.len().saturating_sub(SHOWN) {
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}
