//! What is wrong with a scenario's file is told to who must mend it.

use bevy_surgery::scenario::{ReadyScenario, Scenario, ScenarioError};
use proptest::prelude::*;

const GOOD: &str = r#"(version: 1, name: "a", goals: [
    (id: "near", kind: Reach(structure: "dura", within_m: 0.002)),
    (id: "rest", kind: Remove(structure: "cortex", share: 0.5), after: ["near"]),
], rules: [(id: "cut", kind: Cut(structure: "dura", above_mm3: 1.0), penalty: 10.0)])"#;

fn told(text: &str) -> String {
    Scenario::from_bytes(text.as_bytes(), "a.scenario.ron").expect_err("it is wrong").to_string()
}

#[test]
fn faults_name_file_field_and_reason() {
    assert!(Scenario::from_bytes(GOOD.as_bytes(), "a").is_ok());
    for (from, to, message) in [
        ("share: 0.5", "share: 1.5", "a.scenario.ron: goal \"rest\": share: 1.5 is not above 0 and up to 1"),
        ("share: 0.5", "share: NaN", "a.scenario.ron: goal \"rest\": share: NaN is not above 0 and up to 1"),
        (
            "[\"near\"]",
            "[\"nearr\"]",
            "a.scenario.ron: goal \"rest\": after: no goal before it has the id \"nearr\": did you mean \"near\"?",
        ),
        ("id: \"rest\"", "id: \"near\"", "a.scenario.ron: goal \"near\": id: another goal has it, too"),
        ("penalty: 10.0", "penalty: -1.0", "a.scenario.ron: rule \"cut\": penalty: -1 is not from 0 to 100"),
        ("name: \"a\"", "name: \" \"", "a.scenario.ron: name: it is empty"),
        (
            "version: 1",
            "version: 7",
            "a.scenario.ron: field `version`: written as version 7, and this program reads up to 1: use a newer one",
        ),
    ] {
        assert!(GOOD.contains(from));
        assert_eq!(told(&GOOD.replacen(from, to, 1)), message);
    }
}

#[test]
fn faults_of_spelling_name_the_line() {
    let unknown = told(&GOOD.replace("share: 0.5", "shar: 0.5"));
    assert!(unknown.starts_with("a.scenario.ron: line 3, column ") && unknown.contains("`shar`"), "{unknown}");
    let kind = told(&GOOD.replace("Reach(", "Rech("));
    assert!(kind.contains("line 2") && kind.contains("Rech"), "{kind}");
    let cut_off = told(&GOOD[..60]);
    assert!(cut_off.starts_with("a.scenario.ron: line "), "{cut_off}");
    assert!(told("").contains("line 1"));
    let binary = Scenario::from_bytes(&[0xff, 0xfe, 0], "b").expect_err("no text").to_string();
    assert!(binary.starts_with("b: it is no UTF-8 text"), "{binary}");
    let missing = Scenario::read(std::path::Path::new("/nowhere/x.scenario.ron")).expect_err("not there");
    assert!(matches!(missing, ScenarioError::Io { .. }));
}

#[test]
fn deep_and_large_files_are_refused_and_not_followed() {
    let deep = format!("(version: 1, name: {}", "[".repeat(100_000));
    assert!(told(&deep).contains("line 1"));
    let large = vec![b' '; 5 << 20];
    assert!(Scenario::from_bytes(&large, "l").expect_err("large").to_string().contains("too many"));
}

proptest! {
    #[test]
    fn spoilt_files_never_panic(cut in 0..4000_usize, at in 0..4000_usize, byte in any::<u8>()) {
        let mut bytes = ReadyScenario::find("mastoidectomy").expect("it is there").text.as_bytes().to_vec();
        let place = at % bytes.len();
        bytes[place] = byte;
        bytes.truncate(bytes.len().saturating_sub(cut % 3000));
        let _ = Scenario::from_bytes(&bytes, "spoilt");
    }
}
