//! The metrics of a log.

use super::evidence::{Evidence, Track};
use super::force::{ForceStats, force_stats, near};
use super::motion::{IDLE_M_PER_S, depth_m, largest, mean, median, path_length_m};
use super::seen::seen_volume_share;
use super::smoothness::{log_dimensionless_jerk, sparc};
use super::strokes::Stroke;
use super::suction::suction_distance_m;
use super::volume::{removed, structure_name, targets};
use super::{Metric, MetricChoice, MetricKind, MetricPart};
use crate::scenario::log::{BleedingRecord, LogRecord, LoggedTool, RunLog};
use crate::tools::ToolKind;
use bevy::math::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// The metrics that a run's scenario asks for; all there are, for information, where it asks for none.
pub fn measure(run: &RunLog) -> Vec<Metric> {
    let evidence = Evidence::of(run);
    let chosen = &run.header.scenario.metrics;
    if chosen.is_empty() {
        return MetricKind::ALL.iter().map(|kind| metric(&evidence, &MetricChoice::new(*kind))).collect();
    }
    chosen.iter().map(|choice| metric(&evidence, choice)).collect()
}

/// Mean of the metrics' scores by weight, 0 to 1; none where none of them counts. A metric without a score does not count.
pub fn weighted_score(metrics: &[Metric]) -> Option<f64> {
    let scored = metrics.iter().filter_map(|metric| Some((metric.weight, metric.score?)));
    let (mut weights, mut sum) = (0.0, 0.0);
    for (weight, score) in scored.filter(|(weight, _)| weight.is_finite() && *weight > 0.0) {
        weights += weight;
        sum += weight * score;
    }
    (weights > 0.0).then_some(sum / weights)
}

fn metric(evidence: &Evidence, choice: &MetricChoice) -> Metric {
    let kind = choice.metric.checked();
    let Found { value, by } = find(evidence, kind);
    let value = value.filter(|value| value.is_finite());
    Metric {
        kind,
        name: choice.name.clone().unwrap_or_else(|| kind.name()),
        unit: kind.unit().to_string(),
        value,
        by: by.into_iter().filter(|part| part.value.is_finite()).collect(),
        weight: if choice.weight.is_finite() { f64::from(choice.weight.max(0.0)) } else { 0.0 },
        score: value.and_then(|value| choice.score(value)),
        formula: kind.formula().to_string(),
    }
}

/// A value, and its parts.
#[derive(Default)]
struct Found {
    value: Option<f64>,
    by: Vec<MetricPart>,
}

impl Found {
    /// Without parts.
    fn only(value: Option<f64>) -> Self {
        Self { value, by: Vec::new() }
    }
}

/// How the values of tools become one.
#[derive(Clone, Copy)]
enum Joined {
    Sum,
    Max,
    /// Of all samples of all tools.
    Mean,
    Median,
}

fn find(evidence: &Evidence, kind: MetricKind) -> Found {
    let Some(rate_hz) = evidence.rate_hz else { return without_time(evidence, kind) };
    let forces = |track: &Track, of: fn(ForceStats) -> f64| {
        force_stats(&track.forces_n(), rate_hz).map(of).into_iter().collect::<Vec<f64>>()
    };
    let near_samples = |track: &Track, values: &[f64], within_m: f32| {
        // A tenth of a micrometre, as f32 and f64 do not mean the same millimetre.
        near(values, &track.critical_m(), f64::from(within_m) + 1e-7)
    };
    match kind {
        MetricKind::Time => Found::only(evidence.time_s()),
        MetricKind::PathLength => by_tool(evidence, Joined::Sum, |track| path(track).into_iter().collect()),
        MetricKind::Economy => economy(evidence, rate_hz),
        MetricKind::Depth => by_tool(evidence, Joined::Sum, |track| depth(track).into_iter().collect()),
        MetricKind::MeanSpeed => by_tool(evidence, Joined::Mean, |track| track.speeds(rate_hz).concat()),
        MetricKind::MaxSpeed => by_tool(evidence, Joined::Max, |track| track.speeds(rate_hz).concat()),
        MetricKind::Idle => idle(evidence, rate_hz),
        MetricKind::Sparc => by_tool(evidence, Joined::Median, |track| smoothness(track, rate_hz, sparc)),
        MetricKind::LogJerk => {
            by_tool(evidence, Joined::Median, |track| smoothness(track, rate_hz, log_dimensionless_jerk))
        }
        MetricKind::StrokeRate => stroke_rate(evidence, rate_hz),
        MetricKind::StrokeTime => by_stroke(evidence, rate_hz, |_, stroke| Some(stroke.time_s)),
        MetricKind::StrokeLength => by_stroke(evidence, rate_hz, |_, stroke| Some(stroke.length_m)),
        MetricKind::CurvedStrokes => {
            by_stroke(evidence, rate_hz, |_, stroke| Some(f64::from(u8::from(stroke.is_curved))))
        }
        MetricKind::StrokeForce => by_stroke(evidence, rate_hz, |track, stroke| {
            let samples = &track.samples[stroke.first..=stroke.last];
            mean(&pressing(samples.iter().map(|sample| sample.force_n).collect()))
        }),
        MetricKind::MeanForce => by_tool(evidence, Joined::Mean, |track| pressing(track.forces_n())),
        MetricKind::MaxForce => by_tool(evidence, Joined::Max, |track| forces(track, |stats| stats.max_n)),
        MetricKind::Impulse => by_tool(evidence, Joined::Sum, |track| forces(track, |stats| stats.impulse_n_s)),
        MetricKind::MeanForceNear { within_m } => {
            by_tool(evidence, Joined::Mean, |track| pressing(near_samples(track, &track.forces_n(), within_m)))
        }
        MetricKind::MaxForceNear { within_m } => {
            by_tool(evidence, Joined::Max, |track| pressing(near_samples(track, &track.forces_n(), within_m)))
        }
        MetricKind::MeanSpeedNear { within_m } => by_tool(evidence, Joined::Mean, |track| {
            let mut speeds = Vec::new();
            for (stretch, speed) in track.stretches.iter().zip(track.speeds(rate_hz)) {
                // The speed towards a sample is that sample's.
                let distances_m: Vec<_> =
                    track.samples[stretch.clone()].iter().skip(1).map(|at| at.critical_m).collect();
                speeds.extend(near(&speed, &distances_m, f64::from(within_m) + 1e-7));
            }
            speeds
        }),
        MetricKind::TimeNear { within_m } => by_tool(evidence, Joined::Sum, |track| {
            let is_known = track.critical_m().iter().any(Option::is_some);
            let count = near_samples(track, &track.forces_n(), within_m).len();
            if is_known { vec![count as f64 / rate_hz] } else { Vec::new() }
        }),
        MetricKind::SuctionDistance => suction(evidence),
        MetricKind::HiddenView => Found::only(hidden_view(evidence)),
        _ => without_time(evidence, kind),
    }
}

/// What can be said without a rate of samples.
fn without_time(evidence: &Evidence, kind: MetricKind) -> Found {
    match kind {
        MetricKind::CriticalContacts => critical_contacts(evidence),
        MetricKind::SeenRemoval => seen_removal(evidence),
        MetricKind::BloodLoss => Found::only(blood_loss(evidence)),
        MetricKind::Removed => removed_volume(evidence, None),
        MetricKind::RemovedInside => removed_volume(evidence, Some(true)),
        MetricKind::RemovedOutside => removed_volume(evidence, Some(false)),
        _ => Found::default(),
    }
}

/// Values of each tool, joined to one for the tool, and all of them to one for the run.
fn by_tool(evidence: &Evidence, how: Joined, values: impl Fn(&Track) -> Vec<f64>) -> Found {
    joined(how, evidence.tools().map(|(tool, track)| (tool, values(track))))
}

/// The same for strokes of drills, in the mean.
fn by_stroke(evidence: &Evidence, rate_hz: f64, value: impl Fn(&Track, &Stroke) -> Option<f64>) -> Found {
    let values = |track: &Track| track.strokes(rate_hz).iter().filter_map(|stroke| value(track, stroke)).collect();
    joined(Joined::Mean, evidence.drills().map(|(tool, track)| (tool, values(track))))
}

fn joined<'a>(how: Joined, tools: impl Iterator<Item = (&'a LoggedTool, Vec<f64>)>) -> Found {
    let join = |values: &[f64]| match how {
        Joined::Sum => (!values.is_empty()).then(|| values.iter().sum()),
        Joined::Max => largest(values),
        Joined::Mean => mean(values),
        Joined::Median => median(values),
    };
    let (mut by, mut all) = (Vec::new(), Vec::new());
    for (tool, values) in tools {
        by.extend(join(&values).map(|value| MetricPart { name: tool.name.clone(), value }));
        all.extend(values);
    }
    Found { value: join(&all), by }
}

fn pressing(forces_n: Vec<f64>) -> Vec<f64> {
    forces_n.into_iter().filter(|force_n| *force_n > 0.0).collect()
}

fn path(track: &Track) -> Option<f64> {
    let ways = track.stretches.iter().map(|stretch| path_length_m(&track.tips_m(stretch.clone())));
    (!track.stretches.is_empty()).then(|| ways.flatten().sum())
}

fn depth(track: &Track) -> Option<f64> {
    let of = |stretch: &std::ops::Range<usize>| {
        let axes: Vec<DVec3> = track.samples[stretch.clone()].iter().map(|sample| sample.axis).collect();
        depth_m(&track.tips_m(stretch.clone()), &axes)
    };
    (!track.stretches.is_empty()).then(|| track.stretches.iter().filter_map(of).sum())
}

fn economy(evidence: &Evidence, rate_hz: f64) -> Found {
    let (mut straight_m, mut path_m) = (0.0, 0.0);
    let mut by = Vec::new();
    for (tool, track) in evidence.tools() {
        let (mut straight, mut path) = (0.0, 0.0);
        for movement in track.movements(rate_hz) {
            let tips_m = track.tips_m(movement);
            straight += tips_m[0].distance(tips_m[tips_m.len() - 1]);
            path += path_length_m(&tips_m).unwrap_or(0.0);
        }
        if path > 0.0 {
            by.push(MetricPart { name: tool.name.clone(), value: (straight / path).min(1.0) });
        }
        straight_m += straight;
        path_m += path;
    }
    Found { value: (path_m > 0.0).then(|| (straight_m / path_m).min(1.0)), by }
}

/// The steps in which a held tool is slow; the run is idle where all that are held are.
fn idle(evidence: &Evidence, rate_hz: f64) -> Found {
    let (mut held, mut busy) = (BTreeSet::new(), BTreeSet::new());
    let mut by = Vec::new();
    for (tool, track) in evidence.tools() {
        let (mut idle, mut steps) = (0_u64, 0_u64);
        for (stretch, speeds) in track.stretches.iter().zip(track.speeds(rate_hz)) {
            for (sample, speed) in track.samples[stretch.clone()].iter().skip(1).zip(speeds) {
                held.insert(sample.step);
                steps += 1;
                if speed < IDLE_M_PER_S {
                    idle += 1;
                } else {
                    busy.insert(sample.step);
                }
            }
        }
        if steps > 0 {
            by.push(MetricPart { name: tool.name.clone(), value: idle as f64 / rate_hz });
        }
    }
    let value = (!held.is_empty()).then(|| (held.len() - busy.len()) as f64 / rate_hz);
    Found { value, by }
}

fn smoothness(track: &Track, rate_hz: f64, of: fn(&[f64], f64) -> Option<f64>) -> Vec<f64> {
    let measure = |movement| of(&super::motion::speeds_m_per_s(&track.tips_m(movement), rate_hz), rate_hz);
    track.movements(rate_hz).into_iter().filter_map(measure).collect()
}

fn stroke_rate(evidence: &Evidence, rate_hz: f64) -> Found {
    let (mut strokes, mut time_s) = (0.0, 0.0);
    let mut by = Vec::new();
    for (tool, track) in evidence.drills() {
        let worked_s = track.working().iter().map(|range| range.len() as f64 / rate_hz).sum::<f64>();
        let count = track.strokes(rate_hz).len() as f64;
        if worked_s > 0.0 {
            by.push(MetricPart { name: tool.name.clone(), value: count / worked_s });
        }
        strokes += count;
        time_s += worked_s;
    }
    Found { value: (time_s > 0.0).then(|| strokes / time_s), by }
}

fn suction(evidence: &Evidence) -> Found {
    let is_suction = |tool: &LoggedTool| tool.tool.kind == ToolKind::SuctionIrrigator;
    let tips =
        |track: &Track| track.samples.iter().map(|sample| (sample.step, sample.tip_m)).collect::<BTreeMap<_, _>>();
    let suctions: Vec<_> =
        evidence.tools().filter(|(tool, _)| is_suction(tool)).map(|(_, track)| tips(track)).collect();
    let (mut all, mut by) = (Vec::new(), Vec::new());
    for (tool, track) in evidence.drills() {
        let row = track.samples.iter().map(|sample| {
            let there = suctions.iter().filter_map(|tips| tips.get(&sample.step).copied());
            let nearest = there.min_by(|a, b| a.distance(sample.tip_m).total_cmp(&b.distance(sample.tip_m)));
            (Some(sample.tip_m), nearest, sample.is_working)
        });
        let row: Vec<_> = row.collect();
        by.extend(suction_distance_m(row.iter().copied()).map(|value| MetricPart { name: tool.name.clone(), value }));
        all.extend(row);
    }
    Found { value: suction_distance_m(all), by }
}

fn critical_contacts(evidence: &Evidence) -> Found {
    let header = &evidence.run.header;
    let is_critical = |body: u32, label: u8| {
        let body = header.bodies.get(body as usize);
        let index = label.checked_sub(1).map(usize::from);
        body.zip(index).and_then(|(body, index)| body.critical.get(index)).copied().unwrap_or(false)
    };
    if !header.bodies.iter().any(|body| body.critical.contains(&true)) {
        return Found::default();
    }
    let mut open = BTreeSet::new();
    let mut counts: BTreeMap<(u32, u8), u64> = BTreeMap::new();
    for entry in &evidence.run.entries {
        let LogRecord::Contact(contact) = &entry.record else { continue };
        let Some(label) = contact.label.filter(|label| is_critical(contact.body, *label)) else { continue };
        let key = (contact.tool, contact.body, label, contact.part);
        if !contact.is_on {
            open.remove(&key);
        } else if open.insert(key) {
            *counts.entry((contact.body, label)).or_default() += 1;
        }
    }
    let value = Some(counts.values().sum::<u64>() as f64);
    let part = |((body, label), count)| MetricPart { name: structure_name(header, body, label), value: count as f64 };
    Found { value, by: counts.into_iter().map(part).collect() }
}

fn seen_removal(evidence: &Evidence) -> Found {
    let mut tools: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
    let mut all = Vec::new();
    for entry in &evidence.run.entries {
        let LogRecord::Removal(removal) = &entry.record else { continue };
        let Some(seen) = removal.seen else { continue };
        let removed = (removal.by_label_mm3.iter().map(|(_, mm3)| mm3).sum::<f64>(), f64::from(seen));
        all.push(removed);
        if let Some(tool) = removal.tool {
            tools.entry(tool).or_default().push(removed);
        }
    }
    let part = |(tool, removals): (u32, Vec<(f64, f64)>)| {
        let tool = evidence.run.header.tools.get(tool as usize)?;
        Some(MetricPart { name: tool.name.clone(), value: seen_volume_share(removals)? })
    };
    Found { value: seen_volume_share(all), by: tools.into_iter().filter_map(part).collect() }
}

fn bleedings<'a>(evidence: &Evidence<'a>) -> impl Iterator<Item = (u64, &'a BleedingRecord)> {
    evidence.run.entries.iter().filter_map(|entry| match &entry.record {
        LogRecord::Bleeding(bleeding) => Some((entry.step, bleeding)),
        _ => None,
    })
}

fn blood_loss(evidence: &Evidence) -> Option<f64> {
    bleedings(evidence).map(|(_, bleeding)| bleeding.lost_ml).filter(|lost_ml| lost_ml.is_finite()).reduce(f64::max)
}

/// Each record holds until the next one, the last one until the end of the run.
fn hidden_view(evidence: &Evidence) -> Option<f64> {
    let records: Vec<_> = bleedings(evidence).collect();
    let end = evidence.run.entries.iter().map(|entry| entry.step).max()?;
    let ends = records.iter().skip(1).map(|(step, _)| *step).chain([end]);
    let (mut steps, mut sum) = (0.0, 0.0);
    for ((step, record), until) in records.iter().zip(ends) {
        let Some(hidden) = record.hidden.filter(|hidden| hidden.is_finite()) else { continue };
        let lasts = until.saturating_sub(*step) as f64;
        steps += lasts;
        sum += lasts * f64::from(hidden.clamp(0.0, 1.0));
    }
    (steps > 0.0).then_some(sum / steps)
}

/// What was removed of targets, of anything else, or of both; nothing where the run has no volume, or goals name no target.
fn removed_volume(evidence: &Evidence, of_targets: Option<bool>) -> Found {
    let header = &evidence.run.header;
    let has_volume = header.bodies.iter().any(|body| !body.volumes_mm3.is_empty() || !body.structures.is_empty());
    let removed = removed(evidence.run);
    if (removed.is_empty() && !has_volume) || (of_targets.is_some() && targets(header).is_empty()) {
        return Found::default();
    }
    let chosen = removed.into_iter().filter(|structure| of_targets.is_none_or(|is| is == structure.is_target));
    let by: Vec<_> = chosen.map(|structure| MetricPart { name: structure.name, value: structure.mm3 }).collect();
    // The sum of no numbers is -0.
    Found { value: Some(by.iter().map(|part| part.value).sum::<f64>() + 0.0), by }
}
