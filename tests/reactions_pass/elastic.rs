//! Reactions on an organ that gives way.

use super::*;

#[test]
fn paint_goes_along_into_a_dent() {
    let eye = Vec3::new(0.02, 0.25, 0.3);
    let (mut app, organ) = sphere_app(eye);
    let model = model_of(&app, organ);
    let lattice = DeformLattice::around_organ(&model, 3, 0.05).expect("a box");
    let body = ElasticBody::of_organ(&lattice, &model, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.y < -0.04);
    app.world_mut().entity_mut(organ).insert((lattice, body));
    app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    app.step(2);
    let red = app.add_reaction_kind(Paint { colour: [200, 20, 10], opacity: 255 });
    let pale = app.add_reaction_kind(Paint { colour: [250, 230, 200], opacity: 120 });
    let aside = DVec3::new(0.0, 0.8, 0.6);
    start(&mut app, organ, red, aside, 0.015);
    start(&mut app, organ, pale, aside + DVec3::new(0.25, 0.0, 0.0), 0.03);
    app.step(1);
    assert_shows_the_map(&mut app, organ, eye);
    let before = app.capture();
    let outwards = aside.normalize().as_vec3();
    for step in 1..=60 {
        let tip_m = outwards * (0.11 - 0.025 * (step as f32 / 30.0).min(1.0));
        let shape = ToolShape::Capsule { tip_m, back_m: tip_m + 0.2 * outwards, radius_m: 0.01 };
        app.world_mut().write_message(PressBody { body: organ, tool: 0, shape, friction: 0.1 });
        app.step(1);
    }
    let shape = app.world().get::<OrganShape>(organ).expect("a shape");
    let moved = shape.positions_m().iter().zip(&model.mesh.positions_m).map(|(at, rest)| at.distance(*rest));
    assert!(moved.fold(0.0, f32::max) > 0.02);
    assert_shows_the_map(&mut app, organ, eye);
    let after = app.capture();
    let apart = before.pixels().zip(after.pixels()).filter(|(a, b)| a.0[0].abs_diff(b.0[0]) > 40).count();
    assert!(apart > 60, "the dent moves what is seen: {apart} pixels");
}
