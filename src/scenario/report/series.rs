//! What plots show of a run, made small: a report of an hour is not larger than one of a minute.

use crate::scenario::log::{ContactRecord, LogRecord, RunLog};
use crate::scenario::metrics::{Evidence, volume};
use crate::tools::ToolPart;
use bevy::math::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most points of an instrument's way.
const MOST_POINTS: usize = 1500;
/// Pieces of time that forces and bleeding are told in.
const TIME_PIECES: usize = 600;
/// Most dots of the map of what was removed.
const MOST_DOTS: usize = 1500;
/// Most spans of contact.
const MOST_SPANS: usize = 400;
/// Removals nearer than this become one dot, metres; more where there are too many.
const DOT_M: f64 = 0.5e-3;
/// Cells do not grow beyond this, metres: what is farther apart is of no operation.
const LARGEST_CELL_M: f64 = 100.0;

/// What plots show.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportSeries {
    /// Ways and forces.
    pub tools: Vec<ToolSeries>,
    /// Blood.
    pub bleeding: Vec<BleedingPoint>,
    /// What was removed, by place.
    pub removals: Vec<RemovalDot>,
    /// What was touched, when.
    pub contacts: Vec<ContactSpan>,
    /// Where organs and volumes are.
    pub bodies: Vec<ReportBody>,
}

/// What an instrument did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolSeries {
    /// Its name.
    pub tool: String,
    /// Its way.
    pub track: Vec<TrackPoint>,
    /// Its force.
    pub force: Vec<ForcePoint>,
}

/// A point of an instrument's way.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// When, seconds.
    pub time_s: f64,
    /// Where the tip is, world, metres.
    pub tip_m: Vec3,
    /// Whether the pedal is down.
    pub is_working: bool,
    /// Whether the way is broken before it: it was away, or not tracked.
    pub is_new: bool,
}

/// Force in a piece of time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForcePoint {
    /// Middle of the piece, seconds.
    pub time_s: f64,
    /// The mean, newtons.
    pub mean_n: f64,
    /// The largest, newtons.
    pub max_n: f64,
}

/// Bleeding at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BleedingPoint {
    /// When, seconds.
    pub time_s: f64,
    /// All blood that was lost so far, ml.
    pub lost_ml: f64,
    /// What is lost now, ml/s.
    pub rate_ml_s: f64,
}

/// What was removed near a place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RemovalDot {
    /// The body, by its place in [`ReportSeries::bodies`].
    pub body: u32,
    /// Where in the mean, world, metres.
    pub at_m: Vec3,
    /// How much, mm³.
    pub mm3: f64,
    /// Share of it that could be seen, where that is known.
    pub seen: Option<f64>,
    /// Share of it that was to be removed; none where no goal asks for a removal.
    pub inside: Option<f64>,
}

/// An instrument touched something for a while.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContactSpan {
    /// The instrument.
    pub tool: String,
    /// The structure or the organ.
    pub structure: String,
    /// Whether it is critical.
    pub is_critical: bool,
    /// From when, seconds.
    pub from_s: f64,
    /// Until when, seconds.
    pub to_s: f64,
}

/// An organ or a volume.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReportBody {
    /// Its name.
    pub name: String,
    /// Middle of its box, world, metres.
    pub middle_m: Vec3,
    /// Half of the extent of its box, metres.
    pub half_m: Vec3,
}

pub(super) fn series(evidence: &Evidence) -> ReportSeries {
    let run = evidence.run;
    let body = |body: &crate::scenario::log::LoggedBody| {
        let [middle_m, half_m] = body.box_world_m.map(|m| if m.is_finite() { m } else { Vec3::ZERO });
        ReportBody { name: body.name.clone(), middle_m, half_m }
    };
    let bodies = run.header.bodies.iter().map(body).collect();
    let removals = removals(run);
    let Some(rate_hz) = evidence.rate_hz else { return ReportSeries { bodies, removals, ..Default::default() } };
    let time_s = |step: u64| step as f64 / rate_hz;
    let end_s = evidence.time_s().unwrap_or(0.0);
    let tools = evidence.tools().map(|(tool, track)| ToolSeries {
        tool: tool.name.clone(),
        track: way(track, time_s),
        force: force(track.samples.iter().map(|sample| (time_s(sample.step), sample.force_n)), end_s),
    });
    ReportSeries {
        tools: tools.collect(),
        bleeding: bleeding(run, end_s, time_s),
        removals,
        contacts: contacts(run, end_s, time_s),
        bodies,
    }
}

/// Every n-th sample, and where the way is broken between them.
fn way(track: &crate::scenario::metrics::Track, time_s: impl Fn(u64) -> f64) -> Vec<TrackPoint> {
    let every = track.samples.len().div_ceil(MOST_POINTS).max(1);
    let mut points = Vec::new();
    let mut before = None;
    for index in (0..track.samples.len()).step_by(every) {
        let sample = &track.samples[index];
        let stretch = track.stretches.partition_point(|stretch| stretch.end <= index);
        let is_new = before != Some(stretch);
        before = Some(stretch);
        let tip_m = sample.tip_m.as_vec3();
        points.push(TrackPoint { time_s: time_s(sample.step), tip_m, is_working: sample.is_working, is_new });
    }
    points
}

/// The piece of time that a moment is in.
fn piece(time_s: f64, end_s: f64) -> usize {
    if end_s > 0.0 { ((time_s / end_s * TIME_PIECES as f64) as usize).min(TIME_PIECES - 1) } else { 0 }
}

fn force(samples: impl Iterator<Item = (f64, f64)>, end_s: f64) -> Vec<ForcePoint> {
    let mut pieces: BTreeMap<usize, (f64, f64, f64)> = BTreeMap::new();
    for (time_s, force_n) in samples {
        let (count, sum_n, max_n) = pieces.entry(piece(time_s, end_s)).or_default();
        (*count, *sum_n, *max_n) = (*count + 1.0, *sum_n + force_n, max_n.max(force_n));
    }
    let point = |(piece, (count, sum_n, max_n)): (usize, (f64, f64, f64))| ForcePoint {
        time_s: (piece as f64 + 0.5) * end_s / TIME_PIECES as f64,
        mean_n: sum_n / count,
        max_n,
    };
    pieces.into_iter().map(point).collect()
}

/// The last record of each piece of time.
fn bleeding(run: &RunLog, end_s: f64, time_s: impl Fn(u64) -> f64) -> Vec<BleedingPoint> {
    let mut pieces = BTreeMap::new();
    for entry in &run.entries {
        let LogRecord::Bleeding(bleeding) = &entry.record else { continue };
        let (lost_ml, rate_ml_s) = (bleeding.lost_ml, bleeding.rate_ml_s);
        if lost_ml.is_finite() && rate_ml_s.is_finite() {
            let time_s = time_s(entry.step);
            pieces.insert(piece(time_s, end_s), BleedingPoint { time_s, lost_ml, rate_ml_s });
        }
    }
    pieces.into_values().collect()
}

/// What becomes one dot: removals of a body in a cell of space.
#[derive(Default)]
struct Heap {
    mm3: f64,
    moment: DVec3,
    known_mm3: f64,
    seen_mm3: f64,
    inside_mm3: f64,
}

fn removals(run: &RunLog) -> Vec<RemovalDot> {
    let targets = volume::targets(&run.header);
    let mut cell_m = DOT_M;
    loop {
        let mut heaps: BTreeMap<(u32, [i64; 3]), Heap> = BTreeMap::new();
        for entry in &run.entries {
            let LogRecord::Removal(removal) = &entry.record else { continue };
            let parts = removal.by_label_mm3.iter().filter(|(_, mm3)| mm3.is_finite() && *mm3 > 0.0);
            let is_body = (removal.body as usize) < run.header.bodies.len();
            if !removal.centroid_m.is_finite() || !is_body {
                continue;
            }
            let at_m = removal.centroid_m.as_dvec3();
            let heap = heaps.entry((removal.body, (at_m / cell_m).floor().to_array().map(|c| c as i64))).or_default();
            let (mut mm3, mut inside_mm3) = (0.0, 0.0);
            for (label, part_mm3) in parts {
                mm3 += part_mm3;
                let name = volume::structure_name(&run.header, removal.body, *label);
                inside_mm3 += if targets.contains(&name.as_str()) { *part_mm3 } else { 0.0 };
            }
            heap.mm3 += mm3;
            heap.inside_mm3 += inside_mm3;
            heap.moment += at_m * mm3;
            if let Some(seen) = removal.seen.filter(|seen| seen.is_finite()) {
                heap.known_mm3 += mm3;
                heap.seen_mm3 += mm3 * f64::from(seen.clamp(0.0, 1.0));
            }
        }
        heaps.retain(|_, heap| heap.mm3 > 0.0);
        if heaps.len() > MOST_DOTS && cell_m < LARGEST_CELL_M {
            cell_m *= 2.0;
            continue;
        }
        let dot = |((body, _), heap): ((u32, [i64; 3]), Heap)| RemovalDot {
            body,
            at_m: (heap.moment / heap.mm3).as_vec3(),
            mm3: heap.mm3,
            seen: (heap.known_mm3 > 0.0).then(|| heap.seen_mm3 / heap.known_mm3),
            inside: (!targets.is_empty()).then(|| heap.inside_mm3 / heap.mm3),
        };
        return heaps.into_iter().map(dot).take(MOST_DOTS).collect();
    }
}

/// The parts of a tool on a structure: (tool, body, label).
type Touched = (u32, u32, Option<u8>);

/// From the first record of a contact to the one that ends it, or to the end of the run.
fn contacts(run: &RunLog, end_s: f64, time_s: impl Fn(u64) -> f64) -> Vec<ContactSpan> {
    let mut open: BTreeMap<(Touched, ToolPart), f64> = BTreeMap::new();
    let mut spans: BTreeMap<Touched, Vec<[f64; 2]>> = BTreeMap::new();
    for entry in &run.entries {
        let LogRecord::Contact(ContactRecord { tool, body, label, part, is_on, .. }) = &entry.record else { continue };
        let key = (*tool, *body, *label);
        if *is_on {
            open.entry((key, *part)).or_insert(time_s(entry.step));
        } else if let Some(from_s) = open.remove(&(key, *part)) {
            spans.entry(key).or_default().push([from_s, time_s(entry.step)]);
        }
    }
    for ((key, _), from_s) in open {
        spans.entry(key).or_default().push([from_s, end_s.max(from_s)]);
    }
    spans.values_mut().for_each(|spans| spans.sort_by(|a, b| a[0].total_cmp(&b[0])));
    // Spans with shorter and shorter pauses between them become one, until there are few enough.
    let mut gap_s = 0.0;
    loop {
        spans.values_mut().for_each(|spans| join(spans, gap_s));
        if gap_s > end_s || spans.values().map(Vec::len).sum::<usize>() <= MOST_SPANS {
            break;
        }
        gap_s = if gap_s > 0.0 { 2.0 * gap_s } else { (end_s / 1e4).max(1e-3) };
    }
    let named = |((tool, body, label), spans): (Touched, Vec<[f64; 2]>)| {
        let tool = run.header.tools.get(tool as usize).map_or_else(|| format!("tool {tool}"), |tool| tool.name.clone());
        let structure = volume::structure_name(&run.header, body, label.unwrap_or(0));
        let index = label.and_then(|label| label.checked_sub(1)).map(usize::from);
        let critical =
            run.header.bodies.get(body as usize).zip(index).and_then(|(body, index)| body.critical.get(index));
        let is_critical = critical == Some(&true);
        spans.into_iter().map(move |[from_s, to_s]| ContactSpan {
            tool: tool.clone(),
            structure: structure.clone(),
            is_critical,
            from_s,
            to_s,
        })
    };
    spans.into_iter().flat_map(named).take(MOST_SPANS).collect()
}

/// Joins spans, sorted by their beginnings, that overlap or have a short pause between them.
fn join(spans: &mut Vec<[f64; 2]>, gap_s: f64) {
    let mut joined: Vec<[f64; 2]> = Vec::with_capacity(spans.len());
    for span in spans.iter() {
        match joined.last_mut() {
            Some(last) if span[0] - last[1] <= gap_s => last[1] = last[1].max(span[1]),
            _ => joined.push(*span),
        }
    }
    *spans = joined;
}
