//! Skin, reactions, highlights.

use super::plot::Plot;
use super::{edit, fields};
use crate::highlights::Highlights;
use crate::highlights::profile::{RingProfile, ring_tilt_rad};
use crate::reactions::ReactionModel;
use crate::reactions::kind::ReactionKinds;
use crate::skin::{OrganPreset, Skin};
use crate::view::ScopeLight;
use bevy::prelude::*;
use bevy_egui::egui::{self, Align2, Color32, Sense};

/// Skins that are ready.
pub(super) fn skin(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Preset").on_hover_text("Cells, colours and sheen of an organ, all at once");
        for preset in [
            OrganPreset::Liver,
            OrganPreset::Gallbladder,
            OrganPreset::Spleen,
            OrganPreset::Kidney,
            OrganPreset::Mucosa,
        ] {
            let name = fields::label_of_type(&format!("{preset:?}"));
            let told = format!("The skin of a {}", preset.name());
            if ui.small_button(name).on_hover_text(told).clicked() {
                let seed = world.get::<Skin>(entity).map_or(0, |skin| skin.seed);
                edit(world, entity, Skin { seed, ..preset.skin() }, &format!("Skin of a {}", preset.name()));
            }
        }
    });
}

/// What happens on the organ just now.
pub(super) fn reactions(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let kinds = world.get_resource::<ReactionKinds>();
    let Some((model, kinds)) = world.get::<ReactionModel>(entity).zip(kinds) else {
        ui.weak("They begin when the organ is loaded.");
        return;
    };
    let told = "Sprites and drops that are there, blood on the organ in millilitres, wounds that bleed";
    ui.label(format!(
        "{} sprites, {} drops, {:.2} ml of blood, {} wounds",
        model.sprite_count(),
        model.drop_count(kinds),
        model.volume_m3() * 1e6,
        model.wounds().len()
    ))
    .on_hover_text(told);
    let told = "Takes all blood, burns and whitening off the organ; cannot be undone";
    if ui.button("Clean the organ").on_hover_text(told).clicked() {
        world.entity_mut(entity).remove::<ReactionModel>();
    }
}

/// The profile of the ring's reflection, dry and wet: the curve that the shader looks up.
pub(super) fn highlights(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(highlights) = world.get::<Highlights>(entity).map(Highlights::clamped) else { return };
    let place_world_m = world.get::<GlobalTransform>(entity).map_or(Vec3::ZERO, GlobalTransform::translation);
    let mut lights = world.query::<(&ScopeLight, &GlobalTransform)>();
    let light = lights.iter(world).next();
    let ring_radius_m = light.map_or(0.005, |(light, _)| light.ring_radius_m);
    let distance_m = light.map_or(0.15, |(_, place)| place.translation().distance(place_world_m)).max(1e-3);
    let ring_tilt_rad = ring_tilt_rad(ring_radius_m, distance_m);
    let widest = highlights.dry_roughness.max(highlights.wet_roughness);
    let reach_rad = ring_tilt_rad + 3.0 * widest;
    let rows: Vec<(Vec<f32>, Color32, f32)> = [
        (highlights.dry_roughness, Color32::from_rgb(220, 180, 120)),
        (highlights.wet_roughness, Color32::from_rgb(110, 180, 255)),
    ]
    .into_iter()
    .map(|(roughness_rad, colour)| {
        let profile = RingProfile { ring_tilt_rad, roughness_rad };
        let row = (0..=120).map(|step| profile.density(reach_rad * step as f32 / 120.0)).collect();
        (row, colour, roughness_rad)
    })
    .collect();
    let most = rows.iter().flat_map(|(row, ..)| row).copied().fold(f32::MIN_POSITIVE, f32::max);
    let plot = Plot::new(ui, 96.0, Sense::hover());
    plot.mark(ring_tilt_rad / reach_rad, Color32::from_gray(90));
    for (row, colour, _) in &rows {
        plot.curve(row.iter().enumerate().map(|(step, value)| (step as f32 / 120.0, 0.95 * value / most)), *colour);
    }
    plot.text(0.0, 1.0, Align2::LEFT_TOP, &format!("{most:.0} /sr"));
    plot.text(1.0, 1.0, Align2::RIGHT_TOP, "blue wet, amber dry");
    plot.text(0.0, 0.0, Align2::LEFT_BOTTOM, "0°");
    plot.text(1.0, 0.0, Align2::RIGHT_BOTTOM, &format!("{:.1}°", reach_rad.to_degrees()));
    plot.response.on_hover_text(format!(
        "How bright the ring is mirrored by how far the surface is tilted (degrees), dry and wet, in shares of the light per \
         steradian; the line is where a mirror would show the ring: {:.1} mm wide, seen from {:.0} mm.",
        ring_radius_m * 1e3,
        distance_m * 1e3
    ));
}
