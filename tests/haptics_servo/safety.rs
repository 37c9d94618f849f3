//! Each link of the safety chain, by itself.

use bevy_surgery::haptics::device::{DeviceLimits, DeviceSample};
use bevy_surgery::haptics::safety::{ForceState, SafetyChain, SafetySettings, Tracked, Tracking, Wanted};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

const DT_S: f64 = 1e-3;

fn wanted(force_n: DVec3) -> Wanted {
    Wanted { force_n, contact_n: force_n.length(), silent_s: 0.0, is_held: true }
}

/// Takes so many ticks of the same.
fn rest(chain: &mut SafetyChain, ticks: u32, of: Wanted) {
    for _ in 0..ticks {
        chain.limit(of, DT_S);
    }
}

/// A chain that is engaged and at full force.
fn engaged() -> SafetyChain {
    let mut chain = SafetyChain::new(&DeviceLimits::OMNI, SafetySettings::default());
    rest(&mut chain, 400, wanted(DVec3::ZERO));
    assert_eq!(chain.state(true), ForceState::Whole);
    chain
}

proptest! {
    #[test]
    fn whatever_comes_the_force_is_limited(
        forces in prop::collection::vec((any::<f64>(), any::<f64>(), -50.0..50.0_f64, 0.0..0.3_f64, any::<bool>()), 1..200),
    ) {
        let mut chain = engaged();
        let mut last_n = DVec3::ZERO;
        for (x, y, z, silent_s, is_held) in forces {
            let told_n = chain.limit(Wanted { silent_s, is_held, ..wanted(DVec3::new(x, y, z)) }, DT_S);
            prop_assert!(told_n.is_finite() && told_n.length() <= 3.3 + 1e-12, "{told_n}");
            let step_n = (told_n - last_n).length();
            prop_assert!(told_n == DVec3::ZERO || step_n <= 330.0 * DT_S + 1e-12, "{step_n}");
            last_n = told_n;
        }
    }
}

#[test]
fn forces_are_limited_in_size_and_slew() {
    let mut chain = engaged();
    let told: Vec<f64> = (0..50).map(|_| chain.limit(wanted(DVec3::X * 100.0), DT_S).length()).collect();
    assert!((told[0] - 0.33).abs() < 1e-9 && (told[1] - 0.66).abs() < 1e-9, "{told:?}");
    assert!(told.iter().all(|force| *force <= 3.3) && (told[49] - 3.3).abs() < 1e-12);
    let settings = SafetySettings { force_share: 0.5, ..SafetySettings::default() };
    let mut half = SafetyChain::new(&DeviceLimits::OMNI, settings);
    rest(&mut half, 400, wanted(DVec3::ZERO));
    let last = (0..50).map(|_| half.limit(wanted(DVec3::X * 100.0), DT_S).length()).last();
    assert!((last.expect("one") - 1.65).abs() < 1e-12);
}

#[test]
fn what_is_no_number_is_no_force_and_begins_anew() {
    let mut chain = engaged();
    rest(&mut chain, 20, wanted(DVec3::X));
    assert_eq!(chain.limit(wanted(DVec3::new(f64::NAN, 0.0, 0.0)), DT_S), DVec3::ZERO);
    assert_eq!(chain.not_numbers(), 1);
    assert_eq!(chain.limit(wanted(DVec3::X), DT_S), DVec3::ZERO, "it engages at low force only");
}

#[test]
fn it_engages_at_low_force_only_and_ramps() {
    let mut chain = SafetyChain::new(&DeviceLimits::OMNI, SafetySettings::default());
    for _ in 0..1000 {
        assert_eq!(chain.limit(wanted(DVec3::X), DT_S), DVec3::ZERO);
    }
    assert_eq!(chain.state(true), ForceState::Waiting);
    // Three low ticks are not enough.
    rest(&mut chain, 3, wanted(DVec3::X * 0.1));
    assert_eq!(chain.limit(wanted(DVec3::X), DT_S), DVec3::ZERO);
    rest(&mut chain, 4, wanted(DVec3::X * 0.1));
    assert_eq!(chain.state(true), ForceState::Ramping);
    let told: Vec<f64> = (0..300).map(|_| chain.limit(wanted(DVec3::X), DT_S).x).collect();
    assert!(told[0] < 0.01 && (told[148] - 0.5).abs() < 0.01 && told[299] == 1.0, "{} {}", told[0], told[148]);
    assert!(told.windows(2).all(|pair| pair[1] >= pair[0]));
}

#[test]
fn a_silent_simulation_fades_and_comes_back_softly() {
    let mut chain = engaged();
    rest(&mut chain, 20, wanted(DVec3::X));
    let silent = |silent_s| Wanted { silent_s, ..wanted(DVec3::X) };
    assert_eq!(chain.limit(silent(0.09), DT_S), DVec3::X);
    let told: Vec<f64> = (0..60).map(|_| chain.limit(silent(0.11), DT_S).x).collect();
    assert!(told[24] > 0.4 && told[24] < 0.6 && told[59] == 0.0, "{told:?}");
    assert_eq!(chain.state(true), ForceState::Silent);
    let told: Vec<f64> = (0..310).map(|_| chain.limit(silent(0.0), DT_S).x).collect();
    assert!(told[0] < 0.01 && (told[149] - 0.5).abs() < 0.02 && told[309] == 1.0);
}

#[test]
fn a_loop_that_missed_and_a_hand_that_let_go_begin_anew() {
    for (dt_s, is_held) in [(0.021, true), (DT_S, false), (f64::NAN, true), (0.0, true)] {
        let mut chain = engaged();
        rest(&mut chain, 20, wanted(DVec3::X));
        assert_eq!(chain.limit(Wanted { is_held, ..wanted(DVec3::X) }, dt_s), DVec3::ZERO);
        assert_eq!(chain.limit(wanted(DVec3::X), DT_S), DVec3::ZERO);
    }
}

#[test]
fn limits_that_are_no_numbers_are_none() {
    let limits = DeviceLimits { max_force_n: f64::NAN, ..DeviceLimits::OMNI };
    let mut chain = SafetyChain::new(&limits, SafetySettings::default());
    rest(&mut chain, 400, wanted(DVec3::ZERO));
    assert_eq!(chain.limit(wanted(DVec3::X), DT_S), DVec3::ZERO);
}

fn at(x: f64, time_s: f64) -> DeviceSample {
    DeviceSample { position_m: DVec3::X * x, time_s, ..DeviceSample::default() }
}

#[test]
fn poses_that_are_none_are_dropped_and_jumps_begin_anew() {
    let mut tracking = Tracking::new(SafetySettings::default());
    assert_eq!(tracking.follow(Some(&at(0.0, 0.0)), DT_S), Tracked::Began);
    assert_eq!(tracking.follow(Some(&at(1e-3, 0.0)), DT_S), Tracked::Moved { by_m: DVec3::X * 1e-3 });
    let turned = DeviceSample { device_from_handle: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..at(1e-3, 0.0) };
    for bad in [at(f64::NAN, 0.0), at(0.0, f64::INFINITY), turned] {
        assert_eq!(tracking.follow(Some(&bad), DT_S), Tracked::Dropped);
    }
    assert_eq!(tracking.dropped(), 3);
    assert_eq!(tracking.sample().map(|sample| sample.position_m.x), Some(1e-3));
    // It went on while the samples were bad: four ticks at 5 m/s are 20 mm.
    assert!(matches!(tracking.follow(Some(&at(20e-3, 0.0)), DT_S), Tracked::Moved { .. }));
    assert_eq!(tracking.follow(Some(&at(26e-3, 0.0)), DT_S), Tracked::Began);
    assert_eq!(tracking.jumps(), 1);
    for tick in 0..40 {
        let tracked = tracking.follow(None, DT_S);
        // The twentieth is a matter of rounding.
        if tick != 19 {
            assert_eq!(tracked, if tick < 19 { Tracked::Dropped } else { Tracked::Lost }, "tick {tick}");
        }
    }
    assert_eq!(tracking.follow(Some(&at(0.0, 0.0)), DT_S), Tracked::Began);
}

#[test]
fn a_device_that_repeats_itself_is_lost_if_it_counts_time() {
    let mut tracking = Tracking::new(SafetySettings::default());
    for tick in 0..300 {
        // One without a clock may stand still for ever.
        assert_ne!(tracking.follow(Some(&at(0.0, 0.0)), DT_S), Tracked::Lost, "tick {tick}");
    }
    tracking.follow(Some(&at(0.0, 0.5)), DT_S);
    for tick in 0..300 {
        let is_lost = tracking.follow(Some(&at(0.0, 0.5)), DT_S) == Tracked::Lost;
        assert!(is_lost == (tick >= 100) || tick == 99, "tick {tick}");
    }
    assert_eq!(tracking.follow(Some(&at(0.0, 0.9)), DT_S), Tracked::Began);
    // One that reports at 100 Hz moves in steps of its own time.
    assert!(matches!(tracking.follow(Some(&at(0.04, 0.91)), DT_S), Tracked::Moved { .. }));
}

#[test]
fn velocities_are_smoothed() {
    let mut tracking = Tracking::new(SafetySettings::default());
    // Steps of an encoder of 50 um at 0.1 m/s.
    for tick in 0..200 {
        let x = (0.1 * f64::from(tick) * DT_S / 50e-6).floor() * 50e-6;
        tracking.follow(Some(&at(x, 0.0)), DT_S);
    }
    assert!((tracking.velocity_m_per_s().x - 0.1).abs() < 0.02, "{}", tracking.velocity_m_per_s());
}
