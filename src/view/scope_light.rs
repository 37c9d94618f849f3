//! The ring light on the tip of an endoscope.

use crate::render::LightUniform;
use bevy::prelude::*;

/// A thin ring of light around the optic fibre, shining along -Z of its entity (paper of 2002, sections 1 and 4.3).
///
/// It lies on the camera's entity for an [`Endoscope`](super::Endoscope), but any entity with a transform may carry
/// one. Organs are lit by it with inverse-square fall-off; what the cavity's walls throw back is added as an ambient
/// share, because inter-reflections fill a closed cavity with light.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform, Visibility)]
pub struct ScopeLight {
    /// Colour of the light; xenon and LED sources are slightly warm of white.
    pub colour: Color,
    /// Luminous intensity on the axis in candela. At Bevy's default exposure 80 cd suit a working distance of 15 cm.
    pub intensity_cd: f32,
    /// Radius of the ring in metres.
    pub ring_radius_m: f32,
    /// Half angle inside which the beam has full strength, radians.
    pub inner_angle_rad: f32,
    /// Half angle beyond which it is dark, radians.
    pub outer_angle_rad: f32,
    /// Share of the light that arrives from all sides after inter-reflection, 0 to 1.
    pub ambient_fraction: f32,
}

impl Default for ScopeLight {
    fn default() -> Self {
        Self {
            colour: Color::srgb(1.0, 0.97, 0.93),
            intensity_cd: 80.0,
            ring_radius_m: 0.004,
            inner_angle_rad: 12_f32.to_radians(),
            outer_angle_rad: 58_f32.to_radians(),
            ambient_fraction: 0.08,
        }
    }
}

impl ScopeLight {
    /// The light as organs receive it, at a place in the world.
    pub fn to_uniform(&self, transform: &GlobalTransform) -> LightUniform {
        let (cone_scale, cone_offset) = LightUniform::cone(self.inner_angle_rad, self.outer_angle_rad);
        LightUniform {
            colour: self.colour.to_linear().to_vec3() * self.intensity_cd,
            kind: LightUniform::RING,
            position_world_m: transform.translation(),
            inverse_range_squared: 0.0,
            direction_world: transform.forward().into(),
            ring_radius_m: self.ring_radius_m,
            cone_scale,
            cone_offset,
            ambient_fraction: self.ambient_fraction,
        }
    }
}

pub(super) fn build(app: &mut App) {
    extraction::build(app);
}

mod extraction {
    use super::ScopeLight;
    use crate::render::{ExtractSceneLights, SceneLight, SceneLights};
    use bevy::camera::visibility::RenderLayers;
    use bevy::prelude::*;
    use bevy::render::{Extract, ExtractSchedule, RenderApp};

    pub fn build(app: &mut App) {
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            render_app.add_systems(ExtractSchedule, extract_scope_lights.after(ExtractSceneLights));
        }
    }

    type Scope = (
        Entity,
        &'static ScopeLight,
        &'static GlobalTransform,
        &'static InheritedVisibility,
        Option<&'static RenderLayers>,
    );

    fn extract_scope_lights(scene: Option<ResMut<SceneLights>>, scopes: Extract<Query<Scope>>) {
        // Without `SurgeryRenderPlugin` nothing is lit.
        let Some(mut scene) = scene else { return };
        for (entity, scope, transform, visible, layers) in scopes.iter() {
            if visible.get() {
                let layers = layers.cloned().unwrap_or_default();
                scene.lights.push(SceneLight { light: scope.to_uniform(transform), layers, entity });
            }
        }
    }
}
