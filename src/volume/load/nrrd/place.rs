//! What the axes of an NRRD mean, and where its voxels lie.

use super::header::Header;
use crate::files::excerpt;
use crate::volume::VolumeGrid;
use crate::volume::error::VolumeFault;
use crate::volume::load::text::{number, numbers, spacing};
use crate::volume::load::{LPS_FROM_RAS, malformed, placed_grid, unsupported};
use glam::{DVec3, UVec3};

/// What an axis of the numbers in memory runs along.
pub(super) enum Axis {
    /// A direction in space; its step in the file's own space, if the file gives one.
    Space { size: u64, step: Option<DVec3> },
    /// Colour, time, or a list of anything; its kind in lower case.
    Other { size: u64, kind: String },
}

/// Sorts the axes by `space directions`, where they are given, and else by `kinds`. Without either, four axes are RGB or RGBA
/// if the first has 3 or 4 bytes, and a series in time if not.
pub(super) fn axes(header: &Header, sizes: &[u64]) -> Result<Vec<Axis>, VolumeFault> {
    let kinds: Vec<String> = match header.get("kinds") {
        Some(kinds) => kinds.split_whitespace().map(str::to_ascii_lowercase).collect(),
        None => Vec::new(),
    };
    if !kinds.is_empty() && kinds.len() != sizes.len() {
        return Err(malformed("kinds", format!("there are {} for {} axes", kinds.len(), sizes.len())));
    }
    let kind = |at: usize| kinds.get(at).cloned().unwrap_or_default();
    if let Some(directions) = header.get("space directions") {
        let directions = vectors("space directions", directions, sizes.len())?;
        let axis = |(at, (direction, &size))| match direction {
            Some(step) => Axis::Space { size, step: Some(step) },
            None => Axis::Other { size, kind: kind(at) },
        };
        return Ok(directions.into_iter().zip(sizes).enumerate().map(axis).collect());
    }
    let is_byte = header.get("type").is_some_and(|named| named.contains("char") || named.contains("int8"));
    let is_spatial = |at: usize| match &*kind(at) {
        "domain" | "space" => true,
        "" | "???" | "none" if sizes.len() == 4 => match is_byte && matches!(sizes[0], 3 | 4) {
            true => at > 0,
            false => at < 3,
        },
        "" | "???" | "none" => true,
        _ => false,
    };
    let axis = |(at, &size)| match is_spatial(at) {
        true => Axis::Space { size, step: None },
        false => Axis::Other { size, kind: kind(at) },
    };
    Ok(sizes.iter().enumerate().map(axis).collect())
}

/// The grid, and whether the file says where it lies in the patient.
pub(super) fn grid(header: &Header, axes: &[Axis], size: UVec3) -> Result<(VolumeGrid, bool), VolumeFault> {
    let space = Space::of(header)?;
    let spacings = match header.get("spacings") {
        Some(text) => numbers("spacings", text, axes.len())?,
        None => vec![f64::NAN; axes.len()],
    };
    let units_mm = units_mm(header)?;
    let mut steps = Vec::new();
    for (axis, spaced) in axes.iter().zip(spacings) {
        match axis {
            Axis::Space { step: Some(step), .. } => steps.push(*step * space.lps_from_file * units_mm),
            // A file without any spacing counts in voxels.
            Axis::Space { step: None, .. } => {
                let spaced = if header.get("spacings").is_none() { 1.0 } else { spacing("spacings", spaced)? };
                let axis = DVec3::AXES.get(steps.len()).copied().unwrap_or_default();
                steps.push(axis * spaced * space.lps_from_file.abs() * units_mm);
            }
            Axis::Other { .. } => {}
        }
    }
    // A picture is a volume of one slice, 1 mm thick.
    if let [i, j] = steps[..] {
        steps.push(i.cross(j).normalize_or_zero());
    }
    let [i, j, k] = steps[..] else { return Err(malformed("space directions", "a volume has three axes in space")) };
    let origin = match header.get("space origin") {
        Some(text) => vectors("space origin", text, 1)?
            .pop()
            .flatten()
            .ok_or_else(|| malformed("space origin", format!("`{}` is no vector", excerpt(text))))?,
        None => DVec3::ZERO,
    };
    let has_directions = header.get("space directions").is_some();
    let field = if has_directions { "space directions" } else { "spacings" };
    let grid = placed_grid(size, [i, j, k], origin * space.lps_from_file * units_mm, field)?;
    Ok((grid, has_directions && space.is_of_the_patient))
}

struct Space {
    lps_from_file: DVec3,
    is_of_the_patient: bool,
}

impl Space {
    fn of(header: &Header) -> Result<Self, VolumeFault> {
        let Some(named) = header.get("space") else {
            return Ok(Self { lps_from_file: DVec3::ONE, is_of_the_patient: false });
        };
        let patient = |lps_from_file| Ok(Self { lps_from_file, is_of_the_patient: true });
        match &*named.to_ascii_lowercase() {
            "lps" | "left-posterior-superior" => patient(DVec3::ONE),
            "ras" | "right-anterior-superior" => patient(LPS_FROM_RAS),
            "las" | "left-anterior-superior" => patient(DVec3::new(1.0, -1.0, 1.0)),
            "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => {
                Ok(Self { lps_from_file: DVec3::ONE, is_of_the_patient: false })
            }
            other if other.ends_with("-time") || matches!(other, "rast" | "last" | "lpst") => Err(unsupported(
                format!("space {}", excerpt(named)),
                "save one time of it, in space left-posterior-superior",
            )),
            _ => Err(malformed("space", format!("`{}` is not known", excerpt(named)))),
        }
    }
}

/// Millimetres per unit of the space.
fn units_mm(header: &Header) -> Result<f64, VolumeFault> {
    let Some(units) = header.get("space units") else { return Ok(1.0) };
    let mut scale = None;
    for unit in units.split('"').filter(|unit| !unit.trim().is_empty()) {
        let this = match unit.trim().to_ascii_lowercase().as_str() {
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" | "???" => 1.0,
            "cm" | "centimeter" | "centimeters" => 10.0,
            "m" | "meter" | "meters" | "metre" | "metres" => 1000.0,
            "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometers" => 1e-3,
            _ => return Err(malformed("space units", format!("`{}` is not mm, cm, m or um", excerpt(unit)))),
        };
        if scale.is_some_and(|other| other != this) {
            return Err(unsupported("a different unit along each axis", "save all axes in mm"));
        }
        scale = Some(this);
    }
    Ok(scale.unwrap_or(1.0))
}

/// So many vectors like `(1,0,0)`; `none` where an axis is not in space. In a plane, the third component is 0.
fn vectors(field: &str, text: &str, count: usize) -> Result<Vec<Option<DVec3>>, VolumeFault> {
    let mut vectors = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            vectors.push(None);
            rest = after.trim_start();
            continue;
        }
        let Some((inside, after)) = rest.strip_prefix('(').and_then(|rest| rest.split_once(')')) else {
            return Err(malformed(field, format!("`{}` is neither a vector like (1,0,0) nor none", excerpt(rest))));
        };
        let parts = inside.split(',').map(|part| number(field, part)).collect::<Result<Vec<f64>, _>>()?;
        let vector = match parts[..] {
            [x, y] => DVec3::new(x, y, 0.0),
            [x, y, z] => DVec3::new(x, y, z),
            _ => {
                return Err(malformed(field, format!("`({})` has {} components, not 3", excerpt(inside), parts.len())));
            }
        };
        if !vector.is_finite() {
            return Err(malformed(field, format!("`({})` is not finite", excerpt(inside))));
        }
        vectors.push(Some(vector));
        rest = after.trim_start();
    }
    match vectors.len() == count {
        true => Ok(vectors),
        false => Err(malformed(field, format!("there are {} vectors where {count} belong", vectors.len()))),
    }
}
