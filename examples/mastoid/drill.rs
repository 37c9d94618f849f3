//! What the hand with the drill does: rests the burr on the bone, presses, and notes what comes near.

use crate::Patient;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::{SenseDevices, ServoReading};
use bevy_surgery::volume::critical::CriticalDistances;
use bevy_surgery::volume::cut::{Burr, BurrPose, BurrShape};
use bevy_surgery::volume::{CtVolume, Volume, VolumePicking, VoxelsRemoved};

/// Least and greatest force, newtons.
pub const FORCES_N: [f32; 2] = [0.5, 5.0];
/// Distance of a critical structure from the burr's surface below which there is a warning, millimetres.
pub const WARNING_MM: f32 = 2.0;

/// The drill, as the mouse or the script wants it held; with a device in the hand, as that holds it.
#[derive(Resource)]
pub struct Drill {
    pub burr: Burr,
    /// Force with which it is pressed on the bone, newtons.
    pub force_n: f32,
    /// Turns per minute.
    pub speed_rpm: f32,
    /// Where it points; none while it is away from the bone.
    pub aim: Option<Aim>,
    /// Whether it is pressed on the bone and turns.
    pub is_on: bool,
    /// Where the burr is, in the world; none while it is away.
    pub pose: Option<BurrPose>,
}

/// The tool in the right hand.
#[derive(Component)]
pub struct RightHand;

/// Along which line a burr is brought to the bone, and how the drill is held.
#[derive(Clone, Copy)]
pub struct Aim {
    /// From the eye.
    pub ray: Ray3d,
    /// From the burr towards the hand, in the world.
    pub shaft: Vec3,
}

impl Aim {
    /// A drill in the right hand, below a microscope that looks along a ray.
    pub fn of_right_hand(eye: &GlobalTransform, ray: Ray3d) -> Self {
        Self { ray, shaft: eye.rotation() * Vec3::new(0.6, -0.5, 0.62).normalize() }
    }
}

/// The nearest critical structure.
#[derive(Resource, Clone, Copy, Default, PartialEq)]
pub struct Danger {
    /// Its label and the distance from the burr's surface, millimetres; none if there is none nearby.
    pub nearest: Option<(u8, f32)>,
    /// The nearest of all so far.
    pub closest: Option<(u8, f32)>,
    /// Steps for which the panel still says that one was hurt.
    pub alarm_steps: u32,
}

pub fn build(app: &mut App) {
    app.insert_resource(Drill {
        burr: Burr { diameter_m: 6e-3, ..default() },
        force_n: 2.0,
        speed_rpm: 60_000.0,
        aim: None,
        is_on: false,
        pose: None,
    })
    .init_resource::<Danger>()
    .add_systems(
        FixedUpdate,
        (hold.after(SenseDevices).in_set(SurgerySystems::Sense), watch.in_set(SurgerySystems::Judge)),
    );
}

type Held = (&'static mut Tool, &'static mut ToolPose, &'static mut ToolCommand, &'static mut ToolForce);

/// Holds the drill where it is aimed at and presses it there, unless a device holds it.
pub fn hold(
    mut drill: ResMut<Drill>,
    picking: VolumePicking,
    mut tools: Query<(Held, Option<&ServoReading>), With<RightHand>>,
) {
    let Ok(((mut tool, mut pose, mut command, mut force), device)) = tools.single_mut() else { return };
    let head = DrillHead { burr: drill.burr, full_speed_rpm: drill.speed_rpm, ..default() };
    if tool.kind != ToolKind::Drill(head) {
        *tool = Tool::new(ToolKind::Drill(head));
    }
    if let Some(device) = device {
        let place = pose.place;
        drill.pose = pose.is_tracked.then(|| BurrPose { centre_m: place.tip_in_world_m, axis: place.back_in_world() });
        (drill.is_on, drill.force_n) = (command.pedal > 0.0, device.state.burr.force_n as f32);
        return;
    }
    let before = drill.pose.take();
    *pose = ToolPose::default();
    let Some(aim) = drill.aim else { return };
    let radius_m = 0.5 * drill.burr.diameter_m;
    let Some(distance_m) = rest_on_bone(&picking, aim.ray, radius_m) else { return };
    // The harder it is pressed, the farther a burr that turns is ahead of what it has removed.
    let depth_m = if drill.is_on { 0.5 * radius_m * drill.force_n / FORCES_N[1] } else { 0.0 };
    let wanted_m = aim.ray.get_point(distance_m + depth_m);
    // A hand does not jump; where it was lifted over to another place it begins anew.
    let near = before.filter(|before| before.centre_m.distance(wanted_m) < 4.0 * radius_m);
    let centre_m = near.map_or(wanted_m, |near| near.centre_m.lerp(wanted_m, 0.35));
    let axis = free_shaft(&picking, centre_m, radius_m, &aim);
    let axis = near.and_then(|near| near.axis.lerp(axis, 0.2).try_normalize()).unwrap_or(axis);
    drill.pose = Some(BurrPose { centre_m, axis });
    if before.is_none() || near.is_some() {
        *pose = ToolPose::with_shaft_towards(centre_m, centre_m + axis);
    }
    command.pedal = f32::from(u8::from(drill.is_on));
    *force = ToolForce { drilling_n: Some(drill.force_n), is_known: true, ..default() };
}

/// Moves a ball along a ray until it touches bone: how far its middle gets. Rays beside the middle one find
/// the rim of a hole that is narrower than the ball.
fn rest_on_bone(picking: &VolumePicking, ray: Ray3d, radius_m: f32) -> Option<f32> {
    let (right, up) = ray.direction.any_orthonormal_pair();
    let rings = [(0.0, 1), (0.5, 6), (0.87, 8)];
    let offsets = rings.into_iter().flat_map(|(share, count)| {
        (0..count).map(move |k| (share, Vec2::from_angle(k as f32 / count as f32 * std::f32::consts::TAU)))
    });
    let touches = offsets.filter_map(|(share, to): (f32, Vec2)| {
        let beside = (right * to.x + up * to.y) * share * radius_m;
        let hit = picking.cast_ray(Ray3d::new(ray.origin + beside, ray.direction), 10.0)?;
        Some(hit.distance_m - radius_m * (1.0 - share * share).sqrt())
    });
    touches.min_by(f32::total_cmp)
}

/// How a tool is held so that its shaft does not go through bone: steeper in a narrow cavity, down to the line of sight.
pub fn free_shaft(picking: &VolumePicking, centre_m: Vec3, radius_m: f32, aim: &Aim) -> Vec3 {
    const TILTS: u32 = 6;
    let mut tilted = (0..=TILTS).map(|tilt| {
        let steeper = aim.shaft.lerp(-*aim.ray.direction, tilt as f32 / TILTS as f32);
        Dir3::new(steeper).unwrap_or(-aim.ray.direction)
    });
    let is_free =
        |shaft: &Dir3| picking.cast_ray(Ray3d::new(centre_m + *shaft * (1.5 * radius_m), *shaft), 0.06).is_none();
    Vec3::from(tilted.find(is_free).unwrap_or(-aim.ray.direction))
}

/// Looks for critical structures around the burr.
fn watch(
    drill: Res<Drill>,
    mut danger: ResMut<Danger>,
    mut removals: MessageReader<VoxelsRemoved>,
    patients: Query<(&CtVolume, &CriticalDistances, &GlobalTransform), With<Patient>>,
    volumes: Res<Assets<Volume>>,
) {
    let mut now = Danger { nearest: None, alarm_steps: danger.alarm_steps.saturating_sub(1), ..*danger };
    for (source, distances, transform) in &patients {
        let Some(volume) = volumes.get(&source.0) else { continue };
        let is_critical = |label| {
            volume.structures().and_then(|structures| structures.of_label(label)).is_some_and(|it| it.is_critical)
        };
        if removals.read().flat_map(|removal| &removal.by_label_mm3).any(|&(label, _)| is_critical(label)) {
            now.alarm_steps = 30;
        }
        let Some(pose) = drill.pose else { continue };
        let voxel_from_world = volume.grid().volume_from_voxel().inverse() * transform.affine().inverse();
        let radius_m = 0.5 * drill.burr.diameter_m;
        // Balls along its axis are as near as the burr.
        let reach_m = match drill.burr.shape {
            BurrShape::Sphere => 0.0,
            BurrShape::Cylinder { length_m } | BurrShape::Matchstick { length_m } => {
                (0.5 * length_m - radius_m).max(0.0)
            }
        };
        let balls = [-1.0, 0.0, 1.0].map(|side| pose.centre_m + pose.axis * (side * reach_m));
        let nearest = balls.iter().filter_map(|ball| distances.nearest(voxel_from_world.transform_point3(*ball)));
        now.nearest = nearest.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(label, mm)| (label, mm - radius_m * 1e3));
        now.closest = now.nearest.into_iter().chain(now.closest).min_by(|a, b| a.1.total_cmp(&b.1));
    }
    danger.set_if_neq(now);
}
