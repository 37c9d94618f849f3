//! The tool that is seen, where the hand is, and arrows for the forces.

use crate::Hand;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::ServoReading;

/// Length of an arrow per newton, metres.
const PER_NEWTON_M: f32 = 0.012;
/// Longest arrow, metres.
const LONGEST_M: f32 = 0.05;

/// What is drawn.
#[derive(Component, Clone, Copy, PartialEq)]
enum Part {
    /// Where the hand is, behind the surface.
    Hand,
    /// The force that the hand feels.
    Force,
    /// The force of contact, before it was limited.
    Wanted,
}

pub fn build(app: &mut App) {
    app.add_systems(Startup, spawn.after(crate::setup)).add_systems(Update, place);
}

fn spawn(
    mut commands: Commands,
    tools: Query<(Entity, &Tool), With<Hand>>,
    meshes: Option<ResMut<Assets<Mesh>>>,
    materials: Option<ResMut<Assets<StandardMaterial>>>,
) {
    // Without a renderer there is nothing to see.
    let (Some(mut meshes), Some(mut materials)) = (meshes, materials) else { return };
    let mut plain = |colour: Color| {
        MeshMaterial3d(materials.add(StandardMaterial { base_color: colour, perceptual_roughness: 0.5, ..default() }))
    };
    let steel = plain(Color::srgb(0.7, 0.72, 0.75));
    let parts = [
        (Part::Hand, plain(Color::srgb(0.35, 0.6, 1.0))),
        (Part::Force, plain(Color::srgb(1.0, 0.75, 0.15))),
        (Part::Wanted, plain(Color::srgb(0.6, 0.25, 0.15))),
    ];
    for (tool, Tool { geometry, .. }) in &tools {
        let tip = Mesh3d(meshes.add(Sphere::new(geometry.tip_radius_m)));
        let shaft = Mesh3d(meshes.add(Cylinder::new(geometry.shaft_radius_m, geometry.shaft_length_m)));
        let back = Transform::from_xyz(0.0, 0.0, 0.5 * geometry.shaft_length_m)
            .with_rotation(Quat::from_rotation_x(std::f32::consts::FRAC_PI_2));
        commands.entity(tool).insert(Visibility::default()).with_children(|tool| {
            tool.spawn((tip, steel.clone()));
            tool.spawn((shaft, steel.clone(), back));
        });
    }
    for (part, colour) in parts {
        let mesh = match part {
            Part::Hand => meshes.add(Sphere::new(2e-3)),
            // One metre long, along Y from its foot.
            _ => meshes.add(arrow()),
        };
        commands.spawn((part, Mesh3d(mesh), colour, Transform::default(), Visibility::Hidden));
    }
}

fn arrow() -> Mesh {
    let rod = Cylinder::new(0.0012, 0.8).mesh().build().translated_by(Vec3::Y * 0.4);
    let head = Cone::new(0.003, 0.2).mesh().build().translated_by(Vec3::Y * 0.9);
    let mut arrow = rod;
    // Two meshes of Bevy's own have the same attributes.
    drop(arrow.merge(&head));
    arrow
}

fn place(
    hands: Query<(&ServoReading, &ToolMotion), With<Hand>>,
    mut parts: Query<(&Part, &mut Transform, &mut Visibility)>,
) {
    let Ok((reading, motion)) = hands.single() else { return };
    let state = &reading.state;
    let Some(tip_m) = motion.to.map(|place| place.tip_in_world_m) else {
        parts.iter_mut().for_each(|(_, _, mut visibility)| *visibility = Visibility::Hidden);
        return;
    };
    for (part, mut transform, mut visibility) in &mut parts {
        let arrow = |force_n: Vec3| {
            let length_m = (force_n.length() * PER_NEWTON_M).min(LONGEST_M);
            let rotation = Quat::from_rotation_arc(Vec3::Y, force_n.normalize_or(Vec3::Y));
            let scale = Vec3::new(1.0, length_m.max(1e-6), 1.0);
            (Transform { translation: tip_m, rotation, scale }, length_m > 1e-3)
        };
        let told = state.force_in_world_n.as_vec3();
        // What is told is shown in the world by its share of what was wanted.
        let share = (state.force_in_device_n.length() / state.force_in_world_n.length().max(1e-9)).min(1.0) as f32;
        let (placed, is_shown) = match part {
            Part::Hand => {
                let at_m = state.tip_in_world_m.as_vec3();
                (Transform::from_translation(at_m), at_m.distance(tip_m) > 1e-3)
            }
            Part::Force => arrow(told * share),
            Part::Wanted => {
                let (placed, is_shown) = arrow(told);
                (placed, is_shown && share < 0.95)
            }
        };
        transform.set_if_neq(placed);
        visibility.set_if_neq(if is_shown { Visibility::Visible } else { Visibility::Hidden });
    }
}
