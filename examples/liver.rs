//! A liver under the endoscope: real where one is at hand, otherwise the one that ships with the crate. With
//! `--preset` it is another organ.
//!
//! Drag with the left button to turn it, with the right to move, scroll to come closer; Escape ends.

mod common;

use bevy::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::prelude::*;
use common::{Args, Stage, Viewer};
use std::process::ExitCode;

fn main() -> ExitCode {
    common::main_with(
        "liver",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.2, 0.07, 0.06)));
            app.add_systems(Startup, setup).add_systems(FixedUpdate, turn.in_set(SurgerySystems::Sense));
            if app.world().resource::<Stage>().viewer == Viewer::Person {
                app.add_plugins(PanOrbitCameraPlugin);
            }
        },
        count,
    )
}

fn setup(
    mut commands: Commands,
    args: Res<Args>,
    stage: Res<Stage>,
    assets: Res<AssetServer>,
    mut models: ResMut<Assets<OrganModel>>,
) -> Result {
    let extent_m = args.preset.typical_extent_m();
    // Files come in all units: whatever they say, an organ is as large as its kind.
    let options = OrganOptions::default().with_largest_extent_m(extent_m).centred();
    let real = match args.preset {
        OrganPreset::Liver => Some("liver-smooth.obj"),
        OrganPreset::Gallbladder => Some("gallbladder.stl"),
        _ => None,
    };
    let organ = common::organ(&args, real, options, &assets, &mut models)?;
    commands.spawn((Organ(organ), Skin { seed: args.seed, ..args.preset.skin() }, Patient));
    // The wall of the abdomen round it: the same kind of organ, hollow and seen from inside.
    let wall = procedural_ellipsoid(Vec3::new(0.26, 0.24, 0.26), 6);
    let wall = OrganModel::from_mesh_cached(wall, "abdominal wall", &OrganOptions::default(), &default())?;
    commands.spawn((Organ(models.add(wall)), Hollow, Skin { seed: args.seed, ..Skin::mucosa() }));
    // A smaller organ is looked at from nearer, with less light.
    let nearness = extent_m / OrganPreset::Liver.typical_extent_m();
    let light = ScopeLight::default();
    let mut scope = commands.spawn((
        Endoscope::default(),
        ScopeLight { intensity_cd: light.intensity_cd * nearness * nearness, ..light },
        stage.target.clone(),
        Transform::from_translation(Vec3::new(0.0, 0.09, 0.18) * nearness).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    if stage.viewer == Viewer::Person {
        scope.insert(PanOrbitCamera { zoom_lower_limit: 0.02, zoom_sensitivity: 0.3, ..default() });
    }
    Ok(())
}

/// Marks the organ that is looked at.
#[derive(Component)]
struct Patient;

/// Turns the organ slowly where nobody is there to do so.
fn turn(stage: Res<Stage>, mut organs: Query<&mut Transform, With<Patient>>) {
    for mut transform in organs.iter_mut().filter(|_| stage.viewer == Viewer::Nobody) {
        transform.rotate_y(0.01);
    }
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    let mut organs = world.query::<&Organ>();
    let models = world.resource::<Assets<OrganModel>>();
    if let Some(model) = organs.iter(world).next().and_then(|organ| models.get(&organ.0)) {
        counters.insert("faces".into(), model.mesh.triangles.len().into());
        counters.insert("skin_triangles".into(), (model.skin_mesh.indices.len() / 3).into());
        counters.insert("organ".into(), serde_json::to_value(&model.report).unwrap_or_default());
    }
    counters
}
