//! The tile sets of an app: what is kept, what is dropped, what fails once, and what numbers reach the GPU.

use crate::support::{plain_skin, sphere_organ};
use bevy::asset::AssetPlugin;
use bevy::asset::io::AssetSourceBuilder;
use bevy::asset::io::memory::{Dir, MemoryAssetReader};
use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy_surgery::SurgeryPlugins;
use bevy_surgery::prelude::*;
use bevy_surgery::render::LightUniform;
use bevy_surgery::skin::tiles::{TileError, TileOptions, TileSet};
use bevy_surgery::skin::{SkinTexture, SkinTileLibrary, TileSource};
use bevy_surgery::testing::{TestApp, headless_render_plugins};
use std::path::Path;
use std::time::{Duration, Instant};

/// Updates after which nothing unused may be left.
const LONG: usize = 70;

fn small_tiles(seed: u64) -> TileOptions {
    TileOptions { resolution_px: 64, cells_per_edge: 4.0, seed, ..default() }
}

fn skin_of(tiles: TileSource) -> Skin {
    Skin { tiles, ..Skin::liver() }
}

fn generated(seed: u64) -> Skin {
    skin_of(TileSource::Generated(small_tiles(seed)))
}

fn painted(files: [String; 4]) -> Skin {
    skin_of(TileSource::Painted(files))
}

/// An app that makes tiles and draws nothing, and an entity for skins.
fn library_app(skin: Skin) -> (TestApp, Entity) {
    let mut app = TestApp::gpu(8, 8);
    let entity = app.world_mut().spawn(skin).id();
    (app, entity)
}

fn failures(app: &App) -> Vec<TileError> {
    app.world().resource::<SkinTileLibrary>().failures().cloned().collect()
}

fn image_count(app: &App) -> usize {
    app.world().resource::<Assets<Image>>().len()
}

fn idle(app: &mut TestApp, updates: usize) {
    for _ in 0..updates {
        app.idle();
    }
}

fn tiles_of(app: &App, entity: Entity) -> Option<Handle<Image>> {
    app.world().get::<SkinTexture>(entity).map(|texture| texture.tiles.clone())
}

/// The bytes in the main world of the tiles that an entity wears.
fn bytes_of(app: &App, entity: Entity) -> Option<Vec<u8>> {
    app.world().resource::<Assets<Image>>().get(&tiles_of(app, entity)?)?.data.clone()
}

#[test]
fn options_that_are_not_numbers_fail_once() {
    let options = TileOptions { wobble: f32::NAN, ..small_tiles(1) };
    let (mut app, _) = library_app(skin_of(TileSource::Generated(options)));
    app.idle_until("the failure", |app| !failures(app).is_empty());
    for _ in 0..50 {
        app.idle();
        assert!(!app.world().resource::<SkinTileLibrary>().is_busy(), "it is tried again and again");
    }
    let failures = failures(&app);
    assert!(matches!(failures.as_slice(), [TileError::Options { field: "wobble", .. }]), "{failures:?}");
}

#[test]
fn edits_leave_no_images_behind() {
    let (mut app, entity) = library_app(generated(0));
    app.warm_up();
    let before = image_count(&app);
    // A designer who looks at each seed.
    for seed in 1..=20 {
        let worn = tiles_of(&app, entity);
        app.world_mut().entity_mut(entity).insert(generated(seed));
        app.idle_until("the new tiles", |app| tiles_of(app, entity) != worn);
    }
    assert!(image_count(&app) > before, "the sets were never there together: this test sees nothing");
    idle(&mut app, LONG);
    assert_eq!(image_count(&app), before);
    // One who drags a slider.
    for seed in 21..=40 {
        app.world_mut().entity_mut(entity).insert(generated(seed));
        app.idle();
    }
    app.warm_up();
    idle(&mut app, LONG);
    assert_eq!(image_count(&app), before);
    assert_eq!(bytes_of(&app, entity), TileSet::generate(&small_tiles(40)).ok().map(|set| set.gpu_bytes()));
    app.world_mut().entity_mut(entity).despawn();
    idle(&mut app, LONG);
    assert_eq!(image_count(&app), before - 1, "a despawned organ keeps its tiles");
}

#[test]
fn a_skin_taken_off_for_a_moment_keeps_its_tiles() {
    let (mut app, entity) = library_app(generated(1));
    let other = app.world_mut().spawn(generated(1)).id();
    app.warm_up();
    let worn = tiles_of(&app, entity);
    assert!(worn.is_some() && worn == tiles_of(&app, other), "two organs share one set");
    app.world_mut().entity_mut(other).despawn();
    app.world_mut().entity_mut(entity).remove::<Skin>();
    idle(&mut app, 5);
    assert_eq!(tiles_of(&app, entity), None, "no skin, no texture");
    app.world_mut().entity_mut(entity).insert(generated(1));
    idle(&mut app, 2);
    assert_eq!(tiles_of(&app, entity), worn);
    // The same handle for other tiles would be no proof.
    app.world_mut().entity_mut(entity).insert(generated(2));
    app.idle_until("other tiles", |app| tiles_of(app, entity) != worn);
}

#[test]
fn painted_files_that_were_missing_are_read_when_the_skin_is_set_anew() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files: [String; 4] =
        std::array::from_fn(|tile| folder.path().join(format!("skin-{tile}.png")).to_string_lossy().to_string());
    let (mut app, entity) = library_app(painted(files.clone()));
    app.idle_until("the failure", |app| !failures(app).is_empty());
    idle(&mut app, 10);
    let failed = failures(&app);
    assert!(matches!(failed.as_slice(), [TileError::Png { name, .. }] if *name == files[0]), "{failed:?}");
    let set = TileSet::generate(&small_tiles(7)).expect("sensible options");
    set.save_png(folder.path(), "skin").expect("a folder of ours");
    app.world_mut().entity_mut(entity).insert(generated(1));
    app.idle_until("the skin in between", |app| tiles_of(app, entity).is_some());
    assert_eq!(failures(&app), []);
    app.world_mut().entity_mut(entity).insert(painted(files));
    app.idle_until("the painted skin", |app| bytes_of(app, entity) == Some(set.gpu_bytes()));
    assert_eq!(failures(&app), []);
}

#[test]
fn painted_tiles_come_from_the_asset_folder_and_from_any_source() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let subfolder = folder.path().join("skins");
    std::fs::create_dir(&subfolder).expect("a folder of ours");
    let [filed, packed] = [3, 4].map(|seed| TileSet::generate(&small_tiles(seed)).expect("sensible options"));
    filed.save_png(&subfolder, "filed").expect("a folder of ours");
    let memory = Dir::default();
    for (tile, file) in packed.save_png(folder.path(), "packed").expect("a folder of ours").iter().enumerate() {
        let bytes = std::fs::read(file).expect("just written");
        memory.insert_asset(Path::new(&format!("packed-{tile}.png")), bytes);
        std::fs::remove_file(file).expect("just written");
    }

    let mut app = App::new();
    app.register_asset_source(
        "memory",
        AssetSourceBuilder::new(move || Box::new(MemoryAssetReader { root: memory.clone() })),
    );
    let assets = AssetPlugin { file_path: folder.path().to_string_lossy().to_string(), ..default() };
    app.add_plugins((headless_render_plugins().set(assets), SurgeryPlugins));
    let wanted = [("skins/filed", filed), ("memory://packed", packed)].map(|(prefix, set)| {
        let files = std::array::from_fn(|tile| format!("{prefix}-{tile}.png"));
        (app.world_mut().spawn(painted(files)).id(), set.gpu_bytes())
    });
    let absent = app.world_mut().spawn(painted(["nowhere://a.png"; 4].map(String::from))).id();
    app.finish();
    app.cleanup();
    let started = Instant::now();
    while !wanted.iter().all(|(entity, bytes)| bytes_of(&app, *entity).as_ref() == Some(bytes)) {
        assert!(started.elapsed() < Duration::from_secs(60), "not loaded: {:?}", failures(&app));
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    while failures(&app).is_empty() {
        assert!(started.elapsed() < Duration::from_secs(60), "an unknown source is an error");
        app.update();
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(tiles_of(&app, absent), None);
    let failed = failures(&app);
    assert!(matches!(failed.as_slice(), [TileError::Png { what, .. }] if what.contains("nowhere")), "{failed:?}");
}

fn scope_app(skin: Skin, light: ScopeLight, mask: ScopeMask) -> TestApp {
    let mut app = TestApp::gpu(48, 36);
    app.insert_resource(ClearColor(Color::srgb_u8(0, 0, 200))).insert_resource(GlobalAmbientLight::NONE);
    let target = bevy::camera::RenderTarget::Image(app.target().image.into());
    // Linear HDR, so that a NaN would survive up to tonemapping.
    app.world_mut().spawn((Endoscope::default(), light, mask, target, Transform::from_xyz(0.0, 0.0, 0.2)));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.05));
    app.world_mut().spawn((Organ(organ), skin));
    app
}

fn skin_with(value: f32) -> Skin {
    Skin {
        tint: Color::linear_rgb(value, value, value),
        mottle: value,
        mottle_size_m: value,
        scatter: value,
        sheen: value,
        sheen_roughness: value,
        relief_m: value,
        ..plain_skin([200, 120, 90])
    }
}

fn light_with(value: f32) -> ScopeLight {
    ScopeLight {
        colour: Color::linear_rgb(value, value, value),
        intensity_cd: value,
        ring_radius_m: value,
        inner_angle_rad: value,
        outer_angle_rad: value,
        ambient_fraction: value,
    }
}

#[test]
fn numbers_that_are_not_finite_draw_a_plain_skin_under_a_plain_light() {
    let plain_light = ScopeLight { colour: Color::WHITE, ..default() };
    let wanted = scope_app(plain_skin([200, 120, 90]), plain_light, ScopeMask::default()).capture();
    let centre = wanted.get_pixel(24, 18).0;
    assert!(centre[0] > centre[1] && centre[1] > centre[2] && centre[2] > 10, "the organ is seen: {centre:?}");
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mask = ScopeMask { radius: value, softness: value, colour: Color::linear_rgba(value, value, value, value) };
        let picture = scope_app(skin_with(value), light_with(value), mask).capture();
        assert!(picture == wanted, "{value} changes the picture; its centre is {:?}", picture.get_pixel(24, 18));
    }
}

#[test]
fn numbers_out_of_range_are_drawn_as_the_nearest_in_range() {
    let picture = |skin: Skin, mask: ScopeMask| scope_app(skin, ScopeLight::default(), mask).capture_even_if_black();
    let most = Skin { sheen_roughness: 1.0, relief_m: 0.1, scatter: 1.0, mottle: 1.0, sheen: 100.0, ..skin_with(10.0) };
    let most = Skin { mottle_size_m: 1e6, ..most };
    let wide = |radius, softness| ScopeMask { radius, softness, ..default() };
    assert!(picture(skin_with(f32::MAX), wide(f32::MAX, f32::MAX)) == picture(most, wide(100.0, 100.0)), "too large");
    // White, because a black organ would hide the rest.
    let least = Skin { tint: Color::WHITE, ..skin_with(f32::MIN) };
    let none = Skin { sheen_roughness: 0.05, relief_m: -0.1, mottle_size_m: 1e-6, ..skin_with(0.0) };
    let none = picture(Skin { tint: Color::WHITE, ..none }, ScopeMask::default());
    assert!(none.get_pixel(24, 18).0[0] > 20, "the organ is seen");
    assert!(picture(least, ScopeMask::default()) == none, "too small");
    let edge = picture(plain_skin([200, 120, 90]), wide(0.0, 0.5));
    assert!(edge.get_pixel(24, 16).0[0] > 5, "the soft edge reaches from the middle outwards");
    assert!(picture(plain_skin([200, 120, 90]), wide(-3.0, 0.5)) == edge, "a radius below 0");
    assert!(
        picture(plain_skin([200, 120, 90]), wide(0.5, -3.0)) == picture(plain_skin([200, 120, 90]), wide(0.5, 0.0))
    );
}

#[test]
fn the_scope_light_is_finite_whatever_its_numbers() {
    let numbers = |light: &LightUniform| {
        let [colour, place, direction] =
            [light.colour, light.position_world_m, light.direction_world].map(|vector| vector.to_array());
        let scalars = [light.ring_radius_m, light.cone_scale, light.cone_offset, light.ambient_fraction];
        [colour.as_slice(), &place, &direction, &scalars].concat()
    };
    let point = Vec3::new(0.01, 0.02, -0.1);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, -1.0, 0.0] {
        let light = light_with(value).to_uniform(&GlobalTransform::default());
        assert!(numbers(&light).iter().all(|number| number.is_finite()), "{value}: {light:?}");
        assert!((0.0..=1.0).contains(&light.ambient_fraction) && light.ring_radius_m >= 0.0, "{value}: {light:?}");
        let lux = light.illuminance_lux(point);
        assert!(lux.is_finite() && lux.min_element() >= 0.0, "{value}: {lux}");
        for transform in [Transform::from_translation(Vec3::splat(value)), Transform::from_scale(Vec3::splat(value))] {
            let light = ScopeLight::default().to_uniform(&transform.into());
            assert!(numbers(&light).iter().all(|number| number.is_finite()), "{transform:?}: {light:?}");
            assert!(light.illuminance_lux(point).is_finite(), "{transform:?}: {light:?}");
        }
    }
    let crossed = ScopeLight { inner_angle_rad: 1.2, outer_angle_rad: 0.4, ..default() };
    let sharp = ScopeLight { inner_angle_rad: 0.4, outer_angle_rad: 0.4, ..default() };
    let [crossed, sharp] = [crossed, sharp].map(|light| light.to_uniform(&GlobalTransform::default()));
    assert_eq!(crossed, sharp, "the inner angle ends at the outer one");
}
