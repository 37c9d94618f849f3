//! The mouse holds a tool under its cursor.

use crate::haptics::device::{DeviceKind, DeviceSample};
use crate::organ::OrganPicking;
use crate::tools::session::{Devices, ServoSession};
use crate::tools::{RigFrame, Tool, ToolRig};
use crate::volume::VolumePicking;
use bevy::ecs::system::SystemParam;
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::math::{DQuat, DVec3};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;

/// How the mouse moves a hand. The tool is kept under the cursor, a little over what is there; the left button is the first button and
/// pushes in, the right one the second button, the wheel moves nearer and further, Shift holds the clutch.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct MouseHand {
    /// The tip's surface is held so far over what is under the cursor, scene metres.
    pub hover_m: f32,
    /// How far in the left button pushes from there, scene metres.
    pub push_m: f32,
    /// How far a notch of the wheel moves it, scene metres.
    pub per_notch_m: f32,
    /// How fast the hand goes at most, scene metres per second: a cursor jumps, a hand does not.
    pub most_m_per_s: f32,
    /// How the tool is turned in the device's space: it points along -Z of its own axes.
    pub device_from_handle: Quat,
    /// What the wheel has moved so far, towards the scene, scene metres. A push begins without it.
    pub wheel_m: f32,
}

impl Default for MouseHand {
    /// Held by the right hand, from below.
    fn default() -> Self {
        let device_from_handle = Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.55, -0.5, 0.67).normalize());
        Self { hover_m: 3e-3, push_m: 8e-3, per_notch_m: 1e-3, most_m_per_s: 0.4, device_from_handle, wheel_m: 0.0 }
    }
}

/// What lies under a ray.
#[derive(SystemParam)]
pub(super) struct Under<'w, 's> {
    organs: OrganPicking<'w, 's>,
    volumes: VolumePicking<'w, 's>,
}

impl Under<'_, '_> {
    /// How far away the nearest thing is, metres.
    fn distance_m(&self, ray: Ray3d) -> Option<f32> {
        let organ = self.organs.cast_ray(ray, 10.0).map(|hit| hit.distance_m);
        let volume = self.volumes.cast_ray(ray, 10.0).map(|hit| hit.distance_m);
        organ.into_iter().chain(volume).min_by(f32::total_cmp)
    }
}

pub(super) fn move_hand(
    tools: Query<(&Tool, &ServoSession, &ToolRig)>,
    cameras: Query<(&Camera, &GlobalTransform)>,
    windows: Query<&Window, With<PrimaryWindow>>,
    buttons: Res<ButtonInput<MouseButton>>,
    keys: Option<Res<ButtonInput<KeyCode>>>,
    wheel: Option<Res<AccumulatedMouseScroll>>,
    mut settings: ResMut<MouseHand>,
    under: Under,
    devices: Res<Devices>,
    time: Res<Time<Real>>,
    // How far along the ray the push began.
    mut pushed_from_m: Local<Option<f32>>,
    mut at_m: Local<Option<Vec3>>,
) {
    let held = tools.iter().find(|(_, session, _)| session.device().kind == DeviceKind::Mouse);
    let Some((tool, _, rig)) = held else { return };
    let RigFrame::Of(frame) = rig.frame else { return };
    let Ok((camera, eye)) = cameras.get(frame) else { return };
    if let Some(wheel) = wheel {
        let notches = match wheel.unit {
            MouseScrollUnit::Line => wheel.delta.y,
            MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
        };
        settings.wheel_m = (settings.wheel_m + settings.per_notch_m * notches).clamp(-0.2, 0.2);
    }
    let mut pressed =
        u32::from(buttons.pressed(MouseButton::Left)) | u32::from(buttons.pressed(MouseButton::Right)) << 1;
    if keys.is_some_and(|keys| keys.any_pressed([KeyCode::ShiftLeft, KeyCode::ShiftRight])) {
        pressed |= 4;
    }
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    let ray = cursor.and_then(|at| camera.viewport_to_world(eye, at).ok());
    let turned = settings.device_from_handle.normalize().as_dquat();
    let device_from_handle = if turned.is_finite() { turned } else { DQuat::IDENTITY };
    let mut sample = DeviceSample { buttons: pressed, device_from_handle, ..devices.mouse.sample() };
    if let Some(ray) = ray {
        let middle_m = rig.centre_in_frame_m.length();
        let over_m = || under.distance_m(ray).unwrap_or(middle_m) - tool.tip_radius_m() - settings.hover_m;
        let along_m = if pressed & 1 == 1 {
            let from_m = *pushed_from_m.get_or_insert_with(over_m);
            from_m + settings.hover_m + settings.push_m + settings.wheel_m
        } else {
            *pushed_from_m = None;
            over_m() + settings.wheel_m
        };
        let wanted_m = ray.get_point(along_m.max(0.0));
        let most_m = settings.most_m_per_s * time.delta_secs().min(0.1);
        // With the clutch held the tool stays, and takes no time to be there again.
        let from_m = at_m.filter(|from_m| from_m.distance(wanted_m) < 0.3).unwrap_or(wanted_m);
        let now_m = from_m + (wanted_m - from_m).clamp_length_max(most_m);
        *at_m = Some(now_m);
        let device_m = rig.world_from_device(eye).inverse().transform_point3(now_m.as_dvec3());
        sample.position_m = if device_m.is_finite() { device_m } else { DVec3::ZERO };
    }
    devices.mouse.set(sample);
}
