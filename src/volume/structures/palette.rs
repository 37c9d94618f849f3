//! Structures from the colours of a segmented volume.

use super::{Structure, Structures, Tissue};
use crate::volume::error::VolumeFault;
use crate::volume::{Volume, Voxels};
use bevy::reflect::Reflect;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// The colours that a segmented volume is painted with, and what each of them means.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
pub struct Palette {
    /// The structures; each is recognised by its colour.
    pub structures: Vec<Structure>,
    /// A voxel whose nearest colour differs by more steps than this in any channel is counted as off the palette.
    pub tolerance_steps: u8,
    /// Whether segments that overlap were summed byte by byte when the volume was written: where two opaque segments share a
    /// voxel, each of its bytes is the sum of theirs modulo 256, so the opacity is 254. Such voxels go to the critical one of the
    /// two segments, or to the later one in the list where both or none are critical.
    pub overlaps_are_sums: bool,
}

/// How well the colours of a volume fitted a palette.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct SnapReport {
    /// Voxels that are not empty.
    pub coloured: usize,
    /// Of these, voxels with exactly a colour of the palette.
    pub exact: usize,
    /// Of these, voxels recognised as the sum of two overlapping segments.
    pub overlapping: usize,
    /// Of these, voxels farther from every colour than the palette tolerates. They belong to the nearest one all the same.
    pub off_palette: usize,
}

impl AddAssign for SnapReport {
    fn add_assign(&mut self, other: Self) {
        self.coloured += other.coloured;
        self.exact += other.exact;
        self.overlapping += other.overlapping;
        self.off_palette += other.off_palette;
    }
}

impl Palette {
    /// The palette of the segmented temporal bones that the open drilling simulator `volumetric_drilling` uses.
    ///
    /// Critical is what costs the patient hearing, balance, a nerve or blood when a burr touches it: nerves, vessels, dura, the
    /// inner ear, the vestibular aqueduct and the ossicles. Bone, the ear canal and the jaw's joint are not.
    ///
    /// In that data the spaces of the inner ear, the internal and the external auditory canal are painted as filled bodies. They
    /// are drawn, so they count as filled with something soft here as well: what can be seen can be removed. The ear canal is
    /// mostly air in the patient and therefore the softest of all.
    pub fn temporal_bone() -> Self {
        use Tissue::{CorticalBone, Nerve, Soft, Vessel};
        let named = Structure::new;
        let structures = vec![
            named("Bone", [255, 249, 219], CorticalBone),
            named("Malleus", [233, 0, 255], CorticalBone).critical(),
            named("Incus", [0, 255, 149], CorticalBone).critical(),
            named("Stapes", [63, 0, 255], CorticalBone).critical(),
            named("Bony labyrinth", [91, 123, 91], Soft).critical(),
            named("Internal auditory canal", [244, 142, 52], Soft).critical(),
            named("Superior vestibular nerve", [255, 191, 135], Nerve).critical(),
            named("Inferior vestibular nerve", [121, 70, 24], Nerve).critical(),
            named("Cochlear nerve", [219, 244, 52], Nerve).critical(),
            named("Facial nerve", [244, 214, 49], Nerve).critical(),
            named("Chorda tympani", [151, 131, 29], Nerve).critical(),
            named("Internal carotid artery", [216, 100, 79], Vessel).with_bleeding(0.2).critical(),
            // One colour stands for the sinus and the dura: hardness of the membrane, blood of the vessel.
            named("Sinus and dura", [110, 184, 209], Tissue::Dura)
                .with_bleeding(Vessel.typical_bleeding_ml_per_s_mm3())
                .critical(),
            named("Vestibular aqueduct", [91, 98, 123], Soft).critical(),
            named("Temporomandibular joint", [100, 0, 0], CorticalBone),
            named("External auditory canal", [255, 225, 214], Soft).with_hardness(0.02),
        ];
        Self { structures, tolerance_steps: 13, overlaps_are_sums: true }
    }

    /// Which of two structures (places in the list) a voxel goes to that both of them claim.
    fn of_shared(&self, a: usize, b: usize) -> usize {
        let is_critical = |place: usize| self.structures[place].is_critical;
        let (earlier, later) = (a.min(b), a.max(b));
        if is_critical(earlier) && !is_critical(later) { earlier } else { later }
    }
}

/// Colours ready for look-up: for each of 32^3 boxes of the colour cube the few entries that can be the nearest in it.
struct ColourCube {
    colours: Vec<[u8; 3]>,
    labels: Vec<u8>,
    starts: Vec<u32>,
    candidates: Vec<u16>,
}

impl ColourCube {
    const BITS: u32 = 5;
    const SIDE: usize = 1 << Self::BITS;

    fn new(entries: Vec<([u8; 3], u8)>) -> Self {
        let (colours, labels): (Vec<[u8; 3]>, Vec<u8>) = entries.into_iter().unzip();
        let width = 256 / Self::SIDE as i32;
        // Least and greatest squared distance of a colour from a box.
        let reach = |colour: [u8; 3], cell: [usize; 3]| {
            let (mut least, mut greatest) = (0, 0);
            for (channel, place) in colour.into_iter().zip(cell) {
                let (low, high) = (place as i32 * width, (place as i32 + 1) * width - 1);
                let channel = i32::from(channel);
                let outside = (low - channel).max(channel - high).max(0);
                let across = (channel - low).abs().max((high - channel).abs());
                least += outside * outside;
                greatest += across * across;
            }
            (least, greatest)
        };
        let (mut starts, mut candidates) = (vec![0], Vec::new());
        for r in 0..Self::SIDE {
            for g in 0..Self::SIDE {
                for b in 0..Self::SIDE {
                    let limit = colours.iter().map(|&colour| reach(colour, [r, g, b]).1).min().unwrap_or(0);
                    let near = (0..colours.len() as u16).filter(|&entry| {
                        let (least, _) = reach(colours[usize::from(entry)], [r, g, b]);
                        least <= limit
                    });
                    candidates.extend(near);
                    starts.push(candidates.len() as u32);
                }
            }
        }
        Self { colours, labels, starts, candidates }
    }

    /// Label of the nearest colour (of equally near ones the first) and the greatest difference of a channel.
    fn nearest(&self, colour: [u8; 3]) -> (u8, u8) {
        let [r, g, b] = colour.map(|channel| usize::from(channel >> (8 - Self::BITS)));
        let cell = (r * Self::SIDE + g) * Self::SIDE + b;
        let mut best = (i32::MAX, 0);
        for &entry in &self.candidates[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
            let other = self.colours[usize::from(entry)];
            let squared = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
            let distance = squared(colour[0], other[0]) + squared(colour[1], other[1]) + squared(colour[2], other[2]);
            if distance < best.0 {
                best = (distance, usize::from(entry));
            }
        }
        (self.labels[best.1], steps_between(colour, self.colours[best.1]))
    }
}

fn steps_between(a: [u8; 3], b: [u8; 3]) -> u8 {
    (0..3).map(|channel| a[channel].abs_diff(b[channel])).max().unwrap_or(0)
}

impl Structures {
    /// Structures of a coloured volume: every voxel that is not fully transparent belongs to the structure whose colour is the
    /// nearest in sRGB, however far that is; the report says how many were farther off than the palette tolerates. `solid` is
    /// the opacity.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] if the volume has no colours, or the palette is empty or names more than 255 structures.
    pub fn from_palette(volume: &Volume, palette: &Palette) -> Result<(Self, SnapReport), VolumeFault> {
        let bad = |reason: String| Err(VolumeFault::BadGrid { field: "palette".into(), reason });
        let Voxels::Rgba(voxels) = volume.voxels() else {
            return bad("the volume has numbers and no colours".into());
        };
        let list = &palette.structures;
        if list.is_empty() || list.len() > 255 {
            return bad(format!("{} structures; there must be 1 to 255", list.len()));
        }
        let plain: Vec<([u8; 3], u8)> =
            list.iter().enumerate().map(|(place, structure)| (structure.colour, place as u8 + 1)).collect();
        let sums = if palette.overlaps_are_sums { sums_of_pairs(palette) } else { Vec::new() };
        let cube = ColourCube::new(plain);
        let snap = |[r, g, b, opacity]: [u8; 4]| -> (u8, SnapReport) {
            if opacity == 0 {
                return (0, SnapReport::default());
            }
            let colour = [r, g, b];
            let (label, steps) = cube.nearest(colour);
            let mut report = SnapReport { coloured: 1, ..Default::default() };
            if steps == 0 {
                report.exact = 1;
                return (label, report);
            }
            // Sums were rounded on their way into the file, each channel by one step at most.
            if opacity == 254
                && let Some(&(_, label)) = sums.iter().find(|(sum, _)| steps_between(*sum, colour) <= 1)
            {
                report.overlapping = 1;
                return (label, report);
            }
            report.off_palette = usize::from(steps > palette.tolerance_steps);
            (label, report)
        };
        let side = volume.grid().size.x as usize * volume.grid().size.y as usize;
        let (mut labels, mut solid) = (vec![0; voxels.len()], vec![0; voxels.len()]);
        let reports: Vec<SnapReport> = voxels
            .par_chunks(side)
            .zip(labels.par_chunks_mut(side).zip(solid.par_chunks_mut(side)))
            .map(|(voxels, (labels, solid))| {
                let mut report = SnapReport::default();
                // Neighbours mostly have the same colour.
                let mut last = ([0; 4], snap([0; 4]));
                for ((&voxel, label), solid) in voxels.iter().zip(labels).zip(solid) {
                    if voxel != last.0 {
                        last = (voxel, snap(voxel));
                    }
                    *label = last.1.0;
                    *solid = voxel[3];
                    report += last.1.1;
                }
                report
            })
            .collect();
        let mut report = SnapReport::default();
        reports.into_iter().for_each(|part| report += part);
        Ok((Self::new(list.clone(), labels, solid)?, report))
    }
}

/// The colours that two overlapping structures leave, with the label of the one the voxel goes to.
fn sums_of_pairs(palette: &Palette) -> Vec<([u8; 3], u8)> {
    let list = &palette.structures;
    let mut sums = Vec::new();
    for first in 0..list.len() {
        for second in first + 1..list.len() {
            let (a, b) = (list[first].colour, list[second].colour);
            let sum = std::array::from_fn(|channel| a[channel].wrapping_add(b[channel]));
            sums.push((sum, palette.of_shared(first, second) as u8 + 1));
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_finds_the_nearest_colour_everywhere() {
        let palette = Palette::temporal_bone();
        let entries: Vec<_> = palette.structures.iter().enumerate().map(|(i, s)| (s.colour, i as u8 + 1)).collect();
        let cube = ColourCube::new(entries.clone());
        for number in (0..1u32 << 24).step_by(997) {
            let [_, r, g, b] = number.to_be_bytes();
            let squared = |(other, _): &&([u8; 3], u8)| -> i32 {
                (0..3).map(|c| (i32::from(other[c]) - i32::from([r, g, b][c])).pow(2)).sum()
            };
            let direct = entries.iter().min_by_key(squared).map(|entry| entry.1);
            assert_eq!(Some(cube.nearest([r, g, b]).0), direct, "{r} {g} {b}");
        }
    }

    #[test]
    fn a_shared_voxel_goes_to_what_must_not_be_touched() {
        let palette = Palette::temporal_bone();
        let place = |name: &str| palette.structures.iter().position(|structure| structure.name == name).unwrap();
        let shared = |a, b| palette.structures[palette.of_shared(place(a), place(b))].name.as_str();
        assert_eq!(shared("Bone", "Malleus"), "Malleus");
        assert_eq!(shared("Malleus", "Bone"), "Malleus");
        assert_eq!(shared("Facial nerve", "Bony labyrinth"), "Facial nerve");
        assert_eq!(shared("Bone", "External auditory canal"), "External auditory canal");
    }
}
