//! What deforms: a lattice over a volume or an organ (paper of 2001).

mod animate;
pub mod elastic;
mod error;
mod fit;
mod gradient;
pub mod lattice;
mod organs;
mod plugin;

pub use animate::{KeyFrame, KeyFrames, KeyInterpolation, LatticeAnimation, LatticeMotion, TravellingWave};
pub use error::LatticeError;
pub use fit::FitReport;
pub use gradient::{AffineField, NormalDeformation};
pub use lattice::{DeformLattice, LatticeInverse, Patch, Subdivision};
pub use organs::OrganRide;
pub use plugin::{DeformBodies, DeformPlugin};
