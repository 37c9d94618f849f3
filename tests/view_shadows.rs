//! Shadows of tools against closed forms and their CPU twin.

mod casting;

use crate::support::plain_skin;
use bevy::camera::{Hdr, Projection, RenderTarget, ScalingMode, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_surgery::organ::{ChartKind, SurfaceMesh, procedural_ellipsoid};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::view::{ShadowLens, ToolShadowMaps, shadow_noise};
use image::RgbaImage;
use std::f32::consts::PI;

const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;
const TOOL: [u8; 3] = [0, 0, 255];

/// A flat organ of 20 cm in the plane z = 0, seen from +Z.
fn flat_organ() -> OrganModel {
    const N: u32 = 8;
    let vertices = || (0..=N).flat_map(|y| (0..=N).map(move |x| Vec2::new(x as f32, y as f32) / N as f32));
    let corner = |x: u32, y: u32| y * (N + 1) + x;
    let mesh = SurfaceMesh {
        positions_m: vertices().map(|place| ((place - 0.5) * 0.2).extend(0.0)).collect(),
        triangles: (0..N)
            .flat_map(|y| (0..N).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect(),
        uvs: Some(vertices().map(|place| 0.05 + 0.9 * Vec2::new(place.x, 1.0 - place.y)).collect()),
    };
    let options = OrganOptions { chart: ChartKind::OwnUvs, table_width_px: 64, ..default() };
    OrganModel::from_mesh(mesh, "flat", &options).expect("a square is an organ")
}

struct Scene {
    app: TestApp,
    camera: Entity,
    lamp: Entity,
}

const LAMP: Vec3 = Vec3::new(0.04, 0.03, 0.25);

fn shadows() -> ToolShadows {
    ToolShadows { strength: 0.75, softness_m: 0.004, resolution_px: 512, half_angle_rad: 0.4, near_m: 0.01 }
}

/// The flat organ in even light, a lamp above it and an oblique camera; no tool yet.
fn scene() -> Scene {
    let mut app = TestApp::gpu_with(WIDTH, HEIGHT, |app| {
        app.add_plugins(PbrPlugin::default());
    });
    app.insert_resource(ClearColor(Color::srgb_u8(0, 200, 0)))
        .insert_resource(GlobalAmbientLight { brightness: 1500.0, ..default() });
    let camera = app.spawn_camera(Transform::from_xyz(0.02, -0.15, 0.2).looking_at(Vec3::ZERO, Vec3::Z));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(flat_organ());
    app.world_mut().spawn((Organ(organ), plain_skin([200, 160, 150])));
    let lamp =
        app.world_mut().spawn((shadows(), Transform::from_translation(LAMP).looking_at(Vec3::ZERO, Vec3::Y))).id();
    Scene { app, camera, lamp }
}

impl Scene {
    fn add_tool(&mut self, mesh: impl Into<Mesh>, transform: Transform) -> Entity {
        let mesh = self.app.world_mut().resource_mut::<Assets<Mesh>>().add(mesh.into());
        let [r, g, b] = TOOL;
        let material =
            StandardMaterial { base_color: Color::srgb_u8(r, g, b), unlit: true, cull_mode: None, ..default() };
        let material = self.app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(material);
        self.app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material), transform, ToolShadow)).id()
    }

    /// The picture, and the one without the lamp's shadows.
    fn pictures(&mut self) -> [RgbaImage; 2] {
        let shaded = self.app.capture();
        let off = ToolShadows { strength: 0.0, ..shadows() };
        let on = self.app.world().get::<ToolShadows>(self.lamp).expect("a lamp").clone();
        self.app.world_mut().entity_mut(self.lamp).insert(off);
        let plain = self.app.capture();
        self.app.world_mut().entity_mut(self.lamp).insert(on);
        [shaded, plain]
    }

    fn lens(&mut self) -> ShadowLens {
        let lamp = self.app.world().entity(self.lamp);
        let (shadows, place) = (lamp.get::<ToolShadows>(), lamp.get::<GlobalTransform>());
        shadows.zip(place).and_then(|(shadows, place)| shadows.to_lens(place)).expect("a lamp with a place")
    }

    /// Where the middle of a pixel meets the plane z = 0.
    fn on_plane(&self, x: u32, y: u32) -> Vec3 {
        let entity = self.app.world().entity(self.camera);
        let (camera, place) = (entity.get::<Camera>().expect("a camera"), entity.get::<GlobalTransform>());
        let ray = camera.viewport_to_world(place.expect("placed"), Vec2::new(x as f32, y as f32) + 0.5).expect("a ray");
        ray.origin - *ray.direction * (ray.origin.z / ray.direction.z)
    }

    fn redraws(&self) -> u64 {
        self.app.sub_app(RenderApp).world().resource::<ToolShadowMaps>().redraws()
    }
}

fn linear(srgb: u8) -> f32 {
    Color::srgb_u8(srgb, srgb, srgb).to_linear().red
}

fn is_tool(pixel: &image::Rgba<u8>) -> bool {
    pixel.0[..3] == TOOL
}

fn is_organ(pixel: &image::Rgba<u8>) -> bool {
    pixel.0[0] > pixel.0[1] && pixel.0[1] > pixel.0[2]
}

/// Pixels of the organ whose neighbours are the organ too, with the share of light that shadows left.
fn light_left([shaded, plain]: &[RgbaImage; 2]) -> Vec<(u32, u32, f32)> {
    let is_inside = |x: u32, y: u32| {
        (x.max(1) - 1..=x + 1)
            .all(|x| (y.max(1) - 1..=y + 1).all(|y| plain.get_pixel_checked(x, y).is_some_and(is_organ)))
    };
    let found: Vec<_> = plain
        .enumerate_pixels()
        .filter(|(x, y, _)| is_inside(*x, *y))
        .map(|(x, y, pixel)| (x, y, linear(shaded.get_pixel(x, y).0[0]) / linear(pixel.0[0])))
        .collect();
    assert!(found.len() > 2000, "only {} pixels show the organ", found.len());
    found
}

/// A rectangle as a shadow map sees it: depth where the texel's ray hits it, row by row.
fn map_of_rectangle(lens: &ShadowLens, half_m: Vec2, world_from_tool: Transform) -> Vec<f32> {
    let tool_from_world = world_from_tool.compute_affine().inverse();
    let origin = tool_from_world.transform_point3(lens.world_from_lamp.translation.into());
    let size = lens.resolution_px;
    let depth = |x: u32, y: u32| {
        let direction = lens.direction_world(Vec2::new(x as f32, y as f32) + 0.5);
        let along = tool_from_world.transform_vector3(direction);
        let distance_m = -origin.z / along.z;
        let place = (origin + along * distance_m).truncate();
        let is_border = x.min(y) == 0 || x.max(y) == size - 1;
        let is_hit = distance_m > lens.near_m && place.abs().cmple(half_m).all() && !is_border;
        if is_hit { lens.near_m / distance_m } else { 0.0 }
    };
    (0..size).flat_map(|y| (0..size).map(move |x| (x, y))).map(|(x, y)| depth(x, y)).collect()
}

const RECTANGLE_HALF_M: Vec2 = Vec2::new(0.02, 0.008);

fn rectangle_place() -> Transform {
    Transform::from_xyz(0.01, 0.015, 0.05).with_rotation(Quat::from_euler(EulerRot::XYZ, 0.3, -0.4, 0.5))
}

/// Compares every pixel with the twin: nearly all to a look-up, because texels on an edge may round either way.
fn assert_twin(name: &str, scene: &mut Scene) {
    scene.add_tool(Rectangle::from_size(2.0 * RECTANGLE_HALF_M), rectangle_place());
    let pictures = scene.pictures();
    let lens = scene.lens();
    let map = map_of_rectangle(&lens, RECTANGLE_HALF_M, rectangle_place());
    let (mut half_dark, mut dark, mut off, mut error) = (0, 0, 0, 0.0);
    let pixels = light_left(&pictures);
    for &(x, y, got) in &pixels {
        let occlusion = lens.occlusion(&map, scene.on_plane(x, y), shadow_noise(UVec2::new(x, y)));
        let wanted = lens.light_left(occlusion);
        half_dark += u32::from(occlusion > 0.2 && occlusion < 0.8);
        dark += u32::from(occlusion == 1.0);
        off += u32::from((got - wanted).abs() > 0.015);
        error += (got - wanted).abs();
        assert!((got - wanted).abs() < 0.4, "{name}: pixel {x},{y} has {got} of its light instead of {wanted}");
    }
    assert!(half_dark > 60 && dark > 60, "{name}: {half_dark} pixels lie in the half shadow, {dark} in the core");
    let error = error / pixels.len() as f32;
    assert!(
        off * 100 < pixels.len() as u32 && error < 0.004,
        "{name}: {off} of {} are off, mean {error}",
        pixels.len()
    );
}

#[test]
fn pixels_are_darkened_as_the_twin_says() {
    assert_twin("perspective", &mut scene());
    let mut narrow = scene();
    let far = Transform::from_xyz(0.3, -1.5, 2.0).looking_at(Vec3::ZERO, Vec3::Z);
    let lens = PerspectiveProjection { fov: 0.06, near: 0.01, ..default() };
    narrow.app.world_mut().entity_mut(narrow.camera).insert((far, Projection::Perspective(lens)));
    assert_twin("narrow", &mut narrow);
    let mut flat = scene();
    let scaling_mode = ScalingMode::FixedVertical { viewport_height: 0.15 };
    let lens = OrthographicProjection { scaling_mode, near: 0.0, far: 3.0, ..OrthographicProjection::default_3d() };
    flat.app.world_mut().entity_mut(flat.camera).insert(Projection::Orthographic(lens));
    assert_twin("orthographic", &mut flat);
    let mut hdr = scene();
    hdr.app.world_mut().entity_mut(hdr.camera).insert(Hdr);
    assert_twin("hdr", &mut hdr);
    let mut samples = scene();
    samples.app.world_mut().entity_mut(samples.camera).insert(Msaa::Sample4);
    assert_twin("multisampled", &mut samples);
    let mut moved = scene();
    moved.app.world_mut().entity_mut(moved.lamp).insert(ToolShadows {
        resolution_px: 256,
        softness_m: 0.002,
        ..shadows()
    });
    assert_twin("coarse", &mut moved);
}

#[test]
fn each_half_of_a_target_has_its_own_shadow() {
    let mut scene = scene();
    let viewport =
        |x| Viewport { physical_position: UVec2::new(x, 0), physical_size: UVec2::new(120, 180), ..default() };
    let target = RenderTarget::Image(scene.app.target().image.into());
    for hdr in [false, true] {
        let right = Camera { viewport: Some(viewport(120)), order: 1, ..default() };
        let left = Camera { viewport: Some(viewport(0)), ..default() };
        scene.app.world_mut().entity_mut(scene.camera).insert(right);
        let view = Transform::from_xyz(0.1, -0.1, 0.2).looking_at(Vec3::ZERO, Vec3::Z);
        let other = (Camera3d::default(), left, target.clone(), Tonemapping::None, Msaa::Off, view);
        let other = scene.app.world_mut().spawn(other).id();
        if hdr {
            scene.app.world_mut().entity_mut(scene.camera).insert(Hdr);
            scene.app.world_mut().entity_mut(other).insert(Hdr);
        }
        let tool = scene.add_tool(Rectangle::from_size(2.0 * RECTANGLE_HALF_M), rectangle_place());
        let pictures = scene.pictures();
        let lens = scene.lens();
        let map = map_of_rectangle(&lens, RECTANGLE_HALF_M, rectangle_place());
        let mut dark = [0, 0];
        let right = scene.camera;
        for (x, y, got) in light_left(&pictures) {
            scene.camera = if x < 120 { other } else { right };
            let wanted = lens.light_left(lens.occlusion(&map, scene.on_plane(x, y), shadow_noise(UVec2::new(x, y))));
            assert!((got - wanted).abs() < 0.4, "pixel {x},{y} has {got} instead of {wanted}");
            dark[usize::from(x >= 120)] += u32::from(got < 0.3 && wanted < 0.3);
        }
        scene.camera = right;
        assert!(dark[0] > 30 && dark[1] > 30, "cores of {dark:?} pixels");
        scene.app.world_mut().despawn(other);
        scene.app.world_mut().despawn(tool);
    }
}

/// A ball right under a lamp that looks straight down: its shadow is a disk.
#[test]
fn a_ball_shades_a_disk() {
    let mut scene = scene();
    let (radius_m, height_m, lamp_m) = (0.01_f32, 0.06, 0.2);
    let softness_m = 0.004;
    let lamp = Transform::from_xyz(0.0, 0.03, lamp_m).looking_to(Vec3::NEG_Z, Vec3::Y);
    scene.app.world_mut().entity_mut(scene.lamp).insert((lamp, ToolShadows { softness_m, ..shadows() }));
    let ball = Sphere::new(radius_m).mesh().ico(12).expect("few enough");
    scene.add_tool(ball, Transform::from_xyz(0.0, 0.03, height_m));
    let pictures = scene.pictures();
    // Tangents to the ball from the lamp.
    let distance_m = lamp_m - height_m;
    let disk_m = lamp_m * radius_m / (distance_m * distance_m - radius_m * radius_m).sqrt();
    let (mut centre, mut weight, mut area_m2) = (Vec3::ZERO, 0.0, 0.0);
    let mut fade = [(0.0_f32, 0_u32); 10];
    for (x, y, left) in light_left(&pictures) {
        let occlusion = (1.0 - left) / 0.75;
        let point = scene.on_plane(x, y);
        let step = |dx: u32, dy: u32| scene.on_plane(x + dx, y + dy) - point;
        let pixel_m2 = step(1, 0).cross(step(0, 1)).length();
        let beyond = (point - Vec3::new(0.0, 0.03, 0.0)).length() - disk_m;
        if beyond.abs() > softness_m + 0.0006 {
            let wanted = if beyond < 0.0 { 1.0 } else { 0.0 };
            assert!((occlusion - wanted).abs() < 0.05, "{occlusion} at {beyond} m beyond the rim");
        } else {
            let bin = ((beyond / softness_m + 1.0) * 5.0).clamp(0.0, 9.0) as usize;
            fade[bin] = (fade[bin].0 + occlusion, fade[bin].1 + 1);
        }
        centre += point * (occlusion * pixel_m2);
        weight += occlusion * pixel_m2;
        area_m2 += occlusion * pixel_m2;
    }
    centre /= weight;
    assert!(centre.distance(Vec3::new(0.0, 0.03, 0.0)) < 0.0005, "the middle of the shadow is at {centre}");
    let radius_found_m = (area_m2 / PI).sqrt();
    assert!((radius_found_m / disk_m - 1.0).abs() < 0.03, "{radius_found_m} m instead of {disk_m}");
    for (bin, (sum, count)) in fade.into_iter().enumerate() {
        assert!(count > 10, "{count} pixels in part {bin} of the soft edge");
        let share = (bin as f32 + 0.5) / 5.0 - 1.0;
        let wanted = 0.5 - (share * (1.0 - share * share).sqrt() + share.asin()) / PI;
        // The rim is round, and a little less than half of a disk on it lies inside.
        let got = sum / count as f32;
        assert!((got - wanted).abs() < 0.1, "{got} instead of {wanted} at {share} of the softness");
    }
}

#[test]
fn what_is_lit_keeps_its_bits() {
    let mut scene = scene();
    let bar = scene.add_tool(Cuboid::new(0.006, 0.006, 0.05), Transform::from_xyz(0.0, 0.0, 0.04));
    // A body of tissue between the bar and the lamp.
    let ball = procedural_ellipsoid(Vec3::splat(0.008), 8);
    let options = OrganOptions { table_width_px: 64, ..default() };
    let ball = OrganModel::from_mesh(ball, "ball", &options).expect("an organ");
    let ball = scene.app.world_mut().resource_mut::<Assets<OrganModel>>().add(ball);
    let above = LAMP.lerp(Vec3::new(0.0, 0.0, 0.06), 0.75);
    let view = Transform::from_xyz(0.02, -0.2, 0.3).looking_at(Vec3::new(0.0, 0.0, 0.03), Vec3::Z);
    scene.app.world_mut().entity_mut(scene.camera).insert(view);
    scene.app.world_mut().spawn((Organ(ball), plain_skin([200, 160, 150]), Transform::from_translation(above)));
    let [shaded, plain] = scene.pictures();
    let lens = scene.lens();
    let place_of = |scene: &Scene, point: Vec3| {
        let camera = scene.app.world().entity(scene.camera);
        let (camera, place) = (camera.get::<Camera>().expect("one"), camera.get::<GlobalTransform>().expect("one"));
        camera.world_to_viewport(place, point).expect("in view")
    };
    let (middle, rim) = (place_of(&scene, above), place_of(&scene, above + Vec3::X * 0.008));
    let (mut tool, mut between, mut changed) = (0, 0, 0);
    for (x, y, before) in plain.enumerate_pixels() {
        let after = shaded.get_pixel(x, y);
        let is_between = (Vec2::new(x as f32, y as f32) + 0.5).distance(middle) < middle.distance(rim) - 1.0;
        tool += u32::from(is_tool(before));
        between += u32::from(is_between);
        if is_tool(before) || is_between || !is_organ(before) {
            assert_eq!(before, after, "pixel {x},{y} is tool, background, or above the tool");
        }
        if before != after {
            changed += 1;
            assert!(after.0[0] < before.0[0], "pixel {x},{y} became lighter");
            // Nothing far from the bar's shadow changes.
            let place = lens.place(scene.on_plane(x, y)).expect("before the lamp");
            assert!((place.texel - 256.0).abs().max_element() < 200.0, "{place:?}");
        }
    }
    assert!(tool > 60 && between > 60 && changed > 100, "{tool} of the tool, {between} above it, {changed} darker");
    scene.app.world_mut().entity_mut(bar).insert(Visibility::Hidden);
    let [shaded, plain] = scene.pictures();
    assert!(shaded == plain, "a hidden tool casts nothing");
}

/// A post that stands in the tissue: its shadow begins where it enters.
#[test]
fn shadows_begin_where_a_tool_touches() {
    let mut scene = scene();
    let lamp = Transform::from_xyz(0.15, 0.0, 0.15).looking_at(Vec3::ZERO, Vec3::Z);
    let softness_m = 0.0008;
    scene.app.world_mut().entity_mut(scene.lamp).insert((lamp, ToolShadows { softness_m, ..shadows() }));
    // From the side, so that the shadow to the left of the post is seen right up to it.
    let view = Transform::from_xyz(-0.004, -0.03, 0.05).looking_at(Vec3::new(-0.004, 0.0, 0.0), Vec3::Z);
    scene.app.world_mut().entity_mut(scene.camera).insert(view);
    scene.add_tool(Cuboid::new(0.004, 0.012, 0.02), Transform::from_xyz(0.0, 0.0, 0.008));
    let [shaded, plain] = scene.app_pictures_near();
    let (mut near, mut lit) = (0, 0);
    for (x, y, before) in plain.enumerate_pixels() {
        let point = scene.on_plane(x, y);
        if is_tool(before) || point.y.abs() > 0.0045 {
            continue;
        }
        let left = linear(shaded.get_pixel(x, y).0[0]) / linear(before.0[0]);
        let occlusion = (1.0 - left) / 0.75;
        // The post's left face is at -2 mm, its top casts at 18 mm farther left.
        let gap_m = -0.002 - point.x;
        if gap_m > 0.0 && gap_m < 0.014 {
            assert!(occlusion > 0.45, "light leaks in {gap_m} m behind the post: {occlusion}");
            assert!(gap_m < softness_m || occlusion > 0.99, "{occlusion} at {gap_m} m behind the post");
            near += u32::from(gap_m < 0.001);
        } else if point.x > 0.002 + 2.0 * softness_m {
            assert!(occlusion < 0.01, "a shadow of {occlusion} on the side of the lamp at {point}");
            lit += 1;
        }
    }
    assert!(near > 20 && lit > 200, "{near} pixels at the foot, {lit} in the light");
}

impl Scene {
    /// As `pictures`, from close by.
    fn app_pictures_near(&mut self) -> [RgbaImage; 2] {
        let lens = PerspectiveProjection { near: 0.001, ..default() };
        self.app.world_mut().entity_mut(self.camera).insert(Projection::Perspective(lens));
        self.pictures()
    }
}

fn darker([shaded, plain]: &[RgbaImage; 2]) -> usize {
    shaded.pixels().zip(plain.pixels()).filter(|(a, b)| a.0[0] < b.0[0]).count()
}

#[test]
fn shadows_end_with_the_cone() {
    let mut scene = scene();
    // Wider than the cone's 20 mm at the organ, so that the map is full.
    scene.add_tool(Cuboid::new(0.1, 0.1, 0.002), Transform::from_xyz(0.0, 0.0, 0.01));
    let lamp = Transform::from_xyz(0.0, 0.0, 0.2).looking_to(Vec3::NEG_Z, Vec3::Y);
    let half_angle_rad = 0.05_f32.atan();
    scene
        .app
        .world_mut()
        .entity_mut(scene.lamp)
        .insert((lamp, ToolShadows { half_angle_rad, softness_m: 2e-4, ..shadows() }));
    // From below nothing hides the organ; it is drawn from both sides.
    let view = Transform::from_xyz(0.0, 0.0, -0.1).looking_at(Vec3::ZERO, Vec3::Y);
    scene.app.world_mut().entity_mut(scene.camera).insert(view);
    let (mut dark, mut lit) = (0, 0);
    let pictures = scene.app_pictures_near();
    for (x, y, left) in light_left(&pictures) {
        let beyond = scene.on_plane(x, y).truncate().abs().max_element() - 0.01;
        if beyond.abs() > 5e-4 {
            assert!(((1.0 - left) / 0.75 - f32::from(u8::from(beyond < 0.0))).abs() < 0.02, "{left} at {beyond}");
            (dark, lit) = (dark + u32::from(beyond < 0.0), lit + u32::from(beyond > 0.0));
        }
    }
    assert!(dark > 300 && lit > 300, "{dark} in the cone, {lit} beyond");
}
