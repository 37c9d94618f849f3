//! Passes that read what Bevy's opaque pass left in the depth buffer.

use bevy::prelude::*;
use bevy::render::render_resource::TextureUsages;

pub(super) fn build(app: &mut App) {
    app.add_systems(PostUpdate, let_depth_be_read);
}

/// Bevy makes a camera's depth texture for drawing only, unless its camera says otherwise.
fn let_depth_be_read(mut cameras: Query<&mut Camera3d, Added<Camera3d>>) {
    for mut camera in &mut cameras {
        camera.depth_texture_usages.0 |= TextureUsages::TEXTURE_BINDING.bits();
    }
}
