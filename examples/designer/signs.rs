//! What has no look of its own, to be seen where it is: instruments and the cameras of the scene.

use crate::Designer;
use crate::view::OwnView;
use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::{ScenarioEye, ScenarioRun};
use bevy_surgery::scenes::NotAuthored;
use bevy_surgery::view::StereoEye;

/// Size of the sign of a camera, metres.
const CAMERA_M: f32 = 0.01;

/// The look of an instrument: what it belongs to, and radius of the tip, radius and length of the shaft, metres.
#[derive(Component)]
struct Body {
    of: Entity,
    outline_m: [f32; 3],
}

pub fn build(app: &mut App) {
    // Headless programs of the models alone have no meshes.
    app.add_systems(
        PostUpdate,
        (show_tools, show_cameras).after(TransformSystems::Propagate).run_if(resource_exists::<Assets<Mesh>>),
    );
}

fn outline_m(tool: &Tool) -> [f32; 3] {
    let sane = |number: f32, least: f32| if number.is_finite() { number.clamp(least, 1.0) } else { least };
    let geometry = &tool.geometry;
    [tool.tip_radius_m().max(3e-4), sane(geometry.shaft_radius_m, 3e-4), sane(geometry.shaft_length_m, 0.01)]
}

/// Every instrument has a shaft and a tip, also while its outline is being changed.
fn show_tools(
    mut commands: Commands,
    tools: Query<(Entity, &Tool, &ToolMotion, &GlobalTransform), Without<Body>>,
    mut bodies: Query<(Entity, &Body, &mut Transform, &mut GlobalTransform, &mut Visibility), Without<Tool>>,
    run: Option<Res<ScenarioRun>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    mut paint: Local<Option<Handle<StandardMaterial>>>,
) {
    let mut shown = Vec::new();
    for (entity, body, mut place, mut world_from_body, mut visibility) in &mut bodies {
        let tool = tools.get(body.of).ok().filter(|(_, tool, ..)| outline_m(tool) == body.outline_m);
        let Some((_, _, motion, world_from_tool)) = tool else {
            commands.entity(entity).despawn();
            continue;
        };
        shown.push(body.of);
        let wanted = match motion.to {
            Some(held) => Transform::from_translation(held.tip_in_world_m).with_rotation(held.world_from_tool),
            None => Transform { scale: Vec3::ONE, ..world_from_tool.compute_transform() },
        };
        // In a run, what nobody holds lies aside.
        let is_aside = motion.to.is_none() && run.is_some();
        visibility.set_if_neq(if is_aside { Visibility::Hidden } else { Visibility::Inherited });
        place.set_if_neq(wanted);
        // It was propagated already.
        *world_from_body = wanted.into();
    }
    for (of, tool, ..) in tools.iter().filter(|(entity, ..)| !shown.contains(entity)) {
        // Not lit: a scene need not have lights that Bevy's materials know of.
        let material = paint.get_or_insert_with(|| materials.add(StandardMaterial { unlit: true, ..default() }));
        let outline_m = outline_m(tool);
        let look = (Mesh3d(meshes.add(mesh(outline_m))), MeshMaterial3d(material.clone()));
        commands.spawn((NotAuthored, Body { of, outline_m }, look));
    }
}

/// Shaft and tip, with shading painted on them as if a lamp stood above and beside.
fn mesh([tip_radius_m, shaft_radius_m, length_m]: [f32; 3]) -> Mesh {
    // A cylinder stands along Y, a tool's back is along Z.
    let upright = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let mut mesh =
        Mesh::from(Cylinder::new(shaft_radius_m, length_m)).rotated_by(upright).translated_by(Vec3::Z * 0.5 * length_m);
    // Both have the same attributes.
    let _ = mesh.merge(&Mesh::from(Sphere::new(tip_radius_m)));
    let normals = mesh.attribute(Mesh::ATTRIBUTE_NORMAL).and_then(|normals| normals.as_float3()).unwrap_or_default();
    let lamp = Vec3::new(0.45, 0.8, 0.4);
    let shades: Vec<[f32; 4]> = normals
        .iter()
        .map(|normal| {
            let shade = 0.06 + 0.3 * (0.5 + 0.5 * Vec3::from_array(*normal).dot(lamp)).powi(2);
            [shade, 1.02 * shade, 1.06 * shade, 1.0]
        })
        .collect();
    mesh.insert_attribute(Mesh::ATTRIBUTE_COLOR, shades);
    mesh
}

/// A pyramid where a camera of the scene is, opening to where it looks.
fn show_cameras(
    mut gizmos: Gizmos,
    designer: Res<Designer>,
    own: Query<&GlobalTransform, With<OwnView>>,
    cameras: Query<
        (Entity, &GlobalTransform),
        (Or<(With<Camera3d>, With<ScenarioEye>)>, Without<NotAuthored>, Without<StereoEye>, Without<RenderLayers>),
    >,
) {
    let eye_m = own.iter().next().map(GlobalTransform::translation);
    for (entity, place) in cameras.iter().filter(|(entity, _)| designer.through != Some(*entity)) {
        let tip = place.translation();
        // One that looks from where the designer looks would be lines across the picture.
        if eye_m.is_some_and(|eye_m| eye_m.distance(tip) < 4.0 * CAMERA_M) {
            continue;
        }
        let ends = [(-1.0, -0.75), (1.0, -0.75), (1.0, 0.75), (-1.0, 0.75)].map(|(x, y)| {
            let ahead = 1.5 * place.forward() + x * place.right().as_vec3() + y * place.up().as_vec3();
            tip + CAMERA_M * ahead
        });
        let colour =
            if designer.chosen == Some(entity) { Color::srgb(1.0, 0.8, 0.3) } else { Color::srgb(0.6, 0.65, 0.7) };
        for corner in 0..4 {
            gizmos.line(tip, ends[corner], colour);
            gizmos.line(ends[corner], ends[(corner + 1) % 4], colour);
        }
    }
}
