//! What an instrument remembers from step to step.

use super::ToolCommand;
use bevy::prelude::*;

/// Edges of pedals and jaws, and what is held.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolState {
    /// The command of this step, with numbers that are some.
    pub command: ToolCommand,
    /// That of the step before.
    pub before: ToolCommand,
    /// What its jaws have closed on.
    pub held: Option<Entity>,
}

impl ToolState {
    pub(super) fn advance(&mut self, command: &ToolCommand) {
        self.before = self.command;
        self.command = command.clean();
    }

    /// Whether the pedal is down.
    pub fn is_pedal_down(&self) -> bool {
        self.command.pedal >= ToolCommand::DOWN
    }

    /// Whether jaws are closed.
    pub fn is_closed(&self) -> bool {
        self.command.grip >= ToolCommand::DOWN
    }

    /// Whether jaws close in this step.
    pub fn closes(&self) -> bool {
        self.is_closed() && self.before.grip < ToolCommand::DOWN
    }

    /// Whether the next burr is to be put on in this step.
    pub fn changes_burr(&self) -> bool {
        let is_still = self.command.pedal <= 0.0 && self.before.pedal <= 0.0;
        is_still && self.command.next_burr && !self.before.next_burr
    }

    /// Whether pedal or jaws bite in this step.
    pub fn bites(&self) -> bool {
        self.closes() || self.is_pedal_down() && self.before.pedal < ToolCommand::DOWN
    }
}
