//! Goals, rules and scores, from plain facts.

use bevy_surgery::scenario::judge::{Facts, Judge, LesionFacts, RemovalFacts, StructureFacts, ToolFacts};
use bevy_surgery::scenario::log::{EndReason, LogRecord};
use bevy_surgery::scenario::{Scenario, Severity};

const DT_S: f32 = 1.0 / 60.0;

fn scenario(goals: &str, rules: &str) -> Scenario {
    let text = format!("(version: 1, name: \"a\", goals: [{goals}], rules: [{rules}])");
    Scenario::from_bytes(text.as_bytes(), "a").expect("it is good")
}

const NEVER: &str = r#"(id: "never", kind: Remove(structure: "other", share: 1.0), weight: 0.0),"#;

/// Facts of a scenario with one structure of interest and one tool.
fn facts(change: impl FnOnce(&mut Facts)) -> Facts {
    let structure = StructureFacts { is_touched: vec![false], distance_m: vec![None], ..Default::default() };
    let mut facts = Facts {
        dt_s: DT_S,
        tools: vec![ToolFacts::default()],
        structures: vec![structure.clone(), structure],
        ..Default::default()
    };
    change(&mut facts);
    facts
}

fn violations(told: &[LogRecord]) -> Vec<(String, f32)> {
    let of = |record: &LogRecord| match record {
        LogRecord::Violation(violation) => Some((violation.rule.clone(), violation.penalty)),
        _ => None,
    };
    told.iter().filter_map(of).collect()
}

#[test]
fn shares_of_goals_make_the_score() {
    let scenario = scenario(
        r#"(id: "one", kind: Remove(structure: "a", share: 0.5), weight: 3.0),
           (id: "two", kind: Expose(structure: "b", share: 0.2, cover_m: 0.001), weight: 1.0)"#,
        "",
    );
    let mut judge = Judge::new(&scenario);
    let (_, end) = judge.step(&scenario, &facts(|facts| facts.structures[0].removed_share = 0.25));
    assert_eq!(end, None);
    assert!((judge.score(&scenario) - 37.5).abs() < 1e-3, "{}", judge.score(&scenario));
    // What was reached is kept, whatever comes.
    judge.step(&scenario, &facts(|facts| facts.structures[0].removed_share = 0.6));
    judge.step(&scenario, &facts(|_| {}));
    assert!((judge.score(&scenario) - 75.0).abs() < 1e-3);
    let (_, end) = judge.step(&scenario, &facts(|facts| facts.structures[1].exposed_share = Some(0.2)));
    assert_eq!((end, judge.score(&scenario)), (Some(EndReason::Done), 100.0));
    assert!(judge.is_passed(&scenario));
}

#[test]
fn goals_wait_for_those_before_them() {
    let scenario = scenario(
        r#"(id: "first", kind: Reach(structure: "a", within_m: 0.001)),
           (id: "then", kind: Reach(structure: "b", within_m: 0.001), after: ["first"])"#,
        "",
    );
    let mut judge = Judge::new(&scenario);
    let near_b = facts(|facts| facts.structures[1].distance_m[0] = Some(0.0005));
    judge.step(&scenario, &near_b);
    assert!(!judge.is_open(&scenario, 1) && !judge.goals()[1].is_reached);
    judge.step(&scenario, &facts(|facts| facts.structures[0].is_touched[0] = true));
    let (_, end) = judge.step(&scenario, &near_b);
    assert_eq!(end, Some(EndReason::Done));
}

#[test]
fn bleeding_must_stay_stopped() {
    let scenario = scenario(r#"(id: "stop", kind: StopBleeding(below_ml_s: 0.01, for_s: 0.5))"#, "");
    let mut judge = Judge::new(&scenario);
    let (still, bleeds) = (facts(|_| {}), facts(|facts| facts.bleeding_ml_s = 0.02));
    judge.step(&scenario, &bleeds);
    for step in 1..=30 {
        let (_, end) = judge.step(&scenario, &still);
        assert_eq!(end.is_some(), step == 30, "half a second is thirty steps");
    }
    judge.step(&scenario, &bleeds);
    assert!(!judge.goals()[0].is_reached, "it bleeds again");
}

#[test]
fn lesions_are_held_each_for_itself() {
    let lesions = r#"[(uv: (0.1, 0.5), radius_m: 0.004), (uv: (0.2, 0.5), radius_m: 0.004)]"#;
    let goals = format!(r#"(id: "mark", kind: Mark(organ: "liver", for_s: 0.1, lesions: {lesions}))"#);
    let scenario = scenario(&goals, "");
    let mut judge = Judge::new(&scenario);
    let on = |which: usize| {
        facts(|facts| {
            let is_touched = vec![which == 0, which == 1];
            facts.lesions = vec![LesionFacts { is_touched, coagulated: vec![0.0; 2], outside_mm2: 0.0 }];
        })
    };
    for _ in 0..20 {
        judge.step(&scenario, &on(0));
    }
    assert!((judge.goals()[0].progress - 0.5).abs() < 1e-6);
    for _ in 0..6 {
        judge.step(&scenario, &on(1));
    }
    assert!(judge.goals()[0].is_reached);
}

#[test]
fn a_view_is_kept_for_a_share_of_the_time() {
    let goals = format!(r#"{NEVER} (id: "view", kind: KeepVisible(share: 0.5, of_time: 0.75))"#);
    let scenario = scenario(&goals, "");
    let mut judge = Judge::new(&scenario);
    for step in 0..8 {
        judge.step(&scenario, &facts(|facts| facts.hidden = Some(if step % 2 == 0 { 0.0 } else { 0.6 })));
    }
    assert!((judge.goals()[1].progress - 0.5 / 0.75).abs() < 1e-6 && !judge.goals()[1].is_reached);
    for _ in 0..8 {
        judge.step(&scenario, &facts(|facts| facts.hidden = Some(0.1)));
    }
    assert!(judge.goals()[1].is_reached, "12 of 16 steps");
}

#[test]
fn what_lasts_is_one_violation_and_costs_no_more_than_the_most() {
    let rules = r#"(id: "touch", kind: Touch(structure: "a"), penalty: 4.0, most: 10.0)"#;
    let goals = r#"(id: "never", kind: Remove(structure: "a", share: 1.0)), (id: "all", kind: Reach(structure: "b", within_m: 0.1))"#;
    let scenario = scenario(goals, rules);
    let mut judge = Judge::new(&scenario);
    let on = facts(|facts| {
        facts.structures[0].is_touched[0] = true;
        facts.structures[1].is_touched[0] = true;
    });
    let off = facts(|_| {});
    let mut costs = Vec::new();
    for _ in 0..4 {
        // On for a while with a short gap in it, then off for half a second.
        for now in [&on, &on, &off, &on] {
            costs.extend(violations(&judge.step(&scenario, now).0));
        }
        for _ in 0..30 {
            judge.step(&scenario, &off);
        }
    }
    assert_eq!(costs.iter().map(|(_, cost)| *cost).collect::<Vec<_>>(), [4.0, 4.0, 2.0, 0.0]);
    assert_eq!(judge.rules()[0].count, 4);
    assert!((judge.score(&scenario) - 40.0).abs() < 1e-3, "half of the goals less ten points");
}

#[test]
fn what_adds_up_counts_each_time_as_much_again() {
    let rules = r#"(id: "blood", kind: BloodLoss(above_ml: 2.0), penalty: 5.0),
                   (id: "unseen", kind: DrilledUnseen(above_mm3: 1.0), penalty: 1.0)"#;
    let scenario = scenario(NEVER.replace("weight: 0.0", "weight: 1.0").as_str(), rules);
    let mut judge = Judge::new(&scenario);
    let mut told = Vec::new();
    for lost_ml in [1.0, 2.0, 2.1, 3.9, 4.1, 9.0] {
        let now = facts(|facts| {
            facts.lost_ml = lost_ml;
            let unseen = |mm3, seen| RemovalFacts { mm3, seen: Some(seen), ..Default::default() };
            facts.removals = vec![unseen(0.5, 0.0), unseen(7.0, 1.0)];
        });
        told.extend(violations(&judge.step(&scenario, &now).0));
    }
    let blood: Vec<f32> = told.iter().filter(|(rule, _)| rule == "blood").map(|(_, cost)| *cost).collect();
    assert_eq!(blood, [5.0, 5.0, 10.0], "at 2, 4, and 6 and 8 at once");
    let unseen = told.iter().filter(|(rule, _)| rule == "unseen").count();
    assert_eq!(unseen, 2, "3 mm3 in all: above 1, and above 2");
}

#[test]
fn force_speed_and_size_count_near_a_structure_only() {
    let rules = r#"(id: "force", kind: Force(structure: "a", within_m: 0.002, above_n: 2.0), penalty: 1.0),
        (id: "speed", kind: Speed(structure: "a", within_m: 0.002, above_m_per_s: 0.05), penalty: 1.0),
        (id: "size", kind: BurrTooLarge(structure: "a", within_m: 0.002, above_m: 0.004), penalty: 1.0),
        (id: "near", kind: Near(structure: "a", within_m: 0.001), penalty: 1.0)"#;
    let goals = r#"(id: "never", kind: Remove(structure: "a", share: 1.0))"#;
    let scenario = scenario(goals, rules);
    let at = |distance_m: Option<f32>, force_n: f32, speed_m_per_s: f32, burr_m: Option<f32>| {
        facts(|facts| {
            facts.tools[0].force_n = force_n;
            facts.tools[0].speed_m_per_s = speed_m_per_s;
            facts.tools[0].turning_burr_m = burr_m;
            facts.structures[0].distance_m[0] = distance_m;
        })
    };
    let broken = |now: &Facts| {
        let (told, _) = Judge::new(&scenario).step(&scenario, now);
        violations(&told).into_iter().map(|(rule, _)| rule).collect::<Vec<_>>()
    };
    assert!(broken(&at(None, 9.0, 1.0, Some(6e-3))).is_empty());
    assert!(broken(&at(Some(0.0021), 9.0, 1.0, Some(6e-3))).is_empty());
    assert_eq!(broken(&at(Some(0.0019), 9.0, 1.0, Some(6e-3))), ["force", "speed", "size"]);
    assert_eq!(broken(&at(Some(0.0009), 1.0, 0.01, Some(3e-3))), ["near"]);
    assert!(broken(&at(Some(0.0009), 1.0, 0.01, None)).is_empty(), "a burr that does not turn does no harm");
}

#[test]
fn a_failure_is_not_passed_and_time_runs_out() {
    let rules = r#"(id: "cut", kind: Cut(structure: "a", above_mm3: 1.0), severity: Failure),
                   (id: "late", kind: OutOfTime, penalty: 20.0)"#;
    let mut scenario = scenario(r#"(id: "one", kind: Remove(structure: "a", share: 0.5))"#, rules);
    scenario.time_limit_s = Some(1.0);
    assert_eq!(scenario.rules[0].severity, Severity::Failure);
    let mut judge = Judge::new(&scenario);
    let cut = facts(|facts| {
        facts.structures[0].removed_share = 0.5;
        facts.structures[0].removed_mm3 = 1.2;
    });
    let (told, end) = judge.step(&scenario, &cut);
    assert_eq!((violations(&told).len(), end), (1, Some(EndReason::Done)));
    assert!(judge.score(&scenario) == 100.0 && !judge.is_passed(&scenario));
    // Another run, in which nothing is done: sixty steps are the second that there is.
    let mut judge = Judge::new(&scenario);
    for step in 1..=60 {
        let (_, end) = judge.step(&scenario, &facts(|facts| facts.structures[0].removed_share = 0.4));
        assert_eq!(end.is_some(), step == 60);
    }
    let told = judge.end(&scenario, EndReason::OutOfTime);
    assert_eq!(violations(&told), [("late".to_string(), 20.0)]);
    let Some(LogRecord::End(end)) = told.last() else { panic!("the end is told last") };
    assert!((end.score - 60.0).abs() < 1e-3 && !end.is_passed, "{end:?}");
}
