//! How much travels to the GPU.

use bevy::prelude::*;
use bevy::render::{ExtractSchedule, RenderApp};
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that this crate's plugins sent to the GPU in this frame (render world).
///
/// What changes while a scene runs counts: whoever writes such a buffer or texture in `RenderSystems::Prepare*` adds
/// to it. What an asset brings once (an organ's corners, a skin's tiles) does not.
#[derive(Resource, Debug, Default)]
pub struct UploadedBytes(AtomicU64);

impl UploadedBytes {
    /// Counts bytes; the order among systems does not matter.
    pub fn add(&self, bytes: u64) {
        self.0.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Bytes of this frame so far.
    pub fn total(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<UploadedBytes>()
        .add_systems(ExtractSchedule, |mut bytes: ResMut<UploadedBytes>| *bytes = default());
}
