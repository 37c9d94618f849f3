//! Path, economy, depth, speed, rest.

use super::near;
use bevy::math::{DQuat, DVec3};
use bevy_surgery::scenario::metrics::motion::*;
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

fn circle(count: usize, radius_m: f64) -> Vec<DVec3> {
    let at = |index: usize| DQuat::from_rotation_z(TAU * index as f64 / count as f64) * DVec3::X * radius_m;
    (0..=count).map(at).collect()
}

#[test]
fn a_circle_is_as_long_as_its_polygon() {
    let (count, radius_m) = (360, 0.02);
    near(path_length_m(&circle(count, radius_m)), 2.0 * count as f64 * radius_m * (PI / count as f64).sin(), 1e-12);
}

#[test]
fn a_helix_has_its_length_and_its_depth() {
    let (count, radius_m, rise_m) = (500, 0.01, 0.03);
    let angle = 5.0 * TAU / count as f64;
    let helix: Vec<DVec3> = (0..=count)
        .map(|index| {
            let (sin, cos) = (angle * index as f64).sin_cos();
            DVec3::new(radius_m * cos, radius_m * sin, rise_m * index as f64 / count as f64)
        })
        .collect();
    let step_m = (2.0 * radius_m * (0.5 * angle).sin()).hypot(rise_m / count as f64);
    near(path_length_m(&helix), step_m * count as f64, 1e-12);
    // Along the helix's axis it only rises; across it, it goes to and fro: four radii a turn.
    near(depth_m(&helix, &vec![DVec3::Z; count + 1]), rise_m, 1e-12);
    near(depth_m(&helix, &vec![DVec3::X; count + 1]), 5.0 * 4.0 * radius_m, 1e-3);
}

#[test]
fn economy_is_one_on_a_line_and_two_over_pi_on_half_a_circle() {
    let line: Vec<DVec3> = (0..50).map(|index| DVec3::new(0.3, 0.1, -0.7) * f64::from(index)).collect();
    near(economy(&line), 1.0, 1e-12);
    near(economy(&circle(2000, 1.0)[..=1000]), 2.0 / PI, 1e-6);
    assert!(economy(&circle(100, 1.0)).expect("a way") < 1e-12, "it comes back to where it began");
}

#[test]
fn speed_and_rest_of_a_stop_and_go() {
    // 20 mm/s for a second, still for two.
    let places: Vec<DVec3> = (0..=300).map(|index| DVec3::X * 0.02 * f64::from(index.min(100)) / 100.0).collect();
    let speeds = speeds_m_per_s(&places, 100.0);
    near(mean(&speeds), 0.02 / 3.0, 1e-9);
    near(largest(&speeds), 0.02, 1e-9);
    near(idle_s(&speeds, 100.0, IDLE_M_PER_S), 2.0, 1e-12);
    near(idle_s(&speeds, 100.0, 0.03), 3.0, 1e-12);
}

#[test]
fn movements_lie_between_rests_and_are_neither_short_nor_endless() {
    let rule = MovementRule::default();
    let mut speeds = vec![0.0; 60];
    speeds.extend(vec![0.03; 60]);
    speeds.extend(vec![0.001; 30]);
    speeds.extend(vec![0.03; 10]);
    speeds.extend(vec![0.0; 30]);
    speeds.extend(vec![0.03; 301]);
    assert_eq!(movements(&speeds, 60.0, &rule), vec![59..121], "the second is too short, the third too long");
    assert_eq!(movements(&speeds[..speeds.len() - 1], 60.0, &rule), vec![59..121, 189..490]);
    assert!(movements(&speeds, f64::NAN, &rule).is_empty());
}

#[test]
fn the_middle_of_numbers() {
    assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
    assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
    assert_eq!((median(&[]), median(&[f64::NAN, 1.0])), (None, None));
}

#[test]
fn what_says_nothing_has_no_value() {
    let bad = [DVec3::ZERO, DVec3::new(f64::NAN, 0.0, 0.0)];
    let endless = [DVec3::ZERO, DVec3::X * f64::MAX, -DVec3::X * f64::MAX];
    for places in [&[][..], &bad, &endless] {
        assert_eq!((path_length_m(places), economy(places)), (None, None), "{places:?}");
    }
    assert_eq!((path_length_m(&[DVec3::ONE]), economy(&[DVec3::ONE])), (Some(0.0), None));
    assert_eq!(economy(&[DVec3::ONE; 5]), None, "no way, no economy");
    assert_eq!((depth_m(&[], &[]), depth_m(&[DVec3::ONE], &[])), (None, None));
    assert_eq!(depth_m(&bad, &[DVec3::X; 2]), None);
    assert_eq!((mean(&[]), mean(&[f64::INFINITY]), largest(&[]), largest(&[1.0, f64::NAN])), (None, None, None, None));
    assert_eq!((idle_s(&[], 60.0, 1.0), idle_s(&[1.0], 0.0, 1.0), idle_s(&[f64::NAN], 60.0, 1.0)), (None, None, None));
    assert!(speeds_m_per_s(&circle(9, 1.0), -1.0).is_empty() && speeds_m_per_s(&[DVec3::ONE], 60.0).is_empty());
}

fn place() -> impl Strategy<Value = DVec3> {
    [-0.1..0.1, -0.1..0.1, -0.1..0.1_f64].prop_map(DVec3::from_array)
}

proptest! {
    #[test]
    fn moving_and_turning_everything_changes_no_length(
        places in prop::collection::vec(place(), 2..60),
        by in place(),
        axis in place(),
        angle in 0.0..TAU,
    ) {
        let turn = DQuat::from_axis_angle(axis.normalize_or(DVec3::Y), angle);
        let moved: Vec<DVec3> = places.iter().map(|place| turn * *place + by).collect();
        near(path_length_m(&moved), path_length_m(&places).expect("a length"), 1e-9);
        let axes = vec![DVec3::Z; places.len()];
        let depth = depth_m(&places, &axes).expect("a depth");
        prop_assert!((depth_m(&moved, &vec![turn * DVec3::Z; places.len()]).expect("a depth") - depth).abs() < 1e-9);
        prop_assert!(depth <= path_length_m(&places).expect("a length") + 1e-12);
    }

    #[test]
    fn economy_is_a_share(places in prop::collection::vec(place(), 0..60)) {
        prop_assert!(economy(&places).is_none_or(|share| (0.0..=1.0).contains(&share)));
    }
}
