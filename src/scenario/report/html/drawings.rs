//! What is drawn over time: the timeline and the forces.

use super::section;
use super::svg::{BLOOD, COLOURS, GOOD, Scale, Svg, WIDTH, WRONG, time_axis};
use super::text::{label, moment, number, short};
use crate::scenario::Severity;
use crate::scenario::report::{ContactSpan, GoalReport, RunReport, ToolSeries};
use std::collections::BTreeMap;

/// Where the names of lanes end.
const LEFT: f64 = 192.0;
const RIGHT: f64 = WIDTH - 8.0;
/// Where the lanes of goals and violations end.
const LANES_TOP: f64 = 64.0;
/// Lanes of contacts.
const MOST_LANES: usize = 10;
/// Marks of violations in a drawing.
const MOST_MARKS: usize = 200;

fn time_scale(report: &RunReport, left: f64) -> Scale {
    Scale::new([0.0, report.outcome.time_s.unwrap_or(0.0)], [left, RIGHT])
}

/// A violation's mark: hollow, filled, or square, by how bad it is.
fn mark(svg: &mut Svg, severity: Severity, tip: [f64; 2]) {
    let filled = format!("fill=\"{WRONG}\" stroke=\"{WRONG}\"");
    match severity {
        Severity::Warning => svg.triangle(&format!("fill=\"#fff\" stroke=\"{WRONG}\""), tip, 8.0),
        Severity::Error => svg.triangle(&filled, tip, 8.0),
        Severity::Failure => svg.rect(&filled, [tip[0] - 4.0, tip[1] - 8.0], [8.0, 8.0]),
    }
}

pub(super) fn timeline(report: &RunReport) -> String {
    let lanes = lanes(&report.series.contacts);
    let has_blood = report.series.bleeding.iter().any(|point| point.lost_ml > 0.0);
    let is_empty = report.outcome.time_s.is_none_or(|time_s| time_s <= 0.0);
    if is_empty || (report.goals.is_empty() && report.violations.is_empty() && lanes.is_empty() && !has_blood) {
        return String::new();
    }
    let blood_height = if has_blood { 46.0 } else { 0.0 };
    let bottom = LANES_TOP + blood_height + 17.0 * lanes.len() as f64;
    let mut svg = Svg::new(WIDTH, bottom + 30.0);
    let scale = time_scale(report, LEFT);
    time_axis(&mut svg, &scale, 4.0, bottom);
    goals(&mut svg, report, &scale);
    lane_name(&mut svg, 52.0, "Violations", "strong");
    for violation in report.violations.iter().take(MOST_MARKS) {
        mark(&mut svg, violation.severity, [scale.at(violation.time_s), 53.0]);
    }
    let mut y = LANES_TOP;
    if has_blood {
        blood(&mut svg, report, &scale, y);
        y += blood_height;
    }
    for lane in &lanes {
        svg.line("grid", [8.0, y], [RIGHT, y]);
        let name = format!("{}{} – {}", if lane.is_critical { "▲ " } else { "" }, lane.structure, lane.tool);
        lane_name(&mut svg, y + 12.0, &label(&name, 34), if lane.is_critical { "strong" } else { "" });
        let colour = if lane.is_critical { WRONG } else { "#7f8b95" };
        for [from_s, to_s] in &lane.spans {
            let (from, to) = (scale.at(*from_s), scale.at(*to_s));
            svg.rect(&format!("fill=\"{colour}\""), [from, y + 4.0], [(to - from).max(1.0), 9.0]);
        }
        y += 17.0;
    }
    svg.line("axis", [LEFT, bottom], [RIGHT, bottom]);
    let note = "Diamonds: goals by their number. Triangles: warnings (hollow) and errors (filled); squares: failures. \
                Bars: contacts; ▲ marks critical structures.";
    section("", "Timeline", note, &svg.finish("Timeline of goals, violations, blood and contacts"))
}

/// Goals by their number; those that would hide one another stand in two rows.
fn goals(svg: &mut Svg, report: &RunReport, scale: &Scale) {
    lane_name(svg, 22.0, "Goals reached", "strong");
    let reached = |(index, goal): (usize, &GoalReport)| Some((scale.at(goal.reached_s?), index + 1));
    let mut marks: Vec<(f64, usize)> = report.goals.iter().enumerate().filter_map(reached).collect();
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut before, mut y) = (f64::NEG_INFINITY, 12.0);
    for (x, number) in marks {
        y = if x - before < 17.0 && y == 12.0 { 28.0 } else { 12.0 };
        before = x;
        svg.diamond(&format!("fill=\"{GOOD}\""), [x, y], 9.0);
        svg.text("num", "middle", [x, y + 3.0], &number.to_string());
    }
}

fn lane_name(svg: &mut Svg, y: f64, name: &str, class: &str) {
    svg.text(class, "start", [0.0, y], name);
}

/// What was lost so far: also from what has no rate of its own, as bone that is drilled.
fn blood(svg: &mut Svg, report: &RunReport, time: &Scale, top: f64) {
    let points = &report.series.bleeding;
    let most = points.iter().map(|point| point.lost_ml).fold(0.0, f64::max);
    let (low, high) = (top + 42.0, top + 6.0);
    let scale = Scale::new([0.0, most], [low, high]);
    lane_name(svg, top + 20.0, "Blood lost", "strong");
    svg.text("tick", "start", [0.0, top + 34.0], &format!("up to {} ml", number(most)));
    svg.line("grid", [8.0, top], [RIGHT, top]);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return };
    let mut outline = vec![[time.at(first.time_s), low]];
    outline.extend(points.iter().map(|point| [time.at(point.time_s), scale.at(point.lost_ml)]));
    outline.extend([[RIGHT, scale.at(last.lost_ml)], [RIGHT, low]]);
    svg.polygon(&format!("fill=\"{BLOOD}\" fill-opacity=\".35\" stroke=\"{BLOOD}\" stroke-width=\".8\""), &outline);
}

/// Contacts of an instrument with a structure.
struct Lane<'a> {
    tool: &'a str,
    structure: &'a str,
    is_critical: bool,
    spans: Vec<[f64; 2]>,
}

/// The critical ones first, then the longest.
fn lanes(contacts: &[ContactSpan]) -> Vec<Lane<'_>> {
    let mut lanes: BTreeMap<(&str, &str), Lane> = BTreeMap::new();
    for span in contacts {
        let lane = lanes.entry((&span.tool, &span.structure)).or_insert_with(|| Lane {
            tool: &span.tool,
            structure: &span.structure,
            is_critical: span.is_critical,
            spans: Vec::new(),
        });
        lane.spans.push([span.from_s, span.to_s]);
    }
    let mut lanes: Vec<Lane> = lanes.into_values().collect();
    let length = |lane: &Lane| lane.spans.iter().map(|[from_s, to_s]| to_s - from_s).sum::<f64>();
    lanes.sort_by(|a, b| b.is_critical.cmp(&a.is_critical).then(length(b).total_cmp(&length(a))));
    lanes.truncate(MOST_LANES);
    lanes
}

pub(super) fn force(report: &RunReport) -> String {
    let presses = |tool: &&ToolSeries| tool.force.iter().any(|point| point.max_n > 0.0);
    let tools: Vec<&ToolSeries> = report.series.tools.iter().filter(presses).take(COLOURS.len()).collect();
    if tools.is_empty() {
        return String::new();
    }
    let most_n = tools.iter().flat_map(|tool| &tool.force).map(|point| point.max_n).fold(0.0, f64::max);
    let (height, left) = (112.0, 40.0);
    let bottom = height * tools.len() as f64;
    let mut svg = Svg::new(WIDTH, bottom + 30.0);
    let time = time_scale(report, left);
    time_axis(&mut svg, &time, 4.0, bottom);
    for (index, tool) in tools.iter().enumerate() {
        let (top, low) = (height * index as f64 + 28.0, height * (index + 1) as f64);
        let scale = Scale::new([0.0, most_n], [low, top]);
        for tick in scale.ticks(3.0) {
            svg.line("grid", [left, scale.at(tick)], [RIGHT, scale.at(tick)]);
            svg.text("tick", "end", [left - 5.0, scale.at(tick) + 3.5], &short(tick));
        }
        for piece in pieces(tool) {
            let mut outline = vec![[time.at(piece[0].time_s), low]];
            outline.extend(piece.iter().map(|point| [time.at(point.time_s), scale.at(point.max_n)]));
            outline.push([time.at(piece[piece.len() - 1].time_s), low]);
            svg.polygon(&format!("fill=\"{}\" fill-opacity=\".22\"", COLOURS[index]), &outline);
            let mean: Vec<_> = piece.iter().map(|point| [time.at(point.time_s), scale.at(point.mean_n)]).collect();
            svg.polyline(&format!("stroke=\"{}\" stroke-width=\"1.3\"", COLOURS[index]), &mean);
        }
        let own = report.violations.iter().filter(|violation| violation.tool.as_deref() == Some(&tool.tool));
        for violation in own.take(MOST_MARKS) {
            let x = time.at(violation.time_s);
            svg.line("mark", [x, top], [x, low]);
            mark(&mut svg, violation.severity, [x, top]);
        }
        svg.line("axis", [left, low], [RIGHT, low]);
        svg.raw("<g paint-order=\"stroke\" stroke=\"#fff\" stroke-width=\"3\">");
        svg.text("strong", "start", [left + 4.0, top - 11.0], &format!("{}, N", label(&tool.tool, 40)));
        svg.raw("</g>");
    }
    let first = report.violations.iter().find(|violation| violation.unit == "N");
    let first =
        first.map_or(String::new(), |first| format!(" The first force above a limit was at {}.", moment(first.time_s)));
    let note = format!(
        "Line: mean; area: largest force in each piece of time. Triangles: violations of the instrument.{first}"
    );
    section("", "Force over time", &note, &svg.finish("Force of each instrument over time"))
}

/// Points that follow one another without a pause.
fn pieces(tool: &ToolSeries) -> Vec<&[crate::scenario::report::ForcePoint]> {
    let step_s = tool.force.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).reduce(f64::min).unwrap_or(0.0);
    tool.force.chunk_by(|a, b| b.time_s - a.time_s <= 1.5 * step_s).collect()
}
