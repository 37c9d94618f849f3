//! Translations at the vertices, and the field between them.

use super::saved::SavedLattice;
use super::tree::{Patch, Subdivision, Tree};
use crate::deform::LatticeError;
use bevy::prelude::*;
use glam::{Affine3A, DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// A lattice over the box of a volume or an organ, with a translation per vertex (paper of 2001, section 3).
///
/// At a place `x` of the box the matter is shown that rests at `x + t(x)`, where `t` is interpolated between the vertices
/// (equation 2). Translations are those of texture coordinates: matter moves *against* them, and to drag a vertex is to
/// subtract ([`DeformLattice::drag_vertex`], equation 3). Both are in shares of the box; beyond the box `t` goes on as it is on
/// its side. Vertices on edges and faces of coarser patches are constrained (equations 5 and 6).
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(try_from = "SavedLattice", into = "SavedLattice")]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeformLattice {
    tree: Tree,
    translations: Vec<Vec3>,
    body_from_box: Affine3A,
    box_from_body: Affine3A,
    /// Grows with every change.
    revision: u64,
}

impl DeformLattice {
    /// A lattice at rest over a box of the body's own space, metres; `level` halvings give `2^level` patches along each side.
    pub fn new(low_m: Vec3, high_m: Vec3, level: u32) -> Result<Self, LatticeError> {
        let size = high_m - low_m;
        if !(low_m.is_finite() && size.is_finite() && size.cmpgt(Vec3::ZERO).all()) {
            return Err(LatticeError::EmptyBox { low_m, high_m });
        }
        Self::over(Affine3A::from_scale_rotation_translation(size, Quat::IDENTITY, low_m), level)
    }

    /// A lattice at rest over a box that may be turned: `body_from_box` leads from shares of the box to the body's own space,
    /// metres.
    pub fn over(body_from_box: Affine3A, level: u32) -> Result<Self, LatticeError> {
        Self::over_tree(body_from_box, Tree::uniform(level)?)
    }

    /// The same with given patches.
    pub(crate) fn over_tree(body_from_box: Affine3A, tree: Tree) -> Result<Self, LatticeError> {
        let box_from_body = body_from_box.inverse();
        if !(body_from_box.is_finite() && body_from_box.matrix3.determinant() != 0.0 && box_from_body.is_finite()) {
            let low_m = body_from_box.translation.into();
            return Err(LatticeError::EmptyBox { low_m, high_m: body_from_box.transform_point3(Vec3::ONE) });
        }
        let translations = vec![Vec3::ZERO; tree.vertex_count()];
        Ok(Self { tree, translations, body_from_box, box_from_body, revision: 0 })
    }

    /// Its patches and vertices.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Leads from shares of the box to the body's own space, metres.
    pub fn body_from_box(&self) -> Affine3A {
        self.body_from_box
    }

    /// Leads from the body's own space, metres, to shares of the box.
    pub fn box_from_body(&self) -> Affine3A {
        self.box_from_body
    }

    /// Grows with every change of a translation or of the tree.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Translations of all vertices, in shares of the box.
    pub fn translations(&self) -> &[Vec3] {
        &self.translations
    }

    /// Whether nothing is moved.
    pub fn is_at_rest(&self) -> bool {
        self.translations.iter().all(|translation| *translation == Vec3::ZERO)
    }

    /// Puts everything back to rest; the tree stays.
    pub fn reset(&mut self) {
        self.translations.fill(Vec3::ZERO);
        self.revision += 1;
    }

    /// Sets the translation of a vertex that is not constrained, in shares of the box.
    pub fn set_translation(&mut self, vertex: usize, translation: Vec3) -> Result<(), LatticeError> {
        let count = self.translations.len();
        if vertex >= count {
            return Err(LatticeError::NoVertex { vertex, count });
        }
        if !translation.is_finite() {
            return Err(LatticeError::NotFinite { vertex, translation });
        }
        if let Some(constraint) = self.tree.constraint(vertex) {
            return Err(LatticeError::Constrained { vertex, of: constraint.of.clone() });
        }
        self.translations[vertex] = translation;
        self.follow_constraints();
        Ok(())
    }

    /// Moves the matter at a vertex: its translation is that of texture coordinates, and goes the other way (equation 3).
    pub fn drag_vertex(&mut self, vertex: usize, by: Vec3) -> Result<(), LatticeError> {
        let count = self.translations.len();
        let was = *self.translations.get(vertex).ok_or(LatticeError::NoVertex { vertex, count })?;
        self.set_translation(vertex, was - by)
    }

    /// Sets all translations at once, in shares of the box. Those of constrained vertices do not count: they follow.
    pub fn set_translations(&mut self, translations: &[Vec3]) -> Result<(), LatticeError> {
        if translations.len() != self.translations.len() {
            return Err(LatticeError::WrongCount { found: translations.len(), expected: self.translations.len() });
        }
        let free =
            |(vertex, translation): &(usize, &Vec3)| !translation.is_finite() && !self.tree.is_constrained(*vertex);
        if let Some((vertex, &translation)) = translations.iter().enumerate().find(free) {
            return Err(LatticeError::NotFinite { vertex, translation });
        }
        self.translations.copy_from_slice(translations);
        self.follow_constraints();
        Ok(())
    }

    /// Sets the translations from a function of the vertices' places; both in shares of the box.
    pub fn set_from(&mut self, mut translation_at: impl FnMut(DVec3) -> DVec3) -> Result<(), LatticeError> {
        let made: Vec<Vec3> =
            (0..self.tree.vertex_count()).map(|vertex| translation_at(self.tree.place_of(vertex)).as_vec3()).collect();
        self.set_translations(&made)
    }

    fn follow_constraints(&mut self) {
        for constraint in self.tree.constraints() {
            let sum: Vec3 = constraint.of.iter().map(|&vertex| self.translations[vertex]).sum();
            self.translations[constraint.vertex] = sum / constraint.of.len() as f32;
        }
        self.revision += 1;
    }

    /// Halves a patch, and before it the neighbours that would be too coarse. The field stays as it is.
    pub fn subdivide(&mut self, patch: Patch) -> Result<Subdivision, LatticeError> {
        self.subdivide_all(&[patch])
    }

    /// Halves several patches at once, as [`DeformLattice::subdivide`] does with one.
    pub fn subdivide_all(&mut self, patches: &[Patch]) -> Result<Subdivision, LatticeError> {
        let mut tree = self.tree.clone();
        let did = tree.subdivide_all(patches)?;
        self.translations =
            (0..tree.vertex_count()).map(|vertex| self.translation_at(tree.place_of(vertex)).as_vec3()).collect();
        self.tree = tree;
        self.follow_constraints();
        Ok(did)
    }

    /// The corners' translations of a patch by its number, and its lower corner and side.
    #[inline]
    pub(super) fn patch(&self, number: usize) -> ([DVec3; 8], DVec3, f64) {
        let patch = self.tree.patches()[number];
        let corners = self.tree.corners(number).map(|vertex| self.translation_of(vertex));
        (corners, patch.low(), patch.side())
    }

    /// The translation of a vertex, not rounded: that of a constrained one is exactly the mean of those that it follows, so that the
    /// field has no jumps, not even small ones in which a place would have no way back.
    #[inline]
    fn translation_of(&self, vertex: usize) -> DVec3 {
        let Some(constraint) = self.tree.constraint(vertex) else { return self.translations[vertex].as_dvec3() };
        let sum: DVec3 = constraint.of.iter().map(|&master| self.translations[master].as_dvec3()).sum();
        sum / constraint.of.len() as f64
    }

    /// The translation at a place, both in shares of the box.
    pub fn translation_at(&self, place: DVec3) -> DVec3 {
        self.translation_in(self.tree.patch_at(place), place)
    }

    /// The translation that a patch, by its number, has at a place in it.
    pub fn translation_in(&self, number: usize, place: DVec3) -> DVec3 {
        let (corners, low, side) = self.patch(number);
        let share = ((place - low) / side).clamp(DVec3::ZERO, DVec3::ONE);
        trilinear(corners, share)
    }

    /// Where the matter rests that is shown at a place (equation 2); both in shares of the box.
    pub fn rest_from_shown(&self, place: DVec3) -> DVec3 {
        place + self.translation_at(place)
    }

    /// Derivative of [`DeformLattice::rest_from_shown`] at a place; column `a` is along axis `a`. At a place between patches it is
    /// that of the one behind it.
    pub fn jacobian_at(&self, place: DVec3) -> DMat3 {
        let (corners, low, side) = self.patch(self.tree.patch_at(place));
        map_in(corners, low, side, place).1
    }
}

/// Where `place` plus what the corners of a patch say is, and the derivative of that. Beyond the box nothing changes any more.
#[inline]
pub(crate) fn map_in(corners: [DVec3; 8], low: DVec3, side: f64, place: DVec3) -> (DVec3, DMat3) {
    let share = ((place - low) / side).clamp(DVec3::ZERO, DVec3::ONE);
    let mut slopes = trilinear_slopes(corners, share);
    for axis in 0..3 {
        slopes[axis] = if place[axis] < 0.0 || place[axis] > 1.0 { DVec3::ZERO } else { slopes[axis] / side };
    }
    let slope = DMat3::from_cols(slopes[0], slopes[1], slopes[2]) + DMat3::IDENTITY;
    (place + trilinear(corners, share), slope)
}

/// Between eight corners, x fastest.
#[inline]
pub(crate) fn trilinear(c: [DVec3; 8], share: DVec3) -> DVec3 {
    let (a, b) = (c[0].lerp(c[1], share.x), c[2].lerp(c[3], share.x));
    let (d, e) = (c[4].lerp(c[5], share.x), c[6].lerp(c[7], share.x));
    a.lerp(b, share.y).lerp(d.lerp(e, share.y), share.z)
}

/// Derivatives of [`trilinear`] by the three shares.
#[inline]
pub(crate) fn trilinear_slopes(c: [DVec3; 8], share: DVec3) -> [DVec3; 3] {
    let (a, b) = (c[0].lerp(c[1], share.x), c[2].lerp(c[3], share.x));
    let (d, e) = (c[4].lerp(c[5], share.x), c[6].lerp(c[7], share.x));
    let along_x = |n: usize| c[n + 1] - c[n];
    [
        along_x(0).lerp(along_x(2), share.y).lerp(along_x(4).lerp(along_x(6), share.y), share.z),
        (b - a).lerp(e - d, share.z),
        d.lerp(e, share.y) - a.lerp(b, share.y),
    ]
}
