//! What a scenario says: patient, instruments, goals, rules, guidance, and how all of it counts.

use super::metrics::MetricChoice;
use crate::reactions::Wound;
use crate::tools::Tool;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// Version of the files that this crate writes; older ones are read.
pub const SCENARIO_VERSION: u32 = 1;

/// A training scenario: an asset, in files that end in `.scenario.ron`.
#[derive(Asset, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Clone)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// [`SCENARIO_VERSION`] of who wrote it.
    pub version: u32,
    /// What trainees know it by.
    pub name: String,
    /// What they are told before they begin.
    #[serde(default)]
    pub description: String,
    /// What is there.
    #[serde(default)]
    pub scene: ScenarioScene,
    /// How one patient differs from another.
    #[serde(default)]
    pub patient: PatientVariation,
    /// The instruments that may be used, by the names that messages and reports call them. None: what the scene has.
    #[serde(default)]
    pub tools: Vec<ScenarioTool>,
    /// What happens by itself.
    #[serde(default)]
    pub events: Vec<PatientEvent>,
    /// After so many seconds it is over.
    #[serde(default)]
    pub time_limit_s: Option<f32>,
    /// What is to be done.
    pub goals: Vec<Goal>,
    /// What must not be done.
    #[serde(default)]
    pub rules: Vec<Rule>,
    /// What trainees are told meanwhile.
    #[serde(default)]
    pub guidance: Guidance,
    /// What is measured for the report, and how it counts. None: all that can be, for information.
    #[serde(default)]
    pub metrics: Vec<MetricChoice>,
    /// Score from which it is passed, 0 to 100.
    #[serde(default = "pass_score")]
    pub pass_score: f32,
}

fn pass_score() -> f32 {
    70.0
}

/// What a scenario is played in.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ScenarioScene {
    /// What the program has put there by itself.
    #[default]
    Own,
    /// The procedural liver in the abdomen.
    Liver,
    /// The phantom of a temporal bone, under a pool.
    TemporalBone,
    /// A saved world ([`scene_text`](crate::scenes::scene_text)) by its asset path, a file that ends in `.surgery.scn.ron`. Tools of the
    /// scenario that it holds are those. Needs the feature `scenes`.
    World(String),
}

/// How patients differ: the same seed is the same patient.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PatientVariation {
    /// Says which patient; the program may choose another one.
    pub seed: u64,
    /// How much patients differ, 0 (not at all) to 1.
    pub amount: f32,
}

/// Something that happens in a patient, whatever the trainee does. A run is not over before the last of them.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PatientEvent {
    /// When, seconds from the beginning.
    #[serde(default)]
    pub at_s: f32,
    /// What.
    pub what: PatientEventKind,
}

/// What can happen in a patient.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum PatientEventKind {
    /// A vessel on an organ opens.
    Bleed {
        /// The organ.
        organ: String,
        /// Texture coordinates of the place.
        uv: Vec2,
        /// How it bleeds.
        wound: Wound,
    },
}

/// An instrument with a name.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioTool {
    /// Its name.
    pub name: String,
    /// What it is.
    #[serde(default)]
    pub tool: Tool,
}

/// Something that is to be done.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// What the log calls it; each goal of a scenario has another name.
    pub id: String,
    /// What trainees are told to do.
    #[serde(default)]
    pub title: String,
    /// What it is.
    pub kind: GoalKind,
    /// Its share of the score, compared with the other goals'.
    #[serde(default = "one")]
    pub weight: f32,
    /// Goals that must be reached before this one counts, by their ids.
    #[serde(default)]
    pub after: Vec<String>,
}

fn one() -> f32 {
    1.0
}

/// What is to be done. Structures are named as in the volume's [`Structures`](crate::volume::structures::Structures) or by the
/// `Name` of an organ.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum GoalKind {
    /// The tip of any instrument comes near a structure.
    Reach {
        /// The structure.
        structure: String,
        /// How near, metres.
        within_m: f32,
    },
    /// So much of a structure's surface can be seen from where the trainee looks, with nothing in front of it but
    /// a thin cover.
    Expose {
        /// The structure.
        structure: String,
        /// Share of what of it is turned to the eye, 0 to 1.
        share: f32,
        /// How much matter may be left over it, metres.
        cover_m: f32,
    },
    /// So much of a structure is removed.
    Remove {
        /// The structure.
        structure: String,
        /// Share of its volume, 0 to 1.
        share: f32,
    },
    /// Places on an organ are touched with the tip of an instrument, each for a while.
    Mark {
        /// The organ.
        organ: String,
        /// The places.
        lesions: Vec<Lesion>,
        /// How long each is touched, seconds.
        for_s: f32,
    },
    /// Places on an organ are coagulated.
    Coagulate {
        /// The organ.
        organ: String,
        /// The places.
        lesions: Vec<Lesion>,
        /// Share of their area that is coagulated, 0 to 1.
        share: f32,
    },
    /// Nothing bleeds faster than this, for a while.
    StopBleeding {
        /// Blood from all that bleeds, millilitres a second.
        below_ml_s: f32,
        /// How long, seconds.
        for_s: f32,
    },
    /// The view is kept: so much of the pool lets what is under it be seen, for so much of the time.
    KeepVisible {
        /// Share of the pool, 0 to 1.
        share: f32,
        /// Share of the time, 0 to 1.
        of_time: f32,
    },
}

/// A place on an organ.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lesion {
    /// Texture coordinates of its middle.
    pub uv: Vec2,
    /// Its radius, metres.
    pub radius_m: f32,
}

/// Something that must not be done.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// What the log calls it; each rule of a scenario has another name.
    pub id: String,
    /// What trainees are told when they break it.
    #[serde(default)]
    pub message: String,
    /// What it is.
    pub kind: RuleKind,
    /// Points of 100 that each time costs.
    #[serde(default)]
    pub penalty: f32,
    /// Points that it can cost at most.
    #[serde(default)]
    pub most: Option<f32>,
    /// How bad it is.
    #[serde(default)]
    pub severity: Severity,
}

/// How bad a violation is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Reflect, Serialize, Deserialize)]
pub enum Severity {
    /// The trainee is told.
    Warning,
    /// A mistake.
    #[default]
    Error,
    /// The scenario is not passed, whatever else is done.
    Failure,
}

/// What must not be done. Structures are named as in [`GoalKind`].
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum RuleKind {
    /// An instrument touches a structure.
    Touch {
        /// The structure.
        structure: String,
    },
    /// More of a structure is removed than this.
    Cut {
        /// The structure.
        structure: String,
        /// Volume, mm³.
        above_mm3: f32,
    },
    /// An instrument presses too hard near a structure.
    Force {
        /// The structure.
        structure: String,
        /// How near, metres.
        within_m: f32,
        /// Force, newtons.
        above_n: f32,
    },
    /// A tip moves too fast near a structure.
    Speed {
        /// The structure.
        structure: String,
        /// How near, metres.
        within_m: f32,
        /// Metres a second.
        above_m_per_s: f32,
    },
    /// A burr that turns comes too near a structure.
    Near {
        /// The structure.
        structure: String,
        /// How near, metres.
        within_m: f32,
    },
    /// A burr that turns is too large for what is near.
    BurrTooLarge {
        /// The structure.
        structure: String,
        /// How near, metres.
        within_m: f32,
        /// Diameter, metres.
        above_m: f32,
    },
    /// Matter is removed that cannot be seen.
    DrilledUnseen {
        /// Volume in one go, mm³.
        above_mm3: f32,
    },
    /// Two instruments touch each other.
    Collision,
    /// An organ is burnt where it should not be.
    BurntOutside {
        /// The organ.
        organ: String,
        /// Where it may be.
        lesions: Vec<Lesion>,
        /// Area elsewhere, mm².
        above_mm2: f32,
    },
    /// Too much blood is lost.
    BloodLoss {
        /// Millilitres.
        above_ml: f32,
    },
    /// The time is over before the goals are reached.
    OutOfTime,
}

/// What trainees are told while they work. What is always on does not teach: each can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Guidance {
    /// All of it.
    pub is_on: bool,
    /// Warnings of near structures.
    pub distances: bool,
    /// Warnings of forces.
    pub forces: bool,
    /// How much was removed.
    pub removed: bool,
    /// How well one sees.
    pub visibility: bool,
    /// What comes next.
    pub next_step: bool,
}

impl Default for Guidance {
    fn default() -> Self {
        Self { is_on: true, distances: true, forces: true, removed: true, visibility: true, next_step: true }
    }
}
