//! The volume of an example: which one, whether it is there, what it costs.

use super::args::Args;
use super::report::Measures;
use bevy::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::critical::CriticalDistances;
use bevy_surgery::volume::load::VolumeLoadOptions;
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::{CtVolume, CutVolume, LoadVolume, Volume, VolumeLoadFailed, WatchCritical};
use std::path::Path;
use std::time::Instant;

/// Size of the real temporal bone, millimetres; its pictures do not say it.
const TEMPORAL_BONE_MM: [f64; 3] = [49.2, 49.2, 48.5];
const TEMPORAL_BONE_VOXELS: [f64; 3] = [256.0, 256.0, 252.0];

/// Which volume an example shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chosen {
    /// That of the arguments.
    Given,
    /// The real temporal bone of the data folder beside the project.
    TemporalBone,
    /// The one that ships with the crate.
    Phantom,
}

/// Gives an entity the volume of the arguments; otherwise the real temporal bone of the data folder beside the project, where it
/// is there; otherwise the phantom that ships with the crate.
pub fn volume(args: &Args, entity: &mut EntityCommands, volumes: &mut Assets<Volume>) -> Result<Chosen> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/ct/temporal-bone-png").canonicalize().ok();
    let given = args.volume.as_ref().map(std::path::absolute).transpose()?;
    let is_real = |path: &Path| data.is_some() && path.canonicalize().ok() == data;
    let chosen = match &given {
        Some(path) if is_real(path) => Chosen::TemporalBone,
        Some(_) => Chosen::Given,
        None if args.phantom || args.figure.is_some() || data.is_none() => Chosen::Phantom,
        None => Chosen::TemporalBone,
    };
    let mut options = VolumeLoadOptions { spacing_mm: args.spacing.map(|Spacing(mm)| mm), ..default() };
    if chosen == Chosen::TemporalBone && options.spacing_mm.is_none() {
        options.spacing_mm = Some(std::array::from_fn(|axis| TEMPORAL_BONE_MM[axis] / TEMPORAL_BONE_VOXELS[axis]));
    }
    match given.or(data).filter(|_| chosen != Chosen::Phantom) {
        Some(path) => entity.insert(LoadVolume { path, options }),
        None => entity.insert(CtVolume(volumes.add(phantom(&PhantomOptions { seed: args.seed, ..default() })?))),
    };
    Ok(chosen)
}

/// Distances between voxels, millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spacing(pub [f64; 3]);

/// Reads `0.2x0.2x0.5`.
pub fn parse_spacing(text: &str) -> Result<Spacing, String> {
    let numbers: Vec<f64> = text.split('x').filter_map(|number| number.parse().ok()).collect();
    match numbers.try_into() {
        Ok(mm) if text.split('x').count() == 3 => Ok(Spacing(mm)),
        _ => Err("write it as 0.2x0.2x0.5".into()),
    }
}

/// Why a volume could not be loaded, if one could not.
pub fn failed_volume(failed: &mut QueryState<&VolumeLoadFailed>, world: &World) -> Option<String> {
    failed.iter(world).next().map(|failed| failed.0.to_string())
}

/// Whether a volume is still on its way.
pub fn is_waiting(world: &mut World) -> bool {
    let mut loading = world.query_filtered::<(), (With<LoadVolume>, Without<CtVolume>, Without<VolumeLoadFailed>)>();
    if loading.iter(world).next().is_some() {
        return true;
    }
    let mut bodies = world.query::<(&CtVolume, Has<CutVolume>, Has<WatchCritical>, Has<CriticalDistances>)>();
    let volumes = world.resource::<Assets<Volume>>();
    bodies.iter(world).any(|(source, is_cut, is_watched, is_measured)| {
        let has_structures = volumes.get(&source.0).is_some_and(|volume| volume.structures().is_some());
        !is_cut || is_watched && has_structures && !is_measured
    })
}

/// Draws a frame without volumes, one in which they come back, and one in which nothing has changed, in turn, so that all see
/// the same noise of the machine.
pub fn compare_with_empty(app: &mut TestApp, measures: &mut Measures) {
    let volumes: Vec<Entity> = app.world_mut().query_filtered::<Entity, With<CtVolume>>().iter(app.world()).collect();
    if volumes.is_empty() {
        return;
    }
    for _ in 0..15 {
        for (frame, shown) in [Visibility::Hidden, Visibility::Hidden, Visibility::Inherited, Visibility::Inherited]
            .into_iter()
            .enumerate()
        {
            for &volume in &volumes {
                app.world_mut().entity_mut(volume).insert(shown);
            }
            let started = Instant::now();
            app.idle();
            let ms = started.elapsed().as_secs_f64() * 1e3;
            match frame {
                1 => measures.by_volumes_shown[0].push(ms),
                2 => measures.by_volumes_shown[1].push(ms),
                3 => measures.by_volumes_shown[2].push(ms),
                // Here the picture still forgets them.
                _ => {}
            }
        }
    }
}
