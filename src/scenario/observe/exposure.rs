//! How much of a structure can be seen: rays from its surface towards the eye (Sewell 2008 asks the same of what is drilled).

use super::bodies::Place;
use super::scene::Scene;
use super::volumes::WatchedVolume;
use crate::volume::CutVolume;
use crate::volume::pick::VolumePicker;
use bevy::prelude::*;

/// Places of a structure's surface that are looked at, at most.
const MOST_PLACES: usize = 600;
/// How often that is done, steps: all rays of a structure take a millisecond.
pub(super) const EVERY_STEPS: u64 = 30;

/// Places of a structure's surface that were turned to the eye when the run began.
#[derive(Clone)]
pub(super) struct Exposure {
    /// The volume, by its place, and the voxels.
    places: Vec<(usize, UVec3)>,
    cover_m: f32,
    /// Their middle in the world, metres.
    pub middle_m: Option<Vec3>,
}

impl Exposure {
    pub fn new(of: &[Place], volumes: &[WatchedVolume], scene: &Scene, eye_m: Vec3, cover_m: f32) -> Self {
        let mut places = Vec::new();
        for place in of {
            let Place::Label { volume, label } = *place else { continue };
            let Ok((_, _, _, _, Some(picked), _, transform, ..)) = scene.volumes.get(volumes[volume].entity) else {
                continue;
            };
            let eye_in_volume_m = transform.affine().inverse().transform_point3(eye_m);
            turned_to(&picked.0, label, eye_in_volume_m, |voxel| places.push((volume, voxel)));
        }
        // Evenly over all of them, in the order in which they lie in memory.
        let every = places.len().div_ceil(MOST_PLACES).max(1);
        let places: Vec<(usize, UVec3)> = places.into_iter().step_by(every).collect();
        let in_world = |&(volume, voxel): &(usize, UVec3)| {
            let (_, _, _, _, Some(picked), _, transform, ..) = scene.volumes.get(volumes[volume].entity).ok()? else {
                return None;
            };
            let in_volume_m = picked.0.grid().volume_from_voxel().transform_point3(voxel.as_vec3());
            Some(transform.transform_point(in_volume_m))
        };
        let sum: Option<Vec3> = places.iter().map(in_world).sum();
        let middle_m = sum.filter(|_| !places.is_empty()).map(|sum| sum / places.len() as f32);
        Self { places, cover_m, middle_m }
    }

    /// Share of them that can be seen now.
    pub fn share(&self, volumes: &[WatchedVolume], scene: &Scene, eye_m: Vec3) -> Option<f32> {
        let mut seen = 0;
        for &(volume, voxel) in &self.places {
            let (_, _, _, Some(cut), Some(picked), _, transform, ..) =
                scene.volumes.get(volumes[volume].entity).ok()?
            else {
                return None;
            };
            let volume_from_world = transform.affine().inverse();
            let eye_m = volume_from_world.transform_point3(eye_m);
            let scale = volume_from_world.matrix3.determinant().abs().cbrt();
            let at_m = picked.0.grid().volume_from_voxel().transform_point3(voxel.as_vec3());
            seen += usize::from(can_be_seen(&picked.0, cut, at_m, eye_m, self.cover_m * scale));
        }
        (!self.places.is_empty()).then(|| seen as f32 / self.places.len() as f32)
    }
}

/// Whether nothing lies between a place and the eye but a cover; all in the volume's space, metres.
pub(super) fn can_be_seen(picker: &VolumePicker, cut: &CutVolume, at_m: Vec3, eye_m: Vec3, cover_m: f32) -> bool {
    let way = eye_m - at_m;
    let length_m = way.length();
    if length_m <= cover_m {
        return true;
    }
    let from_m = at_m + way * (cover_m / length_m);
    picker.pick(from_m, way, length_m - cover_m, |voxel| cut.remaining(voxel)).is_none()
}

/// Voxels of a structure's surface that face a place.
fn turned_to(picker: &VolumePicker, label: u8, eye_m: Vec3, mut found: impl FnMut(UVec3)) {
    let (grid, structures) = (picker.grid(), picker.structures());
    let (size, labels) = (grid.size, structures.labels());
    let is_of = |at: IVec3| {
        let inside = at.cmpge(IVec3::ZERO).all() && at.cmplt(size.as_ivec3()).all();
        inside && labels[grid.index(at.as_uvec3())] == label
    };
    let volume_from_voxel = grid.volume_from_voxel();
    for (index, _) in labels.iter().enumerate().filter(|(_, of)| **of == label) {
        let index = index as u32;
        let voxel = UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y));
        let at = voxel.as_ivec3();
        let outside: IVec3 = [IVec3::X, IVec3::Y, IVec3::Z, IVec3::NEG_X, IVec3::NEG_Y, IVec3::NEG_Z]
            .into_iter()
            .filter(|to| !is_of(at + *to))
            .sum();
        if outside == IVec3::ZERO {
            continue;
        }
        let normal = volume_from_voxel.transform_vector3(outside.as_vec3());
        let to_eye = eye_m - volume_from_voxel.transform_point3(voxel.as_vec3());
        if normal.dot(to_eye) > 0.0 {
            found(voxel);
        }
    }
}
