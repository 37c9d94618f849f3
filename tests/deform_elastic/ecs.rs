//! Bodies among instruments, organs and lattices.

use super::*;
use bevy::math::DVec3;
use bevy_surgery::organ::pick::OrganPicker;
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

/// A sphere of liver of 10 cm, held at its lower half.
fn scene(level: u32) -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let model = sphere();
    let lattice = DeformLattice::around_organ(&model, level, 0.05).expect("a box");
    let body = ElasticBody::of_organ(&lattice, &model, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.y < -0.02);
    let model = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
    let organ = app.world_mut().spawn((Organ(model), lattice, body)).id();
    app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    app.step(2);
    (app, organ)
}

fn sphere() -> OrganModel {
    let options = OrganOptions { table_width_px: 64, ..default() };
    OrganModel::from_mesh(procedural_ellipsoid(Vec3::splat(0.05), 12), "sphere", &options)
        .expect("a sphere is an organ")
}

fn shape(app: &TestApp, organ: Entity) -> &OrganShape {
    app.world().get::<OrganShape>(organ).expect("a shaped organ")
}

/// Takes all messages of a kind.
fn taken<M: Message + Clone>(app: &mut TestApp) -> Vec<M> {
    let mut messages = app.world_mut().resource_mut::<Messages<M>>();
    messages.drain().collect()
}

#[test]
fn a_probe_dents_an_organ_and_is_never_in_it() {
    for (level, radius_m) in [(2, 0.003), (3, 0.003), (3, 0.012)] {
        let (mut app, organ) = scene(level);
        let model = sphere();
        let mut deepest: Option<BodyContact> = None;
        for step in 0..60 {
            let sunk_m = 0.012 * (step as f32 / 30.0).min(1.0);
            let tip_m = Vec3::new(0.004, 0.05 + radius_m - sunk_m, 0.002);
            let back_m = tip_m + Vec3::new(0.05, 0.2, 0.0);
            let shape_now = ToolShape::Capsule { tip_m, back_m, radius_m };
            app.world_mut().write_message(PressBody { body: organ, tool: 3, shape: shape_now, friction: 0.1 });
            app.step(1);
            deepest = taken::<BodyContact>(&mut app).pop().or(deepest);
            // From the axis of the rod, no place of the surface is nearer than its radius.
            let picker = OrganPicker::build(&model.mesh.triangles, shape(&app, organ).positions_m());
            for n in 0..=20 {
                let on_axis = tip_m.lerp(back_m, n as f32 / 20.0 * 0.2).as_dvec3();
                let gap_m = picker.nearest(on_axis, 1.0).expect("a surface").distance_m;
                assert!(gap_m > f64::from(radius_m) - 1e-4, "level {level}, step {step}: {gap_m} m from its axis");
                let out = picker.cast_ray(on_axis, DVec3::Y, 1.0);
                assert!(out.is_none_or(|hit| hit.is_front), "level {level}, step {step}: the axis is inside");
            }
        }
        let contact = deepest.expect("it touches");
        assert!(contact.tool == 3 && contact.depth_m > 0.008, "{contact:?}");
        assert!(contact.force_world_n.y > 0.02 && contact.force_world_n.y < 50.0, "pushed back: {contact:?}");
        let dent_m = 0.05 - shape(&app, organ).positions_m().iter().map(|at| at.y).fold(0.0, f32::max);
        assert!(dent_m < 0.02, "the top is {dent_m} m lower");
        // Without it the organ comes back to where it was.
        app.step(240);
        let off_m = off(&app, organ, &model);
        assert!(off_m < 5e-4, "level {level}: {off_m} m off");
    }
}

/// How far a vertex is from where it rests, at most.
fn off(app: &TestApp, organ: Entity, model: &OrganModel) -> f32 {
    let pairs = shape(app, organ).positions_m().iter().zip(&model.mesh.positions_m);
    pairs.map(|(at, rest)| at.distance(*rest)).fold(0.0, f32::max)
}

/// Pulls the top of the sphere up; returns the messages: held, slipped, torn.
fn pull(grip_force_n: f32, height_m: f32) -> (Vec<GraspHeld>, Vec<GraspSlipped>, Vec<TissueTorn>, f32) {
    let (mut app, organ) = scene(3);
    let (mut held, mut slipped, mut torn) = (Vec::new(), Vec::new(), Vec::new());
    let mut highest = 0.0_f32;
    for step in 0..90 {
        let share = (step as f32 / 60.0).min(1.0);
        app.world_mut().write_message(GraspBody {
            body: organ,
            tool: 1,
            position_world_m: Vec3::new(0.0, 0.05 + share * height_m, 0.0),
            rotation_world: Quat::IDENTITY,
            radius_m: 0.01,
            grip_force_n,
            friction: 0.8,
        });
        app.step(1);
        highest = shape(&app, organ).positions_m().iter().map(|at| at.y).fold(highest, f32::max);
        held.extend(taken::<GraspHeld>(&mut app));
        slipped.extend(taken::<GraspSlipped>(&mut app));
        torn.extend(taken::<TissueTorn>(&mut app));
    }
    (held, slipped, torn, highest)
}

#[test]
fn jaws_lift_tissue_lose_it_or_tear_it() {
    let (held, slipped, torn, highest) = pull(1e3, 0.01);
    assert!(slipped.is_empty() && torn.is_empty() && held.len() == 90);
    assert!((highest - 0.06).abs() < 2e-3, "lifted to {highest}");
    let last = held.last().expect("it holds");
    assert!(last.force_world_n.y < -0.01 && last.stretch > 1.02, "it pulls back: {last:?}");
    // A light grip slips, once, and holds nothing after that.
    let pull_n = -last.force_world_n.y;
    let (held, slipped, torn, _) = pull(0.5 * pull_n / 0.8, 0.01);
    assert!(slipped.len() == 1 && torn.is_empty() && held.len() < 90, "{slipped:?}");
    assert!(slipped[0].pull_n > 0.5 * pull_n && slipped[0].tool == 1);
    // A firm one tears it where it is pulled too far.
    let (_, slipped, torn, _) = pull(1e6, 0.08);
    assert!(slipped.is_empty() && torn.len() == 1, "{torn:?}");
    assert!(torn[0].stretch > ElasticTissue::LIVER.tears_at_stretch, "{torn:?}");
}

#[test]
fn organs_ride_in_lattices_alone() {
    let mut app = TestApp::cpu();
    let model = sphere();
    let mut lattice = DeformLattice::around_organ(&model, 2, 0.05).expect("a box");
    // Matter is shown 3% of the box higher than it rests: all of it moves up.
    lattice.set_from(|_| DVec3::new(0.0, -0.03, 0.0)).expect("finite");
    let side_m = lattice.body_from_box().matrix3.y_axis.y;
    let handle = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model.clone());
    let organ = app.world_mut().spawn((Organ(handle), lattice)).id();
    app.step(3);
    for (at, rest) in shape(&app, organ).positions_m().iter().zip(&model.mesh.positions_m) {
        assert!((*at - *rest).distance(Vec3::Y * 0.03 * side_m) < 1e-6, "{at} from {rest}");
    }
    app.world_mut().get_mut::<DeformLattice>(organ).expect("a lattice").reset();
    app.step(1);
    assert_eq!(shape(&app, organ).positions_m(), &model.mesh.positions_m[..], "at rest, bit for bit");
}

#[test]
fn lattices_are_told_and_may_be_subdivided() {
    let (mut app, organ) = scene(2);
    app.world_mut().insert_resource(SurgeryGravity::default());
    app.step(60);
    let sagged = off(&app, organ, &sphere());
    assert!(sagged > 1e-3);
    let agrees = |app: &TestApp| {
        let lattice = app.world().get::<DeformLattice>(organ).expect("a lattice");
        let body = app.world().get::<ElasticBody>(organ).expect("a body");
        let rest_m = Vec3::new(0.01, 0.02, -0.015);
        let shown = lattice.box_from_body().transform_point3(body.moved_m(rest_m)).as_dvec3();
        let rest = lattice.body_from_box().transform_point3(lattice.rest_from_shown(shown).as_vec3());
        rest.distance(rest_m)
    };
    assert!(agrees(&app) < 2e-4, "{} m apart", agrees(&app));
    let mut lattice = app.world_mut().get_mut::<DeformLattice>(organ).expect("a lattice");
    let patch = lattice.tree().patches()[40];
    lattice.subdivide(patch).expect("it is there");
    app.step(1);
    let now = off(&app, organ, &sphere());
    assert!((now / sagged - 1.0).abs() < 0.05, "{now} m after {sagged} m");
    app.step(30);
    assert!(agrees(&app) < 2e-4, "{} m apart", agrees(&app));
}

#[test]
fn frames_do_not_change_what_steps_do() {
    let run = |steps_per_frame: u32| {
        let (mut app, organ) = scene(2);
        app.world_mut().insert_resource(SurgeryGravity::default());
        for _ in 0..60 / steps_per_frame {
            if steps_per_frame == 1 {
                app.step(1);
                app.idle();
            } else {
                app.insert_resource(bevy::time::TimeUpdateStrategy::FixedTimesteps(steps_per_frame));
                app.update();
            }
        }
        shape(&app, organ).positions_m().iter().flat_map(|at| at.to_array().map(f32::to_bits)).collect::<Vec<u32>>()
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn an_exchanged_model_rides_too_and_nobody_is_told_what_is_none() {
    let (mut app, organ) = scene(2);
    let smaller = procedural_ellipsoid(Vec3::splat(0.04), 6);
    let smaller = OrganModel::from_mesh(smaller, "smaller", &OrganOptions { table_width_px: 64, ..default() });
    let smaller = app.world_mut().resource_mut::<Assets<OrganModel>>().add(smaller.expect("an organ"));
    app.world_mut().entity_mut(organ).insert(Organ(smaller));
    app.world_mut().insert_resource(SurgeryGravity::default());
    let nobody = app.world_mut().spawn_empty().id();
    let shape_of_none = ToolShape::Sphere { centre_m: Vec3::NAN, radius_m: -1.0 };
    for body in [organ, nobody] {
        app.world_mut().write_message(PressBody { body, tool: 0, shape: shape_of_none, friction: f32::NAN });
    }
    app.step(30);
    let body = app.world().get::<ElasticBody>(organ).expect("a body");
    let positions = shape(&app, organ).positions_m();
    assert!(body.faults().odd_inputs == 1 && positions.iter().all(|at| at.is_finite()));
    let top = positions.iter().map(|at| at.y).fold(0.0, f32::max);
    assert!(top < 0.0399 && top > 0.03, "it sags: {top}");
}
