//! SpaceMice: their reports byte by byte, and handles that they move.

use super::wait_for;
use bevy_surgery::haptics::device::spacemouse::{
    RateControl, RateHandle, ReportSource, ReportTransport, SpaceMouseBackend, SpaceMouseModel, SpaceMouseReport,
    parse_report,
};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceKind, DeviceManager, DeviceNews, DeviceOutput, HapticDevice,
};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

#[test]
fn reports_are_read_in_all_their_layouts() {
    use SpaceMouseReport::{Buttons, Push, PushAndTurn, Turn};
    for (bytes, report) in [
        // X 350, Y 175, Z -350, little endian: right, half towards the person, up.
        (vec![1, 0x5e, 0x01, 0xaf, 0x00, 0xa2, 0xfe], Push(DVec3::new(1.0, 1.0, 0.5))),
        (vec![2, 0x5e, 0x01, 0xaf, 0x00, 0xa2, 0xfe], Turn(DVec3::new(1.0, 1.0, 0.5))),
        (vec![1, 0x5e, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0xa2, 0xfe], PushAndTurn(DVec3::X, DVec3::Y)),
        // Further than full.
        (vec![1, 0xff, 0x7f, 0x00, 0x80, 0, 0], Push(DVec3::new(1.0, 0.0, -1.0))),
        (vec![3, 0b10], Buttons(2)),
        (vec![3, 1, 0, 0, 0x80], Buttons(0x8000_0001)),
        (vec![3, 1, 2, 3, 4, 5, 6], Buttons(0x0403_0201)),
    ] {
        assert_eq!(parse_report(&bytes), Some(report), "{bytes:?}");
    }
    for bytes in [&[][..], &[1], &[1, 0, 0, 0, 0, 0], &[2, 0], &[3], &[4, 1], &[9, 0, 0, 0, 0, 0, 0]] {
        assert_eq!(parse_report(bytes), None, "{bytes:?}");
    }
}

proptest! {
    #[test]
    fn any_bytes_give_shares_of_full_deflection_or_nothing(bytes in proptest::collection::vec(any::<u8>(), 0..20)) {
        let is_share = |v: DVec3| v.is_finite() && v.abs().max_element() <= 1.0;
        match parse_report(&bytes) {
            Some(SpaceMouseReport::Push(v) | SpaceMouseReport::Turn(v)) => prop_assert!(is_share(v)),
            Some(SpaceMouseReport::PushAndTurn(v, w)) => prop_assert!(is_share(v) && is_share(w)),
            _ => {}
        }
    }
}

#[test]
fn models_are_known_by_their_numbers() {
    assert_eq!(SpaceMouseModel::of(0x046d, 0xc626), Some(SpaceMouseModel::Navigator));
    assert_eq!(SpaceMouseModel::of(0x256f, 0xc633), Some(SpaceMouseModel::Enterprise));
    assert_eq!(SpaceMouseModel::of(0x256f, 0xc626), None, "another maker's number");
}

#[test]
fn deflection_is_speed() {
    let control = RateControl { dead_zone: 0.1, ..RateControl::default() };
    let mut handle = RateHandle::new(control);
    handle.take(SpaceMouseReport::Push(DVec3::new(0.1, -0.05, 0.0)));
    assert_eq!(handle.step(0.1, 0.0).position_m, DVec3::ZERO, "the dead zone");
    handle.take(SpaceMouseReport::Push(DVec3::new(1.0, -0.55, 0.0)));
    let mut sample = handle.step(0.05, 0.0);
    for _ in 0..9 {
        sample = handle.step(0.05, 1.0);
    }
    // Half a second at 0.1 m/s, and at half of it.
    assert!(sample.position_m.distance(DVec3::new(0.05, -0.025, 0.0)) < 1e-9, "{sample:?}");
    assert!(sample.velocity_m_per_s.expect("known").distance(DVec3::new(0.1, -0.05, 0.0)) < 1e-9);
    assert_eq!(sample.time_s, 1.0);
    handle.take(SpaceMouseReport::Turn(DVec3::Y));
    handle.take(SpaceMouseReport::Buttons(3));
    for _ in 0..1000 {
        sample = handle.step(0.01, 2.0);
    }
    assert!((sample.position_m.length() - control.reach_m).abs() < 1e-9, "it ends where its reach ends");
    assert!(sample.device_from_handle.angle_between(DQuat::from_rotation_y(15.0)) < 1e-6, "ten seconds at 1.5 rad/s");
    assert_eq!(sample.buttons, 3);
    assert!(handle.step(f64::NAN, 3.0).is_valid() && handle.step(-1.0, 3.0).is_valid());
}

/// What is plugged in, and what it sends.
#[derive(Default)]
struct Plugs {
    serials: Vec<&'static str>,
    reports: VecDeque<Vec<u8>>,
    refuses: bool,
}

#[derive(Clone)]
struct TestTransport(Arc<Mutex<Plugs>>);

struct TestSource(Arc<Mutex<Plugs>>, String);

impl ReportTransport for TestTransport {
    fn list(&mut self) -> Result<Vec<(String, SpaceMouseModel)>, String> {
        let plugs = self.0.lock().expect("unharmed");
        if plugs.refuses {
            return Err("permission denied".into());
        }
        Ok(plugs.serials.iter().map(|serial| ((*serial).into(), SpaceMouseModel::Compact)).collect())
    }

    fn open(&mut self, serial: &str) -> Result<Box<dyn ReportSource>, String> {
        Ok(Box::new(TestSource(self.0.clone(), serial.into())))
    }
}

impl ReportSource for TestSource {
    fn read(&mut self, bytes: &mut [u8], patience: Duration) -> Result<usize, String> {
        std::thread::sleep(patience / 4);
        let mut plugs = self.0.lock().expect("unharmed");
        if !plugs.serials.iter().any(|serial| *serial == self.1) {
            return Err("unplugged".into());
        }
        let Some(report) = plugs.reports.pop_front() else { return Ok(0) };
        bytes[..report.len()].copy_from_slice(&report);
        Ok(report.len())
    }
}

fn backend(serials: &[&'static str]) -> (SpaceMouseBackend<TestTransport>, Arc<Mutex<Plugs>>) {
    let plugs = Arc::new(Mutex::new(Plugs { serials: serials.to_vec(), ..Plugs::default() }));
    (SpaceMouseBackend::new(RateControl::default(), TestTransport(plugs.clone())), plugs)
}

#[test]
fn a_pushed_cap_moves_the_handle_until_it_is_let_go() {
    let (mut backend, plugs) = backend(&["S1", "S2"]);
    let listed: Vec<_> = backend.list().expect("a list").into_iter().map(|info| info.id).collect();
    assert_eq!(listed, ["spacemouse:S1", "spacemouse:S2"]);
    let mut device = backend.open("spacemouse:S1").expect("it opens");
    assert_eq!((device.info().kind, device.info().has_force), (DeviceKind::SpaceMouse, false));
    assert_eq!(device.read().expect("the middle").position_m, DVec3::ZERO);
    device.write(&DeviceOutput { force_n: DVec3::X, ..DeviceOutput::default() }).expect("it feels nothing");
    plugs.lock().expect("unharmed").reports.extend([vec![1, 0x5e, 0x01, 0, 0, 0, 0], vec![3, 1], vec![77, 1, 2]]);
    wait_for("the handle to move", || device.read().ok().filter(|s| s.position_m.x > 0.001 && s.buttons == 1));
    plugs.lock().expect("unharmed").reports.push_back(vec![1, 0, 0, 0, 0, 0, 0]);
    wait_for("the handle to rest", || {
        device.read().ok().filter(|sample| sample.velocity_m_per_s.is_some_and(|v| v.length() == 0.0))
    });
    let fault = backend.open("spacemouse:S3").err().expect("there is none").to_string();
    assert_eq!(fault, "there is no device spacemouse:S3; there are: spacemouse:S1, spacemouse:S2");
    plugs.lock().expect("unharmed").refuses = true;
    let fault = backend.list().expect_err("refused").to_string();
    assert!(fault.ends_with("permission denied"), "{fault}");
}

#[test]
fn what_is_unplugged_is_taken_up_again() {
    let (backend, plugs) = backend(&["S1"]);
    let manager = DeviceManager::new(vec![Box::new(backend)], Duration::from_millis(10)).expect("a thread");
    let mut device = manager.open("spacemouse").expect("its first");
    device.read().expect("a state");
    plugs.lock().expect("unharmed").serials.clear();
    wait_for("the loss", || device.read().err().filter(|fault| matches!(fault, DeviceFault::Away { .. })));
    plugs.lock().expect("unharmed").serials.push("S1");
    wait_for("the return", || device.read().ok());
    let news = wait_for("the news", || Some(manager.news()).filter(|news| !news.is_empty()));
    assert!(matches!(&news[..], [DeviceNews::Lost { .. }, DeviceNews::Found { .. }]), "{news:?}");
}
