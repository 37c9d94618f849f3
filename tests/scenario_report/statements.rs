//! Statements of the Experience API, field by field as xAPI-Data.md (1.0.3) has them.

use super::*;
use bevy_surgery::scenario::report::RunReport;
use bevy_surgery::scenario::report::xapi::{Agent, Statement, XapiContext, to_json_lines};
use serde_json::{Value, json};

const REGISTRATION: &str = "6ba7b810-9dad-41d1-80b4-00c04fd430c8";

fn context() -> XapiContext {
    XapiContext {
        registration: REGISTRATION.into(),
        activity_iri: "https://example.org/training/mastoid".into(),
        timestamp: "2026-11-23T08:10:00.5+01:00".into(),
        language: "en".into(),
        instructor: Some(Agent::with_mail(Some("B. Trainer".into()), "b@example.org")),
        platform: Some("theatre 2".into()),
    }
}

fn actor() -> Agent {
    Agent::with_account(None, "https://example.org", "4711")
}

fn statements(run: &RunLog) -> Vec<Value> {
    let statements = RunReport::of(run).xapi_statements(&actor(), &context()).expect("statements");
    let lines = to_json_lines(&statements).expect("JSON");
    assert_eq!(lines.lines().count(), statements.len());
    let read: Vec<Statement> = lines.lines().map(|line| serde_json::from_str(line).expect("a statement")).collect();
    assert_eq!(read, statements);
    lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("an object").keys().map(String::as_str).collect()
}

fn is_iri(text: &str) -> bool {
    text.contains(':') && !text.contains(|c: char| c.is_whitespace() || "<>\"{}|\\^`".contains(c))
}

/// What the specification demands of every statement here.
fn conforms(statement: &Value) {
    let allowed = ["actor", "context", "id", "object", "result", "timestamp", "verb", "version"];
    assert!(keys(statement).iter().all(|key| allowed.contains(key)), "{:?}", keys(statement));
    let id = statement["id"].as_str().expect("an id");
    assert_eq!((id.len(), &id[14..15]), (36, "4"), "a UUID of version 4: {id}");
    assert!("89ab".contains(&id[19..20]), "of the RFC's variant: {id}");
    assert_eq!(statement["version"], "1.0.3");
    assert!(is_iri(statement["verb"]["id"].as_str().expect("a verb")));
    assert!(statement["verb"]["display"]["en"].is_string());
    let object = &statement["object"];
    assert_eq!(object["objectType"], "Activity");
    assert!(is_iri(object["id"].as_str().expect("an activity")));
    let definition = ["correctResponsesPattern", "description", "interactionType", "name", "steps", "type"];
    assert!(keys(&object["definition"]).iter().all(|key| definition.contains(key)));
    assert!(is_iri(object["definition"]["type"].as_str().expect("a type")));
    let result = ["completion", "duration", "extensions", "response", "score", "success"];
    assert!(keys(&statement["result"]).iter().all(|key| result.contains(key)));
    for (key, value) in statement["result"]["extensions"].as_object().into_iter().flatten() {
        assert!(is_iri(key) && !value.is_null(), "{key}");
    }
    let context = ["contextActivities", "extensions", "instructor", "language", "platform", "registration"];
    assert!(keys(&statement["context"]).iter().all(|key| context.contains(key)));
    assert_eq!(statement["context"]["registration"], REGISTRATION);
    assert!(!has_null(statement), "no property is null: {statement}");
}

/// Extensions may hold null, nothing else may.
fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Object(map) => map.iter().any(|(key, value)| key != "extensions" && has_null(value)),
        Value::Array(list) => list.iter().any(has_null),
        _ => false,
    }
}

#[test]
fn a_passed_run_field_by_field() {
    let mut run = empty_run(100.0, vec![remove_cells()], Vec::new(), Vec::new());
    let goal = GoalRecord { goal: "cells".into(), progress: 1.0, is_reached: true };
    push(&mut run, 1234, LogRecord::Goal(goal));
    push(&mut run, 30_050, LogRecord::End(EndRecord { reason: EndReason::Done, score: 81.5, is_passed: true }));
    let statements = statements(&run);
    statements.iter().for_each(conforms);
    let [procedure, goal] = &statements[..] else { panic!("two statements") };
    assert_eq!(
        procedure["actor"],
        json!({ "objectType": "Agent", "account": { "homePage": "https://example.org", "name": "4711" } })
    );
    assert_eq!(
        procedure["verb"],
        json!({ "id": "http://adlnet.gov/expapi/verbs/passed", "display": { "en": "passed" } })
    );
    assert_eq!(procedure["timestamp"], "2026-11-23T08:10:00.5+01:00");
    assert_eq!(
        procedure["object"],
        json!({
            "objectType": "Activity",
            "id": "https://example.org/training/mastoid",
            "definition": {
                "name": { "en": "Cortical mastoidectomy" },
                "description": { "en": "Open the antrum. Spare the nerve." },
                "type": "http://adlnet.gov/expapi/activities/cmi.interaction",
                "interactionType": "performance",
                "correctResponsesPattern": ["cells[.]1"],
                "steps": [{ "id": "cells", "description": { "en": "Remove the mastoid cells" } }],
            },
        })
    );
    let result = &procedure["result"];
    assert_eq!(result["score"], json!({ "scaled": 0.815, "raw": 81.5, "min": 0.0, "max": 100.0 }));
    assert_eq!((&result["success"], &result["completion"]), (&json!(true), &json!(true)));
    assert_eq!((&result["response"], &result["duration"]), (&json!("cells[.]1"), &json!("PT300.5S")));
    let metrics = &result["extensions"]["https://example.org/training/mastoid/metrics"];
    assert_eq!(metrics["time"], json!({ "value": 300.5, "unit": "s", "score": null }));
    assert_eq!(result["extensions"]["https://example.org/training/mastoid/violations"], json!({}));
    let context = &procedure["context"];
    assert_eq!(context["instructor"]["mbox"], "mailto:b@example.org");
    assert_eq!((&context["platform"], &context["language"]), (&json!("theatre 2"), &json!("en")));
    assert_eq!(context["extensions"]["https://example.org/training/mastoid/seed"], 7);
    assert!(context.get("contextActivities").is_none());
    assert_eq!(goal["verb"]["id"], "http://adlnet.gov/expapi/verbs/completed");
    assert_eq!(goal["object"]["id"], "https://example.org/training/mastoid/goal/cells");
    assert_eq!(goal["object"]["definition"]["type"], "http://adlnet.gov/expapi/activities/objective");
    assert_eq!(
        goal["result"],
        json!({
            "success": true, "completion": true, "duration": "PT12.34S",
            "extensions": { "https://example.org/training/mastoid/progress": 1.0 },
        })
    );
    let parent = json!([{ "objectType": "Activity", "id": "https://example.org/training/mastoid" }]);
    assert_eq!(goal["context"]["contextActivities"], json!({ "parent": parent }));
}

#[test]
fn a_failed_run_and_one_without_an_end() {
    let failed = statements(&mastoid_run(0.1, 5, Vec::new()));
    failed.iter().for_each(conforms);
    assert_eq!(failed[0]["verb"]["id"], "http://adlnet.gov/expapi/verbs/failed");
    assert_eq!((&failed[0]["result"]["success"], &failed[0]["result"]["completion"]), (&json!(false), &json!(false)));
    let response = failed[0]["result"]["response"].as_str().expect("a response");
    assert!(response.contains("[,]nerve[.]0[,]"), "{response}");
    let mut nearly = RunReport::of(&mastoid_run(0.1, 5, Vec::new()));
    (nearly.goals[0].progress, nearly.goals[0].is_reached) = (0.9999, false);
    let nearly = nearly.xapi_statements(&actor(), &context()).expect("statements").remove(0).result;
    let response = nearly.and_then(|result| result.response).expect("a response");
    assert!(response.starts_with("cells[.]0.999[,]"), "nearly reached is not reached: {response}");
    let nerve =
        failed.iter().find(|statement| statement["object"]["id"].as_str().is_some_and(|id| id.ends_with("/nerve")));
    assert_eq!(nerve.expect("a goal")["verb"]["id"], "http://adlnet.gov/expapi/verbs/attempted");
    let mut run = mastoid_run(0.1, 5, Vec::new());
    run.entries.retain(|entry| !matches!(entry.record, LogRecord::End(_)));
    let open = statements(&run);
    assert_eq!(open[0]["verb"]["id"], "http://adlnet.gov/expapi/verbs/attempted");
    assert!(open[0]["result"].get("score").is_none() && open[0]["result"].get("success").is_none());
}

#[test]
fn ids_are_the_same_for_the_same_and_differ_else() {
    let report = RunReport::of(&mastoid_run(0.9, 5, Vec::new()));
    let ids = |registration: &str| {
        let context = XapiContext { registration: registration.into(), ..context() };
        let statements = report.xapi_statements(&actor(), &context).expect("statements");
        statements.into_iter().map(|statement| statement.id).collect::<Vec<_>>()
    };
    let mut all = ids(REGISTRATION);
    assert_eq!((all.len(), &all), (1 + report.goals.len(), &ids(&REGISTRATION.to_uppercase())));
    all.extend(ids("00000000-9dad-41d1-80b4-00c04fd430c8"));
    let count = all.len();
    all.sort();
    all.dedup();
    assert_eq!(all.len(), count);
}

#[test]
fn hostile_and_broken_runs_make_proper_statements() {
    for run in [hostile_run(), broken_run(), empty_run(f64::NAN, Vec::new(), Vec::new(), Vec::new())] {
        let statements = statements(&run);
        statements.iter().for_each(conforms);
        let definition = &statements[0]["object"]["definition"];
        let steps: Vec<&str> =
            definition["steps"].as_array().into_iter().flatten().filter_map(|step| step["id"].as_str()).collect();
        let mut unique = steps.clone();
        unique.sort_unstable();
        unique.dedup();
        assert_eq!((unique.len(), steps.len()), (steps.len(), run.header.scenario.goals.len()));
        assert!(
            steps
                .iter()
                .all(|id| !id.is_empty() && id.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-'))
        );
    }
}

#[test]
fn what_a_store_would_refuse_is_told_by_field() {
    let report = RunReport::of(&mastoid_run(0.9, 5, Vec::new()));
    let good = context();
    let wrong = |field: &str, actor: &Agent, context: XapiContext| {
        let error = report.xapi_statements(actor, &context).expect_err(field).to_string();
        assert!(error.contains(field), "{field}: {error}");
    };
    for registration in ["", "4711", "6ba7b8109dad-41d1-80b4-00c04fd430c8-", "6ba7b810-9dad-41d1-80b4-00c04fd430cg"] {
        wrong("registration", &actor(), XapiContext { registration: registration.into(), ..good.clone() });
    }
    for activity_iri in ["", "mastoid", "https:", "1:2", "https://example.org/a b", "https://e.org/<x>"] {
        wrong("activity_iri", &actor(), XapiContext { activity_iri: activity_iri.into(), ..good.clone() });
    }
    for timestamp in [
        "",
        "yesterday",
        "2026-11-23",
        "2026-11-23T08:10:00",
        "2026-13-23T08:10:00Z",
        "2026-11-23T24:10:00Z",
        "2026-11-23T08:10:00.Z",
        "2026-11-23T08:10:00-00:00",
        "2026-11-23T08:10:00+1:00",
        "２026-11-23T08:10:00Z",
    ] {
        wrong("timestamp", &actor(), XapiContext { timestamp: timestamp.into(), ..good.clone() });
    }
    for language in ["", "-", "de CH", "französisch"] {
        wrong("language", &actor(), XapiContext { language: language.into(), ..good.clone() });
    }
    let nobody = Agent { account: None, ..actor() };
    let both = Agent { mbox: Some("mailto:a@b.c".into()), ..actor() };
    let nameless = Agent::with_account(None, "https://example.org", "");
    let homeless = Agent::with_account(None, "example", "4711");
    for agent in [&nobody, &both, &nameless, &homeless, &Agent::with_mail(None, "a b@c"), &Agent::with_mail(None, "@c")]
    {
        wrong("actor", agent, good.clone());
        wrong("instructor", &actor(), XapiContext { instructor: Some(agent.clone()), ..good.clone() });
    }
}
