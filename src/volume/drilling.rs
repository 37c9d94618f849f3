//! Drilling in the ECS: who drills what is a message, what was removed is one too.

use super::cut::{Burr, BurrPose, BurrStroke};
use super::rest::RestMap;
use super::{CtVolume, CutVolume, DeformedVolume, Volume, VoxelBox};
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use bevy::math::UVec3;
use bevy::prelude::*;

/// A burr that runs against a volume during this step. Written before [`SurgerySystems::Cut`], once per burr and step.
///
/// Of a volume that a lattice deforms, the burr removes the matter that is shown where it is. Burrs and forces count in the
/// volume's own metres: an entity that is scaled shows a larger picture of the same bone.
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
pub struct DrillVolume {
    /// The volume.
    pub volume: Entity,
    /// The tool, if it is an entity.
    pub tool: Option<Entity>,
    /// Its burr.
    pub burr: Burr,
    /// Where the burr was when the step began: middle in the world, metres, and axis.
    pub from_world: BurrPose,
    /// Where it is when the step ends.
    pub to_world: BurrPose,
    /// Force with which it presses, newtons.
    pub force_n: f32,
    /// Turns per minute.
    pub speed_rpm: f32,
    /// Whether a stroke begins here, which [`CutVolume::undo`] takes back as one.
    pub begins_stroke: bool,
}

/// What a burr removed in a step. Written in [`SurgerySystems::Cut`], for every [`DrillVolume`] that removed something.
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
pub struct VoxelsRemoved {
    /// The volume.
    pub volume: Entity,
    /// The tool, if it is an entity.
    pub tool: Option<Entity>,
    /// Volume of tissue per structure, mm³: labels that lost something, ascending; 0 is what belongs to no structure.
    pub by_label_mm3: Vec<(u8, f64)>,
    /// All of it, mm³.
    pub total_mm3: f64,
    /// Where it was in the mean, in the world, metres.
    pub centroid_world_m: Vec3,
}

/// All that was removed of a volume so far, also after undo or loading. Inserted beside the [`CutVolume`].
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct RemovedTissue {
    /// Volume per label, mm³; index 0 is what belongs to no structure.
    by_label_mm3: Vec<f64>,
    /// Of the cut that this counts.
    revision: Option<u64>,
}

impl RemovedTissue {
    /// What was removed of the structure with a label, mm³; label 0 is what belongs to none.
    pub fn of_label_mm3(&self, label: u8) -> f64 {
        self.by_label_mm3.get(usize::from(label)).copied().unwrap_or(0.0)
    }

    /// All of it, mm³.
    pub fn total_mm3(&self) -> f64 {
        self.by_label_mm3.iter().sum()
    }

    fn add(&mut self, by_label_mm3: &[(u8, f64)]) {
        self.by_label_mm3.resize(256, 0.0);
        for &(label, mm3) in by_label_mm3 {
            self.by_label_mm3[usize::from(label)] += mm3;
        }
    }

    /// Counts a cut from its voxels.
    fn recount(&mut self, volume: &Volume, cut: &CutVolume) {
        let grid = volume.grid();
        self.by_label_mm3 = vec![0.0; 256];
        let Some(structures) = volume.structures() else { return };
        // Where nothing was cut nothing is looked at.
        const SIDE: u32 = 16;
        let boxes = grid.size.map(|side| side.div_ceil(SIDE));
        for place in 0..boxes.x * boxes.y * boxes.z {
            let corner = UVec3::new(place % boxes.x, place / boxes.x % boxes.y, place / (boxes.x * boxes.y)) * SIDE;
            let of = VoxelBox { min: corner, max: (corner + SIDE).min(grid.size) };
            if cut.is_untouched(of) {
                continue;
            }
            for z in of.min.z..of.max.z {
                for y in of.min.y..of.max.y {
                    for x in of.min.x..of.max.x {
                        let voxel = UVec3::new(x, y, z);
                        let index = grid.index(voxel);
                        let share =
                            f64::from(structures.solid()[index]) / 255.0 * f64::from(1.0 - cut.remaining(voxel));
                        self.by_label_mm3[usize::from(structures.labels()[index])] += share * grid.voxel_mm3();
                    }
                }
            }
        }
    }
}

/// In [`SurgerySystems::Cut`]: burrs cut, and what was removed is counted.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DrillVolumes;

pub(super) fn build(app: &mut App) {
    app.add_message::<DrillVolume>()
        .add_message::<VoxelsRemoved>()
        .register_type::<DrillVolume>()
        .register_type::<VoxelsRemoved>()
        .register_type::<RemovedTissue>()
        .keep_large_component(CutVolume::bytes)
        .keep_component::<RemovedTissue>();
    app.register_required_components::<CutVolume, RemovedTissue>();
    app.add_systems(
        FixedUpdate,
        (drill_volumes, count_removed).chain().in_set(DrillVolumes).in_set(SurgerySystems::Cut),
    );
}

fn drill_volumes(
    mut strokes: MessageReader<DrillVolume>,
    mut removed: MessageWriter<VoxelsRemoved>,
    mut bodies: Query<(&CtVolume, &mut CutVolume, &mut RemovedTissue, &GlobalTransform, Option<&DeformedVolume>)>,
    volumes: Res<Assets<Volume>>,
    time: Res<Time>,
) {
    for stroke in strokes.read() {
        let Ok((body, mut cut, mut tissue, transform, deformed)) = bodies.get_mut(stroke.volume) else { continue };
        let Some(volume) = volumes.get(&body.0).filter(|volume| volume.grid().size == cut.size()) else { continue };
        let Some(structures) = volume.structures() else { continue };
        let volume_from_world = transform.affine().inverse();
        let pose = |world: BurrPose| BurrPose {
            centre_m: volume_from_world.transform_point3(world.centre_m),
            axis: volume_from_world.transform_vector3(world.axis),
        };
        let mut burr = stroke.burr;
        let (mut from, mut to) = (pose(stroke.from_world), pose(stroke.to_world));
        let rest = deformed.map(|deformed| RestMap::new(deformed.lattice(), volume.grid()));
        if let Some(rest) = &rest {
            burr.diameter_m *= rest.scale_at(to.centre_m);
            (from, to) = (rest_pose(rest, from), rest_pose(rest, to));
        }
        let stroke_in_volume = BurrStroke { burr, from, to, force_n: stroke.force_n, speed_rpm: stroke.speed_rpm };
        // Looked at without noting a change: a burr that touches nothing changes nothing.
        let untouched = cut.revision();
        let unchanged = cut.bypass_change_detection();
        if stroke.begins_stroke {
            unchanged.begin_stroke();
        }
        let removal = unchanged.drill(volume, structures, &stroke_in_volume, time.delta_secs_f64());
        if cut.revision() == untouched {
            continue;
        }
        cut.set_changed();
        if tissue.revision == Some(untouched) {
            tissue.add(&removal.by_label_mm3);
            tissue.revision = Some(cut.revision());
        }
        if let Some(centroid_m) = removal.centroid_m {
            removed.write(VoxelsRemoved {
                volume: stroke.volume,
                tool: stroke.tool,
                by_label_mm3: removal.by_label_mm3,
                total_mm3: removal.total_mm3,
                centroid_world_m: transform.transform_point(match &rest {
                    None => centroid_m.as_vec3(),
                    Some(rest) => rest.shown(centroid_m.as_vec3()),
                }),
            });
        }
    }
}

/// A burr's pose at rest for the one that is shown.
fn rest_pose(rest: &RestMap, shown: BurrPose) -> BurrPose {
    BurrPose { centre_m: rest.rest(shown.centre_m), axis: rest.rest_direction(shown.axis, shown.centre_m) }
}

/// Volumes whose content was exchanged or modified in place.
pub(super) fn changed_volumes(events: &mut MessageReader<AssetEvent<Volume>>) -> Vec<AssetId<Volume>> {
    let id = |event: &AssetEvent<Volume>| if let AssetEvent::Modified { id } = event { Some(*id) } else { None };
    events.read().filter_map(id).collect()
}

/// Counts anew where a cut changed otherwise: undone, reset, loaded.
fn count_removed(
    mut bodies: Query<(&CtVolume, &CutVolume, &mut RemovedTissue)>,
    volumes: Res<Assets<Volume>>,
    mut assets: MessageReader<AssetEvent<Volume>>,
) {
    let changed = changed_volumes(&mut assets);
    for (body, cut, mut tissue) in &mut bodies {
        let Some(volume) = volumes.get(&body.0).filter(|volume| volume.grid().size == cut.size()) else { continue };
        if tissue.revision != Some(cut.revision()) || changed.contains(&body.0.id()) {
            tissue.recount(volume, cut);
            tissue.revision = Some(cut.revision());
        }
    }
}
