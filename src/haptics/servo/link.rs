//! The simulation's end of the loop.

use super::{ServoScene, ServoState};
use crate::haptics::device::DeviceFault;
use crate::haptics::exchange::{Publisher, Subscriber};
use bevy::reflect::Reflect;
use std::sync::mpsc::Receiver;
use thiserror::Error;

/// What went wrong in the loop.
#[derive(Clone, Debug, PartialEq, Error, Reflect)]
pub enum ServoFault {
    /// The device.
    #[error("{0}")]
    Device(DeviceFault),
    /// The loop itself, which has stopped.
    #[error("the servo loop has stopped with zero force: {0}")]
    Panic(String),
}

/// Publishes scenes to a loop and reads its states; never waits.
pub struct ServoLink {
    pub(super) scenes: Publisher<ServoScene>,
    pub(super) states: Subscriber<ServoState>,
    pub(super) faults: Receiver<ServoFault>,
}

impl ServoLink {
    /// Hands a scene over, and returns an old one to be filled again or freed.
    pub fn publish(&mut self, scene: ServoScene) -> ServoScene {
        self.scenes.publish(scene)
    }

    /// The newest state.
    pub fn state(&mut self) -> ServoState {
        self.states.take_newest();
        self.states.read(|state| *state).unwrap_or_default()
    }

    /// What went wrong since the last call; the same fault on end is told once.
    pub fn faults(&mut self) -> impl Iterator<Item = ServoFault> + '_ {
        self.faults.try_iter()
    }
}
