//! Instruments press: skin turns pale under them, and soft bodies give way.

use super::{electrode, tool_number};
use crate::deform::elastic::{ElasticBody, PressBody, ToolShape};
use crate::reactions::{OrganTouch, ReactionAction, ReactionModel};
use crate::tools::state::ToolState;
use crate::tools::{ContactMatter, Tool, ToolContacts, ToolKind, ToolMotion, ToolOrder};
use bevy::prelude::*;

/// Force at which all blood is pressed out of the skin, newtons.
const FULL_PRESSURE_N: f32 = 1.0;
/// Radius of the skin that turns pale then, beyond the tip's own, metres.
const PALE_BEYOND_M: f32 = 0.014;
/// Friction of wet metal on tissue.
const FRICTION: f32 = 0.1;

/// The skin under a probe or a closed jaw turns pale, the more the harder it is pressed.
pub(super) fn press_organs(
    order: Res<ToolOrder>,
    tools: Query<(Entity, &Tool, &ToolContacts)>,
    organs: Query<(), With<ReactionModel>>,
    mut touches: MessageWriter<OrganTouch>,
) {
    for (entity, tool, contacts) in tools.iter_many(&order.0) {
        if tool.kind != ToolKind::Probe {
            continue;
        }
        for contact in &contacts.list {
            let ContactMatter::Organ { point, .. } = contact.matter else { continue };
            let pressure = (contact.force_n / FULL_PRESSURE_N).min(1.0);
            if pressure > 0.0 && organs.contains(contact.body) {
                let action = ReactionAction::Press { pressure, radius_m: tool.tip_radius_m() + PALE_BEYOND_M };
                touches.write(OrganTouch { organ: contact.body, point, instrument: tool_number(entity), action });
            }
        }
    }
}

/// Soft bodies feel every instrument near them but one whose jaws hold them.
pub(super) fn press_bodies(
    order: Res<ToolOrder>,
    tools: Query<(Entity, &Tool, &ToolMotion, &ToolContacts, &ToolState)>,
    bodies: Query<(), With<ElasticBody>>,
    mut presses: MessageWriter<PressBody>,
) {
    for (entity, tool, motion, contacts, state) in tools.iter_many(&order.0) {
        let Some(place) = motion.to.filter(|_| state.held.is_none() && !works_without_pressing(tool, state)) else {
            continue;
        };
        for &body in contacts.near.iter().filter(|body| bodies.contains(**body)) {
            let (tip_m, radius_m) = (place.tip_in_world_m, tool.tip_radius_m());
            let back_m = tip_m + place.back_in_world() * tool.geometry.shaft_length_m.max(0.0);
            let shape = ToolShape::Capsule { tip_m, back_m, radius_m };
            presses.write(PressBody { body, tool: tool_number(entity), shape, friction: FRICTION });
        }
    }
}

/// Before a burr that turns and an electrode with current on it tissue gives way by itself: they do not push it aside.
fn works_without_pressing(tool: &Tool, state: &ToolState) -> bool {
    match tool.kind {
        ToolKind::CauteryHook(_) => electrode::power(tool, state).is_some(),
        ToolKind::Drill(_) => state.command.pedal > 0.0,
        _ => false,
    }
}
