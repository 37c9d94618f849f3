//! A temporal bone under the operating microscope, to be drilled: the real one where it is at hand, otherwise the phantom that
//! ships with the crate. With `--volume` it is a scan of your own; with `--script demo` a cavity is drilled with no one there.
//!
//! The burr follows the mouse over the bone; the left button drills, the wheel sets the force. 1 to 5 choose the burr, S, C and
//! M its shape. The other hand irrigates (I switches that), sucks while the space bar is held, and seals with K what bleeds around
//! the burr. U takes a stroke back, Y brings it again, R makes the bone whole; F5 saves the cut to `mastoid.cut`, F9 loads
//! it. + and - change the magnification, drag with the right button to turn the view, with the middle one to move it. T
//! changes between rays and slices, W goes through the kinds of wet shading, P clips what lies in front; with `--stereo` comma
//! and full stop set the distance of the eyes. Escape ends.

// Queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "mastoid/controls.rs"]
mod controls;
#[path = "mastoid/demo.rs"]
mod demo;
#[path = "mastoid/drill.rs"]
mod drill;
#[path = "mastoid/figure.rs"]
mod figure;
#[path = "mastoid/irrigate.rs"]
mod irrigate;
#[path = "mastoid/panel.rs"]
mod panel;
#[path = "mastoid/tool.rs"]
mod tool;

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::prelude::*;
use bevy_surgery::sound::ears_at_field;
use bevy_surgery::volume::{CtVolume, CutVolume, RemovedTissue, Volume, WatchCritical};
use common::{Args, Chosen, Script, Stage, Viewer};
use drill::Danger;
use std::process::ExitCode;

/// By how much the real temporal bone is turned, and moved, so that its mastoid faces the microscope.
const MASTOID_TURN_RAD: f32 = 0.45;
const MASTOID_MOVE_M: Vec3 = Vec3::new(0.009, 0.0045, 0.0);

/// Shines from the upper right, so that the shadow of a drill in the right hand falls beside it.
const LAMP: MicroscopeLamp = MicroscopeLamp { offset_m: Vec2::new(0.024, 0.026) };

/// Its intensity for a bone at life size.
const LIGHT_CD: f32 = 222.0;

/// The bone that is drilled.
#[derive(Component)]
struct Patient;

/// The microscope is set up for a volume that has arrived.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
struct LookAtVolume;

fn main() -> ExitCode {
    common::main_with(
        "mastoid",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.03, 0.045, 0.05)));
            drill::build(app);
            tool::build(app);
            if app.world().resource::<Args>().figure.is_none() {
                irrigate::build(app);
            }
            app.add_systems(Startup, setup).add_systems(Update, look_at_volume.in_set(LookAtVolume));
            let (args, viewer) = (app.world().resource::<Args>().clone(), app.world().resource::<Stage>().viewer);
            match (args.figure, args.script, viewer) {
                (Some(number), ..) => return figure::build(app, number),
                (None, Script::Demo, _) => demo::build(app),
                (None, Script::None, Viewer::Person) => {
                    app.add_plugins(PanOrbitCameraPlugin);
                    controls::build(app);
                }
                (None, Script::None, Viewer::Nobody) => {
                    app.add_systems(FixedUpdate, turn.in_set(SurgerySystems::Sense));
                }
                (None, Script::None, Viewer::Recording) => {}
            }
            panel::build(app);
        },
        count,
    )
}

fn setup(mut commands: Commands, args: Res<Args>, stage: Res<Stage>, mut volumes: ResMut<Assets<Volume>>) -> Result {
    // The farthest warning, 2 mm from the surface of a burr, is given 5 mm from its middle.
    let mut patient = commands.spawn((Patient, WatchCritical { band_mm: 6.0 }));
    let placed = match common::volume(&args, &mut patient, &mut volumes)? {
        // The phantom and patients face +Z.
        Chosen::Phantom | Chosen::Given => Transform::IDENTITY,
        // A right ear as well. Its outer side is at -Y, the top of the head at -Z, the back of the head at +X.
        Chosen::TemporalBone => {
            let upright = Quat::from_mat3(&Mat3::from_cols(Vec3::NEG_X, Vec3::NEG_Z, Vec3::NEG_Y));
            let turned = Quat::from_rotation_y(MASTOID_TURN_RAD) * upright;
            Transform::from_translation(MASTOID_MOVE_M).with_rotation(turned)
        }
    };
    patient.insert(placed);
    let microscope = commands.spawn((
        Microscope::default(),
        // The drill's own light is on layer 1, so that it does not light the bone a second time.
        RenderLayers::from_layers(&[0, 1]),
        stage.target.clone(),
        ears_at_field(Microscope::default().working_distance_m),
        Transform::from_xyz(0.0, 0.0, Microscope::default().working_distance_m),
        // On both layers, because the drill casts its shadow from here.
        children![
            (LAMP, RenderLayers::from_layers(&[0, 1])),
            (
                PointLight { intensity: 9000.0, range: 2.0, ..default() },
                Transform::from_xyz(-0.1, 0.12, 0.0),
                RenderLayers::layer(1)
            ),
        ],
    ));
    let microscope = microscope.id();
    if args.stereo {
        commands.entity(microscope).insert(StereoPair::default());
    }
    if args.monitor && stage.viewer == Viewer::Person {
        let window = commands.spawn(Window { title: "mastoid: monitor".into(), ..default() }).id();
        let target = bevy::camera::RenderTarget::Window(bevy::window::WindowRef::Entity(window));
        let layers = RenderLayers::from_layers(&[0, 1]);
        commands.spawn((MonitorView { of: microscope }, ScopeMask::default(), target, layers));
    }
    Ok(())
}

/// Sets the microscope up for a volume that has arrived: a bone is seen at life size, a whole head whole.
fn look_at_volume(
    mut commands: Commands,
    mut arrived: Query<(Entity, &CtVolume, &mut Transform), (Added<CutVolume>, Without<Microscope>)>,
    volumes: Res<Assets<Volume>>,
    stage: Res<Stage>,
    args: Res<Args>,
    mut microscopes: Query<(Entity, &mut Microscope, &mut Transform)>,
    mut lamps: Query<(&mut MicroscopeLamp, &mut ScopeLight)>,
) {
    let Some((patient, source, mut place)) = arrived.iter_mut().next() else { return };
    let Some(volume) = volumes.get(&source.0) else { return };
    let half_axes_m = volume.grid().half_axes_m();
    let half_m: Vec3 = half_axes_m.iter().map(|half| (place.rotation * *half).abs()).sum();
    // Of a few slices of a body one sees more from above.
    if half_m.y < 0.4 * half_m.x.min(half_m.z) {
        place.rotate_x(1.0);
    }
    let life_size = Microscope::default();
    let longest_m = half_axes_m.iter().fold(0.0_f32, |longest, half| longest.max(2.0 * half.length()));
    let is_a_bone = (0.04..0.06).contains(&longest_m);
    let scale = if is_a_bone { 1.0 } else { 1.25 * longest_m / life_size.field_m() };
    // Figure 7 is of dry bone.
    if args.figure != Some(7) {
        irrigate::add_pool(&mut commands, patient, &place, scale, &args);
    }
    for (entity, mut microscope, mut transform) in &mut microscopes {
        microscope.working_distance_m = life_size.working_distance_m * scale;
        microscope.field_at_1x_m = life_size.field_at_1x_m * scale;
        microscope.near_m = life_size.near_m * scale;
        // In focus is what lies between the surface and the middle.
        transform.translation = Vec3::Z * (microscope.working_distance_m + 0.5 * half_m.z);
        if stage.viewer == Viewer::Person && args.script == Script::None {
            commands.entity(entity).insert(PanOrbitCamera {
                button_orbit: MouseButton::Right,
                button_pan: MouseButton::Middle,
                // The wheel is for the force.
                zoom_sensitivity: 0.0,
                ..default()
            });
        }
    }
    for (mut lamp, mut light) in &mut lamps {
        lamp.offset_m = LAMP.offset_m * scale;
        light.intensity_cd = LIGHT_CD * scale * scale;
    }
}

/// Turns the bone slowly where nobody is there to do so.
fn turn(mut patients: Query<&mut Transform, With<Patient>>) {
    for mut transform in &mut patients {
        transform.rotate_y(0.01);
    }
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    let fixed = world.resource::<Time<Fixed>>();
    counters.insert("steps".into(), ((fixed.elapsed().as_nanos() / fixed.timestep().as_nanos()) as u64).into());
    irrigate::count(world, &mut counters);
    let closest = world.resource::<Danger>().closest;
    let mut patients = world.query_filtered::<(&CtVolume, &RemovedTissue), With<Patient>>();
    for (source, removed) in patients.iter(world) {
        let Some(volume) = world.resource::<Assets<Volume>>().get(&source.0) else { continue };
        counters.insert("voxels".into(), serde_json::json!(volume.grid().size.to_array()));
        counters.insert("spacing_mm".into(), serde_json::json!(volume.grid().spacing_mm().to_array()));
        counters.insert("removed_mm3".into(), removed.total_mm3().into());
        let Some(structures) = volume.structures() else { continue };
        let by_structure = structures.list().iter().zip(1..=255).filter_map(|(structure, label)| {
            let mm3 = removed.of_label_mm3(label);
            (mm3 > 0.0).then(|| (structure.name.clone(), mm3.into()))
        });
        counters.insert("removed_mm3_by_structure".into(), serde_json::Value::Object(by_structure.collect()));
        let closest = closest.and_then(|(label, mm)| Some((&structures.of_label(label)?.name, mm)));
        counters.insert("closest_critical_mm".into(), serde_json::json!(closest));
    }
    counters
}
