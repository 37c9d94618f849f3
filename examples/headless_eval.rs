//! Many runs of a scenario, side by side and without a picture, in one table: recorded ones that are performed again, or a scripted
//! hand with other patients each time.
//!
//! ```sh
//! cargo run --example headless_eval -- --scenario mastoidectomy --runs 100 --jobs 4 --skill novice --csv novices.csv
//! cargo run --example headless_eval -- --replay runs/*.mcap --csv again.csv
//! ```
//!
//! Each run has a process of its own: one that crashes is a row that says so, and the others go on.

use bevy::prelude::*;
use bevy_surgery::scenario::log::RunLog;
use bevy_surgery::scenario::metrics::{MetricKind, measure};
use bevy_surgery::scenario::scripted::{ScriptedHand, Skill};
use bevy_surgery::scenario::{READY_SCENARIOS, ReadyScenario, RunPhase, Scenario, ScenarioRun};
use bevy_surgery::testing::TestApp;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How well the scripted hand does it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
enum Who {
    Expert,
    Novice,
}

/// Performs a scenario many times without a picture, and writes one row for each run.
#[derive(clap::Parser, Clone, Debug)]
struct Args {
    /// bleeding-control, mastoidectomy, lesions, or a file that ends in .scenario.ron.
    #[arg(long, value_name = "X", default_value = "bleeding-control")]
    scenario: String,
    /// How many runs; each is another patient.
    #[arg(long, value_name = "N", default_value_t = 10)]
    runs: u64,
    /// How many at a time; as many as there are processors unless told.
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// How well it is done.
    #[arg(long, value_enum, default_value = "expert")]
    skill: Who,
    /// The first patient.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Recorded runs to be performed again instead.
    #[arg(long, value_name = "FILE", num_args = 1..)]
    replay: Vec<PathBuf>,
    /// The table.
    #[arg(long, value_name = "FILE", default_value = "runs.csv")]
    csv: PathBuf,
    /// One run, in this process: for the processes that this program starts.
    #[arg(long, hide = true)]
    one: Option<usize>,
}

/// What came of a run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Row {
    /// Whether it came to its end.
    is_done: bool,
    reason: String,
    score: f32,
    is_passed: bool,
    violations: usize,
    /// Of a replay: the first second that was another.
    diverged_s: Option<u64>,
    /// By key.
    metrics: BTreeMap<String, f64>,
    /// Why it came to none.
    fault: String,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let done = match args.one {
        Some(number) => one(&args, number).map(|row| {
            println!("{}", serde_json::to_string(&row).unwrap_or_default());
        }),
        None => all(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}

fn scenario(wanted: &str) -> Result<Scenario, String> {
    if let Some(ready) = ReadyScenario::find(wanted) {
        return ready.scenario().map_err(|error| error.to_string());
    }
    if wanted.ends_with(".ron") {
        return Scenario::read(Path::new(wanted)).map_err(|error| error.to_string());
    }
    let ready: Vec<&str> = READY_SCENARIOS.iter().map(|ready| ready.id).collect();
    Err(format!("--scenario {wanted}: there are {}, and files that end in .scenario.ron", ready.join(", ")))
}

/// One run, to its end.
fn one(args: &Args, number: usize) -> Result<Row, String> {
    let mut app = TestApp::cpu();
    let run = match args.replay.get(number) {
        Some(file) => ScenarioRun::replay(RunLog::read(file).map_err(|error| error.to_string())?),
        None => {
            let seed = args.seed + number as u64;
            let skill = if args.skill == Who::Expert { Skill::EXPERT } else { Skill::NOVICE };
            app.insert_resource(ScriptedHand::new(skill, seed));
            ScenarioRun::new(scenario(&args.scenario)?).with_seed(seed)
        }
    };
    app.insert_resource(run.kept());
    let log = loop {
        app.step(1);
        let run = app.world().resource::<ScenarioRun>();
        match run.phase() {
            RunPhase::Refused(fault) => return Err(fault.to_string()),
            RunPhase::Ended(_) => break run.log().cloned(),
            // Organs and volumes are made off the main thread.
            RunPhase::Waiting => std::thread::sleep(std::time::Duration::from_millis(1)),
            _ => {}
        }
    };
    let run = app.world().resource::<ScenarioRun>();
    let end = run.end().ok_or("it has no end")?;
    let metrics = log.iter().flat_map(measure).filter_map(|metric| Some((metric.kind.key(), metric.value?)));
    Ok(Row {
        is_done: true,
        reason: format!("{:?}", end.reason),
        score: end.score,
        is_passed: end.is_passed,
        violations: run.rules().iter().map(|rule| rule.count as usize).sum(),
        diverged_s: run.diverged_s(),
        metrics: metrics.collect(),
        fault: String::new(),
    })
}

/// The same in a process of its own.
fn apart(number: usize) -> Row {
    let failed = |fault: String| Row { fault, ..Row::default() };
    let program = match std::env::current_exe() {
        Ok(program) => program,
        Err(error) => return failed(error.to_string()),
    };
    let child = Command::new(program)
        .args(std::env::args_os().skip(1))
        .args(["--one", &number.to_string()])
        .stdin(Stdio::null())
        .output();
    let output = match child {
        Ok(output) => output,
        Err(error) => return failed(error.to_string()),
    };
    let text = String::from_utf8_lossy(&output.stdout);
    let row = text.lines().last().and_then(|line| serde_json::from_str(line).ok());
    row.filter(|_| output.status.success()).unwrap_or_else(|| {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("it said nothing");
        failed(format!("{}: {last}", output.status))
    })
}

fn all(args: &Args) -> Result<(), String> {
    // Before anything is started.
    if args.replay.is_empty() {
        scenario(&args.scenario)?;
    }
    let count = if args.replay.is_empty() { args.runs as usize } else { args.replay.len() };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = args.jobs.unwrap_or(cores).clamp(1, count.max(1));
    let file = |error: csv::Error| format!("{}: {error}", args.csv.display());
    let mut table = csv::Writer::from_path(&args.csv).map_err(file)?;
    let bar = ProgressBar::new(count as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos} of {len} runs, {eta} left {msg}") {
        bar.set_style(style);
    }
    let (next, rows) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    let row = apart(number);
                    if let Ok(mut rows) = rows.lock() {
                        rows.insert(number, row);
                    }
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let rows = rows.into_inner().map_err(|error| error.to_string())?;
    let words = |kind: &MetricKind| match kind.unit() {
        "1" => kind.key(),
        unit => format!("{} [{unit}]", kind.key()),
    };
    let first =
        ["run", "seed or file", "hand", "done", "reason", "score", "passed", "violations", "diverged [s]", "fault"];
    let head = first.iter().map(ToString::to_string).chain(MetricKind::ALL.iter().map(words));
    table.write_record(head).map_err(file)?;
    for (number, row) in &rows {
        let (of, hand) = match args.replay.get(*number) {
            Some(file) => (file.display().to_string(), "recorded".into()),
            None => ((args.seed + *number as u64).to_string(), format!("{:?}", args.skill).to_lowercase()),
        };
        let numbers =
            MetricKind::ALL.iter().map(|kind| row.metrics.get(&kind.key()).map_or(String::new(), f64::to_string));
        let plain = [
            number.to_string(),
            of,
            hand,
            row.is_done.to_string(),
            row.reason.clone(),
            row.score.to_string(),
            row.is_passed.to_string(),
            row.violations.to_string(),
            row.diverged_s.map_or(String::new(), |second| second.to_string()),
            row.fault.clone(),
        ];
        table.write_record(plain.into_iter().chain(numbers)).map_err(file)?;
    }
    table.flush().map_err(|error| format!("{}: {error}", args.csv.display()))?;
    let done: Vec<&Row> = rows.values().filter(|row| row.is_done).collect();
    let mean = done.iter().map(|row| f64::from(row.score)).sum::<f64>() / done.len().max(1) as f64;
    let passed = done.iter().filter(|row| row.is_passed).count();
    println!(
        "{}: {} of {count} runs came to their end, {passed} were passed, mean score {mean:.1}",
        args.csv.display(),
        done.len()
    );
    if done.is_empty() && count > 0 {
        return Err(rows.values().map(|row| row.fault.clone()).next().unwrap_or_default());
    }
    Ok(())
}
