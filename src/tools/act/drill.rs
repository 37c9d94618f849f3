//! A burr that turns cuts volumes.

use crate::tools::state::ToolState;
use crate::tools::{
    ContactMatter, Tool, ToolContacts, ToolForce, ToolKind, ToolMotion, ToolOrder, ToolPart, ToolPlace, ToolWork,
};
use crate::volume::cut::BurrPose;
use crate::volume::{DrillVolume, PickedVolume};
use bevy::prelude::*;

fn pose(place: &ToolPlace) -> BurrPose {
    BurrPose { centre_m: place.tip_in_world_m, axis: place.back_in_world() }
}

type Drilling = (
    &'static Tool,
    &'static ToolMotion,
    &'static ToolContacts,
    &'static ToolForce,
    &'static ToolState,
    &'static mut ToolWork,
);

/// Drills whose burr stands still get their next one, if that is asked for.
pub(super) fn change_burrs(mut tools: Query<(&mut Tool, &ToolState)>) {
    for (mut tool, state) in &mut tools {
        if state.changes_burr() && !tool.burrs.is_empty() {
            tool.put_next_burr_on();
        }
    }
}

/// Every volume near a burr that runs is told of it: also fluid over it is stirred.
pub(super) fn drill(
    order: Res<ToolOrder>,
    mut tools: Query<Drilling>,
    volumes: Query<&PickedVolume>,
    mut strokes: MessageWriter<DrillVolume>,
) {
    for &entity in &order.0 {
        let Ok((tool, motion, contacts, force, state, mut work)) = tools.get_mut(entity) else { continue };
        let ToolKind::Drill(head) = tool.kind else { continue };
        let speed_rpm = head.full_speed_rpm * state.command.pedal;
        let Some(to) = motion.to.filter(|_| speed_rpm > 0.0) else {
            work.set_if_neq(ToolWork::Idle);
            continue;
        };
        let begins_stroke = state.before.pedal <= 0.0 || motion.from.is_none();
        let (mut pressed_n, mut share, mut hardness) = (0.0_f32, 0.0_f32, 1.0);
        for &volume in contacts.near.iter().filter(|body| volumes.contains(**body)) {
            let contact = contacts.of(volume, ToolPart::Tip);
            let force_n = force.drilling_n.or(contact.map(|contact| contact.force_n)).unwrap_or(0.0).max(0.0);
            strokes.write(DrillVolume {
                volume,
                tool: Some(entity),
                burr: head.burr,
                from_world: pose(&motion.from.unwrap_or(to)),
                to_world: pose(&to),
                force_n,
                speed_rpm,
                begins_stroke,
            });
            let Some(contact) = contact.filter(|_| force_n >= pressed_n) else { continue };
            pressed_n = force_n;
            share = (contact.depth_m / tool.tip_radius_m().max(1e-6)).clamp(0.0, 1.0);
            let ContactMatter::Volume { label, .. } = contact.matter else { continue };
            let structure =
                volumes.get(volume).ok().and_then(|PickedVolume(picker)| picker.structures().of_label(label));
            hardness = structure.map_or(1.0, |structure| structure.hardness);
        }
        work.set_if_neq(ToolWork::Drilling { speed_rpm, force_n: pressed_n, contact: share, hardness });
    }
}
