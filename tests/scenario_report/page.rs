//! The page of HTML.

use super::*;
use bevy_surgery::scenario::report::RunReport;

/// Names of the elements of a page, and that each is closed; attributes are in double quotes.
fn elements(html: &str) -> Vec<String> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    let mut rest = html.strip_prefix("<!DOCTYPE html>").expect("a document");
    while let Some(begin) = rest.find('<') {
        let end = begin + rest[begin..].find('>').expect("a tag ends");
        let tag = &rest[begin + 1..end];
        assert!(tag.matches('"').count().is_multiple_of(2), "quotes: {tag}");
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "what is closed was open");
            continue;
        }
        let name: String = tag.chars().take_while(char::is_ascii_alphanumeric).collect();
        assert!(!name.is_empty(), "a tag has a name: <{tag}>");
        if name != "meta" && !tag.ends_with('/') {
            open.push(name.clone());
        }
        found.push(name);
    }
    assert_eq!(open, Vec::<String>::new(), "what is open is closed");
    found
}

/// What every page keeps to.
fn conforms(html: &str) {
    let allowed = [
        "html", "head", "meta", "title", "style", "body", "header", "footer", "section", "h1", "h2", "p", "b", "small",
        "span", "div", "ul", "li", "table", "thead", "tbody", "tr", "th", "td", "svg", "g", "line", "rect", "circle",
        "text", "polyline", "polygon", "clipPath",
    ];
    for name in elements(html) {
        assert!(allowed.contains(&name.as_str()), "no <{name}>");
    }
    for outside in ["http:", "https:", "<script", "<link", "@import", "src=", "href", "url(http", "javascript"] {
        let tags = html.split('<').filter_map(|tag| tag.split('>').next());
        assert!(!tags.clone().any(|tag| tag.contains(outside)), "nothing from outside: {outside}");
    }
    for none in ["NaN", "inf,", "\"inf", "\"-inf", "null"] {
        assert!(!html.contains(none), "a number is none: {none}");
    }
}

fn weighted() -> Vec<MetricChoice> {
    let choice = |metric, weight, best, worst| MetricChoice { weight, best, worst, ..MetricChoice::new(metric) };
    let mut metrics: Vec<_> = MetricKind::ALL.into_iter().map(MetricChoice::new).collect();
    metrics[0] = choice(MetricKind::Time, 1.0, 150.0, 600.0);
    metrics[1] = choice(MetricKind::PathLength, 1.0, 2.0, 12.0);
    metrics[26] = choice(MetricKind::SeenRemoval, 2.0, 1.0, 0.6);
    metrics
}

#[test]
fn a_page_shows_all_of_a_run() {
    let earlier: Vec<RunReport> = (0..6).map(|n| RunReport::of(&mastoid_run(0.1 * n as f32, n, weighted()))).collect();
    let report = RunReport::of(&mastoid_run(0.85, 9, weighted()));
    let html = report.to_html(&earlier);
    conforms(&html);
    for title in [
        "Cortical mastoidectomy",
        "A. Trainee",
        "Goals",
        "Timeline",
        "Violations by rule",
        "Violations in time",
        "Force over time",
        "Ways of the instruments",
        "Removed matter",
        "Removed by structure",
        "Earlier runs",
        "Metrics",
        "Show the facial nerve",
        "Drill, 4 mm cutting",
        "sigmoid sinus",
        "✓ Passed",
    ] {
        assert!(html.contains(title), "{title}");
    }
    for metric in &report.metrics {
        assert!(html.contains(&metric.name), "{}", metric.name);
    }
    let circles = html.matches("<circle").count();
    let squares = html.matches("<rect").count();
    assert!(circles + squares > 2 * report.series.removals.len(), "each removal is seen from two sides");
    assert!(html.contains("run 7") && !report.to_html(&[]).contains("Earlier runs"));
}

#[test]
fn runs_of_other_scenarios_are_not_compared() {
    let report = RunReport::of(&mastoid_run(0.9, 9, Vec::new()));
    let mut other = report.clone();
    other.scenario = "Liver biopsy".into();
    assert!(!report.to_html(&[other]).contains("Earlier runs"));
}

#[test]
fn hostile_texts_stay_texts() {
    let report = RunReport::of(&hostile_run());
    let html = report.to_html(std::slice::from_ref(&report));
    conforms(&html);
    assert!(
        !html.contains("<img") && !html.contains("<script") && !html.contains('\u{202e}') && !html.contains('\u{0}')
    );
    assert_eq!(html.matches("<title>").count(), 1);
    assert!(html.contains("&lt;script&gt;alert(&#39;x&amp;y&#39;)&lt;/script&gt;"));
}

#[test]
fn runs_that_say_little_have_a_page() {
    let empty = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    let mut single = empty_run(60.0, vec![remove_cells()], Vec::new(), Vec::new());
    push(&mut single, 0, LogRecord::Sample(sample(0, Vec3::ONE)));
    push(&mut single, 0, removal(0, 1, 1.0, Vec3::ONE, None));
    let mut still = empty_run(60.0, Vec::new(), Vec::new(), Vec::new());
    still.header.bodies[0].box_world_m = [Vec3::ZERO; 2];
    for step in 0..100 {
        push(&mut still, step, LogRecord::Sample(sample(0, Vec3::ONE)));
        push(&mut still, step, removal(0, 1, 1.0, Vec3::ZERO, None));
    }
    for mut run in [empty, single, still, broken_run()] {
        for is_complete in [true, false] {
            run.is_complete = is_complete;
            let report = RunReport::of(&run);
            let html = report.to_html(std::slice::from_ref(&report));
            conforms(&html);
            assert_eq!(html.contains("The log is incomplete."), !is_complete);
        }
    }
    let report = RunReport::of(&broken_run());
    assert!(report.to_html(&[]).contains("Violations by rule"));
}

#[test]
fn numbers_of_a_report_from_a_file_do_no_harm() {
    // A report is read from a file, and a file can say anything that a number can.
    let mut report = RunReport::of(&mastoid_run(0.4, 9, weighted()));
    report.outcome.score = Some(f32::INFINITY);
    report.outcome.time_s = Some(f64::MAX);
    report.outcome.pass_score = -1e30;
    report.series.bodies[0].half_m = Vec3::splat(f32::INFINITY);
    report.series.tools[0].track.iter_mut().for_each(|point| point.tip_m *= 1e37);
    report.series.tools[0].force.iter_mut().for_each(|point| point.max_n = f64::MAX);
    report.series.removals.iter_mut().for_each(|dot| (dot.mm3, dot.body) = (f64::MAX, dot.body + 1_000_000));
    report.metrics.iter_mut().for_each(|metric| metric.value = Some(f64::MAX));
    report.violations.iter_mut().for_each(|violation| violation.time_s = -f64::MAX);
    report.goals[0].reached_s = Some(f64::INFINITY);
    conforms(&report.to_html(std::slice::from_ref(&report)));
}
