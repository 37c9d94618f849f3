//! What scenarios are played in: the models, which need no renderer, where the eye is, and saved worlds.

use super::systems::refuse;
use super::{ScenarioError, ScenarioEye, ScenarioRun, ScenarioScene};
use crate::pool::{Pool, PoolBackend, PoolFluid, SuctionIrrigator};
use crate::ready;
use crate::skin::Skin;
use crate::tools::{Tool, ToolKind};
use crate::volume::phantom::PhantomOptions;
use bevy::prelude::*;

/// Voxels along the side of the phantom: 0.3 mm each, with which a step takes a third of the time that it takes at 0.19.
const PHANTOM_VOXELS: u32 = 160;
/// Working distance of the operating microscope, metres.
const MICROSCOPE_M: f32 = 0.25;
/// Water and suction, millilitres a second. A lesson takes a minute of what takes half an hour, so that there is as much more dust and
/// blood in a second: a litre of water in a quarter of an hour keeps the field as clear as the slower drip does in theatre.
const IRRIGATION_ML_S: f32 = 1.0;
const SUCTION_ML_S: f32 = 6.0;
/// Milky water per volume of drilled bone, for the same reason.
const DUST_PER_BONE: f32 = 1.0;

/// Part of the scene of a scenario: despawned with it. Beside what [`ScenarioScene`] names.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ScenarioPart;

/// How far the scene of a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum SceneState {
    /// Nothing was spawned yet.
    #[default]
    Wanted,
    /// A saved world is being loaded; this entity is its root.
    Loading(Entity),
    /// All was spawned but the tools that are missing.
    Spawned,
    /// All was spawned.
    There,
}

/// Spawns the scene of a run that has just been inserted; of one before it nothing is left.
pub(super) fn spawn_scene(
    mut run: ResMut<ScenarioRun>,
    parts: Query<Entity, With<ScenarioPart>>,
    mut commands: Commands,
    worlds: worlds::Worlds,
) {
    let run = &mut *run;
    match run.scene {
        SceneState::Wanted => {}
        SceneState::Loading(root) => {
            match worlds.is_there(root) {
                Ok(true) => run.scene = SceneState::Spawned,
                Ok(false) => {}
                Err(reason) => refuse_world(run, &reason),
            }
            return;
        }
        SceneState::Spawned | SceneState::There => return,
    }
    for part in &parts {
        commands.entity(part).despawn();
    }
    run.scene = SceneState::Spawned;
    match &run.scenario.scene {
        ScenarioScene::Own => {}
        ScenarioScene::World(path) => match worlds.load(path, &mut commands) {
            Ok(root) => run.scene = SceneState::Loading(root),
            Err(reason) => refuse_world(run, &reason),
        },
        ScenarioScene::Liver => {
            let (organ, skin, reactions, highlights) = ready::liver();
            let skin = Skin { seed: run.seed, ..skin };
            commands.spawn((ScenarioPart, Name::new("liver"), organ, skin, reactions, highlights));
            commands.spawn((ScenarioPart, Name::new("eye"), ScenarioEye, ready::before_liver()));
        }
        ScenarioScene::TemporalBone => {
            let amount = run.scenario.patient.amount;
            let seed = if amount > 0.0 { run.seed } else { PhantomOptions::default().seed };
            let bone = ready::mastoid_bone(PhantomOptions { size: PHANTOM_VOXELS, seed, ..PhantomOptions::default() });
            let bone = commands.spawn((ScenarioPart, Name::new("temporal bone"), bone, Transform::IDENTITY)).id();
            let pool = Pool { size: UVec2::new(256, 192), cell_m: 2.5e-4, ..Pool::new(bone) };
            // On the processor: a run that is scored can be repeated to the bit.
            let place = (PoolBackend::Cpu, ready::over_mastoid(), ChildOf(bone));
            commands.spawn((Name::new("pool"), pool, PoolFluid { dust_per_bone: DUST_PER_BONE, ..default() }, place));
            let place = ready::before_mastoid(MICROSCOPE_M);
            commands.spawn((ScenarioPart, Name::new("eye"), ScenarioEye, place));
        }
    }
}

/// Spawns the tools that a run names and its scene has not.
pub(super) fn spawn_tools(
    mut run: ResMut<ScenarioRun>,
    tools: Query<&Name, (With<Tool>, Without<ScenarioPart>)>,
    mut commands: Commands,
) {
    if run.scene != SceneState::Spawned {
        return;
    }
    run.scene = SceneState::There;
    for wanted in &run.scenario.tools {
        if tools.iter().any(|name| name.as_str() == wanted.name) {
            continue;
        }
        let mut tool = commands.spawn((ScenarioPart, Name::new(wanted.name.clone()), wanted.tool.clone()));
        if wanted.tool.kind == ToolKind::SuctionIrrigator {
            let (irrigation_ml_s, suction_ml_s) = (IRRIGATION_ML_S, SUCTION_ML_S);
            tool.insert(SuctionIrrigator { irrigation_ml_s, suction_ml_s, ..default() });
        }
    }
}

fn refuse_world(run: &mut ScenarioRun, reason: &str) {
    let ScenarioScene::World(path) = &run.scenario.scene else { return };
    let reason = format!("the world \"{path}\": {reason}");
    let fault = ScenarioError::Field { file: run.file.clone(), field: "scene".into(), reason };
    refuse(run, fault);
}

/// Saved worlds, with Bevy's plugin for them.
#[cfg(feature = "scenes")]
mod worlds {
    use super::ScenarioPart;
    use bevy::asset::LoadState;
    use bevy::ecs::system::SystemParam;
    use bevy::prelude::*;
    use bevy::world_serialization::WorldInstanceReady;

    /// On the root of a world all of whose entities are there.
    #[derive(Component)]
    pub struct IsThere;

    #[derive(SystemParam)]
    pub(in super::super) struct Worlds<'w, 's> {
        server: Option<Res<'w, AssetServer>>,
        worlds: Option<Res<'w, Assets<DynamicWorld>>>,
        roots: Query<'w, 's, (&'static DynamicWorldRoot, Has<IsThere>)>,
    }

    impl Worlds<'_, '_> {
        /// Begins to load a world; all of it will hang from an entity.
        pub fn load(&self, path: &str, commands: &mut Commands) -> Result<Entity, String> {
            let Some((server, _)) = self.server.as_ref().zip(self.worlds.as_ref()) else {
                return Err("this program has no ScenesPlugin, which would load it".into());
            };
            let root = (ScenarioPart, Name::new("world"), DynamicWorldRoot(server.load(path.to_owned())));
            let mark = |ready: On<WorldInstanceReady>, mut commands: Commands| {
                commands.entity(ready.entity).try_insert(IsThere);
            };
            Ok(commands.spawn(root).observe(mark).id())
        }

        /// Whether a world's entities are there.
        pub fn is_there(&self, root: Entity) -> Result<bool, String> {
            let Ok((world, is_there)) = self.roots.get(root) else { return Err("it was despawned".into()) };
            match self.server.as_ref().map(|server| server.load_state(&world.0)) {
                Some(LoadState::Failed(error)) => Err(error.to_string()),
                _ => Ok(is_there),
            }
        }
    }
}

/// Without Bevy's plugin for them there are no saved worlds.
#[cfg(not(feature = "scenes"))]
mod worlds {
    use bevy::ecs::system::SystemParam;
    use bevy::prelude::*;

    #[derive(SystemParam)]
    pub(in super::super) struct Worlds<'w, 's> {
        _none: Query<'w, 's, ()>,
    }

    impl Worlds<'_, '_> {
        pub fn load(&self, _: &str, _: &mut Commands) -> Result<Entity, String> {
            Err("this program was built without the feature `scenes`, which loads saved worlds".into())
        }

        pub fn is_there(&self, _: Entity) -> Result<bool, String> {
            Ok(false)
        }
    }
}
