//! Devices by name.

use super::*;
use bevy_surgery::haptics::device::{DeviceFault, DeviceSample};
use bevy_surgery::tools::{DeviceRefused, Devices, HoldDevice, ServoSession};

fn with_devices() -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    app.insert_resource(Devices::new().expect("a thread"));
    let tool = app.world_mut().spawn((Tool::new(ToolKind::Probe), HoldDevice::new("hand:mouse"))).id();
    (app, tool)
}

#[test]
fn a_hand_of_the_program_moves_a_tool() {
    let (mut app, tool) = with_devices();
    app.idle_until("the device", |app| app.world().get::<ServoSession>(tool).is_some());
    assert!(app.world().get::<ServoSession>(tool).expect("a session").is_threaded());
    let mouse = app.world().resource::<Devices>().mouse.clone();
    let wanted = DVec3::new(0.01, -0.02, 0.03);
    mouse.set(DeviceSample { position_m: wanted, buttons: 1, ..default() });
    let started = std::time::Instant::now();
    loop {
        app.step(1);
        let is_there = motion(&app, tool).to.is_some_and(|to| to.tip_in_world_m.as_dvec3().distance(wanted) < 1e-6);
        let is_down = app.world().get::<ToolCommand>(tool).is_some_and(|command| command.pedal == 1.0);
        if is_there && is_down {
            break;
        }
        assert!(started.elapsed().as_secs() < 60, "waited a minute for the tool to follow the hand");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    // Without the device the tool is put down.
    app.world_mut().entity_mut(tool).remove::<HoldDevice>();
    assert!(app.world().get::<ServoSession>(tool).is_none());
}

#[test]
fn a_device_that_is_not_there_is_refused_with_a_name_and_the_app_goes_on() {
    let (mut app, tool) = with_devices();
    app.world_mut().entity_mut(tool).insert(HoldDevice::new("hand:mosue"));
    app.idle_until("an answer", |app| app.world().get::<DeviceRefused>(tool).is_some());
    let DeviceRefused(fault) = app.world().get::<DeviceRefused>(tool).expect("refused");
    assert!(matches!(fault, DeviceFault::NotFound { .. }));
    assert!(fault.to_string().contains("hand:mouse (did you mean this one?)"), "{fault}");
    app.step(5);
    assert!(app.world().get::<ServoSession>(tool).is_none());
    // Another choice is taken.
    app.world_mut().entity_mut(tool).insert(HoldDevice::new("hand:gamepad"));
    app.idle_until("the device", |app| app.world().get::<ServoSession>(tool).is_some());
    assert_eq!(app.world().get::<ServoSession>(tool).expect("a session").device().id, "hand:gamepad");
    assert!(app.world().get::<DeviceRefused>(tool).is_none());
}

/// A gamepad that is told of as a driver would.
#[cfg(feature = "render")]
#[test]
fn a_gamepad_moves_its_hand_and_rumbles() {
    use bevy::input::InputPlugin;
    use bevy::input::gamepad::{
        GamepadAxis, GamepadButton, GamepadConnection, GamepadConnectionEvent, GamepadRumbleRequest,
        RawGamepadAxisChangedEvent, RawGamepadButtonChangedEvent, RawGamepadEvent,
    };
    use bevy_surgery::haptics::device::hand::HandDevice;
    use bevy_surgery::haptics::device::{DeviceKind, DeviceOutput, HapticDevice};
    let mut app = TestApp::cpu();
    app.add_plugins(InputPlugin);
    let devices = Devices::new().expect("a thread");
    let hand = devices.gamepad.clone();
    app.insert_resource(devices);
    let gamepad = app.world_mut().spawn_empty().id();
    let connection = GamepadConnection::Connected { name: "pad".into(), vendor_id: None, product_id: None };
    let tell = |app: &mut TestApp, event: RawGamepadEvent| {
        app.world_mut().write_message(event);
    };
    app.world_mut().write_message(GamepadConnectionEvent::new(gamepad, connection));
    app.idle();
    let axis = |axis, value| RawGamepadEvent::Axis(RawGamepadAxisChangedEvent::new(gamepad, axis, value));
    let button = |button, value| RawGamepadEvent::Button(RawGamepadButtonChangedEvent::new(gamepad, button, value));
    tell(&mut app, axis(GamepadAxis::LeftStickX, 1.0));
    tell(&mut app, axis(GamepadAxis::RightStickY, 1.0));
    tell(&mut app, button(GamepadButton::RightTrigger2, 0.6));
    tell(&mut app, button(GamepadButton::East, 1.0));
    app.step(4);
    let sample = hand.sample();
    // Four steps of a sixtieth at 4 cm/s.
    let expected_m = DVec3::new(1.0, 0.0, -1.0) * (0.04 * 4.0 / 60.0);
    assert!(sample.position_m.distance(expected_m) < 1e-4, "right and away: {}", sample.position_m);
    assert_eq!((sample.buttons, sample.axes[1]), (2, 0.0));
    assert!((sample.axes[0] - 0.6).abs() < 0.05, "{:?}", sample.axes);
    // A force on the hand is a rumble.
    let mut device = HandDevice::new(DeviceKind::Gamepad, "gamepad", hand);
    device.write(&DeviceOutput { rumble: 0.5, ..default() }).expect("a mailbox");
    app.step(1);
    let is_half = |rumble: &GamepadRumbleRequest| matches!(rumble, GamepadRumbleRequest::Add { intensity, .. } if intensity.weak_motor == 0.5);
    assert!(written::<GamepadRumbleRequest>(&app).iter().any(is_half));
}
