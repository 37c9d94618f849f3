//! Haply's devices, against a counterpart of the service.

use super::haply_service::{Service, arm};
use super::wait_for;
use bevy_surgery::haptics::device::haply::{HaplyBackend, HaplyFormat, HaplySettings};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceKind, DeviceManager, DeviceNews, DeviceOutput, DeviceSample, HapticDevice,
};
use glam::{DQuat, DVec3};
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tungstenite::Message;

fn settings(service: &Service) -> HaplySettings {
    HaplySettings { host: "127.0.0.1".into(), port: service.port, lost_after_s: 0.4, ..HaplySettings::default() }
}

fn backend(service: &Service) -> HaplyBackend {
    HaplyBackend::new(settings(service))
}

fn one_arm() -> Value {
    json!({ "session_id": 1, "inverse3": [arm("A14", json!("inverse3"), [0.01, 0.02, 0.03])] })
}

fn state(device: &mut dyn HapticDevice) -> DeviceSample {
    wait_for("a state", || device.read().ok())
}

fn push(device: &mut dyn HapticDevice, force_n: DVec3) -> Result<(), DeviceFault> {
    device.write(&DeviceOutput { force_n, ..DeviceOutput::default() })
}

fn ids(backend: &mut HaplyBackend) -> Vec<String> {
    backend.list().expect("the service").into_iter().map(|info| info.id).collect()
}

#[test]
fn states_and_forces_are_turned_into_the_space_of_all_devices() {
    let service = Service::new(Some("3.5.1"), one_arm());
    let mut backend = backend(&service);
    assert_eq!(ids(&mut backend), ["haply:A14"]);
    let mut device = backend.open("haply:A14").expect("it opens");
    assert_eq!((device.info().kind, device.info().name.as_str()), (DeviceKind::Haply, "Haply Inverse3"));
    let sample = state(&mut *device);
    // X stays, the service's up is our Y, its away is our minus Z.
    assert!(sample.position_m.distance(DVec3::new(0.01, 0.03, -0.02)) < 1e-12, "{sample:?}");
    assert!(sample.velocity_m_per_s.expect("known").distance(DVec3::new(0.1, 0.3, -0.2)) < 1e-12);
    let told = wait_for("the force", || {
        push(&mut *device, DVec3::new(1.0, 2.0, -0.5)).expect("written");
        service.last_force("A14").filter(|(_, force)| force[0] != 0.0)
    });
    assert_eq!(told.0, "vector");
    assert!(DVec3::from_array(told.1).distance(DVec3::new(1.0, 0.5, 2.0)) < 1e-12, "{told:?}");
    let world = service.world();
    let profiles =
        world.received.iter().filter(|message| message["session"]["configure"]["profile"].is_object()).count();
    let presets = world.received.iter().filter(|message| message["inverse3"][0]["configure"].is_object());
    let presets: Vec<_> = presets.map(|message| message["inverse3"][0]["configure"].to_string()).collect();
    assert_eq!(profiles, 1, "said once");
    assert_eq!(presets, [r#"{"preset":{"preset":"arm_front_centered"}}"#]);
}

#[test]
fn services_before_3_5_are_told_values_and_nothing_that_they_do_not_know() {
    for version in [None, Some("3.4.9"), Some("2.1")] {
        let service = Service::new(version, one_arm());
        let mut device = backend(&service).open("A14").expect("it opens");
        let middle = HaplySettings::default().middle_before_3_5_m;
        let place = DVec3::new(0.01, 0.03 - middle.z, -0.02 + middle.y);
        assert!(state(&mut *device).position_m.distance(place) < 1e-12);
        let told = wait_for("the force", || {
            push(&mut *device, DVec3::X).expect("written");
            service.last_force("A14").filter(|(_, force)| force[0] != 0.0)
        });
        assert_eq!(told.0, "values");
        let text = format!("{:?}", service.world().received);
        assert!(!text.contains("configure") && !text.contains("execute"), "{text}");
    }
    let service = Service::new(None, one_arm());
    let settings = HaplySettings { format: HaplyFormat::Vector, ..settings(&service) };
    let _device = HaplyBackend::new(settings).open("A14").expect("it opens");
    let told = wait_for("a force", || service.last_force("A14"));
    assert_eq!(told, ("vector".into(), [0.0; 3]), "as it was set");
}

#[test]
fn without_an_open_device_the_line_is_kept_open_by_nothing() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let mut backend = backend(&service);
    backend.list().expect("the service");
    wait_for("messages", || (service.world().received.len() > 5).then_some(()));
    assert!(service.world().received[1..].iter().all(|message| *message == json!({})));
}

#[test]
fn a_force_ends_with_its_time_and_with_its_device() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let mut backend = backend(&service);
    let mut device = backend.open("haply:A14").expect("it opens");
    state(&mut *device);
    let is_pushed = |pushed| move |(_, force): &(_, [f64; 3])| (force[0] != 0.0) == pushed;
    wait_for("the force", || {
        push(&mut *device, DVec3::X * 100.0).expect("written");
        service.last_force("A14").filter(is_pushed(true))
    });
    assert!(service.last_force("A14").expect("told").1[0] <= device.info().limits.max_force_n, "limited");
    wait_for("no force after a silence", || service.last_force("A14").filter(is_pushed(false)));
    push(&mut *device, DVec3::NAN).expect("taken for none");
    wait_for("the force", || {
        push(&mut *device, DVec3::X).expect("written");
        service.last_force("A14").filter(is_pushed(true))
    });
    drop(device);
    // On a busy machine a drop does not wait until the service has been told.
    wait_for("no force after the drop", || service.last_force("A14").filter(is_pushed(false)));
    drop(backend);
}

#[test]
fn two_arms_and_their_grips() {
    let grip = |id: &str, [x, y, z, w]: [f64; 4], buttons: Value| {
        let orientation = json!({ "x": x, "y": y, "z": z, "w": w });
        json!({ "device_id": id, "state": { "orientation": orientation, "buttons": buttons, "hall": 3, "battery_level": 0.5 } })
    };
    let half = 0.5_f64.sqrt();
    let first = grip("G1", [0.0, 0.0, half, half], json!({ "a": true, "b": false, "c": 1, "long": true }));
    let frame = json!({
        "inverse3": [arm("A14", json!(4), [0.0; 3]), arm("B77", json!(6), [0.1, 0.0, 0.0])],
        "wireless_verse_grip": [first],
        "custom_verse_grip": [first, grip("G2", [0.0, 0.0, 0.0, 1.0], json!({ "b": true }))],
        "verse_grip": null,
    });
    let service = Service::new(Some("3.5.0"), frame);
    let mut backend = backend(&service);
    let listed = wait_for("both with grips", || {
        backend.list().ok().filter(|list| list.len() == 2 && list.iter().all(|info| info.has_rotation))
    });
    assert_eq!((listed[0].name.as_str(), listed[1].name.as_str()), ("Haply Inverse3", "Haply Minverse"));
    assert_eq!(listed[1].limits.workspace_radius_m, 0.04);
    let (mut a, mut b) = (backend.open("haply:A14").expect("it opens"), backend.open("haply:B77").expect("it opens"));
    let (sample, other) = (state(&mut *a), state(&mut *b));
    assert_eq!((sample.buttons, other.buttons), (0b101, 0b010));
    assert!((other.position_m.x - 0.1).abs() < 1e-12);
    // A quarter about the service's up is a quarter about ours; the grip then points to the left.
    assert!(sample.device_from_handle.angle_between(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2)) < 1e-6);
    assert!((sample.device_from_handle * DVec3::NEG_Z).distance(DVec3::NEG_X) < 1e-6);
    assert!(other.device_from_handle.angle_between(DQuat::IDENTITY) < 1e-6);
    wait_for("both forces", || {
        push(&mut *a, DVec3::X).expect("written");
        push(&mut *b, DVec3::X * 2.0).expect("written");
        let (a, b) = (service.last_force("A14")?, service.last_force("B77")?);
        ((a.1[0] - 1.0).abs() < 1e-9 && (b.1[0] - 2.0).abs() < 1e-9).then_some(())
    });
    let settings = HaplySettings { grips: vec![("A14".into(), "G2".into())], ..settings(&service) };
    let mut other_way = HaplyBackend::new(settings);
    let mut a = other_way.open("A14").expect("it opens");
    let mut b = other_way.open("B77").expect("it opens");
    wait_for("the other pairs", || (state(&mut *a).buttons == 0b010 && state(&mut *b).buttons == 0b101).then_some(()));
}

#[test]
fn an_only_grip_belongs_to_the_only_open_arm() {
    let grip =
        json!({ "device_id": 61576, "state": { "orientation": { "x": 1, "y": 0, "z": 0, "w": 0 }, "button": true } });
    let arms = json!([arm("A14", json!(4), [0.0; 3]), arm("B77", json!(4), [0.0; 3])]);
    let service = Service::new(None, json!({ "inverse3": arms, "verse_grip": grip }));
    let mut device = backend(&service).open("B77").expect("it opens");
    wait_for("the button of an old grip", || (state(&mut *device).buttons == 1).then_some(()));
}

#[test]
fn what_is_wrong_in_a_message_is_left_out() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    state(&mut *device);
    let texts = [
        "",
        "{",
        "[]",
        "null",
        "garbage \u{1f600}",
        r#"{"inverse3":"none"}"#,
        r#"{"inverse3":[{"state":{}}, 7, null]}"#,
        r#"{"inverse3":[{"device_id":"A14"}]}"#,
        r#"{"inverse3":[{"device_id":"A14","state":[1,2]}]}"#,
        r#"{"inverse3":[{"device_id":"A14","state":{"cursor_position":{"x":1}},"status":7}]}"#,
        r#"{"inverse3":[{"device_id":{},"state":{"cursor_position":{"x":9,"y":9,"z":9}}}]}"#,
        r#"{"verse_grip":[{"device_id":"G","state":{"orientation":{"x":0,"y":0,"z":0,"w":0},"buttons":[true]}}]}"#,
    ];
    let mut raw: Vec<Message> = texts.iter().map(|text| Message::text(*text)).collect();
    raw.extend([Message::binary(vec![1, 2, 3]), Message::Ping(vec![1].into()), Message::text("{\"x\":".repeat(2000))]);
    service.world().raw.extend(raw);
    while !service.world().raw.is_empty() {
        let sample = device.read().expect("the last good state goes on");
        assert!(sample.position_m.distance(DVec3::new(0.01, 0.03, -0.02)) < 1e-12 && sample.is_valid(), "{sample:?}");
    }
    let before_s = state(&mut *device).time_s;
    wait_for("a newer state", || (state(&mut *device).time_s > before_s).then_some(()));
}

#[test]
fn what_speaks_only_garbage_is_not_the_service() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    service.world().frame = json!("garbage");
    let fault = wait_for("the end", || device.read().err().filter(DeviceFault::is_over));
    assert!(fault.to_string().contains("haply:A14 is gone: "), "{fault}");
}

#[test]
fn messages_may_come_in_pieces() {
    let service = Service::new(Some("3.5.0"), one_arm());
    service.world().in_pieces = true;
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    let first_s = state(&mut *device).time_s;
    service.world().frame = json!({ "inverse3": arm("A14", json!(4), [0.5, 0.0, 0.0]) });
    let sample =
        wait_for("what is new", || device.read().ok().filter(|sample| (sample.position_m.x - 0.5).abs() < 1e-12));
    assert!(sample.time_s > first_s);
}

#[test]
fn a_slow_service_does_not_stop_the_loop() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    state(&mut *device);
    service.world().delay = Duration::from_millis(150);
    let begun = Instant::now();
    let mut longest = Duration::ZERO;
    while begun.elapsed() < Duration::from_millis(600) {
        let tick = Instant::now();
        device.read().expect("the last state");
        push(&mut *device, DVec3::X).expect("written");
        longest = longest.max(tick.elapsed());
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(longest < Duration::from_millis(100), "a tick waited {longest:?} for a service that takes 150 ms");
}

#[test]
fn an_uncalibrated_arm_says_what_to_do_and_is_not_pushed() {
    let mut frame = one_arm();
    frame["inverse3"][0]["status"]["calibrated"] = json!(false);
    let service = Service::new(Some("3.5.0"), frame);
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    let fault = wait_for("the fault", || device.read().err().filter(|f| matches!(f, DeviceFault::Uncalibrated { .. })));
    assert!(!fault.is_over() && fault.to_string().starts_with("haply:A14 is not calibrated: "), "{fault}");
    for _ in 0..50 {
        let _ = push(&mut *device, DVec3::X);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(service.last_force("A14").expect("told").1, [0.0; 3]);
    service.world().frame = one_arm();
    wait_for("the force", || {
        let _ = push(&mut *device, DVec3::X);
        service.last_force("A14").filter(|(_, force)| force[0] > 0.99)
    });
    state(&mut *device);
}

#[test]
fn no_power_is_a_warning() {
    let mut frame = one_arm();
    frame["inverse3"][0]["status"]["power_supply"] = json!(false);
    let service = Service::new(Some("3.5.0"), frame);
    let mut device = backend(&service).open("haply:A14").expect("it opens");
    state(&mut *device);
    let warning = wait_for("the warning", || push(&mut *device, DVec3::X).err());
    assert!(matches!(&warning, DeviceFault::Warning { reason, .. } if reason.contains("power")), "{warning}");
    push(&mut *device, DVec3::X).expect("said once");
}

#[test]
fn without_a_service_there_is_one_clear_message() {
    let service = Service::new(None, one_arm());
    let settings = settings(&service);
    drop(service);
    let port = settings.port;
    let fault = HaplyBackend::new(settings).list().expect_err("no service").to_string();
    let wanted = format!("Haply's service does not answer at ws://127.0.0.1:{port}: ");
    assert!(fault.starts_with(&wanted), "{fault}");
}

#[test]
fn an_arm_that_is_unplugged_is_gone_and_the_other_goes_on() {
    let arms = json!([arm("A14", json!(4), [0.0; 3]), arm("B77", json!(4), [0.0; 3])]);
    let service = Service::new(Some("3.5.0"), json!({ "inverse3": arms }));
    let mut backend = backend(&service);
    let (mut a, mut b) = (backend.open("haply:A14").expect("it opens"), backend.open("haply:B77").expect("it opens"));
    state(&mut *a);
    state(&mut *b);
    service.world().frame = json!({ "inverse3": [arms[1]] });
    let fault = wait_for("the loss", || a.read().err().filter(DeviceFault::is_over));
    assert!(matches!(&fault, DeviceFault::Gone { id, .. } if id == "haply:A14"), "{fault}");
    b.read().expect("the other one goes on");
    assert_eq!(ids(&mut backend), ["haply:B77"]);
    let missing = backend.open("haply:A14").err().expect("not there").to_string();
    assert_eq!(missing, "there is no device haply:A14; there are: haply:B77");
    service.world().frame = json!({ "inverse3": arms });
    wait_for("both", || (ids(&mut backend).len() == 2).then_some(()));
    let mut again = backend.open("haply:A14").expect("it opens");
    state(&mut *again);
}

#[test]
fn a_service_that_ends_and_comes_back_is_taken_up_again() {
    let service = Service::new(Some("3.5.0"), one_arm());
    let settings = settings(&service);
    let backends: Vec<Box<dyn DeviceBackend>> = vec![Box::new(HaplyBackend::new(settings.clone()))];
    let manager = DeviceManager::new(backends, Duration::from_millis(20)).expect("a thread");
    let mut device = manager.open("haply:A14").expect("it opens");
    state(&mut device);
    drop(service);
    wait_for("the loss", || device.read().err().filter(|fault| matches!(fault, DeviceFault::Away { .. })));
    let service = Service::at(settings.port, Some("3.5.0"), one_arm());
    state(&mut device);
    wait_for("the force", || {
        let _ = push(&mut device, DVec3::X);
        service.last_force("A14").filter(|(_, force)| force[0] > 0.99)
    });
    let news = manager.news();
    assert!(matches!(&news[..], [DeviceNews::Lost { .. }, DeviceNews::Found { .. }]), "{news:?}");
}

#[test]
fn a_service_that_falls_silent_or_hangs_up_is_gone() {
    for is_silent in [true, false] {
        let service = Service::new(Some("3.5.0"), one_arm());
        let mut device = backend(&service).open("haply:A14").expect("it opens");
        state(&mut *device);
        service.world().is_silent = is_silent;
        service.world().hangs_up = !is_silent;
        wait_for("the loss", || device.read().err().filter(DeviceFault::is_over));
    }
}
