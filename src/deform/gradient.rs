//! What a deformation does to gradients and to light (paper of 2001, section 5).
//!
//! The map is one of texture coordinates: at `x` the matter is shown that rests at `Phi(x)`. A value `v` at rest is shown as
//! `v(Phi(x))`, so its gradient in space is `A^T n`, where `n` is the gradient at rest and `A` the Jacobian of `Phi`, or what
//! stands for it. (The paper's equation 12 has the inverse of `A`, because it thinks of matter that is moved by `A`.) Equation 13
//! then reads `(A^T n) . l = n . (A l)`: instead of all gradients, turn the light into the patch by `A`.

use super::lattice::{DeformLattice, Tree, trilinear};
use bevy::ecs::VariantDefaults;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use glam::{DMat3, DVec3, Mat3};
use serde::{Deserialize, Serialize};

/// How the deformation of gradients is found: what stands for the Jacobian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
#[reflect(Clone, Debug, Default, PartialEq, Hash)]
pub enum NormalDeformation {
    /// One affine map per patch, the nearest to the field (equations 7 to 10). It jumps between patches, which shows as facets
    /// (figure 7, centre).
    PerPatch,
    /// The mean of the patches' maps at each vertex, interpolated between the vertices (figure 7, right): as the paper does it.
    /// No jumps, but blurred: farther from the normals of the surface that is shown than the patches' own are, and nearer to
    /// those of a smooth field that a fine lattice follows.
    Smoothed,
    /// The Jacobian of the field itself at every place: what the surface has that is shown.
    #[default]
    Exact,
}

/// The affine maps nearest to a lattice's field, per patch and averaged at the vertices: their linear parts `A`.
///
/// Light directions need no list of their own: averaging and interpolating are linear, so the interpolated map turns any light
/// into what the paper gets by turning it at the vertices and interpolating that.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct AffineField {
    per_patch: Vec<Mat3>,
    at_vertices: Vec<Mat3>,
}

impl AffineField {
    /// Those of a lattice as it is now.
    pub fn new(lattice: &DeformLattice) -> Self {
        let mut made = Self { per_patch: Vec::new(), at_vertices: Vec::new() };
        made.update(lattice);
        made
    }

    /// Finds them anew, in the memory that it has.
    pub fn update(&mut self, lattice: &DeformLattice) {
        let tree = lattice.tree();
        self.per_patch.clear();
        self.at_vertices.clear();
        self.at_vertices.resize(tree.vertex_count(), Mat3::ZERO);
        let mut shares = vec![0_u8; tree.vertex_count()];
        for number in 0..tree.patches().len() {
            let affine = nearest_affine(lattice, number);
            self.per_patch.push(affine);
            for vertex in tree.corners(number) {
                self.at_vertices[vertex] += affine;
                shares[vertex] += 1;
            }
        }
        for (sum, count) in self.at_vertices.iter_mut().zip(shares) {
            *sum *= 1.0 / f32::from(count);
        }
        // What hangs on a coarser patch follows it in this too, or there would be gaps in the light.
        for constraint in tree.constraints() {
            let sum: Mat3 = constraint.of.iter().map(|&master| self.at_vertices[master]).sum();
            self.at_vertices[constraint.vertex] = sum * (1.0 / constraint.of.len() as f32);
        }
    }

    /// `A` of each patch, in the order of their numbers.
    pub fn per_patch(&self) -> &[Mat3] {
        &self.per_patch
    }

    /// The mean of the patches' `A` at each vertex; constrained vertices follow.
    pub fn at_vertices(&self) -> &[Mat3] {
        &self.at_vertices
    }

    /// What stands for the Jacobian at a place of the lattice that this was made of. Beyond the box, where the field goes on
    /// unchanged, its columns are those of the identity.
    pub fn jacobian_at(&self, lattice: &DeformLattice, place: DVec3, by: NormalDeformation) -> DMat3 {
        let number = lattice.tree().patch_at(place);
        let mut affine = match by {
            NormalDeformation::Exact => return lattice.jacobian_at(place),
            NormalDeformation::PerPatch => self.per_patch[number].as_dmat3(),
            NormalDeformation::Smoothed => self.smoothed_in(lattice.tree(), number, place),
        };
        for axis in 0..3 {
            if place[axis] < 0.0 || place[axis] > 1.0 {
                *affine.col_mut(axis) = DVec3::AXES[axis];
            }
        }
        affine
    }

    /// The matrix that leads from gradients at rest to gradients in space, at a place: the transposed
    /// [`AffineField::jacobian_at`]. Both gradients are by shares of the box; normalize after it.
    pub fn space_from_rest_gradient(&self, lattice: &DeformLattice, place: DVec3, by: NormalDeformation) -> DMat3 {
        self.jacobian_at(lattice, place, by).transpose()
    }

    /// The averaged maps, interpolated inside a patch.
    pub fn smoothed_in(&self, tree: &Tree, number: usize, place: DVec3) -> DMat3 {
        let patch = tree.patches()[number];
        let share = ((place - patch.low()) / patch.side()).clamp(DVec3::ZERO, DVec3::ONE);
        let corners = tree.corners(number).map(|vertex| self.at_vertices[vertex].as_dmat3());
        let column = |axis: usize| trilinear(corners.map(|corner| corner.col(axis)), share);
        DMat3::from_cols(column(0), column(1), column(2))
    }
}

/// The linear part of the affine map that is nearest to the field at the eight corners of a patch (equations 7 to 10).
///
/// With the origin in the middle of the patch, corners lie at plus and minus half a side along each axis, so `M` is diagonal: twice
/// the squared side for the linear part, and 8 for the translation. What is left of equation 10 are sums of the corners' images
/// with weights of plus and minus a quarter of a side: eight multiplications for each entry, or one after adding up. It is the
/// field's Jacobian in the middle of the patch.
fn nearest_affine(lattice: &DeformLattice, number: usize) -> Mat3 {
    let tree = lattice.tree();
    let corners = tree.corners(number).map(|vertex| lattice.translations()[vertex]);
    let weight = 0.25 / tree.patches()[number].side() as f32;
    // The corners' own places give the identity.
    let column = |bit: usize| {
        (0..8).filter(|n| n & bit != 0).map(|n| corners[n] - corners[n ^ bit]).sum::<glam::Vec3>() * weight
    };
    Mat3::IDENTITY + Mat3::from_cols(column(1), column(2), column(4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deform::lattice::corner;
    use glam::{DMat4, DVec4, Vec3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    /// Equation 10 as it stands: `A^T` from the inverse of `M` and the sum of products, in homogenous coordinates.
    fn by_equation_10(lattice: &DeformLattice, number: usize) -> (DMat3, DVec3) {
        let patch = lattice.tree().patches()[number];
        let outer = |a: DVec4, b: DVec4| DMat4::from_cols(a * b.x, a * b.y, a * b.z, a * b.w);
        let (mut m, mut products) = (DMat4::ZERO, DMat4::ZERO);
        for n in 0..8 {
            let place = patch.low() + corner(n).as_dvec3() * patch.side();
            let x = place.extend(1.0);
            m += outer(x, x);
            products += outer(x, (place + lattice.translation_in(number, place)).extend(1.0));
        }
        let affine = (m.inverse() * products).transpose();
        (DMat3::from_mat4(affine), affine.w_axis.truncate())
    }

    #[test]
    fn eight_multiplications_are_the_least_squares() {
        let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a lattice");
        lattice.subdivide(lattice.tree().patches()[3]).expect("it is there");
        let mut random = Pcg32::seed_from_u64(1);
        let mut part = || random.random_range(-0.2..0.2);
        lattice.set_from(|_| DVec3::new(part(), part(), part())).expect("numbers");
        for number in 0..lattice.tree().patches().len() {
            let (affine, _) = by_equation_10(&lattice, number);
            let ours = nearest_affine(&lattice, number).as_dmat3();
            assert!((ours - affine).abs_diff_eq(DMat3::ZERO, 1e-5), "{ours} and {affine}");
            let patch = lattice.tree().patches()[number];
            let middle = lattice.jacobian_at(patch.low() + 0.5 * patch.side());
            assert!((ours - middle).abs_diff_eq(DMat3::ZERO, 1e-5), "{ours} and {middle}");
        }
    }
}
