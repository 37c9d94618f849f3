//! Swimming, and dragging matter with a mouse or a script.

use crate::edges::ShowsEdges;
use crate::{LEVEL, Patient};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::VolumeMethod;

/// Deepest level that dragging makes.
const DEEPEST: u32 = 4;
/// How far what is dragged takes its surroundings along, in shares of the box.
const REACH: f64 = 0.15;

/// Matter that is held.
#[derive(Resource, Default)]
pub struct Held {
    /// Along which the hand points.
    pub ray: Option<Ray3d>,
    /// Whether it pulls.
    pub is_on: bool,
    /// Where in the world, and how far from the eye.
    taken: Option<(Vec3, f32)>,
}

/// A wave that travels from head to foot and grows on its way, as fish swim.
pub fn swim() -> LatticeAnimation {
    LatticeAnimation::new(LatticeMotion::Wave(TravellingWave { along: Vec3::NEG_Y, frequency_hz: 0.7, ..default() }))
}

pub fn build(app: &mut App) {
    app.init_resource::<Held>().add_systems(FixedUpdate, drag.in_set(SurgerySystems::Deform).before(DeformBodies));
}

pub fn follow_mouse(
    mut held: ResMut<Held>,
    buttons: Res<ButtonInput<MouseButton>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), With<Camera3d>>,
) {
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    held.ray = cursor.zip(cameras.iter().next()).and_then(|(at, (camera, eye))| camera.viewport_to_world(eye, at).ok());
    held.is_on = buttons.pressed(MouseButton::Left);
}

pub fn follow_keys(
    keys: Res<ButtonInput<KeyCode>>,
    mut edges: ResMut<ShowsEdges>,
    mut commands: Commands,
    mut patients: Query<(Entity, &mut VolumeLook, &mut DeformLattice, Has<LatticeAnimation>), With<Patient>>,
) {
    for (entity, mut look, mut lattice, swims) in &mut patients {
        for (key, normals) in [
            (KeyCode::Digit1, NormalDeformation::PerPatch),
            (KeyCode::Digit2, NormalDeformation::Smoothed),
            (KeyCode::Digit3, NormalDeformation::Exact),
        ] {
            if keys.just_pressed(key) {
                look.deformed_normals = normals;
            }
        }
        if keys.just_pressed(KeyCode::KeyM) {
            look.method = match look.method {
                VolumeMethod::Rays => VolumeMethod::Slices,
                VolumeMethod::Slices => VolumeMethod::PatchSlices,
                VolumeMethod::PatchSlices => VolumeMethod::Rays,
            };
        }
        if keys.just_pressed(KeyCode::KeyL) {
            edges.0 = !edges.0;
        }
        if keys.just_pressed(KeyCode::Space) {
            if swims {
                commands.entity(entity).remove::<LatticeAnimation>();
            } else {
                commands.entity(entity).insert(swim());
            }
        }
        if keys.just_pressed(KeyCode::KeyR) {
            commands.entity(entity).remove::<LatticeAnimation>();
            lattice.reset();
        }
    }
}

/// Steps of the script: the wave ends, matter is drawn aside, the normals change, all goes back.
const STILL: u32 = 60;
const DRAG: (u32, u32) = (70, 130);
const NORMALS: [(u32, NormalDeformation); 3] =
    [(140, NormalDeformation::PerPatch), (170, NormalDeformation::Smoothed), (200, NormalDeformation::Exact)];
const REST: u32 = 230;

/// A script: it swims, something of it is drawn far to the side, each kind of normals is shown, and it goes back.
pub fn perform(
    mut commands: Commands,
    mut held: ResMut<Held>,
    mut step: Local<u32>,
    mut edges: ResMut<ShowsEdges>,
    mut patients: Query<(Entity, &mut VolumeLook, &mut DeformLattice), With<Patient>>,
    eyes: Query<&GlobalTransform, With<Camera3d>>,
) {
    let (Ok((patient, mut look, mut lattice)), Some(eye)) = (patients.single_mut(), eyes.iter().next()) else { return };
    let now = *step;
    *step += 1;
    if now == STILL || now == REST {
        commands.entity(patient).remove::<LatticeAnimation>();
        lattice.reset();
    }
    edges.set_if_neq(ShowsEdges((STILL..NORMALS[0].0).contains(&now)));
    let (from, to) = DRAG;
    let share = ((now as f32 - from as f32) / (to - from) as f32).clamp(0.0, 1.0);
    held.is_on = (from..to).contains(&now);
    // The lower end of the picture's middle goes to the right and up.
    let direction = eye.affine().transform_vector3(Vec3::new(0.14 * share - 0.02, 0.04 * share - 0.12, -1.0));
    held.ray = Dir3::new(direction).ok().map(|direction| Ray3d::new(eye.translation(), direction));
    if let Some((_, normals)) = NORMALS.iter().rev().find(|(from, _)| now >= *from) {
        look.deformed_normals = *normals;
    }
}

/// Takes hold of what is pointed at, in patches that get finer there, and moves its matter along: less the farther away it is.
fn drag(
    mut held: ResMut<Held>,
    picking: VolumePicking,
    mut patients: Query<(&mut DeformLattice, &GlobalTransform, Has<LatticeAnimation>), With<Patient>>,
) -> Result {
    let Some(ray) = held.ray.filter(|_| held.is_on) else {
        held.taken = None;
        return Ok(());
    };
    let Ok((mut lattice, world_from_volume, swims)) = patients.single_mut() else { return Ok(()) };
    // What swims goes where it wants.
    if swims {
        return Ok(());
    }
    let box_from_world = lattice.box_from_body() * world_from_volume.affine().inverse();
    let place_of = |at: Vec3| box_from_world.transform_point3(at).as_dvec3();
    let Some((was, distance_m)) = held.taken else {
        let Some(hit) = picking.cast_ray(ray, 10.0) else { return Ok(()) };
        let place = place_of(hit.position_world_m);
        for _ in LEVEL..DEEPEST {
            let patch = lattice.tree().patches()[lattice.tree().patch_at(place)];
            if patch.level < DEEPEST {
                lattice.subdivide(patch)?;
            }
        }
        held.taken = Some((hit.position_world_m, hit.distance_m));
        return Ok(());
    };
    let now = ray.origin + *ray.direction * distance_m;
    let (middle, by) = (place_of(now), box_from_world.transform_vector3(now - was));
    let tree = lattice.tree();
    // Matter moves against the translations.
    let moved: Vec<Vec3> = lattice
        .translations()
        .iter()
        .enumerate()
        .map(|(vertex, old)| {
            let away = tree.place_of(vertex).distance(middle) / REACH;
            *old - by * (-0.5 * away * away).exp() as f32
        })
        .collect();
    let before = lattice.clone();
    lattice.set_translations(&moved)?;
    // No farther than matter can go without folding over itself.
    if lattice.check_folds().is_err() {
        *lattice = before;
        return Ok(());
    }
    held.taken = Some((now, distance_m));
    Ok(())
}
