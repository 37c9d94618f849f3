//! Volumes of a run: what is in them, how near something is to it, what was taken from it.

use crate::scenario::judge::Targets;
use crate::scenario::log::LoggedBody;
use crate::volume::critical::StructureDistance;
use crate::volume::pick::VolumePicker;
use crate::volume::rest::RestMap;
use crate::volume::structures::Structures;
use crate::volume::{CutVolume, DeformedVolume, VoxelBox};
use bevy::prelude::*;
use std::sync::Arc;

/// How far from a critical structure the log says how far it is, metres.
const CRITICAL_M: f32 = 6e-3;
/// Radius of the largest burr: distances are to its surface, metres.
const LARGEST_BURR_M: f32 = 4e-3;

/// A volume that is watched.
#[derive(Clone)]
pub(super) struct WatchedVolume {
    pub entity: Entity,
    pub name: String,
    pub structures: Arc<Structures>,
    /// Volume of each label before anything was drilled, mm³.
    pub whole_mm3: Vec<f64>,
    distances: Vec<StructureDistance>,
    revision: u64,
    pub box_world_m: [Vec3; 2],
}

impl WatchedVolume {
    pub fn new(
        entity: Entity,
        name: String,
        picker: &VolumePicker,
        cut: &CutVolume,
        transform: &GlobalTransform,
        targets: &Targets,
    ) -> Self {
        let (grid, structures) = (picker.grid(), picker.structures().clone());
        let mut whole_mm3 = vec![0.0; structures.list().len() + 1];
        for (&label, &solid) in structures.labels().iter().zip(structures.solid()) {
            if let Some(whole_mm3) = whole_mm3.get_mut(usize::from(label)) {
                *whole_mm3 += f64::from(solid) / 255.0 * grid.voxel_mm3();
            }
        }
        let scale = scale_of(transform);
        let mut distances = Vec::new();
        for (label, structure) in (1..=255_u8).zip(structures.list()) {
            let asked = targets.structures.iter().filter(|target| target.name == structure.name);
            let asked_m = asked.map(|target| target.band_m).fold(0.0, f32::max);
            let band_m = if structure.is_critical { asked_m.max(CRITICAL_M) } else { asked_m };
            if band_m <= 0.0 {
                continue;
            }
            let band_mm = (band_m + LARGEST_BURR_M) * 1e3 / scale;
            distances.extend(StructureDistance::build(grid, &structures, cut, label, band_mm));
        }
        let half_m: Vec3 =
            grid.half_axes_m().iter().map(|half_m| transform.affine().transform_vector3(*half_m).abs()).sum();
        let box_world_m = [transform.translation(), half_m];
        Self { entity, name, structures, whole_mm3, distances, revision: cut.revision(), box_world_m }
    }

    /// Bytes that it holds, about.
    pub fn bytes(&self) -> usize {
        self.distances.iter().map(StructureDistance::bytes).sum()
    }

    pub fn logged(&self) -> LoggedBody {
        LoggedBody {
            name: self.name.clone(),
            structures: self.structures.list().iter().map(|structure| structure.name.clone()).collect(),
            critical: self.structures.list().iter().map(|structure| structure.is_critical).collect(),
            volumes_mm3: self.whole_mm3.clone(),
            box_world_m: self.box_world_m,
        }
    }

    /// Follows what was drilled.
    pub fn follow(&mut self, cut: &CutVolume) {
        if cut.revision() == self.revision {
            return;
        }
        let everything = || vec![VoxelBox { min: UVec3::ZERO, max: cut.size() }];
        let changed = cut.changes_since(self.revision).unwrap_or_else(everything);
        self.revision = cut.revision();
        for field in &mut self.distances {
            for &changed in &changed {
                field.update(&self.structures, cut, changed);
            }
        }
    }

    /// How far the surface of a ball is from a structure, metres; none beyond the band.
    pub fn distance_m(&self, label: u8, at: &VolumePlace, radius_m: f32) -> Option<f32> {
        let field = self.distances.iter().find(|field| field.label() == label)?;
        let distance_m = field.distance_mm(at.voxel)? * 1e-3 * at.scale;
        Some((distance_m - radius_m).max(0.0))
    }

    /// How far it is from the nearest critical structure.
    pub fn critical_m(&self, at: &VolumePlace, radius_m: f32) -> Option<f32> {
        let is_critical = |label: u8| self.structures.of_label(label).is_some_and(|structure| structure.is_critical);
        let fields = self.distances.iter().filter(|field| is_critical(field.label()));
        let distances = fields.filter_map(|field| self.distance_m(field.label(), at, radius_m));
        distances.reduce(f32::min).filter(|distance_m| *distance_m <= CRITICAL_M)
    }
}

/// A place in a volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct VolumePlace {
    /// Where it is at rest, in voxels.
    pub voxel: Vec3,
    /// Metres in the world per metre of the volume.
    pub scale: f32,
}

impl VolumePlace {
    /// Where the matter rests that is shown at a place in the world.
    pub fn of(
        world_m: Vec3,
        picker: &VolumePicker,
        transform: &GlobalTransform,
        deformed: Option<&DeformedVolume>,
    ) -> Self {
        let mut volume_m = transform.affine().inverse().transform_point3(world_m);
        if let Some(deformed) = deformed {
            volume_m = RestMap::new(deformed.lattice(), picker.grid()).rest(volume_m);
        }
        let voxel = picker.grid().volume_from_voxel().inverse().transform_point3(volume_m);
        Self { voxel, scale: scale_of(transform) }
    }
}

fn scale_of(transform: &GlobalTransform) -> f32 {
    let scale = transform.affine().matrix3.determinant().abs().cbrt();
    if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
}
