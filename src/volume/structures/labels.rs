//! Structures from a second volume that names every voxel.

use super::thresholds::SolidRamp;
use super::{Structure, Structures, Tissue};
use crate::volume::error::VolumeFault;
use crate::volume::{Volume, Voxels};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// How far the corners of two grids may lie apart, as a share of a voxel, to count as one.
const GRID_TOLERANCE_VOXELS: f64 = 0.1;

impl Structures {
    /// Structures from a label volume on the grid of `volume`: 0 is nothing, any other whole number the structure that `names`
    /// gives it, or one called "label 17". The list holds the named structures first, in the order of `names`, then the unnamed
    /// ones that occur, in ascending order; labels are numbered accordingly.
    ///
    /// With a ramp the filling comes from the values of `volume`, without one every labelled voxel is filled. Voxels without a
    /// label are not filled in either case: nothing is known about them.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] if the grids differ in size or by more than a tenth of a voxel in place, a label is negative or
    /// no whole number, 0 or one number is named twice, there are more than 255 structures, or the ramp falls.
    pub fn from_labels(
        volume: &Volume,
        labels: &Volume,
        names: &[(u32, Structure)],
        solid: Option<SolidRamp>,
    ) -> Result<Self, VolumeFault> {
        let bad = |reason: String| Err(VolumeFault::BadGrid { field: "labels".into(), reason });
        check_same_grid(volume, labels)?;
        if let Some(ramp) = &solid {
            ramp.check()?;
        }
        let numbers = label_numbers(labels)?;
        let mut list: Vec<(u32, Structure)> = Vec::with_capacity(names.len());
        for (number, structure) in names {
            if *number == 0 || list.iter().any(|(other, _)| other == number) {
                return bad(format!("{} is named {number}, which is taken", structure.name));
            }
            list.push((*number, structure.clone()));
        }
        for &number in numbers.iter().filter(|&&number| number != 0) {
            if !list.iter().any(|&(other, _)| other == number) {
                list.push((number, unnamed(number)));
            }
        }
        if list.len() > 255 {
            return bad(format!("{} different ones; at most 255 can be told apart", list.len()));
        }
        // Numbers in a file may be large and sparse: sorted, and found by bisection where they do not fit a small table.
        let mut places: Vec<(u32, u8)> = list.iter().zip(1..).map(|(&(number, _), place)| (number, place)).collect();
        places.sort_unstable();
        let place = |number: u32| match places.binary_search_by_key(&number, |entry| entry.0) {
            Ok(found) => places[found].1,
            Err(_) => 0,
        };
        let small: [u8; 256] = std::array::from_fn(|number| place(number as u32));
        let compact = |index: usize| -> u8 {
            // `label_numbers` found a whole number from 0 upwards here.
            let number = labels.value(index).round() as u32;
            small.get(number as usize).copied().unwrap_or_else(|| place(number))
        };
        let filled = |index: usize, label: u8| match (label, solid) {
            (0, _) => 0,
            (_, None) => 255,
            (_, Some(ramp)) => ramp.solid(volume.value(index)),
        };
        let count = volume.grid().count();
        let (mut out, mut fill) = (vec![0; count], vec![0; count]);
        const VOXELS_PER_TASK: usize = 1 << 16;
        out.par_chunks_mut(VOXELS_PER_TASK).zip(fill.par_chunks_mut(VOXELS_PER_TASK)).enumerate().for_each(
            |(task, (out, fill))| {
                for (offset, (label, fill)) in out.iter_mut().zip(fill).enumerate() {
                    let index = task * VOXELS_PER_TASK + offset;
                    *label = compact(index);
                    *fill = filled(index, *label);
                }
            },
        );
        Self::new(list.into_iter().map(|(_, structure)| structure).collect(), out, fill)
    }
}

/// Colours far apart from one another: hues that advance by the golden angle.
fn unnamed(number: u32) -> Structure {
    let hue = (f64::from(number) * 0.618_033_988_75).fract() * 6.0;
    let channel = |shift: f64| {
        let place = (hue + shift).rem_euclid(6.0);
        let share = (2.0 - (place - 3.0).abs()).clamp(0.0, 1.0);
        (90.0 + 140.0 * (1.0 - share)).round() as u8
    };
    Structure::new(format!("label {number}"), [channel(0.0), channel(4.0), channel(2.0)], Tissue::Soft)
}

/// The different labels that occur, in ascending order.
fn label_numbers(labels: &Volume) -> Result<Vec<u32>, VolumeFault> {
    let bad = |value: f64| VolumeFault::BadGrid {
        field: "labels".into(),
        reason: format!("{value} is no label; labels are whole numbers from 0 upwards"),
    };
    let number = |value: f64| -> Result<u32, VolumeFault> {
        // Slopes and intercepts leave rounding errors.
        let number = value.round();
        if (value - number).abs() < 1e-3 && (0.0..=f64::from(u32::MAX)).contains(&number) {
            Ok(number as u32)
        } else {
            Err(bad(value))
        }
    };
    if matches!(labels.voxels(), Voxels::Rgba(_)) {
        let reason = "a coloured volume has no labels; snap it to a palette".into();
        return Err(VolumeFault::BadGrid { field: "labels".into(), reason });
    }
    const VOXELS_PER_TASK: usize = 1 << 18;
    let count = labels.voxels().count();
    let parts: Vec<BTreeSet<u32>> = (0..count.div_ceil(VOXELS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let mut found = BTreeSet::new();
            let mut last = f64::NAN;
            for index in task * VOXELS_PER_TASK..((task + 1) * VOXELS_PER_TASK).min(count) {
                let value = labels.value(index);
                if value != last {
                    found.insert(number(value)?);
                    last = value;
                }
            }
            Ok(found)
        })
        .collect::<Result<_, VolumeFault>>()?;
    Ok(parts.into_iter().flatten().collect::<BTreeSet<u32>>().into_iter().collect())
}

fn check_same_grid(volume: &Volume, labels: &Volume) -> Result<(), VolumeFault> {
    let bad = |reason: String| Err(VolumeFault::BadGrid { field: "labels".into(), reason });
    let (a, b) = (volume.grid(), labels.grid());
    if a.size != b.size {
        return bad(format!("they are on a grid of {}, the volume on one of {}", b.size, a.size));
    }
    let tolerance_mm = GRID_TOLERANCE_VOXELS * a.spacing_mm().min_element();
    for corner in 0..8u32 {
        let voxel = glam::UVec3::new(corner & 1, (corner >> 1) & 1, corner >> 2) * (a.size - 1);
        let [one, other] = [a, b].map(|grid| grid.lps_mm_from_voxel.transform_point3(voxel.as_dvec3()));
        if one.distance(other) > tolerance_mm {
            return bad(format!("their voxel {voxel} lies at {other:.3} mm, that of the volume at {one:.3} mm"));
        }
    }
    Ok(())
}
