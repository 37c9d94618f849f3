//! The scenarios that ship with the crate, performed well and badly.

use super::{again, perform};
use bevy_surgery::scenario::log::{EndReason, EndRecord, LogRecord, RunLog};
use bevy_surgery::scenario::scripted::Skill;
use bevy_surgery::scenario::{READY_SCENARIOS, ReadyScenario, Scenario, ScenarioRun};
use std::collections::BTreeMap;
use std::sync::OnceLock;

fn ready(id: &str) -> ScenarioRun {
    ScenarioRun::new(ReadyScenario::find(id).expect("it is there").scenario().expect("it is good"))
}

/// Goals and violations, for who looks into a failure.
fn tell(what: &str, end: &EndRecord, log: &RunLog) {
    println!("{what}: {end:?}");
    for entry in &log.entries {
        if let LogRecord::Goal(_) | LogRecord::Violation(_) = &entry.record {
            println!("  {:6.2} {:?}", log.time_s(entry.step), entry.record);
        }
    }
}

/// An expert's run of a ready scenario: performed once, for all tests that look at it.
pub fn expert_run(id: &str) -> (EndRecord, RunLog) {
    static RUNS: OnceLock<BTreeMap<&'static str, OnceLock<(EndRecord, RunLog)>>> = OnceLock::new();
    let runs = RUNS.get_or_init(|| READY_SCENARIOS.map(|ready| (ready.id, OnceLock::new())).into());
    runs[id].get_or_init(|| perform(ready(id), Some(Skill::EXPERT))).clone()
}

/// An expert and a novice score far apart, and the expert's run can be repeated to the bit.
fn tells_apart(id: &str) -> [EndRecord; 2] {
    let [(expert, log), (novice, badly)] = [expert_run(id), perform(ready(id), Some(Skill::NOVICE))];
    tell("expert", &expert, &log);
    tell("novice", &novice, &badly);
    assert!(expert.is_passed && !novice.is_passed);
    assert!(expert.score >= 80.0 && novice.score <= expert.score - 40.0);
    again(&log);
    [expert, novice]
}

#[test]
fn bleeding_control_tells_an_expert_from_a_novice() {
    let [expert, novice] = tells_apart("bleeding-control");
    assert_eq!((expert.reason, novice.reason), (EndReason::Done, EndReason::OutOfTime));
}

#[test]
fn mastoidectomy_tells_an_expert_from_a_novice() {
    tells_apart("mastoidectomy");
}

#[test]
fn lesions_tell_an_expert_from_a_novice() {
    let [expert, _] = tells_apart("lesions");
    assert_eq!(expert.reason, EndReason::Done);
}

#[test]
fn patients_differ_by_seed_and_not_otherwise() {
    for ready in READY_SCENARIOS {
        let scenario = ready.scenario().expect("it is good");
        let [one, same, other] = [3, 3, 4].map(|seed| scenario.for_patient(seed));
        assert_eq!(one, same);
        assert!(one != other && one.check("it").is_ok());
        let mut alike = scenario.clone();
        alike.patient.amount = 0.0;
        assert_eq!(alike.for_patient(3).goals, alike.goals);
        assert_eq!(alike.for_patient(3).events, alike.events);
    }
}

#[test]
fn what_is_written_is_read_again() {
    for ready in READY_SCENARIOS {
        let scenario = ready.scenario().expect("it is good");
        let again = Scenario::from_bytes(scenario.to_text().as_bytes(), "written").expect("it can be read");
        assert_eq!(again, scenario);
    }
}
