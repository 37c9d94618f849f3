//! Pools in the picture, against their twin on the processor and closed forms.

mod beside;
mod optics;
mod stage;

use bevy::camera::{Exposure, Hdr, Projection, ScalingMode};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::{EnvironmentMapLight, GlobalAmbientLight};
use bevy::prelude::*;
use bevy_surgery::pool::software::{
    PoolMixture, composite, fresnel, meniscus, optical_displacement_m, refracted, refractive_index,
};
use bevy_surgery::pool::{FresnelModel, PoolLook, PoolSurface};
use image::RgbaImage;
use stage::{LEVEL_M, Stage, channels, linear, set_all};

const FLOOR: [u8; 3] = [210, 180, 140];
const BRIGHTNESS: f32 = 600.0;

/// What the twin says of every pixel of a level pool over the floor `z = 0`, beside what the picture shows; 0 to 255.
fn against_twin(stage: &mut Stage, mixture: PoolMixture, level_m: f32, around: Option<Vec3>) -> Vec<(Vec3, Vec3)> {
    let picture = stage.app.capture();
    let look = *stage.app.world().get::<PoolLook>(stage.pool).expect("a pool");
    let white = Vec3::splat(BRIGHTNESS * Exposure::default().exposure());
    let mut pairs = Vec::new();
    for (x, y, pixel) in picture.enumerate_pixels() {
        // Beyond the border there is nothing to refract.
        if x < 16 || y < 16 || x + 16 >= picture.width() || y + 16 >= picture.height() {
            continue;
        }
        let (_, along) = stage.ray(Vec2::new(x as f32, y as f32) + 0.5);
        let index = refractive_index(&look, mixture);
        let bent = refracted(along, Vec3::Z, index);
        // The paper's incident rays go straight down, and the depth is that of a level ground.
        let shift = optical_displacement_m(bent, Vec3::NEG_Z, level_m);
        let reflectivity = fresnel(look.fresnel, -along.z, index);
        let mirrored = -along.z;
        let room = white * look.room * (0.25 + 0.75 * mirrored);
        let ground = linear(FLOOR);
        let paths = [if look.refracts { shift.length() } else { level_m / -along.z }, level_m];
        let environment = around.unwrap_or(room);
        let radiance = composite(&look, mixture, ground, white, environment, reflectivity, paths);
        let shown = LinearRgba::rgb(radiance.x, radiance.y, radiance.z);
        pairs.push((Vec3::from_array(Srgba::from(shown).to_f32_array_no_alpha()) * 255.0, channels(pixel)));
    }
    assert!(pairs.len() > 5000);
    pairs
}

fn assert_twin(what: &str, stage: &mut Stage, mixture: PoolMixture, level_m: f32) {
    assert_pairs(what, &against_twin(stage, mixture, level_m, None));
}

fn assert_pairs(what: &str, pairs: &[(Vec3, Vec3)]) {
    for (wanted, got) in pairs {
        assert!((*wanted - *got).abs().max_element() < 2.0, "{what}: {got} instead of {wanted}");
    }
}

/// A level pool that fills the picture, over a floor of one colour, in even light.
fn wide() -> Stage {
    let mut stage = Stage::new(160, 120);
    stage.app.insert_resource(GlobalAmbientLight { brightness: BRIGHTNESS, ..default() });
    stage.add_floor(FLOOR);
    stage
}

#[test]
fn level_pools_look_as_the_twin_says() {
    let mut stage = wide();
    let clear = PoolMixture::default();
    assert_twin("water", &mut stage, clear, LEVEL_M);
    let bloody = PoolMixture { blood: 0.03, dust: 0.01 };
    stage.change_surface(|surface| set_all(surface, 0.0, bloody));
    assert_twin("blood and dust", &mut stage, bloody, LEVEL_M);
    let camera = stage.camera;
    stage.app.world_mut().entity_mut(camera).insert(Msaa::Sample4);
    assert_twin("four samples", &mut stage, bloody, LEVEL_M);
    stage.app.world_mut().entity_mut(camera).insert((Msaa::Off, Hdr));
    assert_twin("hdr", &mut stage, bloody, LEVEL_M);
    stage.app.world_mut().entity_mut(camera).remove::<Hdr>();
    let lens = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 0.03 },
        near: 0.0,
        far: 1.0,
        ..OrthographicProjection::default_3d()
    };
    stage.app.world_mut().entity_mut(camera).insert(Projection::Orthographic(lens));
    assert_twin("orthographic", &mut stage, bloody, LEVEL_M);
    stage.look().fresnel = FresnelModel::Paper;
    assert_twin("the paper's Fresnel term", &mut stage, bloody, LEVEL_M);
    stage.look().refracts = false;
    assert_twin("without refraction", &mut stage, bloody, LEVEL_M);
}

#[test]
fn deep_pools_are_darker_and_redder_than_films() {
    let bloody = PoolMixture { blood: 0.02, dust: 0.0 };
    let mean = |level_m: f32| {
        let mut stage = wide();
        stage.change_surface(|surface| {
            surface.level_m = level_m;
            set_all(surface, 0.0, bloody);
        });
        let pairs = against_twin(&mut stage, bloody, level_m, None);
        assert_pairs("depth", &pairs);
        pairs.iter().map(|(_, got)| *got).sum::<Vec3>() / pairs.len() as f32
    };
    let (film, deep) = (mean(2e-4), mean(5e-3));
    assert!(film.x > deep.x + 10.0 && film.y > deep.y + 60.0, "{film} {deep}");
    assert!(deep.x / deep.y > 1.5 * film.x / film.y, "{film} {deep}");
}

#[test]
fn cameras_without_hdr_show_nearly_the_same() {
    let mut stage = wide();
    stage.change_surface(|surface| set_all(surface, 0.0, PoolMixture { blood: 0.01, dust: 0.01 }));
    let camera = stage.camera;
    for tonemapping in [Tonemapping::Reinhard, Tonemapping::AgX] {
        stage.app.world_mut().entity_mut(camera).insert((tonemapping, Hdr));
        let hdr = stage.app.capture();
        stage.app.world_mut().entity_mut(camera).remove::<Hdr>();
        let plain = stage.app.capture();
        // The fluid absorbs before the one and after the other.
        let furthest = hdr.pixels().zip(plain.pixels()).map(|(a, b)| (channels(a) - channels(b)).abs().max_element());
        let furthest = furthest.fold(0.0, f32::max);
        assert!(furthest < 30.0, "{tonemapping:?}: {furthest}");
    }
}

#[test]
fn an_environment_map_is_mirrored() {
    let mut stage = wide();
    let mut images = stage.app.world_mut().resource_mut::<Assets<Image>>();
    let map = EnvironmentMapLight::solid_color(&mut images, Color::linear_rgb(0.2, 0.4, 1.0));
    let intensity = 40_000.0;
    let camera = stage.camera;
    stage.app.world_mut().entity_mut(camera).insert(EnvironmentMapLight { intensity, ..map });
    let around = Vec3::new(0.2, 0.4, 1.0) * intensity * Exposure::default().exposure();
    let pairs = against_twin(&mut stage, PoolMixture::default(), LEVEL_M, Some(around));
    for (wanted, got) in pairs {
        let wanted = wanted.min(Vec3::splat(255.0));
        assert!((wanted - got).abs().max_element() < 2.0, "{got} instead of {wanted}");
    }
}

#[test]
fn refraction_obeys_snell() {
    // A floor of two colours: where the refracted ray ends says which one is seen.
    for msaa in [Msaa::Off, Msaa::Sample4] {
        let mut stage = Stage::new(160, 120);
        let camera = stage.camera;
        // From so near that another index shows.
        let lens = PerspectiveProjection { fov: 0.1, near: 0.001, ..default() };
        stage.app.world_mut().entity_mut(camera).insert((msaa, Projection::Perspective(lens)));
        stage.add_box(Vec3::new(-0.05, 0.0, -0.01), Vec3::new(0.1, 0.2, 0.02), [255, 0, 0]);
        stage.add_box(Vec3::new(0.05, 0.0, -0.01), Vec3::new(0.1, 0.2, 0.02), [0, 255, 0]);
        stage.aim(Vec3::new(0.05, -0.01, 0.05));
        let picture = stage.app.capture();
        let (mut compared, mut shifted, mut other) = (0, 0, 0);
        for y in 16..104 {
            for x in 20..140 {
                let at = Vec2::new(x as f32, y as f32) + 0.5;
                let end = |at: Vec2, index: f32| {
                    let (from, along) = stage.ray(at);
                    let entry = from + along * ((LEVEL_M - from.z) / along.z);
                    entry.x + optical_displacement_m(refracted(along, Vec3::Z, index), Vec3::NEG_Z, LEVEL_M).x
                };
                let here = end(at, 1.33);
                let pixel_m = (end(at + Vec2::X, 1.33) - here).abs() + (end(at + Vec2::Y, 1.33) - here).abs();
                if here.abs() < 1.2 * pixel_m {
                    continue;
                }
                let got = picture.get_pixel(x, y).0;
                assert_eq!(got[0] < got[1], here > 0.0, "{msaa:?}: pixel {x},{y} is {got:?}, its ray ends at {here}");
                compared += 1;
                other += u32::from((end(at, 1.43) > 0.0) != (here > 0.0));
                let (from, along) = stage.ray(at);
                shifted += u32::from((from.x - along.x * from.z / along.z > 0.0) != (here > 0.0));
            }
        }
        assert!(compared > 8000 && shifted > 300, "{compared} pixels, of which refraction changes {shifted}");
        assert!(other > 100, "only {other} pixels tell the index of water from that of oil");
    }
}

/// A floor, and a wall that stands out of the pool to the right of `x = 0`, seen from straight above.
fn before_a_wall(width: u32) -> (Stage, RgbaImage, RgbaImage) {
    let mut stage = Stage::new(width, width * 3 / 4);
    stage.app.insert_resource(GlobalAmbientLight { brightness: BRIGHTNESS, ..default() });
    stage.add_floor(FLOOR);
    stage.add_box(Vec3::new(0.01, 0.0, 0.0), Vec3::new(0.02, 0.1, 0.011), FLOOR);
    stage.aim(Vec3::new(0.0, 0.0, 0.06));
    stage.look().meniscus_width_m = 1e-3;
    stage.look().meniscus_reach_m = 2e-3;
    let with = stage.app.capture();
    stage.look().meniscus_width_m = 0.0;
    let without = stage.app.capture();
    (stage, with, without)
}

#[test]
fn the_meniscus_is_as_wide_in_every_resolution() {
    for width in [120, 240, 480] {
        let (stage, with, without) = before_a_wall(width);
        let middle = with.height() / 2;
        let place_m = |x: u32| {
            let (from, along) = stage.ray(Vec2::new(x as f32 + 0.5, middle as f32 + 0.5));
            (from + along * ((LEVEL_M - from.z) / along.z)).x
        };
        let pixel_m = place_m(1) - place_m(0);
        let changed: Vec<f32> =
            (0..width).filter(|x| with.get_pixel(*x, middle) != without.get_pixel(*x, middle)).map(place_m).collect();
        let (least, most) = (changed[0], changed[changed.len() - 1]);
        assert!((least + 1e-3).abs() < 1.6 * pixel_m, "{width} pixels: from {least} m");
        assert!(most < 0.6 * pixel_m && most > -1.6 * pixel_m, "{width} pixels: to {most} m");
        assert!(changed.len() as f32 * pixel_m < 1e-3 + 2.0 * pixel_m);
        let brighter = |x: u32| with.get_pixel(x, middle).0[2] > without.get_pixel(x, middle).0[2];
        assert!((0..width).any(brighter), "it is bright");
    }
}

#[test]
fn menisci_add_what_the_table_says() {
    let table = PoolLook::default().meniscus;
    assert_eq!([0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|count| meniscus(&table, count)), table);
    assert!((meniscus(&table, 1.5) - 0.065).abs() < 1e-6 && meniscus(&table, 9.0) == 0.0);
    // Beside a straight wall one neighbour counts: its reflectivity is the table's, of light so many times as bright as a sheet.
    let (mut stage, with, without) = before_a_wall(480);
    stage.look().meniscus_light = 7.0;
    stage.look().meniscus_width_m = 1e-3;
    let brighter = stage.app.capture();
    let light = |picture: &RgbaImage| {
        let at = picture.get_pixel(238, 180).0;
        linear([at[0], at[1], at[2]])
    };
    let white = BRIGHTNESS * Exposure::default().exposure();
    let more = (light(&brighter) - light(&with)) / (white * 2.0);
    assert!((more - 0.08).abs().max_element() < 0.006, "{more} of the light");
    // The first five times, less what no longer shines through.
    assert!(light(&with).z > light(&without).z + 0.3 * white, "{} {}", light(&with), light(&without));
}

#[test]
fn pools_without_surface_draw_nothing() {
    let mut stage = wide();
    stage.app.world_mut().entity_mut(stage.pool).insert(Visibility::Hidden);
    let dry = stage.app.capture();
    stage.app.world_mut().entity_mut(stage.pool).insert(Visibility::Inherited);
    let wet = stage.app.capture();
    assert!(dry != wet);
    let good = stage.app.world().get::<PoolSurface>(stage.pool).expect("a pool").clone();
    let pool = stage.pool;
    for (what, level_m, tiles) in [
        ("not a number", f32::NAN, true),
        ("endless", f32::INFINITY, true),
        ("on the floor", 0.0, true),
        ("under the floor", -1e-3, true),
        ("no tiles", LEVEL_M, false),
    ] {
        let mut bad = good.clone();
        bad.level_m = level_m;
        bad.revision += 1;
        if !tiles {
            bad.wet_tiles.clear();
        }
        stage.app.world_mut().entity_mut(pool).insert(bad);
        assert!(stage.app.capture() == dry, "{what}");
    }
    let mut short = good.clone();
    short.texels.pop();
    stage.app.world_mut().entity_mut(pool).insert(short);
    assert!(stage.app.capture() == dry, "too few texels");
    // Walls only: all tiles are drawn, and nothing is in them.
    let mut walls = good.clone();
    walls.texels.fill([0; 4]);
    walls.revision += 2;
    stage.app.world_mut().entity_mut(pool).insert(walls);
    assert!(stage.app.capture() == dry, "walls");
    let mut again = good;
    again.revision += 3;
    stage.app.world_mut().entity_mut(pool).insert(again);
    assert!(stage.app.capture() == wet, "and back");
    // An eye in the fluid.
    stage.app.world_mut().entity_mut(stage.camera).insert(Transform::from_xyz(0.0, 0.0, 0.6 * LEVEL_M));
    let inside = stage.app.capture();
    stage.app.world_mut().entity_mut(pool).insert(Visibility::Hidden);
    assert!(inside == stage.app.capture());
}
