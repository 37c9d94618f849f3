//! The operating microscope as one component, and its lamp.

use super::{FollowCameras, ScopeLight, ScopeMask, SetLenses, ToolShadows};
use crate::render::finite_within;
use bevy::camera::{Hdr, Projection};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::transform::TransformSystems;

/// A camera that is an operating microscope: a narrow view at a working distance, magnification in steps, round
/// picture, linear HDR.
///
/// It looks along -Z and is in focus at the working distance. Everything it requires can be spawned beside it with other
/// values, or removed again. Of a perspective [`Projection`] the angle of view and the near and far distances follow the
/// microscope; other projections stay as they are.
///
/// Its lamp is an entity of its own, because it shines from beside the view: give it a [`MicroscopeLamp`] as a child.
/// [`StereoPair`](super::StereoPair) splits its picture for two eyes.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_surgery::prelude::*;
/// # fn setup(mut commands: Commands) {
/// let above = Transform::from_xyz(0.0, 0.25, 0.0).looking_at(Vec3::ZERO, Vec3::NEG_Z);
/// commands.spawn((Microscope::default(), above, children![MicroscopeLamp::default()]));
/// # }
/// ```
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(
    Camera3d,
    Hdr,
    // As for the endoscope: reds stay red, highlights white, and one sample per pixel where there is no GPU.
    Tonemapping::SomewhatBoringDisplayTransform,
    Msaa::Off,
    ScopeMask
)]
pub struct Microscope {
    /// Distance from the objective to what is in focus, metres; 0.01 to 10.
    pub working_distance_m: f32,
    /// Magnifications that can be chosen, as on the changer's dial; 0.1 to 1000 each. None of them: 1.
    pub steps: Vec<f32>,
    /// Which of the steps is chosen; beyond the last it is the last.
    pub step: usize,
    /// Diameter of the field at magnification 1, metres; 0.001 to 10. At 4x a field of 0.2 m shows 50 mm. The field is the
    /// circle that touches the upper and lower border of the frame.
    pub field_at_1x_m: f32,
    /// Nearest distance that is drawn, metres.
    pub near_m: f32,
    /// Farthest distance that is drawn, metres.
    pub far_m: f32,
}

impl Default for Microscope {
    fn default() -> Self {
        Self {
            working_distance_m: 0.25,
            steps: vec![4.0, 6.0, 10.0, 16.0, 25.0],
            step: 0,
            field_at_1x_m: 0.2,
            near_m: 0.01,
            far_m: 10.0,
        }
    }
}

impl Microscope {
    /// The chosen magnification.
    pub fn magnification(&self) -> f32 {
        let chosen = self.step.min(self.steps.len().saturating_sub(1));
        self.steps.get(chosen).map_or(1.0, |chosen| finite_within(*chosen, 0.1, 1000.0, 1.0))
    }

    /// Diameter of the field in focus, metres.
    pub fn field_m(&self) -> f32 {
        finite_within(self.field_at_1x_m, 1e-3, 10.0, Self::default().field_at_1x_m) / self.magnification()
    }

    /// Distance to what is in focus, metres, within its bounds.
    pub fn focus_m(&self) -> f32 {
        finite_within(self.working_distance_m, 0.01, 10.0, Self::default().working_distance_m)
    }

    /// Full vertical angle of view in radians, under which the field is seen from the objective.
    pub fn field_of_view_rad(&self) -> f32 {
        2.0 * (0.5 * self.field_m() / self.focus_m()).atan()
    }

    /// One step up; the last one stays.
    pub fn magnify(&mut self) {
        self.step = self.step.saturating_add(1).min(self.steps.len().saturating_sub(1));
    }

    /// One step down; the first one stays.
    pub fn reduce(&mut self) {
        self.step = self.step.min(self.steps.len()).saturating_sub(1);
    }
}

/// The lamp of a [`Microscope`]; spawn it as a child of the microscope, or of a camera of your own.
///
/// It keeps beside the view and aims at what is in focus: the entity's [`Transform`] is set when the microscope or the
/// lamp changes. The cone of its [`ToolShadows`] follows the magnification, so that the shadow map is spent on what is
/// seen. Under a parent without a microscope the default's focus counts.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(
    Transform,
    // 80 cd at 15 cm, as of an endoscope, are 222 cd at 25 cm; the room and the cavity send back more of it.
    ScopeLight = ScopeLight {
        intensity_cd: 222.0,
        ring_radius_m: 0.008,
        inner_angle_rad: 8_f32.to_radians(),
        outer_angle_rad: 16_f32.to_radians(),
        ambient_fraction: 0.15,
        ..default()
    },
    ToolShadows = ToolShadows { softness_m: 2e-4, ..default() }
)]
pub struct MicroscopeLamp {
    /// Place beside the view, in the plane of the objective: right and up of the picture, metres.
    pub offset_m: Vec2,
}

impl Default for MicroscopeLamp {
    /// Oblique by six degrees at 25 cm, as the main illumination of operating microscopes is.
    fn default() -> Self {
        Self { offset_m: Vec2::new(-0.018, 0.019) }
    }
}

impl MicroscopeLamp {
    /// Where the lamp is and where it looks, in the microscope's space.
    pub fn transform(&self, focus_m: f32) -> Transform {
        let offset_m = if self.offset_m.is_finite() { self.offset_m } else { Self::default().offset_m };
        // The picture's up is never along the beam: the focus lies before the objective.
        Transform::from_translation(offset_m.extend(0.0)).looking_at(Vec3::NEG_Z * focus_m, Vec3::Y)
    }
}

/// Half angle of the lamp's shadow map: twice the field, so that wide frames, and tools that reach in from beside it, are on it.
fn lamp_half_angle_rad(microscope: &Microscope) -> f32 {
    (microscope.field_m() / microscope.focus_m()).atan()
}

pub(super) fn build(app: &mut App) {
    app.register_type::<Microscope>().register_type::<MicroscopeLamp>();
    app.add_systems(
        PostUpdate,
        (
            // A camera that is both is a microscope.
            set_projection.in_set(SetLenses).after(super::endoscope::set_projection),
            aim_lamps.after(SetLenses).before(FollowCameras).before(TransformSystems::Propagate),
        ),
    );
}

fn set_projection(mut microscopes: Query<(&Microscope, &mut Projection), Changed<Microscope>>) {
    for (microscope, mut projection) in &mut microscopes {
        // Looked at first, so that a projection that is left alone does not count as changed.
        if matches!(&*projection, Projection::Perspective(_))
            && let Projection::Perspective(lens) = &mut *projection
        {
            (lens.fov, lens.near, lens.far) = (microscope.field_of_view_rad(), microscope.near_m, microscope.far_m);
        }
    }
}

fn aim_lamps(
    mut lamps: Query<(Ref<MicroscopeLamp>, &mut Transform, &mut ToolShadows, Option<Ref<ChildOf>>)>,
    microscopes: Query<Ref<Microscope>>,
) {
    for (lamp, mut transform, mut shadows, parent) in &mut lamps {
        let microscope = parent.as_ref().and_then(|parent| microscopes.get(parent.parent()).ok());
        let is_hung_anew = parent.is_some_and(|parent| parent.is_changed());
        if !(lamp.is_changed() || is_hung_anew || microscope.as_ref().is_some_and(Ref::is_changed)) {
            continue;
        }
        let microscope = microscope.map(Ref::into_inner);
        let default = Microscope::default();
        let microscope = microscope.unwrap_or(&default);
        transform.set_if_neq(lamp.transform(microscope.focus_m()));
        let half_angle_rad = lamp_half_angle_rad(microscope);
        if shadows.half_angle_rad != half_angle_rad {
            shadows.half_angle_rad = half_angle_rad;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_shrink_with_magnification() {
        let mut microscope = Microscope::default();
        assert!((microscope.field_m() - 0.05).abs() < 1e-6);
        // 50 mm under 25 cm.
        assert!((microscope.field_of_view_rad() - 2.0 * 0.1_f32.atan()).abs() < 1e-6);
        for wanted in [6.0, 10.0, 16.0, 25.0, 25.0] {
            microscope.magnify();
            assert_eq!(microscope.magnification(), wanted);
            assert!((microscope.field_m() - 0.2 / wanted).abs() < 1e-6);
        }
        for wanted in [16.0, 10.0, 6.0, 4.0, 4.0] {
            microscope.reduce();
            assert_eq!(microscope.magnification(), wanted);
        }
    }

    #[test]
    fn odd_values_are_clamped() {
        let at = |step, steps: &[f32]| Microscope { step, steps: steps.to_vec(), ..default() }.magnification();
        assert_eq!(at(99, &[4.0, 6.0]), 6.0);
        assert_eq!(at(0, &[]), 1.0);
        assert_eq!(at(0, &[f32::NAN]), 1.0);
        assert_eq!(at(0, &[-3.0]), 0.1);
        let mut far = Microscope { step: usize::MAX, ..default() };
        far.magnify();
        assert_eq!(far.step, 4);
        far.step = usize::MAX;
        far.reduce();
        assert_eq!(far.magnification(), 25.0);
        let mut none = Microscope { steps: Vec::new(), ..default() };
        none.magnify();
        none.reduce();
        assert_eq!(none.magnification(), 1.0);
        let odd = Microscope { working_distance_m: f32::NAN, field_at_1x_m: -1.0, ..default() };
        assert!(odd.field_of_view_rad().is_finite() && odd.field_of_view_rad() > 0.0);
    }

    #[test]
    fn the_lamp_meets_the_focus_at_six_degrees() {
        let lamp = MicroscopeLamp::default();
        let transform = lamp.transform(0.25);
        let hit = transform.translation + transform.forward() * transform.translation.distance(Vec3::NEG_Z * 0.25);
        assert!(hit.distance(Vec3::NEG_Z * 0.25) < 1e-6, "{hit}");
        let angle = transform.forward().angle_between(Vec3::NEG_Z).to_degrees();
        assert!((angle - 6.0).abs() < 0.1, "{angle}");
    }
}
