//! Scenarios that are played in saved worlds.

use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::asset::io::{AssetSourceBuilder, AssetSourceId};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_surgery::organ::LoadOrgan;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::log::{EndReason, RunLog};
use bevy_surgery::scenario::scripted::{ScriptedHand, Skill};
use bevy_surgery::scenario::{RunPhase, Scenario, ScenarioEye, ScenarioRun};
use bevy_surgery::testing::TestApp;
use std::path::Path;
use std::time::Duration;

const SCENARIO: &str = r#"(version: 1, name: "gallbladder", scene: World("saved://theatre.surgery.scn.ron"),
    tools: [(name: "probe"), (name: "forceps", tool: (kind: Grasper(())))], time_limit_s: 20.0,
    goals: [
        (id: "reach", kind: Reach(structure: "gallbladder", within_m: 0.001)),
        (id: "mark", kind: Mark(organ: "gallbladder", lesions: [(uv: (0.3, 0.4), radius_m: 0.006)], for_s: 0.5)),
    ],
    rules: [(id: "force", kind: Force(structure: "gallbladder", within_m: 0.001, above_n: 5.0), penalty: 30.0)])"#;

/// A theatre that a designer has set up, as a file.
fn theatre() -> String {
    let mut app = TestApp::cpu();
    let source = OrganSource::Ellipsoid { semi_axes_m: Vec3::new(0.02, 0.04, 0.02), subdivisions: 8 };
    let organ = LoadOrgan { source, ..default() };
    let place = Transform::from_xyz(0.1, 0.02, 0.0);
    app.world_mut().spawn((Name::new("gallbladder"), organ, Reactions { map_width_px: 256, ..default() }, place));
    app.world_mut().spawn((Name::new("probe"), Tool::new(ToolKind::Probe)));
    app.world_mut().spawn((Name::new("eye"), ScenarioEye, Transform::from_xyz(0.0, 0.0, 0.3)));
    scene_text(app.world()).expect("it can be saved")
}

/// A program in whose source `saved` there is a file.
fn program(file: &str, text: &str) -> App {
    let files = Dir::default();
    files.insert_asset_text(Path::new(file), text);
    let mut app = App::new();
    app.register_asset_source(
        AssetSourceId::from("saved"),
        AssetSourceBuilder::new(move || Box::new(MemoryAssetReader { root: files.clone() })),
    );
    app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin, AssetPlugin::default(), SurgeryPlugins));
    app.finish();
    app.cleanup();
    app.update();
    app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
    app
}

fn run_of(app: &App) -> &ScenarioRun {
    app.world().resource::<ScenarioRun>()
}

/// Steps until a run's scene is there, or it is refused.
fn begin(app: &mut App, run: ScenarioRun) {
    app.insert_resource(run.kept());
    for _ in 0..60_000 {
        app.update();
        if *run_of(app).phase() != RunPhase::Waiting {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("its scene never came");
}

fn scenario() -> Scenario {
    Scenario::from_bytes(SCENARIO.as_bytes(), "gallbladder.scenario.ron").expect("it is good")
}

fn names(app: &mut App) -> Vec<String> {
    let mut all = app.world_mut().query::<&Name>();
    let mut names: Vec<String> = all.iter(app.world()).map(|name| name.to_string()).collect();
    names.sort();
    names
}

/// Performs a run to its end.
fn perform(app: &mut App, run: ScenarioRun) -> RunLog {
    begin(app, run);
    while *run_of(app).phase() == RunPhase::Running {
        app.update();
    }
    assert_eq!(run_of(app).diverged_s(), None);
    run_of(app).log().expect("it is kept").clone()
}

#[test]
fn a_saved_world_is_played_in_and_scored() {
    let mut app = program("theatre.surgery.scn.ron", &theatre());
    let before = names(&mut app);
    app.insert_resource(ScriptedHand::new(Skill::EXPERT, 0));
    let log = perform(&mut app, ScenarioRun::new(scenario()));
    let end = run_of(&app).end().expect("it is over").clone();
    assert_eq!((end.reason, end.is_passed, end.score), (EndReason::Done, true, 100.0), "{end:?}");
    assert_eq!(log.header.bodies[0].name, "gallbladder");
    let middle_m = log.header.bodies[0].box_world_m[0];
    assert!(middle_m.distance(Vec3::new(0.1, 0.02, 0.0)) < 1e-3, "where it was saved: {middle_m}");
    // The file's own probe, and the forceps that it has not.
    let there = names(&mut app);
    for name in ["probe", "forceps", "eye", "gallbladder"] {
        assert_eq!(there.iter().filter(|there| *there == name).count(), 1, "{name}: {there:?}");
    }
    // Another program does the same.
    let mut other = program("theatre.surgery.scn.ron", &theatre());
    let again = perform(&mut other, ScenarioRun::replay(log.clone()));
    assert_eq!(again.entries, log.entries);
    // With the next scenario all of it goes.
    let mut next = scenario();
    next.scene = bevy_surgery::scenario::ScenarioScene::Own;
    next.tools.clear();
    begin(&mut app, ScenarioRun::new(next));
    app.update();
    assert_eq!(names(&mut app), before);
    let RunPhase::Refused(fault) = run_of(&app).phase() else { panic!("there is no gallbladder any more") };
    assert!(fault.to_string().contains("no structure \"gallbladder\""), "{fault}");
}

/// What is told of a scenario whose world is a file with this text.
fn refused(file: &str, text: &str) -> String {
    let mut app = program(file, text);
    begin(&mut app, ScenarioRun::new(scenario()).named("gallbladder.scenario.ron"));
    let RunPhase::Refused(fault) = run_of(&app).phase().clone() else { panic!("it was taken") };
    fault.to_string()
}

#[test]
fn a_world_that_cannot_be_loaded_is_refused_with_its_file_and_the_reason() {
    let missing = refused("another.surgery.scn.ron", &theatre());
    let begins = "gallbladder.scenario.ron: scene: the world \"saved://theatre.surgery.scn.ron\": ";
    assert!(missing.starts_with(begins), "{missing}");
    assert!(missing[begins.len()..].contains("not found"), "{missing}");
    let text = theatre();
    let broken = refused("theatre.surgery.scn.ron", &text.replace("Ellipsoid", "Elipsoid"));
    assert!(broken.starts_with(begins), "{broken}");
    assert!(broken.contains("line ") && broken.contains("LoadOrgan"), "{broken}");
    let cut = refused("theatre.surgery.scn.ron", &text[..text.len() / 2]);
    assert!(cut.starts_with(begins) && cut.contains("line "), "{cut}");
    let other = SCENARIO.replace("theatre.surgery.scn.ron", "theatre.glb");
    let fault = Scenario::from_bytes(other.as_bytes(), "a").expect_err("that is no saved world").to_string();
    assert_eq!(
        fault,
        "a: scene: the world \"saved://theatre.glb\" is no saved one: their files end in .surgery.scn.ron"
    );
}
