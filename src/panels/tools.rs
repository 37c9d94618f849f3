//! Instruments and the devices that hold them.

use super::{edit, edit_component};
use crate::haptics::device::DeviceInfo;
use crate::pool::SuctionIrrigator;
use crate::reactions::Wound;
use crate::tools::{DeviceRefused, Devices, DrillHead, Electrodes, HoldDevice, Jaws, Tool, ToolKind};
use bevy::prelude::*;
use bevy::tasks::{IoTaskPool, Task, block_on, poll_once};
use bevy_egui::egui;
use std::any::TypeId;

/// Devices that were found when somebody last looked.
#[derive(Resource, Default)]
pub(super) struct FoundDevices {
    found: Vec<DeviceInfo>,
    looking: Option<Task<Vec<DeviceInfo>>>,
    has_looked: bool,
}

/// Instruments that are ready.
pub fn ready_tools() -> [(&'static str, &'static str, ToolKind); 7] {
    [
        ("Probe", "Presses: the skin turns pale under it", ToolKind::Probe),
        ("Grasper", "Jaws that hold tissue", ToolKind::Grasper(Jaws::default())),
        ("Biopsy needle", "Each bite opens a vessel", ToolKind::BiopsyNeedle(Wound::default())),
        ("Cautery hook", "Coagulates and cuts", ToolKind::CauteryHook(Electrodes::default())),
        ("Drill", "A burr that turns with the pedal", ToolKind::Drill(DrillHead::default())),
        ("Suction irrigator", "Irrigates all the time, sucks with the pedal", ToolKind::SuctionIrrigator),
        ("Scope", "Holds a camera", ToolKind::Scope),
    ]
}

/// What an instrument is, with the outline that suits it.
pub(super) fn tool(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Preset").on_hover_text("What it is, with the outline that suits it");
        for (name, told, kind) in ready_tools() {
            if ui.small_button(name).on_hover_text(told).clicked() {
                let hand = world.get::<Tool>(entity).map_or_else(default, |tool| tool.hand);
                edit(world, entity, Tool::new(kind).in_hand(hand), name);
                if kind == ToolKind::SuctionIrrigator && world.get::<SuctionIrrigator>(entity).is_none() {
                    edit(world, entity, SuctionIrrigator::default(), name);
                }
            }
        }
    });
}

/// Which device holds it.
pub(super) fn device(ui: &mut egui::Ui, world: &mut World, entity: Entity) {
    if let Some(DeviceRefused(fault)) = world.get::<DeviceRefused>(entity) {
        ui.colored_label(ui.visuals().error_fg_color, fault.to_string())
            .on_hover_text("Why the device does not hold it");
    }
    let Some(devices) = world.get_resource::<Devices>().cloned() else {
        ui.weak("This program uses no devices.");
        return;
    };
    let found = world.resource_scope(|_, mut found: Mut<FoundDevices>| {
        let told = "Looks for devices that are connected now";
        if ui.button("Look for devices").on_hover_text(told).clicked() || !found.has_looked {
            found.has_looked = true;
            // Drivers take their time.
            found.looking = Some(IoTaskPool::get().spawn(async move { devices.list() }));
        }
        if let Some(list) = found.looking.as_mut().and_then(|task| block_on(poll_once(task))) {
            found.found = list;
            found.looking = None;
        }
        found.found.clone()
    });
    let now = world.get::<HoldDevice>(entity).cloned().unwrap_or_default();
    for info in found {
        let told = format!("{}\nLets the tool be held by it", info.id);
        if ui.selectable_label(now.id == info.id, &info.name).on_hover_text(told).clicked() {
            let held = HoldDevice { id: info.id.clone(), ..now.clone() };
            edit_component(world, entity, TypeId::of::<HoldDevice>(), Some(Box::new(held)), "Device");
        }
    }
}
