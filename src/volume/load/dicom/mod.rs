//! DICOM: files and series, with the feature `dicom`.

#[cfg(feature = "dicom")]
mod file;
#[cfg(feature = "dicom")]
mod guard;
#[cfg(feature = "dicom")]
mod pixels;
#[cfg(feature = "dicom")]
mod series;

#[cfg(feature = "dicom")]
pub(super) use series::{read_file, read_folder};

/// Bytes that tell whether a file is DICOM.
pub(super) const HEAD: u64 = 132;

/// Whether bytes begin as a DICOM file does: the magic behind 128 bytes of anything.
pub(super) fn is_dicom(bytes: &[u8]) -> bool {
    bytes.get(128..132) == Some(b"DICM")
}

#[cfg(not(feature = "dicom"))]
pub(super) use without::{read_file, read_folder};

#[cfg(not(feature = "dicom"))]
mod without {
    use crate::volume::error::VolumeFault;
    use crate::volume::load::{Parsed, SliceFault, VolumeLoadOptions, unsupported};

    pub(crate) fn read_file(_: &[u8], _: &str, _: &VolumeLoadOptions) -> Result<Parsed, VolumeFault> {
        Err(unsupported("DICOM in this build", "build with the feature `dicom` of this crate"))
    }

    pub(crate) fn read_folder(_: &[(String, Vec<u8>)], _: &VolumeLoadOptions) -> Result<Parsed, SliceFault> {
        Err(unsupported("DICOM in this build", "build with the feature `dicom` of this crate").into())
    }
}
