//! What is measured of a run. The formulas are plain functions, a subject a file; [`measure`] applies them to a log.
//!
//! Values are in SI units, volumes in mm³, blood in ml. A metric about which a run says nothing has no value: a number that is
//! none never gets into a report.

mod evidence;
pub mod force;
mod kind;
mod measure;
pub mod motion;
pub mod seen;
pub mod smoothness;
pub mod strokes;
pub mod suction;
pub mod volume;

pub(crate) use evidence::{Evidence, Track};
pub use kind::MetricKind;
pub use measure::{measure, weighted_score};

use bevy::prelude::App;
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// A metric that a scenario asks for, and how it counts: `(metric: PathLength, weight: 1.0, best: 2.0, worst: 8.0)`.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MetricChoice {
    /// Which.
    pub metric: MetricKind,
    /// Its name in reports; none for its usual one.
    #[serde(default)]
    pub name: Option<String>,
    /// Its share of the metrics' score, compared with the other metrics'; 0 for information only.
    #[serde(default)]
    pub weight: f32,
    /// Value of a perfect run, in the metric's unit. Its score is 1 from here on.
    #[serde(default)]
    pub best: f32,
    /// Value with a score of 0; below or above `best`. The same as `best`: it has no score.
    #[serde(default)]
    pub worst: f32,
}

impl MetricChoice {
    /// For information only, under its usual name.
    pub fn new(metric: MetricKind) -> Self {
        Self { metric, name: None, weight: 0.0, best: 0.0, worst: 0.0 }
    }

    /// 0 to 1, linear between worst and best; none where both are the same, or one is no number.
    pub fn score(&self, value: f64) -> Option<f64> {
        let (best, worst) = (f64::from(self.best), f64::from(self.worst));
        let share = (value - worst) / (best - worst);
        share.is_finite().then(|| share.clamp(0.0, 1.0))
    }
}

/// A metric of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Metric {
    /// Which.
    pub kind: MetricKind,
    /// Its name.
    pub name: String,
    /// Unit of its values.
    pub unit: String,
    /// Its value; none where the run says nothing about it.
    pub value: Option<f64>,
    /// The same by instrument or by structure, where that means something.
    pub by: Vec<MetricPart>,
    /// Its share of the metrics' score, compared with the other metrics'.
    pub weight: f64,
    /// 0 to 1; none where the scenario does not say what is good, or there is no value.
    pub score: Option<f64>,
    /// How it is computed, in a line.
    pub formula: String,
}

/// A metric's value for one instrument or structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MetricPart {
    /// The instrument or structure.
    pub name: String,
    /// The value.
    pub value: f64,
}

pub(super) fn register(app: &mut App) {
    app.register_type::<MetricKind>().register_type::<MetricChoice>();
}
