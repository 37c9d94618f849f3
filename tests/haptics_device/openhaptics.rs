//! OpenHaptics, against a library that has its functions.

use super::fake::{Fake, copy};
use super::wait_for;
use bevy_surgery::haptics::device::openhaptics::{OpenHapticsBackend, OpenHapticsSettings};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceKind, DeviceLimits, DeviceManager, DeviceNews, DeviceOutput, DeviceSample,
    HapticDevice,
};
use glam::{DQuat, DVec3};
use std::path::Path;
use std::time::Duration;

// The fixture's numbers.
const PLUGGED: u32 = 0;
const CALIBRATION: u32 = 1;
const CALIBRATION_AFTER_UPDATE: u32 = 2;
const STYLE: u32 = 3;
const STIFFNESS: u32 = 4;
const FORCE: u32 = 5;
const DAMPING: u32 = 6;
const MODEL: u32 = 7;
const BUTTONS: u32 = 8;
const INIT_ERROR: u32 = 9;
const SCHEDULE_ERROR: u32 = 10;
const FRAME_ERROR: u32 = 11;
const INITS: u32 = 32;
const DISABLES: u32 = 33;
const MISUSES: u32 = 34;
const UPDATES: u32 = 35;
const LAST_STYLE: u32 = 36;
const FRAMES: u32 = 37;

const OK: f64 = 0x5000 as f64;
const NEEDS_UPDATE: f64 = 0x5001 as f64;
const NEEDS_HAND: f64 = 0x5002 as f64;

fn fake() -> Fake {
    Fake::new("fake_hd", &[(PLUGGED, 3.0), (CALIBRATION, OK), (STYLE, 4.0), (BUTTONS, 3.0)])
}

fn backend(library: &Path) -> OpenHapticsBackend {
    let names = vec!["default".into(), "Left Device".into()];
    OpenHapticsBackend::new(OpenHapticsSettings { library: library.into(), names, ..OpenHapticsSettings::default() })
}

fn state(device: &mut dyn HapticDevice) -> DeviceSample {
    wait_for("a state", || device.read().ok())
}

fn push(device: &mut dyn HapticDevice, force_n: DVec3) -> Result<(), DeviceFault> {
    device.write(&DeviceOutput { force_n, ..DeviceOutput::default() })
}

fn closed_cleanly(fake: &Fake) {
    // On a busy machine a drop does not wait until the driver's thread has ended.
    wait_for("the end of all that was opened", || (fake.get(INITS) == fake.get(DISABLES)).then_some(()));
    assert_eq!(fake.get(MISUSES), 0.0, "no frame out of order, no handle that is not open, no scheduler twice");
}

#[test]
fn states_come_in_metres_and_forces_reach_the_driver() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let mut device = backend.open("openhaptics:default").expect("it opens");
    assert_eq!((device.info().kind, device.info().name.as_str()), (DeviceKind::OpenHaptics, "Touch SN42"));
    let sample = state(&mut *device);
    assert!(sample.position_m.distance(DVec3::new(0.001, 0.002, 0.003)) < 1e-12, "{sample:?}");
    assert!(sample.velocity_m_per_s.expect("known").distance(DVec3::new(0.01, 0.02, 0.03)) < 1e-12);
    assert!(sample.device_from_handle.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)) < 1e-6);
    assert_eq!(sample.buttons, 3);
    wait_for("a newer state", || (state(&mut *device).time_s > sample.time_s).then_some(()));
    wait_for("the force", || {
        push(&mut *device, DVec3::new(0.5, -1.0, 2.0)).expect("written");
        (fake.force(0) == [0.5, -1.0, 2.0]).then_some(())
    });
    wait_for("the limit", || {
        push(&mut *device, DVec3::X * 1000.0).expect("written");
        (fake.force(0)[0] > 1.0).then_some(())
    });
    assert!(fake.force(0)[0] <= DeviceLimits::TOUCH.max_force_n);
    wait_for("no force after a silence", || (fake.force(0) == [0.0; 3]).then_some(()));
    wait_for("the force", || {
        push(&mut *device, DVec3::X).expect("written");
        (fake.force(0)[0] == 1.0).then_some(())
    });
    drop(device);
    wait_for("no force after the drop", || (fake.force(0) == [0.0; 3]).then_some(()));
    closed_cleanly(&fake);
}

#[test]
fn limits_are_those_of_the_driver_and_never_above_the_table() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let mut limits = |model: f64, stiffness: f64, force: f64, damping: f64| {
        [(MODEL, model), (STIFFNESS, stiffness), (FORCE, force), (DAMPING, damping)]
            .iter()
            .for_each(|(key, value)| fake.set(*key, *value));
        let list = backend.list().expect("the library");
        let limits = list[0].limits;
        (limits.max_stiffness_n_per_m, limits.max_force_n, limits.max_damping_n_s_per_m)
    };
    assert_eq!(limits(0.0, 0.25, 2.0, 0.002), (250.0, 2.0, 2.0), "newtons per millimetre");
    assert_eq!(limits(0.0, 1.26, 99.0, 1.0), (400.0, 3.3, 4.0), "a Touch");
    assert_eq!(limits(1.0, 9.0, 99.0, 1.0), (700.0, 3.3, 5.0), "an Omni");
    assert_eq!(limits(2.0, 9.0, 99.0, 1.0), (1000.0, 7.9, 5.0), "a Desktop");
    for nothing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(limits(3.0, nothing, nothing, nothing), (400.0, 3.3, 4.0), "what is not known is the weakest");
    }
    closed_cleanly(&fake);
}

#[test]
fn two_devices_share_the_scheduler() {
    let fake = fake();
    let mut backend = backend(&fake.path);
    let listed: Vec<_> = backend.list().expect("the library").into_iter().map(|info| info.id).collect();
    assert_eq!(listed, ["openhaptics:default", "openhaptics:Left Device"]);
    let mut a = backend.open("openhaptics:default").expect("it opens");
    let mut b = backend.open("openhaptics:Left Device").expect("it opens");
    assert!((state(&mut *b).position_m.x - 0.101).abs() < 1e-12 && (state(&mut *a).position_m.x - 0.001).abs() < 1e-12);
    wait_for("both forces", || {
        push(&mut *a, DVec3::X).expect("written");
        push(&mut *b, DVec3::Y).expect("written");
        (fake.force(0) == [1.0, 0.0, 0.0] && fake.force(1) == [0.0, 1.0, 0.0]).then_some(())
    });
    assert_eq!(backend.list().expect("the library").len(), 2, "open ones are listed too");
    let twice = backend.open("openhaptics:default").err().expect("it is open").to_string();
    assert!(twice.contains("open already"), "{twice}");
    drop(a);
    let before = fake.get(FRAMES);
    wait_for("the other one's frames", || (fake.get(FRAMES) > before + 3.0).then_some(()));
    state(&mut *b);
    drop(b);
    closed_cleanly(&fake);
}

#[test]
fn without_a_library_or_one_of_its_functions_there_is_one_clear_message() {
    let fault = backend(Path::new("/nowhere/libHD.so")).list().expect_err("there is none").to_string();
    assert!(fault.starts_with("/nowhere/libHD.so cannot be used: ") && fault.contains("3D Systems"), "{fault}");
    let (_folder, path) = copy("fake_hd", &["incomplete"]);
    let fault = backend(&path).list().expect_err("it lacks one").to_string();
    assert!(fault.contains("hdBeginFrame"), "{fault}");
}

#[test]
fn what_is_not_plugged_in_is_not_listed() {
    let fake = fake();
    fake.set(PLUGGED, 2.0);
    let mut backend = backend(&fake.path);
    assert_eq!(backend.list().expect("the library").len(), 1);
    let fault = backend.open("openhaptics:default").err().expect("not there").to_string();
    assert!(
        fault.contains("openhaptics:default is gone: the device does not answer") && fault.contains("HD_COMM"),
        "{fault}"
    );
    let fault = backend.open("openhaptics:Right Device").err().expect("not named").to_string();
    assert!(fault.ends_with("there are: openhaptics:default, openhaptics:Left Device"), "{fault}");
}

#[test]
fn every_family_of_errors_says_what_it_is() {
    for (code, said) in [
        (0x0100, "does not know"),
        (0x0104, "does not know"),
        (0x0300, "does not answer"),
        (0x0302, "does not answer"),
        (0x0400, "out of order"),
        (0x0401, "out of order"),
        (0x0501, "no place"),
        (0x0600, "no licence"),
        (0x7777, "reports an error"),
    ] {
        for at in [INIT_ERROR, SCHEDULE_ERROR, FRAME_ERROR] {
            let fake = fake();
            let mut backend = backend(&fake.path);
            let fault = if at == FRAME_ERROR {
                let mut device = backend.open("default").expect("it opens");
                state(&mut *device);
                fake.set(at, f64::from(code));
                wait_for("the fault", || device.read().err())
            } else {
                fake.set(at, f64::from(code));
                backend.open("default").err().expect("it fails")
            };
            assert!(fault.is_over(), "{code:#x}: {fault}");
            let text = fault.to_string();
            assert!(text.contains(said) && text.contains(&format!("{code:#06x}")), "{code:#x} at {at}: {text}");
            drop(backend);
            closed_cleanly(&fake);
        }
    }
}

#[test]
fn warm_motors_and_their_like_are_warnings() {
    let fake = fake();
    let mut device = backend(&fake.path).open("default").expect("it opens");
    state(&mut *device);
    for (code, said) in
        [(0x0200, "warm"), (0x0201, "too great"), (0x0202, "quickly"), (0x0203, "too fast"), (0x0204, "put out")]
    {
        fake.set(FRAME_ERROR, f64::from(code));
        let warning = wait_for("the warning", || push(&mut *device, DVec3::X).err());
        assert!(!warning.is_over() && warning.to_string().contains(said), "{warning}");
        device.read().expect("it goes on");
    }
}

#[test]
fn calibration_is_done_or_asked_for() {
    let fake = fake();
    fake.set(CALIBRATION, NEEDS_UPDATE);
    fake.set(CALIBRATION_AFTER_UPDATE, OK);
    fake.set(STYLE, 6.0);
    let mut backend = backend(&fake.path);
    let mut device = backend.open("default").expect("it opens");
    state(&mut *device);
    assert_eq!((fake.get(UPDATES), fake.get(LAST_STYLE)), (1.0, 2.0), "by itself where it can");
    drop(device);
    for (style, said) in [(4.0, "inkwell"), (1.0, "still")] {
        fake.set(CALIBRATION, NEEDS_HAND);
        fake.set(STYLE, style);
        let mut device = backend.open("default").expect("it opens");
        let fault =
            wait_for("the fault", || device.read().err().filter(|f| matches!(f, DeviceFault::Uncalibrated { .. })));
        assert!(!fault.is_over() && fault.to_string().contains(said), "{fault}");
        for _ in 0..20 {
            let _ = push(&mut *device, DVec3::X);
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(fake.force(0), [0.0; 3], "no force before");
        fake.set(CALIBRATION, OK);
        state(&mut *device);
        wait_for("the force", || {
            push(&mut *device, DVec3::X).expect("written");
            (fake.force(0)[0] == 1.0).then_some(())
        });
    }
    closed_cleanly(&fake);
}

#[test]
fn what_is_unplugged_in_the_middle_is_taken_up_again() {
    let fake = fake();
    let backends: Vec<Box<dyn DeviceBackend>> = vec![Box::new(backend(&fake.path))];
    let manager = DeviceManager::new(backends, Duration::from_millis(10)).expect("a thread");
    let mut device = manager.open("openhaptics:default").expect("it opens");
    let mut other = manager.open("openhaptics:Left Device").expect("it opens");
    state(&mut device);
    state(&mut other);
    fake.set(PLUGGED, 2.0);
    wait_for("the loss", || device.read().err().filter(|fault| matches!(fault, DeviceFault::Away { .. })));
    state(&mut other);
    fake.set(PLUGGED, 3.0);
    state(&mut device);
    wait_for("the force", || {
        let _ = push(&mut device, DVec3::X);
        (fake.force(0)[0] == 1.0).then_some(())
    });
    let news = wait_for("the news", || Some(manager.news()).filter(|news| !news.is_empty()));
    assert!(matches!(&news[..], [DeviceNews::Lost { .. }, DeviceNews::Found { .. }]), "{news:?}");
    drop((device, other));
    closed_cleanly(&fake);
}
