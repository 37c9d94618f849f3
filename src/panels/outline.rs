//! What a scene is made of, as a tree.

use crate::scenes::{NotAuthored, SceneComponents};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::resource::IS_RESOURCE;
use bevy::prelude::*;
use bevy_egui::egui;

/// The tree of all entities that a designer set up. Returns whether the choice was changed.
pub fn outline_panel(ui: &mut egui::Ui, world: &World, chosen: &mut Option<Entity>) -> bool {
    let before = *chosen;
    let mut roots = authored(world);
    let is_inside = |entity: Entity| world.get::<ChildOf>(entity).is_some_and(|of| is_shown(world, of.parent()));
    roots.retain(|entity| !is_inside(*entity));
    roots.sort_by_key(|entity| (title(world, *entity), *entity));
    for root in roots {
        branch(ui, world, root, chosen);
    }
    *chosen != before
}

/// The entities of the tree in the order in which it shows them, unfolded.
pub fn outline(world: &World) -> Vec<Entity> {
    let mut roots = authored(world);
    let is_inside = |entity: Entity| world.get::<ChildOf>(entity).is_some_and(|of| is_shown(world, of.parent()));
    roots.retain(|entity| !is_inside(*entity));
    roots.sort_by_key(|entity| (title(world, *entity), *entity));
    let mut all = Vec::new();
    let mut open: Vec<Entity> = roots.into_iter().rev().collect();
    while let Some(entity) = open.pop() {
        all.push(entity);
        open.extend(shown_children(world, entity).into_iter().rev());
    }
    all
}

/// Entities with something that a designer set.
fn authored(world: &World) -> Vec<Entity> {
    let all = world.archetypes().iter().flat_map(|archetype| archetype.entities()).map(|entity| entity.id());
    all.filter(|entity| is_shown(world, *entity)).collect()
}

fn is_shown(world: &World, entity: Entity) -> bool {
    let Ok(here) = world.get_entity(entity) else { return false };
    let is_eye = here.contains::<crate::view::StereoEye>();
    if here.contains::<Disabled>() || here.contains_id(IS_RESOURCE) || here.contains::<NotAuthored>() || is_eye {
        return false;
    }
    let default = SceneComponents::default();
    let components = world.get_resource::<SceneComponents>().unwrap_or(&default);
    components.count_on(world, here)
}

fn shown_children(world: &World, entity: Entity) -> Vec<Entity> {
    let children = world.get::<Children>(entity).into_iter().flatten().copied();
    let mut children: Vec<Entity> = children.filter(|child| is_shown(world, *child)).collect();
    children.sort_by_key(|entity| (title(world, *entity), *entity));
    children
}

fn title(world: &World, entity: Entity) -> String {
    world.get::<Name>(entity).map_or_else(|| format!("entity {entity}"), Name::to_string)
}

fn branch(ui: &mut egui::Ui, world: &World, entity: Entity, chosen: &mut Option<Entity>) {
    let children = shown_children(world, entity);
    let title = title(world, entity);
    let told = format!("{title} ({entity})\nClick to edit it");
    let mut row = |ui: &mut egui::Ui| {
        if ui.selectable_label(*chosen == Some(entity), &title).on_hover_text(&told).clicked() {
            *chosen = Some(entity);
        }
    };
    if children.is_empty() {
        ui.indent(entity, row);
        return;
    }
    let id = ui.make_persistent_id(entity);
    let state = egui::collapsing_header::CollapsingState::load_with_default_open(ui.ctx(), id, true);
    let (toggle, ..) = state.show_header(ui, |ui| row(ui)).body(|ui| {
        for child in children {
            branch(ui, world, child, chosen);
        }
    });
    toggle.on_hover_text("Folds and unfolds what hangs from it");
}
