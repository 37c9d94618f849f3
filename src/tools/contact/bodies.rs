//! Organs and volumes as bodies that can be touched.

use super::ContactMatter;
use super::sweep::{Near, Solid};
use crate::organ::pick::OrganPicker;
use crate::organ::surface::Surface;
use crate::volume::cut::CutVolume;
use crate::volume::pick::VolumePicker;
use crate::volume::rest::RestMap;
use crate::volume::{VolumeGrid, VoxelLattice};
use bevy::math::{Affine3A, DAffine3, DVec3, UVec3};

/// A rotation, an even scale and a place, in double precision.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    world_from_body: DAffine3,
    body_from_world: DAffine3,
    /// Metres in the world per metre of the body.
    scale: f64,
}

impl Placed {
    /// None where it cannot be turned round.
    pub(super) fn new(world_from_body: Affine3A) -> Option<Self> {
        let world_from_body = world_from_body.as_daffine3();
        let scale = world_from_body.matrix3.determinant().abs().cbrt();
        let body_from_world = world_from_body.inverse();
        let is_map = scale > 0.0 && world_from_body.is_finite() && body_from_world.is_finite();
        is_map.then_some(Self { world_from_body, body_from_world, scale })
    }

    fn in_world(
        &self,
        height_m: f64,
        point_m: DVec3,
        on_segment_m: DVec3,
        normal: DVec3,
        matter: ContactMatter,
    ) -> Near {
        Near {
            height_m: height_m * self.scale,
            point_m: self.world_from_body.transform_point3(point_m),
            on_segment_m: self.world_from_body.transform_point3(on_segment_m),
            normal: (self.body_from_world.matrix3.transpose() * normal).normalize_or(DVec3::Y),
            matter,
        }
    }
}

/// An organ at one moment.
pub(super) struct OrganBody<'a> {
    pub(super) placed: Placed,
    pub(super) picker: &'a OrganPicker,
    pub(super) surface: Surface<'a>,
    pub(super) is_hollow: bool,
}

impl Solid for OrganBody<'_> {
    fn nearest(&self, ends_m: [DVec3; 2], max_distance_m: f64) -> Option<Near> {
        let ends_m = ends_m.map(|end| self.placed.body_from_world.transform_point3(end));
        let hit = self.picker.nearest_to_segment(ends_m, max_distance_m / self.placed.scale)?;
        let outwards = if self.is_hollow { -1.0 } else { 1.0 };
        let skin = self.surface.normal(hit.point) * outwards;
        let gap = hit.on_segment_m - hit.position_m;
        let side = if gap.dot(skin) < 0.0 { -1.0 } else { 1.0 };
        let normal = gap.try_normalize().map_or(skin, |away| away * side);
        let uv = self.surface.atlas.uv(hit.point).as_vec2();
        let matter = ContactMatter::Organ { point: hit.point, uv };
        Some(self.placed.in_world(hit.distance_m * side, hit.position_m, hit.on_segment_m, normal, matter))
    }
}

/// What is left of a volume at one moment.
pub(super) struct VolumeBody<'a> {
    pub(super) placed: Placed,
    pub(super) picker: &'a VolumePicker,
    pub(super) cut: &'a CutVolume,
    pub(super) lattice: Option<(&'a VoxelLattice, &'a VolumeGrid)>,
}

impl VolumeBody<'_> {
    fn remaining(&self) -> impl Fn(UVec3) -> f32 + '_ {
        |voxel| self.cut.remaining(voxel)
    }
}

impl Solid for VolumeBody<'_> {
    fn nearest(&self, ends_m: [DVec3; 2], max_distance_m: f64) -> Option<Near> {
        let ends_m = ends_m.map(|end| self.placed.body_from_world.transform_point3(end));
        let max_m = max_distance_m / self.placed.scale;
        let Some((lattice, grid)) = self.lattice else {
            let hit = self.picker.nearest_to_segment(ends_m, max_m, self.remaining())?;
            let matter = ContactMatter::Volume { voxel: hit.voxel, label: hit.label };
            return Some(self.placed.in_world(hit.height_m, hit.position_m, hit.on_segment_m, hit.normal, matter));
        };
        // The matter at rest near where the rod would rest; its place and normal are then shown.
        let map = RestMap::new(lattice, grid);
        let rest_m = ends_m.map(|end| map.rest(end.as_vec3()).as_dvec3());
        let stretch = f64::from(map.scale_at(ends_m[0].as_vec3()));
        let hit = self.picker.nearest_to_segment(rest_m, max_m * stretch, self.remaining())?;
        let [point_m, on_segment_m] = [hit.position_m, hit.on_segment_m].map(|rest| map.shown(rest.as_vec3()));
        let normal = map.shown_normal(hit.normal.as_vec3(), on_segment_m).as_dvec3().normalize_or(hit.normal);
        let matter = ContactMatter::Volume { voxel: hit.voxel, label: hit.label };
        Some(self.placed.in_world(hit.height_m / stretch, point_m.as_dvec3(), on_segment_m.as_dvec3(), normal, matter))
    }
}
