//! Where the opaque scene changed: there, and only there, rays of a volume may end elsewhere than in the last frame.

use bevy::asset::AssetEventSystems;
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{RenderLayers, VisibilitySystems};
use bevy::ecs::entity::EntityHashMap;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d, mark_3d_meshes_as_changed_if_their_assets_changed};
use bevy::prelude::*;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};

/// What meshes did since the last frame.
#[derive(Resource, Clone, Debug, Default, ExtractResource)]
pub(super) struct SceneChanges {
    /// Boxes around what moved, came or left, before and after: from their space to the world, lower and upper corner.
    pub boxes: Vec<(Mat4, Vec3, Vec3)>,
    /// Something changed whose place is not known.
    pub everywhere: bool,
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<SceneChanges>().add_plugins(ExtractResourcePlugin::<SceneChanges>::default()).add_systems(
        PostUpdate,
        note_changes
            .after(VisibilitySystems::VisibilityPropagate)
            .after(TransformSystems::Propagate)
            .after(VisibilitySystems::CalculateBounds)
            .after(AssetEventSystems)
            .after(mark_3d_meshes_as_changed_if_their_assets_changed),
    );
}

type Placed = (Entity, &'static GlobalTransform, &'static InheritedVisibility, Option<&'static Aabb>);
type Moved = Or<(
    Changed<GlobalTransform>,
    Changed<InheritedVisibility>,
    Changed<Mesh3d>,
    Changed<Aabb>,
    Changed<RenderLayers>,
    // A skeleton moves its mesh without touching the entity.
    With<SkinnedMesh>,
)>;

fn note_changes(
    mut changes: ResMut<SceneChanges>,
    mut before: Local<EntityHashMap<(Mat4, Vec3, Vec3)>>,
    moved: Query<Placed, (With<Mesh3d>, Moved)>,
    mut removed: RemovedComponents<Mesh3d>,
    mut meshes: MessageReader<AssetEvent<Mesh>>,
) {
    let mut boxes = Vec::new();
    let mut everywhere = meshes.read().any(|event| matches!(event, AssetEvent::Modified { .. }));
    for entity in removed.read() {
        boxes.extend(before.remove(&entity));
    }
    for (entity, transform, visible, bounds) in &moved {
        boxes.extend(before.remove(&entity));
        if !visible.get() {
            continue;
        }
        // Bounds come a frame after the mesh.
        let Some(bounds) = bounds else {
            everywhere = true;
            continue;
        };
        let placed = (transform.to_matrix(), bounds.min().into(), bounds.max().into());
        before.insert(entity, placed);
        boxes.push(placed);
    }
    // The order of the query does not matter: only a box around all of them is used.
    *changes = SceneChanges { boxes, everywhere };
}
