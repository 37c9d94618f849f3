//! From a log to its report.

use super::series::series;
use super::{GoalReport, Outcome, REPORT_VERSION, RunReport, StructureReport, ViolationReport};
use crate::scenario::RuleKind;
use crate::scenario::log::{EndRecord, GoalRecord, LogRecord, RunLog, ViolationRecord};
use crate::scenario::metrics::{Evidence, measure, volume, weighted_score};
use std::collections::BTreeMap;

impl RunReport {
    /// The report of a run.
    pub fn of(run: &RunLog) -> Self {
        let header = &run.header;
        let scenario = &header.scenario;
        let evidence = Evidence::of(run);
        let metrics = measure(run);
        Self {
            version: REPORT_VERSION,
            crate_version: header.crate_version.clone(),
            scenario: scenario.name.clone(),
            description: scenario.description.clone(),
            trainee: header.trainee.clone(),
            began: header.began.clone(),
            seed: header.seed,
            branch: header.branch.clone(),
            outcome: outcome(run, evidence.time_s()),
            goals: goals(run),
            violations: violations(run),
            structures: structures(run),
            metrics_score: weighted_score(&metrics),
            metrics,
            series: series(&evidence),
        }
    }
}

fn outcome(run: &RunLog, time_s: Option<f64>) -> Outcome {
    let end = run.entries.iter().rev().find_map(|entry| match &entry.record {
        LogRecord::End(end) => Some(end),
        _ => None,
    });
    let scenario = &run.header.scenario;
    Outcome {
        reason: end.map(|end: &EndRecord| end.reason),
        score: end.map(|end| end.score).filter(|score| score.is_finite()),
        is_passed: end.map(|end| end.is_passed),
        pass_score: finite(scenario.pass_score),
        time_s,
        time_limit_s: scenario.time_limit_s.filter(|limit_s| limit_s.is_finite()),
        is_complete: run.is_complete,
    }
}

fn goals(run: &RunLog) -> Vec<GoalReport> {
    let mut last: BTreeMap<&str, &GoalRecord> = BTreeMap::new();
    let mut reached: BTreeMap<&str, f64> = BTreeMap::new();
    for entry in &run.entries {
        let LogRecord::Goal(goal) = &entry.record else { continue };
        last.insert(&goal.goal, goal);
        let time_s = run.time_s(entry.step);
        if goal.is_reached && time_s.is_finite() {
            reached.entry(&goal.goal).or_insert(time_s);
        }
    }
    let report = |goal: &crate::scenario::Goal| {
        let last = last.get(goal.id.as_str());
        GoalReport {
            id: goal.id.clone(),
            title: if goal.title.is_empty() { goal.id.clone() } else { goal.title.clone() },
            weight: finite(goal.weight),
            progress: last.map_or(0.0, |last| finite(last.progress).clamp(0.0, 1.0)),
            reached_s: reached.get(goal.id.as_str()).copied(),
            is_reached: last.is_some_and(|last| last.is_reached),
        }
    };
    run.header.scenario.goals.iter().map(report).collect()
}

fn violations(run: &RunLog) -> Vec<ViolationReport> {
    let header = &run.header;
    let report = |step: u64, violation: &ViolationRecord| {
        let rule = header.scenario.rules.iter().find(|rule| rule.id == violation.rule);
        let message = rule.map(|rule| rule.message.clone()).filter(|message| !message.is_empty());
        let tool = violation.tool.and_then(|tool| header.tools.get(tool as usize));
        let time_s = run.time_s(step);
        ViolationReport {
            time_s: if time_s.is_finite() { time_s } else { 0.0 },
            rule: violation.rule.clone(),
            message: message.unwrap_or_else(|| violation.rule.clone()),
            severity: violation.severity,
            tool: tool.map(|tool| tool.name.clone()),
            point_m: violation.point_m.filter(|point_m| point_m.is_finite()),
            value: Some(violation.value).filter(|value| value.is_finite()),
            unit: rule.map_or("", |rule| unit(&rule.kind)).to_string(),
            penalty: finite(violation.penalty),
        }
    };
    let violation = |entry: &crate::scenario::log::LogEntry| match &entry.record {
        LogRecord::Violation(violation) => Some(report(entry.step, violation)),
        _ => None,
    };
    run.entries.iter().filter_map(violation).collect()
}

/// Unit of the value of a violation.
fn unit(rule: &RuleKind) -> &'static str {
    match rule {
        RuleKind::Force { .. } => "N",
        RuleKind::Speed { .. } => "m/s",
        RuleKind::Near { .. } | RuleKind::BurrTooLarge { .. } => "m",
        RuleKind::Cut { .. } | RuleKind::DrilledUnseen { .. } => "mm³",
        RuleKind::BurntOutside { .. } => "mm²",
        RuleKind::BloodLoss { .. } => "ml",
        RuleKind::Touch { .. } | RuleKind::Collision | RuleKind::OutOfTime => "",
    }
}

/// All structures of volumes, and whatever else something was removed of.
fn structures(run: &RunLog) -> Vec<StructureReport> {
    let header = &run.header;
    let targets = volume::targets(header);
    let mut removed: BTreeMap<(u32, u8), f64> = volume::removed_by_label(run);
    for (index, body) in (0..).zip(&header.bodies) {
        for label in (1..=u8::MAX).take(body.structures.len()) {
            removed.entry((index, label)).or_default();
        }
    }
    let report = |((body, label), removed_mm3): ((u32, u8), f64)| {
        let name = volume::structure_name(header, body, label);
        let logged = header.bodies.get(body as usize);
        let index = usize::from(label);
        let before_mm3 = logged.and_then(|body| body.volumes_mm3.get(index)).copied();
        StructureReport {
            body: logged.map_or_else(String::new, |body| body.name.clone()),
            is_critical: index > 0 && logged.is_some_and(|body| body.critical.get(index - 1) == Some(&true)),
            is_target: targets.contains(&name.as_str()),
            before_mm3: before_mm3.filter(|mm3| mm3.is_finite()),
            removed_mm3,
            name,
        }
    };
    removed.into_iter().map(report).collect()
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}
