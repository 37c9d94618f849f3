//! The endoscope as one component.

use super::{ScopeLight, ScopeMask};
use bevy::camera::{Hdr, PerspectiveProjection, Projection};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;

/// A camera that is an endoscope: wide view, light on the tip, round picture, linear HDR.
///
/// Everything it requires can be spawned beside it with other values, or removed again (`ScopeMask` for a full
/// frame). Move it with its [`Transform`]: it looks along -Z from its tip.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(
    Camera3d,
    Hdr,
    // Needs no lookup texture, keeps reds red and highlights white.
    Tonemapping::SomewhatBoringDisplayTransform,
    // llvmpipe and weak laptops pay for every sample; add `Msaa::Sample4` where there is a GPU.
    Msaa::Off,
    ScopeLight,
    ScopeMask
)]
pub struct Endoscope {
    /// Full vertical angle of view in radians. Laparoscopes see 60 to 80 degrees.
    pub field_of_view_rad: f32,
    /// Nearest distance that is drawn, metres.
    pub near_m: f32,
    /// Farthest distance that is drawn, metres.
    pub far_m: f32,
}

impl Default for Endoscope {
    fn default() -> Self {
        Self { field_of_view_rad: 60_f32.to_radians(), near_m: 0.002, far_m: 10.0 }
    }
}

pub(super) fn build(app: &mut App) {
    app.add_systems(PostUpdate, set_projection.before(bevy::camera::CameraUpdateSystems));
}

/// Writes the lens into the camera's projection when it changes.
fn set_projection(mut scopes: Query<(&Endoscope, &mut Projection), Changed<Endoscope>>) {
    for (scope, mut projection) in &mut scopes {
        let aspect_ratio = match &*projection {
            Projection::Perspective(old) => old.aspect_ratio,
            _ => 1.0,
        };
        *projection = Projection::Perspective(PerspectiveProjection {
            fov: scope.field_of_view_rad,
            aspect_ratio,
            near: scope.near_m,
            far: scope.far_m,
            ..default()
        });
    }
}
