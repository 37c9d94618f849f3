//! The picture: the designer's own camera, and looking through those of the scene.

use crate::Designer;
use crate::common::{Args, Stage};
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{CameraOutputMode, Hdr, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::gizmos::transform_gizmo::{TransformGizmoCamera, TransformGizmoFocus, TransformGizmoSettings};
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy::window::PrimaryWindow;
use bevy_egui::PrimaryEguiContext;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::organ::OrganShape;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::NotAuthored;
use bevy_surgery::view::{ScopeLight, StereoEye, StereoPair};

/// The layer of Bevy's gizmo.
const GIZMO_LAYER: usize = 15;

/// Size of the gizmo as a share of half the picture's height.
const GIZMO_SIZE: f32 = 0.24;

/// The designer's own camera.
#[derive(Component)]
pub struct OwnView;

/// Whether a camera of the scene draws where nobody looks through it here.
#[derive(Component)]
pub struct DrawsElsewhere(pub bool);

pub fn build(app: &mut App) {
    app.add_plugins(PanOrbitCameraPlugin)
        .add_observer(rest_at_first)
        .add_systems(Startup, open)
        .add_systems(PreUpdate, (place_picture, light_up, tame_gizmo).chain());
}

fn open(mut commands: Commands, stage: Res<Stage>) {
    let lens = PerspectiveProjection { near: 1e-3, far: 20.0, fov: 0.8, ..default() };
    commands.spawn((
        NotAuthored,
        OwnView,
        (Camera3d::default(), Hdr, Msaa::Off, Tonemapping::SomewhatBoringDisplayTransform),
        Projection::Perspective(lens),
        stage.target.clone(),
        TransformGizmoCamera,
        Transform::from_xyz(0.05, 0.12, 0.3).looking_at(Vec3::ZERO, Vec3::Y),
        PanOrbitCamera { zoom_lower_limit: 1e-3, use_real_time: true, ..default() },
    ));
    let panels = Camera {
        order: 100,
        output_mode: CameraOutputMode::Write {
            blend_state: Some(BlendState::ALPHA_BLENDING),
            clear_color: ClearColorConfig::None,
        },
        clear_color: ClearColorConfig::Custom(Color::NONE),
        ..default()
    };
    // Draws nothing but the panels.
    commands.spawn((
        NotAuthored,
        PrimaryEguiContext,
        (Camera2d, Msaa::Off),
        panels,
        RenderLayers::none(),
        stage.target.clone(),
    ));
}

/// A camera that comes with a scene rests until it is looked through.
fn rest_at_first(
    added: On<Add, Camera3d>,
    mut cameras: Query<
        (&mut Camera, Has<StereoPair>),
        (Without<NotAuthored>, Without<StereoEye>, Without<RenderLayers>),
    >,
    mut commands: Commands,
) {
    if let Ok((mut camera, is_pair)) = cameras.get_mut(added.entity) {
        if !is_pair {
            commands.entity(added.entity).insert(DrawsElsewhere(camera.is_active));
        }
        camera.is_active = false;
    }
}

/// The camera that is looked through draws between the panels; the others of the scene rest.
fn place_picture(
    mut designer: ResMut<Designer>,
    windows: Query<&Window, With<PrimaryWindow>>,
    args: Res<Args>,
    mut own: Query<&mut Camera, With<OwnView>>,
    mut others: Query<
        (Entity, &mut Camera, Option<&mut StereoPair>, Option<&DrawsElsewhere>),
        (With<Camera3d>, Without<OwnView>, Without<NotAuthored>, Without<StereoEye>, Without<RenderLayers>),
    >,
    mut commands: Commands,
) {
    let scale = windows.iter().next().map_or(1.0, Window::scale_factor);
    let size_px = windows.iter().next().map_or(args.size, Window::physical_size);
    let low = (designer.picture.min * scale).as_uvec2().min(size_px.saturating_sub(UVec2::ONE));
    let high = (designer.picture.max * scale).as_uvec2().clamp(low + 1, size_px.max(low + 1));
    let viewport = Viewport { physical_position: low, physical_size: high - low, ..default() };
    if designer.through.is_some_and(|through| !others.contains(through)) {
        designer.through = None;
    }
    let is_whole = designer.picture.is_empty();
    for (entity, mut camera, pair, elsewhere) in &mut others {
        if elsewhere.is_none() {
            let draws = pair.as_ref().map_or(camera.is_active, |pair| pair.is_active);
            commands.entity(entity).insert(DrawsElsewhere(draws));
        }
        let is_looked_through = designer.through == Some(entity);
        match pair {
            Some(mut pair) if pair.is_active != is_looked_through => pair.is_active = is_looked_through,
            Some(_) => {}
            None if camera.is_active != is_looked_through => camera.is_active = is_looked_through,
            None => {}
        }
        let wanted = is_looked_through.then(|| viewport.clone());
        if !same(&camera.viewport, &wanted) {
            camera.viewport = wanted;
        }
    }
    for mut camera in &mut own {
        let is_active = designer.through.is_none();
        if camera.is_active != is_active {
            camera.is_active = is_active;
        }
        let wanted = (!is_whole).then(|| viewport.clone());
        if !same(&camera.viewport, &wanted) {
            camera.viewport = wanted;
        }
    }
}

fn same(one: &Option<Viewport>, other: &Option<Viewport>) -> bool {
    let area = |viewport: &Option<Viewport>| viewport.as_ref().map(|it| (it.physical_position, it.physical_size));
    area(one) == area(other)
}

/// Where nothing else shines there is a lamp at the designer's eye.
fn light_up(
    mut own: Query<(Entity, Option<&mut ScopeLight>, &PanOrbitCamera), With<OwnView>>,
    scope_lights: Query<(), (With<ScopeLight>, Without<OwnView>)>,
    lights: Query<(), Or<(With<DirectionalLight>, With<PointLight>, With<SpotLight>)>>,
    mut commands: Commands,
) {
    let is_dark = scope_lights.is_empty() && lights.is_empty();
    for (entity, lamp, eye) in &mut own {
        // As bright from far away as from near.
        let far = eye.radius.unwrap_or(eye.target_radius) / 0.15;
        let intensity_cd = 80.0 * (far * far).clamp(0.01, 1e4);
        match lamp {
            Some(_) if !is_dark => drop(commands.entity(entity).remove::<ScopeLight>()),
            Some(mut lamp) if lamp.intensity_cd != intensity_cd => lamp.intensity_cd = intensity_cd,
            None if is_dark => {
                commands.entity(entity).insert(ScopeLight { ring_radius_m: 0.02, intensity_cd, ..default() });
            }
            _ => {}
        }
    }
}

/// Bevy's gizmo has a camera of its own, which must draw as ours do and over what they drew.
fn tame_gizmo(
    mut overlays: Query<
        (Entity, &RenderLayers, &mut Camera, &mut Projection, Has<Hdr>),
        (With<Camera3d>, Without<TransformGizmoCamera>),
    >,
    lenses: Query<&Projection, With<TransformGizmoCamera>>,
    focus: Query<(), With<TransformGizmoFocus>>,
    through: Query<Entity, With<TransformGizmoCamera>>,
    own: Query<Entity, With<OwnView>>,
    pairs: Query<(), With<StereoPair>>,
    designer: Res<Designer>,
    stage: Res<Stage>,
    mut settings: ResMut<TransformGizmoSettings>,
    mut commands: Commands,
) {
    // As large on the screen whatever the lens.
    if let Some(Projection::Perspective(lens)) = lenses.iter().next() {
        let factor = GIZMO_SIZE * (0.5 * lens.fov).tan();
        if settings.screen_scale_factor != factor {
            settings.screen_scale_factor = factor;
        }
    }
    for (entity, layers, mut camera, mut lens, is_tamed) in &mut overlays {
        if *layers != RenderLayers::layer(GIZMO_LAYER) {
            continue;
        }
        if !is_tamed {
            camera.clear_color = ClearColorConfig::None;
            camera.order = 90;
            let look = (Hdr, Msaa::Off, Tonemapping::SomewhatBoringDisplayTransform);
            commands.entity(entity).insert((look, stage.target.clone()));
        }
        // Bevy's own begins ten centimetres away: farther than most of an operating field.
        if let Some(wanted) = lenses.iter().next() {
            *lens = wanted.clone();
        }
        // It draws over all of the picture what the last camera drew, of a pair the right half.
        let is_pair = designer.through.is_some_and(|through| pairs.contains(through));
        let is_active = !focus.is_empty() && !is_pair;
        if camera.is_active != is_active {
            camera.is_active = is_active;
        }
    }
    // The gizmo is where one looks from.
    let wanted = designer.through.or(own.iter().next());
    for camera in through.iter().filter(|camera| Some(*camera) != wanted) {
        commands.entity(camera).remove::<TransformGizmoCamera>();
    }
    if let Some(wanted) = wanted.filter(|wanted| !through.contains(*wanted)) {
        commands.entity(wanted).insert(TransformGizmoCamera);
    }
}

/// The designer's eye begins where the first camera of the scene is.
pub fn begin(world: &mut World) {
    let mut cameras =
        world.query_filtered::<(Entity, &Transform), (With<Camera3d>, Without<NotAuthored>, Without<StereoEye>)>();
    let Some((camera, _)) = cameras.iter(world).min_by_key(|(entity, _)| *entity) else { return };
    let mut place = GlobalTransform::IDENTITY;
    let mut at = Some(camera);
    while let Some(entity) = at {
        place = GlobalTransform::from(world.get::<Transform>(entity).copied().unwrap_or_default()) * place;
        at = world.get::<ChildOf>(entity).map(ChildOf::parent);
    }
    let far_m = world.get::<Microscope>(camera).map_or(0.2, Microscope::focus_m);
    let focus = place.translation() + far_m * *place.forward();
    let mut own = world.query_filtered::<(&mut Transform, &mut PanOrbitCamera), With<OwnView>>();
    for (mut transform, mut eye) in own.iter_mut(world) {
        *transform = place.compute_transform().with_scale(Vec3::ONE);
        *eye = PanOrbitCamera { focus, zoom_lower_limit: 1e-3, use_real_time: true, ..default() };
    }
}

/// Turns the designer's eye to what is chosen, or to everything.
pub fn frame(world: &mut World, chosen: Option<Entity>) {
    let mut bodies = world.query::<(Entity, &GlobalTransform, Option<&OrganShape>, Option<&CtVolume>)>();
    let volumes = world.resource::<Assets<Volume>>();
    let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
    for (entity, place, shape, volume) in bodies.iter(world) {
        let wanted = match chosen {
            Some(chosen) => chosen == entity,
            None => shape.is_some() || volume.is_some(),
        };
        if !wanted || world.get::<Hollow>(entity).is_some() && chosen.is_none() {
            continue;
        }
        let mut points = vec![Vec3::ZERO];
        if let Some(shape) = shape {
            points = shape.positions_m().iter().step_by(7).copied().collect();
        } else if let Some(volume) = volume.and_then(|volume| volumes.get(&volume.0)) {
            let half = volume.grid().half_axes_m();
            points = (0..8)
                .map(|corner| (0..3).map(|axis| half[axis] * if corner >> axis & 1 == 1 { 1.0 } else { -1.0 }).sum())
                .collect();
        }
        for point in points {
            let at = place.transform_point(point);
            (low, high) = (low.min(at), high.max(at));
        }
    }
    if low.cmpgt(high).any() {
        return;
    }
    let radius_m = (0.5 * low.distance(high)).max(0.01);
    let mut eyes = world.query_filtered::<&mut PanOrbitCamera, With<OwnView>>();
    for mut eye in eyes.iter_mut(world) {
        eye.target_focus = 0.5 * (low + high);
        eye.target_radius = 2.4 * radius_m;
        eye.force_update = true;
    }
}

/// Looks through the next camera of the scene, and then through the designer's own again.
pub fn next_camera(world: &mut World, designer: &mut Designer) {
    let mut cameras = world
        .query_filtered::<Entity, (With<Camera3d>, Without<NotAuthored>, Without<StereoEye>, Without<RenderLayers>)>();
    let mut all: Vec<Entity> = cameras.iter(world).collect();
    all.sort();
    let place = designer.through.and_then(|through| all.iter().position(|camera| *camera == through));
    designer.through = all.get(place.map_or(0, |place| place + 1)).copied();
    designer.status = match designer.through {
        Some(camera) => {
            let name = world.get::<Name>(camera).map_or_else(|| camera.to_string(), Name::to_string);
            format!("Looking through {name}")
        }
        None => "Looking with the designer's own eye".into(),
    };
}
