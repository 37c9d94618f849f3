//! Scenarios: files, judging, logs, runs and their replay.

#[path = "scenario/burrs.rs"]
mod burrs;
#[path = "scenario/documented.rs"]
mod documented;
#[path = "scenario/files.rs"]
mod files;
#[path = "scenario/in_view.rs"]
mod in_view;
#[path = "scenario/judging.rs"]
mod judging;
#[path = "scenario/lesions.rs"]
mod lesions;
#[path = "scenario/logs.rs"]
mod logs;
#[path = "scenario/ready.rs"]
mod ready;
#[path = "scenario/replays.rs"]
mod replays;
#[path = "scenario/seeking.rs"]
mod seeking;
#[cfg(feature = "scenes")]
#[path = "scenario/worlds.rs"]
mod worlds;

use bevy_surgery::scenario::log::{EndRecord, RunLog};
use bevy_surgery::scenario::scripted::{ScriptedHand, Skill};
use bevy_surgery::scenario::{RunPhase, Scenario, ScenarioRun};
use bevy_surgery::testing::TestApp;
use std::sync::OnceLock;
use std::time::Duration;

/// Steps until the scene of a run is there, and its first step is done; or until it is refused.
fn begin(app: &mut TestApp) {
    for _ in 0..60_000 {
        app.step(1);
        if *app.world().resource::<ScenarioRun>().phase() != RunPhase::Waiting {
            return;
        }
        // Organs and volumes are made off the main thread.
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("its scene never came");
}

/// Performs a run to its end: its hand, or that of its log.
fn perform(run: ScenarioRun, skill: Option<Skill>) -> (EndRecord, RunLog) {
    let mut app = TestApp::cpu();
    if let Some(skill) = skill {
        app.insert_resource(ScriptedHand::new(skill, run.seed()));
    }
    app.insert_resource(run.kept());
    begin(&mut app);
    for _ in 0..200 * 60 {
        let run = app.world().resource::<ScenarioRun>();
        match run.phase() {
            RunPhase::Refused(fault) => panic!("{fault}"),
            RunPhase::Ended(end) => {
                assert_eq!(run.diverged_s(), None);
                return (end.clone(), run.log().expect("it is kept").clone());
            }
            _ => app.step(1),
        }
    }
    panic!("it never ended");
}

/// Repeats a run and finds it the same: every record of every step.
fn again(log: &RunLog) {
    let (_, repeated) = perform(ScenarioRun::replay(log.clone()), None);
    let pairs = log.entries.iter().zip(&repeated.entries);
    for (before, after) in pairs {
        assert_eq!(before, after, "at {:.2} s", log.time_s(before.step));
    }
    assert_eq!(log.entries.len(), repeated.entries.len());
}

/// One vessel to be sealed on the liver.
fn short_scenario() -> Scenario {
    let text = r#"(version: 1, name: "short", scene: Liver, tools: [(name: "electrode", tool: (kind: CauteryHook(())))],
        events: [(what: Bleed(organ: "liver", uv: (0.06, 0.34), wound: (rate_m3_per_s: 2.0e-8, clotting_time_s: 600.0)))],
        time_limit_s: 12.0,
        goals: [(id: "stop", kind: StopBleeding(below_ml_s: 0.0005, for_s: 2.0))])"#;
    Scenario::from_bytes(text.as_bytes(), "short").expect("it is good")
}

/// An expert's run of it.
fn short_run() -> RunLog {
    static RUN: OnceLock<RunLog> = OnceLock::new();
    RUN.get_or_init(|| perform(ScenarioRun::new(short_scenario()), Some(Skill::EXPERT)).1).clone()
}
