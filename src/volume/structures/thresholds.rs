//! Structures from the values of a scalar volume.

use super::{Structure, Structures, Tissue};
use crate::volume::error::VolumeFault;
use crate::volume::{Volume, Voxels};
use bevy::reflect::Reflect;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Values between which a voxel goes from empty to filled: scanners blur a surface over a voxel or two, so a value between
/// those of air and tissue means that the voxel is partly filled.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct SolidRamp {
    /// Voxels up to this value are empty.
    pub empty_below: f64,
    /// Voxels from this value on are filled.
    pub full_above: f64,
}

impl Default for SolidRamp {
    /// From air to water, in Hounsfield units.
    fn default() -> Self {
        Self { empty_below: -700.0, full_above: -200.0 }
    }
}

impl SolidRamp {
    /// How much of a voxel of a value is filled, 0 to 255.
    pub fn solid(&self, value: f64) -> u8 {
        let width = self.full_above - self.empty_below;
        if width > 0.0 {
            ((value - self.empty_below) / width * 255.0).round().clamp(0.0, 255.0) as u8
        } else if value >= self.full_above {
            255
        } else {
            0
        }
    }

    pub(super) fn check(&self) -> Result<(), VolumeFault> {
        // Also refuses NaN, which is in no order with anything.
        if self.empty_below <= self.full_above && self.empty_below.is_finite() && self.full_above.is_finite() {
            return Ok(());
        }
        Err(VolumeFault::BadGrid {
            field: "solid".into(),
            reason: format!("a ramp from {} to {}; it must rise", self.empty_below, self.full_above),
        })
    }
}

/// Values that mean one structure.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct ThresholdBand {
    /// Least value.
    pub from: f64,
    /// Values up to, but without, this one.
    pub to: f64,
    /// What has these values.
    pub structure: Structure,
}

/// Structures by ranges of values.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Thresholds {
    /// The bands; where two of them overlap, the first one counts.
    pub bands: Vec<ThresholdBand>,
    /// How much of a voxel is filled.
    pub solid: SolidRamp,
}

const BONE_COLOUR: [u8; 3] = [240, 226, 197];
const CANCELLOUS_COLOUR: [u8; 3] = [222, 184, 146];

impl Thresholds {
    /// Bone in a CT with Hounsfield units: cortical from 700, cancellous from 250. Soft tissue is left out: voxels count as
    /// filled from 150 (empty) to 350 (full), half way between muscle and the least dense bone.
    pub fn bone_hu() -> Self {
        let band = |from, to, structure| ThresholdBand { from, to, structure };
        Self {
            bands: vec![
                band(700.0, f64::MAX, Structure::new("Cortical bone", BONE_COLOUR, Tissue::CorticalBone)),
                band(250.0, 700.0, Structure::new("Cancellous bone", CANCELLOUS_COLOUR, Tissue::CancellousBone)),
            ],
            solid: SolidRamp { empty_below: 150.0, full_above: 350.0 },
        }
    }

    /// Whatever is brighter than its surroundings, for values that are no Hounsfield units: one structure, "Tissue", above the
    /// threshold that parts the histogram into two classes with the greatest variance between them (Otsu, "A threshold selection
    /// method from gray-level histograms", 1979). The ramp runs over the middle half between the means of the two classes.
    ///
    /// A volume with a single value is all tissue.
    pub fn otsu(volume: &Volume) -> Self {
        let tissue = Structure::new("Tissue", BONE_COLOUR, Tissue::CorticalBone);
        let [least, greatest] = volume.range();
        let (threshold, below, above) = otsu_threshold(&histogram(volume), least, greatest);
        let quarter = 0.25 * (above - below);
        Self {
            bands: vec![ThresholdBand { from: threshold, to: f64::MAX, structure: tissue }],
            solid: SolidRamp { empty_below: threshold - quarter, full_above: threshold + quarter },
        }
    }

    /// Label of a value: of the first band that holds it, otherwise of the nearest one.
    fn label(&self, value: f64) -> u8 {
        let outside = |band: &ThresholdBand| {
            if value < band.from {
                band.from - value
            } else if value >= band.to {
                // At `to` itself the voxel is already outside, by however little.
                (value - band.to).max(f64::MIN_POSITIVE)
            } else {
                0.0
            }
        };
        let mut best = (f64::INFINITY, 0);
        for (place, band) in self.bands.iter().enumerate() {
            let distance = outside(band);
            if distance < best.0 {
                best = (distance, place as u8 + 1);
            }
        }
        best.1
    }
}

/// Bins of the histogram that Otsu's threshold is taken from.
const BINS: usize = 256;

fn histogram(volume: &Volume) -> [u64; BINS] {
    const VOXELS_PER_TASK: usize = 1 << 18;
    let count = volume.voxels().count();
    let of_part = |task: usize| {
        let mut counts = [0; BINS];
        for index in task * VOXELS_PER_TASK..((task + 1) * VOXELS_PER_TASK).min(count) {
            let bin = (volume.normalized(index) * BINS as f32) as usize;
            counts[bin.min(BINS - 1)] += 1;
        }
        counts
    };
    // Whole numbers: the same sum in any order.
    let sum = |a: [u64; BINS], b: [u64; BINS]| std::array::from_fn(|bin| a[bin] + b[bin]);
    (0..count.div_ceil(VOXELS_PER_TASK)).into_par_iter().map(of_part).reduce(|| [0; BINS], sum)
}

/// Threshold and the means of the classes below and above it.
fn otsu_threshold(counts: &[u64; BINS], least: f64, greatest: f64) -> (f64, f64, f64) {
    let value = |bin: f64| least + (greatest - least) * bin / BINS as f64;
    let total: f64 = counts.iter().map(|&count| count as f64).sum();
    let sum: f64 = counts.iter().enumerate().map(|(bin, &count)| (bin as f64 + 0.5) * count as f64).sum();
    let (mut weight, mut part) = (0.0, 0.0);
    let mut best = (0.0, least, least, least);
    let mut gap = (0, 0.0);
    for (bin, &count) in counts.iter().enumerate().take(BINS - 1) {
        weight += count as f64;
        part += (bin as f64 + 0.5) * count as f64;
        if weight == 0.0 || weight == total {
            continue;
        }
        let (below, above) = (part / weight, (sum - part) / (total - weight));
        let variance = weight * (total - weight) * (above - below) * (above - below);
        if variance > best.0 {
            best = (variance, value(bin as f64 + 1.0), value(below), value(above));
            gap = (bin, variance);
        } else if variance == gap.1 && count == 0 {
            // Over a gap in the histogram all thresholds are equally good: take its middle.
            best.1 = value((gap.0 + bin) as f64 * 0.5 + 1.0);
        }
    }
    (best.1, best.2, best.3)
}

impl Structures {
    /// Structures by ranges of values. Voxels with anything in them, but a value in none of the bands, go to the band nearest to
    /// their value: at a surface scanners blur dense bone into values of softer tissue. For colours the value is the opacity.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] if there are no bands or more than 255, a bound is NaN, or the ramp falls.
    pub fn from_thresholds(volume: &Volume, thresholds: &Thresholds) -> Result<Self, VolumeFault> {
        let bad = |reason: String| Err(VolumeFault::BadGrid { field: "thresholds".into(), reason });
        let bands = &thresholds.bands;
        if bands.is_empty() || bands.len() > 255 {
            return bad(format!("{} bands; there must be 1 to 255", bands.len()));
        }
        if let Some(band) = bands.iter().find(|band| band.from.is_nan() || band.to.is_nan()) {
            return bad(format!("{} has a bound that is no number", band.structure.name));
        }
        thresholds.solid.check()?;
        let (slope, intercept) = volume.rescale();
        let of_value = |value: f64| -> [u8; 2] {
            let solid = thresholds.solid.solid(value);
            [if solid > 0 { thresholds.label(value) } else { 0 }, solid]
        };
        let of_stored = |stored: f64| of_value(slope * stored + intercept);
        let count = volume.voxels().count();
        let (mut labels, mut solid) = (vec![0; count], vec![0; count]);
        // Of 8 and 16 bits every number is looked up; 65,536 results cost less than one slice.
        match volume.voxels() {
            Voxels::U8(voxels) => {
                let table: Vec<_> = (0..=u8::MAX).map(|stored| of_stored(stored.into())).collect();
                classify(voxels, &mut labels, &mut solid, |&stored| table[usize::from(stored)]);
            }
            Voxels::I16(voxels) => {
                let table: Vec<_> = (0..=u16::MAX).map(|bits| of_stored((bits as i16).into())).collect();
                classify(voxels, &mut labels, &mut solid, |&stored| table[usize::from(stored as u16)]);
            }
            Voxels::U16(voxels) => {
                let table: Vec<_> = (0..=u16::MAX).map(|stored| of_stored(stored.into())).collect();
                classify(voxels, &mut labels, &mut solid, |&stored| table[usize::from(stored)]);
            }
            Voxels::F32(voxels) => classify(voxels, &mut labels, &mut solid, |&stored| of_stored(stored.into())),
            Voxels::Rgba(voxels) => {
                classify(voxels, &mut labels, &mut solid, |&[.., opacity]| of_stored(opacity.into()))
            }
        }
        Self::new(bands.iter().map(|band| band.structure.clone()).collect(), labels, solid)
    }
}

/// Label and filling of every voxel, in parallel.
fn classify<T: Sync>(voxels: &[T], labels: &mut [u8], solid: &mut [u8], of: impl Fn(&T) -> [u8; 2] + Sync) {
    const VOXELS_PER_TASK: usize = 1 << 16;
    voxels
        .par_chunks(VOXELS_PER_TASK)
        .zip(labels.par_chunks_mut(VOXELS_PER_TASK).zip(solid.par_chunks_mut(VOXELS_PER_TASK)))
        .for_each(|(voxels, (labels, solid))| {
            for ((voxel, label), solid) in voxels.iter().zip(labels).zip(solid) {
                [*label, *solid] = of(voxel);
            }
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn otsu_parts_two_peaks_in_the_middle_of_the_gap() {
        let mut counts = [0; BINS];
        (counts[40], counts[200]) = (700, 300);
        let (threshold, below, above) = otsu_threshold(&counts, 0.0, 256.0);
        assert!((threshold - 120.5).abs() <= 1.0, "{threshold}");
        assert_eq!((below, above), (40.5, 200.5));
    }

    #[test]
    fn ramps_rise_from_empty_to_full_and_may_be_steps() {
        let ramp = SolidRamp { empty_below: 100.0, full_above: 300.0 };
        assert_eq!([0.0, 100.0, 200.0, 300.0, 9e9].map(|value| ramp.solid(value)), [0, 0, 128, 255, 255]);
        let step = SolidRamp { empty_below: 100.0, full_above: 100.0 };
        assert_eq!([99.9, 100.0].map(|value| step.solid(value)), [0, 255]);
        assert!(SolidRamp { empty_below: 2.0, full_above: 1.0 }.check().is_err());
        assert!(SolidRamp { empty_below: f64::NAN, full_above: 1.0 }.check().is_err());
    }
}
