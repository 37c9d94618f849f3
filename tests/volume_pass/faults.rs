//! Input that makes no picture, and things that go while they are drawn.

use super::stage::{Difference, EYE, SIZE_PX, Shot, Stage, add_volume};
use super::{SIZE, ball, points, solid, specimen, veil, volume_of};
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy_surgery::volume::transfer::{ControlPoint, TransferFunction, ValueScale};
use bevy_surgery::volume::{
    CtVolume, SmoothedNormals, Volume, VolumeGrid, VolumeLook, VolumeMethod, Voxels, WetShading,
};

const METHODS: [VolumeMethod; 3] = [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices];

fn is_empty(shot: &Shot) -> bool {
    shot.colour.iter().all(|texel| *texel == [0.0; 4]) && shot.depth_m.iter().all(|depth| depth.is_infinite())
}

fn is_finite(shot: &Shot) -> bool {
    shot.colour.iter().flatten().all(|number| number.is_finite())
}

fn specimen_stage() -> Stage {
    Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil())
}

#[test]
fn transforms_that_make_no_picture_show_nothing() {
    let mut stage = specimen_stage();
    let volume = stage.volume;
    for method in METHODS {
        stage.look().method = method;
        let shot = stage.shot();
        assert!(!is_empty(&shot));
        for broken in [
            Transform::from_scale(Vec3::ZERO),
            Transform::from_scale(Vec3::new(1.0, 0.0, 1.0)),
            Transform::from_scale(Vec3::NAN),
            Transform::from_xyz(f32::NAN, 0.0, 0.0),
            Transform::from_xyz(0.0, f32::INFINITY, 0.0),
            Transform::from_rotation(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0)),
        ] {
            stage.set(volume, broken);
            assert!(is_empty(&stage.shot()), "{broken:?}");
            stage.set(volume, Transform::IDENTITY);
            assert!(stage.shot() == shot, "after {broken:?} the picture comes back");
        }
        // So small or so large that numbers run out.
        for scale in [1e-7, 1e-10, 1e-12, 1e-13, 1e9, 1e25] {
            stage.set(volume, Transform::from_scale(Vec3::splat(scale)));
            let shown = stage.shot();
            assert!(is_finite(&shown), "{method:?}, scale {scale}");
            assert!(scale > 1.0 || shown.colour.iter().filter(|texel| texel[3] > 0.0).count() < 5, "scale {scale}");
        }
        stage.set(volume, Transform::IDENTITY);
        assert!(stage.shot() == shot);
    }
}

#[test]
fn far_volumes_end() {
    // At such distances sample planes are closer than numbers are.
    let mut stage = Stage::new(ball(20.0), solid([255, 255, 255]));
    let (camera, volume) = (stage.camera, stage.volume);
    for (method, is_solid) in METHODS.into_iter().flat_map(|method| [(method, true), (method, false)]) {
        stage.look().method = method;
        stage.set(
            volume,
            if is_solid { solid([255, 255, 255]) } else { points(&[(0.9, [255; 3], 0.0), (1.0, [255; 3], 1e-4)]) },
        );
        for (metres, fov) in [(300.0_f32, 0.0002_f32), (30_000.0, 2e-6), (3e6, 1e-7)] {
            let lens = PerspectiveProjection { fov, near: 0.005, far: 1e9, ..default() };
            stage.set(camera, Projection::Perspective(lens));
            stage.aim(Vec3::Z * metres, Vec3::ZERO);
            let shot = stage.shot();
            assert!(is_finite(&shot), "{method:?}, {metres} m");
            if metres < 1000.0 && is_solid {
                let covered = shot.colour.iter().filter(|texel| texel[3] > 0.5).count();
                // A ball of 4 cm fills two thirds of the picture's height.
                assert!((2000..6000).contains(&covered), "{method:?}: {covered} pixels at {metres} m");
            }
        }
    }
}

#[test]
fn settings_out_of_range_are_put_right() {
    let mut stage = specimen_stage();
    let first = stage.shot();
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0, 0.0, 1e30, -1e30];
    for method in METHODS {
        for number in odd {
            *stage.look() = VolumeLook {
                method,
                step_voxels: number,
                clip_planes: [Vec4::splat(f32::NAN), Vec4::new(0.0, 0.0, 0.0, number)].repeat(10),
                wet: WetShading {
                    passes: u32::MAX,
                    edge_voxels: number,
                    shine: number,
                    shine_exponent: number,
                    smoothed: SmoothedNormals::All,
                    ..default()
                },
                ..default()
            };
            let shot = stage.shot();
            assert!(is_finite(&shot) && !is_empty(&shot), "{method:?}, {number}");
        }
        // Only so many planes count.
        let keeps_all = Vec4::new(1.0, 0.0, 0.0, 1.0);
        let cuts_all = Vec4::new(1.0, 0.0, 0.0, -1.0);
        let mut planes = vec![keeps_all; 6];
        planes.push(cuts_all);
        *stage.look() = VolumeLook { method, clip_planes: planes, ..default() };
        assert!(!is_empty(&stage.shot()));
    }
    *stage.look() = VolumeLook::default();
    assert!(stage.shot() == first);
}

#[test]
fn nothing_to_see_is_seen() {
    let mut stage = specimen_stage();
    let volume = stage.volume;
    let shot = stage.shot();
    let odd = |value: f64, opacity: f32| ControlPoint { value, colour: [255; 3], opacity };
    for method in METHODS {
        stage.look().method = method;
        for transfer in [
            points(&[]),
            points(&[(0.0, [255; 3], 0.0)]),
            TransferFunction { points: vec![odd(f64::NAN, 1.0), odd(0.5, f32::NAN)], ..veil() },
        ] {
            stage.set(volume, transfer);
            assert!(is_empty(&stage.shot()), "{method:?}");
        }
        stage.set(volume, veil());
    }
    stage.look().method = VolumeMethod::Rays;
    assert!(stage.shot() == shot);
}

#[test]
fn one_voxel_is_a_block() {
    let grid = VolumeGrid::upright(UVec3::ONE, DVec3::splat(20.0));
    let volume = Volume::new(grid, Voxels::U8(vec![200]), 1.0, 0.0).expect("a voxel");
    let transfer = TransferFunction { scale: ValueScale::Values, ..solid([255; 3]) };
    let transfer =
        TransferFunction { points: vec![ControlPoint { value: 200.0, colour: [255; 3], opacity: 1.0 }], ..transfer };
    let mut stage = Stage::new(volume, transfer);
    stage.look().step_voxels = 0.25;
    for method in METHODS {
        stage.look().method = method;
        let shot = stage.shot();
        let difference = Difference::between(&shot, &stage.twin(), stage.rays(Vec3::ZERO).voxel_edge_m());
        println!("{difference:?}");
        // 2 cm of 9.9 cm away are as many pixels.
        assert!(difference.covered > 1500 && difference.mean < 0.01, "{method:?}: {difference:?}");
        assert!(shot.colour.iter().filter(|texel| texel[3] > 0.99).count() > 1500);
    }
}

#[test]
fn long_and_thin_is_drawn_to_its_ends() {
    let size = UVec3::new(2048, 2, 3);
    let volume = volume_of(size, DVec3::new(0.02, 2.0, 2.0), |voxel| if voxel.x < 1024.0 { 0.6 } else { 1.0 });
    let transfer = points(&[(0.0, [255, 0, 0], 0.99), (0.5, [255, 0, 0], 0.99), (0.5, [0, 0, 255], 0.99)]);
    let mut stage = Stage::new(volume, transfer);
    // It hardly has slopes, so its normals are mere rounding; what shines would show that.
    stage.look().wet.shine = 0.0;
    for method in METHODS {
        stage.look().method = method;
        let shot = stage.shot();
        let difference = Difference::between(&shot, &stage.twin(), stage.rays(Vec3::ZERO).voxel_edge_m());
        println!("{difference:?}");
        assert!(difference.covered > 500 && difference.mean < 0.01 && difference.share_off < 0.03, "{difference:?}");
        for channel in [0, 2] {
            assert!(shot.colour.iter().filter(|texel| texel[channel] > 0.2).count() > 200, "{method:?}: {channel}");
        }
    }
}

#[test]
fn what_goes_leaves_nothing() {
    let mut stage = specimen_stage();
    let shot = stage.shot();
    let world = stage.app.world_mut();
    world.despawn(stage.volume);
    let gone = stage.next_shot();
    assert!(is_empty(&gone), "it is gone at once");
    assert!(is_empty(&stage.shot()));
    stage.volume = add_volume(&mut stage.app, volume_of(SIZE, DVec3::ONE, specimen), veil());
    assert!(stage.shot() == shot, "another like it looks the same");
    // Gone before it was ever drawn, and while it is drilled.
    let brief = add_volume(&mut stage.app, ball(10.0), veil());
    stage.app.world_mut().despawn(brief);
    assert!(stage.shot() == shot);
    stage.drill(Vec3::new(-0.010, -0.003, 0.008), Vec3::new(-0.008, -0.003, 0.004), 4e-3);
    let volume = stage.volume;
    stage.app.world_mut().despawn(volume);
    assert!(is_empty(&stage.next_shot()));
}

#[test]
fn an_asset_may_go_and_come_back() {
    let mut stage = specimen_stage();
    let shot = stage.shot();
    let handle = stage.app.world().get::<CtVolume>(stage.volume).expect("a volume").0.clone();
    let mut assets = stage.app.world_mut().resource_mut::<Assets<Volume>>();
    assets.remove(&handle);
    assert!(is_empty(&stage.shot()), "what is not there is not shown");
    // Others of the same size: through the middle of the old one's empty space runs a wall.
    let wall = || volume_of(SIZE, DVec3::ONE, |voxel| if voxel.y < 4.0 { 1.0 } else { 0.0 });
    let mut fresh = Stage::new(wall(), veil());
    let expected = fresh.shot();
    let put = |stage: &mut Stage, volume: Volume| {
        let mut assets = stage.app.world_mut().resource_mut::<Assets<Volume>>();
        assets.insert(handle.id(), volume).expect("its place is there");
    };
    put(&mut stage, wall());
    assert!(stage.shot() == expected, "the new voxels are shown");
    // Changed in place, and removed and put back within one frame.
    put(&mut stage, volume_of(SIZE, DVec3::ONE, specimen));
    assert!(stage.shot() == shot, "the old voxels are shown again");
    stage.app.world_mut().resource_mut::<Assets<Volume>>().remove(&handle);
    put(&mut stage, wall());
    assert!(stage.shot() == expected, "the new voxels are shown");
    // Of another size.
    let small = || volume_of(UVec3::new(20, 9, 31), DVec3::ONE, |voxel| 1.0 - voxel.x / 40.0);
    let mut fresh = Stage::new(small(), veil());
    let expected = fresh.shot();
    put(&mut stage, small());
    let next = stage.next_shot();
    assert!(is_finite(&next));
    assert!(stage.shot() == expected, "the new size is shown");
    stage.app.world_mut().resource_mut::<Assets<Volume>>().remove(&handle);
    stage.app.idle();
    put(&mut stage, volume_of(SIZE, DVec3::ONE, specimen));
    assert!(stage.shot() == shot, "the first one is shown again");
}

#[test]
fn another_volume_takes_the_place_of_one() {
    let mut stage = specimen_stage();
    let first = stage.shot();
    let give = |stage: &mut Stage, volume: Volume| {
        let handle = stage.app.world_mut().resource_mut::<Assets<Volume>>().add(volume);
        let entity = stage.volume;
        stage.set(entity, CtVolume(handle));
    };
    // Larger, smaller, and of the same size with other distances: culled by its own box and not by the old one's.
    for (size, spacing_mm) in [
        (UVec3::splat(48), DVec3::ONE),
        (UVec3::new(9, 7, 5), DVec3::splat(3.0)),
        (UVec3::new(9, 7, 5), DVec3::splat(0.4)),
        (UVec3::new(9, 7, 5), DVec3::new(12.0, 3.0, 3.0)),
    ] {
        let volume = || volume_of(size, spacing_mm, |voxel| if voxel.x > 0.5 { 1.0 } else { 0.0 });
        give(&mut stage, volume());
        let next = stage.next_shot();
        assert!(is_finite(&next));
        let mut fresh = Stage::new(volume(), veil());
        for at in [Vec3::ZERO, Vec3::new(-0.06, 0.0, 0.0)] {
            stage.aim(EYE, at);
            fresh.aim(EYE, at);
            assert!(stage.shot() == fresh.shot(), "{size} voxels of {spacing_mm} mm, looking at {at}");
        }
        stage.aim(EYE, Vec3::ZERO);
    }
    // While the old one's asset is gone.
    let handle = stage.app.world().get::<CtVolume>(stage.volume).expect("a volume").0.clone();
    stage.app.world_mut().resource_mut::<Assets<Volume>>().remove(&handle);
    stage.app.idle();
    give(&mut stage, volume_of(SIZE, DVec3::ONE, specimen));
    assert!(is_finite(&stage.next_shot()));
    assert!(stage.shot() == first);
    // The hole of one is not the hole of another of the same size.
    stage.drill(Vec3::new(-0.010, -0.003, 0.008), Vec3::new(-0.008, -0.003, 0.004), 4e-3);
    assert!(stage.shot() != first);
    give(&mut stage, volume_of(SIZE, DVec3::ONE, specimen));
    assert!(stage.shot() == first, "another volume is whole");
}

#[test]
fn cameras_that_make_no_picture_do_no_harm() {
    let mut stage = specimen_stage();
    let (camera, shot) = (stage.camera, stage.shot());
    let good = *stage.app.world().get::<Transform>(camera).expect("it is placed");
    for broken in
        [Transform::from_xyz(f32::NAN, 0.0, 0.0), Transform::from_scale(Vec3::ZERO), good.with_scale(Vec3::NAN)]
    {
        stage.set(camera, broken);
        stage.app.idle();
        stage.app.idle();
        stage.set(camera, good);
        assert!(stage.shot() == shot, "after {broken:?} the picture comes back");
    }
    let count = stage.shot().colour.len();
    assert_eq!(count as u32, SIZE_PX.x * SIZE_PX.y);
}
