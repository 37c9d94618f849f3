//! Lattices and elastic bodies: subdivided, pinned, stiffened.

use super::edit;
use super::fields::{FieldContext, fields};
use crate::deform::elastic::{ElasticBody, ElasticTissue};
use crate::deform::{DeformLattice, Patch};
use bevy::prelude::*;
use bevy_egui::egui;

/// Faces of a body's box: what they are called, and the axis and end that they lie at.
const FACES: [(&str, usize, f32); 6] =
    [("Left", 0, -1.0), ("Right", 0, 1.0), ("Bottom", 1, -1.0), ("Top", 1, 1.0), ("Back", 2, -1.0), ("Front", 2, 1.0)];

/// Patches of a lattice.
pub(super) fn lattice(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(lattice) = world.get::<DeformLattice>(entity) else { return };
    let (patches, vertices) = (lattice.tree().patches().to_vec(), lattice.translations().len());
    let most = lattice.translations().iter().map(|by| by.length()).fold(0.0, f32::max);
    ui.label(format!("{} patches, {vertices} vertices, moved by up to {:.1} %", patches.len(), most * 100.0))
        .on_hover_text("Of the lattice, and how far a vertex lies from where it rests, as a share of the box");
    ui.horizontal_wrapped(|ui| {
        let told = "Halves every patch along all three axes: eight times as many. What it is bent to stays";
        if ui.add_enabled(patches.len() <= 4096, egui::Button::new("Subdivide")).on_hover_text(told).clicked() {
            subdivide(world, entity, &patches);
        }
        let told = "All vertices back to where they rest";
        if ui.button("Straighten").on_hover_text(told).clicked()
            && let Some(mut straight) = world.get::<DeformLattice>(entity).cloned()
        {
            straight.reset();
            edit(world, entity, straight, "Straighten the lattice");
        }
    });
    ui.weak("Drag its vertices in the picture while it is selected.");
}

fn subdivide(world: &mut World, entity: Entity, patches: &[Patch]) {
    let Some(mut finer) = world.get::<DeformLattice>(entity).cloned() else { return };
    if let Err(reason) = finer.subdivide_all(patches) {
        tracing::warn!("the lattice is not subdivided: {reason}");
        return;
    }
    let body = world.get::<ElasticBody>(entity).cloned();
    edit(world, entity, finer.clone(), "Subdivide the lattice");
    if let Some(mut body) = body
        && body.follow_tree(&finer).is_ok()
    {
        edit(world, entity, body, "Subdivide the lattice");
    }
}

/// A body's tissue and what holds it.
pub(super) fn body(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    let Some(body) = world.get::<ElasticBody>(entity).cloned() else { return };
    let count = body.tree().vertex_count();
    let pinned = (0..count).filter(|vertex| body.is_pinned(*vertex)).count();
    let faults = body.faults();
    let asleep = if body.is_asleep() { ", at rest" } else { "" };
    let restored =
        if faults.restored_steps > 0 { format!(", {} steps restored", faults.restored_steps) } else { String::new() };
    ui.label(format!("{pinned} of {count} vertices pinned{asleep}{restored}")).on_hover_text(
        "Vertices that stay where they are; whether it moves; steps that ended in numbers that are none",
    );
    pins(ui, world, entity, &body);
    tissue(ui, world, entity, &body);
    settings(ui, world, entity, &body);
}

fn pins(ui: &mut egui::Ui, world: &mut World, entity: Entity, body: &ElasticBody) {
    let count = body.tree().vertex_count();
    let rests: Vec<Vec3> = (0..count).map(|vertex| body.rest_m(vertex)).collect();
    let (low, high) = rests.iter().fold((Vec3::MAX, Vec3::MIN), |(low, high), rest| (low.min(*rest), high.max(*rest)));
    ui.horizontal_wrapped(|ui| {
        ui.label("Pin")
            .on_hover_text("Vertices that stay where they are, by the side of the body's box that they lie on");
        for (name, axis, end) in FACES {
            let at = if end < 0.0 { low[axis] } else { high[axis] };
            let near = 1e-3 * (high[axis] - low[axis]);
            let on_face: Vec<usize> = (0..count).filter(|vertex| (rests[*vertex][axis] - at).abs() <= near).collect();
            let mut is_pinned = !on_face.is_empty() && on_face.iter().all(|vertex| body.is_pinned(*vertex));
            let told = format!(
                "Holds the side {} ({}{})",
                name.to_lowercase(),
                if end < 0.0 { "-" } else { "+" },
                ["x", "y", "z"][axis]
            );
            if ui.checkbox(&mut is_pinned, name).on_hover_text(told).changed() {
                let mut body = body.clone();
                for vertex in on_face {
                    // The vertices are the body's own.
                    let _ = body.pin(vertex, is_pinned);
                }
                edit(world, entity, body, "Pins");
            }
        }
    });
}

fn tissue(ui: &mut egui::Ui, world: &mut World, entity: Entity, body: &ElasticBody) {
    let mut chosen: Option<ElasticTissue> = None;
    ui.horizontal_wrapped(|ui| {
        ui.label("Tissue").on_hover_text("What all of it is made of");
        for (name, tissue) in [
            ("Liver", ElasticTissue::LIVER),
            ("Gallbladder", ElasticTissue::GALLBLADDER),
            ("Kidney", ElasticTissue::KIDNEY),
            ("Brain", ElasticTissue::BRAIN),
            ("Muscle", ElasticTissue::MUSCLE),
            ("Fat", ElasticTissue::FAT),
            ("Skin", ElasticTissue::SKIN),
            ("Cartilage", ElasticTissue::CARTILAGE),
        ] {
            let told = format!("{name}: {:.0} Pa", tissue.youngs_modulus_pa);
            if ui.small_button(name).on_hover_text(told).clicked() {
                chosen = Some(tissue);
            }
        }
    });
    let first = body.cell(0).tissue;
    let is_same = (0..body.tree().patches().len()).all(|cell| body.cell(cell).tissue == first);
    let memory = ui.id().with("tissue");
    if is_same {
        let registry = world.resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        let context = FieldContext::new(world, &registry);
        let mut tissue = ui.data(|data| data.get_temp(memory)).unwrap_or(first);
        fields(ui, &mut tissue, &context);
        // The body is built anew: not while a number is still dragged.
        if tissue == first || !ui.input(|input| input.pointer.any_down()) {
            ui.data_mut(|data| data.remove::<ElasticTissue>(memory));
            chosen = chosen.or((tissue != first).then_some(tissue));
        } else {
            ui.data_mut(|data| data.insert_temp(memory, tissue));
        }
    } else {
        ui.weak("Of several tissues.")
            .on_hover_text("Those of the volume's structures; choose one for all of it above");
    }
    let Some(chosen) = chosen else { return };
    let mut body = body.clone();
    body.change_tissue(|_, _| chosen);
    edit(world, entity, body, "Tissue");
}

fn settings(ui: &mut egui::Ui, world: &mut World, entity: Entity, body: &ElasticBody) {
    let mut changed = body.clone();
    let told = "Parts of a step. More make stiff tissue stiffer and waves livelier, and take longer";
    let mut is_changed = super::fields::labelled(ui, "Substeps", told, |ui| {
        ui.add(egui::DragValue::new(&mut changed.substeps).range(1..=100).speed(0.1))
    });
    let told = "How fast motion dies down by itself\nUnit: 1/s";
    is_changed |= super::fields::labelled(ui, "Drag", told, |ui| {
        ui.add(egui::DragValue::new(&mut changed.drag_per_s).range(0.0..=100.0).speed(0.05).suffix(" 1/s"))
    });
    if is_changed {
        edit(world, entity, changed, "Elastic body");
    }
}
