//! Volumes beside the rest of a Bevy scene: depth in both directions, several cameras, samples, HDR.

use super::stage::{EYE, SIZE_PX, Stage, add_volume, lens};
use super::{ball, points, solid, veil};
use crate::support::{plain_skin, sphere_organ};
use bevy::camera::{Hdr, RenderTarget, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::volume::VolumeMethod;
use image::RgbaImage;

/// Radius of the ball, metres.
const RADIUS_M: f32 = 0.012;

/// A thing of the scene, as closed forms know it.
#[derive(Clone, Copy)]
enum Body {
    Ball { middle: Vec3, radius: f32 },
    Box { middle: Vec3, half: Vec3 },
}

/// Colours that bodies have, each in one channel of the picture.
const CHANNELS: usize = 3;

impl Body {
    /// Distance along a ray (unit direction) at which it is met from outside.
    fn met_by(self, from: Vec3, along: Vec3) -> Option<f32> {
        match self {
            Self::Ball { middle, radius } => {
                let to = from - middle;
                let (b, c) = (to.dot(along), to.length_squared() - radius * radius);
                let root = (b * b - c).sqrt();
                (!root.is_nan() && -b - root > 0.0).then_some(-b - root)
            }
            Self::Box { middle, half } => {
                let low = (middle - half - from) / along;
                let high = (middle + half - from) / along;
                let (enter, leave) = (low.min(high).max_element(), low.max(high).min_element());
                (enter <= leave && enter > 0.0).then_some(enter)
            }
        }
    }
}

/// Every pixel shows the nearest of the bodies, whose colours are red, green and blue in this order, or black. Pixels where
/// two of them are nearly as near, or that an outline crosses, are left out.
fn assert_nearest(what: &str, picture: &RgbaImage, viewport: URect, clip: Mat4, camera: Transform, bodies: &[Body]) {
    assert!(bodies.len() <= CHANNELS);
    let size = viewport.size().as_vec2();
    let view_from_clip = clip.inverse();
    let nearest = |pixel: Vec2| {
        let ndc = pixel / size * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
        let along = camera.rotation * view_from_clip.project_point3(ndc.extend(0.5)).normalize();
        let hits = bodies
            .iter()
            .enumerate()
            .filter_map(|(place, body)| Some((body.met_by(camera.translation, along)?, place)));
        let mut hits: Vec<(f32, usize)> = hits.collect();
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_close = hits.len() > 1 && hits[1].0 - hits[0].0 < 0.002;
        (hits.first().map(|hit| hit.1), is_close)
    };
    let (mut compared, mut of_body) = (0, [0; CHANNELS]);
    for y in 0..viewport.height() {
        for x in 0..viewport.width() {
            let middle = Vec2::new(x as f32, y as f32) + 0.5;
            let (body, is_close) = nearest(middle);
            let around = [Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y].map(|side| nearest(middle + 1.6 * side));
            if is_close || around.iter().any(|other| other.0 != body || other.1) {
                continue;
            }
            let pixel = picture.get_pixel(viewport.min.x + x, viewport.min.y + y).0;
            let expected: [bool; CHANNELS] = std::array::from_fn(|channel| body == Some(channel));
            let seen: [bool; CHANNELS] = std::array::from_fn(|channel| pixel[channel] > 90);
            assert_eq!(seen, expected, "{what}: pixel {x},{y} is {pixel:?} where body {body:?} belongs");
            compared += 1;
            if let Some(body) = body {
                of_body[body] += 1;
            }
        }
    }
    let all = viewport.width() * viewport.height();
    assert!(compared > all * 3 / 5, "{what}: only {compared} of {all} pixels were compared");
    let least = all / 300;
    assert!(
        of_body[..bodies.len()].iter().all(|&count| count > least),
        "{what}: a body is hardly seen: {of_body:?} pixels"
    );
}

/// A red volume, without light but from all sides.
fn stage() -> Stage {
    let mut stage = Stage::with_materials(ball(RADIUS_M * 1e3), solid([255, 0, 0]));
    let camera = stage.camera;
    stage.app.world_mut().entity_mut(camera).remove::<Hdr>();
    stage.app.insert_resource(GlobalAmbientLight { brightness: 1000.0, ..GlobalAmbientLight::NONE });
    stage.look().wet.shine = 0.0;
    stage
}

fn add_box(stage: &mut Stage, middle: Vec3, half: Vec3, colour: Color) -> Entity {
    let world = stage.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid { half_size: half });
    let material = StandardMaterial { base_color: colour, unlit: true, ..default() };
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(middle))).id()
}

const GREEN: Color = Color::srgb(0.0, 1.0, 0.0);
const THE_BALL: Body = Body::Ball { middle: Vec3::ZERO, radius: RADIUS_M };

fn everything() -> URect {
    URect { min: UVec2::ZERO, max: SIZE_PX }
}

#[test]
fn boxes_and_volumes_hide_one_another() {
    let mut stage = stage();
    let camera = Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y);
    let towards = EYE.normalize();
    let half = Vec3::new(0.004, 0.005, 0.003);
    let cube = add_box(&mut stage, Vec3::ZERO, half, GREEN);
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let entity = stage.camera;
        stage.set(entity, msaa);
        for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
            stage.look().method = method;
            for (name, middle) in [
                ("in front", towards * 0.03),
                ("half in", Vec3::new(0.006, 0.004, 0.010)),
                ("behind and beside", Vec3::new(-0.014, -0.004, -0.006)),
            ] {
                stage.set(cube, Transform::from_translation(middle));
                let picture = stage.app.capture();
                let clip = stage.clip_from_view();
                let what = format!("{name}, {method:?}, {msaa:?}");
                assert_nearest(&what, &picture, everything(), clip, camera, &[THE_BALL, Body::Box { middle, half }]);
            }
        }
    }
}

#[test]
fn what_stands_in_a_veil_is_seen_through_it() {
    let veil = points(&[(0.4, [255, 255, 255], 0.0), (0.6, [255, 255, 255], 0.08)]);
    let mut stage = Stage::with_materials(ball(RADIUS_M * 1e3), veil);
    // A wall across the view, so that the closed form is the twin's with one depth for all pixels.
    let wall_m = 0.092;
    stage.aim(Vec3::Z * 0.1, Vec3::ZERO);
    add_box(&mut stage, Vec3::Z * (0.1 - wall_m - 0.001), Vec3::new(0.1, 0.1, 0.001), Color::BLACK);
    for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
        stage.look().method = method;
        let shot = stage.shot();
        let depths = vec![wall_m; shot.colour.len()];
        let twin = stage.twin_before(Vec3::ZERO, Some(&depths));
        let open = stage.twin();
        let (mut compared, mut hidden) = (0, 0.0_f32);
        for (place, texel) in shot.colour.iter().enumerate() {
            // The plane of samples that lies on the wall may fall on either side of it.
            let (near, own) = (twin.colour[place], texel);
            if near[3] > 0.1 {
                assert!(
                    (0..3).all(|channel| (own[channel] - near[channel]).abs() < 0.09 * near[3]),
                    "{own:?} {near:?}"
                );
                compared += 1;
                hidden = hidden.max((open.colour[place][0] - own[0]) / open.colour[place][0]);
            }
        }
        assert!(compared > 500, "only {compared} pixels show the veil");
        assert!(hidden > 0.25, "the wall hides at most {hidden} of the light");
    }
}

#[test]
fn organs_and_volumes_hide_one_another() {
    let mut stage = stage();
    stage.add_organ_of_the_scene();
    let camera = Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y);
    let right = camera.right();
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let entity = stage.camera;
        stage.set(entity, msaa);
        for (name, middle) in [
            ("behind and beside", right * 0.01 - EYE.normalize() * 0.012),
            ("half in", right * 0.008 + EYE.normalize() * 0.006),
        ] {
            let organ = stage.organ();
            stage.set(organ, Transform::from_translation(middle));
            let picture = stage.app.capture();
            let bodies = [THE_BALL, Body::Ball { middle, radius: ORGAN_RADIUS_M }];
            let clip = stage.clip_from_view();
            assert_nearest(&format!("{name}, {msaa:?}"), &picture, everything(), clip, camera, &bodies);
        }
    }
}

/// Radius of the organ, metres.
const ORGAN_RADIUS_M: f32 = 0.01;

impl Stage {
    fn add_organ_of_the_scene(&mut self) {
        let organ = self.app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(ORGAN_RADIUS_M));
        self.app.world_mut().spawn((Organ(organ), plain_skin([0, 255, 0])));
    }

    fn organ(&mut self) -> Entity {
        let mut organs = self.app.world_mut().query_filtered::<Entity, With<Organ>>();
        organs.single(self.app.world()).expect("one organ")
    }
}

#[test]
fn two_cameras_share_a_target() {
    let mut stage = stage();
    let first = stage.camera;
    let half = UVec2::new(SIZE_PX.x / 2, SIZE_PX.y);
    let viewport = |x: u32| Some(Viewport { physical_position: UVec2::new(x, 0), physical_size: half, ..default() });
    let cube = Vec3::new(0.006, 0.004, 0.010);
    let half_size = Vec3::new(0.004, 0.005, 0.003);
    let entity = add_box(&mut stage, cube, half_size, GREEN);
    let places =
        [EYE, Vec3::new(-0.03, 0.05, 0.08)].map(|eye| Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Y));
    stage.app.world_mut().get_mut::<Camera>(first).expect("a camera").viewport = viewport(0);
    let target = RenderTarget::Image(stage.app.target().image.into());
    let second = Camera { order: 1, viewport: viewport(half.x), clear_color: ClearColorConfig::None, ..default() };
    let second = (Camera3d::default(), second, lens(), target, Tonemapping::None, Msaa::Off, places[1]);
    stage.app.world_mut().spawn(second);
    for middle in [cube, Vec3::new(-0.002, 0.0, 0.02)] {
        stage.set(entity, Transform::from_translation(middle));
        let picture = stage.app.capture();
        let clip = stage.clip_from_view();
        for (side, camera) in places.into_iter().enumerate() {
            let min = UVec2::new(half.x * side as u32, 0);
            let viewport = URect { min, max: min + half };
            let bodies = [THE_BALL, Body::Box { middle, half: half_size }];
            assert_nearest(&format!("camera {side}"), &picture, viewport, clip, camera, &bodies);
        }
    }
}

#[test]
fn cameras_with_and_without_hdr_show_the_same() {
    let mut stage = Stage::with_materials(super::ball(14.0), veil());
    // On black, blending before and after tonemapping differs where something shines through; what is solid does not.
    stage.app.insert_resource(ClearColor(Color::BLACK));
    let solid = solid([230, 180, 140]);
    let (camera, volume) = (stage.camera, stage.volume);
    stage.set(volume, solid);
    for tonemapping in [Tonemapping::None, Tonemapping::Reinhard, Tonemapping::AcesFitted] {
        stage.set(camera, tonemapping);
        stage.set(camera, Hdr);
        let hdr = stage.app.capture();
        stage.app.world_mut().entity_mut(camera).remove::<Hdr>();
        let plain = stage.app.capture();
        let differences = hdr
            .pixels()
            .zip(plain.pixels())
            .map(|(a, b)| (0..3).map(|channel| a.0[channel].abs_diff(b.0[channel])).max().unwrap_or_default());
        let mut differences: Vec<u8> = differences.collect();
        differences.sort_unstable();
        let (most, worst) = (differences[differences.len() * 97 / 100], differences[differences.len() - 1]);
        assert!(most <= 2 && worst < 60, "{tonemapping:?}: {most}, at most {worst}");
        let bright = plain.pixels().filter(|pixel| pixel.0[0] > 100).count();
        assert!(bright > 1000, "{tonemapping:?}: only {bright} pixels are bright");
    }
}

#[test]
fn two_volumes_hide_one_another() {
    let mut stage = stage();
    let other = add_volume(&mut stage.app, ball(9.0), solid([0, 255, 0]));
    let look = stage.look().clone();
    stage.set(other, look);
    let camera = Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y);
    let aside = camera.right() * 0.009;
    for (name, middle) in [
        ("farther", aside - EYE.normalize() * 0.01),
        ("nearer", aside + EYE.normalize() * 0.012),
        ("overlapping", aside),
    ] {
        stage.set(other, Transform::from_translation(middle));
        let picture = stage.app.capture();
        let clip = stage.clip_from_view();
        let bodies = [THE_BALL, Body::Ball { middle, radius: 0.009 }];
        assert_nearest(name, &picture, everything(), clip, camera, &bodies);
    }
}
