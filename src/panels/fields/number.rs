//! Numbers with their units.

use super::{Limits, Place};
use bevy_egui::egui;

/// A number with few digits: 0.0035, 12.5, 4000.
pub(super) fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A control for a number; `is_whole` for counts.
pub(super) fn number(ui: &mut egui::Ui, stored: &mut f64, is_whole: bool, place: Place) -> egui::Response {
    let factor = place.unit.shown_per_stored;
    let mut shown = *stored * factor;
    let before = shown;
    let suffix = if place.unit.symbol.is_empty() { String::new() } else { format!(" {}", place.unit.symbol) };
    let response = match place.limits {
        Some(Limits { least, greatest, is_logarithmic }) if ui.available_width() > 150.0 => {
            ui.spacing_mut().slider_width = (ui.available_width() - 90.0).max(50.0);
            let range = least * factor..=greatest * factor;
            let slider = egui::Slider::new(&mut shown, range)
                .logarithmic(is_logarithmic)
                .clamping(egui::SliderClamping::Edits)
                .suffix(suffix)
                .custom_formatter(|value, _| short(value));
            ui.add(if is_whole { slider.integer() } else { slider })
        }
        limits => {
            // A hundredth of what it is per point, and of what is usual where it is nothing.
            let usual = if factor > 100.0 { 1.0 } else { 0.1 };
            let speed = if is_whole { 0.1 } else { (shown.abs() * 0.01).max(usual * 0.01) };
            let mut drag = egui::DragValue::new(&mut shown).speed(speed).suffix(suffix);
            if let Some(limits) = limits {
                drag = drag.range(limits.least * factor..=limits.greatest * factor);
            }
            drag = if is_whole { drag.fixed_decimals(0) } else { drag.custom_formatter(|value, _| short(value)) };
            ui.add(drag)
        }
    };
    // Compared as shown: there and back the stored one would be a hair off.
    if shown != before {
        *stored = shown / factor;
    }
    response
}
