//! A gamepad holds a tool: its sticks say how fast the hand moves, and it rumbles with the force.

use crate::haptics::device::DeviceSample;
use crate::tools::session::Devices;
use bevy::input::gamepad::{GamepadRumbleIntensity, GamepadRumbleRequest};
use bevy::math::{DQuat, DVec3, EulerRot};
use bevy::prelude::*;
use std::time::Duration;

/// How a gamepad moves a hand. Left stick: right and up; right stick up and down: away and near; cross right and left, up and
/// down: turn the tool. The right trigger is the first pedal, the left one the second; the lower face button is the first button,
/// the right one the second, the left shoulder the clutch.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct GamepadHand {
    /// Speed of the hand with a stick fully out, metres per second at the hand.
    pub speed_m_per_s: f64,
    /// How fast the cross turns the tool, radians per second.
    pub turn_rad_per_s: f64,
    /// How far the hand gets from the middle, metres.
    pub reach_m: f64,
    /// Force at which it rumbles at its full, newtons.
    pub full_rumble_n: f64,
    /// Yaw and pitch so far, radians.
    pub turned_rad: [f64; 2],
}

impl Default for GamepadHand {
    fn default() -> Self {
        Self { speed_m_per_s: 0.04, turn_rad_per_s: 0.8, reach_m: 0.1, full_rumble_n: 3.0, turned_rad: [0.0; 2] }
    }
}

/// How long a rumble is asked for, and how much sooner anew; nothing has to be stopped when a program ends.
const RUMBLE: Duration = Duration::from_millis(100);
const RUMBLE_AGAIN_S: f32 = 0.05;

pub(super) fn move_hand(
    gamepads: Query<&Gamepad>,
    mut settings: ResMut<GamepadHand>,
    devices: Res<Devices>,
    time: Res<Time<Real>>,
) {
    let Some(gamepad) = gamepads.iter().next() else { return };
    let dt_s = time.delta_secs_f64().min(0.1);
    let before = devices.gamepad.sample();
    let (left, right) = (gamepad.left_stick().as_dvec2(), gamepad.right_stick().as_dvec2());
    // Squared, so that small motions are fine ones.
    let way = DVec3::new(left.x * left.x.abs(), left.y * left.y.abs(), -right.y * right.y.abs());
    let to_m = before.position_m + way * (settings.speed_m_per_s * dt_s);
    let down = |button| f64::from(u8::from(gamepad.pressed(button)));
    let turn = [
        down(GamepadButton::DPadLeft) - down(GamepadButton::DPadRight),
        down(GamepadButton::DPadUp) - down(GamepadButton::DPadDown),
    ];
    let turn_rad = settings.turn_rad_per_s * dt_s;
    if turn != [0.0; 2] {
        settings.turned_rad =
            std::array::from_fn(|axis| (settings.turned_rad[axis] + turn[axis] * turn_rad).clamp(-1.5, 1.5));
    }
    let [yaw_rad, pitch_rad] = settings.turned_rad;
    let buttons = [GamepadButton::South, GamepadButton::East, GamepadButton::LeftTrigger, GamepadButton::RightTrigger];
    let pressed = buttons.iter().enumerate().map(|(bit, button)| u32::from(gamepad.pressed(*button)) << bit).sum();
    let trigger = |button: GamepadButton| gamepad.get(button).unwrap_or(0.0).clamp(0.0, 1.0);
    devices.gamepad.set(DeviceSample {
        position_m: to_m.clamp_length_max(settings.reach_m.max(0.0)),
        device_from_handle: DQuat::from_euler(EulerRot::YXZ, yaw_rad, pitch_rad, 0.0),
        buttons: pressed,
        axes: [trigger(GamepadButton::RightTrigger2), trigger(GamepadButton::LeftTrigger2)],
        ..before
    });
}

/// Rumbles with what the hand would feel.
pub(super) fn rumble(
    gamepads: Query<Entity, With<Gamepad>>,
    settings: Res<GamepadHand>,
    devices: Res<Devices>,
    time: Res<Time<Real>>,
    mut last: Local<Option<(f32, f32)>>,
    mut requests: MessageWriter<GamepadRumbleRequest>,
) {
    let Some(gamepad) = gamepads.iter().next() else { return };
    let (now_s, strength) = (time.elapsed_secs(), devices.gamepad.rumble(settings.full_rumble_n));
    let is_due = last.is_none_or(|(at_s, before)| now_s - at_s > RUMBLE_AGAIN_S || (before - strength).abs() > 0.2);
    let was_on = last.is_some_and(|(_, before)| before > 0.0);
    if !is_due || !(strength > 0.0 || was_on) {
        return;
    }
    *last = Some((now_s, strength));
    requests.write(GamepadRumbleRequest::Stop { gamepad });
    if strength > 0.0 {
        // Fine and quick for the force itself; the heavy motor only when it is strong.
        let intensity = GamepadRumbleIntensity { weak_motor: strength, strong_motor: (2.0 * strength - 1.0).max(0.0) };
        requests.write(GamepadRumbleRequest::Add { duration: RUMBLE, intensity, gamepad });
    }
}
