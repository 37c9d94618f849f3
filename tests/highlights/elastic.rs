//! The ring on an organ that a probe dents (the paper's figure 17).

use super::*;
use bevy_surgery::organ::pick::OrganPicker;

/// What the closed form has on the surface as it is now: radiance of each pixel, 0 beside the organ.
fn on_the_surface(scene: &Scene, model: &OrganModel, positions_m: &[Vec3], normals: &[Vec3]) -> Vec<f32> {
    let picker = OrganPicker::build(&model.mesh.triangles, positions_m);
    let highlights = scene.app.world().get::<Highlights>(scene.organ).expect("highlights").clone();
    let (light, eye) = (scene.light(), scene.eye.translation);
    let at = |place: u32| {
        let along = scene.ray((place % SIZE) as f32 + 0.5, (place / SIZE) as f32 + 0.5);
        let hit = picker.cast_ray(eye.as_dvec3(), along.as_dvec3(), 10.0)?;
        let corners = model.mesh.triangles[hit.point.face as usize];
        let weights = hit.point.barycentric.as_vec3();
        let normal: Vec3 = (0..3).map(|k| normals[corners[k] as usize] * weights[k]).sum();
        let point = eye + along * hit.distance_m as f32;
        Some(highlight_radiance(&highlights, &light, eye, point, normal.normalize(), 0.5).x)
    };
    (0..SIZE * SIZE).map(|place| at(place).unwrap_or(0.0)).collect()
}

/// How unlike two pictures are: 0 for the same, 2 where nothing of one is in the other.
fn apart(a: &[f32], b: &[f32]) -> f32 {
    let (sum, off) = a.iter().zip(b).fold((0.0, 0.0), |(sum, off), (a, b)| (sum + 0.5 * (a + b), off + (a - b).abs()));
    off / sum
}

#[test]
fn the_ring_follows_a_dent() {
    let model = fine_sphere(RADIUS_M);
    let mut scene = Scene::new(model.clone(), smooth(0.05), lamp(0.02), at(0.3), 0.6);
    let lattice = DeformLattice::around_organ(&model, 3, 0.05).expect("a box");
    let body = ElasticBody::of_organ(&lattice, &model, ElasticTissue::LIVER).expect("a body");
    let body = body.pinned_where(|rest_m| rest_m.z < -0.03);
    scene.app.world_mut().entity_mut(scene.organ).insert((lattice, body));
    scene.app.world_mut().insert_resource(SurgeryGravity { world_m_per_s2: Vec3::ZERO });
    scene.app.warm_up();
    scene.app.step(2);
    let grey = |picture: Vec<Vec3>| -> Vec<f32> { picture.iter().map(|pixel| pixel.x).collect() };
    let shape = |scene: &Scene| scene.app.world().get::<OrganShape>(scene.organ).expect("a shape").clone();
    let rest = shape(&scene);
    let at_rest = grey(scene.picture());
    let wanted = on_the_surface(&scene, &model, rest.positions_m(), rest.normals());
    let off = apart(&at_rest, &wanted);
    assert!(off < 0.05, "at rest: {off}");
    // From the side, so that the probe does not hide the dent; it is not drawn anyway.
    let outwards = Vec3::new(0.15, 0.05, 1.0).normalize();
    for step in 1..=60 {
        let tip_m = outwards * (RADIUS_M + 0.008 - 0.012 * (step as f32 / 30.0).min(1.0));
        let rod = ToolShape::Capsule { tip_m, back_m: tip_m + 0.2 * outwards, radius_m: 0.008 };
        scene.app.world_mut().write_message(PressBody { body: scene.organ, tool: 0, shape: rod, friction: 0.1 });
        scene.app.step(1);
    }
    let dented = shape(&scene);
    let picture = grey(scene.picture());
    let wanted = on_the_surface(&scene, &model, dented.positions_m(), dented.normals());
    let (with, without) = (apart(&picture, &wanted), apart(&picture, &at_rest));
    println!("{with} off the dented surface's, {without} off the one at rest");
    assert!(with < 0.1, "the ring is not that of the dent: {with}");
    assert!(without > 0.4, "this dent hardly bends the ring: {without}");
    // And back again.
    scene.app.step(300);
    let again = apart(&grey(scene.picture()), &at_rest);
    assert!(again < 0.05, "{again} off after the probe has gone");
}
