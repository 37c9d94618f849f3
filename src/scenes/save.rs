//! Saving: what of a world a designer set.

use super::components::{NotAuthored, SceneComponents, made};
use super::{SceneError, SceneVersion};
use crate::organ::Organ;
use crate::pool::Bleeder;
use crate::volume::transfer::TransferFunction;
use crate::volume::{CtVolume, has_suited_transfer};
use bevy::asset::UntypedHandle;
use bevy::ecs::entity::EntityMapper;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::relationship::RelationshipTarget;
use bevy::ecs::resource::IS_RESOURCE;
use bevy::prelude::*;
use std::any::TypeId;
use std::collections::BTreeSet;

/// What a designer set up in a world, as Bevy's scene: write it down with [`DynamicWorld::serialize`] or [`scene_text`].
///
/// Saved are the components that [`SceneComponents`] lists, and the [`SceneVersion`]. Left out are what the simulation makes of them,
/// the eyes of a [`StereoPair`](crate::view::StereoPair), vessels that a burr opened, and where a camera shows its picture, which
/// is the program's business. In place of an [`Organ`], a [`CtVolume`], a lattice and a body that a component beside them asked for,
/// that component is saved.
///
/// # Errors
/// [`SceneError`] for an organ or a volume that a program made and no component describes, and for a reference to an entity that is
/// not saved.
pub fn author_scene(world: &World) -> Result<DynamicWorld, SceneError> {
    let all = world.archetypes().iter().flat_map(|archetype| archetype.entities()).map(|entity| entity.id());
    author_scene_of(world, all)
}

/// The same of some entities only; what hangs from them is not taken along.
///
/// # Errors
/// As [`author_scene`].
pub fn author_scene_of(world: &World, entities: impl IntoIterator<Item = Entity>) -> Result<DynamicWorld, SceneError> {
    let default = SceneComponents::default();
    let components = world.get_resource::<SceneComponents>().unwrap_or(&default);
    let saved = saved_entities(world, components, entities);
    let registry = world.resource::<AppTypeRegistry>().read();
    let mut scene = DynamicWorldBuilder::from_world(world, &registry)
        .with_component_filter(components.filter().clone())
        .extract_entities(saved.iter().copied())
        .build();
    let made = made();
    for entity in &mut scene.entities {
        let id = entity.entity;
        let here = world.entity(id);
        let has = |component: TypeId| here.contains_type_id(component);
        entity.components.retain(|component| {
            let kind = component.get_represented_type_info().map(|info| info.type_id());
            let is_made = made.iter().any(|it| Some(it.made.id) == kind && it.by.iter().any(|by| has(by.id)));
            let is_orphaned = kind == Some(TypeId::of::<ChildOf>())
                && here.get::<ChildOf>().is_none_or(|parent| !saved.contains(&parent.parent()));
            let is_suited = kind == Some(TypeId::of::<TransferFunction>()) && has_suited_transfer(here);
            !is_made && !is_orphaned && !is_suited && kind != Some(TypeId::of::<Children>())
        });
        // Children that are not saved are none.
        let children: Vec<Entity> = here.get::<Children>().into_iter().flatten().copied().collect();
        let children: Vec<Entity> = children.into_iter().filter(|child| saved.contains(child)).collect();
        if !children.is_empty() {
            entity.components.push(Box::new(Children::from_collection_risky(children)));
        }
        check_handles(world, id, &made)?;
        for component in &mut entity.components {
            let registration = component.get_represented_type_info().and_then(|info| registry.get(info.type_id()));
            let reflected = registration.and_then(|registration| registration.data::<ReflectComponent>());
            let (Some(reflected), Some(value)) = (reflected, component.try_as_reflect_mut()) else { continue };
            let mut referred = Referred(BTreeSet::new());
            reflected.map_entities(value, &mut referred);
            if referred.0.iter().any(|entity| !saved.contains(entity)) {
                let component = value.reflect_type_path().into();
                return Err(SceneError::NotInScene { entity: name_of(world, id), component });
            }
        }
    }
    scene.resources.push(Box::new(SceneVersion::NOW));
    Ok(scene)
}

/// The scene of a world as the text of a `.scn.ron` file.
///
/// # Errors
/// As [`author_scene`], and [`SceneError::NotWritten`] for a component of the app that cannot be written down.
pub fn scene_text(world: &World) -> Result<String, SceneError> {
    let scene = author_scene(world)?;
    let registry = world.resource::<AppTypeRegistry>().read();
    scene.serialize(&registry).map_err(|error| SceneError::NotWritten { reason: error.to_string() })
}

/// Collects the entities that a component refers to.
struct Referred(BTreeSet<Entity>);

impl EntityMapper for Referred {
    fn get_mapped(&mut self, source: Entity) -> Entity {
        self.0.insert(source);
        source
    }

    fn set_mapped(&mut self, _source: Entity, _target: Entity) {}
}

/// Those of some entities that hold something authored, and what they hang from.
fn saved_entities(
    world: &World,
    components: &SceneComponents,
    entities: impl IntoIterator<Item = Entity>,
) -> BTreeSet<Entity> {
    let given: BTreeSet<Entity> = entities.into_iter().filter(|entity| is_authored(world, *entity)).collect();
    let counts = |entity: &Entity| components.count_on(world, world.entity(*entity));
    let mut saved: BTreeSet<Entity> = given.iter().copied().filter(counts).collect();
    for entity in saved.clone() {
        let mut at = entity;
        while let Some(parent) = world.get::<ChildOf>(at).map(ChildOf::parent).filter(|parent| given.contains(parent)) {
            if !saved.insert(parent) {
                break;
            }
            at = parent;
        }
    }
    saved
}

/// Whether an entity was not made by the simulation.
fn is_authored(world: &World, entity: Entity) -> bool {
    let Ok(entity) = world.get_entity(entity) else { return false };
    if entity.contains::<NotAuthored>() {
        return false;
    }
    #[cfg(feature = "render")]
    let is_eye = entity.contains::<crate::view::StereoEye>();
    #[cfg(not(feature = "render"))]
    let is_eye = false;
    // A burr gives no names.
    let was_opened = entity.get::<Bleeder>().is_some_and(|bleeder| bleeder.label != 0) && !entity.contains::<Name>();
    // What is disabled is as if it were not there, and would be there when it is loaded.
    !(is_eye || was_opened || entity.contains::<Disabled>() || entity.contains_id(IS_RESOURCE))
}

/// Handles of organs and volumes lead to files, or something beside them says what they are.
fn check_handles(world: &World, entity: Entity, made: &[super::components::MadeBy]) -> Result<(), SceneError> {
    let here = world.entity(entity);
    let organ = here.get::<Organ>().map(|organ| (TypeId::of::<Organ>(), organ.0.clone().untyped()));
    let volume = here.get::<CtVolume>().map(|volume| (TypeId::of::<CtVolume>(), volume.0.clone().untyped()));
    for (component, handle) in organ.into_iter().chain(volume) {
        // A handle by number is the same in every program.
        if handle.path().is_some() || matches!(handle, UntypedHandle::Uuid { .. }) {
            continue;
        }
        let Some(it) = made.iter().find(|it| it.made.id == component) else { continue };
        if it.by.iter().any(|by| here.contains_type_id(by.id)) {
            continue;
        }
        let short = |path: &'static str| path.rsplit("::").next().unwrap_or(path);
        return Err(SceneError::NotInAFile {
            entity: name_of(world, entity),
            component: short((it.made.path)()).into(),
            instead: it.by.iter().map(|by| short((by.path)())).collect::<Vec<_>>().join(" or a "),
        });
    }
    Ok(())
}

fn name_of(world: &World, entity: Entity) -> String {
    world.get::<Name>(entity).map_or_else(|| format!("entity {entity}"), |name| format!("{name} ({entity})"))
}
