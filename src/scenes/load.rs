//! Loading: from a text to entities, with all that can be wrong said at once and before anything is spawned.

use super::SceneError;
use super::migrate::{MIGRATIONS, migrated};
use super::text::{byte_of, entries};
use super::version::SceneVersion;
use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext, LoadFromPath};
use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use bevy::reflect::{PartialReflect, ReflectRef, TypeInfo, TypePath, TypeRegistry, TypeRegistryArc};
use bevy::world_serialization::serde::WorldDeserializer;
use serde::de::DeserializeSeed;

/// Reads a scene that [`scene_text`](super::scene_text) or Bevy has written, of this minor version of the crate or an older one.
/// `file` is what errors call it.
///
/// # Errors
/// [`SceneError`], with the file, the place and the component.
pub fn read_scene(
    file: &str,
    text: &str,
    registry: &TypeRegistry,
    assets: &mut dyn LoadFromPath,
) -> Result<DynamicWorld, SceneError> {
    let text = migrated(file, text, SceneVersion::NOW, MIGRATIONS)?;
    #[cfg(not(feature = "render"))]
    let text = super::migrate::without_views(&text);
    let broken = |error: ron::error::SpannedError| {
        let (line, column) = (error.span.end.line, error.span.end.col);
        let at = byte_of(&text, line, column);
        let entries = entries(&text);
        // The last one that begins before the place, if it does not end before.
        let entry =
            entries.iter().rev().find(|entry| entry.path_at.start <= at).filter(|entry| at <= entry.value_at.end);
        SceneError::Broken {
            file: file.into(),
            line,
            column,
            component: entry.map(|entry| entry.path.clone()),
            reason: error.code.to_string(),
        }
    };
    let mut deserializer = ron::de::Deserializer::from_str(&text).map_err(broken)?;
    let scene = WorldDeserializer { type_registry: registry, load_from_path: assets }
        .deserialize(&mut deserializer)
        .map_err(|error| broken(deserializer.span_error(error)))?;
    deserializer.end().map_err(|error| broken(deserializer.span_error(error)))?;
    check(file, &scene, registry)?;
    Ok(scene)
}

/// Spawns a scene of a text into a world, and returns which entity became which.
///
/// # Errors
/// As [`read_scene`]; then the world is as it was.
pub fn load_scene(world: &mut World, file: &str, text: &str) -> Result<EntityHashMap<Entity>, SceneError> {
    let registry = world.resource::<AppTypeRegistry>().clone();
    let mut assets = world.resource::<AssetServer>().clone();
    let scene = read_scene(file, text, &registry.read(), &mut assets)?;
    let mut entities = EntityHashMap::default();
    scene.write_to_world(world, &mut entities).map_err(|error| {
        for entity in entities.values() {
            world.despawn(*entity);
        }
        SceneError::Incomplete {
            file: file.into(),
            component: "a component".into(),
            entity: 0,
            reason: error.to_string(),
        }
    })?;
    Ok(entities)
}

/// Whether all of a scene can be spawned: Bevy panics where something is missing.
fn check(file: &str, scene: &DynamicWorld, registry: &TypeRegistry) -> Result<(), SceneError> {
    let incomplete = |value: &dyn PartialReflect, entity: u64, reason: String| SceneError::Incomplete {
        file: file.into(),
        component: value.get_represented_type_info().map_or("a component", |info| info.type_path()).into(),
        entity,
        reason,
    };
    let known =
        |value: &dyn PartialReflect| value.get_represented_type_info().and_then(|info| registry.get(info.type_id()));
    for resource in &scene.resources {
        let is_resource = known(&**resource).is_some_and(|known| known.data::<ReflectResource>().is_some());
        if !is_resource || resource.is_dynamic() {
            return Err(incomplete(&**resource, 0, "is no resource, or lacks a field".into()));
        }
    }
    for entity in &scene.entities {
        for component in &entity.components {
            let number = entity.entity.to_bits();
            if known(&**component).is_none_or(|known| known.data::<ReflectComponent>().is_none()) {
                return Err(incomplete(&**component, number, "is no component".into()));
            }
            if component.is_dynamic() {
                let reason = match missing_field(&**component) {
                    Some(field) => format!("lacks the field {field}"),
                    None => "lacks a field of one of its parts".into(),
                };
                return Err(incomplete(&**component, number, reason));
            }
        }
    }
    Ok(())
}

/// A field that a value read from a file lacks.
fn missing_field(value: &dyn PartialReflect) -> Option<&'static str> {
    let TypeInfo::Struct(info) = value.get_represented_type_info()? else { return None };
    let ReflectRef::Struct(found) = value.reflect_ref() else { return None };
    info.iter().map(|field| field.name()).find(|name| found.field(name).is_none())
}

/// Loads scenes as Bevy's own loader does, of older versions of the crate too and with errors that say what is wrong: files that
/// end in `.surgery.scn.ron`. Spawn them with a [`DynamicWorldRoot`].
#[derive(TypePath)]
pub struct SceneLoader {
    registry: TypeRegistryArc,
}

impl FromWorld for SceneLoader {
    fn from_world(world: &mut World) -> Self {
        Self { registry: world.resource::<AppTypeRegistry>().0.clone() }
    }
}

impl AssetLoader for SceneLoader {
    type Asset = DynamicWorld;
    type Settings = ();
    type Error = SceneError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        context: &mut LoadContext<'_>,
    ) -> Result<DynamicWorld, SceneError> {
        let file = context.path().to_string();
        let unread = |error: String| SceneError::Io { file: file.clone(), error };
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await.map_err(|error| unread(error.to_string()))?;
        let text = String::from_utf8(bytes).map_err(|error| unread(error.to_string()))?;
        read_scene(&file, &text, &self.registry.read(), context)
    }

    fn extensions(&self) -> &[&str] {
        &["surgery.scn.ron"]
    }
}
