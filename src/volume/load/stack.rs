//! Stacks of PNG or JPEG pictures, one per slice.

use super::{LoadReport, Parsed, SliceFault, VolumeFormat, VolumeLoadOptions, checked_size, malformed};
use crate::files::excerpt;
use crate::volume::error::VolumeFault;
use crate::volume::{MAX_SIDE, VolumeGrid, Voxels};
use glam::{DAffine3, DMat3, DVec3, UVec3};
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;
use std::io::Cursor;

/// Most bytes of pixels that a byte of a picture unpacks to, rounded up; PNG packs no tighter.
const MOST_PER_BYTE: u64 = 1100;

/// The grid of a stack of pictures, which say nothing of where they were taken: the pictures stand upright before the viewer
/// as they are drawn, the first one nearest. In the patient's terms, x runs to the left, y down from the head to the feet, and
/// the slices from front to back; the origin is in the middle.
pub fn stack_grid(size: UVec3, spacing_mm: DVec3) -> VolumeGrid {
    let matrix = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y) * DMat3::from_diagonal(spacing_mm);
    let middle = (size.as_dvec3() - 1.0) * 0.5;
    VolumeGrid { size, lps_mm_from_voxel: DAffine3::from_mat3_translation(matrix, -(matrix * middle)) }
}

/// Whether a name is that of a picture.
pub(super) fn is_picture(name: &str) -> bool {
    format_of(name).is_some()
}

fn format_of(name: &str) -> Option<ImageFormat> {
    // A hidden file is a program's note to itself: some systems leave one beside every picture.
    if name.starts_with('.') {
        return None;
    }
    let (_, extension) = name.rsplit_once('.')?;
    match extension.to_ascii_lowercase().as_str() {
        "png" => Some(ImageFormat::Png),
        "jpg" | "jpeg" => Some(ImageFormat::Jpeg),
        _ => None,
    }
}

pub(super) fn read(files: Vec<(String, Vec<u8>)>, options: &VolumeLoadOptions) -> Result<Parsed, SliceFault> {
    let all = files.len();
    let mut slices = Vec::new();
    for (name, bytes) in files {
        if let Some(format) = format_of(&name) {
            let number = last_number(&name).map_err(SliceFault::of(&name))?;
            slices.push(Slice { number, name, format, bytes });
        }
    }
    slices.sort_by(|a, b| a.number.cmp(&b.number).then_with(|| a.name.cmp(&b.name)));
    check_numbers(&slices)?;
    // Headers first: nothing is unpacked before all of them agree.
    let heads = slices.par_iter().map(Slice::head).collect::<Vec<_>>();
    let mut first = None;
    for (slice, head) in slices.iter().zip(heads) {
        let head = head.map_err(SliceFault::of(&slice.name))?;
        let (first_name, expected) = first.get_or_insert((&slice.name, head));
        let differs = |field: &str, found: String, expected: String| {
            let fault = VolumeFault::SliceDiffers {
                slice: excerpt(&slice.name),
                field: field.into(),
                found,
                expected: format!("{expected} in `{}`", excerpt(first_name)),
            };
            Err(SliceFault::from(fault))
        };
        if head.sides != expected.sides {
            let shown = |[width, height]: [u32; 2]| format!("{width} x {height}");
            return differs("size", shown(head.sides), shown(expected.sides));
        }
        if head.pixels != expected.pixels {
            return differs("kind of pixels", head.pixels.name().into(), expected.pixels.name().into());
        }
    }
    let Some((_, Head { sides: [width, height], pixels })) = first else { return Err(VolumeFault::Empty.into()) };
    let size = checked_size([width.into(), height.into(), slices.len() as u64])?;

    let decoded = slices.into_par_iter().map(|slice| slice.decode().map_err(SliceFault::of(&slice.name)));
    let decoded = decoded.collect::<Result<Vec<_>, _>>()?;
    let count = size.as_usizevec3().element_product();
    let voxels = match pixels {
        Pixels::Grey8 => {
            let mut voxels = Vec::with_capacity(count);
            decoded.into_iter().for_each(|slice| voxels.extend(slice.into_luma8().into_raw()));
            Voxels::U8(voxels)
        }
        Pixels::Grey16 => {
            let mut voxels = Vec::with_capacity(count);
            decoded.into_iter().for_each(|slice| voxels.extend(slice.into_luma16().into_raw()));
            Voxels::U16(voxels)
        }
        Pixels::Colour => {
            let mut voxels: Vec<[u8; 4]> = Vec::with_capacity(count);
            decoded.into_iter().for_each(|slice| voxels.extend_from_slice(slice.into_rgba8().as_chunks().0));
            Voxels::Rgba(voxels)
        }
    };
    let report = LoadReport {
        format: VolumeFormat::Stack,
        element: pixels.name().into(),
        frames: 1,
        files_ignored: all - size.z as usize,
        ..LoadReport::default()
    };
    let spacing_mm = options.spacing_mm.map_or(DVec3::ONE, DVec3::from_array);
    Ok(Parsed { grid: stack_grid(size, spacing_mm), voxels, slope: 1.0, intercept: 0.0, report })
}

struct Slice {
    number: u64,
    name: String,
    format: ImageFormat,
    bytes: Vec<u8>,
}

#[derive(Clone, Copy)]
struct Head {
    sides: [u32; 2],
    pixels: Pixels,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Pixels {
    Grey8,
    Grey16,
    Colour,
}

impl Pixels {
    fn name(self) -> &'static str {
        match self {
            Self::Grey8 => "8-bit grey",
            Self::Grey16 => "16-bit grey",
            Self::Colour => "RGBA",
        }
    }
}

impl Slice {
    fn decoder(&self) -> Result<impl ImageDecoder + '_, VolumeFault> {
        let mut reader = ImageReader::with_format(Cursor::new(&*self.bytes), self.format);
        let mut limits = Limits::no_limits();
        // One more than a volume may have, so that a size beyond it is told of as such.
        limits.max_image_width = Some(MAX_SIDE * 16);
        limits.max_image_height = Some(MAX_SIDE * 16);
        limits.max_alloc = Some(self.bytes.len() as u64 * MOST_PER_BYTE + (1 << 20));
        reader.limits(limits);
        reader.into_decoder().map_err(|error| self.unreadable(&error))
    }

    /// What the picture claims to be.
    fn head(&self) -> Result<Head, VolumeFault> {
        let decoder = self.decoder()?;
        let (width, height) = decoder.dimensions();
        let pixels = match decoder.color_type() {
            ColorType::L8 => Pixels::Grey8,
            ColorType::L16 => Pixels::Grey16,
            _ => Pixels::Colour,
        };
        checked_size([width.into(), height.into(), 1])?;
        let expected = decoder.total_bytes();
        let most = self.bytes.len() as u64 * MOST_PER_BYTE;
        match expected > most {
            true => Err(VolumeFault::Truncated { what: "pixels".into(), expected, found: most }),
            false => Ok(Head { sides: [width, height], pixels }),
        }
    }

    fn decode(&self) -> Result<DynamicImage, VolumeFault> {
        DynamicImage::from_decoder(self.decoder()?).map_err(|error| self.unreadable(&error))
    }

    fn unreadable(&self, error: &image::ImageError) -> VolumeFault {
        let format = if self.format == ImageFormat::Png { "PNG" } else { "JPEG" };
        malformed(format!("{format} data"), excerpt(&error.to_string()))
    }
}

/// The number that says where a slice belongs: the last one in the name, by its value and not by its digits.
fn last_number(name: &str) -> Result<u64, VolumeFault> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    let Some(digits) = stem.rsplit(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty()) else {
        return Err(malformed(
            "file name",
            "there is no number in it that says which slice it is; rename or remove it",
        ));
    };
    digits
        .parse()
        .map_err(|_| malformed("file name", format!("{} is too large for the number of a slice", excerpt(digits))))
}

fn check_numbers(slices: &[Slice]) -> Result<(), VolumeFault> {
    for pair in slices.windows(2) {
        let (before, after) = (&pair[0], &pair[1]);
        if before.number == after.number {
            let (a, b, number) = (excerpt(&before.name), excerpt(&after.name), before.number);
            return Err(malformed(
                "file name",
                format!("`{a}` and `{b}` have the same number {number}; remove one of them"),
            ));
        }
        if before.number + 1 != after.number {
            let [before_name, after_name] = [excerpt(&before.name), excerpt(&after.name)];
            return Err(VolumeFault::MissingSlice {
                number: before.number + 1,
                before: before_name,
                after: after_name,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_number_of_a_name_counts_by_its_value() {
        for (name, number) in
            [("plane009.png", 9), ("plane0010.png", 10), ("2024-ct_7a.png", 7), ("\u{e4}1.png", 1), ("5", 5)]
        {
            assert_eq!(last_number(name), Ok(number), "{name}");
        }
        assert_eq!(
            last_number("cover.png2").unwrap_err().to_string().split(';').next(),
            Some("file name: there is no number in it that says which slice it is")
        );
        assert!(last_number("99999999999999999999.png").is_err());
    }

    #[test]
    fn pictures_stand_upright_before_the_viewer() {
        let volume_from_voxel = stack_grid(UVec3::new(3, 3, 3), DVec3::ONE).volume_from_voxel();
        let step = |voxel| (volume_from_voxel.transform_vector3(voxel) * 1e3).round();
        assert_eq!(step(glam::Vec3::X), glam::Vec3::X);
        assert_eq!(step(glam::Vec3::Y), glam::Vec3::NEG_Y);
        assert_eq!(step(glam::Vec3::Z), glam::Vec3::NEG_Z);
    }
}
