//! What deforms: a lattice over a volume or an organ (paper of 2001).

mod error;
mod gradient;
pub mod lattice;

pub use error::LatticeError;
pub use gradient::{AffineField, NormalDeformation};
pub use lattice::{DeformLattice, LatticeInverse, Patch, Subdivision};
