//! Millimetres along the axes of a grid.

use super::super::grid::VolumeGrid;
use glam::{DMat3, DVec3, Vec3};

/// The frame that drilling computes in: millimetres from the centre of voxel (0, 0, 0), turned so that rows of voxels run
/// along x and planes of rows lie across z. `mm = upper * voxel` with an upper triangular matrix (a QR decomposition of the
/// grid's axes), diagonal unless the grid is skewed. Lengths and angles are those of the volume's space, whatever the grid.
pub(super) struct GridFrame {
    /// Columns; below the diagonal 0, on it positive.
    pub upper: DMat3,
    mm_from_volume: DMat3,
    origin_m: DVec3,
    pub voxel_mm3: f64,
    /// Edge of a cube of a voxel's volume.
    pub ramp_mm: f64,
    /// Whether voxels are cubes, to two percent.
    pub is_isotropic: bool,
}

impl GridFrame {
    pub fn new(grid: &VolumeGrid) -> Self {
        let volume_from_voxel = grid.volume_from_voxel();
        let axes_mm = glam::Mat3::from(volume_from_voxel.matrix3).as_dmat3() * 1e3;
        // Gram-Schmidt; a left-handed grid comes out mirrored, which changes no burr.
        let x = axes_mm.x_axis.normalize();
        let y = (axes_mm.y_axis - x * x.dot(axes_mm.y_axis)).normalize();
        let across = x.cross(y);
        let z = across * across.dot(axes_mm.z_axis).signum();
        let mm_from_volume = DMat3::from_cols(x, y, z).transpose();
        let mut upper = mm_from_volume * axes_mm;
        let [a, b, c] = [upper.x_axis.x, upper.y_axis.y, upper.z_axis.z];
        let largest = a.max(b).max(c);
        // Single precision leaves crumbs off the diagonal; a skew so small moves nothing by a hundredth of a voxel.
        let cleaned = |entry: f64| if entry.abs() < 4e-6 * largest { 0.0 } else { entry };
        upper.x_axis = DVec3::new(a, 0.0, 0.0);
        upper.y_axis = DVec3::new(cleaned(upper.y_axis.x), b, 0.0);
        upper.z_axis = DVec3::new(cleaned(upper.z_axis.x), cleaned(upper.z_axis.y), c);
        let is_upright = upper == DMat3::from_diagonal(DVec3::new(a, b, c));
        Self {
            upper,
            mm_from_volume,
            origin_m: volume_from_voxel.translation.as_dvec3(),
            voxel_mm3: grid.voxel_mm3(),
            ramp_mm: (a * b * c).cbrt(),
            is_isotropic: is_upright && largest < 1.02 * a.min(b).min(c),
        }
    }

    pub fn point_mm(&self, volume_m: Vec3) -> DVec3 {
        self.mm_from_volume * ((volume_m.as_dvec3() - self.origin_m) * 1e3)
    }

    pub fn direction(&self, volume: Vec3) -> DVec3 {
        self.mm_from_volume * volume.as_dvec3()
    }

    /// The part of a path from `from` to `to` within `reach_mm` of the grid, from 0 to 1; none if it passes by.
    pub fn clip(&self, size: DVec3, from: DVec3, to: DVec3, reach_mm: f64) -> Option<[f64; 2]> {
        let voxel_from_mm = self.upper.inverse();
        let (from, to) = (voxel_from_mm * from, voxel_from_mm * to);
        let rows = voxel_from_mm.transpose();
        let reach = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length()) * reach_mm;
        let (low, high) = (-reach - 0.5, size - 0.5 + reach);
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (start, along) = (from[axis], to[axis] - from[axis]);
            if along == 0.0 {
                if start < low[axis] || start > high[axis] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((low[axis] - start) / along, (high[axis] - start) / along);
            first = first.max(a.min(b));
            last = last.min(a.max(b));
        }
        (first <= last).then_some([first, last])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, DQuat, UVec3};

    #[test]
    fn distances_survive_any_grid() {
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0));
        let skewed =
            DMat3::from_cols(DVec3::new(0.3, 0.0, 0.0), DVec3::new(0.05, 0.4, 0.0), DVec3::new(0.1, -0.2, 0.8));
        let mirrored = skewed * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        for axes in [DMat3::from_diagonal(DVec3::splat(0.2)), turn * skewed, turn * mirrored] {
            let grid = VolumeGrid {
                size: UVec3::new(40, 50, 60),
                lps_mm_from_voxel: DAffine3::from_mat3_translation(axes, DVec3::new(5.0, 7.0, -90.0)),
            };
            let frame = GridFrame::new(&grid);
            assert!(frame.upper.determinant() > 0.0);
            assert!((frame.upper.determinant() - frame.voxel_mm3).abs() < 1e-6);
            for voxel in [Vec3::ZERO, Vec3::new(12.0, 3.5, 40.0), Vec3::new(39.0, 0.0, 59.0)] {
                let point_m = grid.volume_from_voxel().transform_point3(voxel);
                let error = frame.point_mm(point_m) - frame.upper * voxel.as_dvec3();
                assert!(error.length() < 1e-5, "{error}");
            }
        }
    }

    #[test]
    fn paths_are_cut_to_what_can_touch_the_grid() {
        let frame = GridFrame::new(&VolumeGrid::upright(UVec3::splat(10), DVec3::ONE));
        let size = DVec3::splat(10.0);
        let clip = |from, to| frame.clip(size, from, to, 2.0);
        assert_eq!(clip(DVec3::splat(3.0), DVec3::splat(3.0)), Some([0.0, 1.0]));
        assert_eq!(clip(DVec3::splat(-3.0), DVec3::splat(-3.0)), None);
        let [first, last] = clip(DVec3::new(-102.5, 5.0, 5.0), DVec3::new(97.5, 5.0, 5.0)).expect("through");
        assert!((first - 0.5).abs() < 1e-6 && (last - 0.57).abs() < 1e-6, "{first} {last}");
        assert_eq!(clip(DVec3::new(-100.0, 50.0, 5.0), DVec3::new(100.0, 50.0, 5.0)), None);
    }
}
