//! Scenarios: what is to be done, whether it was, and the run to look at again.
//!
//! A [`Scenario`] says what is to be done and what must not be; a [`ScenarioRun`] performs it. In every step the scene is looked at
//! ([`judge::Facts`]), goals and rules are judged ([`judge`]), and all is written down ([`log`]). The log is enough to perform the
//! same run again, to the bit ([`ScenarioRun::replay`]), or to go on from any moment of it ([`ScenarioRun::retry_at`]).
//! [`metrics`] says how it was done; a [`Guide`] tells a trainee meanwhile.
//!
//! A scored scenario of one's own:
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::prelude::*;
//! use bevy_surgery::scenario::{RunPhase, Scenario, ScenarioEye, ScenarioRun, ScenarioTold};
//!
//! const SCENARIO: &str = r#"(
//!     version: 1,
//!     name: "A gentle touch",
//!     tools: [(name: "probe")],
//!     time_limit_s: 30,
//!     goals: [
//!         (id: "touch", title: "Touch the liver", kind: Reach(structure: "liver", within_m: 0.0005)),
//!     ],
//!     rules: [
//!         (id: "force", message: "Gently!", kind: Force(structure: "liver", within_m: 0.001, above_n: 1), penalty: 30),
//!     ],
//! )"#;
//!
//! fn setup(mut commands: Commands, mut models: ResMut<Assets<OrganModel>>) -> Result {
//!     let liver = models.add(OrganModel::procedural_liver(&OrganOptions::default())?);
//!     commands.spawn((Name::new("liver"), Organ(liver), Skin::liver(), Reactions::default(), Highlights::default()));
//!     // Beside the camera in a program that has one: `Endoscope::default()`.
//!     let place = Transform::from_xyz(0.0, 0.12, 0.22).looking_at(Vec3::ZERO, Vec3::Y);
//!     commands.spawn((ScenarioEye, place));
//!     let scenario = Scenario::from_bytes(SCENARIO.as_bytes(), "a gentle touch")?;
//!     commands.insert_resource(ScenarioRun::new(scenario).recorded_to("touch.mcap"));
//!     Ok(())
//! }
//!
//! // The probe comes down on the liver; `HoldDevice` beside it would let a hand do that.
//! fn move_probe(mut probes: Query<&mut ToolPose, With<Tool>>, run: Option<Res<ScenarioRun>>) {
//!     let Some(run) = run.filter(|run| *run.phase() == RunPhase::Running) else { return };
//!     let tip_m = Vec3::Y * (0.1 - 0.05 * run.time_s() as f32);
//!     for mut pose in &mut probes {
//!         *pose = ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::Y);
//!     }
//! }
//!
//! fn tell(run: Option<Res<ScenarioRun>>, mut told: MessageReader<ScenarioTold>) {
//!     for ScenarioTold { record, .. } in told.read() {
//!         info!("{record:?}");
//!     }
//!     if let Some(end) = run.as_ref().and_then(|run| run.end()) {
//!         info!("{:.0} points of 100", end.score);
//!     }
//! }
//!
//! # use bevy_surgery::testing::TestApp;
//! # let folder = std::env::temp_dir().join(format!("bevy_surgery-doc-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! # std::env::set_current_dir(&folder)?;
//! # let mut app = TestApp::cpu();
//! // In a program of its own: `App::new().add_plugins((DefaultPlugins, SurgeryPlugins))`.
//! app.add_systems(Startup, setup)
//!     .add_systems(FixedUpdate, move_probe.in_set(SurgerySystems::Sense))
//!     .add_systems(Update, tell);
//! # for _ in 0..300 {
//! #     app.step(1);
//! # }
//! # let end = app.world().resource::<ScenarioRun>().end().cloned();
//! # assert!(end.as_ref().is_some_and(|end| end.is_passed && end.score == 100.0), "{end:?}");
//! # assert!(std::fs::read("touch.mcap")?.len() > 1000);
//! # drop(app);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod asset;
mod error;
mod guide;
mod hash;
pub mod judge;
mod load;
pub mod log;
pub mod metrics;
mod observe;
mod patient;
mod ready;
mod replay;
pub mod report;
mod run;
mod scene;
pub mod scripted;
mod seek;
mod systems;

pub use asset::{
    Goal, GoalKind, Guidance, Lesion, PatientEvent, PatientEventKind, PatientVariation, Rule, RuleKind,
    SCENARIO_VERSION, Scenario, ScenarioScene, ScenarioTool, Severity,
};
pub use error::ScenarioError;
pub use guide::Guide;
pub use load::ScenarioLoader;
pub use observe::ScenarioEye;
pub use ready::{READY_SCENARIOS, ReadyScenario};
pub use run::{RunPhase, ScenarioRun};
pub use scene::ScenarioPart;
pub use systems::{ScenarioSystems, ScenarioTold};

use crate::checkpoint::KeepState;
use bevy::prelude::*;

/// Performs scenarios. See the [module](self).
pub struct ScenarioPlugin;

impl Plugin for ScenarioPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<Scenario>()
            .init_asset_loader::<ScenarioLoader>()
            .init_resource::<Guide>()
            .register_type::<Guide>()
            .register_type::<ScenarioEye>()
            .register_type::<ScenarioPart>()
            // So that it is where it was.
            .keep_component::<ScenarioEye>()
            .register_asset_reflect::<Scenario>();
        register(app);
        systems::build(app);
        scripted::build(app);
    }
}

/// What inspectors and remote tools may want to see.
fn register(app: &mut App) {
    metrics::register(app);
    app.register_type::<Scenario>()
        .register_type::<Goal>()
        .register_type::<GoalKind>()
        .register_type::<Guidance>()
        .register_type::<Lesion>()
        .register_type::<PatientEvent>()
        .register_type::<PatientEventKind>()
        .register_type::<PatientVariation>()
        .register_type::<Rule>()
        .register_type::<RuleKind>()
        .register_type::<ScenarioScene>()
        .register_type::<ScenarioTool>()
        .register_type::<Severity>()
        .register_type::<RunPhase>()
        .register_type::<ScenarioError>()
        .register_type::<ScenarioTold>();
    app.register_type::<log::LogHeader>()
        .register_type::<log::LoggedTool>()
        .register_type::<log::LoggedBody>()
        .register_type::<log::LogBranch>()
        .register_type::<log::LogEntry>()
        .register_type::<log::LogRecord>()
        .register_type::<log::ToolSample>()
        .register_type::<log::ContactRecord>()
        .register_type::<log::RemovalRecord>()
        .register_type::<log::ReactionRecord>()
        .register_type::<log::BleedingRecord>()
        .register_type::<log::CameraRecord>()
        .register_type::<log::GoalRecord>()
        .register_type::<log::ViolationRecord>()
        .register_type::<log::HashRecord>()
        .register_type::<log::EndRecord>()
        .register_type::<log::EndReason>()
        .register_type::<log::RunLog>()
        .register_type::<log::LogError>();
    app.register_type::<judge::Facts>()
        .register_type::<judge::ToolFacts>()
        .register_type::<judge::StructureFacts>()
        .register_type::<judge::LesionFacts>()
        .register_type::<judge::RemovalFacts>()
        .register_type::<judge::Targets>()
        .register_type::<judge::TargetStructure>()
        .register_type::<judge::TargetLesions>()
        .register_type::<judge::GoalState>()
        .register_type::<judge::RuleState>();
}
