//! A liver under the endoscope that bleeds, burns and gives way: real where one is at hand, otherwise the one that ships
//! with the crate. With `--preset` it is another organ; with `--script demo` everything is done with no one there.
//!
//! The left button works with the instrument that was chosen: 1 a probe that presses, 2 an electrode that coagulates, 3 one
//! that cuts, 4 a biopsy needle, 5 a grasper that takes hold where it is pressed, follows the mouse, and lifts with the wheel or
//! the arrows up and down. Drag with the right button to turn the view, with the middle one to move it, scroll to come closer;
//! Escape ends.

// Queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "liver/demo.rs"]
mod demo;
#[path = "liver/instruments.rs"]
mod instruments;

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::abdominal_wall;
use bevy_surgery::sound::ears_at_field;
use common::{Args, Script, Stage, Viewer};
use instruments::Patient;
use std::process::ExitCode;

fn main() -> ExitCode {
    common::main_with(
        "liver",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.2, 0.07, 0.06)));
            instruments::build(app);
            app.add_systems(Startup, setup).add_systems(FixedUpdate, turn.in_set(SurgerySystems::Sense));
            if app.world().resource::<Args>().script == Script::Demo {
                demo::build(app);
            } else if app.world().resource::<Stage>().viewer == Viewer::Person {
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
    commands.spawn((
        Organ(organ),
        // The sharp reflections take the place of most of the soft sheen.
        Skin { seed: args.seed, sheen: 0.15, ..args.preset.skin() },
        Reactions { map_width_px: args.map, ..default() },
        Highlights { grain_tilt: 0.02, dry_roughness: 0.016, ..default() },
        Patient,
    ));
    // The wall of the abdomen round it: the same kind of organ, hollow and seen from inside.
    commands.spawn_scene(bsn! { abdominal_wall() Skin { seed: {args.seed} } });
    // A smaller organ is looked at from nearer, with less light.
    let nearness = extent_m / OrganPreset::Liver.typical_extent_m();
    let light = ScopeLight::default();
    let mut scope = commands.spawn((
        Endoscope::default(),
        // A wide ring, as lamps round the trocar have: its reflection is seen as a ring.
        ScopeLight { intensity_cd: light.intensity_cd * nearness * nearness, ring_radius_m: 0.015, ..light },
        // The instruments' own light is on layer 1, so that it does not light the organ a second time.
        RenderLayers::from_layers(&[0, 1]),
        stage.target.clone(),
        ears_at_field(0.2 * nearness),
        Transform::from_translation(Vec3::new(0.0, 0.09, 0.18) * nearness).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    if stage.viewer == Viewer::Person && args.script == Script::None {
        scope.insert(PanOrbitCamera {
            button_orbit: MouseButton::Right,
            button_pan: MouseButton::Middle,
            zoom_lower_limit: 0.02,
            zoom_sensitivity: 0.3,
            ..default()
        });
    }
    Ok(())
}

/// Turns the organ slowly where nobody is there to do so.
fn turn(stage: Res<Stage>, args: Res<Args>, mut organs: Query<&mut Transform, With<Patient>>) {
    let is_shown = stage.viewer == Viewer::Nobody && args.script == Script::None;
    for mut transform in organs.iter_mut().filter(|_| is_shown) {
        transform.rotate_y(0.01);
    }
}

fn count(world: &mut World) -> serde_json::Map<String, serde_json::Value> {
    let mut counters = serde_json::Map::new();
    let mut organs = world.query_filtered::<(&Organ, &OrganShape, &ReactionModel), With<Patient>>();
    let (models, kinds) = (world.resource::<Assets<OrganModel>>(), world.resource::<ReactionKinds>());
    for (organ, shape, reactions) in organs.iter(world) {
        let Some(model) = models.get(&organ.0) else { continue };
        counters.insert("faces".into(), model.mesh.triangles.len().into());
        counters.insert("skin_triangles".into(), (model.skin_mesh.indices.len() / 3).into());
        counters.insert("organ".into(), serde_json::to_value(&model.report).unwrap_or_default());
        counters.insert("sprites".into(), reactions.sprite_count().into());
        counters.insert("drops".into(), reactions.drop_count(kinds).into());
        counters.insert("hot_tiles".into(), reactions.heat().hot_tiles().into());
        counters.insert("reactions".into(), serde_json::to_value(reactions.tally()).unwrap_or_default());
        let texel = reactions.texel_size(&model.surface(shape));
        counters.insert("texel_mm".into(), serde_json::to_value(texel).unwrap_or_default());
    }
    counters
}
