//! Scenarios: what is to be done, whether it was, and the run to look at again.
//!
//! A [`Scenario`] says what is to be done and what must not be; a [`ScenarioRun`] performs it. In every step the scene is looked at
//! ([`judge::Facts`]), goals and rules are judged ([`judge`]), and all is written down ([`log`]). The log is enough to perform the
//! same run again, to the bit ([`ScenarioRun::replay`]), or to go on from any moment of it ([`ScenarioRun::retry_at`]).

mod asset;
mod error;
mod hash;
pub mod judge;
mod load;
pub mod log;
pub mod metrics;
mod observe;
mod patient;
mod ready;
mod replay;
mod run;
mod scene;
pub mod scripted;
mod systems;

pub use asset::{
    Goal, GoalKind, Guidance, Lesion, PatientEvent, PatientEventKind, PatientVariation, Rule, RuleKind,
    SCENARIO_VERSION, Scenario, ScenarioScene, ScenarioTool, Severity,
};
pub use error::ScenarioError;
pub use load::ScenarioLoader;
pub use observe::ScenarioEye;
pub use ready::{READY_SCENARIOS, ReadyScenario};
pub use run::{RunPhase, ScenarioRun};
pub use scene::ScenarioPart;
pub use systems::{ScenarioSystems, ScenarioTold};

use bevy::prelude::*;

/// Performs scenarios. See the [module](self).
pub struct ScenarioPlugin;

impl Plugin for ScenarioPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<Scenario>()
            .init_asset_loader::<ScenarioLoader>()
            .register_type::<ScenarioEye>()
            .register_type::<ScenarioPart>()
            .register_asset_reflect::<Scenario>();
        systems::build(app);
        scripted::build(app);
    }
}
