//! Swimming, and dragging matter with a mouse or a script.

use crate::Patient;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::VolumeMethod;

/// Deepest level that dragging makes.
const DEEPEST: u32 = 4;

/// Matter that is held.
#[derive(Resource, Default)]
pub struct Held {
    /// Along which the hand points.
    pub ray: Option<Ray3d>,
    /// Whether it pulls.
    pub is_on: bool,
    /// The vertex, where it was taken hold of in the world, and how far from the eye.
    taken: Option<(usize, Vec3, f32)>,
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

/// A script: it swims, then something of it is drawn to the side, then normals and method change.
pub fn perform(
    mut commands: Commands,
    mut held: ResMut<Held>,
    mut step: Local<u32>,
    mut patients: Query<(Entity, &mut VolumeLook), (With<Patient>, With<DeformLattice>)>,
    eyes: Query<&GlobalTransform, With<Camera3d>>,
) {
    let (Ok((patient, mut look)), Some(eye)) = (patients.single_mut(), eyes.iter().next()) else { return };
    let now = *step;
    *step += 1;
    if now == 60 {
        commands.entity(patient).remove::<LatticeAnimation>();
    }
    let share = ((now as f32 - 70.0) / 60.0).clamp(0.0, 1.0);
    held.is_on = (70..130).contains(&now);
    let direction = eye.affine().transform_vector3(Vec3::new(0.05 + 0.12 * share, 0.1 * share, -1.0));
    held.ray = Dir3::new(direction).ok().map(|direction| Ray3d::new(eye.translation(), direction));
    look.deformed_normals = match now / 30 {
        5 => NormalDeformation::PerPatch,
        6 => NormalDeformation::Smoothed,
        _ => NormalDeformation::Exact,
    };
}

/// Takes hold of the vertex next to what is pointed at, in patches that get finer there, and moves its matter along.
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
    let Some((vertex, was, distance_m)) = held.taken else {
        let Some(hit) = picking.cast_ray(ray, 10.0) else { return Ok(()) };
        let place = box_from_world.transform_point3(hit.position_world_m).as_dvec3();
        let patch = lattice.tree().patches()[lattice.tree().patch_at(place)];
        if patch.level < DEEPEST {
            lattice.subdivide(patch)?;
        }
        let tree = lattice.tree();
        let corners = tree.corners(tree.patch_at(place));
        let nearest = corners.into_iter().filter(|&vertex| !tree.is_constrained(vertex)).min_by(|&a, &b| {
            tree.place_of(a).distance_squared(place).total_cmp(&tree.place_of(b).distance_squared(place))
        });
        held.taken = nearest.map(|vertex| (vertex, hit.position_world_m, hit.distance_m));
        return Ok(());
    };
    let now = ray.origin + *ray.direction * distance_m;
    let before = lattice.clone();
    lattice.drag_vertex(vertex, box_from_world.transform_vector3(now - was))?;
    // No farther than matter can go without folding over itself.
    if lattice.check_folds().is_err() {
        *lattice = before;
        return Ok(());
    }
    held.taken = Some((vertex, now, distance_m));
    Ok(())
}
