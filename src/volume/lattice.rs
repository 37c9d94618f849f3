//! A deforming lattice in the voxel coordinates of a volume: what the passes, their twins on the CPU and tools read of it.

use super::VolumeGrid;
use crate::deform::{AffineField, DeformLattice, NormalDeformation};
use bevy::reflect::Reflect;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3, Vec3};

/// The field of a [`DeformLattice`] over a volume, in voxel coordinates: what is shown at a place rests at the place plus the
/// translation there. The translations are those of the lattice's vertices on a full grid; between them the field is the same.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct VoxelLattice {
    cells: u32,
    /// Translations in voxels, x fastest.
    nodes: Vec<Vec3>,
    node_from_voxel: Affine3A,
    slopes: (Mat3, Mat3),
    normals: NormalDeformation,
    /// What stands for the slope in normals, voxels by voxels: at the nodes or in the cells, or none of them for the field's own.
    matrices: Vec<Mat3>,
}

/// Leads from shares of a lattice's box to the voxel coordinates of a grid.
pub(super) fn voxel_from_box(lattice: &DeformLattice, grid: &VolumeGrid) -> DAffine3 {
    let wide = |affine: Affine3A| DAffine3::from_cols_array(&affine.to_cols_array().map(f64::from));
    wide(grid.volume_from_voxel()).inverse() * wide(lattice.body_from_box())
}

impl VoxelLattice {
    /// The field of a lattice for a grid.
    pub fn new(lattice: &DeformLattice, grid: &VolumeGrid) -> Self {
        let voxel_from_box = voxel_from_box(lattice, grid);
        let (mut nodes, cells) = lattice.dense();
        let turn = voxel_from_box.matrix3.as_mat3();
        for node in &mut nodes {
            *node = turn * *node;
        }
        let node_from_box = DAffine3::from_scale(DVec3::splat(f64::from(cells)));
        let node_from_voxel = (node_from_box * voxel_from_box.inverse()).as_affine3a();
        let slopes = slopes_in_voxels(lattice, voxel_from_box.matrix3);
        let (normals, matrices) = (NormalDeformation::Exact, Vec::new());
        Self { cells, nodes, node_from_voxel, slopes, normals, matrices }
    }

    /// The same with normals from somewhere else than the field itself; of the same lattice and grid.
    pub fn with_normals(mut self, normals: NormalDeformation, lattice: &DeformLattice, grid: &VolumeGrid) -> Self {
        if normals == NormalDeformation::Exact {
            return Self { normals, matrices: Vec::new(), ..self };
        }
        let turn = voxel_from_box(lattice, grid).matrix3;
        let back = turn.inverse();
        let in_voxels = |slope: DMat3| (turn * slope * back).as_mat3();
        // Nodes, or the middles of the cells.
        let (side, shift) = match normals {
            NormalDeformation::Exact => (0, 0.0),
            NormalDeformation::PerPatch => (self.cells, 0.5),
            NormalDeformation::Smoothed => (self.cells + 1, 0.0),
        };
        let affine = AffineField::new(lattice);
        let place = |x: u32, y: u32, z: u32| (glam::UVec3::new(x, y, z).as_dvec3() + shift) / f64::from(self.cells);
        let places = (0..side).flat_map(|z| (0..side).flat_map(move |y| (0..side).map(move |x| (x, y, z))));
        let slope = |(x, y, z)| in_voxels(affine.jacobian_at(lattice, place(x, y, z), normals));
        self.matrices = places.map(slope).collect();
        self.normals = normals;
        self
    }

    /// Where normals come from.
    pub fn normals(&self) -> NormalDeformation {
        self.normals
    }

    /// What stands for the slope in normals, x fastest: in `cells^3` cells for those of the patches, at `(cells + 1)^3` nodes for
    /// smoothed ones, and nothing for the field's own.
    pub fn matrices(&self) -> &[Mat3] {
        &self.matrices
    }

    /// A gradient per voxel at rest, as it is at a place where the matter is shown.
    pub fn shown_gradient(&self, gradient: Vec3, voxel: Vec3) -> Vec3 {
        if self.normals == NormalDeformation::Exact {
            return self.slope_at(voxel).transpose() * gradient;
        }
        let (first, share, is_in) = self.locate(voxel);
        let row = self.cells as usize + usize::from(self.normals == NormalDeformation::Smoothed);
        let product = |n: usize| {
            let at = [n & 1, n >> 1 & 1, n >> 2];
            let place = ((first[2] + at[2]) * row + first[1] + at[1]) * row + first[0] + at[0];
            self.matrices[place].transpose() * gradient
        };
        let sum = if self.normals == NormalDeformation::PerPatch {
            product(0)
        } else {
            let along = |n: usize, axis: usize| if n >> axis & 1 == 1 { share[axis] } else { 1.0 - share[axis] };
            (0..8).map(|n| product(n) * (along(n, 0) * along(n, 1) * along(n, 2))).sum()
        };
        // Beyond the box the field goes on unchanged.
        Vec3::from_array(std::array::from_fn(|axis| if is_in[axis] { sum[axis] } else { gradient[axis] }))
    }

    /// Cells along a side of the lattice.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// Translations in voxels at `(cells + 1)^3` nodes, x fastest.
    pub fn nodes(&self) -> &[Vec3] {
        &self.nodes
    }

    /// Leads from voxel coordinates to those in which the nodes are at whole numbers.
    pub fn node_from_voxel(&self) -> Affine3A {
        self.node_from_voxel
    }

    /// Least and greatest value of each entry of the derivative of the place at rest by the place that is shown, over all places.
    pub fn slopes(&self) -> (Mat3, Mat3) {
        self.slopes
    }

    /// Least and greatest translation along each axis, voxels.
    pub fn translation_bounds(&self) -> (Vec3, Vec3) {
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.nodes.iter().fold(none, |(least, most), node| (least.min(*node), most.max(*node)))
    }

    /// Least and greatest way that the matter at rest goes when the shown place goes a way; voxels.
    #[inline]
    pub fn speeds(&self, way_voxels: Vec3) -> (Vec3, Vec3) {
        let (low, high) = self.slopes;
        (0..3).fold((Vec3::ZERO, Vec3::ZERO), |(slow, fast), axis| {
            let (a, b) = (low.col(axis) * way_voxels[axis], high.col(axis) * way_voxels[axis]);
            (slow + a.min(b), fast + a.max(b))
        })
    }

    /// Where the matter rests that is shown at a place; both in voxel coordinates.
    #[inline]
    pub fn rest_from_shown(&self, voxel: Vec3) -> Vec3 {
        let (corners, share, _) = self.cell_at(voxel);
        let [a, b, c, d, e, f, g, h] = corners;
        let near = a.lerp(b, share.x).lerp(c.lerp(d, share.x), share.y);
        let far = e.lerp(f, share.x).lerp(g.lerp(h, share.x), share.y);
        voxel + near.lerp(far, share.z)
    }

    /// Where the matter is shown that rests at a place, to a thousandth of a voxel; both in voxel coordinates. Where the lattice
    /// folds over itself, one of these places or one nearby: `DeformLattice::inverse` refuses such lattices.
    pub fn shown_from_rest(&self, voxel: Vec3) -> Vec3 {
        let mut shown = voxel * 2.0 - self.rest_from_shown(voxel);
        for _ in 0..16 {
            let missed = voxel - self.rest_from_shown(shown);
            if missed.length_squared() < 1e-6 {
                break;
            }
            let slope = self.slope_at(shown);
            let newton = slope.inverse() * missed;
            // Half the way where the whole one leads away.
            let step = if slope.determinant().abs() > 1e-6 && newton.is_finite() { newton } else { missed };
            let is_better =
                |by: Vec3| (voxel - self.rest_from_shown(shown + by)).length_squared() < missed.length_squared();
            shown += if is_better(step) { step } else { step * 0.4 };
        }
        shown
    }

    /// Derivative of [`VoxelLattice::rest_from_shown`]; column `a` is along axis `a`.
    pub fn slope_at(&self, voxel: Vec3) -> Mat3 {
        let (c, share, is_in) = self.cell_at(voxel);
        let (near_low, near_high) = (c[0].lerp(c[1], share.x), c[2].lerp(c[3], share.x));
        let (far_low, far_high) = (c[4].lerp(c[5], share.x), c[6].lerp(c[7], share.x));
        let along_x = |n: usize| c[n + 1] - c[n];
        let by_node = [
            along_x(0).lerp(along_x(2), share.y).lerp(along_x(4).lerp(along_x(6), share.y), share.z),
            (near_high - near_low).lerp(far_high - far_low, share.z),
            far_low.lerp(far_high, share.y) - near_low.lerp(near_high, share.y),
        ];
        let by_node = [0, 1, 2].map(|axis| if is_in[axis] { by_node[axis] } else { Vec3::ZERO });
        let by_node = Mat3::from_cols(by_node[0], by_node[1], by_node[2]);
        Mat3::IDENTITY + by_node * Mat3::from(self.node_from_voxel.matrix3)
    }

    /// Translations at the corners of the cell of a place, the share of the way through it, and along which axes the place is in
    /// the lattice's box: beyond it nothing changes any more along the way out.
    #[inline]
    fn cell_at(&self, voxel: Vec3) -> ([Vec3; 8], Vec3, [bool; 3]) {
        let (first, share, is_in) = self.locate(voxel);
        let row = self.cells as usize + 1;
        let start = (first[2] * row + first[1]) * row + first[0];
        let corners = std::array::from_fn(|n| self.nodes[start + (n & 1) + (n >> 1 & 1) * row + (n >> 2) * row * row]);
        (corners, share, is_in)
    }

    #[inline]
    fn locate(&self, voxel: Vec3) -> ([usize; 3], Vec3, [bool; 3]) {
        let node = self.node_from_voxel.transform_point3(voxel);
        let last = self.cells as f32;
        let inside = node.clamp(Vec3::ZERO, Vec3::splat(last));
        let first = inside.floor().min(Vec3::splat(last - 1.0));
        let is_in = (node.cmpge(Vec3::ZERO) & node.cmple(Vec3::splat(last))).into();
        (first.to_array().map(|part| part as usize), inside - first, is_in)
    }
}

/// Bounds of the slopes in another basis, by interval arithmetic.
fn slopes_in_voxels(lattice: &DeformLattice, voxel_from_box: DMat3) -> (Mat3, Mat3) {
    let (low, high) = lattice.slope_bounds();
    let back = voxel_from_box.inverse();
    let (mut least, mut most) = (DMat3::ZERO, DMat3::ZERO);
    for column in 0..3 {
        for row in 0..3 {
            for (k, l) in (0..3).flat_map(|k| (0..3).map(move |l| (k, l))) {
                let factor = voxel_from_box.col(k)[row] * back.col(column)[l];
                let (a, b) = (factor * low.col(l)[k], factor * high.col(l)[k]);
                least.col_mut(column)[row] += a.min(b);
                most.col_mut(column)[row] += a.max(b);
            }
        }
    }
    // A little more, for translations that are rounded on their way to the GPU.
    let slack = Mat3::from_cols(Vec3::ONE, Vec3::ONE, Vec3::ONE) * 0.004;
    (least.as_mat3() - slack, most.as_mat3() + slack)
}
