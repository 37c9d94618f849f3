//! A simulated device against what mechanics says.

use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedPath};
use bevy_surgery::haptics::device::simulated::{PRESETS, SimulatedBackend, SimulatedDevice, SimulatedHand};
use bevy_surgery::haptics::device::{DeviceBackend, DeviceLimits, DeviceOutput, HapticDevice};
use glam::DVec3;

const FREE: DeviceLimits = DeviceLimits { own_damping_n_s_per_m: 0.0, encoder_step_m: 0.0, ..DeviceLimits::OMEGA };

fn push(device: &mut SimulatedDevice, force_n: DVec3) {
    device.write(&DeviceOutput { force_n, ..DeviceOutput::default() }).expect("written");
}

#[test]
fn a_force_accelerates_the_mass_and_does_its_work() {
    let mut device = SimulatedDevice::new(FREE, 1e-3).with_hand(SimulatedHand::LET_GO);
    push(&mut device, DVec3::X);
    device.step(0.1);
    let truth = device.handle().truth();
    // a = F/m = 10: v = 1, x = 0.05 and half a step of the integration.
    assert!((truth.velocity_m_per_s.x - 1.0).abs() < 1e-9, "{truth:?}");
    assert!((truth.position_m.x - 0.05).abs() < 1e-4, "{truth:?}");
    assert!((truth.motor_work_j - truth.position_m.x).abs() < 1e-12, "one newton along the way: {truth:?}");
}

#[test]
fn damping_sets_the_final_speed_and_friction_holds_what_is_weak() {
    let limits = DeviceLimits { own_damping_n_s_per_m: 2.0, ..FREE };
    let mut device = SimulatedDevice::new(limits, 1e-3).with_hand(SimulatedHand::LET_GO).with_coulomb_friction_n(0.5);
    push(&mut device, DVec3::Y * 0.49);
    device.step(1.0);
    assert_eq!(device.handle().truth().position_m, DVec3::ZERO, "it sticks");
    push(&mut device, DVec3::Y * 1.5);
    device.step(2.0);
    let speed = device.handle().truth().velocity_m_per_s.y;
    assert!((speed - 0.5).abs() < 1e-6, "(1.5 - 0.5) / 2: {speed}");
    push(&mut device, DVec3::ZERO);
    device.step(2.0);
    assert_eq!(device.handle().truth().velocity_m_per_s, DVec3::ZERO, "friction stops it for good");
}

#[test]
fn the_hand_pulls_to_its_target_and_no_harder_than_it_can() {
    let hand = SimulatedHand { target_m: DVec3::X * 0.05, ..SimulatedHand::default() };
    let mut device = SimulatedDevice::new(DeviceLimits::TOUCH, 1e-3).with_hand(hand);
    device.step(2.0);
    assert!(device.handle().truth().position_m.distance(hand.target_m) < 1e-6);
    // A held force moves the balance by F/k.
    push(&mut device, DVec3::NEG_X * 2.0);
    device.step(2.0);
    assert!((device.handle().truth().position_m.x - (0.05 - 2.0 / 200.0)).abs() < 1e-6);
    device.handle().set_hand(SimulatedHand { max_force_n: 1.0, ..hand });
    device.step(0.2);
    assert!(device.handle().truth().position_m.x < 0.03, "two newtons beat one");
}

#[test]
fn the_encoder_shows_whole_steps_and_the_force_is_held() {
    let limits = DeviceLimits { encoder_step_m: 1e-3, ..DeviceLimits::TOUCH };
    let start_m = DVec3::new(0.01049, -0.02051, 0.0);
    let mut device = SimulatedDevice::new(limits, 1e-3).with_hand(SimulatedHand::LET_GO).with_position_m(start_m);
    let seen = device.read().expect("a state");
    assert!(seen.position_m.distance(DVec3::new(0.010, -0.021, 0.0)) < 1e-12, "{seen:?}");
    push(&mut device, DVec3::Z * 100.0);
    let first_s = seen.time_s;
    for tick in 1..=5 {
        let seen = device.read().expect("a state");
        assert!((seen.time_s - first_s - tick as f64 * 1e-3).abs() < 1e-12, "one tick for each read");
        assert_eq!(device.handle().truth().motor_force_n, DVec3::Z * limits.max_force_n, "held, and limited");
    }
    push(&mut device, DVec3::NAN);
    assert_eq!(device.handle().truth().motor_force_n, DVec3::Z * limits.max_force_n, "the past is as it was");
    device.step(1e-3);
    assert_eq!(device.handle().truth().motor_force_n, DVec3::ZERO, "what is no number is no force");
}

#[test]
fn a_hand_on_a_path_arrives_and_steps_are_the_same_again() {
    let run = || {
        let path = ScriptedPath::new(vec![KeyPose::at(0.0, DVec3::ZERO), KeyPose::at(0.5, DVec3::Z * 0.03)], None);
        let mut device = SimulatedDevice::new(DeviceLimits::FALCON, 1e-3).with_path(path);
        (0..1500).map(|_| device.read().expect("a state")).collect::<Vec<_>>()
    };
    let first = run();
    assert_eq!(first, run());
    assert!(first.last().expect("some").position_m.distance(DVec3::Z * 0.03) < 1e-4);
}

#[test]
fn every_preset_has_a_device_that_a_soft_wall_does_not_excite() {
    let mut backend = SimulatedBackend::default();
    let listed = backend.list().expect("a list");
    assert_eq!(listed.len(), PRESETS.len());
    for (info, (_, limits)) in listed.iter().zip(PRESETS) {
        let mut device = backend.open(&info.id).expect("it opens");
        assert_eq!((&device.info().id, device.info().limits), (&info.id, limits));
        // A spring to the middle, of a stiffness that stays passive.
        let stiffness = 0.5 * limits.stable_stiffness_n_per_m(1e-3);
        let mut farthest = 0.0_f64;
        for tick in 0..4000 {
            let place = device.read().expect("a state").position_m;
            let kick = if tick < 20 { DVec3::X } else { DVec3::ZERO };
            device
                .write(&DeviceOutput { force_n: kick - stiffness * place, ..DeviceOutput::default() })
                .expect("written");
            if tick > 3000 {
                farthest = farthest.max(place.length());
            }
        }
        assert!(farthest <= 3.0 * limits.encoder_step_m, "{} still swings by {farthest} m", info.id);
    }
}
