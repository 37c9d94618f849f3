//! Metrics: closed forms, published vectors, and what stays the same whatever the input.

#[path = "scenario_metrics/formulas.rs"]
mod formulas;
#[path = "scenario_metrics/measured.rs"]
mod measured;
#[path = "scenario_metrics/motion.rs"]
mod motion;
#[path = "scenario_metrics/smoothness.rs"]
mod smoothness;
#[path = "scenario_metrics/strokes.rs"]
mod strokes;

/// Whether two numbers are the same to a share of the second.
fn near(found: Option<f64>, expected: f64, share: f64) {
    let found = found.expect("a value");
    assert!((found - expected).abs() <= share * expected.abs().max(1e-300), "{found} instead of {expected}");
}
