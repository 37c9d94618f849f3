//! A report as a long table for spreadsheets and statistics: one number a row.

use super::RunReport;
use std::fmt::Display;

impl RunReport {
    /// The report as CSV (RFC 4180) with the columns `section,name,part,value,unit`; `part` is the instrument or structure. The
    /// series of plots are not in it.
    ///
    /// Texts are always quoted, and one that a spreadsheet could take for a formula begins with an apostrophe.
    pub fn to_csv(&self) -> String {
        let mut table = Table { text: "section,name,part,value,unit\r\n".to_string() };
        self.outcome_rows(&mut table);
        for goal in &self.goals {
            table.number("goal", &goal.title, "progress", Some(goal.progress), "1");
            table.number("goal", &goal.title, "reached", goal.reached_s, "s");
            table.number("goal", &goal.title, "weight", Some(goal.weight), "1");
        }
        for (index, violation) in self.violations.iter().enumerate() {
            let name = format!("{} {}", index + 1, violation.rule);
            table.number("violation", &name, "time", Some(violation.time_s), "s");
            table.number("violation", &name, "value", violation.value, &violation.unit);
            table.number("violation", &name, "penalty", Some(violation.penalty), "1");
            table.text("violation", &name, "severity", &format!("{:?}", violation.severity));
            table.text("violation", &name, "tool", violation.tool.as_deref().unwrap_or_default());
        }
        for structure in &self.structures {
            table.number("structure", &structure.name, "before", structure.before_mm3, "mm³");
            table.number("structure", &structure.name, "removed", Some(structure.removed_mm3), "mm³");
        }
        for metric in &self.metrics {
            table.number("metric", &metric.name, "", metric.value, &metric.unit);
            for part in &metric.by {
                table.number("metric", &metric.name, &part.name, Some(part.value), &metric.unit);
            }
            if metric.score.is_some() {
                table.number("metric score", &metric.name, "", metric.score, "1");
            }
        }
        table.text
    }

    fn outcome_rows(&self, table: &mut Table) {
        let outcome = &self.outcome;
        table.number("report", "version", "", Some(self.version), "1");
        table.text("report", "crate version", "", &self.crate_version);
        table.text("run", "scenario", "", &self.scenario);
        table.text("run", "trainee", "", self.trainee.as_deref().unwrap_or_default());
        table.text("run", "began", "", self.began.as_deref().unwrap_or_default());
        table.number("run", "seed", "", Some(self.seed), "1");
        table.text("outcome", "reason", "", &outcome.reason.map(|reason| format!("{reason:?}")).unwrap_or_default());
        table.number("outcome", "score", "", outcome.score, "1");
        table.number("outcome", "pass score", "", Some(outcome.pass_score), "1");
        table.number("outcome", "passed", "", outcome.is_passed.map(u8::from), "1");
        table.number("outcome", "complete", "", Some(u8::from(outcome.is_complete)), "1");
        table.number("outcome", "time", "", outcome.time_s, "s");
        table.number("outcome", "metrics score", "", self.metrics_score, "1");
    }
}

struct Table {
    text: String,
}

impl Table {
    fn number(&mut self, section: &str, name: &str, part: &str, value: Option<impl Display>, unit: &str) {
        // In letters that spreadsheets read in any encoding.
        let unit = unit.replace('³', "3").replace('²', "2").replace('·', " ");
        let value = value.map(|value| value.to_string()).unwrap_or_default();
        self.text += &[quoted(section), quoted(name), quoted(part), value, quoted(&unit)].join(",");
        self.text += "\r\n";
    }

    fn text(&mut self, section: &str, name: &str, part: &str, value: &str) {
        self.text += &[quoted(section), quoted(name), quoted(part), quoted(value), quoted("")].join(",");
        self.text += "\r\n";
    }
}

/// A text in quotes that no spreadsheet runs, on one line.
fn quoted(text: &str) -> String {
    let line: String = text.chars().map(|letter| if letter.is_control() { ' ' } else { letter }).collect();
    // Spreadsheets of East Asia read the wide ones as well.
    let is_formula = line.trim_start().starts_with(['=', '+', '-', '@', '＝', '＋', '－', '＠']);
    let apostrophe = if is_formula { "'" } else { "" };
    format!("\"{apostrophe}{}\"", line.replace('"', "\"\""))
}
