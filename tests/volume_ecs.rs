//! Volumes in apps without a renderer: picking, drilling, counting and warning in exact steps.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::critical::CriticalDistances;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrPose, BurrShape};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::{CtVolume, CutVolume, DrillVolume, RemovedTissue, VoxelsRemoved, WatchCritical};
use glam::DVec3;

/// Half of the side of a cube of bone in a grid of 40^3 voxels of 0.5 mm, voxels.
const HALF: u32 = 15;
/// Where its sides lie in the volume's space, metres.
const SIDE_M: f32 = 7.5e-3;

fn structure(name: &str, is_critical: bool) -> Structure {
    Structure {
        name: name.into(),
        colour: [230, 220, 200],
        tissue: Tissue::CorticalBone,
        hardness: 1.0,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical,
    }
}

/// A cube of bone (label 1) with a nerve (label 2) along its x axis, 2 by 2 voxels wide, or all bone.
fn bone(has_nerve: bool) -> Volume {
    let grid = VolumeGrid::upright(UVec3::splat(40), DVec3::splat(0.5));
    let (mut labels, mut solid) = (vec![0; grid.count()], vec![0; grid.count()]);
    for place in 0..grid.count() as u32 {
        let voxel = UVec3::new(place % 40, place / 40 % 40, place / 1600);
        let is_within = |side: u32, half: u32| (20 - half..20 + half).contains(&side);
        if is_within(voxel.x, HALF) && is_within(voxel.y, HALF) && is_within(voxel.z, HALF) {
            let is_nerve = has_nerve && is_within(voxel.y, 1) && is_within(voxel.z, 1);
            (labels[place as usize], solid[place as usize]) = (if is_nerve { 2 } else { 1 }, 255);
        }
    }
    let list = vec![structure("bone", false), structure("nerve", true)];
    let structures = Structures::new(list, labels, solid.clone()).expect("two structures");
    let volume = Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume");
    volume.with_structures(structures).expect("of the same size")
}

fn app_with(volumes: Vec<(Volume, Transform)>) -> (TestApp, Vec<Entity>) {
    let mut app = TestApp::cpu();
    let world = app.world_mut();
    let spawn = |(volume, at)| {
        let handle = world.resource_mut::<Assets<Volume>>().add(volume);
        world.spawn((CtVolume(handle), at)).id()
    };
    let entities = volumes.into_iter().map(spawn).collect();
    app.step(2);
    (app, entities)
}

fn cast(app: &mut TestApp, origin: Vec3, towards: Vec3) -> Option<VolumeHitInWorld> {
    let ray = Ray3d::new(origin, Dir3::new(towards - origin).expect("a direction"));
    app.world_mut().run_system_once(move |picking: VolumePicking| picking.cast_ray(ray, 1.0)).expect("it runs")
}

/// A burr of 4 mm that goes from one place of the world to another during the next step.
fn stroke(volume: Entity, from_m: Vec3, to_m: Vec3) -> DrillVolume {
    let pose = |centre_m| BurrPose { centre_m, axis: Vec3::Z };
    DrillVolume {
        volume,
        tool: None,
        burr: Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 4e-3 },
        from_world: pose(from_m),
        to_world: pose(to_m),
        force_n: 1e6,
        speed_rpm: 40_000.0,
        begins_stroke: true,
    }
}

fn removed_mm3(app: &TestApp, volume: Entity, label: u8) -> f64 {
    app.world().get::<RemovedTissue>(volume).expect("it comes with the cut").of_label_mm3(label)
}

fn messages(app: &mut TestApp) -> Vec<VoxelsRemoved> {
    app.world_mut().resource_mut::<Messages<VoxelsRemoved>>().drain().collect()
}

#[test]
fn rays_find_what_is_left_and_not_clipped_away() {
    let turned = Quat::from_rotation_y(0.3);
    let near = Transform::from_xyz(0.0, 0.0, 0.1).with_rotation(turned).with_scale(Vec3::splat(2.0));
    let (mut app, volumes) = app_with(vec![(bone(false), near), (bone(false), Transform::IDENTITY)]);
    let eye = near.translation + turned * Vec3::Z * 0.5;
    let hit = cast(&mut app, eye, near.translation).expect("the near one is in the way");
    assert_eq!(hit.volume, volumes[0]);
    assert!((hit.distance_m - (0.5 - 2.0 * SIDE_M)).abs() < 1e-5, "{}", hit.distance_m);
    assert!(hit.normal_world.distance(turned * Vec3::Z) < 1e-4 && hit.hit.label == 1);
    let eye = Vec3::new(0.0, 0.0, -0.3);
    assert_eq!(cast(&mut app, eye, Vec3::ZERO).expect("the far one").volume, volumes[1]);
    // Half of it is clipped away: what is beyond begins at the plane.
    let look = |planes: Vec<Vec4>| VolumeLook { clip_planes: planes, ..default() };
    app.world_mut().entity_mut(volumes[1]).insert(look(vec![Vec4::new(0.0, 0.0, 2.0, -0.004)]));
    let hit = cast(&mut app, eye, Vec3::ZERO).expect("the rest of it");
    assert!((hit.distance_m - 0.302).abs() < 1e-5, "{}", hit.distance_m);
    assert!(hit.position_world_m.distance(Vec3::new(0.0, 0.0, 0.002)) < 1e-5);
    assert!(hit.normal_world.distance(Vec3::NEG_Z) < 1e-5);
    assert!(hit.hit.position_m.distance(Vec3::new(0.0, 0.0, 0.002)) < 1e-5);
    // From the other side it is met where it was.
    app.world_mut()
        .entity_mut(volumes[0])
        .insert(look(vec![Vec4::new(0.0, 0.0, 1.0, -1.0), Vec4::new(0.0, 0.0, 0.0, -1.0)]));
    let hit = cast(&mut app, Vec3::new(0.0, 0.0, 0.3), Vec3::ZERO).expect("the rest of it");
    assert_eq!(hit.volume, volumes[1], "of the near one nothing is left");
    assert!((hit.distance_m - (0.3 - SIDE_M)).abs() < 1e-5, "{}", hit.distance_m);
}

#[test]
fn what_burrs_remove_is_told_counted_and_taken_back() {
    let at = Transform::from_xyz(0.1, 0.0, 0.0);
    let (mut app, volumes) = app_with(vec![(bone(true), at)]);
    let surface_m = at.translation + Vec3::Z * SIDE_M;
    let mut told_mm3 = 0.0;
    for step in 0..8 {
        let from = surface_m + Vec3::X * (step as f32 * 5e-4 - 2e-3);
        app.world_mut().write_message(stroke(volumes[0], from, from + Vec3::X * 5e-4));
        app.step(1);
        let told = messages(&mut app);
        let [one] = &told[..] else { panic!("{} messages for one burr in step {step}", told.len()) };
        assert_eq!((one.volume, one.tool), (volumes[0], None));
        assert_eq!(one.by_label_mm3.iter().map(|(label, _)| *label).collect::<Vec<_>>(), [1]);
        assert!((one.by_label_mm3[0].1 - one.total_mm3).abs() < 1e-9);
        assert!(one.centroid_world_m.distance(from) < 4e-3, "{}", one.centroid_world_m);
        told_mm3 += one.total_mm3;
    }
    // Half a ball and half a cylinder of 4 mm.
    let expected_mm3 = 2.0 / 3.0 * 8.0 * std::f64::consts::PI + 0.5 * 4.0 * std::f64::consts::PI * 4.0;
    assert!((told_mm3 / expected_mm3 - 1.0).abs() < 0.03, "{told_mm3} mm3, not {expected_mm3}");
    assert!((removed_mm3(&app, volumes[0], 1) - told_mm3).abs() < 1e-6);
    let hit = cast(&mut app, surface_m + Vec3::Z * 0.1, surface_m).expect("the bottom of the groove");
    assert!((hit.distance_m - 0.102).abs() < 2e-4, "{}", hit.distance_m);
    // A step without a burr tells nothing; neither does one in the air, or on what is no volume.
    app.step(1);
    app.world_mut().write_message(stroke(volumes[0], Vec3::ZERO, Vec3::ZERO));
    app.world_mut().write_message(stroke(Entity::PLACEHOLDER, surface_m, surface_m));
    app.step(1);
    assert_eq!(messages(&mut app), []);
    // Strokes are taken back one by one, and what was removed is counted anew.
    app.world_mut().get_mut::<CutVolume>(volumes[0]).expect("it is there").undo();
    app.step(1);
    let less_mm3 = removed_mm3(&app, volumes[0], 1);
    assert!(less_mm3 < told_mm3 - 1.0 && less_mm3 > 0.5 * told_mm3, "{less_mm3} of {told_mm3}");
    app.world_mut().get_mut::<CutVolume>(volumes[0]).expect("it is there").reset();
    app.step(1);
    assert_eq!(removed_mm3(&app, volumes[0], 1), 0.0);
}

#[test]
fn critical_structures_are_watched_while_they_are_drilled() {
    let (mut app, volumes) = app_with(vec![(bone(true), Transform::IDENTITY)]);
    app.world_mut().entity_mut(volumes[0]).insert(WatchCritical { band_mm: 9.0 });
    app.idle_until("the distances are measured", |app| app.world().get::<CriticalDistances>(volumes[0]).is_some());
    // From the middle of the upper side in voxels: 15 voxels and a half to the nerve's nearest.
    let nearest = |app: &TestApp| {
        let distances = app.world().get::<CriticalDistances>(volumes[0]).expect("it was measured");
        distances.nearest(Vec3::new(20.0, 20.0, 35.0))
    };
    assert_eq!(nearest(&app).map(|(label, mm)| (label, (mm * 100.0).round())), Some((2, 750.0)));
    // Through all of it, along the nerve's own axis.
    app.world_mut().write_message(stroke(volumes[0], Vec3::X * 0.02, Vec3::X * -0.02));
    app.step(1);
    assert!(removed_mm3(&app, volumes[0], 2) > 14.0, "{} mm3", removed_mm3(&app, volumes[0], 2));
    assert_eq!(nearest(&app), None, "what is gone is near nothing");
    app.world_mut().get_mut::<CutVolume>(volumes[0]).expect("it is there").undo();
    app.step(1);
    assert!(nearest(&app).is_some(), "it is back");
    app.world_mut().entity_mut(volumes[0]).remove::<WatchCritical>();
    app.idle();
    assert!(app.world().get::<CriticalDistances>(volumes[0]).is_none());
}
