//! What is remembered of the bodies around a tool, from one step to the next.

use bevy::prelude::*;
use std::collections::BTreeMap;

/// Something by body; what is not used in a step is forgotten at its end.
pub(super) struct Kept<T>(BTreeMap<Entity, (T, bool)>);

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<T> Kept<T> {
    /// Begins a step: nothing has been used in it.
    pub(super) fn begin(&mut self) {
        self.0.values_mut().for_each(|(_, is_used)| *is_used = false);
    }

    /// Ends a step.
    pub(super) fn end(&mut self) {
        self.0.retain(|_, (_, is_used)| *is_used);
    }

    /// What is there of a body; that alone does not keep it.
    pub(super) fn get(&self, body: Entity) -> Option<&T> {
        self.0.get(&body).map(|(kept, _)| kept)
    }

    /// What is there of a body, which keeps it.
    pub(super) fn keep(&mut self, body: Entity) -> Option<&mut T> {
        let (kept, is_used) = self.0.get_mut(&body)?;
        *is_used = true;
        Some(kept)
    }

    /// Keeps something of a body.
    pub(super) fn insert(&mut self, body: Entity, new: T) {
        self.0.insert(body, (new, true));
    }
}
