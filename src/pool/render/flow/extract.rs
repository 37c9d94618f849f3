//! Steps of this frame, and those that still wait.

use super::command::{GpuFlow, StepQueue};
use bevy::prelude::*;
use bevy::render::MainWorld;
use bevy::render::sync_world::MainEntity;
use std::collections::BTreeMap;

/// Steps to be made, by pool. A pool without steps has an entry as well.
#[derive(Resource, Default)]
pub(super) struct FlowQueues(pub BTreeMap<MainEntity, StepQueue>);

pub(super) fn extract_steps(mut queues: ResMut<FlowQueues>, mut world: ResMut<MainWorld>) {
    let mut old = std::mem::take(&mut queues.0);
    let mut pools = world.query::<(Entity, &mut GpuFlow)>();
    for (entity, mut flow) in pools.iter_mut(&mut world) {
        let mut queue = old.remove(&MainEntity::from(entity)).unwrap_or_default();
        if flow.waiting() > 0 {
            flow.bypass_change_detection().take().0.into_iter().for_each(|step| queue.push(step));
        }
        queues.0.insert(entity.into(), queue);
    }
}
