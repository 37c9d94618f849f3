//! What deforms: a lattice over a volume or an organ (paper of 2001).

mod error;
pub mod lattice;

pub use error::LatticeError;
pub use lattice::{DeformLattice, LatticeInverse, Patch, Subdivision};
