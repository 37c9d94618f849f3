//! A suction-irrigator sucks with the pedal.

use crate::pool::{SuctionIrrigator, SuctionState};
use crate::tools::state::ToolState;
use crate::tools::{Tool, ToolKind, ToolMotion, ToolWork};
use bevy::prelude::*;

/// Gives suction-irrigators the component of the pools that lets water through them.
pub(super) fn add_irrigators(
    mut commands: Commands,
    tools: Query<(Entity, &Tool), (Changed<Tool>, Without<SuctionIrrigator>)>,
) {
    for (entity, tool) in &tools {
        if tool.kind == ToolKind::SuctionIrrigator {
            let tip_radius_m = tool.tip_radius_m();
            commands.entity(entity).try_insert(SuctionIrrigator { tip_radius_m, ..default() });
        }
    }
}

pub(super) fn suck(mut tools: Query<(&Tool, &ToolMotion, &ToolState, &mut SuctionIrrigator)>) {
    for (tool, motion, state, mut irrigator) in &mut tools {
        let is_sucking = tool.kind == ToolKind::SuctionIrrigator && motion.to.is_some() && state.is_pedal_down();
        if irrigator.is_sucking != is_sucking {
            irrigator.is_sucking = is_sucking;
        }
    }
}

/// What a sucker has taken, once pools have flowed.
pub(super) fn listen(mut tools: Query<(&Tool, &SuctionIrrigator, &SuctionState, &mut ToolWork)>) {
    for (tool, irrigator, took, mut work) in &mut tools {
        if tool.kind != ToolKind::SuctionIrrigator {
            continue;
        }
        let does = if irrigator.is_sucking {
            ToolWork::Sucking { strength: 1.0, liquid: 1.0 - took.air_share }
        } else {
            ToolWork::Idle
        };
        work.set_if_neq(does);
    }
}
