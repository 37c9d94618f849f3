//! What comes back from the GPU.

use bevy::prelude::*;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};

/// State of a pool that the GPU moves, some frames ago.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct PoolReadings {
    /// Blood in the whole pool, in cells full of it.
    pub blood: f32,
    /// Dust, the same.
    pub dust: f32,
    /// Share of the wet cells with so much blood that they hide what is below.
    pub hidden_share: f32,
    /// Greatest velocity in the middle of a cell, metres per second.
    pub fastest_m_s: f32,
    /// Cells with fluid.
    pub wet_cells: u32,
    /// Number of the last step before; 0 before anything came back.
    pub step: u64,
}

/// Into the main world.
#[derive(Resource, Clone)]
pub(super) struct ReadingsSender(pub Sender<(Entity, PoolReadings)>);

#[derive(Resource)]
struct ReadingsReceiver(Mutex<Receiver<(Entity, PoolReadings)>>);

pub(super) fn build(app: &mut App) -> ReadingsSender {
    let (sender, receiver) = channel();
    app.insert_resource(ReadingsReceiver(Mutex::new(receiver))).add_systems(PreUpdate, receive);
    ReadingsSender(sender)
}

fn receive(receiver: Res<ReadingsReceiver>, mut pools: Query<&mut PoolReadings>) {
    let Ok(receiver) = receiver.0.lock() else { return };
    for (entity, readings) in receiver.try_iter() {
        // Those of pools that are gone are of no use.
        if let Ok(mut own) = pools.get_mut(entity) {
            *own = readings;
        }
    }
}
