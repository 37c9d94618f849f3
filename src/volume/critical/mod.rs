//! How far it is to what must not be hurt.

mod distance;
mod transform;

pub use distance::{CriticalDistances, MAX_BAND_MM, StructureDistance};
