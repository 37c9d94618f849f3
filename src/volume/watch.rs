//! Distances to critical structures in the ECS.

use super::critical::CriticalDistances;
use super::{CtVolume, CutVolume, PrepareCuts, Volume};
use crate::schedule::SurgerySystems;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, block_on, poll_once};

/// Keeps the distances to a volume's critical structures: [`CriticalDistances`] is inserted beside it when they have been
/// measured, off the main thread, and follows what is drilled.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct WatchCritical {
    /// How far from a structure its distance is known, millimetres.
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
    of: AssetId<Volume>,
    watch: WatchCritical,
    task: Task<CriticalDistances>,
}

/// Whose distances these are.
#[derive(Component, Clone, Copy, PartialEq)]
struct Measured(AssetId<Volume>, WatchCritical);

pub(super) fn build(app: &mut App) {
    app.register_type::<WatchCritical>()
        .register_type::<CriticalDistances>()
        .add_systems(PreUpdate, measure.after(PrepareCuts))
        .add_systems(FixedUpdate, follow_cuts.in_set(SurgerySystems::Cut).after(super::drilling::DrillVolumes));
}

type Watched = (
    Entity,
    &'static CtVolume,
    &'static CutVolume,
    &'static WatchCritical,
    Option<&'static mut Measuring>,
    Option<&'static Measured>,
);

fn measure(mut commands: Commands, volumes: Res<Assets<Volume>>, mut watched: Query<Watched>) {
    for (entity, body, cut, watch, measuring, measured) in &mut watched {
        let wanted = Measured(body.0.id(), *watch);
        if let Some(mut measuring) = measuring.filter(|measuring| Measured(measuring.of, measuring.watch) == wanted) {
            if let Some(distances) = block_on(poll_once(&mut measuring.task)) {
                commands.entity(entity).remove::<Measuring>().insert((distances, wanted));
            }
            continue;
        }
        if measured == Some(&wanted) {
            continue;
        }
        let Some(volume) = volumes.get(&body.0).filter(|volume| volume.grid().size == cut.size()) else { continue };
        let Some(structures) = volume.structures().cloned() else { continue };
        // What is drilled meanwhile is caught up with by the cut's revision.
        let (grid, cut, band_mm) = (*volume.grid(), cut.clone(), watch.band_mm);
        let task = AsyncComputeTaskPool::get()
            .spawn(async move { CriticalDistances::build(&grid, &structures, &cut, band_mm) });
        commands.entity(entity).insert(Measuring { of: wanted.0, watch: *watch, task });
    }
}

fn follow_cuts(
    volumes: Res<Assets<Volume>>,
    mut watched: Query<
        (&CtVolume, &CutVolume, &mut CriticalDistances),
        Or<(Changed<CutVolume>, Added<CriticalDistances>)>,
    >,
) {
    for (body, cut, mut distances) in &mut watched {
        let Some(structures) = volumes.get(&body.0).and_then(Volume::structures) else { continue };
        if distances.bypass_change_detection().update(structures, cut) {
            distances.set_changed();
        }
    }
}
