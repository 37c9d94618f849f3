//! This run beside earlier ones.

use super::section;
use super::svg::{GOOD, Scale, Svg};
use super::text::{label, metric, number};
use crate::scenario::metrics::MetricKind;
use crate::scenario::report::RunReport;

/// Runs that are shown, this one with them.
const MOST_RUNS: usize = 20;
/// Metrics that are shown.
const MOST_METRICS: usize = 8;

/// Metrics that trainers ask for, where the scenario weighs none.
const USUAL: [MetricKind; 8] = [
    MetricKind::Time,
    MetricKind::PathLength,
    MetricKind::Sparc,
    MetricKind::MaxForce,
    MetricKind::SeenRemoval,
    MetricKind::RemovedOutside,
    MetricKind::CriticalContacts,
    MetricKind::BloodLoss,
];

pub(super) fn compare(report: &RunReport, earlier: &[RunReport]) -> String {
    let same: Vec<&RunReport> = earlier.iter().filter(|run| run.scenario == report.scenario).collect();
    if same.is_empty() {
        return String::new();
    }
    let left_out = (same.len() + 1).saturating_sub(MOST_RUNS);
    let runs: Vec<&RunReport> = same[left_out..].iter().copied().chain([report]).collect();
    let score = |run: &&RunReport| run.outcome.score.map(f64::from).filter(|score| score.is_finite());
    let mut content =
        multiple("Score", &runs.iter().map(score).collect::<Vec<_>>(), left_out, &number, |svg, scale| {
            let y = scale.at(f64::from(report.outcome.pass_score));
            svg.line("mark", [4.0, y], [196.0, y]);
        });
    for (kind, name) in chosen(report) {
        let found =
            |run: &&RunReport| run.metrics.iter().find(|metric| metric.kind == kind).and_then(|metric| metric.value);
        let values: Vec<Option<f64>> =
            runs.iter().map(found).map(|value| value.filter(|value| value.is_finite())).collect();
        if values.iter().flatten().count() > 1 {
            content += &multiple(&name, &values, left_out, &|value| metric(kind, value, kind.unit()), |_, _| {});
        }
    }
    let note = "Each dot is a run, this one the last and filled. Below: the range that is drawn. Dashed: score from which it is passed.";
    section("", "Earlier runs", note, &format!("<div class=\"multiples\">{content}</div>"))
}

/// Those with weight, else the usual ones.
fn chosen(report: &RunReport) -> Vec<(MetricKind, String)> {
    let weighted = report.metrics.iter().filter(|metric| metric.weight > 0.0);
    let mut chosen: Vec<_> = weighted.map(|metric| (metric.kind, metric.name.clone())).collect();
    if chosen.is_empty() {
        let usual = USUAL.iter().filter_map(|kind| report.metrics.iter().find(|metric| metric.kind == *kind));
        chosen = usual.map(|metric| (metric.kind, metric.name.clone())).collect();
    }
    chosen.truncate(MOST_METRICS);
    chosen
}

/// A small drawing of one number over runs.
fn multiple(
    name: &str,
    values: &[Option<f64>],
    left_out: usize,
    told: &dyn Fn(f64) -> String,
    more: impl Fn(&mut Svg, &Scale),
) -> String {
    let mut svg = Svg::new(200.0, 84.0);
    let is_score = name == "Score";
    let known: Vec<f64> = values.iter().flatten().copied().collect();
    let low = known.iter().copied().fold(f64::INFINITY, f64::min);
    let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let range = if is_score { [0.0, 100.0] } else { [low.min(0.0), high.max(0.0)] };
    let scale = Scale::new(range, [66.0, 8.0]);
    let along = Scale::new([0.0, (values.len() - 1).max(1) as f64], [10.0, 190.0]);
    let zero = scale.at(0.0);
    svg.line("axis", [4.0, zero], [196.0, zero]);
    more(&mut svg, &scale);
    let points: Vec<[f64; 2]> = (0..)
        .zip(values)
        .filter_map(|(index, value)| Some([along.at(f64::from(index)), scale.at((*value)?)]))
        .collect();
    svg.polyline(&format!("stroke=\"{GOOD}\" stroke-width=\"1.2\" stroke-opacity=\".6\""), &points);
    let last = values.last().copied().flatten().map(|_| points.len() - 1);
    for (index, point) in points.iter().enumerate() {
        let is_last = Some(index) == last;
        let fill = if is_last { GOOD } else { "#fff" };
        svg.circle(
            &format!("fill=\"{fill}\" stroke=\"{GOOD}\" stroke-width=\"1.4\""),
            *point,
            if is_last { 4.2 } else { 2.8 },
        );
    }
    svg.text("tick", "start", [4.0, 81.0], &format!("run {}", left_out + 1));
    svg.text("tick", "end", [196.0, 81.0], &format!("run {}", left_out + values.len()));
    if range[0] < range[1] {
        svg.text("tick", "middle", [100.0, 81.0], &format!("{} to {}", told(range[0]), told(range[1])));
    }
    let now = values.last().copied().flatten().map_or("–".into(), told);
    let name = label(name, 34);
    format!("<div><b>{name}</b> <span class=\"now\">{now}</span>{}</div>", svg.finish(&format!("{name} over runs")))
}
