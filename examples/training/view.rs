//! What is seen: a camera where the scenario's eye is, and its instruments.

use crate::common::{Stage, Viewer};
use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::{ScenarioEye, ScenarioRun, ScenarioScene};
use bevy_surgery::scenes::abdominal_wall;

pub fn build(app: &mut App) {
    app.add_systems(Update, (look, show_tools, hide_tools).run_if(resource_exists::<Assets<Mesh>>));
    if app.world().resource::<Stage>().viewer == Viewer::Person {
        app.add_plugins(PanOrbitCameraPlugin);
    }
}

/// A camera where the eye is.
fn look(mut commands: Commands, stage: Res<Stage>, run: Res<ScenarioRun>, eyes: Query<Entity, Added<ScenarioEye>>) {
    for eye in &eyes {
        let is_bone = run.scenario().scene == ScenarioScene::TemporalBone;
        // The instruments' own light is on layer 1, so that it does not light the patient a second time.
        let layers = RenderLayers::from_layers(&[0, 1]);
        let mut camera = commands.entity(eye);
        camera.insert((stage.target.clone(), layers.clone()));
        if is_bone {
            camera.insert((
                Microscope::default(),
                children![
                    (
                        MicroscopeLamp { offset_m: Vec2::new(0.024, 0.026) },
                        ScopeLight { intensity_cd: 222.0, ..default() },
                        layers.clone()
                    ),
                    (
                        PointLight { intensity: 9000.0, range: 2.0, ..default() },
                        Transform::from_xyz(-0.1, 0.12, 0.0),
                        RenderLayers::layer(1)
                    ),
                ],
            ));
        } else {
            let light = ScopeLight::default();
            camera.insert((Endoscope::default(), ScopeLight { ring_radius_m: 0.015, ..light }));
            camera.with_child((
                PointLight { intensity: 9000.0, range: 2.0, ..default() },
                Transform::from_xyz(-0.1, 0.12, 0.0),
                RenderLayers::layer(1),
            ));
            commands.spawn_scene(abdominal_wall());
        }
        if stage.viewer == Viewer::Person {
            commands.entity(eye).insert(PanOrbitCamera {
                button_orbit: MouseButton::Middle,
                button_pan: MouseButton::Middle,
                modifier_pan: Some(KeyCode::ShiftLeft),
                zoom_sensitivity: 0.0,
                ..default()
            });
        }
    }
}

/// A shaft and a tip for every instrument.
fn show_tools(
    mut commands: Commands,
    tools: Query<(Entity, &Tool), Added<Tool>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    for (entity, tool) in &tools {
        let (length_m, radius_m) = (tool.geometry.shaft_length_m.max(0.01), tool.geometry.shaft_radius_m.max(3e-4));
        let colour = match tool.kind {
            ToolKind::CauteryHook(_) => Color::srgb(0.12, 0.12, 0.13),
            _ => Color::srgb(0.55, 0.57, 0.6),
        };
        let material = |base_color, perceptual_roughness| StandardMaterial {
            base_color,
            metallic: 0.5,
            perceptual_roughness,
            ..default()
        };
        let shaft = MeshMaterial3d(materials.add(material(colour, 0.4)));
        let steel = MeshMaterial3d(materials.add(material(Color::srgb(0.7, 0.72, 0.75), 0.3)));
        // A cylinder stands along Y, a tool's back is along Z.
        let upright = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
        let back = Transform::from_xyz(0.0, 0.0, 0.5 * length_m).with_rotation(upright);
        commands.entity(entity).insert(Visibility::Hidden).with_children(|tool_parts| {
            let rod = meshes.add(Cylinder::new(radius_m, length_m));
            tool_parts.spawn((Mesh3d(rod), shaft, back, ToolShadow, RenderLayers::layer(1)));
            let tip = meshes.add(Sphere::new(tool.tip_radius_m().max(3e-4)));
            tool_parts.spawn((Mesh3d(tip), steel, ToolShadow, RenderLayers::layer(1)));
        });
    }
}

/// Instruments that nobody holds are not seen.
fn hide_tools(mut tools: Query<(&ToolMotion, &mut Visibility)>) {
    for (motion, mut visibility) in &mut tools {
        visibility.set_if_neq(if motion.to.is_some() { Visibility::Inherited } else { Visibility::Hidden });
    }
}
