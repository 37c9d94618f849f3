//! CSV.

use super::*;
use bevy_surgery::scenario::report::RunReport;

/// A reader of RFC 4180 as plain as can be.
fn read(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut field, mut quoted) = (Vec::new(), Vec::new(), String::new(), false);
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if quoted && letters.peek() == Some(&'"') => field.extend(letters.next()),
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut field)),
            '\r' if !quoted => {}
            '\n' if !quoted => {
                row.push(std::mem::take(&mut field));
                rows.push(std::mem::take(&mut row));
            }
            letter => field.push(letter),
        }
    }
    assert!(!quoted && field.is_empty() && row.is_empty(), "the last row ends");
    rows
}

#[test]
fn the_table_holds_every_number() {
    let report = RunReport::of(&mastoid_run(0.6, 3, Vec::new()));
    let rows = read(&report.to_csv());
    assert_eq!(rows[0], ["section", "name", "part", "value", "unit"]);
    assert!(rows.iter().all(|row| row.len() == 5), "each row has five fields");
    let value = |section: &str, name: &str, part: &str| {
        let is = |row: &&Vec<String>| row[0] == section && row[1] == name && row[2] == part;
        rows.iter().find(is).unwrap_or_else(|| panic!("{section} {name} {part}"))[3].clone()
    };
    assert_eq!(value("run", "seed", ""), "7");
    assert_eq!(value("outcome", "score", ""), report.outcome.score.expect("a score").to_string());
    for metric in &report.metrics {
        assert_eq!(value("metric", &metric.name, ""), metric.value.expect("a value").to_string());
        for part in &metric.by {
            assert_eq!(value("metric", &metric.name, &part.name), part.value.to_string());
        }
    }
    let goals = rows.iter().filter(|row| row[0] == "goal").count();
    assert_eq!(goals, 3 * report.goals.len());
    assert_eq!(rows.iter().filter(|row| row[0] == "violation").count(), 5 * report.violations.len());
    assert!(report.to_csv().lines().all(|line| line.is_ascii()), "units that any spreadsheet reads");
}

#[test]
fn no_text_becomes_a_formula_or_a_row() {
    for name in ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", " =1", "\r\n=1", "＝1", "a\"b,c\r\nd"] {
        let mut run = mastoid_run(0.9, 3, Vec::new());
        run.header.trainee = Some(name.into());
        run.header.tools[0].name = name.into();
        let text = RunReport::of(&run).to_csv();
        let rows = read(&text);
        assert!(rows.iter().all(|row| row.len() == 5), "{name:?}");
        for field in rows.iter().flatten() {
            let is_number = field.parse::<f64>().is_ok();
            let first = field.trim_start().chars().next().unwrap_or(' ');
            assert!(is_number || !"=+-@＝".contains(first), "{name:?}: {field:?}");
        }
        // A text that looks like a number is still a text.
        assert!(!text.contains(",-1,\"\"\r\n") && !text.contains(",+1,"), "{name:?}");
    }
    let rows = read(&RunReport::of(&hostile_run()).to_csv());
    assert!(rows.iter().all(|row| row.len() == 5));
    let rows = read(&RunReport::of(&broken_run()).to_csv());
    assert!(rows.iter().flatten().all(|field| field != "NaN" && field != "inf" && field != "-inf"));
}
