//! Pools: what is in them.

use super::edit;
use crate::pool::{PoolFault, PoolLevel, PoolState, WaterBudget};
use bevy::prelude::*;
use bevy_egui::egui;

/// What the pool holds just now.
pub(super) fn pool(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    if let Some(PoolFault(fault)) = world.get::<PoolFault>(entity) {
        ui.colored_label(ui.visuals().error_fg_color, fault.to_string()).on_hover_text("Why the pool does not flow");
    }
    let Some(state) = world.get::<PoolState>(entity) else { return };
    let level = match (state.level_m, state.rim_m) {
        (Some(level_m), Some(rim_m)) => format!("{:.1} mm below the rim", (rim_m - level_m) * 1e3),
        _ => "no cavity yet".into(),
    };
    ui.label(format!(
        "{level}; {} cells wet, {:.1} mm deep, {:.2} ml of blood, {:.0} % hidden",
        state.wet_cells,
        state.mean_depth_m * 1e3,
        state.blood_ml,
        state.hidden_share * 100.0
    ))
    .on_hover_text(
        "Level, cells with fluid, mean depth, blood in the fluid, share of the field that blood and dust hide",
    );
}

/// Where the fluid came from and went to.
pub(super) fn level(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    ui.horizontal(|ui| {
        for (name, told, level) in [
            ("By budget", "What flows in and out sets the level", PoolLevel::Balanced),
            ("Fixed", "The level stays where it is set, in metres over the pool's origin", PoolLevel::Fixed(0.0)),
        ] {
            let now = world.get::<PoolLevel>(entity);
            let is_it = now.is_some_and(|now| std::mem::discriminant(now) == std::mem::discriminant(&level));
            if ui.selectable_label(is_it, name).on_hover_text(told).clicked() && !is_it {
                edit(world, entity, level, "Level of the pool");
            }
        }
    });
    let Some(water) = world.get::<WaterBudget>(entity) else { return };
    ui.label(format!(
        "{:.1} ml: {:.1} irrigated, {:.2} bled, {:.1} sucked, {:.1} over the rim",
        water.held_ml, water.irrigated_ml, water.bled_ml, water.sucked_ml, water.overflowed_ml
    ))
    .on_hover_text("What the cavity holds, what came in and what went out, millilitres");
}
