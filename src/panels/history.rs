//! What a designer did, undone and done again.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy::reflect::{Reflect, TypePath};
use bevy_egui::egui;
use std::any::TypeId;
use std::collections::{BTreeSet, VecDeque};

/// Most edits that are remembered.
const MOST_EDITS: usize = 500;

/// What was edited, to be undone and done again: components that were changed, added and taken away, entities that were added and
/// removed.
///
/// A drag is one edit however many frames it takes: changes of the same component are joined until [`settle`] is told
/// that the hand rests. Entities that were removed are only [`Disabled`] as long as an undo can bring them back, so that others may go
/// on referring to them.
#[derive(Resource, Default)]
pub struct EditHistory {
    done: VecDeque<Edit>,
    undone: Vec<Edit>,
    open: Option<Edit>,
    /// Edits since the beginning that are in effect, to tell whether something is not saved.
    count: u64,
    saved: u64,
    edited: BTreeSet<(Entity, TypeId)>,
}

/// An edit: all of it is undone together.
struct Edit {
    title: String,
    changes: Vec<Change>,
}

enum Change {
    Component { entity: Entity, kind: TypeId, before: Value, after: Value },
    Presence { entities: Vec<Entity>, is_there_after: bool },
}

/// A component, or that there is none.
type Value = Option<Box<dyn Reflect>>;

impl EditHistory {
    /// What would be undone.
    pub fn undo_title(&self) -> Option<&str> {
        self.open.as_ref().or(self.done.back()).map(|edit| edit.title.as_str())
    }

    /// What would be done again.
    pub fn redo_title(&self) -> Option<&str> {
        self.undone.last().map(|edit| edit.title.as_str())
    }

    /// Edits that can be undone, the oldest first.
    pub fn titles(&self) -> impl Iterator<Item = &str> {
        self.done.iter().chain(&self.open).map(|edit| edit.title.as_str())
    }

    /// Whether something was edited since [`mark_saved`](Self::mark_saved).
    pub fn has_unsaved(&self) -> bool {
        self.open.is_some() || self.count != self.saved
    }

    /// What there is now is what a file has.
    pub fn mark_saved(&mut self) {
        self.saved = self.count;
    }

    /// Components that were set by hand, by an undo or a redo since this was last asked.
    pub fn take_edited(&mut self) -> BTreeSet<(Entity, TypeId)> {
        std::mem::take(&mut self.edited)
    }

    fn note_edited(&mut self, edit: &Edit) {
        for change in &edit.changes {
            if let Change::Component { entity, kind, .. } = change {
                self.edited.insert((*entity, *kind));
            }
        }
    }

    fn push(&mut self, edit: Edit, gone: &mut Vec<Entity>) {
        forget(self.undone.drain(..), false, gone);
        if self.saved > self.count {
            // What was saved can be reached no longer.
            self.saved = u64::MAX;
        }
        self.done.push_back(edit);
        self.count += 1;
        while self.done.len() > MOST_EDITS {
            forget(self.done.pop_front(), true, gone);
        }
    }
}

/// Entities that no edit can bring back any more.
fn forget(edits: impl IntoIterator<Item = Edit>, was_done: bool, gone: &mut Vec<Entity>) {
    for change in edits.into_iter().flat_map(|edit| edit.changes) {
        if let Change::Presence { entities, is_there_after } = change
            && is_there_after != was_done
        {
            gone.extend(entities);
        }
    }
}

fn despawn(world: &mut World, gone: Vec<Entity>) {
    for entity in gone {
        // A parent takes its children along.
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
}

/// Sets a component of an entity by its type, or takes it away, as an edit that can be undone. Nothing happens where that changes
/// nothing. `title` says what is done, as a menu would.
pub fn edit_component(world: &mut World, entity: Entity, kind: TypeId, value: Option<Box<dyn Reflect>>, title: &str) {
    let before = component(world, entity, kind);
    let is_same = match (&before, &value) {
        (Some(before), Some(value)) => before.reflect_partial_eq(value.as_partial_reflect()) == Some(true),
        (before, value) => before.is_none() && value.is_none(),
    };
    if is_same || world.get_entity(entity).is_err() {
        return;
    }
    set_component(world, entity, kind, value.as_deref());
    let mut gone = Vec::new();
    world.resource_scope(|_, mut history: Mut<EditHistory>| {
        history.edited.insert((entity, kind));
        let joins = history.open.as_ref().is_some_and(|open| {
            open.changes.iter().any(|change| {
                matches!(change, Change::Component { entity: of, kind: it, .. } if (*of, *it) == (entity, kind))
            })
        });
        if joins && let Some(open) = &mut history.open {
            for change in &mut open.changes {
                if let Change::Component { entity: of, kind: it, after, .. } = change
                    && (*of, *it) == (entity, kind)
                {
                    *after = value.as_deref().and_then(cloned);
                }
            }
        } else {
            if let Some(open) = history.open.take() {
                history.push(open, &mut gone);
            }
            let change = Change::Component { entity, kind, before, after: value };
            history.open = Some(Edit { title: title.into(), changes: vec![change] });
        }
        // What was undone before belongs to another past.
        forget(history.undone.drain(..), false, &mut gone);
    });
    despawn(world, gone);
}

/// The same for a component whose type is known.
pub fn edit<C: Component + Reflect + TypePath + Clone>(world: &mut World, entity: Entity, value: C, title: &str) {
    edit_component(world, entity, TypeId::of::<C>(), Some(Box::new(value)), title);
}

/// Notes that a component was changed already, from `before` to what it is now.
pub fn note_change(world: &mut World, entity: Entity, kind: TypeId, before: Option<Box<dyn Reflect>>, title: &str) {
    let now = component(world, entity, kind);
    set_component(world, entity, kind, before.as_deref());
    edit_component(world, entity, kind, now, title);
}

/// Notes that entities were added, with all that hangs from them.
pub fn note_added(world: &mut World, roots: &[Entity], title: &str) {
    let entities: Vec<Entity> = roots.iter().flat_map(|root| family(world, *root)).collect();
    note_presence(world, entities, true, title);
}

/// Removes an entity with all that hangs from it, so that it can be brought back.
pub fn remove(world: &mut World, entity: Entity, title: &str) {
    let entities = family(world, entity);
    set_there(world, &entities, false);
    note_presence(world, entities, false, title);
}

fn note_presence(world: &mut World, entities: Vec<Entity>, is_there_after: bool, title: &str) {
    if entities.is_empty() {
        return;
    }
    let mut gone = Vec::new();
    world.resource_scope(|_, mut history: Mut<EditHistory>| {
        if let Some(open) = history.open.take() {
            history.push(open, &mut gone);
        }
        let changes = vec![Change::Presence { entities, is_there_after }];
        history.push(Edit { title: title.into(), changes }, &mut gone);
    });
    despawn(world, gone);
}

/// An entity and all that hangs from it and is there.
fn family(world: &World, root: Entity) -> Vec<Entity> {
    let mut all = Vec::new();
    let mut open = vec![root];
    while let Some(entity) = open.pop() {
        let Ok(here) = world.get_entity(entity) else { continue };
        if here.contains::<Disabled>() {
            continue;
        }
        all.push(entity);
        open.extend(here.get::<Children>().into_iter().flatten());
    }
    all
}

fn set_there(world: &mut World, entities: &[Entity], is_there: bool) {
    for &entity in entities {
        let Ok(mut entity) = world.get_entity_mut(entity) else { continue };
        if is_there {
            entity.remove::<Disabled>();
        } else {
            entity.insert(Disabled);
        }
    }
}

/// The hand rests: what follows is another edit. Call it once a frame while no button is held and no text is typed.
pub fn settle(world: &mut World) {
    let mut gone = Vec::new();
    world.resource_scope(|_, mut history: Mut<EditHistory>| {
        let Some(open) = history.open.take() else { return };
        // Dragged there and back.
        let is_nothing = open.changes.iter().all(|change| match change {
            Change::Component { before: Some(before), after: Some(after), .. } => {
                before.reflect_partial_eq(after.as_partial_reflect()) == Some(true)
            }
            _ => false,
        });
        if !is_nothing {
            history.push(open, &mut gone);
        }
    });
    despawn(world, gone);
}

/// Undoes the last edit; whether there was one.
pub fn undo(world: &mut World) -> bool {
    settle(world);
    let Some(edit) = world.resource_mut::<EditHistory>().done.pop_back() else { return false };
    for change in edit.changes.iter().rev() {
        match change {
            Change::Component { entity, kind, before, .. } => set_component(world, *entity, *kind, before.as_deref()),
            Change::Presence { entities, is_there_after } => set_there(world, entities, !is_there_after),
        }
    }
    let mut history = world.resource_mut::<EditHistory>();
    history.note_edited(&edit);
    history.undone.push(edit);
    history.count -= 1;
    true
}

/// Does the edit again that was undone last; whether there was one.
pub fn redo(world: &mut World) -> bool {
    settle(world);
    let Some(edit) = world.resource_mut::<EditHistory>().undone.pop() else { return false };
    for change in &edit.changes {
        match change {
            Change::Component { entity, kind, after, .. } => set_component(world, *entity, *kind, after.as_deref()),
            Change::Presence { entities, is_there_after } => set_there(world, entities, *is_there_after),
        }
    }
    let mut history = world.resource_mut::<EditHistory>();
    history.note_edited(&edit);
    history.done.push_back(edit);
    history.count += 1;
    true
}

/// Forgets all edits, for instance since another scene was opened.
pub fn clear(world: &mut World) {
    let old = std::mem::take(&mut *world.resource_mut::<EditHistory>());
    let mut gone = Vec::new();
    forget(old.done, true, &mut gone);
    forget(old.undone, false, &mut gone);
    despawn(world, gone);
}

fn cloned(value: &dyn Reflect) -> Value {
    value.reflect_clone().ok()
}

/// A copy of a component by its type.
pub(super) fn component(world: &World, entity: Entity, kind: TypeId) -> Option<Box<dyn Reflect>> {
    let registry = world.get_resource::<AppTypeRegistry>()?.read();
    let reflected = registry.get_type_data::<ReflectComponent>(kind)?;
    cloned(reflected.reflect(world.get_entity(entity).ok()?)?)
}

fn set_component(world: &mut World, entity: Entity, kind: TypeId, value: Option<&dyn Reflect>) {
    let Some(registry) = world.get_resource::<AppTypeRegistry>().cloned() else { return };
    let registry = registry.read();
    let Some(reflected) = registry.get_type_data::<ReflectComponent>(kind) else { return };
    let Ok(mut entity) = world.get_entity_mut(entity) else { return };
    let Some(value) = value.and_then(cloned) else { return reflected.remove(&mut entity) };
    if reflected.contains(&entity)
        && entity
            .world()
            .components()
            .get_id(kind)
            .is_some_and(|id| entity.world().components().get_info(id).is_some_and(|info| info.mutable()))
        && let Some(mut here) = reflected.reflect_mut(&mut entity)
    {
        // Of the same type: it cannot fail.
        let _ = here.set(value);
        return;
    }
    reflected.insert(&mut entity, value.as_partial_reflect(), &registry);
}

/// [`settle`] while no button is held, nothing is typed and no key moves something. Call it once a frame after all panels.
pub fn settle_when_idle(world: &mut World, context: &egui::Context) {
    let is_held = context.input(|input| input.pointer.any_down() || !input.keys_down.is_empty());
    if !is_held && !context.text_edit_focused() {
        settle(world);
    }
}
