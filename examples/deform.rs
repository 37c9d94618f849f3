//! A volume that a lattice deforms: it swims, is dragged with the mouse, and shows three ways of finding its normals. The phantom
//! that ships with the crate, or a scan with `--volume`.
//!
//! Drag the matter with the left button: where you drag, the lattice gets finer. 1, 2 and 3 choose the normals: those of each patch,
//! those between the vertices, the field's own. L shows the lattice, Space lets it swim, M goes through the ways of rendering, R puts
//! everything back; right button and wheel turn the view, Escape ends. `--figure 7` draws figure 7 of the paper of 2001.

#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "deform/drag.rs"]
mod drag;
#[path = "deform/edges.rs"]
mod edges;
#[path = "deform/figure.rs"]
mod figure;

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::prelude::*;
use common::{Args, Script, Stage, Viewer};
use std::process::ExitCode;

/// The volume that is deformed.
#[derive(Component)]
pub struct Patient;

/// Halvings of the lattice before anything is dragged: 4 patches along each side.
pub const LEVEL: u32 = 2;

fn main() -> ExitCode {
    common::main_with(
        "deform",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.02, 0.05, 0.07)));
            app.add_systems(Startup, setup).add_systems(Update, look_at_volume);
            let (args, viewer) = (app.world().resource::<Args>().clone(), app.world().resource::<Stage>().viewer);
            if args.figure.is_some() {
                return figure::build(app);
            }
            drag::build(app);
            edges::build(app);
            if viewer == Viewer::Person && args.script == Script::None {
                app.add_plugins(PanOrbitCameraPlugin).add_systems(Update, (drag::follow_mouse, drag::follow_keys));
            } else {
                app.add_systems(FixedUpdate, drag::perform.in_set(SurgerySystems::Sense));
            }
        },
        count,
    )
}

fn setup(mut commands: Commands, args: Res<Args>, stage: Res<Stage>, mut volumes: ResMut<Assets<Volume>>) -> Result {
    let mut patient = commands.spawn(Patient);
    if args.figure.is_some() {
        patient.insert(figure::sphere(&mut volumes)?);
    } else {
        let args = Args { phantom: args.volume.is_none(), ..args.clone() };
        common::volume(&args, &mut patient, &mut volumes)?;
    }
    let mut camera = commands.spawn((Camera3d::default(), Msaa::Off, stage.target.clone()));
    // Needs no lookup texture.
    camera.insert(Tonemapping::SomewhatBoringDisplayTransform);
    if stage.viewer == Viewer::Person {
        let orbit = PanOrbitCamera { button_orbit: MouseButton::Right, button_pan: MouseButton::Middle, ..default() };
        camera.insert(orbit);
    }
    // From the right over the eye's shoulder; figures from the side, as the normals are to be seen.
    let direction = if args.figure.is_some() { Vec3::new(0.8, -0.6, -0.55) } else { Vec3::new(-0.5, -0.6, -1.0) };
    let sun = Transform::default().looking_to(direction, Vec3::Y);
    commands.spawn((DirectionalLight { illuminance: 6000.0, ..default() }, sun));
    Ok(())
}

/// Gives a volume that has arrived its lattice, lets it swim, and takes the camera to where all of it is seen.
fn look_at_volume(
    mut commands: Commands,
    arrived: Query<(Entity, &CtVolume), (Added<CutVolume>, With<Patient>)>,
    volumes: Res<Assets<Volume>>,
    args: Res<Args>,
    mut cameras: Query<(&mut Transform, &mut Projection, Option<&mut PanOrbitCamera>), With<Camera3d>>,
) -> Result {
    for (entity, source) in &arrived {
        let Some(volume) = volumes.get(&source.0) else { continue };
        let lattice = volume.grid().lattice(LEVEL)?;
        commands.entity(entity).insert(lattice);
        if args.figure.is_none() {
            commands.entity(entity).insert(drag::swim());
        }
        let radius_m = volume.grid().half_axes_m().into_iter().sum::<Vec3>().length();
        let distance_m = radius_m * if args.figure.is_some() { 1.5 } else { 2.2 };
        for (mut place, mut projection, orbit) in &mut cameras {
            // Some centimetres are looked at, and Bevy's nearest distance is ten of them.
            let lens = PerspectiveProjection { near: 0.01 * radius_m, far: 100.0 * radius_m, fov: 0.7, ..default() };
            *projection = Projection::Perspective(lens);
            *place = Transform::from_translation(Vec3::new(0.45, 0.35, 1.0).normalize() * distance_m)
                .looking_at(Vec3::ZERO, Vec3::Y);
            if let Some(mut orbit) = orbit {
                (orbit.focus, orbit.target_focus) = (Vec3::ZERO, Vec3::ZERO);
                (orbit.radius, orbit.target_radius) = (Some(distance_m), distance_m);
                (orbit.yaw, orbit.target_yaw) = (Some(0.42), 0.42);
                (orbit.pitch, orbit.target_pitch) = (Some(0.3), 0.3);
            }
        }
    }
    Ok(())
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    for lattice in world.query_filtered::<&DeformLattice, With<Patient>>().iter(world) {
        counters.insert("patches".into(), lattice.tree().patches().len().into());
        counters.insert("vertices".into(), lattice.tree().vertex_count().into());
        counters.insert("constrained".into(), lattice.tree().constraints().len().into());
    }
    counters
}
