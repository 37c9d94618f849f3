//! Structures for a volume that came without any.

use super::palette::Palette;
use super::thresholds::Thresholds;
use super::{Structure, Structures, Tissue};
use crate::volume::error::VolumeFault;
use crate::volume::{Volume, Voxels};
use rayon::prelude::*;

/// Share of the coloured voxels that may miss the temporal bone's palette if the volume is still painted with it.
const OFF_PALETTE_SHARE: f64 = 0.01;
/// Colours with fewer voxels than this share of the coloured ones are no structures of their own.
const STRONG_SHARE: f64 = 1e-4;
/// Distinct colours that a segmentation has at most; beyond, the colours are those of a photograph.
const MOST_COLOURS: usize = 40;
/// Share of the voxels that the strong colours must cover together in a segmentation.
const SEGMENTED_SHARE: f64 = 0.98;

impl Structures {
    /// What can be said about any volume:
    ///
    /// - structures it came with are taken as they are;
    /// - colours are snapped to [`Palette::temporal_bone`] if at least 99 % of the voxels are within its tolerance and more than
    ///   one of its structures occurs; otherwise every strong colour is a structure ("colour #ffe1d6") if few colours make up
    ///   98 % of the volume; otherwise all is one "Tissue";
    /// - values that look like Hounsfield units (some below -500 and some above 800) are parted by [`Thresholds::bone_hu`];
    /// - other values by [`Thresholds::otsu`].
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] is passed on from the constructors; a [`Volume`] that could be built gives none.
    pub fn for_volume(volume: &Volume) -> Result<Self, VolumeFault> {
        if let Some(structures) = volume.structures() {
            return Ok(structures.as_ref().clone());
        }
        let Voxels::Rgba(voxels) = volume.voxels() else {
            return Self::from_thresholds(volume, &thresholds_for(volume));
        };
        let (snapped, report) = Self::from_palette(volume, &Palette::temporal_bone())?;
        let mut occurs = [false; 256];
        snapped.labels.iter().for_each(|&label| occurs[usize::from(label)] = true);
        let several = occurs[1..].iter().filter(|&&occurs| occurs).count() > 1;
        if several && report.off_palette as f64 <= OFF_PALETTE_SHARE * report.coloured as f64 {
            return Ok(snapped);
        }
        let palette = Palette { structures: strong_colours(voxels), tolerance_steps: 255, overlaps_are_sums: false };
        Ok(Self::from_palette(volume, &palette)?.0)
    }
}

/// Bone in Hounsfield units, or whatever is bright.
fn thresholds_for(volume: &Volume) -> Thresholds {
    let [least, greatest] = volume.range();
    if least < -500.0 && greatest > 800.0 { Thresholds::bone_hu() } else { Thresholds::otsu(volume) }
}

/// One structure per colour of a segmentation, or a single one with the mean colour; in descending order of voxels.
fn strong_colours(voxels: &[[u8; 4]]) -> Vec<Structure> {
    const BITS: u32 = 5;
    const BINS: usize = 1 << (3 * BITS);
    // Count and sums of the channels per box of the colour cube.
    let empty = || vec![[0u64; 4]; BINS];
    let bins = voxels
        .par_chunks(1 << 18)
        .fold(empty, |mut bins, voxels| {
            for &[r, g, b, opacity] in voxels {
                if opacity > 0 {
                    let bin = [r, g, b].into_iter().fold(0, |bin, c| (bin << BITS) | usize::from(c >> (8 - BITS)));
                    let add = [1, r.into(), g.into(), b.into()];
                    bins[bin] = std::array::from_fn(|place| bins[bin][place] + add[place]);
                }
            }
            bins
        })
        .reduce(empty, |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a = std::array::from_fn(|place| a[place] + b[place]));
            a
        });
    let total: u64 = bins.iter().map(|bin| bin[0]).sum();
    let mean = |[count, r, g, b]: [u64; 4]| [r, g, b].map(|sum| ((sum + count / 2) / count.max(1)) as u8);
    let mut strong: Vec<[u64; 4]> =
        bins.iter().filter(|bin| bin[0] > 0 && bin[0] as f64 >= STRONG_SHARE * total as f64).copied().collect();
    // A stable sort: equal counts keep the order of their colours.
    strong.sort_by_key(|bin| std::cmp::Reverse(bin[0]));
    let covered: u64 = strong.iter().map(|bin| bin[0]).sum();
    let is_segmentation = strong.len() <= MOST_COLOURS && covered as f64 >= SEGMENTED_SHARE * total as f64;
    if strong.len() > 1 && is_segmentation {
        return strong
            .into_iter()
            .map(|bin| {
                let [r, g, b] = mean(bin);
                Structure::new(format!("colour #{r:02x}{g:02x}{b:02x}"), [r, g, b], Tissue::CorticalBone)
            })
            .collect();
    }
    let sum = bins.iter().fold([0; 4], |sum, bin| std::array::from_fn(|place| sum[place] + bin[place]));
    vec![Structure::new("Tissue", mean(sum), Tissue::CorticalBone)]
}
