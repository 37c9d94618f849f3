//! Simple instruments for the example: a probe, an electrode and a needle at the end of a ray.

use crate::common::{Args, Script, Stage, Viewer};
use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;

/// The organ that is operated on, and the dent that the probe has made in it.
#[derive(Component, Default)]
pub struct Patient {
    /// Where it was pressed last.
    place: SurfacePoint,
    /// How deep it is now, metres.
    depth_m: f32,
}

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
    was_on: bool,
    contact: Option<OrganHit>,
}

/// The rod that is seen.
#[derive(Component)]
struct Shaft;

const SHAFT_RADIUS_M: f32 = 0.0022;
const SHAFT_LENGTH_M: f32 = 0.2;
const DENT_DEPTH_M: f32 = 0.007;
/// Standard deviation of the dent's bell.
const DENT_WIDTH_M: f32 = 0.011;

pub fn build(app: &mut App) {
    let held = Held { instrument: Instrument::Probe, ray: None, is_on: false, was_on: false, contact: None };
    app.insert_resource(held)
        .add_systems(Startup, spawn_shaft)
        .add_systems(FixedUpdate, (touch.in_set(SurgerySystems::Touch), press.in_set(SurgerySystems::Deform)))
        .add_systems(Update, place_shaft);
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
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), With<Endoscope>>,
) {
    for (key, instrument) in [
        (KeyCode::Digit1, Instrument::Probe),
        (KeyCode::Digit2, Instrument::Coagulation(30.0)),
        (KeyCode::Digit3, Instrument::Cut(40.0)),
        (KeyCode::Digit4, Instrument::Needle),
    ] {
        if keys.just_pressed(key) {
            held.instrument = instrument;
        }
    }
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    let camera = cameras.iter().next();
    held.ray = cursor.zip(camera).and_then(|(at, (camera, eye))| camera.viewport_to_world(eye, at).ok());
    held.is_on = buttons.pressed(MouseButton::Left);
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
    let Some(hit) = held.contact.filter(|_| held.is_on) else { return };
    let action = match held.instrument {
        Instrument::Probe => ReactionAction::Press { pressure: 1.0, radius_m: 0.016 },
        Instrument::Coagulation(power_w) => ReactionAction::Cauterize(Cautery::coagulate(power_w)),
        Instrument::Cut(power_w) => ReactionAction::Cauterize(Cautery::cut(power_w)),
        Instrument::Needle if is_thrust => ReactionAction::Wound(Wound::default()),
        Instrument::Needle => return,
    };
    touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 0, action });
}

/// Lets the organ give way under the probe and come back slowly: a bell pushed inward.
fn press(
    held: Res<Held>,
    time: Res<Time>,
    models: Res<Assets<OrganModel>>,
    mut patients: Query<(&mut Patient, &Organ, &mut OrganShape)>,
) {
    for (mut patient, organ, mut shape) in &mut patients {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        let pressed = held.contact.filter(|_| held.is_on && held.instrument == Instrument::Probe);
        if let Some(hit) = pressed {
            patient.place = hit.point;
        }
        let (target_m, time_s) = if pressed.is_some() { (DENT_DEPTH_M, 0.12) } else { (0.0, 0.35) };
        let depth_m = target_m + (patient.depth_m - target_m) * (-time.delta_secs() / time_s).exp();
        if (depth_m - patient.depth_m).abs() < 1e-6 {
            continue;
        }
        patient.depth_m = depth_m;
        let at_rest = OrganShape::at_rest(model);
        let rest = model.surface(&at_rest);
        let (middle, inward) = (rest.position_m(patient.place).as_vec3(), -rest.normal(patient.place).as_vec3());
        for (vertex, at_rest) in shape.move_vertices().iter_mut().zip(rest.positions_m) {
            let squares = at_rest.distance_squared(middle) / (DENT_WIDTH_M * DENT_WIDTH_M);
            *vertex = *at_rest + inward * depth_m * (-0.5 * squares).exp();
        }
    }
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

/// Holds the rod by its tip; it comes in through the abdominal wall on the right.
fn place_shaft(held: Res<Held>, mut shafts: Query<(&mut Transform, &mut Visibility), With<Shaft>>) {
    for (mut transform, mut visibility) in &mut shafts {
        let Some(hit) = held.contact else {
            *visibility = Visibility::Hidden;
            continue;
        };
        *visibility = Visibility::Inherited;
        let port = Vec3::new(0.13, 0.17, 0.14);
        let lift_m = if held.is_on { 0.4 * SHAFT_RADIUS_M } else { 0.006 };
        let tip = hit.position_world_m + hit.normal_world * lift_m;
        let along = (port - tip).normalize_or(Vec3::Y);
        transform.translation = tip + along * (0.5 * SHAFT_LENGTH_M + SHAFT_RADIUS_M);
        transform.rotation = Quat::from_rotation_arc(Vec3::Y, along);
    }
}
