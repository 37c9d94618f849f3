//! A scenario performed and judged: by you, or by a hand that can (`--expert`) or cannot (`--novice`) do it.
//!
//! `--scenario` names a ready one or a file; without it there is a list. 1 to 9 choose the instrument that the mouse (or `--device`)
//! holds; the left button is the pedal, the right button the second one, the wheel brings it nearer and presses. B puts the next burr on,
//! G switches the guidance, Escape ends the run and, when it is over, the program.
//! `--record FILE` writes the run down, `--replay FILE` performs it again, and with `--retry-at SECONDS` it goes on from there with
//! your hand. When it is over, its report is written beside those of earlier runs (`out/training/run-1.html`, `.csv`, `.json`, or in
//! `--out`), and compared with them.

// Queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "training/hands.rs"]
mod hands;
#[path = "training/panel.rs"]
mod panel;
#[path = "training/view.rs"]
mod view;

use bevy::prelude::*;
use bevy_surgery::scenario::log::{LogError, LogRecord, RunLog};
use bevy_surgery::scenario::report::RunReport;
use bevy_surgery::scenario::scripted::{ScriptedHand, Skill};
use bevy_surgery::scenario::{READY_SCENARIOS, ReadyScenario, RunPhase, Scenario, ScenarioRun};
use common::{Args, Stage, StepsLeft, Viewer};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Steps of a run that has no limit, where nobody is there to end it.
const MOST_STEPS: u32 = 10 * 60 * 60;
/// Steps in which its scene is made, at most; nothing happens in them.
const MOST_WAITING: u32 = 6000;

fn main() -> ExitCode {
    common::main_with(
        "training",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.03, 0.035, 0.04)));
            let args = app.world().resource::<Args>().clone();
            match run(&args) {
                Ok(run) => {
                    let is_led = run.is_replaying();
                    let limit_s = run.scenario().time_limit_s;
                    let most = limit_s.map_or(MOST_STEPS, |limit_s| (limit_s * 60.0) as u32 + MOST_WAITING);
                    app.insert_resource(StepsLeft(args.frames.unwrap_or(most)));
                    let skill = match (args.expert, args.novice) {
                        (true, _) => Some(Skill::EXPERT),
                        (_, true) => Some(Skill::NOVICE),
                        // Where nobody is there somebody has to do it.
                        _ => (!is_led && app.world().resource::<Stage>().viewer == Viewer::Nobody)
                            .then_some(Skill::EXPERT),
                    };
                    if let Some(skill) = skill {
                        app.insert_resource(ScriptedHand::new(skill, run.seed()));
                    }
                    app.insert_resource(run.kept());
                }
                Err(reason) => {
                    eprintln!("{reason}");
                    std::process::exit(1);
                }
            }
            view::build(app);
            panel::build(app);
            hands::build(app);
            app.add_systems(FixedLast, finish);
        },
        count,
    )
}

/// What is to be performed.
fn run(args: &Args) -> Result<ScenarioRun, String> {
    let mut run = if let Some(file) = &args.replay {
        let log = RunLog::read(file).map_err(|error| error.to_string())?;
        match args.retry_at {
            Some(time_s) => ScenarioRun::retry_at(log, file, time_s).map_err(|error| error.to_string())?,
            None => ScenarioRun::replay(log),
        }
    } else {
        let (scenario, name) = scenario(args.scenario.as_deref())?;
        // The patient of the scenario, unless another one was asked for.
        let seed = if args.seed == 1 { scenario.patient.seed } else { args.seed };
        ScenarioRun::new(scenario).named(name).with_seed(seed)
    };
    if let Some(file) = &args.record {
        // Nobody wants to hear of it when the run is over.
        if file.exists() {
            return Err(LogError::Exists { file: file.display().to_string() }.to_string());
        }
        run = run.recorded_to(file);
    }
    Ok(run)
}

fn scenario(wanted: Option<&str>) -> Result<(Scenario, String), String> {
    let ready = || {
        let lines = READY_SCENARIOS.iter().filter_map(|ready| Some((ready.id, ready.scenario().ok()?)));
        lines.map(|(id, scenario)| format!("  {id:<18} {}\n", scenario.name)).collect::<String>()
    };
    let Some(wanted) = wanted else {
        return Err(format!("choose a scenario with --scenario:\n{}or a file that ends in .scenario.ron", ready()));
    };
    if let Some(found) = ReadyScenario::find(wanted) {
        return found.scenario().map(|scenario| (scenario, wanted.into())).map_err(|error| error.to_string());
    }
    if wanted.ends_with(".ron") {
        return Scenario::read(Path::new(wanted)).map(|it| (it, wanted.into())).map_err(|error| error.to_string());
    }
    Err(format!("--scenario {wanted}: there are\n{}and files that end in .scenario.ron", ready()))
}

/// Ends a headless run when the scenario is over; a window stays, with the score in it.
fn finish(run: Res<ScenarioRun>, args: Res<Args>, mut steps: ResMut<StepsLeft>, mut told: Local<bool>) {
    let words = match run.phase() {
        RunPhase::Ended(end) => {
            let passed = if end.is_passed { "passed" } else { "not passed" };
            format!("{:?} after {:.1} s: {:.0} of 100 points, {passed}", end.reason, run.time_s(), end.score)
        }
        RunPhase::Refused(_) => String::new(),
        RunPhase::Waiting => return std::thread::sleep(std::time::Duration::from_millis(1)),
        RunPhase::Running => return,
    };
    steps.0 = 0;
    if !*told && !words.is_empty() {
        println!("{words}");
        match run.log().map(|log| report(log, args.out.as_deref())) {
            Some(Ok(file)) => println!("{}", file.display()),
            Some(Err(reason)) => error!("{reason}"),
            None => {}
        }
        if let Some(second) = run.diverged_s() {
            println!("the replay is another run from second {second} on");
        }
    }
    *told = true;
}

/// Writes the report of a run beside those of earlier ones; gives the page.
fn report(log: &RunLog, folder: Option<&Path>) -> Result<PathBuf, String> {
    let folder = folder.unwrap_or(Path::new("out/training"));
    let fault = |file: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    std::fs::create_dir_all(folder).map_err(|error| fault(folder, &error))?;
    let named = |number: u32, ending: &str| folder.join(format!("run-{number}.{ending}"));
    let mut earlier = Vec::new();
    let number = loop {
        let number = earlier.len() as u32 + 1;
        let file = named(number, "json");
        let Ok(text) = std::fs::read_to_string(&file) else { break number };
        earlier.push(RunReport::from_json(&text).map_err(|error| fault(&file, &error))?);
    };
    let report = RunReport::of(log);
    let json = report.to_json().map_err(|error| error.to_string())?;
    let texts = [("json", json), ("csv", report.to_csv()), ("html", report.to_html(&earlier))];
    for (ending, text) in texts {
        let file = named(number, ending);
        std::fs::write(&file, text).map_err(|error| fault(&file, &error))?;
    }
    Ok(named(number, "html"))
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    let run = world.resource::<ScenarioRun>();
    let Some(log) = run.log() else { return counters };
    counters.insert("scenario".into(), json!(run.scenario().name));
    counters.insert("patient".into(), json!(run.seed()));
    counters.insert("time_s".into(), json!(run.time_s()));
    counters.insert("score".into(), json!(run.score()));
    counters.insert("end".into(), json!(run.end()));
    let events = log.entries.iter().filter_map(|entry| match &entry.record {
        LogRecord::Goal(_) | LogRecord::Violation(_) => Some(json!([log.time_s(entry.step), entry.record])),
        _ => None,
    });
    counters.insert("events".into(), events.collect());
    counters
}
