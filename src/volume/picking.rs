//! Picking volumes in the ECS: rays of the world find the nearest bone that is left, without any rendering.

use super::pick::{VolumeHit, VolumePicker};
use super::{CtVolume, CutVolume, PrepareCuts, Volume};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use std::sync::Arc;

/// Where a ray in the world meets a volume.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct VolumeHitInWorld {
    /// The volume.
    pub volume: Entity,
    /// The place in the world, metres.
    pub position_world_m: Vec3,
    /// Unit normal out of the bone, in the world.
    pub normal_world: Vec3,
    /// From the ray's origin, metres in the world.
    pub distance_m: f32,
    /// The same in the volume's own space.
    pub hit: VolumeHit,
}

/// The [`VolumePicker`] of a volume; inserted beside its [`CutVolume`].
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct PickedVolume(pub VolumePicker);

/// Finds volumes with rays, as they are since the last step.
#[derive(SystemParam)]
pub struct VolumePicking<'w, 's> {
    volumes:
        Query<'w, 's, (Entity, &'static PickedVolume, &'static CutVolume, &'static GlobalTransform), With<CtVolume>>,
}

impl VolumePicking<'_, '_> {
    /// The first volume whose bone a ray in the world meets within a distance in metres.
    pub fn cast_ray(&self, ray: Ray3d, max_distance_m: f32) -> Option<VolumeHitInWorld> {
        let mut nearest: Option<VolumeHitInWorld> = None;
        for (entity, PickedVolume(picker), cut, transform) in &self.volumes {
            let world_from_volume = transform.affine();
            let volume_from_world = world_from_volume.inverse();
            let origin = volume_from_world.transform_point3(ray.origin);
            let along = volume_from_world.transform_vector3(*ray.direction);
            let metres_per_metre = along.length();
            if !(origin.is_finite() && metres_per_metre.is_finite() && metres_per_metre > 0.0) {
                continue;
            }
            let most_m = nearest.map_or(max_distance_m, |hit| hit.distance_m) * metres_per_metre;
            let Some(hit) = picker.pick(origin, along, most_m, |voxel| cut.remaining(voxel)) else { continue };
            let distance_m = hit.distance_m / metres_per_metre;
            let is_nearer = nearest
                .is_none_or(|other| distance_m.total_cmp(&other.distance_m).then(entity.cmp(&other.volume)).is_lt());
            if is_nearer {
                let normal = world_from_volume.matrix3.inverse().transpose() * hit.normal;
                nearest = Some(VolumeHitInWorld {
                    volume: entity,
                    position_world_m: ray.origin + *ray.direction * distance_m,
                    normal_world: normal.normalize_or_zero(),
                    distance_m,
                    hit,
                });
            }
        }
        nearest
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<VolumeHit>()
        .register_type::<VolumeHitInWorld>()
        .register_type::<VolumePicker>()
        .register_type::<PickedVolume>()
        .add_systems(PreUpdate, build_pickers.after(PrepareCuts));
}

/// A picker is built again when the volume was exchanged.
fn build_pickers(
    mut commands: Commands,
    volumes: Res<Assets<Volume>>,
    bodies: Query<(Entity, &CtVolume, Option<&PickedVolume>), With<CutVolume>>,
) {
    for (entity, body, picker) in &bodies {
        let structured = volumes.get(&body.0).and_then(|volume| volume.structures().map(|of| (volume, of)));
        let Some((volume, structures)) = structured else {
            // The old volume's is not the new one's.
            if picker.is_some() {
                commands.entity(entity).try_remove::<PickedVolume>();
            }
            continue;
        };
        if picker.is_some_and(|picker| Arc::ptr_eq(picker.0.structures(), structures)) {
            continue;
        }
        if let Some(picker) = VolumePicker::new(*volume.grid(), structures.clone()) {
            commands.entity(entity).try_insert(PickedVolume(picker));
        }
    }
}
