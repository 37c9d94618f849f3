//! The skin pass against closed forms, and beside the rest of a Bevy scene.

mod elastic;

use crate::support::{plain_skin, real_file, sphere_mesh, sphere_organ};
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Exposure, Hdr, RenderTarget, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::organ::ChartKind;
use bevy_surgery::organ::clean::{Topology, Weld};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::procedural::{ProceduralLiver, procedural_liver};
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::prelude::*;
use bevy_surgery::render::{LightUniform, MAX_SCENE_LIGHTS, SceneLight, SceneLights, strongest_lights};
use bevy_surgery::skin::TileSource;
use bevy_surgery::skin::tiles::{TileOptions, TileSet};
use bevy_surgery::testing::TestApp;
use image::RgbaImage;
use std::f32::consts::PI;

const SIZE: u32 = 96;
const RADIUS_M: f32 = 0.1;
const ALBEDO: [u8; 3] = [200, 120, 90];
const EYE: Vec3 = Vec3::new(0.0, 0.0, 0.4);

fn linear(srgb: u8) -> f32 {
    Color::srgb_u8(srgb, srgb, srgb).to_linear().red
}

/// An app with a plain sphere and a camera 40 cm in front of it, without any light.
fn sphere_app() -> (TestApp, Entity) {
    let mut app = TestApp::gpu_with(SIZE, SIZE, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    app.insert_resource(ClearColor(Color::srgb_u8(0, 0, 255))).insert_resource(GlobalAmbientLight::NONE);
    app.spawn_camera(Transform::from_translation(EYE));
    let organ = add_organ(&mut app, sphere_organ(RADIUS_M));
    (app, organ)
}

fn add_organ(app: &mut TestApp, model: OrganModel) -> Entity {
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
    app.world_mut().spawn((Organ(organ), plain_skin(ALBEDO))).id()
}

/// Direction into the scene through the centre of a pixel.
fn ray(x: u32, y: u32) -> Vec3 {
    let extent = (PI / 8.0).tan();
    let ndc = |pixel: u32| (pixel as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0;
    Vec3::new(ndc(x) * extent, -ndc(y) * extent, -1.0).normalize()
}

/// Where a ray from the eye meets an ellipsoid about the origin, with the unit normal there.
fn hit(direction: Vec3, axes: Vec3) -> Option<(Vec3, Vec3)> {
    let (origin, along) = (EYE / axes, direction / axes);
    let (a, b, c) = (along.length_squared(), origin.dot(along), origin.length_squared() - 1.0);
    let discriminant = b * b - a * c;
    let distance = (-b - discriminant.max(0.0).sqrt()) / a;
    let point = EYE + direction * distance;
    (discriminant > 0.0).then(|| (point, (point / (axes * axes)).normalize()))
}

/// Compares a picture of an ellipsoid with Lambert's law under a light; the ambient share comes from all sides.
fn assert_lambert(picture: &RgbaImage, light: &LightUniform, axes: Vec3) {
    let exposure = Exposure::default().exposure();
    let mut seen = 0;
    for (x, y, pixel) in picture.enumerate_pixels() {
        let Some((point, normal)) = hit(ray(x, y), axes) else { continue };
        // At the rim the polygon is not the sphere.
        if normal.dot(EYE - point) < 0.35 * (EYE - point).length() {
            continue;
        }
        let to_light = match light.kind {
            LightUniform::DIRECTIONAL => -light.direction_world,
            _ => (light.position_world_m - point).normalize(),
        };
        let cosine = normal.dot(to_light).max(0.0) + light.ambient_fraction;
        for (channel, albedo) in ALBEDO.into_iter().enumerate() {
            let lux = light.illuminance_lux(point)[channel];
            let facing = linear(albedo) / PI * lux * exposure;
            let wanted = (facing * cosine).min(1.0);
            let got = linear(pixel.0[channel]);
            assert!(
                // The polygon's normals are off by up to a degree or so, 8 bits by half a step.
                (got - wanted).abs() < 0.02 * wanted + 0.02 * facing + 0.004,
                "pixel {x},{y} channel {channel}: {got} instead of {wanted}"
            );
            seen += u32::from(wanted > 0.05 && wanted < 1.0);
        }
    }
    assert!(seen > 300, "only {seen} values were neither dark nor burnt out: this test sees nothing");
}

#[test]
fn a_directional_light_follows_lambert() {
    let (mut app, _) = sphere_app();
    let sun = Transform::from_xyz(1.0, 1.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y);
    app.world_mut().spawn((DirectionalLight { illuminance: 4000.0, ..default() }, sun));
    let light = LightUniform {
        colour: Vec3::splat(4000.0),
        kind: LightUniform::DIRECTIONAL,
        direction_world: sun.forward().into(),
        ..default()
    };
    assert_lambert(&app.capture(), &light, Vec3::splat(RADIUS_M));
}

#[test]
fn a_point_light_falls_off_with_the_square() {
    let (mut app, _) = sphere_app();
    let bulb = PointLight { color: Color::srgb(1.0, 0.8, 0.6), intensity: 1000.0, range: 20.0, ..default() };
    let at = Transform::from_xyz(0.12, 0.1, 0.25);
    app.world_mut().spawn((bulb, at));
    let light = LightUniform {
        colour: bulb.color.to_linear().to_vec3() * 1000.0 / (4.0 * PI),
        kind: LightUniform::POINT,
        position_world_m: at.translation,
        inverse_range_squared: 1.0 / 400.0,
        ..default()
    };
    assert_lambert(&app.capture(), &light, Vec3::splat(RADIUS_M));
}

#[test]
fn a_spot_light_keeps_to_its_cone() {
    let (mut app, _) = sphere_app();
    let lamp = SpotLight { intensity: 1600.0, range: 20.0, inner_angle: 0.05, outer_angle: 0.35, ..default() };
    let at = Transform::from_xyz(0.0, 0.15, 0.35).looking_at(Vec3::new(0.0, 0.03, 0.09), Vec3::Y);
    app.world_mut().spawn((lamp, at));
    let (cone_scale, cone_offset) = LightUniform::cone(0.05, 0.35);
    let light = LightUniform {
        colour: Vec3::splat(1600.0 / (4.0 * PI)),
        kind: LightUniform::SPOT,
        position_world_m: at.translation,
        inverse_range_squared: 1.0 / 400.0,
        direction_world: at.forward().into(),
        cone_scale,
        cone_offset,
        ..default()
    };
    assert_lambert(&app.capture(), &light, Vec3::splat(RADIUS_M));
}

#[test]
fn the_scope_light_fills_the_cavity() {
    let (mut app, _) = sphere_app();
    let scope = ScopeLight { intensity_cd: 120.0, ring_radius_m: 0.02, ..default() };
    let at = Transform::from_xyz(0.05, 0.05, 0.3).looking_at(Vec3::ZERO, Vec3::Y);
    let light = scope.to_uniform(&at.into());
    app.world_mut().spawn((scope, at));
    assert!(light.ambient_fraction > 0.0);
    assert_lambert(&app.capture(), &light, Vec3::splat(RADIUS_M));
}

#[test]
fn normals_are_right_under_any_transform() {
    for scale in [Vec3::new(1.0, 0.4, 0.7), Vec3::new(-0.8, 1.1, 0.5)] {
        let (mut app, organ) = sphere_app();
        app.world_mut().entity_mut(organ).insert(Transform::from_scale(scale));
        let sun = Transform::from_xyz(-1.0, 2.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y);
        app.world_mut().spawn((DirectionalLight { illuminance: 4000.0, ..default() }, sun));
        let light = LightUniform {
            colour: Vec3::splat(4000.0),
            kind: LightUniform::DIRECTIONAL,
            direction_world: sun.forward().into(),
            ..default()
        };
        assert_lambert(&app.capture(), &light, scale.abs() * RADIUS_M);
    }
}

/// A light that shows everything from the front.
fn flood(app: &mut TestApp) {
    let front = Transform::from_translation(Vec3::Z).looking_at(Vec3::ZERO, Vec3::Y);
    app.world_mut().spawn((DirectionalLight { illuminance: 4000.0, ..default() }, front));
}

fn is_blue(pixel: [u8; 4]) -> bool {
    pixel == [0, 0, 255, 255]
}

/// Whether a pixel shows the plain skin: its red outweighs its green, which outweighs its blue.
fn is_skin(pixel: [u8; 4]) -> bool {
    pixel[0] > pixel[1] && pixel[1] > pixel[2]
}

#[test]
fn depth_agrees_with_the_rest_of_the_scene() {
    for (z, is_hidden) in [(0.2, true), (-0.2, false)] {
        let (mut app, _) = sphere_app();
        flood(&mut app);
        let cube = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.04));
        let green = StandardMaterial { base_color: Color::srgb_u8(0, 255, 0), unlit: true, ..default() };
        let green = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(green);
        app.world_mut().spawn((Mesh3d(cube), MeshMaterial3d(green), Transform::from_xyz(0.0, 0.0, z)));
        let centre = app.capture().get_pixel(SIZE / 2, SIZE / 2).0;
        assert_eq!(centre == [0, 255, 0, 255], is_hidden, "cube at {z}: {centre:?}");
        assert_eq!(is_skin(centre), !is_hidden, "cube at {z}: {centre:?}");
    }
}

#[test]
fn transparent_things_blend_over_the_skin() {
    let (mut app, _) = sphere_app();
    flood(&mut app);
    let plain = app.capture().get_pixel(SIZE / 2, SIZE / 2).0;
    let pane = app.world_mut().resource_mut::<Assets<Mesh>>().add(Rectangle::new(0.05, 0.05));
    let glass = StandardMaterial {
        base_color: Color::srgba(0.0, 1.0, 0.0, 0.5),
        alpha_mode: AlphaMode::Blend,
        unlit: true,
        ..default()
    };
    let glass = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(glass);
    app.world_mut().spawn((Mesh3d(pane), MeshMaterial3d(glass), Transform::from_xyz(0.0, 0.0, 0.15)));
    let tinted = app.capture().get_pixel(SIZE / 2, SIZE / 2).0;
    assert!(tinted[1] > plain[1] && tinted[0] < plain[0] && tinted[0] > 20, "{plain:?} became {tinted:?}");
}

#[test]
fn multisampling_smooths_the_rim_and_nothing_else() {
    let pictures = [Msaa::Off, Msaa::Sample4].map(|msaa| {
        let (mut app, _) = sphere_app();
        flood(&mut app);
        let mut cameras = app.world_mut().query_filtered::<Entity, With<Camera3d>>();
        let camera = cameras.single(app.world()).expect("one camera");
        app.world_mut().entity_mut(camera).insert(msaa);
        app.capture()
    });
    let [plain, smooth] = &pictures;
    assert_ne!(plain, smooth);
    for (x, y, pixel) in plain.enumerate_pixels() {
        let is_rim = (-1..=1).any(|dx| {
            (-1..=1).any(|dy| {
                let neighbour = plain.get_pixel_checked((x as i32 + dx) as u32, (y as i32 + dy) as u32);
                neighbour.is_some_and(|neighbour| is_blue(neighbour.0) != is_blue(pixel.0))
            })
        });
        let difference = (0..3).map(|k| pixel.0[k].abs_diff(smooth.get_pixel(x, y).0[k])).max();
        assert!(is_rim || difference <= Some(2), "pixel {x},{y} differs by {difference:?}");
    }
}

#[test]
fn two_cameras_and_two_organs_share_a_frame() {
    let mut app = TestApp::gpu(64, 32);
    app.insert_resource(ClearColor(Color::srgb_u8(0, 0, 255))).insert_resource(GlobalAmbientLight::NONE);
    flood(&mut app);
    let model = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    app.world_mut().spawn((Organ(model.clone()), plain_skin([200, 120, 90])));
    let aside = Transform::from_xyz(1.0, 0.0, 0.0);
    app.world_mut().spawn((Organ(model), plain_skin([90, 200, 120]), aside, RenderLayers::layer(1)));
    let target = RenderTarget::Image(app.target().image.into());
    for (side, x) in [(0u32, 0.0), (1, 1.0)] {
        let viewport =
            Viewport { physical_position: UVec2::new(32 * side, 0), physical_size: UVec2::splat(32), ..default() };
        app.world_mut().spawn((
            Camera3d::default(),
            Camera { order: side as isize, viewport: Some(viewport), ..default() },
            target.clone(),
            Tonemapping::None,
            Msaa::Off,
            RenderLayers::layer(side as usize),
            Transform::from_xyz(x, 0.0, 0.4),
        ));
    }
    let picture = app.capture();
    let (left, right) = (picture.get_pixel(16, 16).0, picture.get_pixel(48, 16).0);
    assert!(is_skin(left), "the first camera sees the first organ: {left:?}");
    // The flood light is on layer 0 and does not reach the organ on layer 1.
    assert_eq!(right[..3], [0, 0, 0], "the second organ is on a layer without light");
    assert!(is_blue(picture.get_pixel(33, 1).0));
}

#[test]
fn hidden_and_despawned_organs_are_not_drawn() {
    let (mut app, organ) = sphere_app();
    flood(&mut app);
    assert!(is_skin(app.capture().get_pixel(SIZE / 2, SIZE / 2).0));
    app.world_mut().entity_mut(organ).insert(Visibility::Hidden);
    assert!(is_blue(app.capture().get_pixel(SIZE / 2, SIZE / 2).0));
    app.world_mut().entity_mut(organ).insert(Visibility::Visible);
    assert!(is_skin(app.capture().get_pixel(SIZE / 2, SIZE / 2).0));
    app.world_mut().entity_mut(organ).despawn();
    assert!(is_blue(app.capture().get_pixel(SIZE / 2, SIZE / 2).0));
}

#[test]
fn moved_vertices_are_seen() {
    let (mut app, organ) = sphere_app();
    flood(&mut app);
    let wide = |picture: &RgbaImage| (0..SIZE).filter(|x| !is_blue(picture.get_pixel(*x, SIZE / 2).0)).count();
    let before = wide(&app.capture());
    let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shaped organ");
    shape.move_vertices().iter_mut().for_each(|position| position.x *= 0.5);
    app.step(1);
    let after = wide(&app.capture());
    assert!(after.abs_diff(before / 2) <= 2, "half as wide: {before} became {after}");
}

#[test]
fn ambient_light_shows_the_shade() {
    let (mut app, _) = sphere_app();
    app.insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() });
    let pixel = app.capture().get_pixel(SIZE / 2, SIZE / 2).0;
    let wanted = linear(ALBEDO[0]) * 400.0 * Exposure::default().exposure();
    assert!((linear(pixel[0]) - wanted).abs() < 0.01, "{} instead of {wanted}", linear(pixel[0]));
}

#[test]
fn what_is_brighter_than_white_is_tonemapped_with_and_without_hdr() {
    // With HDR Bevy tonemaps the finished picture; without, the skin's shader does.
    for is_hdr in [true, false] {
        let (mut app, _) = sphere_app();
        let mut cameras = app.world_mut().query_filtered::<Entity, With<Camera3d>>();
        let camera = cameras.single(app.world()).expect("one camera");
        app.world_mut().entity_mut(camera).insert(Tonemapping::Reinhard);
        if is_hdr {
            app.world_mut().entity_mut(camera).insert(Hdr);
        }
        let front = Transform::from_translation(Vec3::Z).looking_at(Vec3::ZERO, Vec3::Y);
        app.world_mut().spawn((DirectionalLight { illuminance: 60_000.0, ..default() }, front));
        let red = app.capture().get_pixel(SIZE / 2, SIZE / 2).0[0];
        let radiance = linear(ALBEDO[0]) / PI * 60_000.0 * Exposure::default().exposure();
        assert!(radiance > 2.0);
        // Reinhard: c / (1 + c). A clamped picture would give one, or one half.
        assert!((linear(red) - radiance / (1.0 + radiance)).abs() < 0.03, "{} of {radiance}", linear(red));
    }
}

#[test]
fn the_strongest_lights_are_chosen() {
    let point = |place: u32, candela: f32| SceneLight {
        light: LightUniform {
            colour: Vec3::splat(candela),
            kind: LightUniform::POINT,
            position_world_m: Vec3::X,
            ..default()
        },
        layers: RenderLayers::default(),
        entity: Entity::from_raw_u32(place).expect("a small number"),
    };
    let mut scene = SceneLights { lights: (1..=12).map(|k| point(k, k as f32)).collect(), ambient: Vec3::ONE };
    scene.lights[0].light.kind = LightUniform::RING;
    scene.lights[0].light.direction_world = Vec3::NEG_X;
    scene.lights[0].light.cone_offset = 1.0;
    let chosen = strongest_lights(&scene, Vec3::ZERO, &RenderLayers::default());
    assert_eq!(chosen.count as usize, 1 + MAX_SCENE_LIGHTS);
    assert_eq!(chosen.lights[0].kind, LightUniform::RING, "an endoscope always counts");
    let kept: Vec<f32> = chosen.lights[1..9].iter().map(|light| light.colour.x).collect();
    assert_eq!(kept, [12.0, 11.0, 10.0, 9.0, 8.0, 7.0, 6.0, 5.0]);
    let elsewhere = strongest_lights(&scene, Vec3::ZERO, &RenderLayers::layer(3));
    assert_eq!(elsewhere.count, 0);
}

#[test]
fn the_gpu_places_secondary_vertices_where_the_cpu_does() {
    // Two organs of one surface: coarse and fine texture triangles. Secondary vertices lie on the same surface, so
    // the pictures agree; a wrong combination would tear it.
    let pictures = [0.04, 0.1].map(|edge_length_m| {
        let (mut app, organ) = sphere_app();
        app.world_mut().entity_mut(organ).despawn();
        flood(&mut app);
        let texture_mesh = TextureMeshOptions { edge_length_m: Some(edge_length_m), iterations: 5, ..default() };
        let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
        let model = OrganModel::from_mesh(sphere_mesh(RADIUS_M, 2), "sphere", &options).expect("an organ");
        let organ = add_organ(&mut app, model);
        app.warm_up();
        let mut shape = app.world_mut().get_mut::<OrganShape>(organ).expect("a shaped organ");
        for position in shape.move_vertices() {
            *position = Vec3::new(position.x * 1.2, position.y + 0.3 * position.x, position.z * 0.8);
        }
        app.step(1);
        app.capture()
    });
    let worst =
        pictures[0].pixels().zip(pictures[1].pixels()).filter(|(a, b)| (0..3).any(|k| a.0[k].abs_diff(b.0[k]) > 3));
    assert!(worst.count() <= 4, "the skin changed the shape");
}

#[test]
fn painted_tiles_look_like_the_generated_ones_they_were_saved_from() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let options = TileOptions { resolution_px: 128, cells_per_edge: 8.0, ..TileOptions::liver() };
    let tiles = TileSet::generate(&options).expect("sensible options");
    let files = tiles.save_png(folder.path(), "skin").expect("a folder of ours");
    let painted = TileSource::Painted(files.map(|file| file.to_string_lossy().to_string()));
    let pictures = [TileSource::Generated(options), painted].map(|tiles| {
        let (mut app, organ) = sphere_app();
        flood(&mut app);
        app.world_mut().entity_mut(organ).insert(Skin { tiles, ..Skin::liver() });
        app.capture()
    });
    assert_eq!(pictures[0], pictures[1]);
}

#[test]
fn changing_a_skin_is_seen() {
    let (mut app, organ) = sphere_app();
    flood(&mut app);
    let before = app.capture();
    app.world_mut().entity_mut(organ).insert(plain_skin([40, 180, 60]));
    let centre = app.capture().get_pixel(SIZE / 2, SIZE / 2).0;
    assert!(centre[1] > centre[0], "other tiles: {centre:?}");
    app.world_mut().entity_mut(organ).insert(plain_skin(ALBEDO));
    assert_eq!(app.capture(), before, "and back again");
    app.world_mut().get_mut::<Skin>(organ).expect("a skin").tint = Color::linear_rgb(0.5, 0.5, 0.5);
    let dimmed = app.capture();
    let [full, half] = [&before, &dimmed].map(|picture| linear(picture.get_pixel(SIZE / 2, SIZE / 2).0[0]));
    assert!((half - 0.5 * full).abs() < 0.01, "{full} became {half}");
}

#[test]
fn an_open_organ_with_its_own_coordinates_shows_both_sides() {
    let Some(file) = real_file("mesh/spleen-parts.glb") else { return };
    for turn in [0.0, PI] {
        let (mut app, organ) = sphere_app();
        app.world_mut().entity_mut(organ).despawn();
        let load = LoadOptions {
            unit: MeshUnit::LargestExtent(0.25),
            node: Some("VH_M_diaphragmatic_surface_of_spleen".into()),
            weld: Weld::ByPositionAndUv,
            topology: Topology::Any,
        };
        let options = OrganOptions { load, chart: ChartKind::OwnUvs, ..default() }.centred();
        let handle = app
            .world()
            .resource::<AssetServer>()
            .load_builder()
            .with_settings(move |settings: &mut OrganOptions| *settings = options.clone())
            .override_unapproved()
            .load(file.clone());
        let turned = Transform::from_rotation(Quat::from_rotation_y(turn));
        app.world_mut().spawn((Organ(handle), plain_skin(ALBEDO), turned));
        app.insert_resource(GlobalAmbientLight { brightness: 400.0, ..default() });
        let picture = app.capture();
        let seen = picture.pixels().filter(|pixel| is_skin(pixel.0)).count();
        assert!(seen > 800, "turned by {turn} the surface covers {seen} pixels");
    }
}

/// Golden pictures are made by running with `BEVY_SURGERY_BLESS=1`; look at them before keeping them.
#[test]
fn the_liver_looks_as_it_did() {
    let mut app = TestApp::gpu(96, 72);
    app.insert_resource(ClearColor(Color::srgb_u8(30, 34, 40)));
    let options = OrganOptions { table_width_px: 64, ..default() };
    let mesh = procedural_liver(&ProceduralLiver::default());
    let model = OrganModel::from_mesh(mesh, "liver", &options).expect("the crate's own liver");
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
    app.world_mut().spawn((Organ(organ), Skin::liver()));
    let target = RenderTarget::Image(app.target().image.into());
    let view = Transform::from_xyz(0.0, 0.1, 0.2).looking_at(Vec3::ZERO, Vec3::Y);
    app.world_mut().spawn((Endoscope::default(), target, view));
    let picture = app.capture();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/liver.png");
    if std::env::var_os("BEVY_SURGERY_BLESS").is_some() {
        picture.save(file).expect("a folder of the crate");
    }
    let golden = image::open(file).expect("a golden picture").to_rgba8();
    let difference = mean_difference(&picture, &golden);
    // Drivers round differently; a wrong light, colour, shape or pattern differs by far more.
    if difference > 0.7 {
        let seen = std::env::temp_dir().join("bevy_surgery-liver-seen.png");
        let _ = picture.save(&seen);
        panic!("the picture differs by {difference} of 255 on average; see {}", seen.display());
    }
    let mut darker = golden.clone();
    darker.pixels_mut().for_each(|pixel| pixel.0[0] = (f32::from(pixel.0[0]) * 0.9) as u8);
    assert!(mean_difference(&darker, &golden) > 0.7, "a tenth less red would pass");
}

fn mean_difference(a: &RgbaImage, b: &RgbaImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: u64 = a.iter().zip(b.iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / (f64::from(a.width()) * f64::from(a.height()) * 3.0)
}
