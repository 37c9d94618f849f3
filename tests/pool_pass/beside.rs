//! Pools beside tools, other pools and other cameras.

use super::FLOOR;
use super::stage::{LEVEL_M, Stage, channels, set_all};
use bevy::camera::{Hdr, RenderTarget, Viewport};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_surgery::pool::PoolSurface;
use bevy_surgery::pool::software::PoolMixture;
use half::f16;
use image::RgbaImage;

const BLOODY: PoolMixture = PoolMixture { blood: 0.02, dust: 0.0 };
const TOOL: [u8; 3] = [0, 0, 255];

impl Stage {
    /// The picture with and without the pool.
    fn pictures(&mut self) -> [RgbaImage; 2] {
        let wet = self.app.capture();
        self.app.world_mut().entity_mut(self.pool).insert(Visibility::Hidden);
        let dry = self.app.capture();
        self.app.world_mut().entity_mut(self.pool).insert(Visibility::Inherited);
        [wet, dry]
    }
}

/// Waves as high as they come, without a pattern.
fn choppy(surface: &mut PoolSurface) {
    for (place, texel) in surface.texels.iter_mut().enumerate() {
        let height_mm = ((place as f32 * 12.9898).sin() * 43758.547).fract();
        texel[0] = f16::from_f32(0.3 * height_mm).to_bits();
    }
}

/// Distance along a ray to a box, and the height of the place.
fn met(from: Vec3, along: Vec3, middle: Vec3, size: Vec3) -> Option<Vec3> {
    let low = (middle - 0.5 * size - from) / along;
    let high = (middle + 0.5 * size - from) / along;
    let (enter, leave) = (low.min(high).max_element(), low.max(high).min_element());
    (enter <= leave && enter > 0.0).then(|| from + along * enter)
}

#[test]
fn dry_shafts_stay_and_wet_burrs_are_tinted() {
    for (msaa, is_hdr) in [(Msaa::Off, false), (Msaa::Sample4, false), (Msaa::Off, true)] {
        let mut stage = Stage::new(200, 150);
        stage.app.insert_resource(GlobalAmbientLight { brightness: 300.0, ..default() });
        stage.add_floor(FLOOR);
        let camera = stage.camera;
        stage.app.world_mut().entity_mut(camera).insert(msaa);
        if is_hdr {
            stage.app.world_mut().entity_mut(camera).insert(Hdr);
        }
        stage.aim(Vec3::new(0.02, -0.06, 0.05));
        let (middle, size) = (Vec3::new(0.001, 0.0, 0.007), Vec3::new(0.003, 0.004, 0.014));
        stage.add_box(middle, size, TOOL);
        stage.change_surface(|surface| set_all(surface, 0.0, BLOODY));
        let [wet, dry] = stage.pictures();
        let (mut above, mut below, mut floor) = (0, 0, 0);
        for (x, y, pixel) in wet.enumerate_pixels() {
            let at = Vec2::new(x as f32, y as f32) + 0.5;
            let hits = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::NEG_X, Vec2::NEG_Y].map(|side| {
                let (from, along) = stage.ray(at + side);
                met(from, along, middle, size).map(|place| place.z)
            });
            let plain = dry.get_pixel(x, y);
            if hits.iter().all(|hit| hit.is_some_and(|z| z > LEVEL_M)) {
                assert_eq!(pixel, plain, "{msaa:?}: pixel {x},{y} of the dry shaft");
                above += 1;
            } else if hits.iter().all(|hit| hit.is_some_and(|z| z < LEVEL_M)) {
                assert!(pixel.0[2] < plain.0[2], "{msaa:?}: pixel {x},{y} is under water: {pixel:?}");
                below += 1;
            } else if hits.iter().all(Option::is_none) {
                assert!(pixel != plain, "{msaa:?}: pixel {x},{y} of the floor");
                floor += 1;
            }
        }
        assert!(above > 200 && below > 100 && floor > 10_000, "{above} {below} {floor}");
    }
}

#[test]
fn what_hangs_over_the_pool_is_not_seen_in_it() {
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let mut stage = Stage::new(200, 150);
        let camera = stage.camera;
        stage.app.world_mut().entity_mut(camera).insert(msaa);
        stage.add_floor([255, 0, 0]);
        stage.aim(Vec3::new(0.02, -0.06, 0.05));
        let (middle, size) = (Vec3::new(0.0, 0.0, 0.008), Vec3::new(0.004, 0.008, 0.004));
        stage.add_box(middle, size, TOOL);
        stage.change_surface(choppy);
        let [wet, dry] = stage.pictures();
        let (mut water, mut shifted) = (0, 0);
        for (x, y, pixel) in wet.enumerate_pixels() {
            let plain = dry.get_pixel(x, y);
            if plain.0[2] == 0 {
                assert_eq!(pixel.0[2], 0, "{msaa:?}: pixel {x},{y} shows what is over the pool: {pixel:?}");
                water += 1;
                shifted += u32::from(pixel != plain);
            } else if plain.0[0] == 0 {
                assert_eq!(pixel, plain, "{msaa:?}: pixel {x},{y} of the tool");
            }
        }
        assert!(water > 20_000 && shifted > 15_000, "{water} {shifted}");
    }
}

#[test]
fn one_sample_and_four_agree() {
    let mut stage = Stage::new(160, 120);
    stage.app.insert_resource(GlobalAmbientLight { brightness: 300.0, ..default() });
    stage.add_floor(FLOOR);
    stage.add_box(Vec3::new(0.004, 0.0, 0.0), Vec3::new(0.003, 0.003, 0.006), TOOL);
    stage.change_surface(|surface| set_all(surface, 0.05, BLOODY));
    let one = stage.app.capture();
    stage.app.world_mut().entity_mut(stage.camera).insert(Msaa::Sample4);
    let four = stage.app.capture();
    let differ =
        |a: &image::Rgba<u8>, b: &image::Rgba<u8>| (0..3).any(|channel| a.0[channel].abs_diff(b.0[channel]) > 2);
    let count = one.pixels().zip(four.pixels()).filter(|(a, b)| differ(a, b)).count();
    assert!(count < 250, "{count} pixels differ");
}

#[test]
fn each_half_of_a_target_has_its_pool() {
    let mut stage = Stage::new(240, 90);
    stage.add_floor(FLOOR);
    stage.add_box(Vec3::new(0.004, 0.0, 0.0), Vec3::new(0.003, 0.003, 0.006), TOOL);
    stage.change_surface(|surface| set_all(surface, 0.0, BLOODY));
    let half = |x: u32| {
        Some(Viewport { physical_position: UVec2::new(x, 0), physical_size: UVec2::new(120, 90), ..default() })
    };
    stage.app.world_mut().get_mut::<Camera>(stage.camera).expect("a camera").viewport = half(0);
    let target = RenderTarget::Image(stage.app.target().image.into());
    let camera = Camera { viewport: half(120), order: 1, clear_color: ClearColorConfig::None, ..default() };
    let lens = stage.app.world().get::<Projection>(stage.camera).expect("a lens").clone();
    let place = *stage.app.world().get::<Transform>(stage.camera).expect("placed");
    let other = (Camera3d::default(), camera, target, lens, Tonemapping::None, Msaa::Off, place);
    stage.app.world_mut().spawn(other);
    let [wet, dry] = stage.pictures();
    for y in 0..90 {
        for x in 0..120 {
            let [left, right] = [x, x + 120].map(|x| channels(wet.get_pixel(x, y)));
            assert!((left - right).abs().max_element() < 2.0, "pixel {x},{y}: {left} and {right}");
            assert!(wet.get_pixel(x, y) != dry.get_pixel(x, y), "pixel {x},{y}");
        }
    }
}

#[test]
fn pools_are_seen_through_pools() {
    let mut stage = Stage::new(120, 90);
    stage.add_floor(FLOOR);
    stage.change_surface(|surface| set_all(surface, 0.0, BLOODY));
    let [one, _] = stage.pictures();
    let mut upper = stage.app.world().get::<PoolSurface>(stage.pool).expect("a pool").clone();
    set_all(&mut upper, 0.0, PoolMixture { blood: 0.01, dust: 0.0 });
    // Whichever entity comes first.
    let over = stage.app.world_mut().spawn((upper, Transform::from_xyz(0.0, 0.0, 0.002))).id();
    let both = stage.app.capture();
    let darker = one.pixels().zip(both.pixels()).filter(|(one, both)| both.0[1] < one.0[1]).count();
    assert_eq!(darker, 120 * 90);
    stage.app.world_mut().entity_mut(stage.pool).insert(Transform::from_xyz(0.0, 0.0, 0.002));
    stage.app.world_mut().entity_mut(over).insert(Transform::from_xyz(0.0, 0.0, 0.0));
    let exchanged = stage.app.capture();
    assert!(exchanged != both);
}

#[test]
fn tilted_and_scaled_pools_lie_in_their_plane() {
    // Turned by a right angle and moved: the wall x = 0.01 is the floor.
    let mut stage = Stage::new(160, 120);
    stage.add_box(Vec3::new(0.0, 0.0, 0.0), Vec3::new(0.02, 0.4, 0.4), FLOOR);
    stage.change_surface(|surface| set_all(surface, 0.0, BLOODY));
    stage
        .app
        .world_mut()
        .entity_mut(stage.camera)
        .insert(Transform::from_xyz(0.07, 0.0, 0.02).looking_at(Vec3::X * 0.01, Vec3::Y));
    let turned = Transform::from_xyz(0.01, 0.0, 0.0)
        .with_rotation(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2))
        .with_scale(Vec3::splat(3.0));
    stage.app.world_mut().entity_mut(stage.pool).insert(turned);
    let [wet, dry] = stage.pictures();
    let mean = |picture: &RgbaImage| picture.pixels().map(|pixel| f64::from(pixel.0[1])).sum::<f64>() / 19200.0;
    assert!(mean(&wet) < 0.7 * mean(&dry), "{} {}", mean(&wet), mean(&dry));
    let changed = wet.pixels().zip(dry.pixels()).filter(|(wet, dry)| wet != dry).count();
    assert_eq!(changed, 19200);
}
