//! A page to try a device of the hand on: a wall, a ball, bone and a liver to feel, with what the device says and what the servo
//! loop does.
//!
//! `--device list` tells which devices there are, `--device ID` takes one; without it the mouse is the hand: move it over what is to
//! be felt, push in with the left button. 1 to 4 choose what is felt, comma and full stop make it softer and harder (a device that
//! hums has found its limit), C forgets how far the handle has been, H centres the workspace, Escape ends.

// Queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "feel/objects.rs"]
mod objects;
#[path = "feel/panel.rs"]
mod panel;
#[path = "feel/pointer.rs"]
mod pointer;

use bevy::prelude::*;
use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedDevice, ScriptedPath, Tremor};
use bevy_surgery::haptics::device::{DeviceKind, DeviceLimits};
use bevy_surgery::haptics::servo::ServoSettings;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::{Devices, HoldDevice, ServoReading, ServoSession, ToolRig};
use bevy_surgery::view::ScopeMask;
use common::{Args, Stage, Viewer, hold_device};
use glam::DVec3;
use objects::Object;
use std::process::ExitCode;

/// How far before the camera the things to be felt are, metres.
const DISTANCE_M: f32 = 0.17;

/// The camera.
#[derive(Component)]
struct Viewpoint;

/// The tool that feels.
#[derive(Component)]
struct Hand;

fn main() -> ExitCode {
    common::main_with(
        "feel",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.09, 0.1, 0.12)));
            app.add_systems(Startup, (setup, pick_up).chain()).add_systems(PreUpdate, centre);
            objects::build(app);
            panel::build(app);
            pointer::build(app);
        },
        count,
    )
}

fn setup(mut commands: Commands, stage: Res<Stage>) {
    let view = Transform::from_xyz(0.0, 0.0, DISTANCE_M).looking_at(Vec3::ZERO, Vec3::Y);
    let light = ScopeLight { intensity_cd: 150.0, outer_angle_rad: 1.3, ..default() };
    let camera =
        commands.spawn((Viewpoint, Endoscope::default(), light, stage.target.clone(), view)).remove::<ScopeMask>().id();
    let sun = Transform::from_xyz(-1.0, 2.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y);
    commands.spawn((DirectionalLight { illuminance: 1500.0, ..default() }, sun));
    let geometry = ToolGeometry { tip_radius_m: 3e-3, shaft_length_m: 0.15, shaft_radius_m: 1.5e-3, mass_kg: 0.0 };
    let tool = Tool { geometry, ..Tool::new(ToolKind::Probe) };
    commands.spawn((Hand, Name::new("hand"), tool, ToolRig::before_camera(camera, DISTANCE_M)));
}

/// Takes the device that was asked for, else the mouse; where nobody is there, a hand that follows a path.
fn pick_up(mut commands: Commands, args: Res<Args>, stage: Res<Stage>, tools: Query<Entity, With<Hand>>) -> Result {
    let tool = tools.single()?;
    if !args.device.is_empty() {
        hold_device(&mut commands, tool, &args, ToolHand::Right);
    } else if stage.viewer == Viewer::Person {
        commands.insert_resource(Devices::new()?);
        commands.entity(tool).insert(HoldDevice::new("hand:mouse"));
    } else {
        // Down to the object, pressed, along it, and away; from the workspace's middle, which is the object's.
        let keys = [
            (0.0, [0.0, 0.01, 0.07]),
            (0.5, [-0.02, 0.0, 0.05]),
            (1.2, [-0.02, 0.0, 0.028]),
            (3.0, [0.025, 0.01, 0.028]),
        ];
        // From below on the right, as one holds a pen.
        let device_from_handle = Quat::from_rotation_arc(Vec3::Z, Vec3::new(0.55, -0.5, 0.67).normalize()).as_dquat();
        let keys =
            keys.map(|(time_s, at_m)| KeyPose { device_from_handle, ..KeyPose::at(time_s, DVec3::from_array(at_m)) });
        let path = ScriptedPath::new(keys.to_vec(), Some(Tremor { seed: args.seed, ..default() }));
        let device = Box::new(ScriptedDevice::new(path, 1e-3, DeviceLimits::OMNI));
        commands.entity(tool).insert(ServoSession::stepped(device, ServoSettings::default()));
    }
    Ok(())
}

/// H centres the workspace again.
fn centre(keys: Option<Res<ButtonInput<KeyCode>>>, mut rigs: Query<&mut ToolRig, With<Hand>>) {
    if keys.is_some_and(|keys| keys.just_pressed(KeyCode::KeyH)) {
        rigs.iter_mut().for_each(|mut rig| rig.centre());
    }
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    let mut hands = world.query_filtered::<(&ServoReading, Option<&ServoSession>), With<Hand>>();
    for (reading, session) in hands.iter(world) {
        let state = &reading.state;
        counters.insert("device".into(), reading.device.clone().into());
        let is_simulated = session.is_some_and(|session| session.device().kind == DeviceKind::Scripted);
        counters.insert("scripted".into(), is_simulated.into());
        counters.insert("ticks".into(), state.tick.into());
        counters.insert("force_n".into(), serde_json::json!(state.force_in_device_n.to_array()));
        counters.insert("contacts".into(), state.contact_count.into());
        counters.insert("excess_j".into(), state.excess_j.into());
    }
    let object = world.resource::<Object>();
    counters.insert("object".into(), format!("{object:?}").to_lowercase().into());
    counters
}
