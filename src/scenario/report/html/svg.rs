//! Drawings: coordinates that are always numbers, axes, colours.

use super::text::short;
use std::fmt::Write;

/// Colours that people with any colour vision tell apart (Okabe and Ito 2008): blue, vermilion, green, purple, orange, sky.
pub(super) const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#007a5a", "#a3508a", "#b07800", "#3a8fc4"];
/// Patterns of lines, so that instruments differ without colours.
pub(super) const DASHES: [&str; 6] = ["none", "6 3", "1.5 2.5", "8 3 1.5 3", "3 3", "10 4"];
/// What is good and seen.
pub(super) const GOOD: &str = "#0072b2";
/// What could not be seen.
pub(super) const UNSEEN: &str = "#c98500";
/// What is wrong.
pub(super) const WRONG: &str = "#d55e00";
/// Blood.
pub(super) const BLOOD: &str = "#8c2f39";
/// Width of a drawing, in units of which a page has 720.
pub(super) const WIDTH: f64 = 720.0;

/// A drawing.
pub(super) struct Svg {
    body: String,
    height: f64,
    width: f64,
}

impl Svg {
    pub fn new(width: f64, height: f64) -> Self {
        Self { body: String::new(), width, height }
    }

    /// The drawing, with a text for those who cannot see it (already escaped).
    pub fn finish(self, title: &str) -> String {
        format!(
            "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{title}\">{}</svg>",
            at(self.width),
            at(self.height),
            self.body
        )
    }

    pub fn raw(&mut self, text: &str) {
        self.body += text;
    }

    pub fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(at);
        let _ = write!(self.body, "<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>");
    }

    /// `more` are attributes.
    pub fn rect(&mut self, more: &str, place: [f64; 2], size: [f64; 2]) {
        let [x, y, width, height] = [place[0], place[1], size[0].max(0.0), size[1].max(0.0)].map(at);
        let _ = write!(self.body, "<rect {more} x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>");
    }

    pub fn circle(&mut self, more: &str, middle: [f64; 2], radius: f64) {
        let [x, y, r] = [middle[0], middle[1], radius].map(at);
        let _ = write!(self.body, "<circle {more} cx=\"{x}\" cy=\"{y}\" r=\"{r}\"/>");
    }

    /// A text that is escaped already; `anchor` is start, middle or end.
    pub fn text(&mut self, class: &str, anchor: &str, place: [f64; 2], text: &str) {
        let [x, y] = place.map(at);
        let _ = write!(self.body, "<text class=\"{class}\" text-anchor=\"{anchor}\" x=\"{x}\" y=\"{y}\">{text}</text>");
    }

    pub fn polyline(&mut self, more: &str, points: &[[f64; 2]]) {
        let _ = write!(self.body, "<polyline fill=\"none\" {more} points=\"{}\"/>", list(points));
    }

    pub fn polygon(&mut self, more: &str, points: &[[f64; 2]]) {
        let _ = write!(self.body, "<polygon {more} points=\"{}\"/>", list(points));
    }

    /// A triangle that stands on its point.
    pub fn triangle(&mut self, more: &str, tip: [f64; 2], size: f64) {
        let [x, y] = tip;
        self.polygon(more, &[[x, y], [x - 0.6 * size, y - size], [x + 0.6 * size, y - size]]);
    }

    /// A square that stands on a corner.
    pub fn diamond(&mut self, more: &str, middle: [f64; 2], radius: f64) {
        let [x, y] = middle;
        self.polygon(more, &[[x, y - radius], [x + radius, y], [x, y + radius], [x - radius, y]]);
    }
}

fn list(points: &[[f64; 2]]) -> String {
    let point = |point: &[f64; 2]| format!("{},{}", at(point[0]), at(point[1]));
    points.iter().map(point).collect::<Vec<_>>().join(" ")
}

/// A coordinate with a digit; 0 for what is no number.
fn at(value: f64) -> f64 {
    if value.is_finite() { (value.clamp(-1e5, 1e5) * 10.0).round() / 10.0 } else { 0.0 }
}

/// A range of values along a part of a drawing.
#[derive(Clone, Copy)]
pub(super) struct Scale {
    values: [f64; 2],
    places: [f64; 2],
}

impl Scale {
    /// A range without extent gets one.
    pub fn new(values: [f64; 2], places: [f64; 2]) -> Self {
        let [low, high] = values.map(|value| if value.is_finite() { value } else { 0.0 });
        let values = if high > low { [low, high] } else { [low, low + 1.0] };
        Self { values, places }
    }

    pub fn at(&self, value: f64) -> f64 {
        let share = (value - self.values[0]) / (self.values[1] - self.values[0]);
        self.places[0] + share * (self.places[1] - self.places[0])
    }

    /// Round values, about so many.
    pub fn ticks(&self, count: f64) -> Vec<f64> {
        let rough = (self.values[1] - self.values[0]) / count;
        let power = 10_f64.powf(rough.log10().floor());
        let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|step| step * power >= rough * 0.999).unwrap_or(10.0);
        if !(step.is_finite() && step > 0.0) {
            return Vec::new();
        }
        let first = (self.values[0] / step).ceil();
        // Not more than asked for, whatever rounding does to large numbers.
        let ticks = (0..=2 * count as u32).map(|index| (first + f64::from(index)) * step);
        ticks.take_while(|tick| *tick <= self.values[1] + 1e-9 * step).collect()
    }
}

/// Times along the bottom of a drawing, in minutes where it is long.
pub(super) fn time_axis(svg: &mut Svg, scale: &Scale, top: f64, bottom: f64) {
    let is_long = scale.values[1] > 180.0;
    let unit_s = if is_long { 60.0 } else { 1.0 };
    let shown = Scale { values: scale.values.map(|value| value / unit_s), places: scale.places };
    for tick in shown.ticks(9.0) {
        let x = shown.at(tick);
        svg.line("grid", [x, top], [x, bottom]);
        svg.text("tick", "middle", [x, bottom + 13.0], &short(tick));
    }
    let unit = if is_long { "time, min" } else { "time, s" };
    svg.text("tick", "end", [scale.places[1], bottom + 26.0], unit);
}
