//! The keeper of all devices: lists, opens, loses and finds.

use super::wait_for;
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceManager, DeviceNews, DeviceOutput, DeviceSample, HapticDevice,
    NoBackend, NoDevice,
};
use glam::DVec3;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A service whose devices come and go.
#[derive(Default)]
struct Plugs {
    /// Whether the service runs.
    runs: bool,
    plugged: Vec<&'static str>,
    /// How often devices were opened, and closed.
    opened: usize,
    closed: usize,
    force_n: DVec3,
}

type Shared = Arc<Mutex<Plugs>>;

struct TestBackend(Shared);

struct TestDevice(Shared, DeviceInfo);

fn info(serial: &str) -> DeviceInfo {
    DeviceInfo { id: format!("test:{serial}"), ..NoDevice::default().info().clone() }
}

impl DeviceBackend for TestBackend {
    fn name(&self) -> &'static str {
        "test"
    }

    fn list(&mut self) -> Result<Vec<DeviceInfo>, DeviceFault> {
        let plugs = self.0.lock().expect("unharmed");
        if !plugs.runs {
            let reason = "connection refused".into();
            return Err(DeviceFault::Service { service: "the test".into(), address: "here".into(), reason });
        }
        Ok(plugs.plugged.iter().map(|serial| info(serial)).collect())
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let found = self.list()?.into_iter().find(|info| info.id == id);
        let info = found.ok_or(DeviceFault::NotFound { id: id.into(), there: String::new() })?;
        self.0.lock().expect("unharmed").opened += 1;
        Ok(Box::new(TestDevice(self.0.clone(), info)))
    }
}

impl HapticDevice for TestDevice {
    fn info(&self) -> &DeviceInfo {
        &self.1
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let plugs = self.0.lock().expect("unharmed");
        if plugs.plugged.iter().any(|serial| self.1.id.ends_with(serial)) {
            return Ok(DeviceSample::default());
        }
        Err(DeviceFault::Gone { id: self.1.id.clone(), reason: "unplugged".into() })
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        self.0.lock().expect("unharmed").force_n = output.force_n;
        Ok(())
    }
}

impl Drop for TestDevice {
    fn drop(&mut self) {
        self.0.lock().expect("unharmed").closed += 1;
    }
}

fn manager(plugged: &[&'static str]) -> (DeviceManager, Shared) {
    let plugs = Shared::default();
    plugs.lock().expect("unharmed").runs = true;
    plugs.lock().expect("unharmed").plugged = plugged.to_vec();
    let backends: Vec<Box<dyn DeviceBackend>> = vec![Box::new(NoBackend), Box::new(TestBackend(plugs.clone()))];
    (DeviceManager::new(backends, Duration::from_millis(5)).expect("a thread"), plugs)
}

fn ids(manager: &DeviceManager) -> Vec<String> {
    manager.list().into_iter().map(|info| info.id).collect()
}

#[test]
fn a_missing_service_is_told_once_and_the_rest_goes_on() {
    let (manager, plugs) = manager(&["A14"]);
    plugs.lock().expect("unharmed").runs = false;
    for _ in 0..3 {
        assert_eq!(ids(&manager), ["none:none"]);
    }
    let news = manager.news();
    assert_eq!(news.len(), 1, "{news:?}");
    assert_eq!(news[0].to_string(), "no test devices: the test does not answer at here: connection refused");
    assert!(matches!(manager.open("test:A14").err(), Some(DeviceFault::Service { .. })));
    plugs.lock().expect("unharmed").runs = true;
    assert_eq!(ids(&manager), ["none:none", "test:A14"]);
    assert_eq!(manager.news(), [DeviceNews::BackendFound { backend: "test".into() }]);
}

#[test]
fn a_wrong_id_is_answered_with_the_nearest() {
    let (manager, _plugs) = manager(&["B77", "A14"]);
    let fault = |id: &str| manager.open(id).err().expect("wrong").to_string();
    assert!(
        fault("test:A41").starts_with("there is no device test:A41; there are: test:A14 (did you mean this one?), ")
    );
    assert!(fault("tset:B77").contains("there are: test:B77 (did you mean this one?), "), "{}", fault("tset:B77"));
    assert!(!fault("zzzzzzzzz").contains("did you mean"));
    assert_eq!(manager.open("test").expect("its first").info().id, "test:B77");
    assert_eq!(manager.open("none").expect("its only").info().id, "none:none");
}

#[test]
fn what_is_unplugged_is_taken_up_again() {
    let (manager, plugs) = manager(&["A14", "B77"]);
    let mut device = manager.open("test:A14").expect("it opens");
    let mut other = manager.open("test:B77").expect("it opens");
    for round in 1..=2 {
        device.read().expect("a state");
        plugs.lock().expect("unharmed").plugged.retain(|serial| *serial != "A14");
        let fault = device.read().expect_err("it is gone");
        assert!(matches!(fault, DeviceFault::Away { .. }) && !fault.is_over(), "{fault:?}");
        let news = wait_for("the loss", || Some(manager.news()).filter(|news| !news.is_empty()));
        assert_eq!(news.len(), 1, "{news:?}");
        assert_eq!(news[0].to_string(), "test:A14 is gone: unplugged; looking for test:A14 until it is back");
        std::thread::sleep(Duration::from_millis(30));
        assert!(device.write(&DeviceOutput::default()).is_err(), "still away");
        assert_eq!(manager.news(), [], "said once");
        other.read().expect("the other one goes on");
        plugs.lock().expect("unharmed").plugged.push("A14");
        wait_for("the device", || device.read().ok());
        let news = wait_for("the find", || Some(manager.news()).filter(|news| !news.is_empty()));
        assert_eq!(news, [DeviceNews::Found { id: "test:A14".into() }]);
        device.write(&DeviceOutput { force_n: DVec3::X * round as f64, ..DeviceOutput::default() }).expect("written");
        assert_eq!(plugs.lock().expect("unharmed").force_n.x, round as f64, "the force reaches the new one");
    }
    drop((device, other, manager));
    let plugs = plugs.lock().expect("unharmed");
    assert_eq!((plugs.opened, plugs.closed), (4, 4), "nothing is left open");
}

#[test]
fn nobody_looks_for_what_nobody_waits_for() {
    let (manager, plugs) = manager(&["A14"]);
    let mut device = manager.open("test:A14").expect("it opens");
    plugs.lock().expect("unharmed").plugged.clear();
    device.read().expect_err("it is gone");
    drop(device);
    plugs.lock().expect("unharmed").plugged.push("A14");
    std::thread::sleep(Duration::from_millis(40));
    assert_eq!(plugs.lock().expect("unharmed").opened, 1);
    assert!(!manager.news().iter().any(|news| matches!(news, DeviceNews::Found { .. })));
}

#[test]
fn a_device_outlives_its_manager() {
    let (manager, plugs) = manager(&["A14"]);
    let mut device = manager.open("test:A14").expect("it opens");
    drop(manager);
    plugs.lock().expect("unharmed").plugged.clear();
    device.read().expect_err("it is gone");
    plugs.lock().expect("unharmed").plugged.push("A14");
    wait_for("the device", || device.read().ok());
}

#[test]
fn all_backends_of_this_build_are_listed_without_hardware() {
    let manager = DeviceManager::new(DeviceManager::backends(), Duration::from_secs(1)).expect("a thread");
    let listed = ids(&manager);
    for id in ["none:none", "hand:mouse", "hand:gamepad", "simulated:touch"] {
        assert!(listed.iter().any(|listed| listed == id), "{id} is not among {listed:?}");
    }
    let first = manager.news();
    manager.list();
    assert_eq!(manager.news(), [], "what is missing was told once: {first:?}");
}
