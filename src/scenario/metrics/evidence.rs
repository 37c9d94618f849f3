//! What of a run's log the metrics are computed from: each tool's samples, cut where they do not hang together.

use super::motion::{MovementRule, finite, is_rate, movements, speeds_m_per_s};
use super::strokes::{Stroke, StrokeRule, strokes};
use crate::scenario::log::{LogRecord, LoggedTool, RunLog, ToolSample};
use crate::tools::{ToolCommand, ToolKind, ToolLimits};
use bevy::math::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::ops::Range;

/// A tool's tip in a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrackSample {
    /// The step.
    pub step: u64,
    /// Where, metres.
    pub tip_m: DVec3,
    /// Where it points, of length 1.
    pub axis: DVec3,
    /// How hard it presses, newtons.
    pub force_n: f64,
    /// How far the nearest critical structure is, metres.
    pub critical_m: Option<f64>,
    /// Whether its pedal is down.
    pub is_working: bool,
}

/// What a tool did while it was held; samples that are no numbers are left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Track {
    /// By step.
    pub samples: Vec<TrackSample>,
    /// Ranges of samples of consecutive steps, without jumps.
    pub stretches: Vec<Range<usize>>,
}

/// All of it.
pub(crate) struct Evidence<'a> {
    pub run: &'a RunLog,
    /// Samples per second; none where the log says nothing sensible.
    pub rate_hz: Option<f64>,
    /// By tool, as in the header.
    pub tracks: Vec<Track>,
}

impl<'a> Evidence<'a> {
    pub fn of(run: &'a RunLog) -> Self {
        let rate_hz = Some(run.header.steps_per_second).filter(|rate_hz| is_rate(*rate_hz));
        let mut samples: Vec<BTreeMap<u64, TrackSample>> = vec![BTreeMap::new(); run.header.tools.len()];
        for entry in &run.entries {
            let LogRecord::Sample(sample) = &entry.record else { continue };
            let Some(track) = samples.get_mut(sample.tool as usize) else { continue };
            if let Some(sample) = track_sample(entry.step, sample) {
                track.insert(entry.step, sample);
            }
        }
        let tracks = samples.into_iter().map(|samples| Track::new(samples.into_values().collect(), rate_hz)).collect();
        Self { run, rate_hz, tracks }
    }

    /// Tools with their tracks.
    pub fn tools(&self) -> impl Iterator<Item = (&'a LoggedTool, &Track)> {
        self.run.header.tools.iter().zip(&self.tracks)
    }

    /// Drills with their tracks.
    pub fn drills(&self) -> impl Iterator<Item = (&'a LoggedTool, &Track)> {
        self.tools().filter(|(tool, _)| matches!(tool.tool.kind, ToolKind::Drill(_)))
    }

    /// The last step of the run, and with it its length in seconds.
    pub fn time_s(&self) -> Option<f64> {
        let last = self.run.entries.iter().map(|entry| entry.step).max()?;
        self.rate_hz.and_then(|rate_hz| finite(last as f64 / rate_hz))
    }
}

impl Track {
    fn new(samples: Vec<TrackSample>, rate_hz: Option<f64>) -> Self {
        // What is faster is no motion: tracking was lost. The tools themselves see it so too.
        let most_m = f64::from(ToolLimits::default().max_speed_m_per_s) / rate_hz.unwrap_or(1.0);
        let joins = |a: &TrackSample, b: &TrackSample| b.step == a.step + 1 && a.tip_m.distance(b.tip_m) <= most_m;
        let mut stretches = Vec::new();
        let mut from = 0;
        for index in 1..=samples.len() {
            if index == samples.len() || !joins(&samples[index - 1], &samples[index]) {
                stretches.push(from..index);
                from = index;
            }
        }
        Self { samples, stretches }
    }

    /// Places of a range of samples, metres.
    pub fn tips_m(&self, range: Range<usize>) -> Vec<DVec3> {
        self.samples[range].iter().map(|sample| sample.tip_m).collect()
    }

    /// Speeds within each stretch, metres per second.
    pub fn speeds(&self, rate_hz: f64) -> Vec<Vec<f64>> {
        self.stretches.iter().map(|stretch| speeds_m_per_s(&self.tips_m(stretch.clone()), rate_hz)).collect()
    }

    /// Single movements from rest to rest, as ranges of samples.
    pub fn movements(&self, rate_hz: f64) -> Vec<Range<usize>> {
        let rule = MovementRule::default();
        let of = |stretch: &Range<usize>| {
            let speeds = speeds_m_per_s(&self.tips_m(stretch.clone()), rate_hz);
            let from = stretch.start;
            // A range of steps has one more place than steps.
            movements(&speeds, rate_hz, &rule).into_iter().map(move |range| from + range.start..from + range.end + 1)
        };
        self.stretches.iter().flat_map(of).collect()
    }

    /// Ranges of samples in which the pedal is down.
    pub fn working(&self) -> Vec<Range<usize>> {
        let of = |stretch: &Range<usize>| {
            let from = stretch.start;
            let runs = super::motion::runs(stretch.len(), |index| self.samples[from + index].is_working);
            runs.into_iter().map(move |run| from + run.start..from + run.end)
        };
        self.stretches.iter().flat_map(of).collect()
    }

    /// Strokes while the pedal is down; their indices are of samples.
    pub fn strokes(&self, rate_hz: f64) -> Vec<Stroke> {
        let rule = StrokeRule::default();
        let of = |range: Range<usize>| {
            let from = range.start;
            let moved = move |stroke: Stroke| Stroke { first: stroke.first + from, last: stroke.last + from, ..stroke };
            strokes(&self.tips_m(range), rate_hz, &rule).into_iter().map(moved)
        };
        self.working().into_iter().flat_map(of).collect()
    }

    /// Forces of all samples, newtons.
    pub fn forces_n(&self) -> Vec<f64> {
        self.samples.iter().map(|sample| sample.force_n).collect()
    }

    /// Distances of all samples from critical structures, metres.
    pub fn critical_m(&self) -> Vec<Option<f64>> {
        self.samples.iter().map(|sample| sample.critical_m).collect()
    }
}

fn track_sample(step: u64, sample: &ToolSample) -> Option<TrackSample> {
    let place = &sample.pose.place;
    let axis = (place.world_from_tool.normalize() * Vec3::NEG_Z).as_dvec3();
    let is_place = sample.pose.is_tracked && place.tip_in_world_m.is_finite() && axis.is_finite();
    is_place.then(|| TrackSample {
        step,
        tip_m: place.tip_in_world_m.as_dvec3(),
        axis,
        force_n: force_n(sample),
        critical_m: sample.critical_m.map(f64::from).filter(|distance_m| distance_m.is_finite()),
        is_working: sample.command.pedal >= ToolCommand::DOWN,
    })
}

/// How hard a tool presses, newtons: what its device measured, else what its contacts say. A burr's force on bone and the forces
/// of bodies may be of the same push, so the larger one counts. What is no number counts as 0.
pub(crate) fn force_n(sample: &ToolSample) -> f64 {
    let bodies_n =
        sample.forces_n.as_ref().map(|forces| forces.iter().map(|(_, force_n)| *force_n).sum::<Vec3>().length());
    let force_n = match (bodies_n, sample.drilling_n) {
        (Some(bodies_n), Some(drilling_n)) => bodies_n.max(drilling_n),
        (Some(force_n), None) | (None, Some(force_n)) => force_n,
        (None, None) => sample.contact_n,
    };
    if force_n.is_finite() { f64::from(force_n.max(0.0)) } else { 0.0 }
}
