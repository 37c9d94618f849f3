//! Organs around a tool, as the loop wants them.

use super::kept::Kept;
use crate::haptics::force::{SurfaceFeel, SurfacePatch};
use crate::organ::OrganShape;
use crate::tools::bodies::TouchedOrgan;
use bevy::math::{Affine3A, DVec3};
use bevy::prelude::*;
use std::sync::Arc;

/// Organs with no more faces than this are told of whole.
const WHOLE_FACES: usize = 1000;
/// How far around a tool the surface is told of, metres: further than a hand gets between two steps.
const REACH_M: f64 = 0.03;
/// A patch is made anew when the tool has moved so far from its middle, metres.
const STRAY_M: f64 = 0.01;

/// What was told of an organ.
pub(super) struct ToldOrgan {
    /// All vertices in the world, as they were told last.
    positions_m: Vec<Vec3>,
    placed: Affine3A,
    tip_m: DVec3,
    back_m: DVec3,
    feel: SurfaceFeel,
    patch: Option<Arc<SurfacePatch>>,
    /// Whether it ends where it began: then it serves as it is.
    is_still: bool,
}

/// Where a tool is: its tip and the end of its shaft.
pub(super) struct Around {
    pub(super) tip_m: DVec3,
    pub(super) back_m: DVec3,
}

impl Kept<ToldOrgan> {
    /// The surface of an organ near a tool, and how far it is away; none where it is too far to be reached.
    pub(super) fn patch(&mut self, organ: &TouchedOrgan, around: &Around) -> Option<(f64, Arc<SurfacePatch>)> {
        let TouchedOrgan { entity, model, shape, picker, world_from_organ, is_hollow, feel } = organ;
        let (entity, world_from_organ, feel) = (*entity, *world_from_organ, *feel);
        let is_solid = !is_hollow && model.atlas.is_spherical();
        let scale = f64::from(world_from_organ.matrix3.determinant().abs().cbrt());
        let organ_from_world = world_from_organ.inverse();
        let is_map = scale > 0.0 && organ_from_world.is_finite() && world_from_organ.is_finite();
        if !is_map {
            return None;
        }
        let ends_m =
            [around.tip_m, around.back_m].map(|end| organ_from_world.transform_point3(end.as_vec3()).as_dvec3());
        let nearest = picker.nearest_to_segment(ends_m, REACH_M / scale)?;
        let distance_m = nearest.distance_m * scale;
        let told = self.get(entity).filter(|told| told.positions_m.len() == shape.positions_m().len());
        let has_moved = told.is_none_or(|told| told.placed != world_from_organ) || shape.is_changed();
        let has_strayed = told
            .is_none_or(|told| told.tip_m.distance(around.tip_m).max(told.back_m.distance(around.back_m)) > STRAY_M);
        if let Some(told) = told
            && !has_moved
            && !has_strayed
            && told.is_still
            && told.feel == feel
            && let Some(patch) = &told.patch
        {
            let patch = patch.clone();
            self.keep(entity)?;
            return Some((distance_m, patch));
        }
        let now_m: Vec<Vec3> = match told.filter(|_| !has_moved) {
            Some(told) => told.positions_m.clone(),
            None => shape.positions_m().iter().map(|position| world_from_organ.transform_point3(*position)).collect(),
        };
        let before_m = told.map_or(&now_m, |told| &told.positions_m);
        let is_whole = picker.face_count() <= WHOLE_FACES;
        let faces = &model.mesh.triangles;
        let near: Vec<u32> = if is_whole {
            (0..faces.len() as u32).collect()
        } else {
            picker.faces_near_segment(ends_m, (REACH_M + STRAY_M) / scale)
        };
        // Only the vertices of those faces, in the order in which they come.
        let mut number = vec![u32::MAX; now_m.len()];
        let (mut from_m, mut to_m, mut triangles) = (Vec::new(), Vec::new(), Vec::with_capacity(near.len()));
        for face in near {
            let corners = faces[face as usize].map(|vertex| {
                let slot = &mut number[vertex as usize];
                if *slot == u32::MAX {
                    *slot = to_m.len() as u32;
                    from_m.push(before_m[vertex as usize]);
                    to_m.push(now_m[vertex as usize]);
                }
                *slot
            });
            triangles.push(corners);
        }
        let is_still = from_m == to_m;
        let mut patch = SurfacePatch::moving(from_m, to_m, triangles, feel);
        if !is_whole {
            (patch.centre_m, patch.reach_m) = (around.tip_m, REACH_M + STRAY_M);
        }
        patch.is_closed = is_solid;
        let patch = Arc::new(patch);
        let told = ToldOrgan {
            positions_m: now_m,
            placed: world_from_organ,
            tip_m: around.tip_m,
            back_m: around.back_m,
            feel,
            patch: Some(patch.clone()),
            is_still,
        };
        self.insert(entity, told);
        Some((distance_m, patch))
    }

    /// An organ that is felt in another way in this step is remembered all the same: where it comes back it has moved from there.
    pub(super) fn remember(&mut self, entity: Entity, shape: &OrganShape, world_from_organ: Affine3A) {
        if let Some(told) = self.keep(entity) {
            let places = shape.positions_m().iter().map(|position| world_from_organ.transform_point3(*position));
            told.positions_m.clear();
            told.positions_m.extend(places);
            (told.placed, told.patch) = (world_from_organ, None);
        }
    }
}
