//! The GPU's picture is the CPU's.

use super::stage::{Difference, EYE, Stage};
use super::{SIZE, points, specimen, veil, volume_of, voxels_of};
use bevy::camera::SubCameraView;
use bevy::camera::{OrthographicProjection, ScalingMode};
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy_surgery::volume::transfer::{ColourSource, TransferFunction};
use bevy_surgery::volume::{Volume, VolumeGrid, VolumeMethod, Voxels};

/// Holds the GPU's rays and slices against the CPU's, and sees to it that a displaced picture would not pass.
pub fn check(stage: &mut Stage, what: &str, least_covered: usize) {
    let all = [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices];
    compare(stage, &all, what, least_covered, true);
}

/// The ways that look in every direction: rays askew to slices that are aligned with the volume meet too few of them.
const ALL_AROUND: [VolumeMethod; 2] = [VolumeMethod::Rays, VolumeMethod::Slices];

fn compare(stage: &mut Stage, methods: &[VolumeMethod], what: &str, least_covered: usize, is_displaced: bool) {
    for &method in methods {
        stage.look().method = method;
        let shot = stage.shot();
        let edge_m = stage.rays(Vec3::ZERO).voxel_edge_m();
        let twin = stage.twin();
        let difference = Difference::between(&shot, &twin, edge_m);
        println!("{what}, {method:?}: {difference:?}");
        assert!(difference.covered > least_covered, "{what}, {method:?}: {difference:?} shows too little");
        assert!(difference.is_small(), "{what}, {method:?}: {difference:?}");
        let camera = stage.app.world().get::<GlobalTransform>(stage.camera).expect("it is placed");
        for displaced in [camera.right(), camera.up(), camera.forward()].into_iter().filter(|_| is_displaced) {
            let twin = stage.twin_moved(displaced * (1.5 * edge_m));
            let difference = Difference::between(&shot, &twin, edge_m);
            assert!(!difference.is_small(), "{what}, {method:?}: {displaced:?} makes no difference: {difference:?}");
        }
    }
}

fn eight_bits() -> Volume {
    volume_of(SIZE, DVec3::ONE, specimen)
}

fn hounsfield() -> Volume {
    let voxels = voxels_of(SIZE).map(|voxel| (specimen(voxel) * 2500.0) as i16).collect();
    let grid = VolumeGrid::upright(SIZE, DVec3::new(0.9, 1.3, 1.1));
    Volume::new(grid, Voxels::I16(voxels), 1.0, -1000.0).expect("a good volume")
}

fn coloured() -> Volume {
    let voxels = voxels_of(SIZE).map(|voxel| {
        let [red, green, blue] = (voxel / SIZE.as_vec3() * 255.0).to_array().map(|channel| channel as u8);
        [red, 255 - green, blue, (specimen(voxel) * 255.0) as u8]
    });
    let grid = VolumeGrid::upright(SIZE, DVec3::ONE);
    Volume::new(grid, Voxels::Rgba(voxels.collect()), 1.0, 0.0).expect("a good volume")
}

#[test]
fn every_projection_gives_the_picture_of_the_cpu() {
    let mut stage = Stage::new(eight_bits(), veil());
    let camera = stage.camera;
    check(&mut stage, "perspective", 1500);
    for step_voxels in [0.5, 2.0] {
        stage.look().step_voxels = step_voxels;
        check(&mut stage, &format!("steps of {step_voxels} voxels"), 1500);
    }
    stage.look().step_voxels = 1.0;
    let flat = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 0.04 },
        near: -0.02,
        far: 1.0,
        ..OrthographicProjection::default_3d()
    };
    stage.set(camera, Projection::Orthographic(flat.clone()));
    check(&mut stage, "orthographic", 1500);
    // Through the middle of the volume.
    stage.aim(Vec3::new(0.001, 0.0, 0.002), Vec3::new(-0.02, -0.01, -0.05));
    stage.set(camera, Projection::Orthographic(OrthographicProjection { near: 0.0, ..flat }));
    check(&mut stage, "orthographic, from inside", 1500);
    stage.aim(EYE, Vec3::ZERO);
    stage.set(camera, super::stage::lens());
    let mut lens = stage.app.world_mut().get_mut::<Camera>(camera).expect("a camera");
    let part =
        SubCameraView { full_size: UVec2::new(190, 150), offset: Vec2::new(50.0, 10.0), size: UVec2::new(128, 96) };
    lens.sub_camera_view = Some(part);
    check(&mut stage, "asymmetric", 1500);
}

#[test]
fn every_placement_gives_the_picture_of_the_cpu() {
    let transfer = || TransferFunction { reference_length_m: 0.7e-3, ..veil() };
    let mut stage = Stage::new(hounsfield(), transfer());
    let volume = stage.volume;
    check(&mut stage, "anisotropic", 1500);
    let turned = Quat::from_euler(EulerRot::XYZ, 0.5, 2.1, -0.8);
    stage.set(volume, Transform { rotation: turned, translation: Vec3::new(0.003, -0.002, 0.01), ..default() });
    check(&mut stage, "turned", 1500);
    stage.set(volume, Transform { rotation: turned, scale: Vec3::new(-0.9, 0.8, 1.2), ..default() });
    check(&mut stage, "mirrored and stretched", 1500);
    // A child that is turned within a stretched parent is sheared.
    let parent = stage.app.world_mut().spawn((Transform::from_scale(Vec3::new(1.3, 0.7, 1.0)), Visibility::default()));
    let parent = parent.id();
    stage.set(volume, Transform::from_rotation(turned));
    stage.set(volume, ChildOf(parent));
    check(&mut stage, "sheared", 1500);
    // A hundred times the size, a hundred times as far.
    stage.app.world_mut().entity_mut(volume).remove::<ChildOf>();
    stage.set(volume, Transform::from_scale(Vec3::splat(100.0)));
    stage.aim(EYE * 100.0, Vec3::ZERO);
    check(&mut stage, "large", 1500);
}

#[test]
fn own_colours_are_shown() {
    let transfer = TransferFunction { colour_source: ColourSource::Voxels, ..veil() };
    let mut stage = Stage::new(coloured(), transfer);
    check(&mut stage, "coloured", 1500);
    // The same voxels in the table's colours, and back.
    let own = stage.shot();
    let volume = stage.volume;
    stage.set(volume, veil());
    check(&mut stage, "in the table's colours", 1500);
    stage.set(volume, TransferFunction { colour_source: ColourSource::Voxels, ..veil() });
    assert!(stage.shot() == own, "the volume's own colours come back");
}

#[test]
fn what_was_drilled_is_missing() {
    let mut stage = Stage::new(eight_bits(), veil());
    let whole = stage.shot();
    stage.drill(Vec3::new(-0.012, -0.002, 0.012), Vec3::new(-0.004, -0.006, 0.004), 6e-3);
    check(&mut stage, "drilled", 1500);
    stage.look().method = VolumeMethod::Rays;
    let differing = stage.shot().colour.iter().zip(&whole.colour).filter(|(a, b)| a != b).count();
    assert!(differing > 200, "only {differing} pixels show the hole");
}

#[test]
fn clip_planes_cut() {
    let mut stage = Stage::new(eight_bits(), veil());
    let whole = stage.shot();
    let planes = vec![
        Vec4::new(1.0, 0.3, -0.4, 0.004),
        // Lengths of normals do not matter, and planes without a direction count for nothing.
        Vec4::new(0.0, 0.0, -30.0, 0.06),
        Vec4::new(0.0, 0.0, 0.0, -1.0),
    ];
    stage.look().clip_planes = planes[..2].to_vec();
    check(&mut stage, "clipped", 1000);
    stage.look().method = VolumeMethod::Rays;
    let clipped = stage.shot();
    stage.look().clip_planes = planes;
    assert!(stage.shot() == clipped, "a plane without a direction cuts nothing");
    stage.look().clip_planes.clear();
    assert!(stage.shot() == whole, "without planes the volume is whole again");
    // Everything outside of one of them.
    stage.look().clip_planes = vec![Vec4::new(0.0, 1.0, 0.0, -1.0)];
    for method in [VolumeMethod::Rays, VolumeMethod::Slices] {
        stage.look().method = method;
        assert!(stage.shot().colour.iter().all(|texel| *texel == [0.0; 4]), "{method:?}");
    }
}

#[test]
fn the_camera_may_be_inside() {
    let fog = points(&[(0.0, [200, 210, 220], 0.005), (0.3, [40, 60, 220], 0.02), (0.75, [250, 220, 190], 0.8)]);
    let mut stage = Stage::new(eight_bits(), fog);
    let camera = stage.camera;
    let wide = PerspectiveProjection { fov: 1.2, near: 0.001, ..default() };
    stage.set(camera, Projection::Perspective(wide));
    stage.aim(Vec3::new(0.008, 0.0, 0.008), Vec3::new(-0.01, 0.0, 0.0));
    compare(&mut stage, &ALL_AROUND, "inside", 128 * 96 - 100, true);
    // Inside of what is solid: it fills the picture, wherever it is.
    stage.aim(Vec3::new(-0.0065, -0.0035, -0.0005), Vec3::new(-0.01, 0.01, 0.0));
    compare(&mut stage, &ALL_AROUND, "inside of the ball", 128 * 96 - 1, false);
}

#[test]
fn sizes_that_are_no_multiple_of_a_block_are_drawn_to_their_end() {
    // Solid to its faces, so that what is missing at an end shows.
    for size in [UVec3::new(1, 7, 13), UVec3::new(5, 4, 9), UVec3::new(3, 3, 3)] {
        // Its values rise in one direction, so that it has a normal everywhere.
        let volume =
            volume_of(size, DVec3::splat(2.0), |voxel| 0.7 + (voxel / size.as_vec3()).dot(Vec3::new(0.03, 0.1, 0.2)));
        let mut stage = Stage::new(volume, veil());
        check(&mut stage, &format!("{size} voxels"), 100);
    }
}
