//! A scripted hand, and its tremor.

use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedDevice, ScriptedPath, Tremor};
use bevy_surgery::haptics::device::{DeviceLimits, HapticDevice};
use glam::{DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

#[test]
fn a_path_passes_through_its_poses_and_rests_there() {
    let turned = DQuat::from_rotation_y(FRAC_PI_2);
    let keys = vec![
        KeyPose { device_from_handle: turned, buttons: 1, ..KeyPose::at(3.0, DVec3::Y) },
        KeyPose { axes: [1.0, 0.0], ..KeyPose::at(1.0, DVec3::X) },
        KeyPose::at(f64::NAN, DVec3::ZERO),
        KeyPose::at(2.0, DVec3::NAN),
    ];
    let path = ScriptedPath::new(keys, None);
    assert_eq!(path.end_s(), 3.0);
    for (time_s, place) in [(0.0, DVec3::X), (1.0, DVec3::X), (3.0, DVec3::Y), (9.0, DVec3::Y)] {
        let sample = path.sample(time_s);
        assert!(sample.position_m.distance(place) < 1e-12 && sample.is_valid(), "at {time_s} s: {sample:?}");
        assert!(sample.velocity_m_per_s.expect("known").length() < 1e-9, "it rests at {time_s} s");
    }
    let middle = path.sample(2.0);
    assert!(middle.position_m.distance((DVec3::X + DVec3::Y) / 2.0) < 1e-12, "half way at half time");
    // The way of least jerk is fastest in the middle, by 15/8 of the mean.
    assert!((middle.velocity_m_per_s.expect("known").length() - 15.0 / 8.0 * 2.0_f64.sqrt() / 2.0).abs() < 1e-12);
    assert!(middle.device_from_handle.angle_between(DQuat::from_rotation_y(FRAC_PI_2 / 2.0)) < 1e-6);
    assert_eq!((middle.buttons, path.sample(3.0).buttons), (0, 1));
    assert!((middle.axes[0] - 0.5).abs() < 1e-6);
}

#[test]
fn the_velocity_is_that_of_the_position() {
    let keys = vec![KeyPose::at(0.0, DVec3::ZERO), KeyPose::at(1.0, DVec3::new(0.02, -0.01, 0.03))];
    let path = ScriptedPath::new(keys, Some(Tremor::default()));
    for step in 1..100 {
        let (time_s, dt) = (step as f64 * 0.012, 1e-6);
        let slope = (path.sample(time_s + dt).position_m - path.sample(time_s - dt).position_m) / (2.0 * dt);
        let told = path.sample(time_s).velocity_m_per_s.expect("known");
        assert!(slope.distance(told) < 1e-6, "at {time_s} s {slope} is told as {told}");
    }
}

/// Power of a signal at a frequency, by correlation.
fn power(signal: &[f64], frequency_hz: f64, period_s: f64) -> f64 {
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (i, value) in signal.iter().enumerate() {
        let (sin, cos) = (TAU * frequency_hz * i as f64 * period_s).sin_cos();
        real += value * cos;
        imaginary += value * sin;
    }
    (real * real + imaginary * imaginary) / (signal.len() as f64).powi(2)
}

#[test]
fn tremor_has_its_amplitude_and_its_band() {
    let tremor = Tremor { amplitude_m: 80e-6, ..Tremor::default() };
    let path = ScriptedPath::new(vec![KeyPose::at(0.0, DVec3::ZERO)], Some(tremor));
    let signal: Vec<_> = (0..20_000).map(|i| path.sample(i as f64 * 1e-3).position_m).collect();
    for axis in 0..3 {
        let along: Vec<_> = signal.iter().map(|p| p[axis]).collect();
        let rms = (along.iter().map(|x| x * x).sum::<f64>() / along.len() as f64).sqrt();
        assert!((rms / 80e-6 - 1.0).abs() < 0.05, "axis {axis} trembles by {rms} m");
        let band = |from: f64, to: f64| {
            let steps = ((to - from) / 0.05) as usize;
            (0..steps).map(|i| power(&along, from + i as f64 * 0.05, 1e-3)).sum::<f64>()
        };
        let (inside, outside) = (band(7.9, 12.1), band(1.0, 7.5) + band(12.5, 30.0));
        assert!(inside > 50.0 * outside, "axis {axis}: {inside} in the band, {outside} beside it");
    }
}

#[test]
fn tremor_is_the_same_for_the_same_seed_only() {
    let sample = |seed| {
        let tremor = Tremor { seed, ..Tremor::default() };
        ScriptedPath::new(vec![KeyPose::at(0.0, DVec3::ZERO)], Some(tremor)).sample(0.3).position_m
    };
    assert_eq!(sample(7), sample(7));
    assert_ne!(sample(7), sample(8));
    let broken = Tremor { amplitude_m: f64::NAN, ..Tremor::default() };
    assert_eq!(ScriptedPath::new(Vec::new(), Some(broken)).sample(1.0).position_m, DVec3::ZERO);
}

#[test]
fn each_read_is_one_tick_later() {
    let path = ScriptedPath::new(vec![KeyPose::at(0.0, DVec3::ZERO), KeyPose::at(0.1, DVec3::X)], None);
    let mut device = ScriptedDevice::new(path.clone(), 1e-3, DeviceLimits::TOUCH);
    for tick in 0..200 {
        assert_eq!(device.read().expect("a state"), path.sample(tick as f64 * 1e-3));
    }
}
