//! Simple instruments for the example: a probe, an electrode, a needle and a grasper at the end of a ray.

use crate::common::{Args, Script, Stage, Viewer};
use bevy::camera::visibility::RenderLayers;
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_surgery::prelude::*;

/// The organ that is operated on.
#[derive(Component)]
pub struct Patient;

/// What works at the end of the ray.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Instrument {
    /// Presses.
    Probe,
    /// Coagulates with this power, watts.
    Coagulation(f64),
    /// Cuts with this power, watts.
    Cut(f64),
    /// Opens a vessel with each thrust.
    Needle,
    /// Takes hold and lifts.
    Grasper,
}

/// What the mouse or the script does.
#[derive(Resource)]
pub struct Held {
    /// What is held.
    pub instrument: Instrument,
    /// Along which it points at the organ.
    pub ray: Option<Ray3d>,
    /// Whether it is at work.
    pub is_on: bool,
    /// How far the grasper is lifted, metres.
    pub lift_m: f32,
    was_on: bool,
    contact: Option<OrganHit>,
    /// Where the organ was met as the instrument was switched on.
    began: Option<OrganHit>,
    /// How deep the probe is beyond that, metres.
    depth_m: f32,
    /// Middle of the instrument's tip, where it does not follow from the contact.
    tip_m: Option<Vec3>,
}

impl Default for Held {
    fn default() -> Self {
        Self {
            instrument: Instrument::Probe,
            ray: None,
            is_on: false,
            lift_m: 0.0,
            was_on: false,
            contact: None,
            began: None,
            depth_m: 0.0,
            tip_m: None,
        }
    }
}

/// The rod that is seen.
#[derive(Component)]
struct Shaft;

const SHAFT_RADIUS_M: f32 = 0.0022;
const SHAFT_LENGTH_M: f32 = 0.2;
const DENT_DEPTH_M: f32 = 0.007;
/// The grasper's jaws: what they hold, and how hard.
const JAWS_RADIUS_M: f32 = 0.01;
const GRIP_N: f32 = 12.0;

pub fn build(app: &mut App) {
    app.init_resource::<Held>()
        .add_systems(Startup, spawn_shaft)
        .add_systems(PreUpdate, soften)
        .add_systems(FixedUpdate, (touch, press).chain().in_set(SurgerySystems::Touch))
        .add_systems(Update, (place_shaft, tell));
    let is_played = app.world().resource::<Stage>().viewer == Viewer::Person
        && app.world().resource::<Args>().script == Script::None;
    if is_played {
        app.add_systems(Update, follow_mouse);
    }
}

fn follow_mouse(
    mut held: ResMut<Held>,
    keys: Res<ButtonInput<KeyCode>>,
    buttons: Res<ButtonInput<MouseButton>>,
    wheel: Res<AccumulatedMouseScroll>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut cameras: Query<(&Camera, &GlobalTransform, &mut PanOrbitCamera), With<Endoscope>>,
) {
    for (key, instrument) in [
        (KeyCode::Digit1, Instrument::Probe),
        (KeyCode::Digit2, Instrument::Coagulation(30.0)),
        (KeyCode::Digit3, Instrument::Cut(40.0)),
        (KeyCode::Digit4, Instrument::Needle),
        (KeyCode::Digit5, Instrument::Grasper),
    ] {
        if keys.just_pressed(key) {
            held.instrument = instrument;
        }
    }
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    held.is_on = buttons.pressed(MouseButton::Left);
    let holds = held.is_on && held.instrument == Instrument::Grasper;
    let Some((camera, eye, mut orbit)) = cameras.iter_mut().next() else { return };
    held.ray = cursor.and_then(|at| camera.viewport_to_world(eye, at).ok());
    // The wheel moves the camera, or what is held.
    orbit.zoom_sensitivity = if holds { 0.0 } else { 1.0 };
    // With something between the jaws arrows and wheel lift it.
    let arrows = f32::from(keys.pressed(KeyCode::ArrowUp)) - f32::from(keys.pressed(KeyCode::ArrowDown));
    let turned = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    held.lift_m += 0.0006 * arrows + 0.003 * turned;
}

/// Finds where the ray meets the organ, and does there what the instrument does.
fn touch(
    mut held: ResMut<Held>,
    picking: OrganPicking,
    patients: Query<(), With<Patient>>,
    mut touches: MessageWriter<OrganTouch>,
) {
    held.contact = held.ray.and_then(|ray| picking.cast_ray_at(ray, 1.0, |organ| patients.contains(organ)));
    let is_thrust = held.is_on && !held.was_on;
    held.was_on = held.is_on;
    if !held.is_on {
        held.began = None;
        (held.lift_m, held.depth_m) = (0.0, 0.0);
    } else if held.began.is_none() {
        held.began = held.contact;
    }
    let Some(hit) = held.contact.filter(|_| held.is_on) else { return };
    let action = match held.instrument {
        Instrument::Probe => ReactionAction::Press { pressure: 1.0, radius_m: 0.016 },
        Instrument::Coagulation(power_w) => ReactionAction::Cauterize(Cautery::coagulate(power_w)),
        Instrument::Cut(power_w) => ReactionAction::Cauterize(Cautery::cut(power_w)),
        Instrument::Grasper => return,
        Instrument::Needle if is_thrust => ReactionAction::Wound(Wound::default()),
        Instrument::Needle => return,
    };
    touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 0, action });
}

type Stiff = (Entity, &'static Organ, &'static OrganShape);

/// Makes the organ soft when it is there: a body of its own tissue, held by ligaments at its back.
fn soften(
    mut commands: Commands,
    args: Res<Args>,
    models: Res<Assets<OrganModel>>,
    gravity: Res<SurgeryGravity>,
    patients: Query<Stiff, (With<Patient>, Without<ElasticBody>)>,
) -> Result {
    for (entity, organ, shape) in &patients {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        let tissue = match args.preset {
            OrganPreset::Gallbladder => ElasticTissue::GALLBLADDER,
            OrganPreset::Kidney => ElasticTissue::KIDNEY,
            _ => ElasticTissue::LIVER,
        };
        let surface = model.surface(shape);
        let mut lattice = DeformLattice::around_organ(model, 3, 0.02)?;
        // Finer where it is seen and worked on: its surface towards the camera.
        let is_worked_on = |n: usize| surface.normals[n].dot(Vec3::new(0.0, 0.45, 0.9)) > 0.3;
        lattice.refine_where(4, |low, high| {
            let is_in = |position_m: &Vec3| position_m.cmpge(low).all() && position_m.cmple(high).all();
            surface.positions_m.iter().enumerate().any(|(n, position_m)| is_in(position_m) && is_worked_on(n))
        })?;
        let (low, high) = model.mesh.bounds_m();
        let mut body = ElasticBody::of_organ(&lattice, model, tissue)?
            .pinned_where(|rest_m| rest_m.z < low.z + 0.35 * (high.z - low.z));
        // As it lies there it hangs in its ligaments already.
        body.rests_under_m_per_s2 = gravity.world_m_per_s2;
        // Only volumes have to be told where matter comes from.
        body.publishes = false;
        commands.entity(entity).insert((lattice, body));
    }
    Ok(())
}

/// Pushes the probe into the organ, and lifts what the grasper holds.
fn press(
    mut held: ResMut<Held>,
    time: Res<Time>,
    scopes: Query<&GlobalTransform, With<Endoscope>>,
    mut presses: MessageWriter<PressBody>,
    mut grasps: MessageWriter<GraspBody>,
) {
    held.tip_m = None;
    let (Some(began), Some(ray)) = (held.began.filter(|_| held.is_on), held.ray) else { return };
    let (at, outward, body) = (began.position_world_m, began.normal_world, began.organ);
    match held.instrument {
        Instrument::Probe => {
            // It slides along the surface as it was met, and goes deeper than that.
            let share = 1.0 - (-time.delta_secs() / 0.12).exp();
            held.depth_m += (DENT_DEPTH_M - held.depth_m) * share;
            let along = ray.intersect_plane(at, InfinitePlane3d::new(outward)).map(|distance| ray.get_point(distance));
            let tip_m = along.unwrap_or(at) + outward * (SHAFT_RADIUS_M - held.depth_m);
            let shape = ToolShape::Capsule { tip_m, back_m: back_of(tip_m), radius_m: SHAFT_RADIUS_M };
            presses.write(PressBody { body, tool: 0, shape, friction: 0.1 });
            held.tip_m = Some(tip_m);
        }
        Instrument::Grasper => {
            // It moves in the plane through where it took hold that faces the camera.
            let Some(eye) = scopes.iter().next() else { return };
            let plane = InfinitePlane3d::new(*eye.back());
            let along = ray.intersect_plane(at, plane).map(|distance| ray.get_point(distance));
            let position_world_m = along.unwrap_or(at) + Vec3::Y * held.lift_m;
            let rotation_world = Quat::IDENTITY;
            let (radius_m, grip_force_n, friction) = (JAWS_RADIUS_M, GRIP_N, 0.8);
            let tool = 1;
            grasps.write(GraspBody { body, tool, position_world_m, rotation_world, radius_m, grip_force_n, friction });
            held.tip_m = Some(position_world_m);
        }
        _ => {}
    }
}

/// The other end of a shaft: instruments come in through the abdominal wall on the right.
fn back_of(tip_m: Vec3) -> Vec3 {
    tip_m + (Vec3::new(0.13, 0.17, 0.14) - tip_m).normalize_or(Vec3::Y) * SHAFT_LENGTH_M
}

fn spawn_shaft(
    mut commands: Commands,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let steel = StandardMaterial {
        base_color: Color::srgb(0.62, 0.64, 0.68),
        metallic: 0.6,
        perceptual_roughness: 0.35,
        ..default()
    };
    commands.spawn((
        Shaft,
        Mesh3d(meshes.add(Capsule3d::new(SHAFT_RADIUS_M, SHAFT_LENGTH_M))),
        MeshMaterial3d(materials.add(steel)),
        RenderLayers::layer(1),
        Visibility::Hidden,
    ));
    let lamp = PointLight { intensity: 1500.0, range: 2.0, ..default() };
    commands.spawn((lamp, Transform::from_xyz(-0.05, 0.2, 0.25), RenderLayers::layer(1)));
}

/// Says when the grasper has lost what it held.
fn tell(mut slipped: MessageReader<GraspSlipped>, mut torn: MessageReader<TissueTorn>) {
    for slip in slipped.read() {
        info!("the organ slipped out of the jaws at a pull of {:.1} N", slip.pull_n);
    }
    for tear in torn.read() {
        info!("the organ tore between the jaws at a pull of {:.1} N, stretched by {:.2}", tear.pull_n, tear.stretch);
    }
}

/// Holds the rod by its tip.
fn place_shaft(held: Res<Held>, mut shafts: Query<(&mut Transform, &mut Visibility), With<Shaft>>) {
    for (mut transform, mut visibility) in &mut shafts {
        let lift_m = if held.is_on { 0.4 * SHAFT_RADIUS_M } else { 0.006 };
        let on_surface = held.contact.map(|hit| hit.position_world_m + hit.normal_world * lift_m);
        let Some(tip) = held.tip_m.or(on_surface) else {
            *visibility = Visibility::Hidden;
            continue;
        };
        *visibility = Visibility::Inherited;
        let back = back_of(tip);
        transform.translation = tip.midpoint(back);
        transform.rotation = Quat::from_rotation_arc(Vec3::Y, (back - tip).normalize_or(Vec3::Y));
    }
}
