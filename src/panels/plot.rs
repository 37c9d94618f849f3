//! Curves drawn into a panel.

use bevy_egui::egui::{self, Color32, Pos2, Rect, Sense, Stroke, StrokeKind, pos2, vec2};

/// A place for curves: shares from 0 to 1, to the right and up.
pub(super) struct Plot {
    pub response: egui::Response,
    pub rect: Rect,
    painter: egui::Painter,
}

impl Plot {
    /// Takes the panel's width and a height in points.
    pub fn new(ui: &mut egui::Ui, height: f32, sense: Sense) -> Self {
        let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), height), sense);
        let rect = response.rect.shrink(1.0);
        let visuals = ui.visuals();
        painter.rect(rect, 2.0, visuals.extreme_bg_color, visuals.widgets.noninteractive.bg_stroke, StrokeKind::Inside);
        Self { response, rect, painter }
    }

    /// Where a place of the plot is on the screen.
    pub fn at(&self, x: f32, y: f32) -> Pos2 {
        pos2(self.rect.left() + x * self.rect.width(), self.rect.bottom() - y * self.rect.height())
    }

    /// The place of the plot at a place of the screen, within the plot.
    pub fn place(&self, at: Pos2) -> (f32, f32) {
        let (x, y) = (at.x - self.rect.left(), self.rect.bottom() - at.y);
        ((x / self.rect.width()).clamp(0.0, 1.0), (y / self.rect.height()).clamp(0.0, 1.0))
    }

    /// A curve through places.
    pub fn curve(&self, places: impl IntoIterator<Item = (f32, f32)>, colour: Color32) {
        let points: Vec<Pos2> = places.into_iter().map(|(x, y)| self.at(x, y.clamp(0.0, 1.0))).collect();
        self.painter.line(points, Stroke::new(1.5, colour));
    }

    /// Bars from the ground, as many as fit.
    pub fn bars(&self, heights: &[f32], colour: Color32) {
        let count = heights.len().max(1) as f32;
        for (index, height) in heights.iter().enumerate().filter(|(_, height)| **height > 0.0) {
            let (left, right) = (index as f32 / count, (index + 1) as f32 / count);
            let bar = Rect::from_two_pos(self.at(left, 0.0), self.at(right, height.min(1.0)));
            self.painter.rect_filled(bar, 0.0, colour);
        }
    }

    /// A point to be seized.
    pub fn handle(&self, x: f32, y: f32, fill: Color32, is_chosen: bool) {
        let rim = if is_chosen { Color32::WHITE } else { Color32::from_gray(160) };
        let radius = if is_chosen { 6.0 } else { 5.0 };
        self.painter.circle(self.at(x, y), radius, fill, Stroke::new(1.5, rim));
    }

    /// A mark.
    pub fn handle_small(&self, x: f32, y: f32, fill: Color32) {
        self.painter.circle_filled(self.at(x, y), 3.5, fill);
    }

    /// An upright line.
    pub fn mark(&self, x: f32, colour: Color32) {
        self.painter.vline(self.at(x, 0.0).x, self.rect.y_range(), Stroke::new(1.0, colour));
    }

    /// A text in a corner: shares of the width and height where it is anchored.
    pub fn text(&self, x: f32, y: f32, align: egui::Align2, text: &str) {
        let at = self.at(x, y) + vec2(if x < 0.5 { 3.0 } else { -3.0 }, if y > 0.5 { 2.0 } else { -2.0 });
        self.painter.text(at, align, text, egui::FontId::proportional(10.0), Color32::from_gray(170));
    }
}
