//! What is drawn in space: the ways of instruments, and what was removed where. Each from the front and from above.

use super::section;
use super::svg::{COLOURS, DASHES, GOOD, Svg, UNSEEN, WIDTH, WRONG};
use super::text::{label, number, short};
use crate::scenario::report::{RemovalDot, ReportBody, RunReport, TrackPoint};
use bevy::math::{DVec3, Vec3};

/// Width of one of both views.
const VIEW: f64 = 348.0;
/// Highest view.
const MOST_HEIGHT: f64 = 330.0;
/// Bodies with a map of their own.
const MOST_BODIES: usize = 3;
/// Largest dot.
const MOST_RADIUS: f64 = 7.0;

/// From where one looks; the world's x axis points right in both.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    /// Against the world's z axis: y points up.
    Front,
    /// Down: z points down.
    Above,
}

impl Side {
    /// Right, down, and towards the eye.
    fn see(self, at_m: Vec3) -> [f64; 3] {
        let at_m: DVec3 = at_m.as_dvec3();
        match self {
            Self::Front => [at_m.x, -at_m.y, at_m.z],
            Self::Above => [at_m.x, at_m.z, at_m.y],
        }
    }
}

/// Two views of the same box, at one scale.
struct Views {
    low_m: Vec3,
    high_m: Vec3,
    per_m: f64,
    height: f64,
}

impl Views {
    /// A box with room around it; none where it has no extent.
    fn of(low_m: Vec3, high_m: Vec3) -> Option<Self> {
        let room_m = 0.06 * (high_m - low_m).max_element();
        let (low_m, high_m) = (low_m - room_m, high_m + room_m);
        let size_m = (high_m - low_m).as_dvec3();
        let deep_m = size_m.y.max(size_m.z);
        let per_m = (VIEW / size_m.x).min(MOST_HEIGHT / deep_m);
        let is_box = low_m.is_finite() && high_m.is_finite() && per_m.is_finite() && deep_m > 0.0;
        is_box.then_some(Self { low_m, high_m, per_m, height: deep_m * per_m })
    }

    fn left(side: Side) -> f64 {
        if side == Side::Front { 1.0 } else { WIDTH - VIEW - 1.0 }
    }

    fn at(&self, side: Side, at_m: Vec3) -> [f64; 2] {
        let middle = side.see(0.5 * (self.low_m + self.high_m));
        let at = side.see(at_m);
        let x = Self::left(side) + 0.5 * VIEW + (at[0] - middle[0]) * self.per_m;
        [x, 16.0 + 0.5 * self.height + (at[1] - middle[1]) * self.per_m]
    }

    /// A drawing with both frames; what is drawn next is cut off at them.
    fn draw(&self, name: &str, mut content: impl FnMut(&mut Svg, Side)) -> Svg {
        let mut svg = Svg::new(WIDTH, self.height + 40.0);
        for (side, title) in [(Side::Front, "Front"), (Side::Above, "From above")] {
            let left = Self::left(side);
            svg.text("tick", "start", [left, 10.0], title);
            let id = format!("{name}{}", left as u32);
            svg.raw(&format!("<clipPath id=\"{id}\">"));
            svg.rect("", [left, 16.0], [VIEW, self.height]);
            svg.raw("</clipPath>");
            svg.rect("fill=\"#fafbfc\" stroke=\"#d5dbe0\"", [left, 16.0], [VIEW, self.height]);
            svg.raw(&format!("<g clip-path=\"url(#{id})\">"));
            content(&mut svg, side);
            svg.raw("</g>");
            self.ruler(&mut svg, left);
        }
        svg
    }

    /// A round length under a view.
    fn ruler(&self, svg: &mut Svg, left: f64) {
        let rough_mm = 80.0 / self.per_m * 1e3;
        let power = 10_f64.powf(rough_mm.log10().floor());
        let length_mm = power * [5.0, 2.0, 1.0].into_iter().find(|step| step * power <= rough_mm).unwrap_or(1.0);
        let (y, to) = (self.height + 26.0, left + length_mm * 1e-3 * self.per_m);
        svg.line("axis", [left, y], [to, y]);
        svg.line("axis", [left + 0.5, y - 3.0], [left + 0.5, y + 3.0]);
        svg.line("axis", [to, y - 3.0], [to, y + 3.0]);
        svg.text("tick", "start", [to + 6.0, y + 3.5], &format!("{} mm", short(length_mm)));
    }

    fn body(&self, svg: &mut Svg, side: Side, body: &ReportBody) {
        let [a, b] = [body.middle_m - body.half_m, body.middle_m + body.half_m].map(|corner| self.at(side, corner));
        let (low, high) = ([a[0].min(b[0]), a[1].min(b[1])], [a[0].max(b[0]), a[1].max(b[1])]);
        let line = "fill=\"none\" stroke=\"#8a949d\" stroke-width=\".8\" stroke-dasharray=\"4 3\"";
        svg.rect(line, low, [high[0] - low[0], high[1] - low[1]]);
        // Its name stays in the frame when its corner does not.
        let corner = [low[0].max(Self::left(side)) + 4.0, low[1].max(16.0) + 11.0];
        svg.text("tick small", "start", corner, &label(&body.name, 30));
    }
}

/// The range of most of the values: those that lie far out do not make everything else small.
fn most(mut values: Vec<f32>) -> Option<[f32; 2]> {
    values.retain(|value| value.is_finite());
    values.sort_by(f32::total_cmp);
    let cut = values.len() / 200;
    Some([*values.get(cut)?, *values.get(values.len() - 1 - cut)?])
}

pub(super) fn ways(report: &RunReport) -> String {
    let tools: Vec<_> = report.series.tools.iter().filter(|tool| tool.track.len() > 1).take(COLOURS.len()).collect();
    let along = |axis: usize| most(tools.iter().flat_map(|tool| &tool.track).map(|point| point.tip_m[axis]).collect());
    let (Some(x), Some(y), Some(z)) = (along(0), along(1), along(2)) else { return String::new() };
    let corner = |end: usize| Vec3::new(x[end], y[end], z[end]);
    let Some(views) = Views::of(corner(0), corner(1)) else { return String::new() };
    let svg = views.draw("way", |svg, side| {
        report.series.bodies.iter().for_each(|body| views.body(svg, side, body));
        for (index, tool) in tools.iter().enumerate() {
            let line = format!("stroke=\"{}\" stroke-linejoin=\"round\"", COLOURS[index]);
            let idle =
                format!("{line} stroke-width=\".7\" stroke-opacity=\".6\" stroke-dasharray=\"{}\"", DASHES[index]);
            let busy = format!("{line} stroke-width=\"1.5\"");
            for piece in tool.track.chunk_by(|_, next| !next.is_new) {
                parts(piece, |points, is_working| {
                    let points: Vec<_> = points.iter().map(|point| views.at(side, point.tip_m)).collect();
                    svg.polyline(if is_working { &busy } else { &idle }, &points);
                });
            }
        }
        for (tool, colour) in tools.iter().zip(COLOURS) {
            let ends = tool.track.first().zip(tool.track.last()).map(|ends| [ends.0.tip_m, ends.1.tip_m]);
            let Some([first, last]) = ends.map(|ends| ends.map(|at_m| views.at(side, at_m))) else { continue };
            svg.circle(&format!("fill=\"#fff\" stroke=\"{colour}\" stroke-width=\"1.6\""), first, 4.0);
            svg.diamond(&format!("fill=\"{colour}\" stroke=\"#fff\""), last, 5.0);
        }
    });
    let entry = |(index, tool): (usize, &&crate::scenario::report::ToolSeries)| {
        let mut key = Svg::new(26.0, 12.0);
        let line = format!("stroke=\"{}\" stroke-width=\"1.8\" stroke-dasharray=\"{}\"", COLOURS[index], DASHES[index]);
        key.polyline(&line, &[[0.0, 6.0], [26.0, 6.0]]);
        format!("<li>{}{}</li>", key.finish(""), label(&tool.tool, 60))
    };
    let legend: String = tools.iter().enumerate().map(entry).collect();
    let note = "Thick: the pedal is down. ○ begin, ◆ end. The outermost half percent to each side may be cut off.";
    let content =
        format!("{}<ul class=\"legend\">{legend}</ul>", svg.finish("Ways of the instruments, from two sides"));
    section("", "Ways of the instruments", note, &content)
}

/// Parts of a way with the pedal down or up; each begins where the one before ends.
fn parts(piece: &[TrackPoint], mut draw: impl FnMut(&[TrackPoint], bool)) {
    let mut from = 0;
    for to in 1..=piece.len() {
        if to == piece.len() || piece[to].is_working != piece[from].is_working {
            draw(&piece[from..(to + 1).min(piece.len())], piece[from].is_working);
            from = to;
        }
    }
}

pub(super) fn removals(report: &RunReport) -> String {
    let dots_of = |body: u32| report.series.removals.iter().filter(|dot| dot.body == body).collect::<Vec<_>>();
    let bodies = (0..).zip(&report.series.bodies).map(|(index, body)| (index, body, dots_of(index)));
    let bodies: Vec<_> = bodies.filter(|(_, _, dots)| !dots.is_empty()).take(MOST_BODIES).collect();
    let most_mm3 = bodies.iter().flat_map(|(_, _, dots)| dots).map(|dot| dot.mm3).fold(0.0, f64::max);
    let content: String = bodies.iter().filter_map(|(index, body, dots)| map(*index, body, dots, most_mm3)).collect();
    if content.is_empty() {
        return String::new();
    }
    let key = |draw: fn(&mut Svg), name: &str| {
        let mut svg = Svg::new(26.0, 12.0);
        draw(&mut svg);
        format!("<li>{}{name}</li>", svg.finish(""))
    };
    let legend = [
        key(|svg| dot(svg, [13.0, 6.0], 4.0, Some(true), true), "in sight"),
        key(|svg| dot(svg, [13.0, 6.0], 4.0, Some(false), true), "not in sight"),
        key(|svg| dot(svg, [13.0, 6.0], 4.0, None, true), "not known"),
        key(|svg| dot(svg, [13.0, 6.0], 4.0, Some(true), false), "outside targets"),
        key(|svg| dot(svg, [13.0, 6.0], 4.0, Some(false), false), "outside targets, not in sight"),
    ];
    let note =
        format!("Area of a dot: volume; the largest is {} mm³. Dashed: the box of the volume.", number(most_mm3));
    section("", "Removed matter", &note, &format!("{content}<ul class=\"legend\">{}</ul>", legend.concat()))
}

fn map(index: u32, body: &ReportBody, dots: &[&RemovalDot], most_mm3: f64) -> Option<String> {
    let box_m = [body.middle_m - body.half_m, body.middle_m + body.half_m];
    let low_m = dots.iter().fold(box_m[0].min(box_m[1]), |low_m, dot| low_m.min(dot.at_m));
    let high_m = dots.iter().fold(box_m[0].max(box_m[1]), |high_m, dot| high_m.max(dot.at_m));
    let views = Views::of(low_m, high_m)?;
    let svg = views.draw(&format!("map{index}-"), |svg, side| {
        views.body(svg, side, body);
        let mut sorted = dots.to_vec();
        // What is nearer to the eye lies over what is farther.
        sorted.sort_by(|a, b| side.see(a.at_m)[2].total_cmp(&side.see(b.at_m)[2]));
        for removal in sorted {
            let radius = (MOST_RADIUS * (removal.mm3 / most_mm3).sqrt()).max(0.8);
            let seen = removal.seen.map(|seen| seen >= 0.5);
            dot(svg, views.at(side, removal.at_m), radius, seen, removal.inside.is_none_or(|inside| inside >= 0.5));
        }
    });
    Some(svg.finish("Where matter was removed, from two sides"))
}

/// A disc inside the targets, a square outside; filled where it was seen.
fn dot(svg: &mut Svg, middle: [f64; 2], radius: f64, seen: Option<bool>, is_inside: bool) {
    let filled = |colour: &str| format!("fill=\"{colour}\" fill-opacity=\".75\" stroke=\"#fff\" stroke-width=\".3\"");
    let hollow = |colour: &str| format!("fill=\"#fff\" fill-opacity=\".6\" stroke=\"{colour}\" stroke-width=\"1\"");
    let look = match (is_inside, seen) {
        (true, Some(true)) => filled(GOOD),
        (true, Some(false)) => hollow(UNSEEN),
        (true, None) => filled("#7f8b95"),
        (false, Some(false)) => hollow(WRONG),
        (false, _) => filled(WRONG),
    };
    if is_inside {
        svg.circle(&look, middle, radius);
    } else {
        svg.rect(&look, [middle[0] - radius, middle[1] - radius], [2.0 * radius, 2.0 * radius]);
    }
}
