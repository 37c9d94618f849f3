//! Lattices as scenes save them: the box, the patches, the translations.

use super::{DeformLattice, Patch, Tree};
use crate::deform::LatticeError;
use glam::{Affine3A, Vec3};
use serde::{Deserialize, Serialize};

/// What a [`DeformLattice`] is made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct SavedLattice {
    body_from_box: Affine3A,
    tree: SavedTree,
    /// None where nothing is moved.
    #[serde(default)]
    translations: Vec<Vec3>,
}

/// What a [`Tree`] is made of.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) enum SavedTree {
    /// All patches are of one level.
    Uniform(u32),
    /// The patches.
    Patches(Vec<Patch>),
}

impl From<&Tree> for SavedTree {
    fn from(tree: &Tree) -> Self {
        if tree.is_uniform() { Self::Uniform(tree.deepest()) } else { Self::Patches(tree.patches().to_vec()) }
    }
}

impl TryFrom<SavedTree> for Tree {
    type Error = LatticeError;

    fn try_from(saved: SavedTree) -> Result<Self, LatticeError> {
        match saved {
            SavedTree::Uniform(level) => Self::uniform(level),
            SavedTree::Patches(patches) => Self::of_patches(&patches),
        }
    }
}

impl From<DeformLattice> for SavedLattice {
    fn from(lattice: DeformLattice) -> Self {
        let translations = if lattice.is_at_rest() { Vec::new() } else { lattice.translations().to_vec() };
        Self { body_from_box: lattice.body_from_box(), tree: lattice.tree().into(), translations }
    }
}

impl TryFrom<SavedLattice> for DeformLattice {
    type Error = LatticeError;

    fn try_from(saved: SavedLattice) -> Result<Self, LatticeError> {
        let mut lattice = Self::over_tree(saved.body_from_box, saved.tree.try_into()?)?;
        if !saved.translations.is_empty() {
            lattice.set_translations(&saved.translations)?;
        }
        Ok(lattice)
    }
}
