//! A hand that a program moves, and no device at all.

use bevy_surgery::haptics::device::hand::{HandBackend, HandDevice};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceKind, DeviceOutput, DeviceSample, HapticDevice, NoBackend, device_clock_s,
};
use glam::DVec3;

#[test]
fn a_hand_moves_its_device_from_another_thread_and_shows_the_force() {
    let mut backend = HandBackend::default();
    let hand = backend.hand("mouse").expect("there is a mouse");
    let mut device = backend.open("hand:mouse").expect("it opens");
    assert_eq!(device.info().kind, DeviceKind::Mouse);
    let before_s = device_clock_s();
    let mover = hand.clone();
    let moved = std::thread::spawn(move || {
        mover.set(DeviceSample { position_m: DVec3::X, buttons: 5, ..DeviceSample::default() });
    });
    moved.join().expect("the mover ends");
    let sample = device.read().expect("a state");
    assert_eq!((sample.position_m, sample.buttons), (DVec3::X, 5));
    assert!(sample.time_s >= before_s && sample.time_s <= device_clock_s());
    device.write(&DeviceOutput { force_n: DVec3::Y * 2.0, rumble: 0.25, ..DeviceOutput::default() }).expect("written");
    assert_eq!(hand.output().force_n, DVec3::Y * 2.0);
    assert_eq!((hand.rumble(4.0), hand.rumble(1000.0), hand.rumble(0.0)), (0.5, 0.25, 1.0));
    drop(device);
    assert_eq!(hand.output(), DeviceOutput::default(), "what is dropped leaves no force");
}

#[test]
fn a_rumble_of_no_number_is_none() {
    let backend = HandBackend::default();
    let hand = backend.hand("gamepad").expect("there is a gamepad");
    let mut device = HandDevice::new(DeviceKind::Gamepad, "gamepad", hand.clone());
    device.write(&DeviceOutput { rumble: f32::NAN, force_n: DVec3::NAN, ..DeviceOutput::default() }).expect("written");
    assert_eq!(hand.rumble(1.0), 0.0);
}

#[test]
fn no_device_stands_still() {
    let mut device = NoBackend.open("none:none").expect("it opens");
    device.write(&DeviceOutput { force_n: DVec3::X, ..DeviceOutput::default() }).expect("written");
    let (first, second) = (device.read().expect("a state"), device.read().expect("a state"));
    assert_eq!((first.position_m, second.position_m), (DVec3::ZERO, DVec3::ZERO));
    assert!(second.time_s >= first.time_s && second.is_valid());
    assert!(matches!(NoBackend.open("none:two").err(), Some(DeviceFault::NotFound { .. })));
}
