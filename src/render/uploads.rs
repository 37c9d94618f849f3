//! How much travels to the GPU.

use bevy::prelude::*;
use bevy::render::{ExtractSchedule, RenderApp};

/// Bytes that this crate's plugins sent to the GPU in this frame (render world). Whoever writes a buffer or texture
/// in `RenderSystems::Prepare*` adds to it.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UploadedBytes(pub u64);

pub(super) fn build(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    render_app
        .init_resource::<UploadedBytes>()
        .add_systems(ExtractSchedule, |mut bytes: ResMut<UploadedBytes>| bytes.0 = 0);
}
