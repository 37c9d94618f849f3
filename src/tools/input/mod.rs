//! Mouse, keyboard and gamepad as hands: they move the handle of the devices `hand:mouse` and `hand:gamepad`.

mod gamepad;
mod mouse;

pub use gamepad::GamepadHand;
pub use mouse::MouseHand;

use super::session::Devices;
use bevy::app::{RunFixedMainLoop, RunFixedMainLoopSystems};
use bevy::prelude::*;

pub(super) fn build(app: &mut App) {
    app.init_resource::<MouseHand>()
        .init_resource::<GamepadHand>()
        .register_type::<MouseHand>()
        .register_type::<GamepadHand>()
        .add_message::<bevy::input::gamepad::GamepadRumbleRequest>()
        .add_systems(
            RunFixedMainLoop,
            (
                mouse::move_hand.run_if(resource_exists::<ButtonInput<MouseButton>>),
                (gamepad::move_hand, gamepad::rumble).chain(),
            )
                .in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop)
                .run_if(resource_exists::<Devices>),
        );
}
