//! Instruments for the example: a probe, an electrode, a needle and a grasper, held along the mouse's ray or by a device.

use crate::common::{Args, Script, Stage, Viewer, hold_device};
use bevy::camera::visibility::RenderLayers;
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::{SenseDevices, ServoReading};

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

impl Instrument {
    fn kind(self) -> ToolKind {
        let electrodes = |coagulation| ToolKind::CauteryHook(Electrodes { coagulation, ..default() });
        match self {
            Self::Probe => ToolKind::Probe,
            Self::Coagulation(power_w) => electrodes(Cautery::coagulate(power_w)),
            Self::Cut(power_w) => electrodes(Cautery::cut(power_w)),
            Self::Needle => ToolKind::BiopsyNeedle(Wound::default()),
            Self::Grasper => ToolKind::Grasper(Jaws::default()),
        }
    }
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
    /// Where the organ was met as the instrument was switched on.
    began: Option<OrganHit>,
    /// How deep the probe is beyond that, metres.
    depth_m: f32,
}

impl Default for Held {
    fn default() -> Self {
        Self { instrument: Instrument::Probe, ray: None, is_on: false, lift_m: 0.0, began: None, depth_m: 0.0 }
    }
}

/// The instrument, and the rod that is seen of it.
#[derive(Component)]
pub struct Shaft;

const SHAFT_RADIUS_M: f32 = 0.0022;
const SHAFT_LENGTH_M: f32 = 0.2;
const DENT_DEPTH_M: f32 = 0.007;

pub fn build(app: &mut App) {
    app.init_resource::<Held>()
        .add_systems(Startup, spawn_shaft)
        .add_systems(PreUpdate, soften)
        .add_systems(FixedUpdate, hold.after(SenseDevices).in_set(SurgerySystems::Sense))
        .add_systems(Update, (show_shaft, tell));
    let is_played = app.world().resource::<Stage>().viewer == Viewer::Person
        && app.world().resource::<Args>().script == Script::None;
    if is_played {
        app.add_systems(Update, (choose, follow_mouse));
    }
}

fn choose(mut held: ResMut<Held>, keys: Res<ButtonInput<KeyCode>>) {
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
}

fn follow_mouse(
    mut held: ResMut<Held>,
    keys: Res<ButtonInput<KeyCode>>,
    buttons: Res<ButtonInput<MouseButton>>,
    wheel: Res<AccumulatedMouseScroll>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut cameras: Query<(&Camera, &GlobalTransform, &mut PanOrbitCamera), With<Endoscope>>,
) {
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

type Tools<'w, 's> =
    Query<'w, 's, (&'static mut Tool, &'static mut ToolPose, &'static mut ToolCommand, Has<ServoReading>), With<Shaft>>;

/// Holds the instrument where the ray meets the organ, unless a device holds it.
pub fn hold(
    mut held: ResMut<Held>,
    picking: OrganPicking,
    patients: Query<(), With<Patient>>,
    scopes: Query<&GlobalTransform, With<Endoscope>>,
    mut tools: Tools,
    time: Res<Time>,
) {
    let Ok((mut tool, mut pose, mut command, is_device)) = tools.single_mut() else { return };
    let kind = held.instrument.kind();
    if tool.kind != kind {
        *tool = Tool::new(kind);
    }
    if is_device {
        return;
    }
    let contact = held.ray.and_then(|ray| picking.cast_ray_at(ray, 1.0, |organ| patients.contains(organ)));
    if !held.is_on {
        held.began = None;
        (held.lift_m, held.depth_m) = (0.0, 0.0);
    } else if held.began.is_none() {
        held.began = contact;
    }
    // Along the ray: the normal of a surface that gives way turns with it.
    let lift_m = if held.is_on { 0.3e-3 } else { 0.006 };
    let lifted = |hit: OrganHit| Some(hit.position_world_m - held.ray?.direction * lift_m);
    let on_surface = contact.and_then(lifted);
    let tip_m = pressed_in(&mut held, &scopes, time.delta_secs()).or(on_surface);
    let share = f32::from(u8::from(held.is_on && tip_m.is_some()));
    *command = ToolCommand { pedal: share, grip: share, ..default() };
    *pose = tip_m.map_or_else(ToolPose::default, |tip_m| ToolPose::with_shaft_towards(tip_m, back_of(tip_m)));
}

/// Where a probe is pushed into the organ, and where a grasper holds it.
fn pressed_in(held: &mut Held, scopes: &Query<&GlobalTransform, With<Endoscope>>, dt_s: f32) -> Option<Vec3> {
    let (began, ray) = (held.began.filter(|_| held.is_on)?, held.ray?);
    let (at, outward) = (began.position_world_m, began.normal_world);
    let in_plane =
        |normal| ray.intersect_plane(at, InfinitePlane3d::new(normal)).map(|distance| ray.get_point(distance));
    match held.instrument {
        Instrument::Probe => {
            // It slides along the surface as it was met, and goes deeper than that.
            let share = 1.0 - (-dt_s / 0.12).exp();
            held.depth_m += (DENT_DEPTH_M - held.depth_m) * share;
            Some(in_plane(outward).unwrap_or(at) + outward * (SHAFT_RADIUS_M - held.depth_m))
        }
        // It moves in the plane through where it took hold that faces the camera.
        Instrument::Grasper => Some(in_plane(*scopes.iter().next()?.back()).unwrap_or(at) + Vec3::Y * held.lift_m),
        _ => None,
    }
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

/// The other end of a shaft: instruments come in through the abdominal wall on the right.
fn back_of(tip_m: Vec3) -> Vec3 {
    tip_m + (Vec3::new(0.13, 0.17, 0.14) - tip_m).normalize_or(Vec3::Y) * SHAFT_LENGTH_M
}

fn spawn_shaft(
    mut commands: Commands,
    args: Res<Args>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let tool = commands.spawn((Shaft, Name::new("instrument"), Tool::new(ToolKind::Probe), ToolSound::default())).id();
    hold_device(&mut commands, tool, &args, ToolHand::Right);
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let steel = StandardMaterial {
        base_color: Color::srgb(0.62, 0.64, 0.68),
        metallic: 0.6,
        perceptual_roughness: 0.35,
        ..default()
    };
    // From the tip back along Z.
    let back = Transform::from_xyz(0.0, 0.0, 0.5 * SHAFT_LENGTH_M)
        .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    let rod = Mesh3d(meshes.add(Capsule3d::new(SHAFT_RADIUS_M, SHAFT_LENGTH_M)));
    commands.entity(tool).insert(Visibility::Hidden).with_children(|tool| {
        tool.spawn((rod, MeshMaterial3d(materials.add(steel)), back, RenderLayers::layer(1)));
    });
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

/// Shows the rod while it is held.
fn show_shaft(mut shafts: Query<(&ToolMotion, &mut Visibility), With<Shaft>>) {
    for (motion, mut visibility) in &mut shafts {
        let shown = if motion.to.is_some() { Visibility::Inherited } else { Visibility::Hidden };
        visibility.set_if_neq(shown);
    }
}
