//! What is written down of a run, all numbers in SI units and the world's space unless they say otherwise.

use crate::scenario::{Scenario, Severity};
use crate::tools::{Tool, ToolCommand, ToolPart, ToolPose};
use bevy::math::{Quat, Vec2, Vec3};
use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// Version of the log's records.
pub const LOG_VERSION: u32 = 1;

/// What is known when a run begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct LogHeader {
    /// [`LOG_VERSION`] of who wrote it.
    pub version: u32,
    /// Version of the crate.
    pub crate_version: String,
    /// The whole scenario, so that the file is complete.
    pub scenario: Scenario,
    /// The patient.
    pub seed: u64,
    /// Steps of the simulation per second; record `n` of step `s` is of the time `s / steps_per_second`.
    pub steps_per_second: f64,
    /// Instruments; records name them by their place here.
    pub tools: Vec<LoggedTool>,
    /// Organs and volumes; records name them by their place here.
    pub bodies: Vec<LoggedBody>,
    /// Who performs it.
    pub trainee: Option<String>,
    /// When it began, ISO 8601.
    pub began: Option<String>,
    /// The run that this one goes on from.
    pub branch: Option<LogBranch>,
}

/// An instrument of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct LoggedTool {
    /// Its name.
    pub name: String,
    /// What it is.
    pub tool: Tool,
}

/// An organ or a volume of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, Reflect)]
pub struct LoggedBody {
    /// Its name.
    pub name: String,
    /// Names of a volume's structures by label, from label 1.
    pub structures: Vec<String>,
    /// Which of them are critical.
    pub critical: Vec<bool>,
    /// Volumes of the structures before the run, mm³, from label 0 (what belongs to none).
    pub volumes_mm3: Vec<f64>,
    /// Middle and half of the extent of its box in the world, metres.
    pub box_world_m: [Vec3; 2],
}

/// Where a run goes on from another one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct LogBranch {
    /// The other run's file.
    pub file: String,
    /// Step up to which both are the same.
    pub step: u64,
}

/// Something that happened in a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct LogEntry {
    /// The step, from 0.
    pub step: u64,
    /// What.
    pub record: LogRecord,
}

/// What can happen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub enum LogRecord {
    /// What the hand did; every step of every tool. A replay needs no more.
    Sample(ToolSample),
    /// An instrument touched something.
    Contact(ContactRecord),
    /// Matter was removed.
    Removal(RemovalRecord),
    /// An organ reacted.
    Reaction(ReactionRecord),
    /// How much bleeds.
    Bleeding(BleedingRecord),
    /// Where the eye was.
    Camera(CameraRecord),
    /// A goal came nearer or was reached.
    Goal(GoalRecord),
    /// A rule was broken.
    Violation(ViolationRecord),
    /// What the whole state was at the end of a second.
    Hash(HashRecord),
    /// The end.
    End(EndRecord),
}

/// What a hand did in a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct ToolSample {
    /// The tool, by its place in the header.
    pub tool: u32,
    /// Where.
    pub pose: ToolPose,
    /// Whether the device said a place that is none; the pose is then the last that was one.
    #[serde(default)]
    pub is_dropped: bool,
    /// What was pressed.
    pub command: ToolCommand,
    /// Forces that its device measured, by the body's place in the header; none where it has no device.
    pub forces_n: Option<Vec<(u32, Vec3)>>,
    /// Force of the burr on bone that its device measured, newtons.
    pub drilling_n: Option<f32>,
    /// Force with which all bodies press on it, as the contacts say, newtons.
    pub contact_n: f32,
    /// Distance of the tip from the nearest critical structure, metres, where it is near one.
    pub critical_m: Option<f32>,
}

/// An instrument touches a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct ContactRecord {
    /// The tool.
    pub tool: u32,
    /// The body.
    pub body: u32,
    /// Label of the structure, for a volume.
    pub label: Option<u8>,
    /// Place on an organ's map.
    pub uv: Option<Vec2>,
    /// Which part of the tool.
    pub part: ToolPart,
    /// Whether it begins (or lasts): false where it ends.
    pub is_on: bool,
    /// Where, metres.
    pub point_m: Vec3,
    /// How deep, metres.
    pub depth_m: f32,
    /// Force, newtons.
    pub force_n: f32,
}

/// A burr removed matter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct RemovalRecord {
    /// The tool.
    pub tool: Option<u32>,
    /// The body.
    pub body: u32,
    /// mm³ per label.
    pub by_label_mm3: Vec<(u8, f64)>,
    /// Where in the mean, metres.
    pub centroid_m: Vec3,
    /// Share of it that the eye could see, 0 to 1 (Sewell).
    pub seen: Option<f32>,
}

/// An organ reacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct ReactionRecord {
    /// The organ.
    pub body: u32,
    /// What happened.
    pub what: String,
    /// Where on its map.
    pub uv: Option<Vec2>,
}

/// How much bleeds; written when it changes noticeably.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct BleedingRecord {
    /// All blood that was lost so far, millilitres.
    pub lost_ml: f64,
    /// What is lost now, millilitres a second.
    pub rate_ml_s: f64,
    /// Places that bleed.
    pub sources: u32,
    /// Share of the pool under which nothing can be seen, 0 to 1; none where there is no pool.
    pub hidden: Option<f32>,
}

/// Where the eye is; written when it moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct CameraRecord {
    /// Where, metres.
    pub eye_world_m: Vec3,
    /// How it is turned; it looks along -Z.
    pub world_from_eye: Quat,
}

/// How far a goal is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct GoalRecord {
    /// Its id.
    pub goal: String,
    /// 0 to 1.
    pub progress: f32,
    /// Whether it is reached.
    pub is_reached: bool,
}

/// A rule was broken.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct ViolationRecord {
    /// Its id.
    pub rule: String,
    /// How bad.
    pub severity: Severity,
    /// By which tool.
    pub tool: Option<u32>,
    /// Where, metres.
    pub point_m: Option<Vec3>,
    /// How much: newtons, metres, millilitres, as the rule has it.
    pub value: f32,
    /// Points that it cost.
    pub penalty: f32,
}

/// What the simulation's state was: each hash is of the state and of the hash before, so one number speaks for all that was.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Reflect)]
pub struct HashRecord {
    /// The second that ends here.
    pub second: u64,
    /// 64 hexadecimal digits.
    pub hash: String,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Reflect)]
pub struct EndRecord {
    /// Why.
    pub reason: EndReason,
    /// Score, 0 to 100.
    pub score: f32,
    /// Whether it was passed.
    pub is_passed: bool,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, Reflect)]
pub enum EndReason {
    /// All goals are reached.
    Done,
    /// No time is left.
    OutOfTime,
    /// The trainee or the program ended it.
    Stopped,
}

/// A whole run in memory.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct RunLog {
    /// What was known when it began.
    pub header: LogHeader,
    /// What happened, in order.
    pub entries: Vec<LogEntry>,
    /// Whether the file ends where it should; false where the program did not come to its end.
    pub is_complete: bool,
}

impl RunLog {
    /// The time of a step, seconds.
    pub fn time_s(&self, step: u64) -> f64 {
        step as f64 / self.header.steps_per_second
    }
}
