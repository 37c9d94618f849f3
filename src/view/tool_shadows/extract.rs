//! Lamps and tools of this frame.

use super::{ShadowLens, ToolShadow, ToolShadows};
use bevy::asset::AssetId;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::RenderLayers;
use bevy::math::Affine3A;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;

/// A lamp with its map's camera.
pub(super) struct ExtractedLamp {
    pub entity: MainEntity,
    pub lens: ShadowLens,
    pub layers: RenderLayers,
}

/// A mesh that casts.
pub(super) struct ExtractedCaster {
    pub entity: MainEntity,
    pub mesh: AssetId<Mesh>,
    /// Grows when the mesh's data changes.
    pub revision: u64,
    pub world_from_mesh: Affine3A,
    pub layers: RenderLayers,
    pub bounds: Option<Aabb>,
}

/// Lamps that could cast shadows and meshes that could cast them, in order of their entities.
#[derive(Resource, Default)]
pub(super) struct ExtractedToolShadows {
    pub lamps: Vec<ExtractedLamp>,
    pub casters: Vec<ExtractedCaster>,
}

type Lamp = (
    Entity,
    &'static ToolShadows,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static RenderLayers>,
);

type Caster = (
    Entity,
    &'static Mesh3d,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static RenderLayers>,
    Option<&'static Aabb>,
);

pub(super) fn extract_tool_shadows(
    mut extracted: ResMut<ExtractedToolShadows>,
    lamps: Extract<Query<Lamp>>,
    casters: Extract<Query<Caster, With<ToolShadow>>>,
    mut changes: Extract<MessageReader<AssetEvent<Mesh>>>,
    mut revisions: Local<HashMap<AssetId<Mesh>, u64>>,
    mut latest: Local<u64>,
) {
    for change in changes.read() {
        match change {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => {
                *latest += 1;
                revisions.insert(*id, *latest);
            }
            AssetEvent::Removed { id } => {
                revisions.remove(id);
            }
            AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    extracted.lamps.clear();
    extracted.casters.clear();
    for (entity, shadows, transform, visible, layers) in lamps.iter() {
        if visible.get()
            && let Some(lens) = shadows.to_lens(transform).filter(|lens| lens.strength > 0.0)
        {
            let layers = layers.cloned().unwrap_or_default();
            extracted.lamps.push(ExtractedLamp { entity: entity.into(), lens, layers });
        }
    }
    if extracted.lamps.is_empty() {
        return;
    }
    for (entity, mesh, transform, visible, layers, bounds) in casters.iter() {
        if visible.get() {
            extracted.casters.push(ExtractedCaster {
                entity: entity.into(),
                mesh: mesh.id(),
                revision: revisions.get(&mesh.id()).copied().unwrap_or_default(),
                world_from_mesh: transform.affine(),
                layers: layers.cloned().unwrap_or_default(),
                bounds: bounds.copied(),
            });
        }
    }
    extracted.lamps.sort_by_key(|lamp| lamp.entity);
    extracted.casters.sort_by_key(|caster| caster.entity);
}
