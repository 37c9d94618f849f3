//! Force Dimension and Falcon, against a library that has the functions of DHD.

use super::fake::{Fake, copy};
use super::wait_for;
use bevy_surgery::haptics::device::force_dimension::{ForceDimensionBackend, ForceDimensionSettings};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceKind, DeviceLimits, DeviceManager, DeviceNews, DeviceOutput, DeviceSample,
    HapticDevice,
};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::time::Duration;

// The fixture's numbers.
const COUNT: u32 = 0;
const TYPE: u32 = 1;
const MAX_FORCE: u32 = 5;
const CALIBRATED: u32 = 6;
const POWER: u32 = 7;
const FORCE_ANSWER: u32 = 8;
const POSITION_ANSWER: u32 = 9;
const ENABLE_ANSWER: u32 = 10;
const OPEN_ANSWER: u32 = 11;
const OPENS: u32 = 32;
const CLOSES: u32 = 33;
const MISUSES: u32 = 34;
const ENABLED: u32 = 35;

/// An omega.7 and a Falcon.
fn fake() -> Fake {
    let values = [(COUNT, 2.0), (TYPE, 35.0), (TYPE + 1, 60.0), (CALIBRATED, 1.0), (POWER, 1.0)];
    Fake::new("fake_dhd", &values)
}

fn backend(library: &Path) -> ForceDimensionBackend {
    let libraries = vec!["/nowhere/libdrd.so".into(), library.into()];
    ForceDimensionBackend::new(ForceDimensionSettings { libraries, ..ForceDimensionSettings::default() })
}

fn state(device: &mut dyn HapticDevice) -> DeviceSample {
    wait_for("a state", || device.read().ok())
}

fn push(device: &mut dyn HapticDevice, force_n: DVec3) -> Result<(), DeviceFault> {
    device.write(&DeviceOutput { force_n, ..DeviceOutput::default() })
}

fn closed_cleanly(fake: &Fake) {
    // On a busy machine a drop does not wait until the driver's thread has ended.
    wait_for("the end of all that was opened", || (fake.get(OPENS) == fake.get(CLOSES)).then_some(()));
    assert_eq!(fake.get(MISUSES), 0.0, "no handle that is not open");
}

#[test]
fn states_and_forces_are_turned_into_the_space_of_all_devices() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let mut device = backend.open("force_dimension:0").expect("it opens");
    let info = device.info().clone();
    assert_eq!((info.kind, info.name.as_str()), (DeviceKind::ForceDimension, "Force Dimension omega.7 777"));
    assert_eq!((info.limits, info.has_rotation, info.has_grip), (DeviceLimits::OMEGA, true, true));
    let sample = state(&mut *device);
    // The library's X is towards the person, its Y to the right, its Z up.
    assert!(sample.position_m.distance(DVec3::new(0.02, 0.03, 0.01)) < 1e-12, "{sample:?}");
    assert!(sample.velocity_m_per_s.expect("known").distance(DVec3::new(0.2, 0.3, 0.1)) < 1e-12);
    assert!(sample.device_from_handle.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)) < 1e-6);
    assert_eq!((sample.buttons, sample.grip_rad), (5, Some(0.4)));
    wait_for("the force", || {
        push(&mut *device, DVec3::new(1.0, 2.0, 3.0)).expect("written");
        (fake.force(0) == [3.0, 1.0, 2.0]).then_some(())
    });
    assert_eq!(fake.get(ENABLED), 1.0);
    wait_for("the limit", || {
        push(&mut *device, DVec3::X * 1000.0).expect("written");
        (fake.force(0)[1] > 3.0).then_some(())
    });
    assert!(fake.force(0)[1] <= 12.0);
    wait_for("no force after a silence", || (fake.force(0) == [0.0; 3]).then_some(()));
    wait_for("the force", || {
        push(&mut *device, DVec3::X).expect("written");
        (fake.force(0)[1] == 1.0).then_some(())
    });
    drop(device);
    wait_for("no force after the drop", || (fake.force(0) == [0.0; 3] && fake.get(ENABLED) == 0.0).then_some(()));
    closed_cleanly(&fake);
}

#[test]
fn every_type_has_its_limits_and_no_library_raises_them() {
    let fake = fake();
    fake.set(COUNT, 1.0);
    let mut backend = backend(&fake.path);
    let mut look = |kind: f64, max_force: f64| {
        fake.set(TYPE, kind);
        fake.set(MAX_FORCE, max_force);
        let info = backend.list().expect("the library").remove(0);
        (info.name.split(" 777").next().unwrap_or_default().to_string(), info.limits)
    };
    for (kind, name, limits) in [
        (33.0, "Force Dimension omega.3", DeviceLimits::OMEGA),
        (36.0, "Force Dimension omega.6", DeviceLimits::OMEGA),
        (60.0, "Novint Falcon", DeviceLimits::FALCON),
        (104.0, "Force Dimension sigma.7", DeviceLimits::SIGMA),
        (203.0, "Force Dimension lambda.3", DeviceLimits::SIGMA),
        (4711.0, "device of Force Dimension", DeviceLimits::FALCON),
    ] {
        assert_eq!(look(kind, 1e9), (name.to_string(), limits));
        assert_eq!(look(kind, -1.0).1, limits, "what is not known");
        assert_eq!(look(kind, 2.0).1.max_force_n, 2.0, "what is less");
    }
    closed_cleanly(&fake);
}

#[test]
fn positive_answers_are_no_errors_and_negative_ones_are() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let mut device = backend.open("0").expect("it opens");
    for answer in [1.0, 7.0] {
        fake.set(FORCE_ANSWER, answer);
        fake.set(POSITION_ANSWER, answer);
        let before_s = state(&mut *device).time_s;
        wait_for("a newer state", || (device.read().expect("it goes on").time_s > before_s).then_some(()));
    }
    fake.set(FORCE_ANSWER, 2.0);
    let warning = wait_for("the warning of motors at their end", || push(&mut *device, DVec3::X).err());
    assert!(!warning.is_over() && warning.to_string().contains("all they can"), "{warning}");
    device.read().expect("it goes on");
    for key in [FORCE_ANSWER, POSITION_ANSWER] {
        fake.set(FORCE_ANSWER, 0.0);
        fake.set(POSITION_ANSWER, 0.0);
        let mut device = backend.open("1").expect("it opens");
        state(&mut *device);
        fake.set(key, -1.0);
        let fault = wait_for("the loss", || device.read().err().filter(DeviceFault::is_over)).to_string();
        assert!(
            fault.starts_with("force_dimension:1 is gone: ") && fault.contains("communication error (2)"),
            "{fault}"
        );
    }
    drop(device);
    closed_cleanly(&fake);
}

#[test]
fn two_devices_at_once_and_none_twice() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let names: Vec<_> = backend.list().expect("the library").into_iter().map(|info| info.name).collect();
    assert_eq!(names, ["Force Dimension omega.7 777", "Novint Falcon 777"]);
    let mut a = backend.open("force_dimension:0").expect("it opens");
    let mut b = backend.open("force_dimension:1").expect("it opens");
    assert!((state(&mut *b).position_m.z - 1.01).abs() < 1e-9 && (state(&mut *a).position_m.z - 0.01).abs() < 1e-9);
    assert_eq!(
        (state(&mut *b).device_from_handle, state(&mut *b).grip_rad),
        (DQuat::IDENTITY, None),
        "a Falcon has none"
    );
    wait_for("both forces", || {
        push(&mut *a, DVec3::X).expect("written");
        push(&mut *b, DVec3::Y).expect("written");
        (fake.force(0) == [0.0, 1.0, 0.0] && fake.force(1) == [0.0, 0.0, 1.0]).then_some(())
    });
    assert_eq!(backend.list().expect("the library").len(), 2, "open ones are listed too");
    let twice = backend.open("force_dimension:0").err().expect("it is open").to_string();
    assert!(twice.contains("open already"), "{twice}");
    for wrong in ["force_dimension:2", "force_dimension:x", "force_dimension:-1"] {
        let fault = backend.open(wrong).err().expect("there is none").to_string();
        assert_eq!(fault, format!("there is no device {wrong}; there are: force_dimension:0, force_dimension:1"));
    }
    drop((a, b));
    wait_for("a device that can be opened again", || backend.open("force_dimension:0").ok().map(drop));
    closed_cleanly(&fake);
}

#[test]
fn without_a_library_or_one_of_its_functions_there_is_one_clear_message() {
    let fault = backend(Path::new("/nowhere/libdhd.so")).list().expect_err("there is none").to_string();
    assert!(fault.starts_with("/nowhere/libdrd.so cannot be used: ") && fault.contains("Force Dimension"), "{fault}");
    let (_folder, path) = copy("fake_dhd", &["incomplete"]);
    let settings = ForceDimensionSettings { libraries: vec![path], ..ForceDimensionSettings::default() };
    let fault = ForceDimensionBackend::new(settings).list().expect_err("it lacks one").to_string();
    assert!(fault.contains("dhdSetForce"), "{fault}");
}

#[test]
fn an_older_library_does_without_what_it_lacks() {
    let (_folder, path) = copy("fake_dhd", &["old"]);
    assert_eq!(backend(&path).list().expect("it loads"), []);
}

#[test]
fn an_uncalibrated_device_says_what_to_do_and_is_not_pushed() {
    let fake = fake();
    fake.set(CALIBRATED, 0.0);
    let mut device = backend(&fake.path).open("1").expect("it opens");
    let fault = wait_for("the fault", || device.read().err().filter(|f| matches!(f, DeviceFault::Uncalibrated { .. })));
    assert!(!fault.is_over() && fault.to_string().contains("move its handle"), "{fault}");
    for _ in 0..20 {
        let _ = push(&mut *device, DVec3::X);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(fake.force(1), [0.0; 3]);
    fake.set(CALIBRATED, 1.0);
    wait_for("the force", || {
        let _ = push(&mut *device, DVec3::X);
        (fake.force(1)[1] == 1.0).then_some(())
    });
}

#[test]
fn no_power_and_no_motors_are_warnings() {
    for (key, value, said) in [(POWER, 0.0, "power supply"), (ENABLE_ANSWER, -1.0, "switching its motors on")] {
        let fake = fake();
        fake.set(key, value);
        let mut device = backend(&fake.path).open("0").expect("it opens");
        state(&mut *device);
        let warning = wait_for("the warning", || push(&mut *device, DVec3::X).err());
        assert!(matches!(&warning, DeviceFault::Warning { reason, .. } if reason.contains(said)), "{warning}");
    }
}

#[test]
fn what_is_unplugged_in_the_middle_is_taken_up_again() {
    let fake = fake();
    let backends: Vec<Box<dyn DeviceBackend>> = vec![Box::new(backend(&fake.path))];
    let manager = DeviceManager::new(backends, Duration::from_millis(10)).expect("a thread");
    let mut device = manager.open("force_dimension").expect("its first");
    state(&mut device);
    fake.set(OPEN_ANSWER, -1.0);
    fake.set(POSITION_ANSWER, -1.0);
    wait_for("the loss", || device.read().err().filter(|fault| matches!(fault, DeviceFault::Away { .. })));
    std::thread::sleep(Duration::from_millis(40));
    fake.set(POSITION_ANSWER, 0.0);
    fake.set(OPEN_ANSWER, 0.0);
    state(&mut device);
    let news = wait_for("the news", || Some(manager.news()).filter(|news| !news.is_empty()));
    assert!(matches!(&news[..], [DeviceNews::Lost { .. }, DeviceNews::Found { .. }]), "{news:?}");
    drop(device);
    closed_cleanly(&fake);
}
