//! The order in which entities take their turns: that of queries is another one in another program.

use bevy::prelude::*;

/// Entities by their names, those without one first; of one name by entity.
pub(crate) fn by_name<'a>(entities: impl Iterator<Item = (Entity, Option<&'a Name>)>) -> Vec<Entity> {
    let mut named: Vec<(Option<&str>, Entity)> =
        entities.map(|(entity, name)| (name.map(Name::as_str), entity)).collect();
    named.sort_unstable();
    named.into_iter().map(|(_, entity)| entity).collect()
}
