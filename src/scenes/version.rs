//! Which version of the crate's components a saved scene was written with.

use bevy::prelude::*;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The version of the crate's components in saved scenes. Saved scenes carry it among their resources, and after loading it is
/// that of the scene that was loaded last.
///
/// The minor one grows when a component or field gets another name or goes; scenes of older ones load. The major one grows when
/// scenes of before can no longer be read. A field that is new needs neither: it takes its default.
#[derive(
    Resource, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect, Serialize, Deserialize,
)]
#[reflect(Resource, Default, Clone)]
pub struct SceneVersion {
    /// Scenes of another one cannot be read.
    pub major: u32,
    /// Scenes of older ones can be read.
    pub minor: u32,
}

impl SceneVersion {
    /// What this version of the crate writes.
    pub const NOW: Self = Self { major: 0, minor: 1 };
}

impl fmt::Display for SceneVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}
