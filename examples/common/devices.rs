//! Devices of the hand: listing them, and giving them the instruments.

use super::args::Args;
use bevy::prelude::*;
use bevy_surgery::haptics::device::DeviceInfo;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::{Devices, HoldDevice, ServoSession, ToolRig};

/// Makes devices usable where one was asked for.
pub fn build(app: &mut App) {
    if app.world().resource::<Args>().device.is_empty() {
        return;
    }
    match Devices::new() {
        Ok(devices) => app.insert_resource(devices).add_systems(PreUpdate, rig_tools),
        Err(fault) => {
            error!("no devices can be used: {fault}");
            app
        }
    };
}

/// Prints the devices that there are, and why others cannot be used.
pub fn list() -> Result<(), String> {
    let devices = Devices::new().map_err(|fault| fault.to_string())?;
    for DeviceInfo { id, name, has_force, limits, .. } in devices.list() {
        let force = if has_force { format!("{} N", limits.max_force_n) } else { "no force".into() };
        println!("{id:<24} {name}, {force}");
    }
    devices.news().iter().for_each(|news| println!("{news}"));
    Ok(())
}

/// Gives an instrument the device of its hand, if one was asked for.
pub fn hold_device(commands: &mut Commands, tool: Entity, args: &Args, hand: ToolHand) {
    if let Some(id) = args.device.get(hand as usize) {
        commands.entity(tool).insert(HoldDevice::new(id));
    }
}

/// Lays workspaces before the middle of the scene, as the camera sees it, so that hands begin outside of everything; under a
/// microscope they move less.
#[allow(clippy::type_complexity, reason = "queries spell out what they touch")]
fn rig_tools(
    mut tools: Query<&mut ToolRig, Added<ServoSession>>,
    cameras: Query<(Entity, &Transform, Has<Microscope>), Or<(With<Endoscope>, With<Microscope>)>>,
) {
    let Some((camera, place, is_microscope)) = cameras.iter().next() else { return };
    for mut rig in &mut tools {
        let (scale, share) = if is_microscope { (0.4, 0.85) } else { (1.0, 0.55) };
        *rig = ToolRig { scale, ..ToolRig::before_camera(camera, share * place.translation.length()) };
    }
}
