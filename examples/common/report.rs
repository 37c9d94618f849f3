//! `report.json`: what a run cost and what its models did.

use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_surgery::render::Uploads;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::time::Duration;

/// What is measured while a run goes on.
#[derive(Default)]
pub struct Measures {
    /// From the start until every organ had its shape and every volume was there.
    pub organs_ready: Duration,
    /// Times of frames without organs, with the first one alone, and with all, drawn in turn; milliseconds.
    pub by_organs_shown: [Vec<f64>; 3],
    /// Times of frames without volumes, of those in which all of them were drawn anew, and of those in which nothing had
    /// changed; milliseconds.
    pub by_volumes_shown: [Vec<f64>; 3],
    frames_ms: Vec<f64>,
    uploaded_bytes: Vec<f64>,
    uploaded_rectangles: Vec<f64>,
    spans_ms: BTreeMap<String, Vec<f64>>,
}

impl Measures {
    /// Takes the measures of a frame that was just drawn.
    pub fn take(&mut self, app: &App, frame: Duration) {
        self.frames_ms.push(frame.as_secs_f64() * 1e3);
        let render = app.get_sub_app(RenderApp);
        if let Some(uploads) = render.and_then(|render| render.world().get_resource::<Uploads>()) {
            self.uploaded_bytes.push(uploads.bytes() as f64);
            self.uploaded_rectangles.push(uploads.rectangles() as f64);
        }
        let Some(store) = app.world().get_resource::<DiagnosticsStore>() else { return };
        for diagnostic in store.iter() {
            if let Some(measurement) = diagnostic.measurement() {
                self.spans_ms.entry(diagnostic.path().as_str().to_string()).or_default().push(measurement.value);
            }
        }
    }

    /// The report of the run.
    pub fn report(&self, adapter: &str, size: UVec2, counters: Map<String, Value>) -> Value {
        let spans = |prefix: &str, suffix: &str| -> Map<String, Value> {
            let named = self.spans_ms.iter().filter_map(|(path, values)| {
                let name = path.strip_prefix(prefix)?.strip_suffix(suffix)?;
                Some((name.to_string(), json!(rounded(quantile(values, 0.5)))))
            });
            named.collect()
        };
        let last = |prefix: &str| -> Map<String, Value> {
            let named = self.spans_ms.iter().filter_map(|(path, values)| {
                Some((path.strip_prefix(prefix)?.to_string(), json!(rounded(*values.last()?))))
            });
            named.collect()
        };
        let mut stages = spans("surgery/", "");
        let pace: Map<String, Value> =
            ["steps_per_frame", "lost_time"].iter().filter_map(|name| stages.remove_entry(*name)).collect();
        let mut report = json!({
            "adapter": adapter,
            "size": [size.x, size.y],
            "frames": self.frames_ms.len(),
            "frame_ms": {
                "median": rounded(quantile(&self.frames_ms, 0.5)),
                "p95": rounded(quantile(&self.frames_ms, 0.95)),
            },
            "organs_ready_ms": rounded(self.organs_ready.as_secs_f64() * 1e3),
            "stage_ms": stages,
            "pace": pace,
            // Its last state: it counts from the start.
            "servo": last("servo/"),
            "pass_ms": spans("render/", "/elapsed_gpu"),
            "pass_encoding_ms": spans("render/", "/elapsed_cpu"),
            "bytes_uploaded_per_frame": quantile(&self.uploaded_bytes, 0.5),
            "bytes_uploaded_per_frame_p95": quantile(&self.uploaded_bytes, 0.95),
            "rectangles_uploaded_per_frame": quantile(&self.uploaded_rectangles, 0.5),
            "rectangles_uploaded_per_frame_p95": quantile(&self.uploaded_rectangles, 0.95),
            "counters": counters,
        });
        let mut compare = |times: &[Vec<f64>; 3], names: [&str; 3]| {
            let empty_ms = quantile(&times[0], 0.5);
            if let (false, Some(report)) = (times[0].is_empty(), report.as_object_mut()) {
                report.insert(names[0].into(), json!(rounded(empty_ms)));
                for (name, times) in names.iter().zip(times).skip(1) {
                    report.insert(name.to_string(), json!(rounded(quantile(times, 0.5) - empty_ms)));
                }
            }
        };
        let organs = ["empty_frame_ms", "first_organ_over_empty_ms", "organs_over_empty_ms"];
        compare(&self.by_organs_shown, organs);
        let volumes = ["without_volumes_frame_ms", "volumes_redrawn_over_empty_ms", "volumes_unchanged_over_empty_ms"];
        compare(&self.by_volumes_shown, volumes);
        report
    }
}

fn rounded(ms: f64) -> f64 {
    (ms * 1e4).round() / 1e4
}

/// The value at a share of a list; 0 for an empty one.
fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let place = (sorted.len() as f64 * share) as usize;
    sorted.get(place.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
