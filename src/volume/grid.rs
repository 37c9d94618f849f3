//! Where the voxels of a volume lie.

use bevy::reflect::Reflect;
use glam::{Affine3A, DAffine3, DMat3, DVec3, UVec3, Vec3};

/// A regular grid of voxels and its place in the patient.
///
/// Voxel `(i, j, k)` has its centre at voxel coordinates `(i, j, k)`, so the grid fills the box from -0.5 to `size - 0.5`.
/// `i` runs fastest in memory. Two spaces beside that of the voxels:
///
/// - *patient*: millimetres, LPS (x to the patient's left, y to the back, z to the head), as in DICOM; where the file says.
/// - *volume*: metres in Bevy's axes, x to the patient's left, y to the head, z to the front, with the origin in the middle
///   of the grid. A volume at the identity transform stands upright and faces a camera on +Z.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct VolumeGrid {
    /// Voxels along i, j and k; none of them is 0.
    pub size: UVec3,
    /// Voxel coordinates to the patient's LPS millimetres.
    pub lps_mm_from_voxel: DAffine3,
}

impl VolumeGrid {
    /// A grid with edges along the volume's axes: spacing in millimetres between the centres of neighbouring voxels, i to the
    /// patient's left, j to the head, k to the front.
    pub fn upright(size: UVec3, spacing_mm: DVec3) -> Self {
        let matrix = Self::LPS_FROM_BEVY * DMat3::from_diagonal(spacing_mm);
        let middle = (size.as_dvec3() - 1.0) * 0.5;
        Self { size, lps_mm_from_voxel: DAffine3::from_mat3_translation(matrix, -(matrix * middle)) }
    }

    /// Directions of Bevy's axes (left, head, front) in LPS (left, back, head).
    const LPS_FROM_BEVY: DMat3 = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::new(0.0, -1.0, 0.0));

    /// Voxel coordinates to the volume's own space in metres.
    pub fn volume_from_voxel(&self) -> Affine3A {
        let matrix = Self::LPS_FROM_BEVY.transpose() * self.lps_mm_from_voxel.matrix3 * 1e-3;
        let middle = (self.size.as_dvec3() - 1.0) * 0.5;
        DAffine3::from_mat3_translation(matrix, -(matrix * middle)).as_affine3a()
    }

    /// Distances between the centres of neighbouring voxels along i, j and k, millimetres.
    pub fn spacing_mm(&self) -> DVec3 {
        let matrix = self.lps_mm_from_voxel.matrix3;
        DVec3::new(matrix.x_axis.length(), matrix.y_axis.length(), matrix.z_axis.length())
    }

    /// Volume of one voxel, cubic millimetres.
    pub fn voxel_mm3(&self) -> f64 {
        self.lps_mm_from_voxel.matrix3.determinant().abs()
    }

    /// Extents of the grid in the volume's space, metres: half of the box's sides along its own axes, as vectors.
    pub fn half_axes_m(&self) -> [Vec3; 3] {
        let matrix = self.volume_from_voxel().matrix3;
        let half = self.size.as_vec3() * 0.5;
        [(matrix.x_axis * half.x).into(), (matrix.y_axis * half.y).into(), (matrix.z_axis * half.z).into()]
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        self.size.x as usize * self.size.y as usize * self.size.z as usize
    }

    /// Place of a voxel in memory.
    pub fn index(&self, voxel: UVec3) -> usize {
        linear_index(self.size, voxel)
    }

    /// All of its voxels.
    pub fn bounds(&self) -> VoxelBox {
        VoxelBox { min: UVec3::ZERO, max: self.size }
    }
}

/// Place in memory of an entry of a grid with a size, x fastest.
#[inline]
pub(crate) fn linear_index(size: UVec3, at: UVec3) -> usize {
    (at.z as usize * size.y as usize + at.y as usize) * size.x as usize + at.x as usize
}

/// A box of voxels: from `min` up to, but without, `max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Reflect)]
pub struct VoxelBox {
    /// First voxel.
    pub min: UVec3,
    /// One past the last voxel.
    pub max: UVec3,
}

impl VoxelBox {
    /// Whether it holds no voxel.
    pub fn is_empty(&self) -> bool {
        self.min.cmpge(self.max).any()
    }

    /// Voxels along each axis.
    pub fn size(&self) -> UVec3 {
        self.max.saturating_sub(self.min)
    }

    /// Number of voxels.
    pub fn count(&self) -> usize {
        let size = self.size();
        size.x as usize * size.y as usize * size.z as usize
    }

    /// The smallest box around both.
    pub fn union(&self, other: &Self) -> Self {
        if self.is_empty() {
            return *other;
        }
        if other.is_empty() {
            return *self;
        }
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both hold.
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Grown by some voxels on all sides, within a grid of a size.
    pub fn grown(&self, by: u32, size: UVec3) -> Self {
        Self {
            min: self.min.saturating_sub(UVec3::splat(by)),
            max: self.max.saturating_add(UVec3::splat(by)).min(size),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_upright_grid_has_bevys_axes_and_its_middle_at_the_origin() {
        let grid = VolumeGrid::upright(UVec3::new(4, 6, 9), DVec3::new(1.0, 2.0, 0.5));
        let volume_from_voxel = grid.volume_from_voxel();
        let middle = volume_from_voxel.transform_point3(Vec3::new(1.5, 2.5, 4.0));
        assert!(middle.length() < 1e-9, "{middle}");
        let step = volume_from_voxel.transform_vector3(Vec3::new(1.0, 1.0, 1.0));
        assert!((step - Vec3::new(1e-3, 2e-3, 0.5e-3)).length() < 1e-9, "{step}");
        assert!((grid.voxel_mm3() - 1.0).abs() < 1e-12);
        assert!((grid.spacing_mm() - DVec3::new(1.0, 2.0, 0.5)).length() < 1e-12);
    }

    #[test]
    fn patients_stand_upright_and_face_the_viewer() {
        // A scan whose voxels run left, back and head, as scanners write it.
        let grid = VolumeGrid { size: UVec3::splat(3), lps_mm_from_voxel: DAffine3::IDENTITY };
        let volume_from_voxel = grid.volume_from_voxel();
        let direction = |voxel| volume_from_voxel.transform_vector3(voxel) * 1e3;
        assert!((direction(Vec3::X) - Vec3::X).length() < 1e-6, "left");
        assert!((direction(Vec3::Y) - Vec3::NEG_Z).length() < 1e-6, "back");
        assert!((direction(Vec3::Z) - Vec3::Y).length() < 1e-6, "head");
    }

    #[test]
    fn boxes_unite_intersect_and_grow() {
        let a = VoxelBox { min: UVec3::new(1, 2, 3), max: UVec3::new(4, 5, 6) };
        let none = VoxelBox { min: UVec3::splat(7), max: UVec3::splat(7) };
        assert_eq!(a.union(&none), a);
        assert_eq!(none.union(&a), a);
        assert!(a.intersection(&none).is_empty());
        assert_eq!(a.intersection(&none).count(), 0);
        assert_eq!(a.grown(2, UVec3::splat(5)), VoxelBox { min: UVec3::new(0, 0, 1), max: UVec3::splat(5) });
        assert_eq!(a.count(), 27);
    }
}
