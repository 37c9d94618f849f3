//! Runs again: the same to the bit, another from a moment on, and the second named in which one was not the same.

use super::{again, begin, perform, short_run, short_scenario};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::log::{EndReason, LogRecord, RunLog};
use bevy_surgery::scenario::scripted::{ScriptedHand, Skill};
use bevy_surgery::scenario::{RunPhase, ScenarioRun};
use bevy_surgery::testing::TestApp;
use std::path::Path;

fn hashes(log: &RunLog) -> Vec<String> {
    let of = |entry: &bevy_surgery::scenario::log::LogEntry| match &entry.record {
        LogRecord::Hash(hash) => Some(hash.hash.clone()),
        _ => None,
    };
    log.entries.iter().filter_map(of).collect()
}

#[test]
fn a_run_is_repeated_to_the_bit() {
    let log = short_run();
    assert!(hashes(&log).len() >= 3, "{}", hashes(&log).len());
    again(&log);
}

/// Programs that draw put more into the world than those that do not.
#[cfg(feature = "scenes")]
#[test]
fn a_run_is_the_same_whatever_is_seen_around_it() {
    let mut app = TestApp::cpu();
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn_scene(bevy_surgery::scenes::abdominal_wall());
    });
    app.insert_resource(ScenarioRun::replay(short_run()));
    begin(&mut app);
    while app.world().resource::<ScenarioRun>().end().is_none() {
        app.step(1);
    }
    let mut walls = app.world_mut().query_filtered::<&OrganShape, With<Hollow>>();
    assert_eq!(walls.iter(app.world()).count(), 1, "it is there");
    assert_eq!(app.world().resource::<ScenarioRun>().diverged_s(), None);
}

#[test]
fn a_run_that_is_another_is_found_by_its_second() {
    let mut log = short_run();
    // The hand is a hair elsewhere in step 100, in the second second.
    let changed =
        log.entries.iter_mut().find(|entry| entry.step == 100 && matches!(entry.record, LogRecord::Sample(_)));
    let Some(LogRecord::Sample(sample)) = changed.map(|entry| &mut entry.record) else { panic!("there is one") };
    sample.pose.place.tip_in_world_m.x += 1e-6;
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::replay(log));
    begin(&mut app);
    while app.world().get_resource::<ScenarioRun>().is_some_and(|run| run.end().is_none()) {
        app.step(1);
    }
    assert_eq!(app.world().resource::<ScenarioRun>().diverged_s(), Some(2));
}

#[test]
fn a_run_goes_on_from_any_moment_with_another_hand() {
    let log = short_run();
    let retried = ScenarioRun::retry_at(log.clone(), Path::new("first.mcap"), 1.5).expect("it lasted longer");
    let (_, other) = perform(retried, Some(Skill::NOVICE));
    let [first, second] = [&log, &other].map(hashes);
    assert_eq!(first[0], second[0], "the first second is the same");
    assert_ne!(first[1], second[1], "the second one is not");
    assert_eq!(other.header.branch.as_ref().map(|branch| branch.step), Some(90));
    // It is a run like any other: it can be repeated from its beginning.
    again(&other);
    let fault = ScenarioRun::retry_at(log, Path::new("first.mcap"), 1e4).err().expect("it is over by then");
    assert!(fault.to_string().contains("10000 s is not in the run"), "{fault}");
}

#[test]
fn a_run_of_another_rate_is_refused() {
    let mut app = TestApp::cpu();
    app.insert_resource(Time::<Fixed>::from_hz(30.0)).insert_resource(ScenarioRun::replay(short_run()));
    begin(&mut app);
    let RunPhase::Refused(fault) = app.world().resource::<ScenarioRun>().phase().clone() else { panic!("it is not") };
    assert!(fault.to_string().contains("60.0 steps a second, and this program makes 30.0"), "{fault}");
}

#[test]
fn unknown_structures_are_told_with_the_nearest_spelling() {
    let mut scenario = short_scenario();
    let rule = r#"(id: "force", kind: Force(structure: "livr", within_m: 0.001, above_n: 1.0))"#;
    let text = format!(
        "(version: 1, name: \"a\", scene: Liver, goals: [(id: \"b\", kind: Reach(structure: \"liver\", within_m: 0.0))], rules: [{rule}])"
    );
    scenario.rules = bevy_surgery::scenario::Scenario::from_bytes(text.as_bytes(), "a").expect("good").rules;
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::new(scenario).named("a.scenario.ron"));
    begin(&mut app);
    let RunPhase::Refused(fault) = app.world().resource::<ScenarioRun>().phase().clone() else { panic!("it is not") };
    assert_eq!(
        fault.to_string(),
        "a.scenario.ron: rule \"force\": there is no structure \"livr\" in the scene: did you mean \"liver\"?"
    );
}

#[test]
fn the_world_stands_still_until_the_scene_is_there() {
    let mut app = TestApp::cpu();
    let clock = app.world_mut().spawn((Bleeder::default(), Transform::default())).id();
    let organ = app.world_mut().spawn((Name::new("liver"), Organ(Handle::default()))).id();
    let mut scenario = short_scenario();
    scenario.scene = bevy_surgery::scenario::ScenarioScene::Own;
    app.insert_resource(ScenarioRun::new(scenario));
    app.step(30);
    assert_eq!(*app.world().resource::<ScenarioRun>().phase(), RunPhase::Waiting);
    assert_eq!(app.world().resource::<ScenarioRun>().steps(), 0);
    let liver = OrganModel::procedural_liver(&OrganOptions::default()).expect("the crate's own");
    let liver = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
    app.world_mut().entity_mut(organ).insert((Organ(liver), Reactions::default()));
    app.step(5);
    assert_eq!(*app.world().resource::<ScenarioRun>().phase(), RunPhase::Running);
    assert!(app.world().resource::<ScenarioRun>().steps() >= 3);
    let _ = clock;
}

#[test]
fn a_run_can_be_stopped_and_another_one_begun() {
    let mut app = TestApp::cpu();
    app.insert_resource(ScenarioRun::new(short_scenario()).kept());
    begin(&mut app);
    app.step(10);
    app.world_mut().resource_mut::<ScenarioRun>().stop();
    app.step(1);
    let end = app.world().resource::<ScenarioRun>().end().cloned().expect("it is over");
    assert_eq!(end.reason, EndReason::Stopped);
    let steps = app.world().resource::<ScenarioRun>().steps();
    app.step(5);
    assert_eq!(app.world().resource::<ScenarioRun>().steps(), steps, "it is not judged any more");
    // The second one finds a scene as fresh as the first one did.
    app.insert_resource(ScriptedHand::new(Skill::EXPERT, 0));
    app.insert_resource(ScenarioRun::new(short_scenario()).kept());
    begin(&mut app);
    for _ in 0..600 {
        app.step(1);
        if app.world().resource::<ScenarioRun>().end().is_some() {
            break;
        }
    }
    let run = app.world().resource::<ScenarioRun>();
    assert_eq!(run.end().map(|end| end.reason), Some(EndReason::Done));
    assert_eq!(hashes(run.log().expect("kept")), hashes(&short_run()));
    let livers = app.world_mut().query::<(&Name, &Organ)>().iter(app.world()).count();
    assert_eq!(livers, 1);
}
