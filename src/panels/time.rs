//! Play, pause, single step, slow motion.

use crate::pacing::Pacing;
use bevy::prelude::*;
use bevy_egui::egui;

/// Speeds that can be chosen.
const SPEEDS: [f32; 6] = [0.1, 0.25, 0.5, 1.0, 2.0, 4.0];

/// Plays or pauses the simulation.
pub fn toggle_pause(world: &mut World) {
    let mut time = world.resource_mut::<Time<Virtual>>();
    if time.is_paused() { time.unpause() } else { time.pause() }
}

/// Performs one step of a simulation, and pauses it.
pub fn single_step(world: &mut World) {
    world.resource_mut::<Time<Virtual>>().pause();
    let mut fixed = world.resource_mut::<Time<Fixed>>();
    let step = fixed.timestep();
    // What is left of a step from before would make another one later.
    let left = fixed.overstep();
    fixed.discard_overstep(left);
    fixed.accumulate_overstep(step);
}

/// The next slower (`-1`) or faster (`1`) speed.
pub fn change_speed(world: &mut World, by: i32) {
    let mut time = world.resource_mut::<Time<Virtual>>();
    let now = time.relative_speed();
    let nearest = SPEEDS.iter().enumerate().min_by(|one, other| (one.1 - now).abs().total_cmp(&(other.1 - now).abs()));
    let index = nearest.map_or(3, |(index, _)| index as i32) + by;
    time.set_relative_speed(SPEEDS[index.clamp(0, SPEEDS.len() as i32 - 1) as usize]);
}

/// Buttons for time, in a row. Whether "Reset" was pressed, which the program has to do itself.
pub fn time_panel(ui: &mut egui::Ui, world: &mut World) -> bool {
    let time = world.resource::<Time<Virtual>>();
    let (is_paused, speed) = (time.is_paused(), time.relative_speed());
    let (symbol, told) = if is_paused { ("▶", "Play (Space)") } else { ("⏸", "Pause (Space)") };
    if ui.button(symbol).on_hover_text(told).clicked() {
        toggle_pause(world);
    }
    let step_ms = world.resource::<Time<Fixed>>().timestep().as_secs_f64() * 1e3;
    if ui.button("⏭").on_hover_text(format!("One step of {step_ms:.1} ms (.)")).clicked() {
        single_step(world);
    }
    let mut chosen = speed;
    egui::ComboBox::from_id_salt("speed")
        .selected_text(format!("{speed}x"))
        .width(60.0)
        .show_ui(ui, |ui| {
            for speed in SPEEDS {
                let told = if speed < 1.0 { "Slow motion" } else { "Times as fast as real" };
                ui.selectable_value(&mut chosen, speed, format!("{speed}x")).on_hover_text(told);
            }
        })
        .response
        .on_hover_text("Speed: simulated seconds per second (, slower, / faster)");
    if chosen != speed {
        world.resource_mut::<Time<Virtual>>().set_relative_speed(chosen);
    }
    let is_reset = ui.button("⏮").on_hover_text("Reset: everything as it was set up (Ctrl+R)").clicked();
    let fixed_s = world.resource::<Time<Fixed>>().elapsed_secs_f64();
    ui.label(format!("{fixed_s:.2} s")).on_hover_text("Simulated time, seconds");
    if let Some(pacing) = world.get_resource::<Pacing>().filter(|pacing| pacing.lost_last_frame_s > 0.0) {
        let told = format!(
            "The machine is too slow for this speed: {:.1} s of simulated time were given up so far",
            pacing.lost_s
        );
        ui.colored_label(ui.visuals().warn_fg_color, "slow").on_hover_text(told);
    }
    is_reset
}
