//! What lies on an organ stays with its matter while the organ gives way.

use super::*;
use bevy::ecs::system::RunSystemOnce;
use bevy::math::DVec3;
use bevy_surgery::organ::surface::Surface;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

/// A sphere of liver of 10 cm, held at its lower half, that reacts.
fn scene() -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let options = OrganOptions { table_width_px: 256, ..default() };
    let mesh = procedural_ellipsoid(Vec3::splat(0.05), 12);
    let model = OrganModel::from_mesh(mesh, "sphere", &options).expect("a sphere is an organ");
    let lattice = DeformLattice::around_organ(&model, 3, 0.05).expect("a box");
    let body = ElasticBody::of_organ(&lattice, &model, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.y < -0.02);
    let model = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
    let organ = app.world_mut().spawn((Organ(model), lattice, body, Reactions::default())).id();
    app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    app.step(2);
    (app, organ)
}

fn model(app: &TestApp, organ: Entity) -> OrganModel {
    let handle = &app.world().get::<Organ>(organ).expect("an organ").0;
    app.world().resource::<Assets<OrganModel>>().get(handle).expect("loaded").clone()
}

fn reactions(app: &TestApp, organ: Entity) -> &ReactionModel {
    app.world().get::<ReactionModel>(organ).expect("it reacts")
}

/// Where a place of the surface is now, and its normal.
fn now(app: &TestApp, organ: Entity, point: SurfacePoint) -> (DVec3, DVec3) {
    let (model, shape) = (model(app, organ), app.world().get::<OrganShape>(organ).expect("a shape"));
    let surface = model.surface(shape);
    (surface.position_m(point), surface.normal(point))
}

/// Picks what is seen at a place from outside.
fn picked(app: &mut TestApp, at: DVec3, outwards: DVec3) -> OrganHit {
    let origin = (at + outwards * 2e-3).as_vec3();
    let ray = Ray3d::new(origin, Dir3::new(-outwards.as_vec3()).expect("a direction"));
    let hit = app.world_mut().run_system_once(move |picking: OrganPicking| picking.cast_ray(ray, 0.1));
    hit.expect("it runs").expect("the surface is there")
}

/// Pushes the top down by a rod for a second.
fn dent(app: &mut TestApp, organ: Entity, depth_m: f32) {
    for step in 1..=60 {
        let tip_m = Vec3::new(0.0, 0.055 - depth_m * (step as f32 / 30.0).min(1.0), 0.0);
        let shape = ToolShape::Capsule { tip_m, back_m: tip_m + 0.1 * Vec3::Y, radius_m: 0.005 };
        app.world_mut().write_message(PressBody { body: organ, tool: 0, shape, friction: 0.1 });
        app.step(1);
    }
}

fn burn(app: &mut TestApp, organ: Entity, point: SurfacePoint) {
    for _ in 0..90 {
        let action = ReactionAction::Cauterize(Cautery::coagulate(45.0));
        app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
        app.step(1);
    }
}

/// Places around the top, where a dent moves the surface.
fn places(app: &TestApp, organ: Entity) -> Vec<SurfacePoint> {
    let model = model(app, organ);
    let picker = bevy_surgery::organ::pick::OrganPicker::build(&model.mesh.triangles, &model.mesh.positions_m);
    (0..40)
        .map(|n| {
            let (turn, out) = (f64::from(n) * 2.4, 0.02 + 0.012 * f64::from(n));
            let direction = DVec3::new(out * turn.cos(), 1.0, out * turn.sin()).normalize();
            picker.cast_ray(direction, -direction, 2.0).expect("it goes through the middle").point
        })
        .collect()
}

#[test]
fn a_dent_takes_what_is_picked_along() {
    let (mut app, organ) = scene();
    let points = places(&app, organ);
    let rest: Vec<DVec3> = points.iter().map(|&point| now(&app, organ, point).0).collect();
    dent(&mut app, organ, 0.012);
    let atlas = model(&app, organ).atlas.clone();
    let mut moved = 0;
    for (&point, rest) in points.iter().zip(&rest) {
        let (at, normal) = now(&app, organ, point);
        moved += u32::from(at.distance(*rest) > 4e-3);
        let hit = picked(&mut app, at, normal);
        assert!(hit.organ == organ && hit.is_outside);
        // The same matter, in the same place of the maps; and nobody is told another place than where it is.
        let apart = atlas.uv(hit.point).distance(atlas.uv(point));
        assert!(apart < 1e-5, "{point:?} is picked as {:?}", hit.point);
        if hit.point.face == point.face {
            assert!(hit.point.barycentric.distance(point.barycentric) < 1e-3, "{point:?}, {hit:?}");
        }
        assert!(hit.position_world_m.as_dvec3().distance(at) < 1e-5);
    }
    assert!(moved > 8, "only {moved} places were moved by more than 4 mm");
}

#[test]
fn a_burn_stays_with_the_matter_that_was_burnt() {
    let (mut app, organ) = scene();
    // Beside the rod, on the slope of the dent.
    let point = places(&app, organ)[9];
    burn(&mut app, organ, point);
    // Until it is cold, so that only the dent could change what shows.
    app.step(60 * 60);
    assert_eq!(reactions(&app, organ).heat().hot_tiles(), 0);
    let map = reactions(&app, organ).map().clone();
    let charred = map.colour().iter().filter(|texel| texel[3] > 150).count();
    assert!(charred > 10, "{charred} texels are burnt");
    let (before, _) = now(&app, organ, point);
    dent(&mut app, organ, 0.012);
    let (after, normal) = now(&app, organ, point);
    assert!(before.distance(after) > 3e-3, "it went along by {} m", before.distance(after));
    // Texels are matter: bit for bit what they were, and what is picked in the dent is the burn.
    let same = reactions(&app, organ).map();
    assert!(same.colour() == map.colour() && same.gloss() == map.gloss());
    let hit = picked(&mut app, after, normal);
    let reacting = reactions(&app, organ);
    let size = reacting.size();
    let texel = |point: SurfacePoint| {
        let uv = model(&app, organ).atlas.uv(point);
        let (x, y) = ((uv.x * f64::from(size.width_px)) as usize, (uv.y * f64::from(size.height_px)) as usize);
        reacting.map().colour()[y.min(size.height_px as usize - 1) * size.width_px as usize + x]
    };
    assert!(texel(hit.point)[3] > 150, "{:?}", texel(hit.point));
    assert_eq!(texel(hit.point), texel(point));
    // And it comes back with the organ.
    app.step(300);
    assert!(now(&app, organ, point).0.distance(before) < 5e-4);
    assert!(reactions(&app, organ).map().colour() == map.colour());
}

#[test]
fn touches_are_measured_on_the_stretched_surface() {
    let (mut app, organ) = scene();
    // All of it is stretched along x and held so.
    let stretch = 1.6;
    let mut body = app.world_mut().get_mut::<ElasticBody>(organ).expect("a body");
    for vertex in 0..body.tree().vertex_count() {
        // Those that follow others cannot be pinned, and need not be.
        let _ = body.pin(vertex, true);
    }
    body.displace(|rest_m| (Vec3::X * rest_m.x * (stretch - 1.0), Vec3::ZERO));
    app.step(2);
    let point = places(&app, organ)[0];
    // Pressed skin turns pale within this distance along the surface as it is now.
    let radius_m = 0.008;
    for _ in 0..30 {
        let action = ReactionAction::Press { pressure: 1.0, radius_m };
        app.world_mut().write_message(OrganTouch { organ, point, instrument: 1, action });
        app.step(1);
    }
    let (reacting, of) = (reactions(&app, organ), model(&app, organ));
    let size = reacting.size();
    let table = of.atlas.table(size.width_px, size.height_px);
    let surface = of.surface(app.world().get::<OrganShape>(organ).expect("a shape"));
    let rest = OrganShape::at_rest(&of);
    let at_rest = of.surface(&rest);
    let away_m = |surface: &Surface, place: SurfacePoint| (surface.position_m(place) - surface.position_m(point)).abs();
    let (mut pale, mut reach_m, mut reach_at_rest_m) = (0, DVec3::ZERO, DVec3::ZERO);
    for y in 0..size.height_px {
        for x in 0..size.width_px {
            if reacting.map().colour()[(y * size.width_px + x) as usize][3] == 0 {
                continue;
            }
            let Some(place) = of.atlas.locate_uv(table.centre_uv(x, y), &table) else { continue };
            pale += 1;
            reach_m = reach_m.max(away_m(&surface, place));
            reach_at_rest_m = reach_at_rest_m.max(away_m(&at_rest, place));
        }
    }
    println!("{pale} texels; {reach_m} m as it is, {reach_at_rest_m} m at rest");
    assert!(pale > 40, "{pale} texels");
    // Round on what is seen, to a texel and what the profile's rim hides: an ellipse on the matter at rest.
    let most_m = f64::from(radius_m);
    assert!(reach_m.x < 1.03 * most_m && reach_m.z < 1.03 * most_m, "{reach_m} m");
    assert!((reach_m.x / reach_m.z - 1.0).abs() < 0.1 && reach_m.x > 0.8 * most_m, "{reach_m} m");
    let ratio = reach_at_rest_m.z / reach_at_rest_m.x;
    assert!((ratio / f64::from(stretch) - 1.0).abs() < 0.1, "{reach_at_rest_m} m at rest");
}
