//! A procedural temporal bone: a phantom to drill where no scan is at hand.

mod anatomy;
mod body;
mod cells;
mod ear;
mod fill;
mod interpolated;
mod noise;
mod shapes;

use super::error::VolumeFault;
use super::structures::Structures;
use super::{Volume, VolumeGrid, Voxels};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{DVec3, UVec3};
use serde::{Deserialize, Serialize};

/// Side of the phantom's cube, millimetres.
pub const PHANTOM_SIDE_MM: f64 = 48.0;
/// Least and greatest number of voxels along a side.
pub const PHANTOM_SIZES: std::ops::RangeInclusive<u32> = 32..=512;

/// What phantom to make.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct PhantomOptions {
    /// Voxels along each side of the cube, within [`PHANTOM_SIZES`].
    pub size: u32,
    /// Another bone for each number: other cells and surface, sinus, tegmen and antrum shifted by up to 0.8 mm. The same number
    /// gives the same bone at every size.
    pub seed: u64,
    /// Share of the mastoid's cells that hold air, 0 (a sclerotic mastoid) to 1. Around the antrum it is about this; outwards it
    /// falls by a third.
    pub pneumatization: f32,
}

impl Default for PhantomOptions {
    fn default() -> Self {
        Self { size: 256, seed: 1, pneumatization: 0.96 }
    }
}

/// Makes a phantom of a right temporal bone, in Hounsfield units with its structures named.
///
/// It stands as it lies under the microscope: the mastoid's outer surface faces +Z, +Y is towards the top of the head and +X to
/// the front. (Its grid is upright in a patient whose left side is +X, so the patient's axes of the grid mean nothing.) Under a
/// cortex of 2 to 3 mm lie air cells that grow towards the antrum; behind them the sigmoid sinus under its plate, above them the
/// tegmen with the dura, in front the ear canal with the drum, the middle ear with its three ossicles, and beneath the otic
/// capsule with three canals, vestibule and cochlea. The facial nerve runs from the inner auditory canal over its two bends down
/// to its foramen, with the chorda tympani branching off; the carotid artery passes in front.
///
/// The same options give the same bits, for any number of threads. All sizes show the same bone: voxels are filled by the share
/// of them that a structure takes.
///
/// # Errors
/// [`VolumeFault::BadGrid`] for a size beyond [`PHANTOM_SIZES`] or a pneumatization that is no number.
pub fn phantom(options: &PhantomOptions) -> Result<Volume, VolumeFault> {
    let bad = |field: &str, reason: String| Err(VolumeFault::BadGrid { field: field.into(), reason });
    let size = options.size;
    if !PHANTOM_SIZES.contains(&size) {
        return bad("size", format!("{size}; a phantom has {PHANTOM_SIZES:?} voxels along a side"));
    }
    if options.pneumatization.is_nan() {
        return bad("pneumatization", "it is no number".into());
    }
    /// Samples along the cube's side from which on surfaces and thin walls come out right.
    const ENOUGH_SAMPLES: u32 = 256;
    let lattice = fill::Lattice {
        size,
        samples: ENOUGH_SAMPLES.div_ceil(size),
        side_mm: PHANTOM_SIDE_MM as f32,
        noise: options.seed as u32 ^ 0x9a17,
    };
    let voxels = fill::fill(&anatomy::Anatomy::new(options), &lattice);
    let grid = VolumeGrid::upright(UVec3::splat(size), DVec3::splat(PHANTOM_SIDE_MM / f64::from(size)));
    let structures = Structures::new(anatomy::structures(), voxels.labels, voxels.solid)?;
    Volume::new(grid, Voxels::I16(voxels.hu), 1.0, 0.0)?.with_structures(structures)
}
