//! The highlight passes against closed forms.

mod beside;
mod elastic;

use crate::support::{plain_skin, sphere_organ};
use bevy::asset::RenderAssetUsages;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Exposure, Hdr, PerspectiveProjection, Projection, RenderTarget, Viewport};
use bevy::core_pipeline::schedule::Core3d;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendState, Extent3d, PipelineCache,
    TextureDataOrder, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::MainEntity;
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy_surgery::highlights::highlight_radiance;
use bevy_surgery::highlights::profile::{RingProfile, ring_tilt_rad};
use bevy_surgery::organ::render::{
    OrganDraw, OrganGloss, OrganLayer, OrganLayerView, OrganLayouts, prepare_layer_pipelines,
};
use bevy_surgery::organ::surface::NEUTRAL_GLOSS;
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::prelude::*;
use bevy_surgery::render::{LightUniform, Uploads};
use bevy_surgery::testing::TestApp;
use std::f32::consts::{PI, TAU};
use std::sync::{Arc, Mutex};

/// Width and height of the pictures: rows of 16-bit RGBA are then whole multiples of 256 bytes.
const SIZE: u32 = 256;
const RADIUS_M: f32 = 0.1;

/// A scene of linear radiance: a black organ with highlights and nothing else to see.
struct Scene {
    app: TestApp,
    organ: Entity,
    scope: Entity,
    image: Handle<Image>,
    eye: Transform,
    field_of_view_rad: f32,
}

/// A lamp that shines everywhere alike.
fn lamp(ring_radius_m: f32) -> ScopeLight {
    ScopeLight { ring_radius_m, inner_angle_rad: 1.2, outer_angle_rad: 1.5, ambient_fraction: 0.0, ..default() }
}

/// Highlights of one roughness, without grain.
fn smooth(roughness: f32) -> Highlights {
    Highlights { dry_roughness: roughness, wet_roughness: roughness, grain_tilt: 0.0, ..default() }
}

fn fine_sphere(radius_m: f32) -> OrganModel {
    let texture_mesh = TextureMeshOptions { iterations: 3, tile_sweeps: 1, ..default() };
    let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
    OrganModel::from_mesh(procedural_ellipsoid(Vec3::splat(radius_m), 36), "sphere", &options).expect("an organ")
}

impl Scene {
    fn new(model: OrganModel, highlights: Highlights, light: ScopeLight, eye: Transform, view_rad: f32) -> Self {
        let mut app = TestApp::gpu_with(16, 16, |app| {
            app.add_plugins(PbrPlugin::default());
        });
        app.insert_resource(ClearColor(Color::BLACK)).insert_resource(GlobalAmbientLight::NONE);
        let mut image = Image::new_target_texture(SIZE, SIZE, TextureFormat::Rgba16Float, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        image.asset_usage = RenderAssetUsages::default();
        let image = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let lens = PerspectiveProjection { fov: view_rad, near: 0.001, ..default() };
        let scope = app
            .world_mut()
            .spawn((
                Camera3d::default(),
                Hdr,
                Projection::Perspective(lens),
                RenderTarget::Image(image.clone().into()),
                Tonemapping::None,
                Msaa::Off,
                eye,
                light,
            ))
            .id();
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model);
        let organ = app.world_mut().spawn((Organ(organ), plain_skin([0, 0, 0]), highlights)).id();
        Self { app, organ, scope, image, eye, field_of_view_rad: view_rad }
    }

    fn look(&mut self, eye: Transform, field_of_view_rad: f32) {
        (self.eye, self.field_of_view_rad) = (eye, field_of_view_rad);
        let lens = PerspectiveProjection { fov: field_of_view_rad, near: 0.001, ..default() };
        self.app.world_mut().entity_mut(self.scope).insert((eye, Projection::Perspective(lens)));
    }

    fn highlights(&mut self, highlights: Highlights) {
        self.app.world_mut().entity_mut(self.organ).insert(highlights);
    }

    fn light(&self) -> LightUniform {
        self.app.world().get::<ScopeLight>(self.scope).expect("a scope").to_uniform(&self.eye.into())
    }

    /// Radiance of each pixel, row by row.
    fn picture(&mut self) -> Vec<Vec3> {
        self.app.warm_up();
        let taken: Arc<Mutex<Option<Vec<u8>>>> = default();
        let slot = taken.clone();
        let reader = self.app.world_mut().spawn(Readback::texture(self.image.clone()));
        let reader = reader.id();
        self.app.world_mut().entity_mut(reader).observe(move |read: On<ReadbackComplete>| {
            *slot.lock().expect("only this closure locks it") = Some(read.data.clone());
        });
        let mut bytes = None;
        self.app.idle_until("a readback", |_| {
            bytes = taken.lock().expect("only the observer locks it").take();
            bytes.is_some()
        });
        self.app.world_mut().entity_mut(reader).despawn();
        let exposure = Exposure::default().exposure();
        let halves: Vec<f32> = bytes
            .expect("waited for")
            .as_chunks::<2>()
            .0
            .iter()
            .map(|half| half_value(u16::from_le_bytes(*half)))
            .collect();
        let pixels: Vec<Vec3> =
            halves.as_chunks::<4>().0.iter().map(|p| Vec3::new(p[0], p[1], p[2]) / exposure).collect();
        assert_eq!(pixels.len() as u32, SIZE * SIZE);
        assert!(pixels.iter().all(|pixel| pixel.is_finite()), "a pixel is not finite");
        pixels
    }

    /// Direction through a place of the picture, in pixels, in the world.
    fn ray(&self, x: f32, y: f32) -> Vec3 {
        let extent = (0.5 * self.field_of_view_rad).tan();
        let ndc = |pixel: f32| pixel / SIZE as f32 * 2.0 - 1.0;
        self.eye.rotation * Vec3::new(ndc(x) * extent, -ndc(y) * extent, -1.0).normalize()
    }

    /// Where a point of the world is in the picture, in pixels.
    fn place(&self, point_m: Vec3) -> Vec2 {
        let seen = self.eye.rotation.inverse() * (point_m - self.eye.translation);
        let extent = (0.5 * self.field_of_view_rad).tan();
        let ndc = Vec2::new(seen.x, -seen.y) / (-seen.z * extent);
        (ndc + 1.0) * 0.5 * SIZE as f32
    }

    /// Where a ray meets a sphere about the origin, and the normal there.
    fn hit(&self, direction: Vec3, radius_m: f32) -> Option<(Vec3, Vec3)> {
        let eye = self.eye.translation;
        let along = eye.dot(direction);
        let discriminant = along * along - eye.length_squared() + radius_m * radius_m;
        let point = eye + direction * (-along - discriminant.max(0.0).sqrt());
        (discriminant > 0.0).then(|| (point, point.normalize()))
    }

    /// Gives the organ a gloss map.
    fn gloss(&mut self, width: u32, height: u32, texels: &[u8]) {
        self.app.warm_up();
        let organ = MainEntity::from(self.organ);
        let render = self.app.sub_app_mut(RenderApp).world_mut();
        let (device, queue) = (render.resource::<RenderDevice>(), render.resource::<RenderQueue>());
        let texture = device.create_texture_with_data(
            queue,
            &TextureDescriptor {
                label: Some("test_gloss"),
                size: Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: TextureFormat::R8Unorm,
                usage: TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            TextureDataOrder::LayerMajor,
            texels,
        );
        let view = texture.create_view(&default());
        render.resource_mut::<OrganGloss>().maps.insert(organ, view);
    }
}

fn half_value(bits: u16) -> f32 {
    let magnitude = f32::from_bits(u32::from(bits & 0x7fff) << 13) * 2_f32.powi(112);
    // Infinities and what is not a number have the highest exponent.
    if bits & 0x7c00 == 0x7c00 { f32::NAN } else { magnitude }
}

fn at(z: f32) -> Transform {
    Transform::from_xyz(0.0, 0.0, z)
}

/// Where the bright pixels are.
fn total(picture: &[Vec3]) -> f32 {
    picture.iter().map(|pixel| pixel.x).sum()
}

/// The circle and the deviation of a ring convolved with a Gaussian, from its moments about the middle:
/// `m2 = t0^2 + 2 s^2` and `m4 = t0^4 + 8 t0^2 s^2 + 8 s^4`.
fn circle_and_deviation(samples: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (mut m0, mut m2, mut m4) = (0.0, 0.0, 0.0);
    for (tilt, weight) in samples {
        m0 += weight;
        m2 += weight * tilt.powi(2);
        m4 += weight * tilt.powi(4);
    }
    let (m2, m4) = (m2 / m0, m4 / m0);
    let circle = (2.0 * m2 * m2 - m4).max(0.0).powf(0.25);
    (circle, (0.5 * (m2 - circle * circle)).max(0.0).sqrt())
}

#[test]
fn a_sphere_shows_the_ring_of_the_closed_form() {
    const RING_M: f32 = 0.02;
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.01), lamp(RING_M), at(0.3), 0.1);
    for distance_m in [0.1, 0.14, 0.18, 0.24, 0.3] {
        for roughness in [0.004, 0.008, 0.016] {
            let wanted = f64::from(ring_tilt_rad(RING_M, distance_m));
            // The picture is as wide as the reflection: tilts grow by both angles, at the centre and at the eye.
            let reach_rad = wanted as f32 + 4.5 * roughness;
            let on_sphere_rad = reach_rad / (1.0 + RADIUS_M / distance_m);
            let view_rad = 2.0 * (RADIUS_M * on_sphere_rad.sin() / distance_m).atan();
            scene.look(at(RADIUS_M + distance_m), view_rad);
            scene.highlights(smooth(roughness));
            let light = scene.light();
            let picture = scene.picture();
            let tilt_at = |x: f32, y: f32| {
                let (point, normal) = scene.hit(scene.ray(x, y), RADIUS_M).expect("the sphere fills the picture");
                let to_eye = (scene.eye.translation - point).normalize();
                (point, normal.cross(to_eye).length().asin(), normal.dot(to_eye))
            };
            let middle = 0.5 * SIZE as f32;
            let samples = picture.iter().enumerate().map(|(place, pixel)| {
                let (x, y) = ((place as u32 % SIZE) as f32 + 0.5, (place as u32 / SIZE) as f32 + 0.5);
                let (point, tilt, lit) = tilt_at(x, y);
                let density = 4.0 * pixel.x / (0.02 * lit * light.illuminance_lux(point).x);
                // How large a pixel is in the plane of tilts.
                let away = Vec2::new(x - middle, y - middle);
                let further = tilt_at(x + 0.25 * away.x / away.length(), y + 0.25 * away.y / away.length()).1;
                let nearer = tilt_at(x - 0.25 * away.x / away.length(), y - 0.25 * away.y / away.length()).1;
                let area = tilt / away.length() * (further - nearer) / 0.5;
                (f64::from(tilt), f64::from(density * area))
            });
            let samples: Vec<_> = samples.collect();
            let sum: f64 = samples.iter().map(|(_, weight)| weight).sum();
            let (circle, deviation) = circle_and_deviation(samples.into_iter());
            assert!((circle / wanted - 1.0).abs() < 0.03, "at {distance_m} m the ring is {circle}, not {wanted}");
            let off = deviation / f64::from(roughness) - 1.0;
            assert!(off.abs() < 0.03, "at {distance_m} m: {deviation} wide, not {roughness}");
            assert!((sum - 1.0).abs() < 0.03, "at {distance_m} m, {roughness}: {sum} of the light is mirrored");
        }
    }
}

#[test]
fn the_moments_find_circle_and_deviation() {
    let profile = RingProfile { ring_tilt_rad: 0.03, roughness_rad: 0.01 };
    let samples = (0..4000).map(|k| {
        let tilt = (k as f32 + 0.5) * 2.5e-5;
        (f64::from(tilt), f64::from(tilt * profile.density(tilt)))
    });
    let (circle, deviation) = circle_and_deviation(samples);
    assert!((circle - 0.03).abs() < 1e-4 && (deviation - 0.01).abs() < 1e-4, "{circle}, {deviation}");
}

/// A sphere that is cut flat at this height over its middle.
fn flatten(scene: &mut Scene, height_m: f32) {
    scene.app.warm_up();
    let mut shape = scene.app.world_mut().get_mut::<OrganShape>(scene.organ).expect("a shaped organ");
    shape.move_vertices().iter_mut().for_each(|position| position.z = position.z.min(height_m));
    scene.app.step(1);
}

#[test]
fn a_flat_mirror_shows_the_ring_undistorted() {
    const RING_M: f32 = 0.01;
    // The mirror is tilted by moving the eye: seen along the mirror's normal the ring is this far from the middle.
    for (away_rad, view_rad) in [(0.0_f32, 0.3), (0.35, 1.2), (0.75, 1.9)] {
        let eye =
            Transform::from_xyz(0.0, 0.0, 0.1).with_rotation(Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), away_rad));
        let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.004), lamp(RING_M), eye, view_rad);
        flatten(&mut scene, 0.02);
        let picture = scene.picture();
        let brightness = |at: Vec2| {
            let corner = (at - 0.5).floor();
            let share = at - 0.5 - corner;
            let pixel = |dx: u32, dy: u32| picture[((corner.y as u32 + dy) * SIZE + corner.x as u32 + dx) as usize].x;
            let row = |dy| pixel(0, dy) * (1.0 - share.x) + pixel(1, dy) * share.x;
            row(0) * (1.0 - share.y) + row(1) * share.y
        };
        // The mirror lies in z = 0.02, so that the image of the eye and its ring is as far behind it.
        let image = |point: Vec3| Vec3::new(point.x, point.y, 0.04 - point.z);
        let centre = scene.place(image(eye.translation));
        let mut radii = Vec::new();
        for k in 0..48 {
            let (sin, cos) = (k as f32 / 48.0 * TAU).sin_cos();
            let on_ring = eye.translation + eye.rotation * (RING_M * Vec3::new(cos, sin, 0.0));
            let wanted = scene.place(image(on_ring)) - centre;
            let outwards = wanted.normalize();
            let (mut sum, mut moment) = (0.0, 0.0);
            for step in 0..120 {
                let radius = wanted.length() * (0.55 + 0.9 * step as f32 / 120.0);
                let weight = brightness(centre + outwards * radius);
                (sum, moment) = (sum + weight, moment + weight * radius);
            }
            let radius = moment / sum;
            assert!(sum > 0.0, "{away_rad} away: nothing is seen in direction {k}");
            radii.push((radius, wanted.length()));
        }
        // A ring that is seen at an angle has a nearer and a farther half, which the profile does not tell apart.
        let (near, far) = radii.split_at(24);
        let widths: Vec<(f32, f32)> = near.iter().zip(far).map(|(a, b)| (a.0 + b.0, a.1 + b.1)).collect();
        for (k, (got, wanted)) in widths.iter().enumerate() {
            let off = got / wanted - 1.0;
            assert!(off.abs() < 0.03, "{away_rad} away, direction {k}: {got} px wide instead of {wanted}");
        }
        let (least, most) = widths.iter().fold((f32::MAX, 0.0_f32), |(a, b), w| (a.min(w.0), b.max(w.0)));
        assert!(least > 10.0 && most / least < 1.04, "{away_rad} away the ring is no circle: {least} to {most} px");
    }
}

/// Compares a picture of a sphere with the closed form for some lights.
fn assert_twin(scene: &mut Scene, lights: &[LightUniform], gloss: f32, tolerance: f32) {
    let picture = scene.picture();
    let highlights = scene.app.world().get::<Highlights>(scene.organ).expect("highlights").clone();
    let twin = |x: u32, y: u32| {
        let (point, normal) = scene.hit(scene.ray(x as f32 + 0.5, y as f32 + 0.5), RADIUS_M)?;
        // At the rim the polygon is not the sphere.
        let is_rim = normal.dot((scene.eye.translation - point).normalize()) < 0.3;
        let light = |light| highlight_radiance(&highlights, light, scene.eye.translation, point, normal, gloss);
        (!is_rim).then(|| lights.iter().map(light).sum::<Vec3>())
    };
    let wanted: Vec<Option<Vec3>> = (0..SIZE * SIZE).map(|place| twin(place % SIZE, place / SIZE)).collect();
    let peak = wanted.iter().flatten().map(|pixel| pixel.max_element()).fold(0.0, f32::max);
    let mut seen = 0;
    for (place, (got, wanted)) in picture.iter().zip(&wanted).enumerate() {
        let Some(wanted) = wanted else { continue };
        let off = (got - wanted).abs().max_element();
        let (x, y) = (place as u32 % SIZE, place as u32 / SIZE);
        assert!(off < tolerance * peak, "pixel {x},{y}: {got} instead of {wanted}; the peak is {peak}");
        seen += u32::from(wanted.x > 0.1 * peak);
    }
    assert!(seen > 60, "only {seen} pixels are bright: this test sees nothing");
}

#[test]
fn the_gpu_shows_what_the_closed_form_says() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.06), lamp(0.01), at(0.3), 0.75);
    let own = scene.light();
    assert_twin(&mut scene, &[own], 0.5, 0.02);
    scene.highlights(smooth(0.3));
    assert_twin(&mut scene, &[own], 0.5, 0.02);
    scene.highlights(Highlights { strength: 3.0, reflectance: 0.5, ..smooth(0.05) });
    assert_twin(&mut scene, &[own], 0.5, 0.02);
    // A ring at the picture's edge: the eye looks past the sphere.
    scene.highlights(smooth(0.04));
    let aside = Transform::from_xyz(0.0, 0.0, 0.22).with_rotation(Quat::from_rotation_y(0.7));
    scene.app.world_mut().entity_mut(scene.scope).insert(ScopeLight { ring_radius_m: 0.03, ..lamp(0.03) });
    scene.look(aside, 1.9);
    let own = scene.light();
    assert_twin(&mut scene, &[own], 0.5, 0.03);
}

#[test]
fn a_glint_in_the_middle_of_a_large_face_is_not_lost() {
    // Normals turn by a quarter of a radian along an edge, and the glint is a tenth of that wide.
    let texture_mesh = TextureMeshOptions { edge_length_m: Some(0.1), iterations: 3, tile_sweeps: 1, ..default() };
    let options = OrganOptions { texture_mesh, table_width_px: 64, ..default() };
    let mesh = procedural_ellipsoid(Vec3::splat(RADIUS_M), 4);
    let model = OrganModel::from_mesh(mesh, "coarse sphere", &options).expect("an organ");
    let mut scene = Scene::new(model, smooth(0.004), lamp(0.004), at(0.3), 0.12);
    let light = scene.light();
    let twin = |x: u32, y: u32| {
        let (point, normal) = scene.hit(scene.ray(x as f32 + 0.5, y as f32 + 0.5), RADIUS_M)?;
        Some(highlight_radiance(&smooth(0.004), &light, scene.eye.translation, point, normal, 0.5).x)
    };
    let wanted: f32 = (0..SIZE * SIZE).filter_map(|place| twin(place % SIZE, place / SIZE)).sum();
    for turn in 0..8 {
        let turned = Quat::from_euler(EulerRot::XYZ, 0.11 * turn as f32, 0.23 * turn as f32, 0.0);
        scene.app.world_mut().entity_mut(scene.organ).insert(Transform::from_rotation(turned));
        let share = total(&scene.picture()) / wanted;
        // The faces lie up to a hundredth of the radius inside the sphere.
        assert!((share - 1.0).abs() < 0.1, "turned {turn} times: {share} of the light");
    }
}

#[test]
fn other_lights_leave_a_glint() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.08), lamp(0.004), at(0.3), 0.75);
    scene.app.world_mut().entity_mut(scene.scope).insert(Visibility::Hidden);
    let bulb = PointLight { intensity: 1000.0, range: 20.0, ..default() };
    let place = Vec3::new(0.15, 0.1, 0.3);
    scene.app.world_mut().spawn((bulb, Transform::from_translation(place)));
    let sun = Transform::from_xyz(-1.0, 0.3, 1.0).looking_at(Vec3::ZERO, Vec3::Y);
    scene.app.world_mut().spawn((DirectionalLight { illuminance: 2000.0, ..default() }, sun));
    let lights = [
        LightUniform {
            colour: Vec3::splat(1000.0 / (4.0 * PI)),
            kind: LightUniform::POINT,
            position_world_m: place,
            inverse_range_squared: 1.0 / 400.0,
            ..default()
        },
        LightUniform {
            colour: Vec3::splat(2000.0),
            kind: LightUniform::DIRECTIONAL,
            direction_world: sun.forward().into(),
            ..default()
        },
    ];
    assert_twin(&mut scene, &lights, 0.5, 0.02);
}

#[test]
fn two_scopes_leave_two_rings() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.012), lamp(0.01), at(0.3), 0.6);
    let second = Transform::from_xyz(0.12, 0.05, 0.24).looking_at(Vec3::new(0.03, 0.0, 0.09), Vec3::Y);
    let light = lamp(0.02);
    scene.app.world_mut().spawn((light.clone(), second));
    let lights = [scene.light(), light.to_uniform(&second.into())];
    assert_twin(&mut scene, &lights, 0.5, 0.03);
    // Each of them is seen by itself.
    let both = scene.picture();
    scene.app.world_mut().entity_mut(scene.scope).insert(Visibility::Hidden);
    let other = scene.picture();
    assert!(total(&other) > 0.0 && total(&both) > 1.2 * total(&other));
}

#[test]
fn wet_is_sharp_and_burnt_is_dull() {
    let highlights = Highlights { wet_roughness: 0.01, dry_roughness: 0.08, film_relief_m: 0.001, ..smooth(0.0) };
    let mut scene = Scene::new(fine_sphere(RADIUS_M), highlights.clone(), lamp(0.01), at(0.3), 0.5);
    let light = scene.light();
    let without = scene.picture();
    for gloss in [NEUTRAL_GLOSS, 0, 64, 192, 255] {
        scene.gloss(4, 2, &[gloss; 8]);
        if gloss == 0 {
            assert_eq!(total(&scene.picture()), 0.0, "burnt tissue shines");
            continue;
        }
        // An even film has no relief.
        assert_twin(&mut scene, &[light], f32::from(gloss) / 255.0, 0.02);
        let picture = scene.picture();
        let peak = without.iter().map(|pixel| pixel.x).fold(0.0, f32::max);
        let worst = picture.iter().zip(&without).map(|(a, b)| (a - b).abs().max_element()).fold(0.0, f32::max);
        // With a map more of the faint rim is drawn, because drops could shine there.
        assert_eq!(worst < 3e-3 * peak, gloss == NEUTRAL_GLOSS, "gloss {gloss} differs by {worst} from no map");
    }
    // Under the drops they shine like the skin.
    scene.highlights(Highlights { cover: HighlightCover::UnderDrops, ..highlights });
    assert_twin(&mut scene, &[light], f32::from(NEUTRAL_GLOSS) / 255.0, 0.02);
}

#[test]
fn a_drop_shines_where_the_map_says() {
    let highlights = Highlights { wet_roughness: 0.004, dry_roughness: 0.2, film_relief_m: 0.0, ..smooth(0.0) };
    let mut scene = Scene::new(fine_sphere(RADIUS_M), highlights.clone(), lamp(0.02), at(0.2), 0.7);
    scene.app.warm_up();
    // The place that the middle of the picture shows.
    let organ = scene.app.world().get::<Organ>(scene.organ).expect("an organ").0.clone();
    let model = scene.app.world().resource::<Assets<OrganModel>>().get(&organ).expect("its model").clone();
    let nearest = (0..64 * 32)
        .map(|texel| model.table.centre_uv(texel % 64, texel / 64))
        .filter_map(|uv| Some((uv, model.atlas.locate_uv(uv, &model.table)?)))
        .max_by(|(_, a), (_, b)| {
            let height = |point: &SurfacePoint| {
                let corners =
                    model.mesh.triangles[point.face as usize].map(|corner| model.mesh.positions_m[corner as usize].z);
                (0..3).map(|k| point.barycentric[k] * f64::from(corners[k])).sum::<f64>()
            };
            height(a).total_cmp(&height(b))
        })
        .expect("a place")
        .0;
    let map = |reach: f64| -> Vec<u8> {
        (0..256 * 128)
            .map(|texel| {
                let (u, v) = ((f64::from(texel % 256) + 0.5) / 256.0, (f64::from(texel / 256) + 0.5) / 128.0);
                let du = ((u - nearest.x + 1.5).fract() - 0.5) * (std::f64::consts::PI * v).sin() * 2.0;
                if du.hypot(v - nearest.y) < reach { 255 } else { NEUTRAL_GLOSS }
            })
            .collect()
    };
    let dry = scene.picture();
    let mirrored = |picture: &[Vec3]| picture.iter().map(|pixel| pixel.x).fold(0.0, f32::max);
    let skin = mirrored(&dry);
    scene.gloss(256, 128, &map(0.04));
    let wet = scene.picture();
    assert!(mirrored(&wet) > 5.0 * skin, "a drop in the middle mirrors the ring: {} over {skin}", mirrored(&wet));
    // Beside it the skin is as it was.
    let beside = (SIZE * 40 + SIZE / 2) as usize;
    assert!(dry[beside].x > 0.0 && (wet[beside] - dry[beside]).length() < 1e-3 * dry[beside].x, "{}", wet[beside]);
    // With relief its rim tilts, and the picture changes there only.
    scene.highlights(Highlights { film_relief_m: 0.002, ..highlights });
    let raised = scene.picture();
    let changed = raised.iter().zip(&wet).filter(|(a, b)| (*a - *b).abs().max_element() > 0.01 * skin).count();
    assert!((20..20_000).contains(&changed), "{changed} pixels changed");
}
