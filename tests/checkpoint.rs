//! Copies of a world's state: what is put back, what is gone, what is there again.

use bevy::prelude::*;
use bevy_surgery::checkpoint::{Checkpoint, KeepState};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use std::time::Duration;

#[derive(Component, Clone, Debug, PartialEq)]
struct Stitch(Vec<u8>);

#[derive(Component, Clone)]
struct Grown;

#[derive(Resource, Clone, Debug, PartialEq)]
struct Count(u32);

#[test]
fn components_come_and_go_with_the_moment() {
    let mut app = TestApp::cpu();
    app.keep_large_component(|stitch: &Stitch| stitch.0.len()).keep_resource::<Count>();
    let world = app.world_mut();
    let changed = world.spawn((Stitch(vec![1]), Transform::from_xyz(1.0, 0.0, 0.0))).id();
    let taken = world.spawn(Stitch(vec![2])).id();
    let given = world.spawn_empty().id();
    let stranger = world.spawn(Transform::from_xyz(5.0, 0.0, 0.0)).id();
    let before = Checkpoint::take(world);
    assert!(before.bytes() >= 2);

    *world.get_mut::<Stitch>(changed).expect("it is there") = Stitch(vec![7; 9]);
    for entity in [changed, stranger] {
        world.get_mut::<Transform>(entity).expect("it is there").translation = Vec3::ZERO;
    }
    world.entity_mut(taken).remove::<Stitch>();
    world.entity_mut(given).insert(Stitch(vec![3]));
    world.insert_resource(Count(4));
    before.restore(world);
    assert_eq!(world.get::<Stitch>(changed), Some(&Stitch(vec![1])));
    assert_eq!(world.get::<Transform>(changed).map(|at| at.translation.x), Some(1.0));
    assert_eq!(world.get::<Stitch>(taken), Some(&Stitch(vec![2])));
    assert_eq!(world.get::<Stitch>(given), None);
    assert_eq!(world.get_resource::<Count>(), None);
    assert_eq!(world.get::<Transform>(stranger).map(|at| at.translation.x), Some(0.0), "nobody keeps that");
    // Once more, and with another count.
    world.insert_resource(Count(5));
    let other = Checkpoint::take(world);
    world.insert_resource(Count(6));
    other.restore(world);
    assert_eq!(world.get_resource::<Count>(), Some(&Count(5)));
}

#[test]
fn who_was_born_later_goes_and_who_has_died_is_there_again() {
    let mut app = TestApp::cpu();
    app.keep_births::<Grown>().keep_component::<Stitch>();
    let world = app.world_mut();
    let bone = world.spawn(Transform::default()).id();
    let at = |x: f32| (Grown, Stitch(vec![x as u8]), Transform::from_xyz(x, 0.0, 0.0), ChildOf(bone));
    let [first, second] = [1.0, 2.0].map(|x| world.spawn(at(x)).id());
    let before = Checkpoint::take(world);
    world.despawn(second);
    world.spawn(at(3.0));
    world.spawn(at(4.0));
    let seen = |world: &mut World| {
        let mut all = world.query_filtered::<(Entity, &Stitch, &Transform, &ChildOf), With<Stitch>>();
        all.iter(world).map(|(_, stitch, at, of)| (stitch.0[0], at.translation.x, of.parent())).collect::<Vec<_>>()
    };
    assert_eq!(seen(world).len(), 3);
    before.restore(world);
    assert_eq!(seen(world), [(1, 1.0, bone), (2, 2.0, bone)]);
    assert!(world.get_entity(first).is_ok(), "it never went");
    assert_eq!(world.get::<Children>(bone).map(|children| children.len()), Some(2));
    // What was put back is itself something to go back to.
    let again = Checkpoint::take(world);
    before.restore(world);
    again.restore(world);
    assert_eq!(seen(world), [(1, 1.0, bone), (2, 2.0, bone)]);
}

/// Who reads in a step what was said in the one before.
#[derive(Resource, Default)]
struct Heard(Vec<f32>);

#[test]
fn messages_on_their_way_arrive_again_and_only_those() {
    let mut app = TestApp::cpu();
    let body = app.world_mut().spawn_empty().id();
    app.init_resource::<Heard>()
        .add_systems(
            FixedUpdate,
            (|mut answers: MessageReader<BodyContact>, mut heard: ResMut<Heard>| {
                heard.0.extend(answers.read().map(|answer| answer.force_world_n.x));
            })
            .in_set(SurgerySystems::Touch),
        )
        .add_systems(
            FixedUpdate,
            (move |mut answers: MessageWriter<BodyContact>, mut said: Local<f32>| {
                *said += 1.0;
                answers.write(BodyContact { body, tool: 0, force_world_n: Vec3::X * *said, ..contact(body) });
            })
            .in_set(SurgerySystems::Deform),
        );
    app.step(3);
    assert_eq!(app.world().resource::<Heard>().0, [1.0, 2.0]);
    let before = Checkpoint::take(app.world_mut());
    app.step(2);
    assert_eq!(app.world().resource::<Heard>().0, [1.0, 2.0, 3.0, 4.0]);
    before.restore(app.world_mut());
    app.world_mut().resource_mut::<Heard>().0.clear();
    app.step(2);
    // The third is heard again, the fifth, which was on its way, never.
    assert_eq!(app.world().resource::<Heard>().0, [3.0, 6.0]);
}

fn contact(body: Entity) -> BodyContact {
    BodyContact { body, tool: 0, position_world_m: Vec3::ZERO, depth_m: 0.0, force_world_n: Vec3::X }
}

#[test]
fn the_clock_of_the_steps_goes_back_and_the_frame_goes_on() {
    let mut app = TestApp::cpu();
    app.step(5);
    let elapsed = |app: &TestApp| app.world().resource::<Time<Fixed>>().elapsed();
    let (before, at) = (Checkpoint::take(app.world_mut()), elapsed(&app));
    app.step(7);
    let left = Duration::from_millis(3);
    app.world_mut().resource_mut::<Time<Fixed>>().accumulate_overstep(left);
    let overstep = app.world().resource::<Time<Fixed>>().overstep();
    before.restore(app.world_mut());
    assert_eq!(elapsed(&app), at);
    assert_eq!(app.world().resource::<Time<Fixed>>().overstep(), overstep);
}
