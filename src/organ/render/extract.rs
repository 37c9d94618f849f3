//! What the render world takes of organs each frame.

use super::prepare::{OrganBuffers, OrganSides};
use crate::organ::{Hollow, Organ, OrganModel, OrganShape};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::change_detection::Tick;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;
use bytemuck::{Pod, Zeroable};

/// A primary vertex as the vertex shader reads it (`shaders/organ.wgsl`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PrimaryVertex {
    /// Position in the organ's space, metres; the last component is padding.
    pub position_m: [f32; 4],
    /// Unit normal in the organ's space; the last component is padding.
    pub normal: [f32; 4],
}

/// An organ of this frame.
#[derive(Clone, Debug)]
pub struct ExtractedOrgan {
    /// Its entity in the main world.
    pub entity: MainEntity,
    /// Its model.
    pub model: AssetId<OrganModel>,
    /// Organ space to world.
    pub world_from_organ: Mat4,
    /// Centre of its bounds in the world, metres: where lights are ranked.
    pub centre_world_m: Vec3,
    /// Layers that it is on.
    pub layers: RenderLayers,
    /// Which of its faces are drawn.
    pub sides: OrganSides,
    /// Whether its chart is planar.
    pub is_planar: bool,
    /// When the shape last changed.
    pub revision: Tick,
    /// The vertices, where the GPU's copy is old.
    pub moved: Option<Vec<PrimaryVertex>>,
}

/// Every organ of this frame, in order of their entities.
#[derive(Resource, Default)]
pub struct ExtractedOrgans {
    /// The organs.
    pub organs: Vec<ExtractedOrgan>,
}

/// Keeps the culling box around the vertices.
pub(super) fn bound_shapes(mut commands: Commands, shapes: Query<(Entity, &OrganShape), Changed<OrganShape>>) {
    for (entity, shape) in &shapes {
        if let Some(bounds) = Aabb::enclosing(shape.positions_m()) {
            commands.entity(entity).insert(bounds);
        }
    }
}

type Shaped = (
    Entity,
    &'static Organ,
    Ref<'static, OrganShape>,
    &'static GlobalTransform,
    Option<&'static Aabb>,
    Option<&'static RenderLayers>,
    Has<Hollow>,
);

pub(super) fn extract_organs(
    mut extracted: ResMut<ExtractedOrgans>,
    buffers: Res<OrganBuffers>,
    organs: Extract<Query<Shaped>>,
    models: Extract<Res<Assets<OrganModel>>>,
) {
    extracted.organs.clear();
    for (entity, organ, shape, transform, bounds, layers, is_hollow) in organs.iter() {
        let entity = MainEntity::from(entity);
        let centre = bounds.map_or(Vec3::ZERO, |bounds| bounds.center.into());
        let revision = shape.last_changed();
        let is_planar = models.get(&organ.0).is_some_and(|model| !model.atlas.is_spherical());
        let world_from_organ = transform.to_matrix();
        let is_old = buffers.revision(entity) != Some(revision);
        extracted.organs.push(ExtractedOrgan {
            entity,
            model: organ.0.id(),
            world_from_organ,
            centre_world_m: transform.transform_point(centre),
            layers: layers.cloned().unwrap_or_default(),
            sides: match (is_hollow || is_planar, world_from_organ.determinant() < 0.0) {
                (true, _) => OrganSides::Both,
                (false, true) => OrganSides::OutsideMirrored,
                (false, false) => OrganSides::Outside,
            },
            is_planar,
            revision,
            moved: is_old.then(|| {
                shape
                    .positions_m()
                    .iter()
                    .zip(shape.normals())
                    .map(|(position, normal)| PrimaryVertex {
                        position_m: position.extend(0.0).to_array(),
                        normal: normal.extend(0.0).to_array(),
                    })
                    .collect()
            }),
        });
    }
    extracted.organs.sort_by_key(|organ| organ.entity);
}
