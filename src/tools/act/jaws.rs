//! Jaws: graspers hold, biopsy needles bite.

use super::tool_number;
use crate::deform::elastic::{ElasticBody, GraspBody, GraspSlipped, TissueTorn};
use crate::reactions::{OrganTouch, ReactionAction, ReactionModel};
use crate::tools::state::ToolState;
use crate::tools::{ContactMatter, Tool, ToolContacts, ToolKind, ToolMotion, ToolOrder};
use bevy::prelude::*;

/// A biopsy needle that bites in an organ opens a vessel.
pub(super) fn bite(
    order: Res<ToolOrder>,
    tools: Query<(Entity, &Tool, &ToolContacts, &ToolState)>,
    organs: Query<(), With<ReactionModel>>,
    mut touches: MessageWriter<OrganTouch>,
) {
    for (entity, tool, contacts, state) in tools.iter_many(&order.0) {
        let (ToolKind::BiopsyNeedle(wound), true) = (tool.kind, state.bites()) else { continue };
        let touched = contacts.at_tip().filter(|contact| organs.contains(contact.body));
        let Some(contact) = touched else { continue };
        if let ContactMatter::Organ { point, .. } = contact.matter {
            let action = ReactionAction::Wound(wound);
            touches.write(OrganTouch { organ: contact.body, point, instrument: tool_number(entity), action });
        }
    }
}

/// A grasper whose jaws close near a soft body holds it until they open, or it is lost.
pub(super) fn grasp(
    order: Res<ToolOrder>,
    mut tools: Query<(&Tool, &ToolMotion, &ToolContacts, &mut ToolState)>,
    bodies: Query<(), With<ElasticBody>>,
    mut grasps: MessageWriter<GraspBody>,
    mut slipped: MessageReader<GraspSlipped>,
    mut torn: MessageReader<TissueTorn>,
) {
    let lost: Vec<u32> = slipped.read().map(|slip| slip.tool).chain(torn.read().map(|tear| tear.tool)).collect();
    for &entity in &order.0 {
        let Ok((tool, motion, contacts, mut state)) = tools.get_mut(entity) else { continue };
        let number = tool_number(entity);
        let (ToolKind::Grasper(jaws), Some(place)) = (tool.kind, motion.to) else {
            if state.held.is_some() {
                state.held = None;
            }
            continue;
        };
        let body = if !state.is_closed() || lost.contains(&number) {
            None
        } else if state.closes() {
            // What the tip touches, else what is near.
            let touched = contacts.at_tip().map(|contact| contact.body);
            touched.into_iter().chain(contacts.near.iter().copied()).find(|body| bodies.contains(*body))
        } else {
            state.held.filter(|body| bodies.contains(*body))
        };
        if state.held != body {
            state.held = body;
        }
        let Some(body) = body else { continue };
        grasps.write(GraspBody {
            body,
            tool: number,
            position_world_m: place.tip_in_world_m,
            rotation_world: place.world_from_tool,
            radius_m: jaws.radius_m,
            grip_force_n: jaws.grip_force_n * state.command.grip,
            friction: jaws.friction,
        });
    }
}
