//! Picking volumes in the ECS: rays of the world find the nearest bone that is left, without any rendering.

use super::pick::{VolumeHit, VolumePicker};
use super::{CtVolume, CutVolume, DeformedVolume, PrepareCuts, Volume, VolumeLook};
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
    /// The same in the volume's own space; of a volume that a lattice deforms, the voxel is that of the matter at rest.
    pub hit: VolumeHit,
}

/// The [`VolumePicker`] of a volume; inserted beside its [`CutVolume`].
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct PickedVolume(pub VolumePicker);

type Pickable = (
    Entity,
    &'static PickedVolume,
    &'static CutVolume,
    &'static GlobalTransform,
    Option<&'static VolumeLook>,
    Option<&'static DeformedVolume>,
);

/// Finds volumes with rays, as they are since the last step: what is left of them and not clipped away.
#[derive(SystemParam)]
pub struct VolumePicking<'w, 's> {
    volumes: Query<'w, 's, Pickable, With<CtVolume>>,
}

/// The part of a ray inside a volume's clip planes, metres from its origin, and the plane where that part begins.
fn unclipped(origin: Vec3, direction: Vec3, most_m: f32, look: Option<&VolumeLook>) -> (f32, f32, Option<Vec4>) {
    let (mut from, mut to, mut side) = (0.0, most_m, None);
    for plane in look.iter().flat_map(|look| look.cutting_planes()) {
        let start = plane.truncate().dot(origin) + plane.w;
        let slope = plane.truncate().dot(direction);
        let meets = -start / slope;
        if slope > 0.0 && meets > from {
            (from, side) = (meets, Some(plane));
        } else if slope < 0.0 {
            to = f32::min(to, meets);
        } else if slope == 0.0 && start < 0.0 {
            to = f32::NEG_INFINITY;
        }
    }
    (from, to, side)
}

impl VolumePicking<'_, '_> {
    /// The first volume whose bone a ray in the world meets within a distance in metres. Where a clip plane of its
    /// [`VolumeLook`] cuts through bone, that is its surface.
    pub fn cast_ray(&self, ray: Ray3d, max_distance_m: f32) -> Option<VolumeHitInWorld> {
        let mut nearest: Option<VolumeHitInWorld> = None;
        for (entity, PickedVolume(picker), cut, transform, look, deformed) in &self.volumes {
            let world_from_volume = transform.affine();
            let volume_from_world = world_from_volume.inverse();
            let origin = volume_from_world.transform_point3(ray.origin);
            let along = volume_from_world.transform_vector3(*ray.direction);
            let metres_per_metre = along.length();
            if !(origin.is_finite() && metres_per_metre.is_finite() && metres_per_metre > 0.0) {
                continue;
            }
            let most_m = nearest.map_or(max_distance_m, |hit| hit.distance_m) * metres_per_metre;
            let direction = along / metres_per_metre;
            let (from_m, to_m, side) = unclipped(origin, direction, most_m, look);
            if from_m > to_m {
                continue;
            }
            let origin = origin + direction * from_m;
            let (far_m, remaining) = (to_m - from_m, |voxel| cut.remaining(voxel));
            let hit = match deformed {
                None => picker.pick(origin, direction, far_m, remaining),
                Some(deformed) => picker.pick_deformed(origin, direction, far_m, deformed.lattice(), remaining),
            };
            let Some(mut hit) = hit else { continue };
            if let Some(plane) = side.filter(|_| hit.distance_m == 0.0) {
                hit.normal = -plane.truncate().normalize_or_zero();
            }
            hit.distance_m += from_m;
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
