//! Strokes of a drill, whose number and shape are known.

use super::near;
use bevy::math::DVec3;
use bevy_surgery::scenario::metrics::strokes::*;
use proptest::prelude::*;
use std::f64::consts::PI;

const RATE_HZ: f64 = 100.0;

/// Straight to and fro with sharp ends: so many legs of 8 mm in 0.3 s.
fn zigzag(legs: usize) -> Vec<DVec3> {
    let corner = |leg: usize| DVec3::new(if leg.is_multiple_of(2) { 0.0 } else { 8e-3 }, 2e-4 * leg as f64, 0.0);
    let mut places = vec![corner(0)];
    for leg in 0..legs {
        places.extend((1..=30).map(|index| corner(leg).lerp(corner(leg + 1), f64::from(index) / 30.0)));
    }
    places
}

#[test]
fn the_k_cosine_of_a_line_a_corner_and_a_way_back() {
    let line: Vec<DVec3> = (0..21).map(|index| DVec3::X * f64::from(index)).collect();
    let corner: Vec<DVec3> =
        (0..21).map(|i| DVec3::new(f64::from(i.min(10)), f64::from((i - 10).max(0)), 0.0)).collect();
    let back: Vec<DVec3> = (0..21).map(|i: i32| DVec3::X * f64::from(10 - (i - 10).abs())).collect();
    for (places, expected) in [(line, -1.0), (corner, 0.0), (back, 1.0)] {
        let cosines = k_cosines(&places, 5, 0.0);
        assert!((cosines[10].expect("a way on and back") - expected).abs() < 1e-12, "{cosines:?}");
        assert!(cosines[..5].iter().chain(&cosines[16..]).all(Option::is_none), "too near the ends: {cosines:?}");
        assert_eq!(k_cosines(&places, 5, 6.0)[2..].iter().flatten().count(), 0, "too short a way");
    }
    assert_eq!(k_cosines(&[DVec3::ZERO; 9], 2, 0.0), vec![None; 9], "no way at all");
}

#[test]
fn a_zigzag_has_as_many_strokes_as_legs() {
    let found = strokes(&zigzag(10), RATE_HZ, &StrokeRule::default());
    assert_eq!(found.len(), 10, "{found:?}");
    for (index, stroke) in found.iter().enumerate() {
        assert_eq!((stroke.first, stroke.last, stroke.is_curved), (30 * index, 30 * index + 30, false));
        near(Some(stroke.length_m), 8e-3_f64.hypot(2e-4), 1e-9);
        near(Some(stroke.time_s), 0.3, 1e-9);
    }
}

#[test]
fn a_swing_turns_where_it_is_slowest() {
    // Ten half periods of a sine, as a hand does it: the ends are places of rest, but too short ones to be a rest.
    let swing: Vec<DVec3> = (0..=500).map(|index| DVec3::X * 4e-3 * (PI * f64::from(index) / 50.0).cos()).collect();
    let found = strokes(&swing, RATE_HZ, &StrokeRule::default());
    assert_eq!(found.len(), 10, "{found:?}");
    assert!(found.iter().all(|stroke| (stroke.length_m - 8e-3).abs() < 1e-4 && !stroke.is_curved), "{found:?}");
}

#[test]
fn arcs_are_curved_and_a_circle_is_one_stroke() {
    let turn = |count: i32, turns: f64| -> Vec<DVec3> {
        let at = |index: i32| (2.0 * PI * turns * f64::from(index) / f64::from(count)).sin_cos();
        (0..=count).map(at).map(|(sin, cos)| DVec3::new(cos, sin, 0.0) * 5e-3).collect()
    };
    let mut scythe = turn(40, 0.5);
    scythe.extend(turn(40, 0.5).into_iter().rev().skip(1));
    let found = strokes(&scythe, RATE_HZ, &StrokeRule::default());
    assert_eq!(found.iter().map(|stroke| stroke.is_curved).collect::<Vec<_>>(), vec![true, true]);
    near(Some(found[0].length_m), 5e-3 * PI, 1e-3);
    let round = strokes(&turn(150, 3.0), RATE_HZ, &StrokeRule::default());
    assert_eq!(round.len(), 1, "a circle never turns back: {round:?}");
    assert!(round[0].is_curved);
    let eighth = strokes(&turn(20, 0.125), RATE_HZ, &StrokeRule::default());
    assert!(eighth.len() == 1 && !eighth[0].is_curved, "{eighth:?}");
}

#[test]
fn a_rest_ends_a_stroke_and_tremor_is_none() {
    let mut places: Vec<DVec3> = (0..=30).map(|index| DVec3::X * 3e-4 * f64::from(index)).collect();
    places.extend(vec![places[30]; 40]);
    places.extend((1..=30).map(|index| DVec3::X * (9e-3 + 3e-4 * f64::from(index))));
    let found = strokes(&places, RATE_HZ, &StrokeRule::default());
    assert_eq!(found.iter().map(|stroke| (stroke.first, stroke.last)).collect::<Vec<_>>(), vec![(0, 30), (70, 100)]);
    let tremor: Vec<DVec3> = (0..300).map(|index| DVec3::X * 1e-4 * f64::from(index % 2)).collect();
    assert_eq!(strokes(&tremor, RATE_HZ, &StrokeRule::default()), Vec::new());
}

#[test]
fn what_says_nothing_has_no_strokes() {
    let rule = StrokeRule::default();
    for places in [vec![], vec![DVec3::ONE], vec![DVec3::ONE; 200], vec![DVec3::NAN; 200]] {
        assert_eq!(strokes(&places, RATE_HZ, &rule), Vec::new());
    }
    assert_eq!(strokes(&zigzag(3), 0.0, &rule), Vec::new());
    let odd = StrokeRule { reach_s: f64::NAN, rest_s: f64::NAN, ..rule };
    assert!(strokes(&zigzag(3), RATE_HZ, &odd).len() <= 90, "a rule that is none does no harm");
}

proptest! {
    #[test]
    fn strokes_lie_in_order_and_are_no_longer_than_the_way(
        places in prop::collection::vec([-0.02..0.02, -0.02..0.02, -0.02..0.02_f64], 2..200),
    ) {
        let places: Vec<DVec3> = places.into_iter().map(DVec3::from_array).collect();
        let found = strokes(&places, RATE_HZ, &StrokeRule::default());
        prop_assert!(found.windows(2).all(|pair| pair[0].last <= pair[1].first));
        prop_assert!(found.iter().all(|stroke| stroke.first < stroke.last && stroke.last < places.len()));
        let way: f64 = places.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        prop_assert!(found.iter().map(|stroke| stroke.length_m).sum::<f64>() <= way + 1e-12);
    }
}
