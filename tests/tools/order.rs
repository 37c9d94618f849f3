//! Tools that act on one body in the same step: the order is their own, and not that in which a program has spawned them.

use super::{drill, hold, slab};
use crate::support::sphere_organ;
use bevy::prelude::*;
use bevy_surgery::deform::elastic::{ElasticBody, ElasticTissue};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::tools::ToolOrder;

/// Puts a tool into an archetype of its own.
#[derive(Component)]
struct Marker;

/// Tools with their names and whether they are [`Marker`]s, spawned in this order.
fn spawn(app: &mut TestApp, tools: &[(&str, Tool, bool)]) {
    for (name, tool, is_marked) in tools {
        let mut entity = app.world_mut().spawn((Name::new(name.to_string()), tool.clone()));
        if *is_marked {
            entity.insert(Marker);
        }
    }
}

fn named(app: &mut TestApp, name: &str) -> Entity {
    let mut all = app.world_mut().query::<(Entity, &Name)>();
    all.iter(app.world()).find(|(_, of)| of.as_str() == name).map(|(entity, _)| entity).expect("it was spawned")
}

/// The same tools in several programs: front to back, back to front, and with the one or the other in an archetype of its own.
fn programs(first: (&'static str, Tool), second: (&'static str, Tool)) -> [Vec<(&'static str, Tool, bool)>; 4] {
    let [a, b] = [first, second];
    let tool = |of: &(&'static str, Tool), is_marked| (of.0, of.1.clone(), is_marked);
    [
        vec![tool(&a, false), tool(&b, false)],
        vec![tool(&b, false), tool(&a, false)],
        vec![tool(&a, true), tool(&b, false)],
        vec![tool(&b, true), tool(&a, false)],
    ]
}

/// What is left of a bone that two drills cut at once, each at its x, and what each has removed.
fn drilled(tools: &[(&str, Tool, bool)], places: [(&str, f32); 2]) -> (Vec<u8>, Vec<(String, f64)>) {
    let mut app = TestApp::cpu();
    let volume = app.world_mut().resource_mut::<Assets<Volume>>().add(slab());
    let bone = app.world_mut().spawn(CtVolume(volume)).id();
    app.step(2);
    spawn(&mut app, tools);
    let mut removed = vec![("left".to_string(), 0.0), ("right".to_string(), 0.0)];
    for step in 0..40 {
        let depth_m = 1e-4 * step as f32;
        for (name, x) in places {
            let tool = named(&mut app, name);
            hold(&mut app, tool, Vec3::new(x, 0.0, 2e-3 - depth_m), 1.0);
        }
        app.step(1);
        let messages = app.world().resource::<Messages<VoxelsRemoved>>();
        let new: Vec<VoxelsRemoved> = messages.iter_current_update_messages().cloned().collect();
        for message in new {
            let name = app.world().get::<Name>(message.tool.expect("a tool")).expect("a name").to_string();
            removed.iter_mut().filter(|(of, _)| *of == name).for_each(|(_, mm3)| *mm3 += message.total_mm3);
        }
    }
    let cut = app.world().get::<CutVolume>(bone).expect("a cut");
    let mut left = vec![0; 64 * 64 * 64];
    cut.copy_remaining(bevy_surgery::volume::VoxelBox { min: UVec3::ZERO, max: UVec3::splat(64) }, &mut left);
    (left, removed)
}

#[test]
fn two_drills_cut_the_same_bone_alike_in_every_program() {
    let places = [("left", -4.4e-3), ("right", -3.6e-3)];
    let programs = programs(("left", drill()), ("right", drill()));
    let all = programs.clone().map(|tools| drilled(&tools, places));
    let (left, removed) = &all[0];
    assert!(left.iter().any(|remaining| *remaining < 255) && removed.iter().all(|(_, mm3)| *mm3 > 1.0), "{removed:?}");
    // Whose turn it is first does matter: with each other's names the same drills at the same places take other shares.
    let [left_at, right_at] = places.map(|(_, x)| x);
    let (_, other_way) = drilled(&programs[0], [("right", left_at), ("left", right_at)]);
    assert_ne!(removed[0].1, other_way[1].1, "their order is no matter");
    for other in &all[1..] {
        assert_eq!(&other.1, removed);
        assert!(other.0 == *left, "another bone");
    }
}

/// How a soft body lies that two graspers pull.
fn held(tools: &[(&str, Tool, bool)]) -> Vec<Vec3> {
    let mut app = TestApp::cpu();
    let lattice = DeformLattice::new(Vec3::splat(-0.02), Vec3::splat(0.02), 2).expect("a lattice");
    let body = ElasticBody::uniform(&lattice, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.y < -0.019);
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.018));
    let entity = app.world_mut().spawn((Organ(organ), lattice, body)).id();
    app.step(3);
    spawn(&mut app, tools);
    for step in 0..60 {
        let pull_m = 1e-4 * step as f32;
        for (name, x) in [("left", -2e-3_f32), ("right", 2e-3)] {
            let tool = named(&mut app, name);
            let tip_m = Vec3::new(x + x.signum() * pull_m, 0.018 + pull_m, 0.0);
            let pose = ToolPose::with_shaft_towards(tip_m, tip_m + Vec3::Y);
            let grip = if step > 2 { 1.0 } else { 0.0 };
            app.world_mut().entity_mut(tool).insert((pose, ToolCommand { grip, ..default() }));
        }
        app.step(1);
    }
    app.world().get::<OrganShape>(entity).expect("a shape").positions_m().to_vec()
}

#[test]
fn two_graspers_pull_the_same_body_alike_in_every_program() {
    let grasper = || Tool::new(ToolKind::Grasper(Jaws::default()));
    let all = programs(("left", grasper()), ("right", grasper())).map(|tools| held(&tools));
    let rest = sphere_organ(0.018);
    let farthest = all[0].iter().zip(&rest.mesh.positions_m).map(|(now, rest)| now.distance(*rest)).fold(0.0, f32::max);
    assert!(farthest > 5e-4, "it was pulled: {farthest}");
    for other in &all[1..] {
        assert!(other == &all[0], "another shape");
    }
}

#[test]
fn tools_without_names_come_first_and_those_of_one_name_by_entity() {
    let mut app = TestApp::cpu();
    let [b, a, none, a_again] = ["b", "a", "", "a"].map(|name| {
        let mut tool = app.world_mut().spawn(Tool::default());
        if !name.is_empty() {
            tool.insert(Name::new(name));
        }
        tool.id()
    });
    app.step(1);
    let mut alike = [a, a_again];
    alike.sort();
    assert_eq!(app.world().resource::<ToolOrder>().0, [none, alike[0], alike[1], b]);
    app.world_mut().despawn(a);
    app.step(1);
    assert_eq!(app.world().resource::<ToolOrder>().0, [none, a_again, b]);
}
