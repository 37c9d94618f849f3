//! The ring light on the tip of an endoscope.

use crate::render::{LightUniform, finite_within};
use bevy::math::Vec3A;
use bevy::prelude::*;
use std::f32::consts::PI;

// Far beyond any lamp, and small enough that neither the ring's square nor a sum of lights overflows in 32 bits.
const MAX_COLOUR_LINEAR: f32 = 1e3;
const MAX_INTENSITY_CD: f32 = 1e9;
const MAX_RING_RADIUS_M: f32 = 10.0;

/// A thin ring of light around the optic fibre, shining along -Z of its entity (paper of 2002, sections 1 and 4.3).
///
/// It lies on the camera's entity for an [`Endoscope`](super::Endoscope), but any entity with a transform may carry
/// one. Organs are lit by it with inverse-square fall-off; what the cavity's walls throw back is added as an ambient
/// share, because inter-reflections fill a closed cavity with light.
///
/// Numbers out of range are clamped where light is computed, the inner angle to the outer one; for those that are not
/// finite the default's are taken (white for a colour's channel).
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
    /// The light as organs receive it, at a place in the world. All of it is finite: see [`ScopeLight`] for numbers
    /// that are out of range, and a light whose place is not finite is dark.
    pub fn to_uniform(&self, transform: &GlobalTransform) -> LightUniform {
        let default = Self::default();
        let outer_rad = finite_within(self.outer_angle_rad, 0.0, PI, default.outer_angle_rad);
        // The cone itself takes an inner angle beyond the outer one for the outer one.
        let inner_rad = finite_within(self.inner_angle_rad, 0.0, PI, default.inner_angle_rad);
        let (cone_scale, cone_offset) = LightUniform::cone(inner_rad, outer_rad);
        let colour = Vec3::from(
            self.colour
                .to_linear()
                .to_f32_array_no_alpha()
                .map(|channel| finite_within(channel, 0.0, MAX_COLOUR_LINEAR, 1.0)),
        );
        let intensity_cd = finite_within(self.intensity_cd, 0.0, MAX_INTENSITY_CD, default.intensity_cd);
        let position_world_m = transform.translation();
        // The square too, because that is what the shader computes.
        let has_place = position_world_m.length_squared().is_finite();
        // A transform that scales by nothing has no direction.
        let forward = Vec3::from(transform.affine().transform_vector3a(Vec3A::NEG_Z));
        LightUniform {
            colour: if has_place { colour * intensity_cd } else { Vec3::ZERO },
            kind: LightUniform::RING,
            position_world_m: if has_place { position_world_m } else { Vec3::ZERO },
            inverse_range_squared: 0.0,
            direction_world: forward.try_normalize().unwrap_or(Vec3::NEG_Z),
            ring_radius_m: finite_within(self.ring_radius_m, 0.0, MAX_RING_RADIUS_M, default.ring_radius_m),
            cone_scale,
            cone_offset,
            ambient_fraction: finite_within(self.ambient_fraction, 0.0, 1.0, default.ambient_fraction),
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
