//! Microscopes.

use super::edit;
use crate::view::Microscope;
use bevy::prelude::*;
use bevy_egui::egui;

/// The changer's dial.
pub(super) fn microscope(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(microscope) = world.get::<Microscope>(entity).cloned() else { return };
    ui.horizontal(|ui| {
        let told = "The chosen magnification, and the diameter of the field in millimetres";
        ui.label(format!("{:.1}x, field {:.0} mm", microscope.magnification(), microscope.field_m() * 1e3))
            .on_hover_text(told);
        for (sign, told, turn) in [
            ("−", "One magnification down", Microscope::reduce as fn(&mut Microscope)),
            ("+", "One magnification up", Microscope::magnify),
        ] {
            if ui.small_button(sign).on_hover_text(told).clicked() {
                let mut turned = microscope.clone();
                turn(&mut turned);
                edit(world, entity, turned, "Magnification");
            }
        }
    });
}
