//! Slices of one series in their order.

use super::file::{DataSet, Pixels, Slice};
use super::{is_dicom, pixels};
use crate::files::excerpt;
use crate::volume::error::{DicomSeries, VolumeFault};
use crate::volume::load::{LoadReport, Parsed, SliceFault, VolumeFormat, VolumeLoadOptions};
use crate::volume::load::{checked_size, malformed, placed_grid, samples, shown};
use crate::volume::{VolumeGrid, Voxels};
use glam::{DVec3, UVec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// A volume of one slice.
pub(crate) fn read_file(bytes: &[u8], name: &str, options: &VolumeLoadOptions) -> Result<Parsed, VolumeFault> {
    let data = DataSet::of(bytes)?;
    let slice = data.slice()?;
    if matches!(slice.pixels, Pixels::None) {
        return Err(malformed("PixelData", "this field is missing; it is no picture"));
    }
    read_series(vec![(name, slice)], 0, options).map_err(|fault| fault.fault)
}

/// The series in a folder. Files without pixels, and those that are no DICOM, are ignored and counted.
pub(crate) fn read_folder(files: &[(String, Vec<u8>)], options: &VolumeLoadOptions) -> Result<Parsed, SliceFault> {
    let dicom: Vec<&(String, Vec<u8>)> = files.iter().filter(|(_, bytes)| is_dicom(bytes)).collect();
    let sets = dicom.par_iter().map(|(name, bytes)| DataSet::of(bytes).map_err(SliceFault::of(name)));
    let sets = sets.collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()?;
    let slices = sets.par_iter().zip(&dicom).map(|(set, (name, _))| match set.slice() {
        Ok(slice) => Ok((name.as_str(), slice)),
        Err(fault) => Err(SliceFault::of(name)(fault)),
    });
    let mut slices = slices.collect::<Vec<_>>().into_iter().collect::<Result<Vec<_>, _>>()?;
    slices.retain(|(_, slice)| !matches!(slice.pixels, Pixels::None));
    let ignored = files.len() - slices.len();
    read_series(slices, ignored, options)
}

fn read_series(
    mut slices: Vec<(&str, Slice)>,
    mut ignored: usize,
    options: &VolumeLoadOptions,
) -> Result<Parsed, SliceFault> {
    let before = slices.len();
    let series = choose(&mut slices, options.series.as_deref())?;
    // Slices of other series were left out on purpose, but they do not belong to the volume either.
    ignored += before - slices.len();
    for (name, slice) in &slices {
        pixels::check(slice).map_err(SliceFault::of(name))?;
    }
    let (first_name, first) = slices.first().map(|(name, slice)| (*name, slice.clone())).ok_or(VolumeFault::Empty)?;
    check_alike(&slices, first_name, &first)?;
    let size = checked_size([first.columns.into(), first.rows.into(), slices.len() as u64])?;
    let is_placed = slices.iter().all(|(_, slice)| slice.position_mm.is_some()) && first.orientation.is_some();
    let steps = Steps::of(&first, options).map_err(SliceFault::of(first_name))?;
    let grid = steps.grid(&mut slices, size)?;

    let is_uniform = slices.iter().all(|(_, slice)| (slice.slope, slice.intercept) == (first.slope, first.intercept));
    let (voxels, slope, intercept) = match is_uniform {
        true => (as_stored(&slices, &first)?, first.slope, first.intercept),
        false => {
            let stored = stacked(&slices, |sample| sample)?;
            let area = first.columns as usize * first.rows as usize;
            let rescaled = stored.chunks_exact(area).zip(&slices).flat_map(|(samples, (_, slice))| {
                let number = |sample: i32| match slice.is_signed {
                    true => f64::from(sample),
                    false => f64::from(sample.cast_unsigned()),
                };
                samples.iter().map(move |sample| slice.slope * number(*sample) + slice.intercept)
            });
            (samples::narrow_floating(rescaled, false)?.0, 1.0, 0.0)
        }
    };
    let sign = if first.is_signed { "i" } else { "u" };
    let report = LoadReport {
        format: VolumeFormat::Dicom,
        element: format!("{sign}{} in {} bits", first.bits_stored, first.bits_allocated),
        frames: 1,
        series: Some(series),
        files_ignored: ignored,
        voxels_replaced: 0,
        is_placed,
    };
    Ok(Parsed { grid, voxels, slope, intercept, report })
}

/// Numbers in the type that the file has, or for 32 bits in the narrowest.
fn as_stored(slices: &[(&str, Slice)], first: &Slice) -> Result<Voxels, SliceFault> {
    Ok(match (first.bits_allocated, first.is_signed) {
        (8, false) => Voxels::U8(stacked(slices, |number| number as u8)?),
        (8 | 16, true) => Voxels::I16(stacked(slices, |number| number as i16)?),
        (16, false) => Voxels::U16(stacked(slices, |number| number as u16)?),
        (_, true) => samples::narrow(stacked(slices, |number| number)?.into_iter(), |number| number as f32),
        (_, false) => samples::narrow(stacked(slices, i32::cast_unsigned)?.into_iter(), |number| number as f32),
    })
}

/// The numbers of all slices, one after another; slices are unpacked side by side.
fn stacked<T: Clone + Send>(slices: &[(&str, Slice)], cast: fn(i32) -> T) -> Result<Vec<T>, SliceFault> {
    let decode = |(name, slice): &(&str, Slice)| match pixels::decode(slice) {
        Ok(numbers) => Ok(numbers.into_iter().map(cast).collect::<Vec<_>>()),
        Err(fault) => Err(SliceFault::of(name)(fault)),
    };
    let decoded = slices.par_iter().map(decode).collect::<Vec<_>>();
    let decoded = decoded.into_iter().collect::<Result<Vec<_>, _>>()?;
    Ok(decoded.concat())
}

/// Keeps the slices of the wanted series, or of the only one.
fn choose(slices: &mut Vec<(&str, Slice)>, wanted: Option<&str>) -> Result<DicomSeries, VolumeFault> {
    let mut all: BTreeMap<String, DicomSeries> = BTreeMap::new();
    for (_, slice) in slices.iter() {
        let series = all.entry(slice.series_uid.clone()).or_insert_with(|| DicomSeries {
            uid: slice.series_uid.clone(),
            description: slice.description.clone(),
            slices: 0,
        });
        series.slices += 1;
    }
    let chosen = match (wanted, all.len()) {
        (_, 0) => return Err(malformed("PixelData", "not one DICOM file in it holds a picture")),
        (Some(wanted), _) => all.get(wanted.trim()),
        (None, 1) => all.values().next(),
        (None, _) => return Err(VolumeFault::SeveralSeries { series: all.into_values().collect() }),
    };
    let Some(chosen) = chosen.cloned() else {
        let wanted = excerpt(wanted.unwrap_or_default());
        return Err(VolumeFault::NoSuchSeries { wanted, series: all.into_values().collect() });
    };
    slices.retain(|(_, slice)| slice.series_uid == chosen.uid);
    Ok(chosen)
}

/// Refuses slices that do not fit the first one of the list.
fn check_alike(slices: &[(&str, Slice)], first_name: &str, first: &Slice) -> Result<(), VolumeFault> {
    for (name, slice) in slices {
        let fields = |slice: &Slice| {
            [
                ("size", format!("{} x {}", slice.columns, slice.rows)),
                ("BitsAllocated", slice.bits_allocated.to_string()),
                ("PixelRepresentation", u8::from(slice.is_signed).to_string()),
            ]
        };
        let differs = |field: &str, found: String, expected: String| {
            let expected = format!("{expected} in `{}`", excerpt(first_name));
            Err(VolumeFault::SliceDiffers { slice: excerpt(name), field: field.into(), found, expected })
        };
        for ((field, found), (_, expected)) in fields(slice).into_iter().zip(fields(first)) {
            if found != expected {
                return differs(field, found, expected);
            }
        }
        let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-4 * b.abs().max(1e-3);
        match (slice.pixel_spacing_mm, first.pixel_spacing_mm) {
            (Some([a, b]), Some([c, d])) if is_near(a, c) && is_near(b, d) => {}
            (None, None) => {}
            (found, expected) => {
                let shown =
                    |spacing: Option<[f64; 2]>| spacing.map_or("missing".into(), |[y, x]| format!("{y:?} x {x:?}"));
                return differs("PixelSpacing", shown(found), shown(expected));
            }
        }
        match (slice.orientation, first.orientation) {
            (Some([a, b]), Some([c, d])) if a.distance(c) < 1e-3 && b.distance(d) < 1e-3 => {}
            (None, None) => {}
            (found, expected) => {
                let shown = |axes: Option<[DVec3; 2]>| {
                    axes.map_or("missing".into(), |[x, y]| format!("{} {}", shown(x), shown(y)))
                };
                return differs("ImageOrientationPatient", shown(found), shown(expected));
            }
        }
    }
    Ok(())
}

/// Steps from pixel to pixel, and what is known of those from slice to slice.
struct Steps {
    /// To the right in the picture, millimetres.
    column: DVec3,
    /// Down in the picture.
    row: DVec3,
    normal: DVec3,
    /// Thickness of a slice that has no neighbours.
    thickness_mm: f64,
}

impl Steps {
    fn of(slice: &Slice, options: &VolumeLoadOptions) -> Result<Self, VolumeFault> {
        let [right, down] = slice.orientation.unwrap_or([DVec3::X, DVec3::Y]);
        let normal = right.cross(down);
        let is_unit = |axis: DVec3| (axis.length() - 1.0).abs() < 1e-2;
        if !(is_unit(right) && is_unit(down) && is_unit(normal)) {
            let reason = format!("{} and {} are not two directions at right angles", shown(right), shown(down));
            return Err(malformed("ImageOrientationPatient", reason));
        }
        let [y, x] = match (slice.pixel_spacing_mm, options.spacing_mm) {
            (Some(spacing), _) => spacing,
            (None, Some([x, y, _])) => [y, x],
            (None, None) => {
                return Err(malformed("PixelSpacing", "this field is missing; give the load option `spacing_mm`"));
            }
        };
        if !(x > 0.0 && y > 0.0) {
            return Err(malformed("PixelSpacing", format!("{y:?} x {x:?} are not two positive numbers")));
        }
        let thickness =
            [slice.thickness_mm, slice.slice_spacing_mm].into_iter().flatten().find(|thickness| *thickness > 0.0);
        let thickness_mm = thickness.unwrap_or(1.0);
        Ok(Self { column: right.normalize() * x, row: down.normalize() * y, normal: normal.normalize(), thickness_mm })
    }

    /// Sorts the slices along the normal, whatever their names and numbers say, and makes sure that each is where it belongs.
    fn grid(&self, slices: &mut Vec<(&str, Slice)>, size: UVec3) -> Result<VolumeGrid, SliceFault> {
        let field = "ImagePositionPatient";
        let mut places = Vec::with_capacity(slices.len());
        for (name, slice) in slices.drain(..) {
            let position_mm = match slice.position_mm {
                Some(position_mm) if position_mm.abs().max_element() > 1e6 => {
                    let reason = format!("{} mm lies outside of any scanner", shown(position_mm));
                    return Err(SliceFault::of(name)(malformed(field, reason)));
                }
                Some(position_mm) => position_mm,
                None if size.z == 1 => DVec3::ZERO,
                None => {
                    let reason = "this field is missing; nothing says where the slice belongs";
                    return Err(SliceFault::of(name)(malformed(field, reason)));
                }
            };
            places.push((position_mm.dot(self.normal), position_mm, name, slice));
        }
        places.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.2.cmp(b.2)));
        let step = match (&places[..], self.gaps(&places)?) {
            ([first, .., last], Some(())) => (last.1 - first.1) / (places.len() - 1) as f64,
            _ => self.normal * self.thickness_mm,
        };
        let origin_mm = places.first().map_or(DVec3::ZERO, |place| place.1);
        // Half a pixel aside is another picture, not a rounded number.
        let aside_mm = 0.5 * self.column.length().min(self.row.length());
        for (at, (_, position_mm, name, _)) in places.iter().enumerate() {
            let off_mm = position_mm.distance(origin_mm + step * at as f64);
            if off_mm > aside_mm.max(0.1 * step.length()) {
                let reason = format!("the slice lies {off_mm:.3} mm beside the line through the first and the last");
                return Err(SliceFault::of(name)(malformed(field, reason)));
            }
        }
        slices.extend(places.into_iter().map(|(_, _, name, slice)| (name, slice)));
        Ok(placed_grid(size, [self.column, self.row, step], origin_mm, field)?)
    }

    /// Refuses gaps and doubled slices; `None` where there is but one slice.
    fn gaps(&self, places: &[(f64, DVec3, &str, Slice)]) -> Result<Option<()>, VolumeFault> {
        let mut gaps: Vec<f64> = places.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
        for (gap, pair) in gaps.iter().zip(places.windows(2)) {
            if *gap < 1e-3 {
                let [first, second] = [0, 1].map(|at| excerpt(pair[at].2));
                return Err(VolumeFault::DoubledSlices { first, second, position_mm: pair[0].0 });
            }
        }
        let in_order = gaps.clone();
        gaps.sort_by(f64::total_cmp);
        let Some(&median) = gaps.get(gaps.len() / 2) else { return Ok(None) };
        for (gap, pair) in in_order.iter().zip(places.windows(2)) {
            // Positions are written as decimals, to a hundredth of a millimetre or better.
            if (gap - median).abs() > 0.03 * median + 0.01 {
                let [before, after] = [0, 1].map(|at| excerpt(pair[at].2));
                return Err(VolumeFault::UnevenSlices { before, after, gap_mm: *gap, spacing_mm: median });
            }
        }
        Ok(Some(()))
    }
}
