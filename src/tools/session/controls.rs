//! Which buttons, pedals and grippers of a device press what.

use crate::haptics::device::DeviceSample;
use crate::tools::{ToolCommand, ToolKind};
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// A part of a device that is pressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum DeviceControl {
    /// None.
    #[default]
    None,
    /// Button `n`, from 0 to 31.
    Button(u32),
    /// A pedal or trigger: 0 or 1.
    Axis(u32),
    /// A gripper that is open at an angle, radians; closed at 0.
    Grip {
        /// How far it opens.
        open_rad: f32,
    },
}

impl DeviceControl {
    /// How far it is pressed in a sample, 0 to 1.
    pub fn value(&self, sample: &DeviceSample) -> f32 {
        match *self {
            Self::None => 0.0,
            Self::Button(button) => {
                f32::from(sample.buttons.checked_shr(button).is_some_and(|shifted| shifted & 1 == 1))
            }
            Self::Axis(axis) => sample.axes.get(axis as usize).map_or(0.0, |axis| axis.clamp(0.0, 1.0)),
            Self::Grip { open_rad } => {
                sample.grip_rad.map_or(0.0, |grip_rad| 1.0 - (grip_rad as f32 / open_rad.max(1e-3)).clamp(0.0, 1.0))
            }
        }
    }
}

/// What presses the pedals, the jaws and the clutch of a tool. Of two controls the one that is pressed further counts.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct ToolControls {
    /// [`ToolCommand::pedal`].
    pub pedal: [DeviceControl; 2],
    /// [`ToolCommand::second_pedal`].
    pub second_pedal: [DeviceControl; 2],
    /// [`ToolCommand::grip`].
    pub grip: [DeviceControl; 2],
    /// Holds the tool still while the hand moves.
    pub clutch: DeviceControl,
    /// [`ToolCommand::next_burr`].
    #[serde(default)]
    pub next_burr: DeviceControl,
}

impl Default for ToolControls {
    /// The first button or pedal, the second ones, the gripper, the third button for the clutch, and the fourth for the next burr.
    fn default() -> Self {
        use DeviceControl::{Axis, Button, Grip, None};
        Self {
            pedal: [Button(0), Axis(0)],
            second_pedal: [Button(1), Axis(1)],
            grip: [Grip { open_rad: 0.5 }, None],
            clutch: Button(2),
            next_burr: Button(3),
        }
    }
}

impl ToolControls {
    /// What a sample presses on a tool; jaws on a device without a gripper close with the pedal.
    pub(super) fn command(&self, sample: &DeviceSample, kind: &ToolKind) -> ToolCommand {
        let value = |of: &[DeviceControl; 2]| of[0].value(sample).max(of[1].value(sample));
        let (pedal, second_pedal, mut grip) = (value(&self.pedal), value(&self.second_pedal), value(&self.grip));
        if sample.grip_rad.is_none() && matches!(kind, ToolKind::Grasper(_) | ToolKind::BiopsyNeedle(_)) {
            grip = grip.max(pedal);
        }
        ToolCommand { pedal, second_pedal, grip, next_burr: self.next_burr.value(sample) >= ToolCommand::DOWN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn controls_press_what_they_are_set_to() {
        let controls = ToolControls::default();
        let sample = DeviceSample { buttons: 0b10, axes: [0.4, 0.0], grip_rad: Some(0.1), ..default() };
        let command = controls.command(&sample, &ToolKind::Probe);
        assert_eq!((command.pedal, command.second_pedal), (0.4, 1.0));
        assert!((command.grip - 0.8).abs() < 1e-6);
        assert!(!command.next_burr);
        let fourth = DeviceSample { buttons: 0b1000, ..default() };
        assert!(controls.command(&fourth, &ToolKind::Probe).next_burr);
        let without_gripper = DeviceSample { buttons: 1, ..default() };
        assert_eq!(controls.command(&without_gripper, &ToolKind::Grasper(default())).grip, 1.0);
        assert_eq!(controls.command(&without_gripper, &ToolKind::Probe).grip, 0.0);
        assert_eq!(DeviceControl::Button(77).value(&sample), 0.0);
        assert_eq!(DeviceControl::Axis(9).value(&sample), 0.0);
    }
}
