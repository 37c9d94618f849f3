//! Which triangles can reflect a light towards the eye: the others are not drawn.
//!
//! A reflection is seen where the normal lies near the halfway vector between eye and light, which is on a small part of an
//! organ. Software drivers take both sides of every branch, so what shows nothing is left out before it is shaded.

use crate::organ::OrganModel;
use crate::render::LightUniform;
use bevy::math::{Affine3A, Mat3A, Vec3A};
use bevy::prelude::*;

/// A vertex with what lies around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Around {
    /// Organ space, metres.
    pub position_m: Vec3,
    /// Unit normal, organ space.
    pub normal: Vec3,
    /// Largest angle between its normal and that of a neighbour, radians.
    pub angle_rad: f32,
    /// Longest edge to a neighbour, metres.
    pub edge_m: f32,
}

/// Where an organ is seen from and what lights it.
pub(super) struct Seen<'a> {
    pub world_from_organ: Affine3A,
    /// By how much the transform enlarges angles between normals, and lengths, at most.
    pub scale: Vec2,
    pub lights: &'a [LightUniform],
    /// Tilt beyond which nothing of a point-shaped light is seen, radians.
    pub reach_rad: f32,
    pub eye_world_m: Vec3,
    /// Unit vector towards the eye, for a parallel view.
    pub to_parallel_eye: Option<Vec3>,
}

impl Seen<'_> {
    /// Whether anything can be seen in the triangles around a vertex. All of their points and normals are within its
    /// bounds, so a triangle shows something only if this holds for each of its corners.
    fn may_shine(&self, around: &Around, world_from_normal: Mat3A) -> bool {
        let place = self.world_from_organ.transform_point3(around.position_m);
        let normal = Vec3::from(world_from_normal * Vec3A::from(around.normal)).normalize_or_zero();
        let to_eye = self.to_parallel_eye.unwrap_or_else(|| (self.eye_world_m - place).normalize_or_zero());
        self.lights.iter().any(|light| {
            let path = light.position_world_m - place;
            let is_far = light.kind == LightUniform::DIRECTIONAL;
            let to_light = if is_far { -light.direction_world } else { path.normalize_or_zero() };
            let sum = to_light + to_eye;
            let length = sum.length().max(1e-3);
            let distance_m = path.length().max(1e-6) * 0.5 * length;
            let ring = if light.kind == LightUniform::RING { 0.5 * light.ring_radius_m / distance_m } else { 0.0 };
            // How far the halfway vector turns over an edge; what is infinitely far is seen the same way from everywhere.
            let per_light = if is_far { 0.0 } else { 1.0 / path.length().max(1e-6) };
            let per_eye =
                if self.to_parallel_eye.is_some() { 0.0 } else { 1.0 / self.eye_world_m.distance(place).max(1e-6) };
            let turn = 1.1 * self.scale.y * around.edge_m * (per_light + per_eye) / length;
            let reach = self.reach_rad + ring.min(0.8) + self.scale.x * around.angle_rad + turn;
            // Which side is seen is known only in the fragment shader.
            2.0 - 2.0 * normal.dot(sum / length).abs() < reach * reach
        })
    }

    /// Indices of the skin triangles that may show something; all of them where the vertices are not the model's.
    pub fn triangles(&self, model: &OrganModel, around: &[Around]) -> Vec<u32> {
        let skin = &model.skin_mesh;
        if around.len() != model.mesh.positions_m.len() {
            return skin.indices.clone();
        }
        let world_from_normal = self.world_from_organ.matrix3.inverse().transpose();
        let by_vertex: Vec<bool> = around.iter().map(|around| self.may_shine(around, world_from_normal)).collect();
        let shows = |face: u32| model.mesh.triangles[face as usize].iter().all(|&vertex| by_vertex[vertex as usize]);
        let shown = skin.indices.chunks_exact(3).zip(&skin.faces).filter(|(_, face)| shows(**face));
        shown.flat_map(|(triangle, _)| triangle).copied().collect()
    }
}
