//! Rays of the world against organs in the ECS: transforms, several organs, organs that move.

use crate::support::sphere_organ;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

const RADIUS_M: f32 = 0.1;

fn app_with(transforms: &[Transform]) -> (TestApp, Vec<Entity>) {
    let mut app = TestApp::cpu();
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    let organs = transforms.iter().map(|&at| app.world_mut().spawn((Organ(organ.clone()), at)).id()).collect();
    // Loaded, with shapes, pickers and global transforms.
    app.step(2);
    (app, organs)
}

fn cast(app: &mut TestApp, origin: Vec3, towards: Vec3, most_m: f32) -> Option<OrganHit> {
    let ray = Ray3d::new(origin, Dir3::new(towards - origin).expect("a direction"));
    app.world_mut().run_system_once(move |picking: OrganPicking| picking.cast_ray(ray, most_m)).expect("it runs")
}

#[test]
fn the_nearest_organ_is_hit_where_it_is_in_the_world() {
    let turned = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(0.3);
    let near = Transform::from_xyz(0.0, 0.0, 1.0).with_rotation(turned).with_scale(Vec3::splat(2.0));
    let far = Transform::from_xyz(0.0, 0.0, -1.0).with_scale(Vec3::new(-1.0, 1.0, 1.0));
    let (mut app, organs) = app_with(&[near, far]);
    let eye = Vec3::new(0.0, 0.0, 3.0);
    let hit = cast(&mut app, eye, Vec3::ZERO, 10.0).expect("the near one is in the way");
    assert_eq!(hit.organ, organs[0]);
    assert!((hit.distance_m - 1.8).abs() < 2e-3, "{}", hit.distance_m);
    assert!(hit.position_world_m.distance(Vec3::new(0.0, 0.0, 1.2)) < 2e-3 && hit.is_outside);
    assert!(hit.normal_world.dot(Vec3::Z) > 0.999, "{}", hit.normal_world);
    // From between them, backwards; the mirrored one is seen from outside as well.
    let hit = cast(&mut app, Vec3::ZERO, Vec3::new(0.0, 0.0, -1.0), 10.0).expect("the far one");
    assert_eq!(hit.organ, organs[1]);
    assert!((hit.distance_m - 0.9).abs() < 2e-3 && hit.is_outside && hit.normal_world.z > 0.999);
    // From inside.
    let hit = cast(&mut app, Vec3::new(0.0, 0.0, 1.0), eye, 10.0).expect("the wall");
    assert!(!hit.is_outside && (hit.distance_m - 0.2).abs() < 2e-3);
    assert_eq!(cast(&mut app, eye, Vec3::ZERO, 1.7), None, "too far");
    assert_eq!(cast(&mut app, eye, Vec3::new(1.0, 0.0, 3.0), 10.0), None, "past both");
    let nowhere = Ray3d::new(Vec3::NAN, Dir3::NEG_Z);
    let hit = app.world_mut().run_system_once(move |picking: OrganPicking| picking.cast_ray(nowhere, 10.0));
    assert_eq!(hit.expect("it runs"), None);
}

#[test]
fn a_moved_organ_is_hit_where_it_is_now() {
    let (mut app, organs) = app_with(&[Transform::IDENTITY]);
    let mut shape = app.world_mut().get_mut::<OrganShape>(organs[0]).expect("a shape");
    shape.move_vertices().iter_mut().for_each(|place| place.z *= 0.5);
    app.step(1);
    let hit = cast(&mut app, Vec3::Z, Vec3::ZERO, 10.0).expect("it is there");
    assert!((hit.distance_m - 0.95).abs() < 2e-3, "{}", hit.distance_m);
    // Another model: other faces.
    let other = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.02));
    app.world_mut().entity_mut(organs[0]).insert(Organ(other));
    app.step(2);
    let hit = cast(&mut app, Vec3::Z, Vec3::ZERO, 10.0).expect("it is there");
    assert!((hit.distance_m - 0.98).abs() < 2e-3, "{}", hit.distance_m);
}
