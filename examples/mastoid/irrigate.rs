//! The other hand: a suction-irrigator beside the burr, and the pool that it fills.

use crate::common::{Args, Backend, hold_device};
use crate::drill::{Aim, Drill, free_shaft};
use crate::tool;
use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_surgery::pool::{BleedingControl, Pool, PoolBackend, PoolState, SuctionIrrigator, TreatBleeders, WaterBudget};
use bevy_surgery::prelude::*;
use bevy_surgery::tools::ServoReading;

/// How far from the burr's surface the tip is held, and in which direction, seen from the microscope: to the left and below.
const BESIDE_M: f32 = 1.2e-3;
const BESIDE: Vec2 = Vec2::new(-0.95, -0.31);
/// How high it is held over the bone while it only irrigates, and while it sucks, metres.
const HEIGHTS_M: [f32; 2] = [3.5e-3, 0.8e-3];
/// Thickness of the tube near its tip, metres.
const TUBE_M: f32 = 1.2e-3;
/// Around the burr, what bleeds within so much is sealed, metres.
const SEAL_M: f32 = 6e-3;

/// What the other hand does, as the keys or the script want it.
#[derive(Resource)]
pub struct OtherHand {
    pub is_irrigating: bool,
    pub is_sucking: bool,
    /// Seals what bleeds around the burr in the next step.
    pub seals: bool,
    /// Tip and direction from it towards the hand, in the world; none while it is away.
    pub tip: Option<(Vec3, Vec3)>,
}

/// The tube that is seen; its origin is the tip, the jet leaves along -Z.
#[derive(Component)]
pub struct Tube;

pub fn build(app: &mut App) {
    app.insert_resource(OtherHand { is_irrigating: true, is_sucking: false, seals: false, tip: None })
        .add_systems(Startup, spawn_tube)
        .add_systems(FixedUpdate, hold_tube.in_set(SurgerySystems::Sense).after(crate::drill::hold))
        .add_systems(Update, show_tube);
}

/// A pool over a bone that has arrived: level under the microscope, and fixed to the bone, so that both turn together.
pub fn add_pool(commands: &mut Commands, volume: Entity, place: &Transform, scale: f32, args: &Args) {
    let backend = match args.backend {
        Some(Backend::Gpu) => PoolBackend::Gpu,
        Some(Backend::Cpu) => PoolBackend::Cpu,
        None => PoolBackend::Auto,
    };
    let wanted = Pool::facing(place.translation, Vec3::Z);
    let local = Transform::from_matrix(place.to_matrix().inverse() * wanted.to_matrix());
    let pool = Pool::new(volume);
    commands.spawn((Pool { cell_m: pool.cell_m * scale, ..pool }, backend, local, ChildOf(volume)));
}

fn spawn_tube(
    mut commands: Commands,
    args: Res<Args>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let tool = Tool::new(ToolKind::SuctionIrrigator).in_hand(ToolHand::Left);
    let place =
        (Tube, Name::new("suction-irrigator"), tool, SuctionIrrigator::default(), Transform::from_xyz(0.0, 0.0, 1.0));
    let tube = commands.spawn((place, ToolSound { seed: 1, ..default() })).id();
    hold_device(&mut commands, tube, &args, ToolHand::Left);
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let pipe = [(0.55, 0.0), (0.9, 0.0), (1.0, 0.4), (1.15, 30.0)];
    let handle = [(1.15, 30.0), (2.0, 42.0), (3.2, 50.0), (3.2, 110.0)];
    let steel = StandardMaterial {
        base_color: Color::srgb(0.5, 0.53, 0.57),
        metallic: 0.5,
        perceptual_roughness: 0.3,
        ..default()
    };
    let steel = MeshMaterial3d(materials.add(steel));
    commands.entity(tube).insert(Visibility::Hidden);
    for outline in [pipe, handle] {
        let mesh = tool::revolve_mm(&outline).rotated_by(Quat::from_rotation_arc(Vec3::Y, Vec3::Z));
        let piece = (Mesh3d(meshes.add(mesh)), steel.clone(), ToolShadow, RenderLayers::layer(1));
        commands.spawn((piece, ChildOf(tube)));
    }
}

type Held = (&'static mut ToolPose, &'static mut ToolCommand, &'static mut SuctionIrrigator, Has<ServoReading>);

/// Holds the tip beside the burr, over the bone there, unless a device holds it.
fn hold_tube(
    drill: Res<Drill>,
    mut hand: ResMut<OtherHand>,
    picking: VolumePicking,
    eyes: Query<&GlobalTransform, With<Microscope>>,
    mut tubes: Query<Held, With<Tube>>,
    mut treatments: MessageWriter<TreatBleeders>,
) {
    let (Some(eye), Ok((mut pose, mut command, mut tube, is_device))) = (eyes.iter().next(), tubes.single_mut()) else {
        return;
    };
    let irrigation_ml_s = if hand.is_irrigating { SuctionIrrigator::default().irrigation_ml_s } else { 0.0 };
    if tube.irrigation_ml_s != irrigation_ml_s {
        tube.irrigation_ml_s = irrigation_ml_s;
    }
    if is_device {
        hand.is_sucking = command.pedal >= ToolCommand::DOWN;
        hand.tip = pose.is_tracked.then(|| (pose.place.tip_in_world_m, pose.place.back_in_world()));
        return;
    }
    if let Some(pose) = drill.pose {
        let view = eye.rotation();
        let beside_m = pose.centre_m + view * (BESIDE * (0.5 * drill.burr.diameter_m + BESIDE_M)).extend(0.0);
        let down = Dir3::new(beside_m - eye.translation()).unwrap_or(Dir3::NEG_Z);
        let from_m = beside_m - *down * 0.03;
        let hit = picking.cast_ray(Ray3d::new(from_m, down), 0.06);
        let height_m = HEIGHTS_M[usize::from(hand.is_sucking)];
        let tip_m = hit.map_or(beside_m, |hit| hit.position_world_m) - *down * height_m;
        // A hand does not jump.
        let tip_m = hand.tip.map_or(tip_m, |(before, _)| before.lerp(tip_m, 0.25));
        let aim = Aim { ray: Ray3d::new(from_m, down), shaft: (view * Vec3::new(-0.55, -0.45, 0.7)).normalize() };
        let to_hand = free_shaft(&picking, tip_m, TUBE_M, &aim);
        let to_hand = hand.tip.map_or(to_hand, |(_, before)| before.lerp(to_hand, 0.1).normalize_or(to_hand));
        hand.tip = Some((tip_m, to_hand));
        if std::mem::take(&mut hand.seals) {
            let control = BleedingControl::Cauterized;
            treatments.write(TreatBleeders { place_world_m: pose.centre_m, radius_m: SEAL_M, control });
        }
    }
    let Some((tip_m, to_hand)) = hand.tip else { return };
    *pose = ToolPose::with_shaft_towards(tip_m, tip_m + to_hand);
    command.pedal = f32::from(u8::from(hand.is_sucking));
}

fn show_tube(hand: Res<OtherHand>, mut tubes: Query<&mut Visibility, With<Tube>>) {
    let shown = if hand.tip.is_some() { Visibility::Inherited } else { Visibility::Hidden };
    tubes.iter_mut().for_each(|mut visibility| {
        visibility.set_if_neq(shown);
    });
}

/// What the report says of the pool.
pub fn count(world: &mut World, counters: &mut serde_json::Map<String, serde_json::Value>) {
    let mut pools = world.query_filtered::<(&PoolState, &WaterBudget), With<Pool>>();
    let Some((state, water)) = pools.iter(world).next() else { return };
    counters.insert("fluid_level_mm".into(), serde_json::json!(state.level_m.map(|level_m| level_m * 1e3)));
    counters.insert("fluid_cells".into(), state.wet_cells.into());
    counters.insert("blood_ml".into(), state.blood_ml.into());
    counters.insert("hidden_share".into(), state.hidden_share.into());
    counters.insert("water_ml".into(), serde_json::json!(water));
}

/// What the panel says of the pool.
pub fn said(hand: &OtherHand, state: &PoolState, water: &WaterBudget) -> String {
    let does = match (hand.is_irrigating, hand.is_sucking) {
        (true, true) => "irrigates and sucks",
        (true, false) => "irrigates",
        (false, true) => "sucks",
        (false, false) => "rests",
    };
    let hidden = 100.0 * state.hidden_share;
    format!("{does}\n{:.2} ml, {:.0} % hidden\nblood lost {:.2} ml\n", water.held_ml, hidden, water.bled_ml)
}
