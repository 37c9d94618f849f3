//! Picking in the ECS: every organ keeps a hierarchy over its faces, and rays of the world find the nearest organ without
//! any rendering (the paper of 2002 needed an extra pass per event, section 5.4).

use super::pick::OrganPicker;
use super::shape::follow_moved_vertices;
use super::{Organ, OrganModel, OrganShape, ShapeOrgans, SurfacePoint};
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use bevy::ecs::system::SystemParam;
use bevy::math::DVec3;
use bevy::prelude::*;

/// Where a ray meets an organ.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct OrganHit {
    /// The organ.
    pub organ: Entity,
    /// Where on its surface.
    pub point: SurfacePoint,
    /// The same place in the world, metres.
    pub position_world_m: Vec3,
    /// Unit normal there, between those of the corners, in the world.
    pub normal_world: Vec3,
    /// From the ray's origin, metres in the world.
    pub distance_m: f32,
    /// Whether the outside was met.
    pub is_outside: bool,
}

/// Finds organs with rays, as they are since the last step.
#[derive(SystemParam)]
pub struct OrganPicking<'w, 's> {
    organs:
        Query<'w, 's, (Entity, &'static OrganPicker, &'static OrganShape, &'static Organ, &'static GlobalTransform)>,
    models: Res<'w, Assets<OrganModel>>,
}

impl OrganPicking<'_, '_> {
    /// The first organ that a ray in the world meets, on either side of its surface, within a distance in metres.
    pub fn cast_ray(&self, ray: Ray3d, max_distance_m: f32) -> Option<OrganHit> {
        self.cast_ray_at(ray, max_distance_m, |_| true)
    }

    /// The same among the organs that a filter lets through: all but the wall of a cavity, say.
    pub fn cast_ray_at(
        &self,
        ray: Ray3d,
        max_distance_m: f32,
        mut takes: impl FnMut(Entity) -> bool,
    ) -> Option<OrganHit> {
        let mut nearest: Option<OrganHit> = None;
        for (entity, picker, shape, organ, transform) in &self.organs {
            // A model that was exchanged arrives before the shape that belongs to it.
            let Some(model) = self.models.get(&organ.0).filter(|model| shape.is_of(model) && takes(entity)) else {
                continue;
            };
            let world_from_organ = transform.affine();
            let organ_from_world = world_from_organ.inverse();
            let origin = organ_from_world.transform_point3(ray.origin).as_dvec3();
            let along = organ_from_world.transform_vector3(*ray.direction).as_dvec3();
            let metres_per_metre = along.length();
            if !(origin.is_finite() && metres_per_metre.is_finite() && metres_per_metre > 0.0) {
                continue;
            }
            let most_m = f64::from(nearest.map_or(max_distance_m, |hit| hit.distance_m)) * metres_per_metre;
            let Some(hit) = picker.cast_ray(origin, along, most_m) else { continue };
            let distance_m = (hit.distance_m / metres_per_metre) as f32;
            let is_nearer = nearest
                .is_none_or(|other| distance_m.total_cmp(&other.distance_m).then(entity.cmp(&other.organ)).is_lt());
            if is_nearer {
                let triangle = model.mesh.triangles[hit.point.face as usize];
                let weights = hit.point.barycentric;
                let normal: DVec3 = (0..3).map(|k| shape.normals()[triangle[k] as usize].as_dvec3() * weights[k]).sum();
                let normal = world_from_organ.matrix3.inverse().transpose() * normal.as_vec3a();
                nearest = Some(OrganHit {
                    organ: entity,
                    point: hit.point,
                    position_world_m: ray.origin + *ray.direction * distance_m,
                    normal_world: Vec3::from(normal).normalize_or_zero(),
                    distance_m,
                    is_outside: hit.is_front,
                });
            }
        }
        nearest
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<OrganHit>()
        // The faces, their corners, and about as much for the tree over them.
        .keep_large_component(|picker: &OrganPicker| picker.face_count() * 96)
        .add_systems(PreUpdate, build_pickers.after(ShapeOrgans))
        // After the step's last movement; rays are cast from the next step's first stages on.
        .add_systems(FixedUpdate, refit_pickers.after(follow_moved_vertices).in_set(SurgerySystems::Publish));
}

/// A picker is built again when the organ's model was exchanged.
fn build_pickers(
    mut commands: Commands,
    models: Res<Assets<OrganModel>>,
    organs: Query<(Entity, &Organ, Ref<OrganShape>, Option<&OrganPicker>)>,
) {
    for (entity, organ, shape, picker) in &organs {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        // A shape is inserted anew with its model.
        if picker.is_none() || shape.is_added() {
            commands.entity(entity).insert(OrganPicker::build(&model.mesh.triangles, shape.positions_m()));
        }
    }
}

pub(crate) fn refit_pickers(mut organs: Query<(&OrganShape, &mut OrganPicker), Changed<OrganShape>>) {
    for (shape, mut picker) in &mut organs {
        picker.refit(shape.positions_m());
    }
}
