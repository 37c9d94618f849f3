//! Force, sight, suction.

use super::near;
use bevy::math::DVec3;
use bevy_surgery::scenario::metrics::force::{force_stats, near as near_samples};
use bevy_surgery::scenario::metrics::seen::{SightLine, is_seen, seen_share, seen_volume_share};
use bevy_surgery::scenario::metrics::suction::suction_distance_m;
use std::f64::consts::PI;

#[test]
fn a_half_sine_of_force_has_its_mean_and_impulse() {
    // Between the zeros: mean 2/π of the peak, impulse 2/π times the time.
    let forces_n: Vec<f64> = (0..=1000).map(|index| 3.0 * (PI * f64::from(index) / 1000.0).sin().max(0.0)).collect();
    let stats = force_stats(&forces_n, 500.0).expect("it presses");
    near(Some(stats.mean_n), 3.0 * 2.0 / PI, 2e-3);
    near(Some(stats.impulse_n_s), 3.0 * 2.0 / PI * 2.0, 1e-5);
    near(Some(stats.max_n), 3.0, 1e-12);
    let rests = force_stats(&[0.0, 2.0, 0.0, f64::NAN, -5.0, 4.0, f64::INFINITY], 2.0).expect("it presses");
    assert_eq!((rests.mean_n, rests.max_n, rests.impulse_n_s, rests.time_s), (3.0, 4.0, 3.0, 1.0));
    for (forces_n, rate_hz) in [(&[][..], 60.0), (&[0.0, 0.0][..], 60.0), (&[f64::NAN][..], 60.0), (&[1.0][..], 0.0)] {
        assert_eq!(force_stats(forces_n, rate_hz), None);
    }
}

#[test]
fn near_is_what_is_near() {
    let distances_m = [Some(0.001), None, Some(0.002), Some(0.0021), Some(f64::NAN)];
    assert_eq!(near_samples(&[1.0, 2.0, 3.0, 4.0, 5.0], &distances_m, 0.002), vec![1.0, 3.0]);
}

/// An eye one metre above, a burr at the origin.
fn from_above(clear_m: f64) -> SightLine {
    SightLine { eye_m: DVec3::Z, burr_m: DVec3::ZERO, clear_m, step_m: 1e-3 }
}

#[test]
fn half_a_wall_hides_half() {
    let points: Vec<DVec3> = (0..100).map(|index| DVec3::X * (f64::from(index) - 49.5) * 0.01).collect();
    let wall = |at: DVec3| (at.z - 0.5).abs() < 2e-3 && at.x > 0.0;
    assert_eq!(seen_share(&points, &from_above(0.0), wall), Some(0.5));
    assert_eq!(seen_share(&points, &from_above(0.0), |_| false), Some(1.0));
    assert_eq!(seen_share(&points, &from_above(0.0), |at| at.z > 0.9), Some(0.0));
}

#[test]
fn what_the_burr_is_just_drilling_hides_nothing() {
    // Bone up to 4 mm above the place: hidden, unless all of it is close to the burr.
    let mut bone = |at: DVec3| at.z < 4e-3;
    assert_eq!(is_seen(DVec3::ZERO, &from_above(2.5e-3), &mut bone), Some(false));
    assert_eq!(is_seen(DVec3::ZERO, &from_above(5e-3), &mut bone), Some(true));
    assert_eq!(is_seen(DVec3::Z, &from_above(0.0), &mut |_| true), Some(true), "the eye sees where it is");
}

#[test]
fn lines_that_are_none_are_not_followed() {
    let good = from_above(0.0);
    for line in [
        SightLine { step_m: 0.0, ..good },
        SightLine { step_m: -1.0, ..good },
        SightLine { step_m: f64::NAN, ..good },
        SightLine { step_m: 1e-12, ..good },
        SightLine { eye_m: DVec3::NAN, ..good },
        SightLine { eye_m: DVec3::X * f64::MAX, ..good },
        SightLine { clear_m: f64::NAN, ..good },
    ] {
        assert_eq!(is_seen(DVec3::ZERO, &line, &mut |_| false), None, "{line:?}");
    }
    assert_eq!(seen_share(&[], &good, |_| false), None);
    assert_eq!(seen_share(&[DVec3::NAN], &good, |_| false), None);
}

#[test]
fn sight_is_weighed_by_volume() {
    assert_eq!(seen_volume_share([(3.0, 1.0), (1.0, 0.0)]), Some(0.75));
    assert_eq!(seen_volume_share([(3.0, 7.0), (3.0, -1.0), (f64::NAN, 0.0), (1.0, f64::NAN), (-4.0, 1.0)]), Some(0.5));
    assert_eq!((seen_volume_share([]), seen_volume_share([(0.0, 1.0)])), (None, None));
}

#[test]
fn suction_counts_while_the_burr_turns() {
    let (drill, suction) = (Some(DVec3::ZERO), Some(DVec3::new(3e-3, 4e-3, 0.0)));
    let far = Some(DVec3::X);
    near(suction_distance_m([(drill, suction, true), (drill, far, false), (drill, None, true)]), 5e-3, 1e-12);
    assert_eq!(suction_distance_m([(drill, far, false)]), None);
    assert_eq!(suction_distance_m([(drill, Some(DVec3::NAN), true)]), None);
}
