//! Goals, rules and the score: plain Rust that looks at [`Facts`], step by step.

mod facts;
mod goals;
mod rules;
mod targets;

pub use facts::{Facts, LesionFacts, RemovalFacts, StructureFacts, ToolFacts};
pub use goals::GoalState;
pub use rules::RuleState;
pub use targets::{TargetLesions, TargetStructure, Targets};

use super::log::{EndReason, EndRecord, GoalRecord, LogRecord, ViolationRecord};
use super::{RuleKind, Scenario, Severity};
use rules::Breach;

/// A goal's progress is told of when it has changed by so much.
const TOLD: f32 = 0.1;

/// Judges a run of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Judge {
    targets: Targets,
    goals: Vec<GoalState>,
    told: Vec<(f32, bool)>,
    rules: Vec<RuleState>,
    has_failed: bool,
    time_s: f64,
}

impl Judge {
    /// Begins a run.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            targets: Targets::of(scenario),
            goals: vec![GoalState::default(); scenario.goals.len()],
            told: vec![(0.0, false); scenario.goals.len()],
            rules: vec![RuleState::default(); scenario.rules.len()],
            has_failed: false,
            time_s: 0.0,
        }
    }

    /// What the scenario names.
    pub fn targets(&self) -> &Targets {
        &self.targets
    }

    /// The goals so far, in the scenario's order.
    pub fn goals(&self) -> &[GoalState] {
        &self.goals
    }

    /// The rules so far, in the scenario's order.
    pub fn rules(&self) -> &[RuleState] {
        &self.rules
    }

    /// Whether a goal's turn has come: all that must be reached before it are.
    pub fn is_open(&self, scenario: &Scenario, goal: usize) -> bool {
        let is_reached = |id: &String| {
            scenario.goals.iter().zip(&self.goals).any(|(goal, state)| goal.id == *id && state.is_reached)
        };
        scenario.goals.get(goal).is_some_and(|goal| goal.after.iter().all(is_reached))
    }

    /// Looks at a step; gives what is to be told of it, and the end where it ends the run.
    pub fn step(&mut self, scenario: &Scenario, facts: &Facts) -> (Vec<LogRecord>, Option<EndReason>) {
        self.time_s += f64::from(facts.dt_s);
        let mut told = Vec::new();
        for (place, goal) in scenario.goals.iter().enumerate() {
            // What was reached stays open, also if a goal before it is lost again.
            if !(self.is_open(scenario, place) || self.goals[place].is_reached) {
                continue;
            }
            let state = &mut self.goals[place];
            state.step(goal, &self.targets, facts);
            let (progress, is_reached) = &mut self.told[place];
            if *is_reached != state.is_reached || (*progress - state.progress).abs() >= TOLD {
                (*progress, *is_reached) = (state.progress, state.is_reached);
                told.push(LogRecord::Goal(GoalRecord {
                    goal: goal.id.clone(),
                    progress: state.progress,
                    is_reached: state.is_reached,
                }));
            }
        }
        for (rule, state) in scenario.rules.iter().zip(&mut self.rules) {
            if let Some(breach) = state.step(rule, &self.targets, facts) {
                self.has_failed |= rule.severity == Severity::Failure;
                told.push(violation(rule, state, breach));
            }
        }
        let limit_s = scenario.time_limit_s.map_or(f64::INFINITY, f64::from);
        let end = if self.goals.iter().all(|goal| goal.is_reached) {
            Some(EndReason::Done)
        } else {
            (self.time_s >= limit_s - 0.5 * f64::from(facts.dt_s)).then_some(EndReason::OutOfTime)
        };
        (told, end)
    }

    /// Ends a run: what is only known now, and the score.
    pub fn end(&mut self, scenario: &Scenario, reason: EndReason) -> Vec<LogRecord> {
        let mut told = Vec::new();
        for (rule, state) in scenario.rules.iter().zip(&mut self.rules) {
            if rule.kind == RuleKind::OutOfTime && reason == EndReason::OutOfTime {
                state.count += 1;
                self.has_failed |= rule.severity == Severity::Failure;
                let breach = Breach { value: self.time_s as f32, times: 1, ..Breach::default() };
                told.push(violation(rule, state, breach));
            }
        }
        let score = self.score(scenario);
        let is_passed = self.is_passed(scenario);
        told.push(LogRecord::End(EndRecord { reason, score, is_passed }));
        told
    }

    /// The score now: the weighted share of the goals, less what violations cost, 0 to 100.
    pub fn score(&self, scenario: &Scenario) -> f32 {
        let total: f32 = scenario.goals.iter().map(|goal| goal.weight).sum();
        let reached: f32 =
            scenario.goals.iter().zip(&self.goals).map(|(goal, state)| goal.weight * state.progress).sum();
        let cost: f32 = self.rules.iter().map(|state| state.cost).sum();
        (100.0 * reached / total.max(1e-9) - cost).clamp(0.0, 100.0)
    }

    /// Whether the run would be passed if it ended now.
    pub fn is_passed(&self, scenario: &Scenario) -> bool {
        !self.has_failed && self.score(scenario) >= scenario.pass_score
    }
}

fn violation(rule: &super::Rule, state: &mut RuleState, breach: Breach) -> LogRecord {
    LogRecord::Violation(ViolationRecord {
        rule: rule.id.clone(),
        severity: rule.severity,
        tool: breach.tool,
        point_m: breach.point_m,
        value: breach.value,
        penalty: state.charge(rule, breach.times),
    })
}
