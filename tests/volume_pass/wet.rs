//! Wet shading on the GPU.

use super::stage::{SIZE_PX, Shot, Stage};
use super::{SIZE, solid, specimen, veil, volume_of};
use bevy::camera::{OrthographicProjection, ScalingMode};
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy_surgery::volume::{SmoothedNormals, WetShading};

/// Two roofs beside one another that slope away from their common edge, one higher than the other by some voxels; seen from
/// straight above, 4 pixels to a voxel, the edge in the middle of the picture.
fn roofs(height_voxels: f32) -> Stage {
    let size = UVec3::new(32, 24, 64);
    let volume = volume_of(size, DVec3::ONE, |voxel| {
        let from_edge = voxel.x - 15.5;
        let top = if from_edge < 0.0 { 20.0 + 0.6 * from_edge } else { 20.0 + height_voxels - 0.6 * from_edge };
        0.5 + (top - voxel.z) / 3.0
    });
    let mut stage = Stage::new(volume, solid([200, 200, 200]));
    let camera = stage.camera;
    let flat = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 0.024 },
        near: 0.0,
        ..OrthographicProjection::default_3d()
    };
    stage.set(camera, Projection::Orthographic(flat));
    stage.aim(Vec3::Z * 0.06, Vec3::ZERO);
    stage
}

/// Greatest difference that the left roof makes to a pixel of the right one.
fn leakage(stage: &mut Stage) -> f32 {
    stage.look().clip_planes.clear();
    let both = stage.shot();
    // The left half is cut away; normals of what is left stay as they are.
    stage.look().clip_planes = vec![Vec4::new(1.0, 0.0, 0.0, 0.0)];
    let right = stage.shot();
    let mut compared = 0;
    let differences = both.colour.iter().zip(&right.colour).enumerate().filter_map(|(place, (both, right))| {
        let is_right = place as u32 % SIZE_PX.x >= SIZE_PX.x / 2;
        (is_right && right[3] > 0.9).then(|| {
            compared += 1;
            (0..3).map(|channel| (both[channel] - right[channel]).abs()).fold(0.0, f32::max)
        })
    });
    let most = differences.fold(0.0, f32::max);
    assert!(compared > 4000, "only {compared} pixels show the right roof");
    most
}

#[test]
fn edges_are_not_smeared() {
    let wet = WetShading { smoothed: SmoothedNormals::All, passes: 8, edge_voxels: 5.0, ..default() };
    let mut leaks = Vec::new();
    for height_voxels in [0.0, 3.0, 20.0] {
        let mut stage = roofs(height_voxels);
        stage.look().wet = wet;
        leaks.push(leakage(&mut stage));
        // Without smoothing nothing leaks at all.
        stage.look().wet.passes = 0;
        assert_eq!(leakage(&mut stage), 0.0, "a step of {height_voxels} voxels");
    }
    println!("leakage by height of the step: {leaks:?}");
    assert!(leaks[0] > 0.01 && leaks[1] > 0.01, "where there is hardly a step, both sides mix: {leaks:?}");
    assert_eq!(leaks[2], 0.0, "{leaks:?}");
}

fn differing(a: &Shot, b: &Shot) -> usize {
    a.colour.iter().zip(&b.colour).filter(|(a, b)| a != b).count()
}

#[test]
fn smoothed_normals_feed_what_they_are_asked_to() {
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil());
    let mut shot = |smoothed, shine| {
        stage.look().wet = WetShading { smoothed, shine, shine_exponent: 20.0, ..default() };
        stage.shot()
    };
    let dry = shot(SmoothedNormals::None, 0.0);
    assert_eq!(differing(&dry, &shot(SmoothedNormals::Reflections, 0.0)), 0, "diffuse light goes by the own normals");
    assert!(differing(&dry, &shot(SmoothedNormals::All, 0.0)) > 1000, "or else by the smoothed ones");
    let grainy = shot(SmoothedNormals::None, 1.0);
    let film = shot(SmoothedNormals::Reflections, 1.0);
    let all = shot(SmoothedNormals::All, 1.0);
    assert!(differing(&dry, &grainy) > 300 && differing(&grainy, &film) > 300 && differing(&film, &all) > 300);
    assert!(
        dry.colour.iter().zip(&film.colour).all(|(dry, film)| (0..3).all(|c| film[c] >= dry[c])),
        "a film adds light"
    );
    // Without passes there is nothing to smooth.
    stage.look().wet = WetShading { passes: 0, shine: 1.0, shine_exponent: 20.0, ..default() };
    assert_eq!(differing(&grainy, &stage.shot()), 0);
}

#[test]
fn what_is_not_shaded_shows_its_own_colours() {
    let colour = [40, 200, 120];
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), solid(colour));
    stage.look().wet.is_shaded = false;
    let own = Color::srgb_u8(colour[0], colour[1], colour[2]).to_linear();
    let shot = stage.shot();
    let mut seen = 0;
    for texel in shot.colour.iter().filter(|texel| texel[3] > 0.95) {
        for (channel, own) in [own.red, own.green, own.blue].into_iter().enumerate() {
            assert!((texel[channel] / texel[3] - own).abs() < 0.005, "{texel:?} is not {own:?}");
        }
        seen += 1;
    }
    assert!(seen > 1000, "only {seen} pixels are solid");
    // Whatever the light is.
    stage.add_sun(Vec3::NEG_Y, 10_000.0);
    assert!(stage.shot() == shot);
    let mut lamps = stage.app.world_mut().query_filtered::<Entity, Or<(With<DirectionalLight>, With<PointLight>)>>();
    let lamps: Vec<Entity> = lamps.iter(stage.app.world()).collect();
    for lamp in lamps {
        stage.app.world_mut().despawn(lamp);
    }
    assert!(stage.shot() == shot);
}
