//! The models without a renderer: these tests run with `--no-default-features` too.

mod checkpoint;
mod deform_animate;
#[path = "deform_elastic.rs"]
mod deform_elastic;
mod deform_fit;
mod deform_gradient;
mod deform_inverse;
mod deform_lattice;
mod deform_support;
mod deform_warp;
mod haptics_device;
mod haptics_servo;
#[cfg(feature = "panels")]
mod panels;
#[path = "pool_ecs.rs"]
mod pool_ecs;
mod scenario;
mod scenario_metrics;
mod scenario_report;
mod scenario_runs;
mod scenes;
mod sound;
#[allow(dead_code)]
mod support;
mod tools;
mod volume_deformed;
mod volume_elastic;

use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

#[test]
fn an_organ_lives_on_minimal_plugins() {
    let mut app = TestApp::cpu();
    let liver = OrganModel::procedural_liver(&OrganOptions::default()).expect("the crate's own liver");
    let vertices = liver.mesh.positions_m.len();
    let liver = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
    let organ = app.world_mut().spawn((Organ(liver), Skin::liver())).id();
    app.add_systems(
        FixedUpdate,
        (|mut shapes: Query<&mut OrganShape>| {
            for mut shape in &mut shapes {
                shape.move_vertices().iter_mut().for_each(|position| position.y *= 0.99);
            }
        })
        .in_set(SurgerySystems::Deform),
    );
    app.step(10);
    let shape = app.world().get::<OrganShape>(organ).expect("a shaped organ");
    assert_eq!(shape.positions_m().len(), vertices);
    assert!(shape.normals().iter().all(|normal| (normal.length() - 1.0).abs() < 1e-5));
    let height = |positions: &[Vec3]| positions.iter().map(|p| p.y.abs()).fold(0.0, f32::max);
    let models = app.world().resource::<Assets<OrganModel>>();
    let model = models.get(&app.world().get::<Organ>(organ).expect("an organ").0).expect("a model");
    let share = height(shape.positions_m()) / height(&model.mesh.positions_m);
    assert!((share - 0.99_f32.powi(10)).abs() < 1e-4, "ten steps of one percent each: {share}");
}

#[test]
fn exchanging_a_model_exchanges_the_shape() {
    let mut app = TestApp::cpu();
    let make = |extent_m| {
        OrganModel::procedural_liver(&OrganOptions::default().with_largest_extent_m(extent_m)).expect("a liver")
    };
    let (small, large) = (make(0.1), make(0.3));
    let mut models = app.world_mut().resource_mut::<Assets<OrganModel>>();
    let handle = models.add(small);
    let organ = app.world_mut().spawn(Organ(handle.clone())).id();
    let width = |app: &TestApp| {
        let shape = app.world().get::<OrganShape>(organ).expect("a shaped organ");
        let reach = |sign: f32| shape.positions_m().iter().map(|p| sign * p.x).fold(f32::MIN, f32::max);
        reach(1.0) + reach(-1.0)
    };
    app.step(1);
    let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shaped organ");
    shape.move_vertices().iter_mut().for_each(|position| position.x *= 0.5);
    app.step(3);
    assert!((width(&app) - 0.05).abs() < 1e-4, "a moved organ stays moved: {}", width(&app));
    app.world_mut().resource_mut::<Assets<OrganModel>>().insert(handle.id(), large).expect("its place is there");
    app.step(1);
    assert!((width(&app) - 0.3).abs() < 1e-4, "another model, another shape: {}", width(&app));
}

#[test]
fn organs_bleed_and_burn_without_a_renderer() {
    let mut app = TestApp::cpu();
    let liver = OrganModel::procedural_liver(&OrganOptions::default()).expect("a liver");
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
    let organ = app.world_mut().spawn((Organ(organ), Reactions::default())).id();
    app.step(2);
    let above = Ray3d::new(Vec3::new(0.02, 0.3, 0.0), Dir3::NEG_Y);
    app.add_systems(
        FixedUpdate,
        (move |picking: OrganPicking, mut touches: MessageWriter<OrganTouch>| {
            let Some(hit) = picking.cast_ray(above, 1.0) else { return };
            let action = ReactionAction::Cauterize(Cautery::coagulate(30.0));
            touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 0, action });
            let action = ReactionAction::Bleed { volume_m3: 1e-9 };
            touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 1, action });
        })
        .in_set(SurgerySystems::Touch),
    );
    app.step(60);
    let reactions = app.world().get::<ReactionModel>(organ).expect("it reacts");
    assert!((reactions.tally().bled_m3 / 60e-9 - 1.0).abs() < 1e-9, "{:?}", reactions.tally());
    assert!(reactions.permanent().tiles_in_use() > 0 && !reactions.is_blank());
}
