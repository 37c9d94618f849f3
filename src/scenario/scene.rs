//! What the ready scenarios are played in: the models, which need no renderer, and where the eye is.

use super::{ScenarioEye, ScenarioRun, ScenarioScene};
use crate::highlights::Highlights;
use crate::organ::{Organ, OrganModel, OrganOptions};
use crate::pool::{Pool, PoolBackend, SuctionIrrigator};
use crate::reactions::Reactions;
use crate::skin::Skin;
use crate::tools::{Tool, ToolKind};
use crate::volume::phantom::{PhantomOptions, phantom};
use crate::volume::{CtVolume, Volume, WatchCritical};
use bevy::prelude::*;

/// Voxels along the side of the phantom: 0.3 mm each, with which a step takes a third of the time that it takes at 0.19.
const PHANTOM_VOXELS: u32 = 160;
/// How far the eye is from the bone, metres: that of an operating microscope.
const MICROSCOPE_M: f32 = 0.25;

/// Part of the scene of a scenario: despawned with it. Beside what [`ScenarioScene`] names.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ScenarioPart;

/// Spawns the scene of a run that has just been inserted, and the tools that it names and nobody has; of one before it nothing is
/// left.
pub(super) fn spawn_scene(
    mut run: ResMut<ScenarioRun>,
    parts: Query<Entity, With<ScenarioPart>>,
    tools: Query<&Name, (With<Tool>, Without<ScenarioPart>)>,
    mut commands: Commands,
    models: Option<ResMut<Assets<OrganModel>>>,
    volumes: Option<ResMut<Assets<Volume>>>,
) -> Result {
    if std::mem::replace(&mut run.has_scene, true) {
        return Ok(());
    }
    for part in &parts {
        commands.entity(part).despawn();
    }
    for wanted in &run.scenario.tools {
        if tools.iter().any(|name| name.as_str() == wanted.name) {
            continue;
        }
        let mut tool = commands.spawn((ScenarioPart, Name::new(wanted.name.clone()), wanted.tool.clone()));
        if wanted.tool.kind == ToolKind::SuctionIrrigator {
            tool.insert(SuctionIrrigator::default());
        }
    }
    match run.scenario.scene {
        ScenarioScene::Own | ScenarioScene::World(_) => {}
        ScenarioScene::Liver => {
            let Some(mut models) = models else { return Ok(()) };
            let liver = OrganModel::procedural_liver(&OrganOptions::default())?;
            commands.spawn((
                ScenarioPart,
                Name::new("liver"),
                Organ(models.add(liver)),
                Skin { seed: run.seed, ..Skin::liver() },
                Reactions::default(),
                Highlights::default(),
            ));
            let place = Transform::from_xyz(0.0, 0.09, 0.18).looking_at(Vec3::ZERO, Vec3::Y);
            commands.spawn((ScenarioPart, Name::new("eye"), ScenarioEye, place));
        }
        ScenarioScene::TemporalBone => {
            let Some(mut volumes) = volumes else { return Ok(()) };
            let amount = run.scenario.patient.amount;
            let seed = if amount > 0.0 { run.seed } else { PhantomOptions::default().seed };
            let bone = phantom(&PhantomOptions { size: PHANTOM_VOXELS, seed, ..PhantomOptions::default() })?;
            let bone =
                (ScenarioPart, Name::new("temporal bone"), CtVolume(volumes.add(bone)), WatchCritical::default());
            let bone = commands.spawn((bone, Transform::IDENTITY)).id();
            let pool = Pool { size: UVec2::new(256, 192), cell_m: 2.5e-4, ..Pool::new(bone) };
            // On the processor: a run that is scored can be repeated to the bit.
            let place = Pool::facing(Vec3::ZERO, Vec3::Z);
            commands.spawn((Name::new("pool"), pool, PoolBackend::Cpu, place, ChildOf(bone)));
            let place = Transform::from_xyz(0.0, 0.0, MICROSCOPE_M);
            commands.spawn((ScenarioPart, Name::new("eye"), ScenarioEye, place));
        }
    }
    Ok(())
}
