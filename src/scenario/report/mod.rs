//! The report of a run: what a trainee and a trainer look at afterwards, and what other programs read.
//!
//! [`RunReport::of`] makes it from the log. It is written as JSON (all of it, and read again), as CSV (a long table), as
//! statements of the Experience API ([`xapi`]), and as one page of HTML that needs nothing beside it and prints well.

mod build;
mod csv;
mod html;
mod series;
pub mod xapi;

pub use series::{
    BleedingPoint, ContactSpan, ForcePoint, RemovalDot, ReportBody, ReportSeries, ToolSeries, TrackPoint,
};

use crate::scenario::Severity;
use crate::scenario::log::{EndReason, LogBranch};
use crate::scenario::metrics::Metric;
use bevy::math::Vec3;
use serde::{Deserialize, Serialize};

/// Version of the reports that this crate writes; older ones are read.
pub const REPORT_VERSION: u32 = 1;

/// The report of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// [`REPORT_VERSION`] of who wrote it.
    pub version: u32,
    /// Version of the crate that the run was of.
    pub crate_version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// What it told the trainee.
    pub description: String,
    /// Who performed it.
    pub trainee: Option<String>,
    /// When it began, as the log says.
    pub began: Option<String>,
    /// The patient.
    pub seed: u64,
    /// The run that it goes on from.
    pub branch: Option<LogBranch>,
    /// How it ended.
    pub outcome: Outcome,
    /// The goals, as the scenario orders them.
    pub goals: Vec<GoalReport>,
    /// Each time that a rule was broken, in order.
    pub violations: Vec<ViolationReport>,
    /// What was removed.
    pub structures: Vec<StructureReport>,
    /// What was measured.
    pub metrics: Vec<Metric>,
    /// The metrics' own score, 0 to 1; none where none of them counts.
    pub metrics_score: Option<f64>,
    /// What plots show; its size is bounded, however long the run.
    pub series: ReportSeries,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Why; none where the log does not come to an end.
    pub reason: Option<EndReason>,
    /// Score, 0 to 100.
    pub score: Option<f32>,
    /// Whether it was passed.
    pub is_passed: Option<bool>,
    /// Score from which it is passed.
    pub pass_score: f32,
    /// How long it took, seconds.
    pub time_s: Option<f64>,
    /// How long it may take, seconds.
    pub time_limit_s: Option<f32>,
    /// Whether the log ends where it should.
    pub is_complete: bool,
}

/// A goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GoalReport {
    /// Its id.
    pub id: String,
    /// What trainees were told to do; the id where they were told nothing.
    pub title: String,
    /// Its share of the score, compared with the other goals'.
    pub weight: f32,
    /// 0 to 1, at the end.
    pub progress: f32,
    /// When it was reached first, seconds.
    pub reached_s: Option<f64>,
    /// Whether it is reached at the end.
    pub is_reached: bool,
}

/// A rule was broken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViolationReport {
    /// When, seconds.
    pub time_s: f64,
    /// The rule's id.
    pub rule: String,
    /// What trainees are told; the id where they are told nothing.
    pub message: String,
    /// How bad.
    pub severity: Severity,
    /// By which instrument.
    pub tool: Option<String>,
    /// Where, world, metres.
    pub point_m: Option<Vec3>,
    /// How much.
    pub value: Option<f32>,
    /// Unit of it; empty where the rule has none.
    pub unit: String,
    /// Points that it cost.
    pub penalty: f32,
}

/// What was removed of a structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StructureReport {
    /// Its volume.
    pub body: String,
    /// Its name.
    pub name: String,
    /// Whether it is critical.
    pub is_critical: bool,
    /// Whether a goal asks for its removal.
    pub is_target: bool,
    /// Its volume before the run, mm³, where the log knows it.
    pub before_mm3: Option<f64>,
    /// What was removed of it, mm³.
    pub removed_mm3: f64,
}

/// Why a report cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// It is no report.
    #[error("a report in JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// It was written by a later version.
    #[error("a report in JSON: version {found} is newer than {REPORT_VERSION}, which this program reads")]
    Version {
        /// What it says.
        found: u64,
    },
    /// A statement of the Experience API would break its rules.
    #[error("statements of a report: {field}: {reason}")]
    Statement {
        /// What of the context or the actor.
        field: &'static str,
        /// What is wrong with it.
        reason: String,
    },
}

impl RunReport {
    /// All of it as JSON.
    ///
    /// # Errors
    /// Where it cannot be written as JSON.
    pub fn to_json(&self) -> Result<String, ReportError> {
        Ok(serde_json::to_string_pretty(self)?)
    }

    /// Reads what [`RunReport::to_json`] wrote.
    ///
    /// # Errors
    /// Where it is no report, or one of a later version.
    pub fn from_json(json: &str) -> Result<Self, ReportError> {
        #[derive(Deserialize)]
        struct Versioned {
            version: u64,
        }
        // First, as a later version may have other fields.
        let Versioned { version: found } = serde_json::from_str(json)?;
        if found > u64::from(REPORT_VERSION) {
            return Err(ReportError::Version { found });
        }
        Ok(serde_json::from_str(json)?)
    }
}
