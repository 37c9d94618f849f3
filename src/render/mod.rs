//! What every pass shares: the embedded shaders, the order of the passes, the light list, the capability check.

mod capability;
mod depth;
mod lights;
mod passes;
mod shaders;
mod tonemapping;
mod uploads;
mod viewport;

pub use capability::{GraphicsAdapter, graphics_adapters};
pub(crate) use lights::ExtractSceneLights;
pub use lights::{
    LightUniform, MAX_SCENE_LIGHTS, MAX_SCOPE_LIGHTS, OrganLights, SceneLight, SceneLights, strongest_lights,
};
pub use passes::{OrganPasses, VolumePasses};
pub use shaders::{EmbeddedShader, SHADERS, shader_path};
pub(crate) use tonemapping::tonemapping_definitions;
pub use uploads::Uploads;
pub(crate) use viewport::viewport_of;

use bevy::prelude::*;

/// Embeds the shaders, orders the passes of a camera and collects the scene's lights.
///
/// Every drawing plugin of this crate needs it. Without a render world (a CPU-only app) it does nothing.
pub struct SurgeryRenderPlugin;

impl Plugin for SurgeryRenderPlugin {
    fn build(&self, app: &mut App) {
        if app.get_sub_app(bevy::render::RenderApp).is_none() {
            return;
        }
        shaders::embed(app);
        depth::build(app);
        passes::order(app);
        lights::build(app);
        uploads::build(app);
    }
}

/// A parameter on its way to a shader: within its bounds, and `otherwise` where it is not finite. One number that is not
/// would spread, because bloom and later passes blur it over the whole picture.
pub(crate) fn finite_within(value: f32, low: f32, high: f32, otherwise: f32) -> f32 {
    if value.is_finite() { value.clamp(low, high) } else { otherwise }
}
