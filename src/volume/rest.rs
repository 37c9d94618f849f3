//! Between places that are shown and the matter at rest, in a volume's own space.

use super::{VolumeGrid, VoxelLattice};
use glam::{Affine3A, Mat3A, Vec3};

/// Leads from where matter is shown to where it rests, and back; in the volume's space, metres.
pub(crate) struct RestMap<'a> {
    lattice: &'a VoxelLattice,
    volume_from_voxel: Affine3A,
    voxel_from_volume: Affine3A,
}

impl<'a> RestMap<'a> {
    pub(crate) fn new(lattice: &'a VoxelLattice, grid: &VolumeGrid) -> Self {
        let volume_from_voxel = grid.volume_from_voxel();
        Self { lattice, volume_from_voxel, voxel_from_volume: volume_from_voxel.inverse() }
    }

    /// Where the matter rests that is shown at a place.
    pub(crate) fn rest(&self, shown_m: Vec3) -> Vec3 {
        let shown = self.voxel_from_volume.transform_point3(shown_m);
        self.volume_from_voxel.transform_point3(self.lattice.rest_from_shown(shown))
    }

    /// Where matter is shown, to a thousandth of a voxel; where there is no such place, nearby.
    pub(crate) fn shown(&self, rest_m: Vec3) -> Vec3 {
        let rest = self.voxel_from_volume.transform_point3(rest_m);
        self.volume_from_voxel.transform_point3(self.lattice.shown_from_rest(rest))
    }

    /// A direction at rest for one that is shown at a place.
    pub(crate) fn rest_direction(&self, shown: Vec3, at_shown_m: Vec3) -> Vec3 {
        let slope = self.lattice.slope_at(self.voxel_from_volume.transform_point3(at_shown_m));
        self.volume_from_voxel.transform_vector3(slope * self.voxel_from_volume.transform_vector3(shown))
    }

    /// A normal that is shown at a place for one at rest, of any length: normals go with the transpose of the way to rest.
    pub(crate) fn shown_normal(&self, rest_normal: Vec3, at_shown_m: Vec3) -> Vec3 {
        let slope = self.lattice.slope_at(self.voxel_from_volume.transform_point3(at_shown_m));
        let rest_from_shown = self.volume_from_voxel.matrix3 * Mat3A::from(slope) * self.voxel_from_volume.matrix3;
        rest_from_shown.transpose() * rest_normal
    }

    /// Length at rest of what is shown as a length of 1, in the mean over all directions: so that a burr removes as much matter
    /// as it covers.
    pub(crate) fn scale_at(&self, shown_m: Vec3) -> f32 {
        let volume = self.lattice.slope_at(self.voxel_from_volume.transform_point3(shown_m)).determinant();
        if volume > 0.0 { volume.cbrt() } else { 1.0 }
    }
}
