//! What the GPU samples from the tiles, pixel by pixel against the CPU's own sampling: tile choice, rotation, texture
//! coordinates, secondary vertices.

use crate::support::sphere_organ;
use bevy::camera::Exposure;
use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_surgery::organ::OrganModel;
use bevy_surgery::prelude::*;
use bevy_surgery::skin::TileSource;
use bevy_surgery::skin::tiles::{TileChoice, TileOptions, TileSet, assign_tiles, rotate_barycentric};
use bevy_surgery::testing::TestApp;
use image::RgbaImage;

const SIZE: u32 = 96;
const RADIUS_M: f32 = 0.1;
const SEED: u64 = 5;
/// Close enough for a texel to cover several pixels: then the GPU samples the finest level.
const EYE: Vec3 = Vec3::new(0.0, 0.0, RADIUS_M + 0.02);

fn options() -> TileOptions {
    TileOptions { resolution_px: 128, cells_per_edge: 8.0, ..TileOptions::liver() }
}

/// The sphere close up, with nothing but ambient light: every pixel is the tile's colour times a constant.
fn picture(model: &OrganModel, turn: Quat) -> RgbaImage {
    let mut app = TestApp::gpu(SIZE, SIZE);
    // Radiance is albedo times brightness times exposure: a factor of one.
    let brightness = 1.0 / Exposure::default().exposure();
    app.insert_resource(GlobalAmbientLight { brightness, ..default() });
    let camera = app.spawn_camera(Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y));
    let lens = PerspectiveProjection { near: 0.001, ..default() };
    app.world_mut().entity_mut(camera).insert(Projection::Perspective(lens));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model.clone());
    let tiles = TileSource::Generated(options());
    let skin = Skin { tiles, tint: Color::WHITE, mottle: 0.0, sheen: 0.0, seed: SEED, ..Skin::liver() };
    app.world_mut().spawn((Organ(organ), skin, Transform::from_rotation(turn)));
    app.capture()
}

/// Where a ray meets a triangle: distance and weights.
fn meet(origin: Vec3, along: Vec3, [a, b, c]: [Vec3; 3]) -> Option<(f32, Vec3)> {
    let (ab, ac) = (b - a, c - a);
    let normal = along.cross(ac);
    let determinant = ab.dot(normal);
    let from_a = origin - a;
    let v = from_a.dot(normal) / determinant;
    let across = from_a.cross(ab);
    let w = along.dot(across) / determinant;
    let distance = ac.dot(across) / determinant;
    let is_inside = determinant.abs() > 1e-12 && v >= 0.0 && w >= 0.0 && v + w <= 1.0 && distance > 0.0;
    is_inside.then(|| (distance, Vec3::new(1.0 - v - w, v, w)))
}

/// The texture triangle that every pixel shows, and the place in it; `None` where the ray misses.
fn visible(model: &OrganModel, turn: Quat) -> Vec<Option<(usize, Vec3)>> {
    let extent = (std::f32::consts::PI / 8.0).tan();
    let corners = &model.skin_mesh.corners;
    let place =
        |id: u32| turn * model.skin_mesh.position_m(corners[id as usize].vertex, &model.mesh.positions_m).as_vec3();
    // Nothing of the far side can be seen.
    let near: Vec<([Vec3; 3], &[u32])> = model
        .skin_mesh
        .indices
        .chunks_exact(3)
        .map(|ids| ([place(ids[0]), place(ids[1]), place(ids[2])], ids))
        .filter(|(places, _)| places.iter().any(|place| place.distance(EYE) < 0.06))
        .collect();
    let pixel = |index: u32| {
        let ndc = |pixel: u32| (pixel as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0;
        let along = Vec3::new(ndc(index % SIZE) * extent, -ndc(index / SIZE) * extent, -1.0).normalize();
        let hits = near.iter().filter_map(|(places, ids)| Some((meet(EYE, along, *places)?, *ids)));
        let ((_, weights), ids) = hits.min_by(|(a, _), (b, _)| a.0.total_cmp(&b.0))?;
        let at = |k: usize| &corners[ids[k] as usize];
        let barycentric: Vec3 = (0..3).map(|k| Vec3::from(at(k).tile_barycentric) * weights[k]).sum();
        Some((at(0).texture_triangle as usize, barycentric))
    };
    (0..SIZE * SIZE).map(pixel).collect()
}

/// The linear colours of these places as the CPU samples them.
fn reference(visible: &[Option<(usize, Vec3)>], tiles: &TileSet, choices: &[TileChoice]) -> Vec<Option<Vec3>> {
    let sample = |(triangle, barycentric): (usize, Vec3)| {
        let choice = choices[triangle];
        tiles.sample(choice.tile as usize, rotate_barycentric(barycentric, choice.rotation), 0.0)
    };
    visible.iter().map(|place| place.map(sample)).collect()
}

/// Mean difference over the picture, of 255, in the encoding of the screen.
fn difference(picture: &RgbaImage, reference: &[Option<Vec3>]) -> f32 {
    let encoded = |linear: Vec3| {
        let srgb = Color::linear_rgb(linear.x, linear.y, linear.z).to_srgba();
        Vec3::new(srgb.red, srgb.green, srgb.blue) * 255.0
    };
    let mut sum = 0.0;
    let mut seen = 0;
    for (pixel, wanted) in picture.pixels().zip(reference) {
        if let Some(wanted) = wanted {
            let got = Vec3::new(f32::from(pixel.0[0]), f32::from(pixel.0[1]), f32::from(pixel.0[2]));
            sum += (got - encoded(*wanted)).abs().element_sum() / 3.0;
            seen += 1;
        }
    }
    assert!(seen > (SIZE * SIZE) as usize * 9 / 10, "the sphere fills the picture: {seen} pixels");
    sum / seen as f32
}

#[test]
fn the_gpu_samples_the_tiles_as_the_cpu_does() {
    let model = sphere_organ(RADIUS_M);
    let tiles = TileSet::generate(&options()).expect("sensible options");
    let choices = assign_tiles(&model.texture_mesh.triangulation.neighbours, SEED);
    for turn in [Quat::IDENTITY, Quat::from_rotation_y(1.0), Quat::from_euler(EulerRot::XYZ, 0.5, 2.0, 0.3)] {
        let picture = picture(&model, turn);
        let visible = visible(&model, turn);
        let right = difference(&picture, &reference(&visible, &tiles, &choices));
        assert!(right < 1.0, "the GPU's picture differs by {right} of 255");
        // What a wrong mapping would look like to this test.
        let turned: Vec<TileChoice> =
            choices.iter().map(|choice| TileChoice { rotation: (choice.rotation + 1) % 3, ..*choice }).collect();
        let other: Vec<TileChoice> =
            choices.iter().map(|choice| TileChoice { tile: (choice.tile + 1) % 4, ..*choice }).collect();
        for wrong in [turned, other] {
            let wrong = difference(&picture, &reference(&visible, &tiles, &wrong));
            assert!(wrong > 3.0, "a wrong tile or rotation differs by only {wrong}");
        }
    }
}
