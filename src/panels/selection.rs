//! All that an entity is made of, a section a component.

use super::fields::{FieldContext, fields, label_of_type};
use super::history::component;
use super::{camera, edit_component, lattice, note_change, organ, pool, structures, tools, transfer};
use crate::deform::DeformLattice;
use crate::deform::elastic::ElasticBody;
use crate::highlights::Highlights;
use crate::pool::{Pool, PoolLevel};
use crate::reactions::Reactions;
use crate::scenes::SceneComponents;
use crate::skin::Skin;
use crate::tools::{HoldDevice, Tool};
use crate::view::{Microscope, StereoPair};
use crate::volume::CtVolume;
use crate::volume::structures::StructureChanges;
use crate::volume::transfer::TransferFunction;
use bevy::prelude::*;
use bevy::reflect::TypeRegistry;
use bevy_egui::egui;
use bevy_inspector_egui::bevy_inspector::ui_for_entity;
use std::any::TypeId;

/// More of a component than its fields say: plots, presets, what it does just now.
type More = fn(&mut egui::Ui, &mut World, Entity);

/// What a component's section shows above its fields, and whether the fields are shown.
fn more(kind: TypeId) -> (Option<More>, bool) {
    let special: [(TypeId, More, bool); 12] = [
        (TypeId::of::<Skin>(), organ::skin, true),
        (TypeId::of::<Reactions>(), organ::reactions, true),
        (TypeId::of::<Highlights>(), organ::highlights, true),
        (TypeId::of::<TransferFunction>(), transfer::transfer, true),
        (TypeId::of::<StructureChanges>(), structures::structures, false),
        (TypeId::of::<Pool>(), pool::pool, true),
        (TypeId::of::<PoolLevel>(), pool::level, true),
        (TypeId::of::<DeformLattice>(), lattice::lattice, false),
        (TypeId::of::<ElasticBody>(), lattice::body, false),
        (TypeId::of::<Tool>(), tools::tool, true),
        (TypeId::of::<HoldDevice>(), tools::device, true),
        (TypeId::of::<Microscope>(), camera::microscope, true),
    ];
    special.iter().find(|(of, ..)| *of == kind).map_or((None, true), |(_, more, has_fields)| (Some(*more), *has_fields))
}

/// Components that are told of, but follow from others beside them and are not to be added or taken away by hand.
fn is_made(kind: TypeId) -> bool {
    [TypeId::of::<CtVolume>(), TypeId::of::<StructureChanges>(), TypeId::of::<crate::organ::Organ>()].contains(&kind)
}

/// A component that a section is for.
struct Section {
    kind: TypeId,
    title: String,
    meaning: &'static str,
}

fn section(kind: TypeId, registry: &TypeRegistry) -> Option<Section> {
    let info = registry.get(kind)?.type_info();
    let title = match info.type_path_table().short_path() {
        "CtVolume" => "CT volume".into(),
        "StructureChanges" => "Structures".into(),
        name => label_of_type(name),
    };
    Some(Section { kind, title, meaning: info.docs().unwrap_or_default() })
}

/// The crate's components that a designer sets, in the order in which they are shown.
fn authored(registry: &TypeRegistry) -> Vec<Section> {
    let paths = SceneComponents::authored_of_crate();
    paths.iter().filter_map(|path| section(registry.get_with_type_path(path)?.type_id(), registry)).collect()
}

/// Edits an entity: its name and place, every component of the crate that a designer sets and the cameras' and lights' of Bevy, and what
/// can be added. Every change can be undone ([`EditHistory`](super::EditHistory)).
pub fn entity_panel(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    if world.get_entity(entity).is_err() {
        ui.weak("It is gone.");
        return;
    }
    let Some(registry) = world.get_resource::<AppTypeRegistry>().cloned() else { return };
    let registry = registry.read();
    let context = FieldContext::new(world, &registry);
    ui.push_id(entity, |ui| {
        for kind in [TypeId::of::<Name>(), TypeId::of::<Transform>()] {
            let Some(section) = section(kind, &registry) else { continue };
            show_fields(ui, world, entity, &section, &context);
        }
        ui.separator();
        let all = authored(&registry);
        let has = |world: &World, kind| {
            // A volume has structures, whether they were changed or not.
            let kinds = [kind, TypeId::of::<CtVolume>()];
            let kinds = &kinds[usize::from(kind == TypeId::of::<StructureChanges>())..];
            world.get_entity(entity).is_ok_and(|entity| entity.contains_type_id(kinds[0]))
        };
        for section in &all {
            if has(world, section.kind) {
                show_section(ui, world, entity, section, true, &context);
            }
        }
        let of_bevy = [
            TypeId::of::<DirectionalLight>(),
            TypeId::of::<PointLight>(),
            TypeId::of::<SpotLight>(),
            TypeId::of::<Projection>(),
        ];
        for section in of_bevy.into_iter().filter_map(|kind| section(kind, &registry)) {
            if has(world, section.kind) {
                show_section(ui, world, entity, &section, false, &context);
            }
        }
        add_menu(ui, world, entity, &all, &registry);
        everything(ui, world, entity, &all);
    });
}

/// All components as bevy-inspector-egui shows them, those too that follow from others. What is changed of the authored ones can be
/// undone.
fn everything(ui: &mut egui::Ui, world: &mut World, entity: Entity, authored: &[Section]) {
    let folded = egui::CollapsingHeader::new("Everything").show(ui, |ui| {
        let kinds =
            authored.iter().map(|section| section.kind).chain([TypeId::of::<Transform>(), TypeId::of::<Name>()]);
        let before: Vec<_> = kinds.map(|kind| (kind, component(world, entity, kind))).collect();
        ui_for_entity(world, entity, ui);
        for (kind, before) in before {
            let now = component(world, entity, kind);
            let is_same = match (&before, &now) {
                (Some(before), Some(now)) => before.reflect_partial_eq(now.as_partial_reflect()) != Some(false),
                (before, now) => before.is_none() && now.is_none(),
            };
            if !is_same {
                note_change(world, entity, kind, before, "Inspector");
            }
        }
    });
    let told = "All components, those too that follow from others, by the inspector of bevy-inspector-egui";
    folded.header_response.on_hover_text(told);
}

fn show_fields(ui: &mut egui::Ui, world: &mut World, entity: Entity, section: &Section, context: &FieldContext) {
    let Some(mut value) = component(world, entity, section.kind) else { return };
    if fields(ui, value.as_partial_reflect_mut(), context) {
        edit_component(world, entity, section.kind, Some(value), &section.title);
    }
}

fn show_section(
    ui: &mut egui::Ui,
    world: &mut World,
    entity: Entity,
    section: &Section,
    can_go: bool,
    context: &FieldContext,
) {
    let (more, has_fields) = more(section.kind);
    let open_first = [
        TypeId::of::<Skin>(),
        TypeId::of::<TransferFunction>(),
        TypeId::of::<Tool>(),
        TypeId::of::<Pool>(),
        TypeId::of::<Microscope>(),
        TypeId::of::<StereoPair>(),
    ];
    let id = ui.make_persistent_id(&section.title);
    let is_open = open_first.contains(&section.kind);
    let header = egui::collapsing_header::CollapsingState::load_with_default_open(ui.ctx(), id, is_open);
    let (mut is_removed, mut is_toggled) = (false, false);
    let told = super::fields::plain(section.meaning);
    let mut header = header.show_header(ui, |ui| {
        let title = egui::Label::new(egui::RichText::new(&section.title).strong()).selectable(false);
        let title = ui.add(title.sense(egui::Sense::click())).on_hover_text(&told);
        if can_go && !is_made(section.kind) {
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                let told = format!("Takes {} away", section.title.to_lowercase());
                is_removed = ui.small_button("×").on_hover_text(told).clicked();
            });
        }
        is_toggled = title.clicked();
    });
    if is_toggled {
        header.toggle();
    }
    let (button, ..) = header.body(|ui| {
        if let Some(more) = more {
            more(ui, world, entity);
        }
        if has_fields {
            show_fields(ui, world, entity, section, context);
        }
    });
    button.on_hover_text("Folds and unfolds this section");
    if is_removed {
        edit_component(world, entity, section.kind, None, &format!("Take {} away", section.title.to_lowercase()));
    }
}

/// Components that are not there yet.
fn add_menu(ui: &mut egui::Ui, world: &mut World, entity: Entity, all: &[Section], registry: &TypeRegistry) {
    let mut added = None;
    let menu = ui.menu_button("Add component", |ui| {
        egui::ScrollArea::vertical().max_height(400.0).show(ui, |ui| {
            for section in all {
                let is_there = world.get_entity(entity).is_ok_and(|entity| entity.contains_type_id(section.kind));
                let Some(default) = registry.get_type_data::<ReflectDefault>(section.kind) else { continue };
                if is_there || is_made(section.kind) {
                    continue;
                }
                let told = super::fields::plain(section.meaning);
                if ui.button(&section.title).on_hover_text(told).clicked() {
                    added = Some((section, default.default()));
                    ui.close();
                }
            }
        });
    });
    menu.response.on_hover_text("Adds a component to what is selected");
    if let Some((section, value)) = added {
        let title = format!("Add {}", section.title.to_lowercase());
        edit_component(world, entity, section.kind, Some(value), &title);
    }
}
