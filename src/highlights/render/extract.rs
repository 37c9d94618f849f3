//! What the render world takes of highlights each frame.

use super::cull::Around;
use crate::highlights::Highlights;
use crate::organ::{Organ, OrganModel, OrganShape};
use bevy::camera::primitives::Aabb;
use bevy::ecs::change_detection::Tick;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// The highlights of an organ in this frame.
pub(super) struct ExtractedOrganHighlights {
    pub entity: MainEntity,
    /// Every number within its bounds.
    pub highlights: Highlights,
    /// Corners of its culling box, world, metres.
    pub corners_world_m: [Vec3; 8],
    /// From the box's own coordinates, -1 to 1 along each axis, to the world.
    pub world_from_box: Mat4,
    /// By how much the transform enlarges angles between normals, and lengths, at most.
    pub surroundings_scale: Vec2,
}

/// In order of their entities.
#[derive(Resource, Default)]
pub(super) struct ExtractedHighlights {
    pub organs: Vec<ExtractedOrganHighlights>,
}

/// The vertices of organs with what surrounds them, and when the shape last changed; kept between frames.
#[derive(Resource, Default)]
pub(super) struct HighlightSurroundings(pub BTreeMap<MainEntity, (Tick, Vec<Around>)>);

type Shining = (
    Entity,
    &'static Organ,
    &'static Highlights,
    Ref<'static, OrganShape>,
    &'static GlobalTransform,
    Option<&'static Aabb>,
);

pub(super) fn extract_highlights(
    mut extracted: ResMut<ExtractedHighlights>,
    mut known: ResMut<HighlightSurroundings>,
    organs: Extract<Query<Shining>>,
    models: Extract<Res<Assets<OrganModel>>>,
) {
    extracted.organs.clear();
    extracted.organs.extend(organs.iter().map(|(entity, organ, highlights, shape, transform, bounds)| {
        let bounds = bounds.copied().unwrap_or_default();
        let organ_from_box =
            Mat4::from_scale_rotation_translation(bounds.half_extents.into(), Quat::IDENTITY, bounds.center.into());
        let world_from_box = transform.to_matrix() * organ_from_box;
        let corner = |k: usize| {
            let sign = |bit: usize| if k & bit == 0 { -1.0 } else { 1.0 };
            world_from_box.transform_point3(Vec3::new(sign(1), sign(2), sign(4)))
        };
        let revision = shape.last_changed();
        if known.0.get(&entity.into()).is_none_or(|(known, _)| *known != revision) {
            let triangles = models.get(&organ.0).map(|model| model.mesh.triangles.as_slice()).unwrap_or_default();
            let around = surroundings(shape.positions_m(), shape.normals(), triangles);
            known.0.insert(entity.into(), (revision, around));
        }
        let axes = transform.affine().matrix3.to_cols_array_2d().map(|axis| Vec3::from(axis).length());
        let (smallest, largest) = (axes[0].min(axes[1]).min(axes[2]), axes[0].max(axes[1]).max(axes[2]));
        ExtractedOrganHighlights {
            entity: entity.into(),
            highlights: highlights.clamped(),
            corners_world_m: std::array::from_fn(corner),
            world_from_box,
            surroundings_scale: Vec2::new(largest / smallest.max(1e-3 * largest), largest),
        }
    }));
    extracted.organs.sort_by_key(|organ| organ.entity);
    let is_here = |entity: &MainEntity| extracted.organs.binary_search_by_key(entity, |organ| organ.entity).is_ok();
    known.0.retain(|entity, _| is_here(entity));
}

/// For each vertex, the largest angle between its normal and that of a neighbour, and the longest edge to one: nothing in its
/// triangles differs from it by more.
fn surroundings(positions_m: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Around> {
    let vertices = positions_m.iter().zip(normals);
    let mut around: Vec<Around> =
        vertices.map(|(&position_m, &normal)| Around { position_m, normal, angle_rad: 0.0, edge_m: 0.0 }).collect();
    for triangle in triangles {
        let corners = triangle.map(|corner| corner as usize);
        // A model that was just exchanged does not belong to the shape.
        if corners.iter().any(|corner| *corner >= positions_m.len()) {
            continue;
        }
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
            // An angle is at most 1.12 times its chord below a right angle.
            let angle_rad = 1.12 * normals[a].distance(normals[b]);
            let length_m = positions_m[a].distance(positions_m[b]);
            for corner in [a, b] {
                let around = &mut around[corner];
                (around.angle_rad, around.edge_m) = (around.angle_rad.max(angle_rad), around.edge_m.max(length_m));
            }
        }
    }
    around
}

impl ExtractedOrganHighlights {
    /// Distances from a point to the nearest and the farthest place of the organ's box, metres. Exact where the box is
    /// no parallelepiped; otherwise the nearest is an estimate.
    pub fn distances_m(&self, from_world_m: Vec3) -> (f32, f32) {
        let farthest_m = self.corners_world_m.iter().map(|corner| corner.distance(from_world_m)).fold(0.0, f32::max);
        let axes = [self.world_from_box.x_axis, self.world_from_box.y_axis, self.world_from_box.z_axis];
        let path = from_world_m - self.world_from_box.w_axis.truncate();
        let outside_squared: f32 = axes
            .iter()
            .map(|axis| {
                let half_extent_m = axis.truncate().length();
                let along_m = path.dot(axis.truncate() / half_extent_m.max(1e-20));
                let outside_m = (along_m.abs() - half_extent_m).max(0.0);
                outside_m * outside_m
            })
            .sum();
        (outside_squared.sqrt(), farthest_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surroundings_are_the_widest_of_all_neighbours() {
        let positions = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::Y, Vec3::ONE];
        let tilted = Vec3::new(0.3_f32.sin(), 0.0, 0.3_f32.cos());
        let around = surroundings(&positions, &[Vec3::Z, tilted, Vec3::Z, Vec3::Z], &[[0, 1, 2]]);
        assert!((0.3..0.36).contains(&around[0].angle_rad) && around[0].edge_m == 2.0, "{around:?}");
        assert!(around[2].angle_rad >= 0.3 && (around[3].angle_rad, around[3].edge_m) == (0.0, 0.0), "{around:?}");
        assert!((around[1].edge_m - 5_f32.sqrt()).abs() < 1e-6, "{around:?}");
    }

    #[test]
    fn distances_to_a_turned_box() {
        let turn = Quat::from_rotation_z(0.5);
        let world_from_box = Mat4::from_scale_rotation_translation(Vec3::new(2.0, 1.0, 0.5), turn, Vec3::X);
        let signs = [-1.0, 1.0];
        let corners = signs.iter().flat_map(|x| signs.map(|y| signs.map(|z| Vec3::new(*x, y, z))).concat());
        let corners: Vec<Vec3> = corners.map(|corner| world_from_box.transform_point3(corner)).collect();
        let organ = ExtractedOrganHighlights {
            entity: Entity::PLACEHOLDER.into(),
            highlights: default(),
            corners_world_m: corners.try_into().expect("eight corners"),
            world_from_box,
            surroundings_scale: Vec2::ONE,
        };
        let from = Vec3::X + turn * Vec3::new(5.0, -5.0, 0.2);
        let (nearest_m, farthest_m) = organ.distances_m(from);
        assert!((nearest_m - 5.0).abs() < 1e-5, "{nearest_m}");
        assert!((farthest_m - Vec3::new(7.0, 6.0, 0.7).length()).abs() < 1e-5, "{farthest_m}");
        assert_eq!(organ.distances_m(Vec3::X).0, 0.0);
    }
}
