//! Whose turn it is: two tools that act on one body in the same step do so in an order of their own.

use super::{Tool, TouchTools};
use crate::order::by_name;
use bevy::prelude::*;

/// The tools in the order in which they act: by their names, of one name by entity. Another program that spawns them otherwise, or gives
/// them other components, does the same to the bit as long as their names differ.
#[derive(Resource, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct ToolOrder(pub Vec<Entity>);

pub(super) fn build(app: &mut App) {
    app.init_resource::<ToolOrder>()
        .register_type::<ToolOrder>()
        .add_systems(FixedUpdate, order_tools.in_set(TouchTools::Move));
}

fn order_tools(tools: Query<(Entity, Option<&Name>), With<Tool>>, mut order: ResMut<ToolOrder>) {
    order.set_if_neq(ToolOrder(by_name(tools.iter())));
}
