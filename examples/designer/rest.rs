//! The scene as it was set up, while it is played: to go back to it, and to save it.

use crate::Designer;
use crate::view::DrawsElsewhere;
use bevy::prelude::*;
use bevy::reflect::TypeRegistry;
use bevy_surgery::checkpoint::Checkpoint;
use bevy_surgery::panels::{EditHistory, outline};
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::SceneComponents;
use std::any::TypeId;
use std::collections::BTreeMap;

/// What was set, of everything that the simulation may change.
#[derive(Resource, Default)]
struct AtRest {
    set: Option<BTreeMap<(Entity, TypeId), Box<dyn Reflect>>>,
    /// All that steps change, before the first one.
    checkpoint: Option<Checkpoint>,
}

pub fn build(app: &mut App) {
    app.init_resource::<AtRest>().add_systems(FixedFirst, remember).add_systems(Last, follow_edits);
}

/// Kinds of components that a designer sets.
fn kinds(registry: &TypeRegistry) -> Vec<TypeId> {
    let paths = SceneComponents::authored_of_crate();
    let of_crate = paths.iter().filter_map(|path| Some(registry.get_with_type_path(path)?.type_id()));
    of_crate.chain([TypeId::of::<Transform>()]).collect()
}

fn value(world: &World, registry: &TypeRegistry, entity: Entity, kind: TypeId) -> Option<Box<dyn Reflect>> {
    let reflected = registry.get_type_data::<ReflectComponent>(kind)?;
    reflected.reflect(world.get_entity(entity).ok()?)?.reflect_clone().ok()
}

/// Before the first step.
fn remember(world: &mut World) {
    if world.resource::<AtRest>().set.is_some() {
        return;
    }
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let mut values = BTreeMap::new();
    for entity in outline(world) {
        for kind in kinds(&registry) {
            if let Some(value) = value(world, &registry, entity, kind) {
                values.insert((entity, kind), value);
            }
        }
    }
    let checkpoint = Checkpoint::take(world);
    *world.resource_mut::<AtRest>() = AtRest { set: Some(values), checkpoint: Some(checkpoint) };
}

/// What is set by hand while it is played is set for good.
fn follow_edits(world: &mut World) {
    let edited = world.resource_mut::<EditHistory>().take_edited();
    if edited.is_empty() || world.resource::<AtRest>().set.is_none() {
        return;
    }
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    for (entity, kind) in edited {
        let now = value(world, &registry, entity, kind);
        let Some(values) = &mut world.resource_mut::<AtRest>().set else { return };
        match now {
            Some(now) => values.insert((entity, kind), now),
            None => values.remove(&(entity, kind)),
        };
    }
}

/// Nothing was played yet.
pub fn forget(world: &mut World) {
    *world.resource_mut::<AtRest>() = AtRest::default();
}

/// Puts what was set in the place of what the simulation made of it; returns that.
fn exchange(world: &mut World) -> Vec<(Entity, TypeId, Box<dyn Reflect>)> {
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    let Some(rest) = world.resource_mut::<AtRest>().set.take() else { return Vec::new() };
    let mut simulated = Vec::new();
    for ((entity, kind), set) in &rest {
        let Some(now) = value(world, &registry, *entity, *kind) else { continue };
        if now.reflect_partial_eq(set.as_partial_reflect()) == Some(true) {
            continue;
        }
        put(world, &registry, *entity, *kind, &**set);
        simulated.push((*entity, *kind, now));
    }
    world.resource_mut::<AtRest>().set = Some(rest);
    simulated
}

fn put(world: &mut World, registry: &TypeRegistry, entity: Entity, kind: TypeId, value: &dyn Reflect) {
    let Some(reflected) = registry.get_type_data::<ReflectComponent>(kind) else { return };
    let Ok(mut entity) = world.get_entity_mut(entity) else { return };
    if let Some(mut here) = reflected.reflect_mut(&mut entity)
        && let Ok(value) = value.reflect_clone()
    {
        // Of the same type: it cannot fail.
        let _ = here.set(value);
    }
}

/// Does something with the scene as it was set up, with its cameras as they are without the designer.
pub fn with_rest<T>(world: &mut World, act: impl FnOnce(&mut World) -> T) -> T {
    let simulated = exchange(world);
    let mut cameras = world.query::<(Entity, &mut Camera, &DrawsElsewhere, Option<&mut StereoPair>)>();
    let mut views = Vec::new();
    for (entity, mut camera, draws, pair) in cameras.iter_mut(world) {
        let pair_was = pair.as_ref().map(|pair| pair.is_active);
        views.push((entity, camera.is_active, camera.viewport.take(), pair_was));
        match pair {
            Some(mut pair) => pair.is_active = draws.0,
            None => camera.is_active = draws.0,
        }
    }
    let done = act(world);
    for (entity, is_active, viewport, pair_was) in views {
        if let Ok((_, mut camera, _, pair)) = cameras.get_mut(world, entity) {
            (camera.is_active, camera.viewport) = (is_active, viewport);
            if let Some((mut pair, was)) = pair.zip(pair_was) {
                pair.is_active = was;
            }
        }
    }
    let registry = world.resource::<AppTypeRegistry>().clone();
    let registry = registry.read();
    for (entity, kind, now) in simulated {
        put(world, &registry, entity, kind, &*now);
    }
    done
}

/// Everything as it was set up: nothing is cut, nothing bleeds, time begins anew.
pub fn reset(world: &mut World, designer: &mut Designer) {
    world.resource_mut::<Time<Virtual>>().pause();
    if let Some(checkpoint) = world.resource_mut::<AtRest>().checkpoint.take() {
        checkpoint.restore(world);
        // What was set by hand since then stays set.
        exchange(world);
    }
    forget(world);
    let mut fixed = world.resource_mut::<Time<Fixed>>();
    let step = fixed.timestep();
    *fixed = Time::<Fixed>::from_duration(step);
    designer.status = "Everything is as it was set up".into();
}
