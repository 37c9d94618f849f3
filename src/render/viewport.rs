//! Where cameras draw.

use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;

/// Where a camera draws in its target, pixels; none where that is empty.
pub(crate) fn viewport_of(camera: &ExtractedCamera, resolution: Option<&MainPassResolutionOverride>) -> Option<URect> {
    let viewport = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution);
    let (min, size) = match viewport {
        Some(viewport) => (viewport.physical_position, viewport.physical_size),
        None => (UVec2::ZERO, camera.physical_target_size?),
    };
    (size.min_element() > 0).then_some(URect { min, max: min + size })
}
