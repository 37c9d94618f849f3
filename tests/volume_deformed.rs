//! Volumes that a lattice deforms, without a renderer: what is picked and drilled is what is shown.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrPose, BurrShape};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::{DeformedVolume, RemovedTissue, VoxelLattice};
use glam::DVec3;
use proptest::prelude::*;
use std::f64::consts::TAU;

const SIZE: u32 = 48;
const RADIUS_VOXELS: f32 = 14.0;

/// A ball of bone in the middle of 48^3 voxels of 0.5 mm.
fn ball() -> Volume {
    let grid = VolumeGrid::upright(UVec3::splat(SIZE), DVec3::splat(0.5));
    let middle = Vec3::splat((SIZE - 1) as f32 * 0.5);
    let solid: Vec<u8> = (0..grid.count() as u32)
        .map(|place| {
            let voxel = UVec3::new(place % SIZE, place / SIZE % SIZE, place / (SIZE * SIZE)).as_vec3();
            (((RADIUS_VOXELS - voxel.distance(middle)) / 4.0 + 0.5).clamp(0.0, 1.0) * 255.0).round() as u8
        })
        .collect();
    let bone = Structure::new("bone", [230, 220, 200], Tissue::CorticalBone);
    let labels = solid.iter().map(|&solid| u8::from(solid > 0)).collect();
    let structures = Structures::new(vec![bone], labels, solid.clone()).expect("one structure");
    let volume = Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume");
    volume.with_structures(structures).expect("of the same size")
}

fn wave(volume: &Volume, share: f64) -> DeformLattice {
    let mut lattice = volume.grid().lattice(3).expect("a level that can be");
    let swing = |at: DVec3| share * DVec3::new((at.y * TAU).sin(), (at.z * TAU + 1.0).sin(), (at.x * TAU).cos());
    lattice.set_from(swing).expect("finite numbers");
    lattice
}

fn app_with(volume: Volume, lattice: DeformLattice, at: Transform) -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(volume);
    let entity = app.world_mut().spawn((CtVolume(handle), lattice, at)).id();
    app.step(2);
    (app, entity)
}

fn cast(app: &mut TestApp, origin: Vec3, towards: Vec3) -> Option<VolumeHitInWorld> {
    let ray = Ray3d::new(origin, Dir3::new(towards - origin).expect("a direction"));
    app.world_mut().run_system_once(move |picking: VolumePicking| picking.cast_ray(ray, 1.0)).expect("it runs")
}

#[test]
fn rays_meet_the_matter_that_is_shown() {
    let volume = ball();
    let grid = *volume.grid();
    let lattice = wave(&volume, 0.06);
    let field = VoxelLattice::new(&lattice, &grid);
    let world_from_volume = Transform::from_xyz(0.1, -0.2, 0.05).with_rotation(Quat::from_rotation_y(0.7));
    let (mut app, entity) = app_with(volume, lattice, world_from_volume);
    let middle = Vec3::splat((SIZE - 1) as f32 * 0.5);
    let voxel_from_world = (world_from_volume.compute_affine() * grid.volume_from_voxel()).inverse();
    let (mut hits, mut moved, mut worst, mut tilted) = (0, 0, 0.0_f32, 0.0_f32);
    for n in 0..200 {
        let turn = n as f32 * 2.4;
        let direction = Vec3::new(turn.cos(), n as f32 / 100.0 - 1.0, turn.sin()).normalize();
        let origin = world_from_volume.translation + direction * 0.05;
        let Some(hit) = cast(&mut app, origin, world_from_volume.translation) else { continue };
        assert_eq!(hit.volume, entity);
        hits += 1;
        let shown = voxel_from_world.transform_point3(hit.position_world_m);
        let rest = field.rest_from_shown(shown);
        assert!(rest.distance(hit.hit.at_voxel) < 1e-3, "the voxel is that of the matter at rest");
        worst = worst.max((rest.distance(middle) - RADIUS_VOXELS).abs());
        moved += usize::from((shown.distance(middle) - RADIUS_VOXELS).abs() > 1.0);
        // The normal of the shown surface: the slope of the ball's distance through the field.
        let slope = field.slope_at(shown).transpose() * (rest - middle);
        let normal = (voxel_from_world.matrix3.transpose() * slope).normalize();
        tilted = tilted.max(normal.angle_between(hit.normal_world));
    }
    println!(
        "{hits} hits, {moved} of them moved by more than a voxel; at most {worst} voxels off, {tilted} rad tilted"
    );
    assert!(hits > 190 && moved > 50);
    assert!(worst < 0.2, "{worst} voxels from the ball's surface");
    assert!(tilted < 0.12, "normals are {tilted} rad off");
}

#[test]
fn a_burr_removes_the_matter_that_is_shown_where_it_is() {
    let volume = ball();
    let grid = *volume.grid();
    let lattice = wave(&volume, 0.06);
    let field = VoxelLattice::new(&lattice, &grid);
    let (mut app, entity) = app_with(volume, lattice, Transform::default());
    let from = Vec3::new(0.012, 0.003, 0.002);
    let hit = cast(&mut app, from, Vec3::ZERO).expect("the ball is hit");
    let centre_m = hit.position_world_m - from.normalize() * 1e-3;
    let pose = BurrPose { centre_m, axis: Vec3::Z };
    let radius_m = 2e-3;
    let mut removed: Vec<VoxelsRemoved> = Vec::new();
    for n in 0..40 {
        app.world_mut().write_message(DrillVolume {
            volume: entity,
            tool: None,
            burr: Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 2.0 * radius_m },
            from_world: pose,
            to_world: pose,
            force_n: 1e6,
            speed_rpm: 40_000.0,
            begins_stroke: n == 0,
        });
        app.step(1);
        removed.extend(app.world_mut().resource_mut::<Messages<VoxelsRemoved>>().drain());
    }
    let centroid = removed.first().map_or(Vec3::NAN, |removed| removed.centroid_world_m);
    assert!(centroid.distance(centre_m) < 1.5e-3, "{centroid} is not near {centre_m}");
    let cut = app.world().get::<CutVolume>(entity).expect("a cut");
    let volume_from_voxel = grid.volume_from_voxel();
    let (mut gone, mut missed, mut stray) = (0, 0, 0);
    for place in 0..grid.count() as u32 {
        let voxel = UVec3::new(place % SIZE, place / SIZE % SIZE, place / (SIZE * SIZE));
        let shown = field.shown_from_rest(voxel.as_vec3());
        assert!(field.rest_from_shown(shown).distance(voxel.as_vec3()) < 2e-3, "there and back at {voxel}");
        let away_m = volume_from_voxel.transform_point3(shown).distance(centre_m);
        let remaining = cut.remaining(voxel);
        gone += usize::from(remaining < 0.5);
        // A ball that is shown round is not quite round at rest.
        missed += usize::from(away_m < radius_m * 0.75 && remaining > 0.5);
        stray += usize::from(away_m > radius_m * 1.3 && remaining < 0.5);
    }
    assert!(gone > 100, "{gone} voxels went");
    assert_eq!((missed, stray), (0, 0), "voxels that stayed in the burr, and that went elsewhere");
    let tissue = app.world().get::<RemovedTissue>(entity).expect("it comes with the cut");
    assert!(tissue.total_mm3() > 5.0);
    // What was picked is gone: the ray goes on to the bottom of the hole.
    let again = cast(&mut app, from, Vec3::ZERO).expect("the hole has a bottom");
    assert!(again.distance_m > hit.distance_m + 2e-3);
}

#[test]
fn lattices_come_move_and_go() {
    let volume = ball();
    let grid = *volume.grid();
    let (mut app, entity) = app_with(volume, grid.lattice(1).expect("a level"), Transform::default());
    let at_rest = cast(&mut app, Vec3::X, Vec3::ZERO).expect("the ball is hit").distance_m;
    let revision = app.world().get::<DeformedVolume>(entity).expect("it follows").revision();
    // Matter moves against the translations.
    let mut lattice = app.world_mut().get_mut::<DeformLattice>(entity).expect("it was spawned with it");
    lattice.set_from(|_| DVec3::new(-0.125, 0.0, 0.0)).expect("finite numbers");
    app.step(1);
    let moved = cast(&mut app, Vec3::X, Vec3::ZERO).expect("the ball is hit").distance_m;
    assert!((at_rest - moved - 0.125 * 0.024).abs() < 1e-5, "{at_rest} to {moved}");
    assert!(app.world().get::<DeformedVolume>(entity).expect("it follows").revision() > revision);
    app.world_mut().entity_mut(entity).remove::<DeformLattice>();
    app.step(1);
    assert!(app.world().get::<DeformedVolume>(entity).is_none());
    assert_eq!(cast(&mut app, Vec3::X, Vec3::ZERO).expect("the ball is hit").distance_m, at_rest);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Looking block by block finds what looking everywhere finds.
    #[test]
    fn skipping_misses_nothing(seed in 0_u64..1000, share in 0.0_f64..0.1) {
        let volume = ball();
        let mut lattice = wave(&volume, share);
        let turned = lattice.translations().iter().map(|by| Quat::from_rotation_z(seed as f32) * *by).collect::<Vec<_>>();
        lattice.set_translations(&turned).expect("as many as there are");
        let field = VoxelLattice::new(&lattice, volume.grid());
        let structures = volume.structures().expect("they were given").clone();
        let picker = bevy_surgery::volume::pick::VolumePicker::new(*volume.grid(), structures).expect("of the same size");
        let origin = Vec3::new((seed as f32).cos(), (seed as f32 * 0.7).sin(), (seed as f32).sin()) * 0.04;
        let target = Vec3::new(0.0, (seed as f32 * 1.3).sin(), (seed as f32 * 0.3).cos()) * 0.007;
        let direction = (target - origin).normalize();
        let found = picker.pick_deformed(origin, direction, 0.1, &field, |_| 1.0);
        let voxel_from_volume = volume.grid().volume_from_voxel().inverse();
        let filling = |distance: f32| {
            let shown = voxel_from_volume.transform_point3(origin + direction * distance);
            picker.filling_at(field.rest_from_shown(shown), |_| 1.0)
        };
        let first = (0..4000).map(|n| n as f32 * 2e-5).find(|&distance| filling(distance) >= 0.5);
        match (found, first) {
            (Some(found), Some(first)) => prop_assert!((found.distance_m - first).abs() < 4e-5, "{} {first}", found.distance_m),
            (found, first) => prop_assert!(found.is_none() && first.is_none(), "{found:?} {first:?}"),
        }
    }
}
