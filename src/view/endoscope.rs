//! The endoscope as one component.

use super::{ScopeLight, ScopeMask, SetLenses};
use bevy::camera::{Hdr, Projection};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;

/// A camera that is an endoscope: wide view, light on the tip, round picture, linear HDR.
///
/// Everything it requires can be spawned beside it with other values, or removed again (`ScopeMask` for a full
/// frame). Of a perspective [`Projection`] the angle of view and the near and far distances follow the endoscope's
/// own; a projection of another kind that is spawned beside it stays as it is. Move it with its [`Transform`]: it
/// looks along -Z from its tip.
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
    app.add_systems(PostUpdate, set_projection.in_set(SetLenses));
}

/// Writes the lens into the camera's perspective when it changes; other projections are somebody else's.
pub(super) fn set_projection(mut scopes: Query<(&Endoscope, &mut Projection), Changed<Endoscope>>) {
    for (scope, mut projection) in &mut scopes {
        // Looked at first, so that a projection that is left alone does not count as changed.
        if matches!(&*projection, Projection::Perspective(_))
            && let Projection::Perspective(lens) = &mut *projection
        {
            (lens.fov, lens.near, lens.far) = (scope.field_of_view_rad, scope.near_m, scope.far_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::camera::{OrthographicProjection, PerspectiveProjection};

    /// The projection after the endoscope was spawned beside it.
    fn written(projection: Projection) -> Projection {
        let mut app = App::new();
        app.add_systems(PostUpdate, set_projection);
        let lens = Endoscope { field_of_view_rad: 1.2, near_m: 0.003, far_m: 0.7 };
        // Without what it requires: those need the plugins of a camera.
        let scope = app.world_mut().spawn((projection, lens)).id();
        app.update();
        app.world().get::<Projection>(scope).expect("it was spawned").clone()
    }

    #[test]
    fn a_perspective_keeps_what_the_endoscope_does_not_know() {
        let plane = Vec4::new(0.0, 0.6, -0.8, -0.01);
        let given = PerspectiveProjection { aspect_ratio: 1.7, near_clip_plane: plane, ..default() };
        let Projection::Perspective(lens) = written(Projection::Perspective(given)) else { panic!("another kind") };
        assert_eq!((lens.fov, lens.near, lens.far), (1.2, 0.003, 0.7));
        assert_eq!((lens.aspect_ratio, lens.near_clip_plane), (1.7, plane));
    }

    #[test]
    fn another_kind_of_projection_is_left_alone() {
        let given = OrthographicProjection { scale: 0.01, ..OrthographicProjection::default_3d() };
        let kept = written(Projection::Orthographic(given));
        assert!(matches!(&kept, Projection::Orthographic(kept) if kept.scale == 0.01), "{kept:?}");
    }
}
