//! Skin on an organ that gives way.

use super::*;
use bevy_surgery::organ::pick::OrganPicker;

/// The skin's colours are those of the matter, wherever that has gone.
#[test]
fn the_pattern_goes_along_with_the_matter() {
    let (mut app, organ) = sphere_app();
    app.insert_resource(GlobalAmbientLight { brightness: 1000.0, ..default() });
    // A pattern that is coarse against pixels, under light from all sides: no shade, only the pattern.
    let tiles = TileSource::Generated(TileOptions { resolution_px: 64, cells_per_edge: 3.0, ..TileOptions::liver() });
    let plain = plain_skin(ALBEDO);
    app.world_mut().entity_mut(organ).insert(Skin { tiles, ..plain });
    let handle = app.world().get::<Organ>(organ).expect("an organ").0.clone();
    let model = app.world().resource::<Assets<OrganModel>>().get(&handle).expect("loaded").clone();
    let lattice = DeformLattice::around_organ(&model, 3, 0.05).expect("a box");
    let body = ElasticBody::of_organ(&lattice, &model, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.z < -0.04);
    app.world_mut().entity_mut(organ).insert((lattice, body));
    app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    app.warm_up();
    app.step(2);
    let before = app.capture();
    // Jaws draw the side away: the pattern moves in the picture, with little change of size.
    for step in 1..=90 {
        let share = (step as f32 / 60.0).min(1.0);
        app.world_mut().write_message(GraspBody {
            body: organ,
            tool: 0,
            position_world_m: Vec3::new(0.02 * share, 0.0, RADIUS_M),
            rotation_world: Quat::IDENTITY,
            radius_m: 0.03,
            grip_force_n: 1e6,
            friction: 1.0,
        });
        app.step(1);
    }
    let after = app.capture();
    let positions = app.world().get::<OrganShape>(organ).expect("a shape").positions_m().to_vec();
    let at_rest = OrganPicker::build(&model.mesh.triangles, &model.mesh.positions_m);
    let seen = OrganPicker::build(&model.mesh.triangles, &positions);
    let colour = |picture: &RgbaImage, at: Vec2| -> Vec3 {
        let corner = at.floor();
        let share = at - corner;
        let pixel = |dx: u32, dy: u32| {
            let [r, g, b, _] = picture.get_pixel(corner.x as u32 + dx, corner.y as u32 + dy).0;
            Vec3::new(linear(r), linear(g), linear(b))
        };
        pixel(0, 0).lerp(pixel(1, 0), share.x).lerp(pixel(0, 1).lerp(pixel(1, 1), share.x), share.y)
    };
    let (mut along, mut left, mut compared) = (0.0, 0.0, 0);
    for y in (20..SIZE - 20).step_by(2) {
        for x in (20..SIZE - 20).step_by(2) {
            let Some(hit) = seen.cast_ray(EYE.as_dvec3(), ray(x, y).as_dvec3(), 10.0) else { continue };
            let rest = at_rest_position(&model, hit.point);
            // Where that matter was in the first picture; what was not seen there is left out.
            let to_rest = (rest - EYE).normalize();
            let first = at_rest.cast_ray(EYE.as_dvec3(), to_rest.as_dvec3(), 10.0);
            let was_seen = first.is_some_and(|first| first.face_normal.dot(-to_rest.as_dvec3()) > 0.5);
            let extent = (PI / 8.0).tan();
            let ndc = Vec2::new(to_rest.x, -to_rest.y) / (-to_rest.z * extent);
            let was_at = (ndc + 1.0) * 0.5 * SIZE as f32 - 0.5;
            let moved_px = was_at.distance(Vec2::new(x as f32, y as f32));
            if !was_seen || moved_px < 3.0 {
                continue;
            }
            let is = colour(&after, Vec2::new(x as f32, y as f32));
            along += is.distance_squared(colour(&before, was_at));
            left += is.distance_squared(colour(&before, Vec2::new(x as f32, y as f32)));
            compared += 1;
        }
    }
    println!("{compared} places: {along} with the matter, {left} in the picture");
    assert!(compared > 60, "{compared} places moved");
    assert!(along < 0.2 * left, "{along} against {left}: the pattern does not stay with the matter");
}

fn at_rest_position(model: &OrganModel, point: bevy_surgery::organ::SurfacePoint) -> Vec3 {
    let corners = model.mesh.triangles[point.face as usize];
    let weights = point.barycentric.as_vec3();
    (0..3).map(|k| model.mesh.positions_m[corners[k] as usize] * weights[k]).sum()
}
