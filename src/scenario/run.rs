//! A run of a scenario: who performs it, how far it is, what it says.

use super::hash::HashChain;
use super::judge::{Facts, GoalState, Judge, RuleState};
use super::log::{CameraRecord, EndRecord, LogBranch, LogEntry, LogError, LogHeader, LogRecord, LogWriter, RunLog};
use super::observe::Observed;
use super::replay::Replay;
use super::scene::SceneState;
use super::seek::{Checkpoints, Seek};
use super::{Scenario, ScenarioError};
use bevy::prelude::*;
use std::path::{Path, PathBuf};

/// A scenario that is performed. Insert it to begin one; as long as the scene is not all there, the world stands still, so that every
/// run begins alike. Remove it to end it without a score.
#[derive(Resource)]
pub struct ScenarioRun {
    pub(super) scenario: Scenario,
    /// The scenario for this patient.
    pub(super) played: Scenario,
    pub(super) file: String,
    pub(super) seed: u64,
    pub(super) trainee: Option<String>,
    pub(super) began: Option<String>,
    pub(super) record_to: Option<PathBuf>,
    pub(super) keeps_log: bool,
    pub(super) replay: Option<Replay>,
    pub(super) branch: Option<LogBranch>,
    pub(super) phase: RunPhase,
    pub(super) is_stopped: bool,
    pub(super) scene: SceneState,
    pub(super) step: u64,
    pub(super) steps_per_second: f64,
    pub(super) judge: Judge,
    pub(super) observed: Option<Observed>,
    pub(super) chain: HashChain,
    pub(super) facts: Facts,
    pub(super) eye: Option<CameraRecord>,
    /// Where the eye is as a log says: turned into matrices and back it would be a hair elsewhere.
    pub(super) led_eye: Option<CameraRecord>,
    pub(super) writer: Option<LogWriter>,
    /// Steps that are in the log, and whether its end is.
    written: u64,
    is_written: bool,
    pub(super) log_fault: Option<LogError>,
    pub(super) log: Option<RunLog>,
    pub(super) seek: Option<Seek>,
    pub(super) checkpoints: Checkpoints,
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum RunPhase {
    /// The scene is being loaded.
    Waiting,
    /// It is performed.
    Running,
    /// It is over.
    Ended(EndRecord),
    /// It cannot be performed in this scene.
    Refused(ScenarioError),
}

impl ScenarioRun {
    /// A run of a scenario by a hand that is there.
    pub fn new(scenario: Scenario) -> Self {
        let judge = Judge::new(&scenario.for_patient(scenario.patient.seed));
        Self {
            seed: scenario.patient.seed,
            file: format!("scenario \"{}\"", scenario.name),
            played: scenario.for_patient(scenario.patient.seed),
            scenario,
            trainee: None,
            began: None,
            record_to: None,
            keeps_log: false,
            replay: None,
            branch: None,
            phase: RunPhase::Waiting,
            is_stopped: false,
            scene: SceneState::default(),
            step: 0,
            steps_per_second: 0.0,
            judge,
            observed: None,
            chain: HashChain::default(),
            facts: Facts::default(),
            eye: None,
            led_eye: None,
            writer: None,
            written: 0,
            is_written: false,
            log_fault: None,
            log: None,
            seek: None,
            checkpoints: Checkpoints::default(),
        }
    }

    /// The same run again, from its log: the hand is that of the log. In the same scene it is the same to the bit, on the CPU's back
    /// ends.
    pub fn replay(log: RunLog) -> Self {
        let (scenario, seed) = (log.header.scenario.clone(), log.header.seed);
        let mut run = Self::new(scenario).with_seed(seed);
        run.replay = Some(Replay::new(log, None));
        run
    }

    /// A run that is the same as that of a log up to a time, and goes on from there with a hand that is there.
    ///
    /// # Errors
    /// The log ends before that time.
    pub fn retry_at(log: RunLog, file: &Path, time_s: f64) -> Result<Self, ScenarioError> {
        let last_s = log.entries.last().map_or(0.0, |entry| log.time_s(entry.step));
        if !(0.0..=last_s).contains(&time_s) {
            return Err(ScenarioError::Field {
                file: file.display().to_string(),
                field: "retry at".into(),
                reason: format!("{time_s} s is not in the run, which lasts {last_s:.1} s"),
            });
        }
        let step = (time_s * log.header.steps_per_second).round() as u64;
        let (scenario, seed) = (log.header.scenario.clone(), log.header.seed);
        let mut run = Self::new(scenario).with_seed(seed);
        run.branch = Some(LogBranch { file: file.display().to_string(), step });
        run.replay = Some(Replay::new(log, Some(step)));
        Ok(run)
    }

    /// What messages call the scenario: its file.
    pub fn named(mut self, file: impl Into<String>) -> Self {
        self.file = file.into();
        self
    }

    /// Another patient.
    pub fn with_seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self.played = self.scenario.for_patient(seed);
        self.judge = Judge::new(&self.played);
        self
    }

    /// Who performs it, for the report.
    pub fn by(mut self, trainee: impl Into<String>) -> Self {
        self.trainee = Some(trainee.into());
        self
    }

    /// When it begins, ISO 8601, for the report.
    pub fn begun_at(mut self, time: impl Into<String>) -> Self {
        self.began = Some(time.into());
        self
    }

    /// Writes its log to a file, which must not be there yet.
    pub fn recorded_to(mut self, file: impl Into<PathBuf>) -> Self {
        self.record_to = Some(file.into());
        self
    }

    /// Keeps its log in memory: some megabytes a minute. See [`log`](Self::log).
    pub fn kept(mut self) -> Self {
        self.keeps_log = true;
        self
    }

    /// Ends it after this step, with the score that it then has.
    pub fn stop(&mut self) {
        self.is_stopped = true;
    }

    /// The scenario, as it is for this patient.
    #[allow(clippy::misnamed_getters, reason = "the one that was asked for is nobody else's")]
    pub fn scenario(&self) -> &Scenario {
        &self.played
    }

    /// The step that is being performed, if one is.
    pub(super) fn running_step(&self) -> Option<u64> {
        (self.phase == RunPhase::Running).then_some(self.step)
    }

    /// The step of a time.
    pub(super) fn step_of(&self, time_s: f32) -> u64 {
        (f64::from(time_s) * self.steps_per_second).round() as u64
    }

    /// Whether something will still happen by itself.
    pub(super) fn has_events_left(&self) -> bool {
        self.played.events.iter().any(|event| self.step_of(event.at_s) >= self.step)
    }

    /// The patient.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// How far it is.
    pub fn phase(&self) -> &RunPhase {
        &self.phase
    }

    /// How it ended, when it has.
    pub fn end(&self) -> Option<&EndRecord> {
        match &self.phase {
            RunPhase::Ended(end) => Some(end),
            _ => None,
        }
    }

    /// Steps that it has lasted.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// How long that is, seconds.
    pub fn time_s(&self) -> f64 {
        if self.steps_per_second > 0.0 { self.step as f64 / self.steps_per_second } else { 0.0 }
    }

    /// The score so far, 0 to 100.
    pub fn score(&self) -> f32 {
        self.judge.score(&self.played)
    }

    /// The goals so far, in the scenario's order.
    pub fn goals(&self) -> &[GoalState] {
        self.judge.goals()
    }

    /// The rules so far, in the scenario's order.
    pub fn rules(&self) -> &[RuleState] {
        self.judge.rules()
    }

    /// The judge.
    pub fn judge(&self) -> &Judge {
        &self.judge
    }

    /// What was known of the last step.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }

    /// The log so far, of a run that [keeps](Self::kept) it: also of what was [gone back](Self::seek_to) over.
    pub fn log(&self) -> Option<&RunLog> {
        self.log.as_ref()
    }

    /// Why the log's file is not written any more, if it is not.
    pub fn log_fault(&self) -> Option<&LogError> {
        self.log_fault.as_ref()
    }

    /// Of a replay, the first second in which it was not the same as the run that it repeats.
    pub fn diverged_s(&self) -> Option<u64> {
        self.replay.as_ref().and_then(|replay| replay.diverged_s)
    }

    /// Whether the hand is the log's now.
    pub fn is_replaying(&self) -> bool {
        self.replay.as_ref().is_some_and(|replay| replay.leads(self.step))
    }

    /// Begins to write.
    pub(super) fn open_log(&mut self, header: LogHeader) {
        if let Some(file) = &self.record_to {
            match LogWriter::create(file, &header) {
                Ok(writer) => self.writer = Some(writer),
                Err(fault) => self.fail_log(fault),
            }
        }
        if self.keeps_log {
            self.log = Some(RunLog { header, entries: Vec::new(), is_complete: false });
        }
    }

    /// Writes a step.
    pub(super) fn write(&mut self, mut entries: Vec<LogEntry>) {
        // After a jump back the same steps come once more; they are written already.
        if self.step < self.written {
            entries.retain(|entry| matches!(entry.record, LogRecord::End(_)) && !self.is_written);
        }
        self.written = self.written.max(self.step + 1);
        if let Some(log) = &mut self.log {
            log.entries.extend(entries.iter().cloned());
        }
        if let Some(Err(fault)) = self.writer.as_mut().map(|writer| writer.write(entries)) {
            self.fail_log(fault);
        }
    }

    /// Ends the log.
    pub(super) fn close_log(&mut self) {
        self.is_written = true;
        if let Some(log) = &mut self.log {
            log.is_complete = true;
        }
        if let Some(Err(fault)) = self.writer.take().map(LogWriter::finish) {
            self.fail_log(fault);
        }
    }

    fn fail_log(&mut self, fault: LogError) {
        tracing::error!("the run is not written down: {fault}");
        self.writer = None;
        self.log_fault = Some(fault);
    }
}
