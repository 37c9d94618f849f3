//! What the structures of a volume are like.

use super::edit;
use super::fields::Unit;
use crate::volume::structures::{Structure, StructureChanges};
use crate::volume::{CtVolume, Volume};
use bevy::prelude::*;
use bevy_egui::egui;

/// A table of structures. What is changed takes the place of what the file says.
pub(super) fn structures(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let list = world
        .get::<CtVolume>(entity)
        .and_then(|body| world.resource::<Assets<Volume>>().get(&body.0))
        .and_then(|volume| Some(volume.structures()?.list().to_vec()));
    let Some(list) = list.filter(|list| !list.is_empty()) else {
        ui.weak("The volume names no structures, or is not loaded.");
        return;
    };
    let before = world.get::<StructureChanges>(entity).cloned().unwrap_or_default();
    // While a number is dragged it counts here only: each change of the volume's structures is shown anew everywhere.
    let memory = ui.id().with("structures");
    let held: Option<(StructureChanges, StructureChanges)> = ui.data(|data| data.get_temp(memory));
    let mut changes = match held {
        Some((of, held)) if of == before => held,
        _ => before.clone(),
    };
    let mut taken_back = None;
    egui::Grid::new("structures").num_columns(6).striped(true).spacing([6.0, 3.0]).show(ui, |ui| {
        for (title, told) in [
            ("Structure", "Its name, as rules of scenarios and reports call it"),
            ("Colour", "Colour, sRGB"),
            ("Hard", "How hard it is to remove, as a multiple of cortical bone"),
            ("Bleeds", "Blood that a cubic millimetre of it lets out per second after it was opened, millilitres"),
            ("Critical", "Whether it must not be touched"),
            ("", ""),
        ] {
            ui.weak(title).on_hover_text(told);
        }
        ui.end_row();
        for structure in &list {
            let change = changes.changes.iter().position(|change| change.name == structure.name);
            let mut now = change.map_or_else(|| structure.clone(), |index| changes.changes[index].clone());
            row(ui, &mut now);
            let told = "Takes back what was changed here";
            if change.is_some() && ui.small_button("↺").on_hover_text(told).clicked() {
                taken_back = change;
            }
            ui.end_row();
            if now != *structure || change.is_some() {
                match change {
                    Some(index) => changes.changes[index] = now,
                    None => changes.changes.push(now),
                }
            }
        }
    });
    if let Some(index) = taken_back {
        changes.changes.remove(index);
    }
    let is_held = ui.input(|input| input.pointer.any_down());
    if is_held && changes != before {
        ui.data_mut(|data| data.insert_temp(memory, (before, changes)));
        return;
    }
    ui.data_mut(|data| data.remove::<(StructureChanges, StructureChanges)>(memory));
    if changes != before {
        edit(world, entity, changes, "Structures");
    }
}

fn row(ui: &mut egui::Ui, structure: &mut Structure) {
    let name = egui::Label::new(&structure.name).truncate().show_tooltip_when_elided(false);
    let height = ui.spacing().interact_size.y;
    let left = egui::Layout::left_to_right(egui::Align::Center);
    let name = ui.allocate_ui_with_layout(egui::vec2(96.0, height), left, |ui| {
        ui.set_min_width(96.0);
        ui.add(name)
    });
    name.inner.on_hover_text(format!("{}: {:?}", structure.name, structure.tissue));
    ui.color_edit_button_srgb(&mut structure.colour).on_hover_text("Colour, sRGB");
    let hardness = egui::DragValue::new(&mut structure.hardness).speed(0.01).range(0.001..=100.0).max_decimals(3);
    ui.add(hardness).on_hover_text("Hardness as a multiple of cortical bone");
    let unit = Unit::of_field("bleeding_ml_per_s_mm3").symbol;
    let rate = egui::DragValue::new(&mut structure.bleeding_ml_per_s_mm3).speed(1e-5).range(0.0..=1.0).max_decimals(6);
    ui.add(rate).on_hover_text(format!("Bleeding, {unit}"));
    ui.checkbox(&mut structure.is_critical, "")
        .on_hover_text("Whether it must not be touched: warnings are given near it");
}
