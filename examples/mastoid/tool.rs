//! How the drill looks.

use crate::common::{Args, hold_device};
use crate::drill::{Drill, RightHand};
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::RenderLayers;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrShape};

/// The burr at its end.
#[derive(Component)]
struct BurrHead;

/// Turn between steps: no divisor of a whole one, so that the flutes do not stand still.
const TURN_PER_STEP_RAD: f32 = 1.1;

pub fn build(app: &mut App) {
    app.add_systems(Startup, spawn_drill).add_systems(Update, (change_burr, show_drill));
}

fn spawn_drill(
    mut commands: Commands,
    args: Res<Args>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let drill = commands
        .spawn((RightHand, Name::new("drill"), Tool::new(ToolKind::Drill(DrillHead::default())), ToolSound::default()))
        .id();
    hold_device(&mut commands, drill, &args, ToolHand::Right);
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    // Radius and height of the shaft, millimetres: a thin neck, the collar, the handle.
    // In two pieces, because bone is drawn again where the box around a mesh moves, and the neck is thin.
    let neck = [(0.0, 0.0), (0.75, 0.0), (1.1, 24.0), (2.2, 34.0)];
    let handle = [(2.2, 34.0), (3.6, 37.0), (4.6, 52.0), (5.5, 120.0), (0.0, 120.0)];
    let mut turned = |outline: &[(f32, f32)]| meshes.add(revolve_mm(outline));
    let pieces = [turned(&neck), turned(&handle)];
    let steel = StandardMaterial {
        base_color: Color::srgb(0.55, 0.57, 0.6),
        metallic: 0.5,
        perceptual_roughness: 0.38,
        ..default()
    };
    let steel = MeshMaterial3d(materials.add(steel));
    // Its shaft goes up along Y, a tool's back along Z.
    let upright = Transform::from_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
    commands.entity(drill).insert(Visibility::Hidden).with_children(|drill| {
        drill.spawn((BurrHead, upright, Visibility::default(), ToolShadow, RenderLayers::layer(1)));
        for piece in pieces {
            drill.spawn((Mesh3d(piece), steel.clone(), upright, ToolShadow, RenderLayers::layer(1)));
        }
    });
}

/// Turns an outline of radii and heights in millimetres about the Y axis.
pub fn revolve_mm(outline: &[(f32, f32)]) -> Mesh {
    revolve(&outline.iter().map(|&(radius, height)| Vec2::new(radius, height)).collect::<Vec<_>>(), 0.0)
}

/// Puts another burr on when another one was chosen.
fn change_burr(
    mut commands: Commands,
    drill: Res<Drill>,
    mut shown: Local<Option<Burr>>,
    heads: Query<Entity, With<BurrHead>>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let Some(head) = heads.iter().next().filter(|_| *shown != Some(drill.burr)) else { return };
    *shown = Some(drill.burr);
    let (colour, roughness, groove) = match drill.burr.kind {
        BurrKind::Cutting => (Color::srgb(0.7, 0.72, 0.75), 0.3, 0.16),
        BurrKind::Diamond => (Color::srgb(0.5, 0.46, 0.36), 0.75, 0.0),
        BurrKind::Polishing => (Color::srgb(0.62, 0.55, 0.45), 0.6, 0.0),
    };
    let steel = StandardMaterial { base_color: colour, metallic: 0.5, perceptual_roughness: roughness, ..default() };
    let mesh = revolve(&outline(&drill.burr), groove);
    commands.entity(head).insert((Mesh3d(meshes.add(mesh)), MeshMaterial3d(materials.add(steel))));
}

/// Half of a burr's section, from its tip to its back: radius and height, millimetres.
fn outline(burr: &Burr) -> Vec<Vec2> {
    let radius_mm = 500.0 * burr.diameter_m;
    let (straight_mm, is_round) = match burr.shape {
        BurrShape::Sphere => (0.0, true),
        BurrShape::Matchstick { length_m } => ((500.0 * length_m - radius_mm).max(0.0), true),
        BurrShape::Cylinder { length_m } => (500.0 * length_m, false),
    };
    let quarter =
        |k: u32| if is_round { Vec2::from_angle(std::f32::consts::FRAC_PI_2 * k as f32 / 10.0) } else { Vec2::X };
    let tip = Vec2::new(0.0, -straight_mm - if is_round { radius_mm } else { 0.0 });
    let below = (0..10).rev().map(|k| quarter(k) * Vec2::new(radius_mm, -radius_mm) - Vec2::Y * straight_mm);
    let above = (0..10).map(|k| quarter(k) * radius_mm + Vec2::Y * straight_mm);
    std::iter::once(tip).chain(below).chain(above).chain([tip * Vec2::NEG_Y]).collect()
}

/// Turns an outline in millimetres about the Y axis, which gives a mesh in metres; grooves of a depth, as a share of the radius, wind about it.
fn revolve(outline: &[Vec2], groove: f32) -> Mesh {
    const SEGMENTS: u32 = 96;
    const FLUTES: f32 = 8.0;
    let widest = outline.iter().fold(0.0_f32, |widest, point| widest.max(point.x));
    let mut positions = Vec::new();
    for point in outline {
        for k in 0..SEGMENTS {
            let angle = k as f32 / SEGMENTS as f32 * std::f32::consts::TAU;
            let flute = (0.5 * FLUTES * (angle + 0.6 * point.y / widest)).sin().abs();
            let radius = point.x * (1.0 - groove * (1.0 - flute).powi(2));
            positions.push([radius * angle.cos(), point.y, -radius * angle.sin()]);
        }
    }
    let mut indices = Vec::new();
    for ring in 0..outline.len() as u32 - 1 {
        for k in 0..SEGMENTS {
            let next = (k + 1) % SEGMENTS;
            let [a, b, c, d] =
                [ring * SEGMENTS + k, ring * SEGMENTS + next, (ring + 1) * SEGMENTS + k, (ring + 1) * SEGMENTS + next];
            indices.extend([a, b, c, c, b, d]);
        }
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(indices))
        .with_computed_smooth_normals()
        // Only now: Bevy takes triangles of a tenth of a millimetre for points, which have no normals.
        .scaled_by(Vec3::splat(1e-3))
}

/// Shows the drill while it is held, and turns its burr.
fn show_drill(
    drill: Res<Drill>,
    mut handles: Query<&mut Visibility, With<RightHand>>,
    mut heads: Query<&mut Transform, With<BurrHead>>,
) {
    for mut visibility in &mut handles {
        let shown = if drill.pose.is_some() { Visibility::Inherited } else { Visibility::Hidden };
        visibility.set_if_neq(shown);
    }
    if drill.is_on && drill.pose.is_some() {
        heads.iter_mut().for_each(|mut head| head.rotate_local_y(TURN_PER_STEP_RAD));
    }
}
