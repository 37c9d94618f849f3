//! The lattice: an octree of patches over a box, with a translation per vertex (paper of 2001, section 3).
//!
//! Places are shares of the box, from (0, 0, 0) to (1, 1, 1): the texture coordinates of the paper. What is shown at a place is
//! the matter that rests at `place + translation`; translations are interpolated trilinearly inside a patch (equation 2) and
//! go on unchanged beyond the box.
//!
//! - [`Patch`] is a sub-cube, [`Tree`] the octree of them with its vertices and constraints
//! - [`DeformLattice`] adds the translations
//! - [`DeformLattice::check_folds`] says whether there is a way back, and [`LatticeInverse`] is it

mod bounds;
mod field;
mod fold;
mod inverse;
mod saved;
mod tree;

pub use field::DeformLattice;
pub(crate) use field::{map_in, trilinear};
pub use inverse::LatticeInverse;
pub(crate) use saved::SavedTree;
pub(crate) use tree::corner;
pub use tree::{Constraint, Patch, Subdivision, Tree};

/// Deepest level of a patch: 2^6 patches along a side.
pub const MAX_LEVEL: u32 = 6;
