//! Going to any moment of a replay: whatever way led there, what follows is the same to the bit.

use super::ready::expert_run;
use super::{begin, short_run, short_scenario};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_surgery::checkpoint::KeepState;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::judge::{Facts, GoalState, RuleState};
use bevy_surgery::scenario::log::{EndRecord, LogRecord, RunLog};
use bevy_surgery::scenario::{RunPhase, ScenarioRun, ScenarioSystems};
use bevy_surgery::testing::TestApp;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// A replay that has begun.
fn replaying(run: ScenarioRun) -> TestApp {
    begun(TestApp::cpu(), run)
}

fn begun(mut app: TestApp, run: ScenarioRun) -> TestApp {
    app.init_resource::<Seen>()
        .add_systems(FixedUpdate, watch.in_set(SurgerySystems::Judge).after(ScenarioSystems::Judge))
        .insert_resource(run.kept());
    begin(&mut app);
    assert_eq!(*run_of(&app).phase(), RunPhase::Running);
    app
}

fn run_of(app: &TestApp) -> &ScenarioRun {
    app.world().resource::<ScenarioRun>()
}

/// Goes to a time, however many frames that takes.
fn seek(app: &mut TestApp, time_s: f64) {
    app.world_mut().resource_mut::<ScenarioRun>().seek_to(time_s).expect("it is a replay");
    assert!(run_of(app).seeking_to().is_some());
    app.idle_until("the time", |app| app.world().resource::<ScenarioRun>().seeking_to().is_none());
}

/// Plays on to the end.
fn play(app: &mut TestApp) {
    for _ in 0..200 * 60 {
        if run_of(app).end().is_some() {
            return;
        }
        app.step(1);
    }
    panic!("it never ended");
}

/// What was known and judged of each step when it was performed first, and the steps in which that was another thing later.
#[derive(Resource, Default)]
struct Seen {
    first: BTreeMap<u64, (Facts, Vec<GoalState>, Vec<RuleState>)>,
    others: Vec<u64>,
    again: usize,
}

fn watch(run: Res<ScenarioRun>, mut seen: ResMut<Seen>) {
    let (step, now) = (run.facts().step, (run.facts().clone(), run.goals().to_vec(), run.rules().to_vec()));
    if *run.phase() != RunPhase::Running {
        return;
    }
    match seen.first.get(&step) {
        None => drop(seen.first.insert(step, now)),
        Some(first) => {
            let is_other = *first != now;
            seen.again += 1;
            if is_other {
                seen.others.push(step);
            }
        }
    }
}

/// The run and its log are the same, as far as it has come.
fn assert_same(app: &TestApp, log: &RunLog) {
    let run = run_of(app);
    assert_eq!(run.diverged_s(), None);
    let seen = app.world().resource::<Seen>();
    assert_eq!(seen.others, [0; 0], "steps that were others");
    let kept = run.log().expect("it is kept");
    for (before, after) in log.entries.iter().zip(&kept.entries) {
        assert_eq!(before, after, "at {:.2} s", log.time_s(before.step));
    }
    let performed = kept.entries.last().map_or(0, |last| last.step);
    assert!(performed + 1 >= run.steps());
    assert_eq!(kept.entries.len(), log.entries.iter().filter(|entry| entry.step <= performed).count());
}

/// Jumps about in a run and plays on, and it is the same run.
fn jumps(log: &RunLog) {
    let mut app = replaying(ScenarioRun::replay(log.clone()));
    let length_s = run_of(&app).replay_length_s().expect("it is a replay");
    let at = |share: f64| share * length_s;
    let step_at = |share: f64| (at(share) * log.header.steps_per_second).round() as u64;
    seek(&mut app, at(0.6));
    assert_eq!(run_of(&app).steps(), step_at(0.6));
    assert_same(&app, log);
    app.step(70);
    for share in [0.25, 0.5, 0.1] {
        seek(&mut app, at(share));
        assert_eq!(run_of(&app).steps(), step_at(share), "there and no further");
        app.step(90);
        assert_same(&app, log);
    }
    play(&mut app);
    assert_same(&app, log);
    assert!(app.world().resource::<Seen>().again > 200, "much was performed again");
    // Also from the end: the run goes on as if it had never been over.
    seek(&mut app, at(0.8));
    assert_eq!(*run_of(&app).phase(), RunPhase::Running);
    seek(&mut app, 1e9);
    assert_eq!(run_of(&app).end(), Some(&end_of(log)));
    assert_same(&app, log);
}

fn end_of(log: &RunLog) -> EndRecord {
    let ends = log.entries.iter().find_map(|entry| match &entry.record {
        LogRecord::End(end) => Some(end.clone()),
        _ => None,
    });
    ends.expect("it ended")
}

#[test]
fn a_short_run_is_the_same_whatever_way_one_goes() {
    jumps(&short_run());
}

#[test]
fn bleeding_control_is_the_same_whatever_way_one_goes() {
    jumps(&expert_run("bleeding-control").1);
}

#[test]
fn mastoidectomy_is_the_same_whatever_way_one_goes() {
    jumps(&expert_run("mastoidectomy").1);
}

#[test]
fn lesions_are_the_same_whatever_way_one_goes() {
    jumps(&expert_run("lesions").1);
}

/// Goes back with a component that is not put back; the second in which that was noticed.
fn without<C: Component>(log: &RunLog, from_s: f64, back_to_s: f64) -> Option<u64> {
    let mut app = TestApp::cpu();
    app.leave_out::<C>();
    let mut app = begun(app, ScenarioRun::replay(log.clone()));
    seek(&mut app, from_s);
    assert_eq!(run_of(&app).diverged_s(), None, "forwards nothing is put back");
    seek(&mut app, back_to_s);
    seek(&mut app, from_s);
    run_of(&app).diverged_s()
}

#[test]
fn what_is_not_put_back_is_noticed() {
    let log = short_run();
    assert_eq!(without::<ReactionModel>(&log, 4.0, 1.5), Some(1), "blood of later");
    assert_eq!(without::<ToolPose>(&log, 4.0, 1.5), None, "what the log says of every step is its own");
    let log = expert_run("mastoidectomy").1;
    assert!(without::<CutVolume>(&log, 20.0, 9.5).is_some(), "bone is missing");
    assert!(without::<FluidSolver>(&log, 20.0, 9.5).is_some(), "blood is where it was later");
}

#[test]
fn a_paused_world_is_led_and_stays_where_it_is() {
    let log = short_run();
    let mut app = replaying(ScenarioRun::replay(log.clone()));
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));
    // Step by step.
    for step in 2..40_u64 {
        app.world_mut().resource_mut::<ScenarioRun>().seek_to(step as f64 / 60.0).expect("it is a replay");
        app.update();
        assert_eq!((run_of(&app).steps(), run_of(&app).seeking_to()), (step, None));
        app.update();
        assert_eq!(run_of(&app).steps(), step, "nothing happens by itself");
    }
    seek(&mut app, 3.0);
    seek(&mut app, 1.0);
    assert_same(&app, &log);
    assert_eq!(app.world().resource::<Pacing>().lost_s, 0.0, "no time was given up");
    app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    play(&mut app);
    assert_same(&app, &log);
}

#[test]
fn a_replay_is_the_same_at_any_speed() {
    for (id, speed) in [("bleeding-control", 4.0), ("mastoidectomy", 4.0), ("lesions", 0.3)] {
        let log = expert_run(id).1;
        let mut app = replaying(ScenarioRun::replay(log.clone()));
        app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(speed);
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));
        for _ in 0..20 {
            app.update();
        }
        let steps = f64::from(run_of(&app).steps() as u32);
        assert!((steps - 20.0 * f64::from(speed)).abs() <= 3.0, "{id}: {steps} steps in 20 frames");
        for _ in 0..40_000 {
            if run_of(&app).end().is_some() {
                break;
            }
            app.update();
        }
        assert_eq!(run_of(&app).end(), Some(&end_of(&log)), "{id}");
        assert_same(&app, &log);
    }
}

#[test]
fn what_is_asked_for_too_soon_is_done_when_it_can_be() {
    let log = short_run();
    let mut app = TestApp::cpu();
    let mut run = ScenarioRun::replay(log.clone()).kept();
    run.seek_to(2.0).expect("it is a replay");
    app.init_resource::<Seen>().insert_resource(run);
    app.idle();
    let one_step = Duration::from_secs_f64(1.0 / 60.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(one_step));
    for _ in 0..10_000 {
        app.update();
        if run_of(&app).seeking_to().is_none() {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    // The frame in which it arrives goes on as frames do.
    assert!((120..=121).contains(&run_of(&app).steps()), "{}", run_of(&app).steps());
    assert_same(&app, &log);
}

#[test]
fn only_what_has_been_performed_can_be_gone_to() {
    let fault = ScenarioRun::new(short_scenario()).named("a.scenario.ron").seek_to(1.0).expect_err("no replay");
    assert_eq!(
        fault.to_string(),
        "a.scenario.ron: seek to: the run replays no log: only what has been performed can be gone to"
    );
    let log = short_run();
    for time_s in [f64::NAN, f64::INFINITY, -1.0] {
        assert!(ScenarioRun::replay(log.clone()).seek_to(time_s).is_err(), "{time_s}");
    }
    // A retry can be led until the other hand takes over.
    let mut app =
        replaying(ScenarioRun::retry_at(log.clone(), Path::new("first.mcap"), 2.0).expect("it lasted longer"));
    seek(&mut app, 1e9);
    assert_eq!(run_of(&app).steps(), 120);
    seek(&mut app, 0.5);
    assert_same(&app, &log);
    seek(&mut app, 2.0);
    app.step(1);
    let fault = app.world_mut().resource_mut::<ScenarioRun>().seek_to(1.0).expect_err("it is another run now");
    assert!(fault.to_string().ends_with("another hand has taken over"), "{fault}");
}

#[test]
fn a_file_holds_every_step_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("again.mcap");
    let log = short_run();
    let mut app = replaying(ScenarioRun::replay(log.clone()).recorded_to(&file));
    seek(&mut app, 3.0);
    seek(&mut app, 1.0);
    seek(&mut app, 2.0);
    play(&mut app);
    seek(&mut app, 1.0);
    assert_eq!(run_of(&app).log_fault(), None);
    drop(app);
    let read = RunLog::read(&file).expect("it is a log");
    assert!(read.is_complete);
    assert_eq!(read.entries, log.entries);
}
