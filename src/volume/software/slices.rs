//! Slices across the view, blended back to front (paper of 2009, sections 3 and 5.4).

use super::march::{Pixel, draw, sample};
use super::{MarchScene, ViewRays, VolumeImage};

/// Draws every slice, the farthest first: what a renderer does that blends textured slices. Colour, gradient and depth are
/// all blended by opacity. It takes the samples of [`march`](super::march) without skipping or stopping.
pub fn composite_slices(rays: &ViewRays, scene: &MarchScene) -> VolumeImage {
    draw(rays, scene, |ray, (first, last), end_m, counts| {
        let mut pixel = Pixel { end_depth_m: end_m, ..Pixel::default() };
        for plane in (first..=last).rev() {
            let depth_m = plane as f32 * scene.step_m;
            counts.samples += 1;
            let Some(sample) = sample(scene, scene.rest_at(ray.at(depth_m))) else { continue };
            counts.visible_samples += 1;
            let (opacity, behind) = (sample.opacity, 1.0 - sample.opacity);
            pixel.colour = sample.colour.extend(1.0) * opacity + pixel.colour * behind;
            pixel.gradient = sample.gradient * opacity + pixel.gradient * behind;
            pixel.weighted_depth_m = depth_m * opacity + pixel.weighted_depth_m * behind;
        }
        pixel
    })
}
