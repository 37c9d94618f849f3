//! NIfTI-1 and NIfTI-2, packed or not, in one file or two. Its space is RAS.
//!
//! Format: <https://nifti.nimh.nih.gov/nifti-1>, <https://nifti.nimh.nih.gov/nifti-2>

mod header;

use super::samples::{self, Element};
use super::siblings::fetch_named;
use super::source::Source;
use super::text::{product, spacing};
use super::{LPS_FROM_RAS, LoadReport, Parsed, VolumeLoadOptions};
use super::{checked_size, choose_frame, malformed, placed_grid, shown, unsupported};
use crate::files::{Fetch, excerpt};
use crate::volume::VolumeGrid;
use crate::volume::error::VolumeFault;
use glam::{DMat3, DQuat, DVec3, UVec3};
use header::Header;

pub(super) fn read(
    bytes: &[u8],
    name: &str,
    options: &VolumeLoadOptions,
    fetch: Fetch<'_>,
) -> Result<Parsed, VolumeFault> {
    let mut file = Source::guess(bytes, "NIfTI file");
    let header = Header::read(&mut file)?;
    let pixels = Pixels::of(&header)?;
    let [sides, frames] = [&header.sides[..3], &header.sides[3..]];
    let size = checked_size([sides[0], sides[1], sides[2]])?;
    let too_many = || malformed("dim", format!("{:?} voxels are more than any file holds", header.sides));
    let frames = product(frames.iter().copied()).ok_or_else(too_many)?;
    let frame_bytes = pixels.bytes() * size.as_u64vec3().element_product();
    let total = frame_bytes.checked_mul(frames).ok_or_else(too_many)?;
    let frame = choose_frame(frames, options)?;
    let (grid, is_placed) = grid(&header, size)?;
    let (slope, intercept) = header.rescale(pixels)?;

    let fetched;
    let what;
    let mut voxels = if header.is_single {
        file.skip(header.voxel_offset.saturating_sub(header.bytes))?;
        file.renamed("voxels")
    } else {
        let named = data_file(name);
        what = format!("voxels in `{}`", excerpt(&named));
        fetched = match fetch_named(&named, fetch) {
            Ok(bytes) => bytes,
            // Packed pairs are rare, but there are some; the fault names the usual one.
            Err(fault) => fetch_named(&format!("{named}.gz"), fetch).map_err(|_| fault)?,
        };
        let mut source = Source::guess(&fetched, &what);
        source.skip(header.voxel_offset)?;
        source
    };
    // Also a claim beyond what the file can hold ends here.
    voxels.expect(total)?;
    voxels.skip(frame * frame_bytes)?;
    let of_frame = voxels.take(frame_bytes)?;
    voxels.skip((frames - 1 - frame) * frame_bytes)?;
    voxels.end(total)?;
    let ((voxels, voxels_replaced), element) = match pixels {
        Pixels::Scalar(element) => (samples::decode(of_frame, element, header.order, slope < 0.0)?, element.name()),
        Pixels::Rgb => ((samples::colours(&of_frame, 3), 0), "RGB"),
        Pixels::Rgba => ((samples::colours(&of_frame, 4), 0), "RGBA"),
    };
    let report = LoadReport {
        format: header.format,
        element: element.into(),
        frames: u32::try_from(frames).unwrap_or(u32::MAX),
        voxels_replaced,
        is_placed,
        ..LoadReport::default()
    };
    Ok(Parsed { grid, voxels, slope, intercept, report })
}

/// The other file of a pair: `.img` in the case that the header's name has.
fn data_file(header: &str) -> String {
    let lower = header.to_ascii_lowercase();
    let plain = if lower.ends_with(".gz") { &header[..header.len() - 3] } else { header };
    let stem = plain.rsplit_once('.').map_or(plain, |(stem, _)| stem);
    let is_loud = plain.ends_with(".HDR");
    format!("{stem}{}", if is_loud { ".IMG" } else { ".img" })
}

/// What a voxel holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pixels {
    Scalar(Element),
    Rgb,
    Rgba,
}

impl Pixels {
    fn of(header: &Header) -> Result<Self, VolumeFault> {
        let pixels = match header.datatype {
            2 => Self::Scalar(Element::U8),
            4 => Self::Scalar(Element::I16),
            8 => Self::Scalar(Element::I32),
            16 => Self::Scalar(Element::F32),
            64 => Self::Scalar(Element::F64),
            128 => Self::Rgb,
            256 => Self::Scalar(Element::I8),
            512 => Self::Scalar(Element::U16),
            768 => Self::Scalar(Element::U32),
            1024 => Self::Scalar(Element::I64),
            1280 => Self::Scalar(Element::U64),
            2304 => Self::Rgba,
            other => {
                let name = match other {
                    1 => " (1 bit)",
                    32 | 1792 | 2048 => " (complex numbers)",
                    1536 => " (128-bit floating point)",
                    _ => "",
                };
                return Err(unsupported(
                    format!("datatype {other}{name}"),
                    "save it as 16-bit integer or 32-bit floating point",
                ));
            }
        };
        let bits = pixels.bytes() * 8;
        match i64::try_from(bits) == Ok(header.bitpix.into()) {
            true => Ok(pixels),
            false => {
                let reason =
                    format!("{} contradicts datatype {}, which has {bits} bits", header.bitpix, header.datatype);
                Err(malformed("bitpix", reason))
            }
        }
    }

    fn bytes(self) -> u64 {
        match self {
            Self::Scalar(element) => element.bytes(),
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }
}

impl Header {
    /// Slope and intercept of the values; colours have none, and a slope of 0 says that there are none.
    fn rescale(&self, pixels: Pixels) -> Result<(f64, f64), VolumeFault> {
        if self.slope == 0.0 || !matches!(pixels, Pixels::Scalar(_)) {
            return Ok((1.0, 0.0));
        }
        for (field, value) in [("scl_slope", self.slope), ("scl_inter", self.intercept)] {
            if !value.is_finite() {
                return Err(malformed(field, format!("{value} is not a finite number")));
            }
        }
        Ok((self.slope, self.intercept))
    }
}

/// The grid, and whether the file says where it lies in the patient: by sform, else by qform, else not at all.
fn grid(header: &Header, size: UVec3) -> Result<(VolumeGrid, bool), VolumeFault> {
    let unit_mm = match header.units & 7 {
        // Files that name no unit mean millimetres.
        0 | 2 => 1.0,
        1 => 1e3,
        3 => 1e-3,
        other => return Err(malformed("xyzt_units", format!("{other} is no unit of length"))),
    };
    let to_lps_mm = LPS_FROM_RAS * unit_mm;
    if header.sform_code > 0 {
        let [x, y, z] = header.srow;
        let column = |at: usize| DVec3::new(x[at], y[at], z[at]) * to_lps_mm;
        let grid = placed_grid(size, [column(0), column(1), column(2)], column(3), "srow_x, srow_y, srow_z")?;
        return Ok((grid, true));
    }
    let mut spacings = DVec3::ONE;
    for at in 0..3 {
        // The thickness of a single picture means nothing.
        if size[at] > 1 || header.pixdim[at + 1] != 0.0 {
            spacings[at] = spacing(&format!("pixdim[{}]", at + 1), header.pixdim[at + 1])?;
        }
    }
    let (rotation, origin) = match header.qform_code > 0 {
        true => (header.rotation()?, header.offset),
        false => (DMat3::IDENTITY, DVec3::ZERO),
    };
    let step = |axis: DVec3, spaced: f64| axis * spaced * to_lps_mm;
    let steps =
        [step(rotation.x_axis, spacings.x), step(rotation.y_axis, spacings.y), step(rotation.z_axis, spacings.z)];
    let grid = placed_grid(size, steps, origin * to_lps_mm, "quatern_b, quatern_c, quatern_d")?;
    Ok((grid, header.qform_code > 0))
}

impl Header {
    /// Directions of the three axes by the quaternion, with the third turned round where qfac says so.
    fn rotation(&self) -> Result<DMat3, VolumeFault> {
        let vector = self.quaternion;
        let real = 1.0 - vector.length_squared();
        // Rounded to 32 bits, half a turn may have a little more than unit length.
        if !vector.is_finite() || real < -1e-4 {
            let reason = format!("{} is longer than 1, which is no rotation", shown(vector));
            return Err(malformed("quatern_b, quatern_c, quatern_d", reason));
        }
        let quaternion = DQuat::from_xyzw(vector.x, vector.y, vector.z, real.max(0.0).sqrt()).normalize();
        let mut rotation = DMat3::from_quat(quaternion);
        if self.pixdim[0] < 0.0 {
            rotation.z_axis = -rotation.z_axis;
        }
        Ok(rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::data_file;

    #[test]
    fn pairs_find_each_other() {
        assert_eq!(data_file("a.b.hdr"), "a.b.img");
        assert_eq!(data_file("a.hdr.gz"), "a.img");
        assert_eq!(data_file("A.HDR"), "A.IMG");
    }
}
