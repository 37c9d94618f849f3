//! How a volume is shown.

use crate::deform::NormalDeformation;
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Most clip planes of a volume.
pub const MAX_CLIP_PLANES: usize = 6;
/// Most passes over the normals.
pub const MAX_SMOOTHING_PASSES: u32 = 16;

/// How the voxels become a picture. Both ways sample the same planes and give the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum VolumeMethod {
    /// A ray per pixel, which skips empty space and stops where nothing shines through any more. The faster one.
    #[default]
    Rays,
    /// Slices across the view, blended back to front (paper of 2009, section 5).
    Slices,
    /// Slices across an axis of the lattice, cut out of its patches, blended front to back (paper of 2001, section 4): only the
    /// lattice's vertices travel when it moves, and the field between them is that of four triangles per patch and slice.
    PatchSlices,
}

/// Which normals are smoothed (paper of 2009, figure 7).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum SmoothedNormals {
    /// None: dry, and every voxel glitters.
    None,
    /// Those of the reflections: a thin film of fluid over a surface that keeps its grain.
    #[default]
    Reflections,
    /// All: the grain is lost.
    All,
}

/// Wet shading of a volume (paper of 2009, section 5.4).
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct WetShading {
    /// Whether light falls on it at all; otherwise it shows its own colours.
    pub is_shaded: bool,
    /// Which normals are smoothed.
    pub smoothed: SmoothedNormals,
    /// Passes over the 3x3 neighbours of each pixel, at most [`MAX_SMOOTHING_PASSES`].
    pub passes: u32,
    /// Difference in depth, in voxels, from which on a neighbour does not count. Edges higher than this stay sharp.
    pub edge_voxels: f32,
    /// Strength of the reflections: 0 is dry, 1 a film of water that is even; more suits a film that is not.
    pub shine: f32,
    /// Blinn-Phong exponent of the reflections.
    pub shine_exponent: f32,
}

impl Default for WetShading {
    fn default() -> Self {
        Self {
            is_shaded: true,
            smoothed: SmoothedNormals::Reflections,
            passes: 4,
            edge_voxels: 4.0,
            shine: 1.6,
            shine_exponent: 140.0,
        }
    }
}

/// How a [`CtVolume`](super::CtVolume) is shown. What it shows is up to its
/// [`TransferFunction`](super::transfer::TransferFunction).
///
/// Numbers out of range are clamped where they are used; for those that are not finite the default's are taken.
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[serde(default)]
pub struct VolumeLook {
    /// Rays or slices.
    pub method: VolumeMethod,
    /// Distance between samples along the view, in lengths of a voxel's shortest edge; 0.25 to 4.
    pub step_voxels: f32,
    /// Half spaces of the volume's own space (metres) of which only the inside is drawn: `normal . p + offset >= 0`, as
    /// `(normal, offset)`. At most [`MAX_CLIP_PLANES`] count.
    pub clip_planes: Vec<Vec4>,
    /// Where the normals of a volume come from that a [`DeformLattice`](crate::deform::DeformLattice) deforms.
    pub deformed_normals: NormalDeformation,
    /// Light and reflections.
    pub wet: WetShading,
}

impl Default for VolumeLook {
    fn default() -> Self {
        Self {
            method: VolumeMethod::Rays,
            step_voxels: 1.0,
            clip_planes: Vec::new(),
            deformed_normals: NormalDeformation::Exact,
            wet: WetShading::default(),
        }
    }
}

impl VolumeLook {
    /// The clip planes that count: at most [`MAX_CLIP_PLANES`], without those that have no direction or are no numbers.
    pub(crate) fn cutting_planes(&self) -> impl Iterator<Item = Vec4> {
        let has_direction = |plane: &Vec4| plane.is_finite() && plane.truncate().length_squared() > 0.0;
        self.clip_planes.iter().copied().filter(has_direction).take(MAX_CLIP_PLANES)
    }

    /// The distance between samples that is used, in lengths of a voxel's shortest edge.
    pub fn sane_step_voxels(&self) -> f32 {
        if self.step_voxels.is_finite() { self.step_voxels.clamp(0.25, 4.0) } else { 1.0 }
    }
}
