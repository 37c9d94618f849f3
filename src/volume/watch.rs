//! Distances to critical structures in the ECS.

use super::critical::{CriticalDistances, StructureDistance};
use super::drilling::{DrillVolumes, changed_volumes};
use super::{CtVolume, CutVolume, PrepareCuts, Volume};
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};

/// Keeps the distances to a volume's critical structures: [`CriticalDistances`] is inserted beside it when they have been
/// measured, off the main thread, and follows what is drilled.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct WatchCritical {
    /// How far from a structure its distance is known, millimetres; 0.01 to 1000, and the default where it is no number.
    pub band_mm: f32,
}

impl Default for WatchCritical {
    fn default() -> Self {
        Self { band_mm: 4.0 }
    }
}

/// Distances that are being measured.
#[derive(Component)]
struct Measuring {
    what: Measured,
    task: Task<CriticalDistances>,
}

/// Whose distances these are.
#[derive(Component, Clone, Copy, PartialEq)]
struct Measured {
    of: AssetId<Volume>,
    band_mm: f32,
}

pub(super) fn build(app: &mut App) {
    app.register_type::<WatchCritical>()
        .register_type::<CriticalDistances>()
        .keep_component::<Measured>()
        .keep_large_component(|of: &CriticalDistances| of.fields().iter().map(StructureDistance::bytes).sum())
        .add_systems(PreUpdate, measure.after(PrepareCuts))
        .add_systems(FixedUpdate, follow_cuts.in_set(SurgerySystems::Cut).after(DrillVolumes));
}

type Watched = (
    Entity,
    &'static CtVolume,
    Option<&'static CutVolume>,
    &'static WatchCritical,
    Option<&'static mut Measuring>,
    Option<&'static Measured>,
);

fn measure(
    mut commands: Commands,
    volumes: Res<Assets<Volume>>,
    mut watched: Query<Watched>,
    mut unwatched: RemovedComponents<WatchCritical>,
    mut assets: MessageReader<AssetEvent<Volume>>,
) {
    for entity in unwatched.read().filter(|entity| !watched.contains(*entity)) {
        if let Ok(mut entity) = commands.get_entity(entity) {
            entity.try_remove::<(Measuring, Measured, CriticalDistances)>();
        }
    }
    let changed = changed_volumes(&mut assets);
    for (entity, body, cut, watch, measuring, measured) in &mut watched {
        let band_mm = finite_band(watch.band_mm);
        let wanted = Measured { of: body.0.id(), band_mm };
        let is_modified = changed.contains(&wanted.of);
        if let Some(mut measuring) = measuring.filter(|measuring| measuring.what == wanted && !is_modified) {
            if let Some(distances) = block_on(poll_once(&mut measuring.task)) {
                commands.entity(entity).try_remove::<Measuring>().try_insert((distances, wanted));
            }
            continue;
        }
        if measured == Some(&wanted) && !is_modified {
            continue;
        }
        // Another volume's distances would warn of what is not there.
        if measured.is_some_and(|measured| measured.of != wanted.of) || is_modified {
            commands.entity(entity).try_remove::<(CriticalDistances, Measured)>();
        }
        let Some((volume, cut)) = volumes.get(&body.0).zip(cut).filter(|(it, cut)| it.grid().size == cut.size()) else {
            continue;
        };
        let Some(structures) = volume.structures().cloned() else { continue };
        // What is drilled meanwhile is caught up with by the cut's revision.
        let (grid, cut) = (*volume.grid(), cut.clone());
        let task = AsyncComputeTaskPool::get()
            .spawn(async move { CriticalDistances::build(&grid, &structures, &cut, band_mm) });
        commands.entity(entity).try_insert(Measuring { what: wanted, task });
    }
}

/// The band that is measured: the default where it is not a number.
fn finite_band(band_mm: f32) -> f32 {
    if band_mm.is_finite() { band_mm.clamp(0.01, 1e3) } else { WatchCritical::default().band_mm }
}

fn follow_cuts(volumes: Res<Assets<Volume>>, mut watched: Query<(&CtVolume, &CutVolume, &mut CriticalDistances)>) {
    for (body, cut, mut distances) in &mut watched {
        let Some(structures) = volumes.get(&body.0).and_then(Volume::structures) else { continue };
        // Returns at once where the cut is the one that it knows.
        if distances.bypass_change_detection().update(structures, cut) {
            distances.set_changed();
        }
    }
}
