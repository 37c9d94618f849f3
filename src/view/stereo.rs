//! Two eyes, and further screens: cameras that follow another one.

use super::microscope::Microscope;
use super::{FollowCameras, ScopeMask, SetLenses};
use crate::render::finite_within;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{
    CameraProjection, CameraUpdateSystems, Exposure, Hdr, PerspectiveProjection, Projection, RenderTarget,
    SubCameraView, Viewport,
};
use bevy::core_pipeline::core_3d::check_msaa;
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::math::Vec3A;
use bevy::prelude::*;
use bevy::render::camera::NormalizedRenderTargetExt;
use bevy::render::texture::ManualTextureViews;
use bevy::render::view::ColorGrading;
use bevy::transform::TransformSystems;
use bevy::window::PrimaryWindow;

/// Splits a camera's picture for two eyes, side by side: the left half of its target, or viewport, for the left eye, the right half
/// for the right one.
///
/// Put it on a [`Microscope`], an [`Endoscope`](super::Endoscope) or any [`Camera3d`]: two child cameras
/// ([`StereoEye`], listed in [`StereoEyes`]) draw from then on, with the camera's lens, target, layers, mask and
/// exposure, and the camera itself is switched off. Without the component it draws again. The scene and its simulation
/// are there once. The right eye's camera takes the order after the camera's own, which no other camera of the same
/// target should have.
///
/// **Parallel axes with shifted frusta**, not toed-in cameras: both eyes see the same window at the convergence
/// distance, so that what lies there has no parallax, and nothing has any vertical parallax. A microscope with a common
/// main objective does the same: both beams pass it off its axis, and the picture planes stay parallel to the object's.
/// Toed-in cameras would add vertical parallax towards the corners, which tires. Parallax of a point at depth `z`:
/// [`StereoPair::parallax`].
///
/// Of a projection that is not perspective each eye gets a copy, without convergence.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct StereoPair {
    /// Distance between the eyes, metres; for a microscope that of the two beams at the objective. 0 to 1.
    pub interocular_m: f32,
    /// Distance at which there is no parallax, metres; `None` for the working distance of a [`Microscope`], or 0.25 m.
    pub convergence_m: Option<f32>,
    /// Exchanges the halves, for viewing with crossed eyes.
    pub is_crossed: bool,
    /// Whether the eyes draw. In place of [`Camera::is_active`], which is off while there is a pair.
    pub is_active: bool,
}

impl Default for StereoPair {
    fn default() -> Self {
        Self { interocular_m: 0.024, convergence_m: None, is_crossed: false, is_active: true }
    }
}

impl StereoPair {
    /// Distance between the eyes within its bounds, metres.
    fn distance_m(&self) -> f32 {
        finite_within(self.interocular_m, 0.0, 1.0, Self::default().interocular_m)
    }

    /// Distance without parallax for a camera that may be a microscope, metres.
    pub fn convergence_m(&self, microscope: Option<&Microscope>) -> f32 {
        let focus_m = microscope.map_or(Microscope::default().working_distance_m, Microscope::focus_m);
        self.convergence_m.map_or(focus_m, |distance_m| finite_within(distance_m, 1e-3, 1e3, focus_m))
    }

    /// How much farther right the left eye sees a point at a depth than the right eye, in halves of a picture's width:
    /// positive before the convergence distance, negative beyond. `tan_half_width` is the tangent of half the horizontal
    /// angle of view.
    pub fn parallax(&self, depth_m: f32, convergence_m: f32, tan_half_width: f32) -> f32 {
        self.distance_m() * (1.0 / depth_m - 1.0 / convergence_m) / tan_half_width
    }
}

/// One of the two cameras of a [`StereoPair`].
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone)]
pub enum StereoEye {
    /// Sees from the left.
    Left,
    /// Sees from the right.
    Right,
}

/// The cameras of a [`StereoPair`], on the same entity as the pair.
#[derive(Component, Clone, Copy, Debug, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone)]
pub struct StereoEyes {
    /// The left eye's camera.
    #[entities]
    pub left: Entity,
    /// The right eye's camera.
    #[entities]
    pub right: Entity,
}

/// A perspective whose window is shifted sideways: what an eye beside the axis sees.
///
/// The angle of the field is fitted into the shorter side of the picture, because half a screen may be narrower than high.
#[derive(Clone, Debug, Reflect)]
#[reflect(Default, Clone)]
pub struct ShiftedPerspective {
    /// The lens without the shift; its angle of view follows the picture's shape.
    pub lens: PerspectiveProjection,
    /// Full angle of view across the picture's shorter side, radians.
    pub field_of_view_rad: f32,
    /// Tangent of the angle from the camera's axis to the middle of the picture, positive to the right.
    pub shift: f32,
}

impl Default for ShiftedPerspective {
    fn default() -> Self {
        let lens = PerspectiveProjection::default();
        Self { field_of_view_rad: lens.fov, lens, shift: 0.0 }
    }
}

impl ShiftedPerspective {
    fn shifted(&self, mut clip_from_view: Mat4) -> Mat4 {
        clip_from_view.z_axis.x += clip_from_view.x_axis.x * self.shift;
        clip_from_view
    }
}

impl CameraProjection for ShiftedPerspective {
    fn get_clip_from_view(&self) -> Mat4 {
        self.shifted(self.lens.get_clip_from_view())
    }

    fn get_clip_from_view_for_sub(&self, sub_view: &SubCameraView) -> Mat4 {
        self.shifted(self.lens.get_clip_from_view_for_sub(sub_view))
    }

    fn update(&mut self, width: f32, height: f32) {
        self.lens.update(width, height);
        let narrow = self.lens.aspect_ratio.min(1.0);
        self.lens.fov = 2.0 * ((0.5 * self.field_of_view_rad).tan() / narrow).atan();
    }

    fn far(&self) -> f32 {
        self.lens.far
    }

    fn get_frustum_corners(&self, z_near: f32, z_far: f32) -> [Vec3A; 8] {
        let corners = self.lens.get_frustum_corners(z_near, z_far);
        corners.map(|corner| corner + Vec3A::X * (self.shift * corner.z.abs()))
    }
}

/// A camera that shows what another one sees, on a target of its own: a second window, a picture for a recording.
///
/// Each frame it takes the pose and the lens of that camera; the shape of the picture is its own. Everything else
/// (target, order, mask) is spawned beside it; what it requires is what a [`Microscope`] does, but for the mask. Of a
/// [`StereoPair`] it shows what lies between the eyes. A camera that follows a follower is a frame late.
#[derive(Component, Clone, Copy, Debug, FromTemplate, PartialEq, Eq, Reflect)]
#[reflect(Component, Clone)]
#[require(Camera3d, Hdr, Tonemapping::SomewhatBoringDisplayTransform, Msaa::Off)]
pub struct MonitorView {
    /// The camera that is followed.
    #[entities]
    pub of: Entity,
}

pub(super) fn build(app: &mut App) {
    app.register_type::<StereoPair>()
        .register_type::<StereoEye>()
        .register_type::<StereoEyes>()
        .register_type::<ShiftedPerspective>()
        .register_type::<MonitorView>()
        .add_observer(open_eyes)
        .add_observer(close_eyes);
    // Where no camera can be, nothing follows one.
    if !app.is_plugin_added::<bevy::camera::CameraPlugin>() {
        return;
    }
    app.add_systems(
        PostUpdate,
        (
            (
                follow::<RenderTarget>,
                follow::<Hdr>,
                follow::<Tonemapping>,
                follow::<DebandDither>,
                follow::<Msaa>,
                follow::<Exposure>,
                follow::<ColorGrading>,
                follow::<RenderLayers>,
                follow::<ScopeMask>,
            ),
            drive_eyes,
            follow_cameras,
        )
            .chain()
            .in_set(FollowCameras)
            // Bevy corrects the samples of deferred cameras there.
            .after(check_msaa)
            .after(SetLenses)
            .before(CameraUpdateSystems)
            .before(TransformSystems::Propagate),
    );
}

fn open_eyes(added: On<Insert, StereoPair>, pairs: Query<Has<StereoEyes>>, mut commands: Commands) {
    let rig = added.entity;
    if pairs.get(rig).unwrap_or(true) {
        return;
    }
    // They wake when they know their place on the target.
    let asleep = || Camera { is_active: false, ..default() };
    let mut eye = |eye| commands.spawn((Camera3d::default(), asleep(), eye, ChildOf(rig))).id();
    let (left, right) = (eye(StereoEye::Left), eye(StereoEye::Right));
    commands.entity(rig).insert(StereoEyes { left, right });
}

fn close_eyes(
    removed: On<Remove, StereoPair>,
    mut pairs: Query<(&StereoEyes, Option<&mut Camera>)>,
    mut commands: Commands,
) {
    if let Ok((eyes, camera)) = pairs.get_mut(removed.entity) {
        if let Some(mut camera) = camera {
            camera.is_active = true;
        }
        commands.entity(eyes.left).try_despawn();
        commands.entity(eyes.right).try_despawn();
        commands.entity(removed.entity).try_remove::<StereoEyes>();
    }
}

/// Keeps a component of the eyes as it is on the camera that they belong to.
fn follow<C: Component + Clone>(
    rigs: Query<(Ref<StereoEyes>, Option<Ref<C>>)>,
    eyes: Query<Has<C>, With<StereoEye>>,
    mut commands: Commands,
) {
    for (pair, component) in &rigs {
        for eye in [pair.left, pair.right] {
            let Ok(has_one) = eyes.get(eye) else { continue };
            match &component {
                Some(component) if component.is_changed() || pair.is_changed() || !has_one => {
                    commands.entity(eye).insert(C::clone(component));
                }
                None if has_one => {
                    commands.entity(eye).remove::<C>();
                }
                _ => {}
            }
        }
    }
}

type Rig = (
    &'static StereoPair,
    &'static StereoEyes,
    Option<&'static Microscope>,
    &'static RenderTarget,
    &'static Projection,
    &'static mut Camera,
);

/// Writes places, lenses and halves of the target.
fn drive_eyes(
    mut rigs: Query<Rig, Without<StereoEye>>,
    mut eyes: Query<(&mut Camera, &mut Transform, &mut Projection), With<StereoEye>>,
    primary_window: Query<Entity, With<PrimaryWindow>>,
    windows: Query<(Entity, &Window)>,
    images: Res<Assets<Image>>,
    texture_views: Res<ManualTextureViews>,
) {
    for (pair, StereoEyes { left, right }, microscope, target, lens, mut rig) in &mut rigs {
        if rig.is_active {
            rig.is_active = false;
        }
        let target = target.normalize(primary_window.iter().next());
        let info = target.and_then(|target| target.get_render_target_info(windows, &images, &texture_views).ok());
        let size_px = info.map(|info| info.physical_size).filter(|size| size.x > 1 && size.y > 0);
        // Side by side in the camera's own viewport, where it has one.
        let corner_px = rig.viewport.as_ref().map_or(UVec2::ZERO, |viewport| viewport.physical_position);
        let size_px = size_px.map(|size| rig.viewport.as_ref().map_or(size, |viewport| viewport.physical_size));
        let half_px = size_px.map(|size| UVec2::new(size.x / 2, size.y));
        let reach_m = 0.5 * pair.distance_m();
        let convergence_m = pair.convergence_m(microscope);
        for (eye, side, order) in [(*left, -1.0, 0), (*right, 1.0, 1)] {
            let Ok((mut camera, mut transform, mut projection)) = eyes.get_mut(eye) else { continue };
            transform.set_if_neq(Transform::from_xyz(side * reach_m, 0.0, 0.0));
            let is_right_half = (side > 0.0) != pair.is_crossed;
            let viewport = half_px.map(|physical_size| Viewport {
                physical_position: corner_px + UVec2::new(if is_right_half { physical_size.x } else { 0 }, 0),
                physical_size,
                ..default()
            });
            camera.is_active = pair.is_active && viewport.is_some();
            camera.viewport = viewport;
            // One after the other: Bevy warns of cameras on one target whose order is open.
            camera.order = rig.order + order;
            camera.clear_color = rig.clear_color;
            (camera.output_mode, camera.msaa_writeback) = (rig.output_mode, rig.msaa_writeback);
            *projection = match lens {
                Projection::Perspective(lens) => {
                    let mut shifted = ShiftedPerspective {
                        lens: lens.clone(),
                        field_of_view_rad: lens.fov,
                        shift: -side * reach_m / convergence_m,
                    };
                    if let Some(half) = half_px {
                        shifted.update(half.x as f32, half.y as f32);
                    }
                    Projection::custom(shifted)
                }
                other => other.clone(),
            };
        }
    }
}

/// Monitors take pose and lens of the camera that they follow.
fn follow_cameras(
    mut poses: ParamSet<(TransformHelper, Query<&mut Transform, With<MonitorView>>)>,
    monitors: Query<(Entity, &MonitorView, Option<&ChildOf>)>,
    mut lenses: ParamSet<(Query<&Projection>, Query<&mut Projection, With<MonitorView>>)>,
) {
    for (monitor, MonitorView { of }, parent) in &monitors {
        if monitor == *of {
            continue;
        }
        let helper = poses.p0();
        // A camera that is gone leaves the monitor where it is.
        let Ok(world_from_camera) = helper.compute_global_transform(*of) else { continue };
        let world_from_parent =
            parent.and_then(|parent| helper.compute_global_transform(parent.parent()).ok()).unwrap_or_default();
        let pose = world_from_camera.reparented_to(&world_from_parent);
        if let Ok(mut transform) = poses.p1().get_mut(monitor) {
            transform.set_if_neq(pose);
        }
        let lens = lenses.p0().get(*of).ok().cloned();
        if let (Some(lens), Ok(mut own)) = (lens, lenses.p1().get_mut(monitor)) {
            *own = lens;
        }
    }
}
