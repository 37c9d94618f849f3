//! The organ presets side by side: one shape, five skins.

mod common;

use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::view::ScopeMask;
use common::{Args, Stage};
use std::process::ExitCode;

fn main() -> ExitCode {
    common::main_with(
        "presets",
        |app| {
            app.insert_resource(ClearColor(Color::srgb(0.16, 0.17, 0.19)));
            app.add_systems(Startup, setup).add_systems(FixedUpdate, turn.in_set(SurgerySystems::Sense));
        },
        |world| {
            let organs = world.query::<&Organ>().iter(world).count();
            serde_json::Map::from_iter([("organs".to_string(), organs.into())])
        },
    )
}

fn setup(
    mut commands: Commands,
    args: Res<Args>,
    stage: Res<Stage>,
    assets: Res<AssetServer>,
    mut models: ResMut<Assets<OrganModel>>,
) -> Result {
    let options = OrganOptions::default().with_largest_extent_m(0.115).centred();
    let organ = common::organ(&args, None, options, &assets, &mut models)?;
    for (place, preset) in OrganPreset::ALL.into_iter().enumerate() {
        // Three above, two below.
        let (row, column) = (place / 3, place % 3);
        let at = Transform::from_xyz(0.125 * (column as f32 - 1.0 + 0.5 * row as f32), 0.05 - 0.1 * row as f32, 0.0)
            .with_rotation(Quat::from_rotation_x(0.35));
        commands.spawn((Organ(organ.clone()), Skin { seed: args.seed + place as u64, ..preset.skin() }, at));
    }
    let view = Transform::from_xyz(0.0, 0.0, 0.25).looking_at(Vec3::ZERO, Vec3::Y);
    let light = ScopeLight { intensity_cd: 190.0, outer_angle_rad: 1.3, ..default() };
    commands.spawn((Endoscope::default(), light, stage.target.clone(), view)).remove::<ScopeMask>();
    // Organs are lit by Bevy's lights too.
    let sun = Transform::from_xyz(1.0, 2.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y);
    commands.spawn((DirectionalLight { illuminance: 900.0, ..default() }, sun));
    Ok(())
}

fn turn(mut organs: Query<&mut Transform, With<Organ>>) {
    for mut transform in &mut organs {
        transform.rotate_local_y(0.01);
    }
}
