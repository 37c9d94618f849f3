//! What instruments do: messages to organs, bodies, volumes and pools, by kind and command.

mod drill;
mod electrode;
mod jaws;
mod press;
mod suction;

use super::TouchTools;
use super::state::ToolState;
use super::{Tool, ToolCommand};
use crate::pool::FlowPools;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;

pub(super) fn build(app: &mut App) {
    app.register_type::<ToolState>();
    app.register_required_components::<Tool, ToolState>();
    app.add_systems(PreUpdate, suction::add_irrigators).add_systems(
        FixedUpdate,
        (
            take_commands,
            drill::change_burrs,
            // What jaws hold is not pressed.
            jaws::grasp,
            press::press_organs,
            press::press_bodies,
            jaws::bite,
            electrode::burn,
            drill::drill,
            suction::suck,
        )
            .chain()
            .in_set(TouchTools::Act),
    );
    app.add_systems(FixedUpdate, suction::listen.in_set(SurgerySystems::Flow).after(FlowPools));
}

/// The number by which messages know a tool from step to step.
pub fn tool_number(tool: Entity) -> u32 {
    tool.index_u32()
}

fn take_commands(mut tools: Query<(&ToolCommand, &mut ToolState), With<Tool>>) {
    for (command, mut state) in &mut tools {
        state.advance(command);
    }
}
