//! What is measured of a run.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// A metric that a scenario asks for, and how it counts.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricChoice {
    /// Its name in reports; none for its usual one.
    #[serde(default)]
    pub name: Option<String>,
}
