//! Passes that read what Bevy's opaque pass left in the depth buffer.

use bevy::camera::Camera3dDepthTextureUsage;
use bevy::prelude::*;
use bevy::render::render_resource::TextureUsages;

pub(super) fn build(app: &mut App) {
    app.add_systems(Last, let_depth_be_read);
}

/// Bevy makes a camera's depth texture for drawing only, unless its camera says otherwise: volumes end at it, and tool shadows
/// copy it.
fn let_depth_be_read(mut cameras: Query<&mut Camera3d, Changed<Camera3d>>) {
    let wanted = (TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC).bits();
    for mut camera in &mut cameras {
        let Camera3dDepthTextureUsage(present) = camera.depth_texture_usages;
        if present & wanted != wanted {
            camera.depth_texture_usages = Camera3dDepthTextureUsage(present | wanted);
        }
    }
}
