//! How much travels to the GPU.

use bevy::prelude::*;
use bevy::render::{ExtractSchedule, RenderApp};
use std::sync::atomic::{AtomicU64, Ordering};

/// What this crate's plugins sent to the GPU in this frame (render world).
///
/// What changes while a scene runs counts: whoever writes such a buffer or texture in `RenderSystems::Prepare*` adds
/// to it. What an asset brings once (an organ's corners, a skin's tiles) does not.
#[derive(Resource, Debug, Default)]
pub struct Uploads {
    bytes: AtomicU64,
    rectangles: AtomicU64,
}

impl Uploads {
    /// Counts bytes of a buffer; the order among systems does not matter.
    pub fn add(&self, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Counts rectangles of a texture, and their bytes.
    pub fn add_rectangles(&self, count: u64, bytes: u64) {
        self.rectangles.fetch_add(count, Ordering::Relaxed);
        self.add(bytes);
    }

    /// Bytes of this frame so far.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Rectangles of textures of this frame so far.
    pub fn rectangles(&self) -> u64 {
        self.rectangles.load(Ordering::Relaxed)
    }
}

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app.init_resource::<Uploads>().add_systems(ExtractSchedule, |mut uploads: ResMut<Uploads>| {
        *uploads = default();
    });
}
