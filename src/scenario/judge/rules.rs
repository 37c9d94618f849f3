//! Whether rules are broken.

use super::{Facts, StructureFacts, Targets};
use crate::scenario::{Rule, RuleKind};
use bevy::reflect::Reflect;
use glam::Vec3;

/// What is broken again within this time after it has ended is the same violation, seconds.
const REST_S: f32 = 0.5;

/// A rule so far.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
pub struct RuleState {
    /// How often it was broken.
    pub count: u32,
    /// Points that this has cost.
    pub cost: f32,
    /// Whether it is being broken in this step.
    pub is_broken: bool,
    /// For how long it has not been broken, seconds; none before the first time and while it is.
    rested_s: Option<f32>,
    /// What has added up: mm³ that were removed unseen.
    sum: f32,
}

/// How a rule is broken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Breach {
    pub(super) tool: Option<u32>,
    pub(super) point_m: Option<Vec3>,
    pub(super) value: f32,
    /// How many times it counts: what adds up counts once for each so much.
    pub(super) times: u32,
}

impl RuleState {
    /// Looks at a step; gives how the rule was broken anew.
    pub(super) fn step(&mut self, rule: &Rule, targets: &Targets, facts: &Facts) -> Option<Breach> {
        if let RuleKind::DrilledUnseen { .. } = rule.kind {
            let unseen = |removal: &super::RemovalFacts| removal.mm3 * (1.0 - removal.seen.unwrap_or(1.0));
            self.sum += facts.removals.iter().map(unseen).sum::<f32>();
        }
        let found = find(rule, targets, facts, self.sum);
        self.is_broken = found.is_some();
        if let Some(limit) = added_up(&rule.kind) {
            // Once when the limit is passed, and once more for each time as much.
            let found = found?;
            let times = if limit > 0.0 { ((found.value / limit).ceil() - 1.0).min(1e6) as u32 } else { 1 };
            let more = times.max(1).saturating_sub(self.count);
            self.count += more;
            return (more > 0).then_some(Breach { times: more, ..found });
        }
        let Some(found) = found else {
            self.rested_s = self.rested_s.map(|rested_s| rested_s + facts.dt_s);
            return None;
        };
        let is_new = self.count == 0 || self.rested_s.is_some_and(|rested_s| rested_s >= REST_S - 0.5 * facts.dt_s);
        self.rested_s = Some(0.0);
        if !is_new {
            return None;
        }
        self.count += 1;
        Some(Breach { times: 1, ..found })
    }

    /// Takes the points of so many times; gives those that it costs.
    pub(super) fn charge(&mut self, rule: &Rule, times: u32) -> f32 {
        let most = rule.most.unwrap_or(f32::INFINITY);
        let cost = (rule.penalty * times as f32).min((most - self.cost).max(0.0));
        self.cost += cost;
        cost
    }
}

/// The limit of a rule on what only grows.
fn added_up(kind: &RuleKind) -> Option<f32> {
    match kind {
        RuleKind::Cut { above_mm3, .. } | RuleKind::DrilledUnseen { above_mm3 } => Some(*above_mm3),
        RuleKind::BurntOutside { above_mm2, .. } => Some(*above_mm2),
        RuleKind::BloodLoss { above_ml } => Some(*above_ml),
        _ => None,
    }
}

fn find(rule: &Rule, targets: &Targets, facts: &Facts, sum: f32) -> Option<Breach> {
    let structure = |name: &str| targets.structure(name).and_then(|place| facts.structures.get(place));
    let by =
        |tool: usize, value: f32| Breach { tool: Some(tool as u32), point_m: facts.tools[tool].tip_m, value, times: 1 };
    // Of several instruments the one that is worst.
    let worst = |value: &dyn Fn(usize) -> Option<f32>| {
        let all = (0..facts.tools.len()).filter_map(|tool| value(tool).map(|value| by(tool, value)));
        all.reduce(|a, b| if b.value > a.value { b } else { a })
    };
    let near = |of: &StructureFacts, tool: usize, within_m: f32| {
        let touches = of.is_touched.get(tool).copied().unwrap_or(false);
        touches || of.distance_m.get(tool).copied().flatten().is_some_and(|distance| distance <= within_m)
    };
    let plain = |value: f32| Breach { tool: None, point_m: None, value, times: 1 };
    match &rule.kind {
        RuleKind::Touch { structure: name } => {
            let of = structure(name)?;
            worst(&|tool| of.is_touched.get(tool).copied()?.then_some(facts.tools[tool].force_n))
        }
        RuleKind::Cut { structure: name, above_mm3 } => {
            let of = structure(name)?;
            let last = facts.removals.last();
            (of.removed_mm3 > *above_mm3).then_some(Breach {
                tool: last.and_then(|removal| removal.tool),
                point_m: last.map(|removal| removal.centroid_m),
                value: of.removed_mm3,
                times: 1,
            })
        }
        RuleKind::Force { structure: name, within_m, above_n } => {
            let of = structure(name)?;
            let force = |tool: usize| Some(facts.tools[tool].force_n).filter(|force_n| force_n > above_n);
            worst(&|tool| near(of, tool, *within_m).then(|| force(tool))?)
        }
        RuleKind::Speed { structure: name, within_m, above_m_per_s } => {
            let of = structure(name)?;
            let speed = |tool: usize| Some(facts.tools[tool].speed_m_per_s).filter(|speed| speed > above_m_per_s);
            worst(&|tool| near(of, tool, *within_m).then(|| speed(tool))?)
        }
        RuleKind::Near { structure: name, within_m } => {
            let of = structure(name)?;
            let turns = |tool: usize| facts.tools[tool].turning_burr_m.is_some() && near(of, tool, *within_m);
            // The nearer the worse.
            let value = |tool: usize| within_m - of.distance_m.get(tool).copied().flatten().unwrap_or(0.0);
            worst(&|tool| turns(tool).then(|| value(tool)))
        }
        RuleKind::BurrTooLarge { structure: name, within_m, above_m } => {
            let of = structure(name)?;
            let size = |tool: usize| facts.tools[tool].turning_burr_m.filter(|size_m| size_m > above_m);
            worst(&|tool| near(of, tool, *within_m).then(|| size(tool))?)
        }
        RuleKind::DrilledUnseen { above_mm3 } => {
            let last = facts.removals.last();
            (sum > *above_mm3).then_some(Breach {
                tool: last.and_then(|removal| removal.tool),
                point_m: last.map(|removal| removal.centroid_m),
                value: sum,
                times: 1,
            })
        }
        RuleKind::Collision => {
            let &[a, _] = facts.collisions.first()?;
            Some(by(a as usize, 1.0))
        }
        RuleKind::BurntOutside { above_mm2, .. } => {
            let place = targets.lesions_of(&format!("rule \"{}\"", rule.id))?;
            let area = facts.lesions.get(place)?.outside_mm2;
            (area > *above_mm2).then_some(plain(area))
        }
        RuleKind::BloodLoss { above_ml } => {
            (facts.lost_ml > f64::from(*above_ml)).then_some(plain(facts.lost_ml as f32))
        }
        // Known at the end.
        RuleKind::OutOfTime => None,
    }
}
