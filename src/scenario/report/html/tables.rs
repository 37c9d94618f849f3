//! What is told in words and tables.

use super::section;
use super::svg::{GOOD, Scale, Svg, WRONG};
use super::text::{clock, escape, metric, moment, number, percent, quantity, short};
use crate::scenario::Severity;
use crate::scenario::log::EndReason;
use crate::scenario::metrics::{MetricKind, MetricPart};
use crate::scenario::report::{RunReport, ViolationReport};
use std::collections::BTreeMap;

/// Violations that are told one by one.
const MOST_ROWS: usize = 40;

pub(super) fn head(report: &RunReport) -> String {
    let mut facts = Vec::new();
    facts.extend(report.trainee.as_ref().map(|name| format!("<b>{}</b>", escape(name))));
    facts.extend(report.began.as_ref().map(|began| escape(&began.replacen('T', " ", 1))));
    facts.push(format!("patient {}", report.seed));
    let branch = report.branch.as_ref();
    facts.extend(branch.map(|branch| format!("goes on from {} at step {}", escape(&branch.file), branch.step)));
    format!(
        "<header><p class=\"kicker\">Report of a training run</p><h1>{}</h1><p class=\"facts\">{}</p></header>\n",
        escape(&report.scenario),
        facts.join(" · ")
    )
}

pub(super) fn foot(report: &RunReport) -> String {
    format!(
        "<footer>bevy_surgery {} · report version {} · Training data, not a certificate of clinical competence.</footer>",
        escape(&report.crate_version),
        report.version
    )
}

pub(super) fn verdict(report: &RunReport) -> String {
    let outcome = &report.outcome;
    let (class, word) = match outcome.is_passed {
        Some(true) => ("pass", "✓ Passed"),
        Some(false) => ("fail", "✗ Not passed"),
        None => ("none", "Not finished"),
    };
    let reason = match outcome.reason {
        Some(EndReason::Done) => "All goals were reached.",
        Some(EndReason::OutOfTime) => "The time ran out.",
        Some(EndReason::Stopped) => "The run was stopped.",
        None => "The log has no end: the run was broken off.",
    };
    let incomplete = if outcome.is_complete { "" } else { " The log is incomplete." };
    let score = outcome.score.map_or("–".to_string(), |score| format!("{:.0}", score));
    let mut content = format!(
        "<div class=\"verdict\"><div class=\"score\">{score}<small> / 100</small></div><div>\
         <span class=\"badge {class}\">{word}</span>{}<div class=\"note\">{reason}{incomplete}</div></div></div>",
        score_scale(report)
    );
    content += &figures(report);
    format!("<section>{content}</section>\n")
}

/// The score between 0 and 100, with the score from which it is passed.
fn score_scale(report: &RunReport) -> String {
    let mut svg = Svg::new(480.0, 30.0);
    let scale = Scale::new([0.0, 100.0], [1.0, 479.0]);
    svg.rect("fill=\"#e7ebef\" rx=\"3\"", [1.0, 4.0], [478.0, 9.0]);
    let score = report.outcome.score.map(f64::from).filter(|score| score.is_finite());
    if let Some(score) = score {
        let colour = if report.outcome.is_passed == Some(true) { GOOD } else { WRONG };
        let end = scale.at(score.clamp(0.0, 100.0));
        svg.rect(&format!("fill=\"{colour}\" rx=\"3\""), [1.0, 4.0], [end - 1.0, 9.0]);
    }
    let pass = f64::from(report.outcome.pass_score).clamp(0.0, 100.0);
    let x = scale.at(pass);
    svg.line("axis", [x, 0.0], [x, 17.0]);
    let anchor = if pass > 80.0 {
        "end"
    } else if pass < 20.0 {
        "start"
    } else {
        "middle"
    };
    svg.text("tick", anchor, [x, 28.0], &format!("passed from {}", short(pass)));
    let told = score.map_or("no score".to_string(), |score| format!("score {score:.0} of 100"));
    svg.finish(&told)
}

fn figures(report: &RunReport) -> String {
    let found =
        |kind: MetricKind| report.metrics.iter().find(|metric| metric.kind == kind).and_then(|metric| metric.value);
    let limit = report.outcome.time_limit_s.map(|limit_s| format!("time, of {}", clock(f64::from(limit_s))));
    let reached = report.goals.iter().filter(|goal| goal.is_reached).count();
    let points: f32 = report.violations.iter().map(|violation| violation.penalty).sum();
    let mut figures = vec![
        (report.outcome.time_s.map_or("–".into(), clock), limit.unwrap_or_else(|| "time".into())),
        (format!("{reached} of {}", report.goals.len()), "goals reached".into()),
        (report.violations.len().to_string(), format!("violations, {} points", short(f64::from(points)))),
    ];
    let seen = found(MetricKind::SeenRemoval).map(|share| (percent(share), "removed in sight".to_string()));
    let blood = found(MetricKind::BloodLoss).map(|lost_ml| (quantity(lost_ml, "ml"), "blood loss".to_string()));
    let force = found(MetricKind::MaxForce).map(|force_n| (quantity(force_n, "N"), "largest force".to_string()));
    let path = found(MetricKind::PathLength).map(|path_m| (quantity(path_m, "m"), "path length".to_string()));
    figures.extend([seen, blood, force, path].into_iter().flatten().take(2));
    let figure = |(value, name): &(String, String)| format!("<div><b>{value}</b><span>{name}</span></div>");
    format!("<div class=\"figures\">{}</div>", figures.iter().map(figure).collect::<String>())
}

/// A share as a bar with an outline, so that it is read in black and white.
fn bar(share: f64, told: &str) -> String {
    let mut svg = Svg::new(92.0, 8.0);
    svg.rect("fill=\"#fff\" stroke=\"#8a949d\" stroke-width=\".8\"", [0.4, 0.4], [91.2, 7.2]);
    svg.rect(&format!("fill=\"{GOOD}\""), [0.8, 0.8], [90.4 * share.clamp(0.0, 1.0), 6.4]);
    svg.finish(told).replacen("<svg", "<svg class=\"bar\"", 1)
}

pub(super) fn goals(report: &RunReport) -> String {
    let mut rows = String::new();
    for (index, goal) in report.goals.iter().enumerate() {
        let state = match (goal.is_reached, goal.reached_s) {
            (true, Some(reached_s)) => format!("✓ {}", moment(reached_s)),
            (true, None) => "✓".to_string(),
            (false, Some(reached_s)) => format!("✗ lost again, had it at {}", moment(reached_s)),
            (false, None) => "✗ not reached".to_string(),
        };
        let progress = percent(f64::from(goal.progress));
        rows += &format!(
            "<tr><td class=\"n fit\">{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"fit\">{}</td><td class=\"n fit\">{progress}</td>\
             <td class=\"w\">{state}</td></tr>",
            index + 1,
            escape(&goal.title),
            short(f64::from(goal.weight)),
            bar(f64::from(goal.progress), &progress),
        );
    }
    let head = "<th class=\"n\">#</th><th>Goal</th><th class=\"n\">Weight</th><th>Progress</th><th></th><th>Reached, min:s</th>";
    section("", "Goals", "", &table(head, &rows))
}

fn table(head: &str, rows: &str) -> String {
    if rows.is_empty() {
        return String::new();
    }
    format!("<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>")
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Warning => "<span class=\"sev\">△ Warning</span>",
        Severity::Error => "<span class=\"sev e\">▲ Error</span>",
        Severity::Failure => "<span class=\"sev f\">■ Failure</span>",
    }
}

pub(super) fn violations(report: &RunReport) -> String {
    if report.violations.is_empty() {
        return section("", "Violations", "", "<p>No rule was broken.</p>");
    }
    let mut rules: BTreeMap<&str, Vec<&ViolationReport>> = BTreeMap::new();
    for violation in &report.violations {
        rules.entry(&violation.rule).or_default().push(violation);
    }
    let mut rules: Vec<_> = rules.into_values().collect();
    let points =
        |violations: &[&ViolationReport]| violations.iter().map(|violation| f64::from(violation.penalty)).sum::<f64>();
    rules.sort_by(|a, b| points(b).total_cmp(&points(a)));
    let mut rows = String::new();
    for violations in rules.iter().take(MOST_ROWS) {
        let worst = violations.iter().filter_map(|violation| violation.value).reduce(f32::max);
        let first = violations[0];
        rows += &format!(
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            severity(violations.iter().map(|violation| violation.severity).max().unwrap_or_default()),
            escape(&first.message),
            violations.len(),
            worst
                .filter(|_| !first.unit.is_empty())
                .map_or("–".into(), |worst| quantity(f64::from(worst), &first.unit)),
            short(points(violations)),
        );
    }
    let head = "<th>Severity</th><th>Rule</th><th class=\"n\">Times</th><th class=\"n\">Largest value</th><th class=\"n\">Points lost</th>";
    section("", "Violations by rule", "", &table(head, &rows))
}

/// Violations one by one.
pub(super) fn violations_in_time(report: &RunReport) -> String {
    let mut rows = String::new();
    for violation in report.violations.iter().take(MOST_ROWS) {
        let value = violation.value.filter(|_| !violation.unit.is_empty());
        rows += &format!(
            "<tr><td class=\"n\">{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            moment(violation.time_s),
            severity(violation.severity),
            escape(&violation.message),
            violation.tool.as_deref().map_or("–".into(), escape),
            value.map_or("–".into(), |value| quantity(f64::from(value), &violation.unit)),
            short(f64::from(violation.penalty)),
        );
    }
    let head = "<th class=\"n\">Time</th><th>Severity</th><th>What</th><th>Instrument</th><th class=\"n\">Value</th><th class=\"n\">Points</th>";
    let left = report.violations.len().saturating_sub(MOST_ROWS);
    let more = if left > 0 {
        format!("<p class=\"note\">{left} more are in the JSON and CSV files.</p>")
    } else {
        String::new()
    };
    section("long", "Violations in time", "Times as minutes:seconds.", &(table(head, &rows) + &more))
}

pub(super) fn structures(report: &RunReport) -> String {
    let mut rows = String::new();
    for structure in report.structures.iter().filter(|structure| structure.removed_mm3 > 0.0 || structure.is_target) {
        let what = match (structure.is_target, structure.is_critical) {
            (true, _) => "● target",
            (false, true) => "▲ critical",
            (false, false) => "other",
        };
        let before = structure.before_mm3.filter(|mm3| *mm3 > 0.0);
        let share = before.map(|before| structure.removed_mm3 / before);
        rows += &format!(
            "<tr><td>{}</td><td>{what}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            escape(&structure.name),
            quantity(structure.removed_mm3, "mm³"),
            before.map_or("–".into(), |mm3| quantity(mm3, "mm³")),
            share.map_or("–".into(), |share| format!("{} %", number(100.0 * share))),
        );
    }
    let head = "<th>Structure</th><th>Kind</th><th class=\"n\">Removed</th><th class=\"n\">Before</th><th class=\"n\">Share</th>";
    section("", "Removed by structure", "", &table(head, &rows))
}

pub(super) fn metrics(report: &RunReport) -> String {
    // Columns about scores only where there are any.
    let is_scored = report.metrics.iter().any(|metric| metric.score.is_some());
    let mut rows = String::new();
    for (found, value) in report.metrics.iter().filter_map(|metric| Some((metric, metric.value?))) {
        let part = |part: &MetricPart| {
            format!("<small>{}: {}</small>", escape(&part.name), metric(found.kind, part.value, &found.unit))
        };
        // One part says the same as the whole.
        let parts: String = if found.by.len() > 1 { found.by.iter().map(part).collect() } else { String::new() };
        rows += &format!(
            "<tr><td>{}<small>{}</small></td><td class=\"n\">{}</td><td>{parts}</td>",
            escape(&found.name),
            escape(&found.formula),
            metric(found.kind, value, &found.unit),
        );
        if is_scored {
            let score = found.score.map(|score| (bar(score, &percent(score)), percent(score))).unwrap_or_default();
            let weight = if found.weight > 0.0 { short(found.weight) } else { String::new() };
            rows += &format!(
                "<td class=\"fit\">{}</td><td class=\"n fit\">{}</td><td class=\"n\">{weight}</td>",
                score.0, score.1
            );
        }
        rows += "</tr>";
    }
    let silent = report.metrics.iter().filter(|metric| metric.value.is_none());
    let silent: Vec<String> = silent.map(|metric| escape(&metric.name)).collect();
    let silent = match silent.len() {
        0 => String::new(),
        _ => format!("<p class=\"note\">The run says nothing about: {}.</p>", silent.join(", ")),
    };
    let told = |score| format!("Score of the weighted metrics: {}.", percent(score));
    let note = report.metrics_score.map_or(String::new(), told);
    let scored = if is_scored { "<th>Score</th><th></th><th class=\"n\">Weight</th>" } else { "" };
    let head = format!("<th>Metric</th><th class=\"n\">Value</th><th>By instrument or structure</th>{scored}");
    section("long", "Metrics", &note, &(table(&head, &rows) + &silent))
}
