//! What is drawn anew: nothing that did not change, and everything that did.

use super::stage::{SIZE_PX, Shot, Stage, add_volume, lens};
use super::{SIZE, ball, points, solid, specimen, veil, volume_of};
use bevy::asset::RenderAssetUsages;
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::image::Image;
use bevy::light::GlobalAmbientLight;
use bevy::math::DVec3;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache, TextureFormat, TextureUsages};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::render::{RenderApp, RenderPlugin};
use bevy_surgery::SurgeryPlugins;
use bevy_surgery::testing::headless_render_plugins;
use bevy_surgery::view::{ScopeMask, StereoPair};
use bevy_surgery::volume::{CtVolume, VolumeLook, VolumeMethod};
use std::sync::{Arc, Mutex};

/// All pixels of the picture.
const ALL: u64 = SIZE_PX.x as u64 * SIZE_PX.y as u64;

fn specimen_stage() -> Stage {
    Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil())
}

/// The picture after everything was drawn anew.
fn redrawn_shot(stage: &mut Stage) -> Shot {
    let step_voxels = stage.look().step_voxels;
    stage.look().step_voxels = step_voxels * 0.5;
    stage.app.warm_up();
    stage.look().step_voxels = step_voxels;
    assert!(stage.redrawn()[0] > 0, "nothing was drawn anew");
    stage.shot()
}

fn assert_is_up_to_date(stage: &mut Stage, what: &str) {
    let shot = stage.shot();
    let anew = redrawn_shot(stage);
    let differing = shot.colour.iter().zip(&anew.colour).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "{what}: {differing} pixels differ from a picture that is drawn anew");
    assert!(shot.depth_m == anew.depth_m, "{what}: depths differ from those of a picture that is drawn anew");
}

#[test]
fn an_unchanged_view_costs_nothing() {
    for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
        let mut stage = specimen_stage();
        stage.look().method = method;
        let first = stage.shot();
        for _ in 0..3 {
            assert_eq!(stage.redrawn(), [0, 0], "{method:?}");
            assert_eq!(stage.uploaded(), 0, "{method:?}");
        }
        assert!(stage.shot() == first, "{method:?}: the picture stays");
        // To touch without changing is no change.
        stage.look().set_changed();
        stage.cut().set_changed();
        let volume = stage.volume;
        stage.set(volume, veil());
        stage.app.world_mut().get_mut::<Transform>(volume).expect("it is placed").set_changed();
        assert_eq!(stage.redrawn(), [0, 0], "{method:?}");
        assert_eq!(stage.uploaded(), 0, "{method:?}");
        // And what does change is noticed.
        stage.aim(Vec3::new(0.03, 0.02, 0.09), Vec3::ZERO);
        let [walked, shaded] = stage.redrawn();
        assert!(walked > ALL / 8 && walked <= ALL && shaded > ALL / 8, "{walked} {shaded} pixels");
        // Of a moved camera nothing travels for rays; for slices their corners, or the numbers of the polygons that show.
        let uploaded = stage.uploaded();
        let expected = if method == VolumeMethod::Rays { 0..1 } else { 500..65_536 };
        assert!(expected.contains(&uploaded), "{method:?}: {uploaded} bytes");
        assert_is_up_to_date(&mut stage, "moved camera");
    }
}

#[test]
fn two_eyes_that_see_the_same_cost_nothing() {
    let mut stage = specimen_stage();
    let camera = stage.camera;
    stage.set(camera, StereoPair::default());
    stage.set(camera, ScopeMask::default());
    stage.app.warm_up();
    // The second frame knows where the halves of the target are.
    stage.redrawn();
    for _ in 0..3 {
        assert_eq!(stage.redrawn(), [0, 0]);
    }
    stage.aim(Vec3::new(0.03, 0.02, 0.09), Vec3::ZERO);
    let [walked, _] = stage.redrawn();
    assert!(walked > ALL / 8, "{walked} pixels");
}

#[test]
fn light_and_film_only_shade() {
    let mut stage = specimen_stage();
    let before = stage.shot();
    stage.add_sun(Vec3::new(0.5, 0.2, -1.0), 800.0);
    let [walked, shaded] = stage.redrawn();
    assert!(walked == 0 && shaded > ALL / 8, "{walked} {shaded} pixels");
    assert!(stage.shot() != before, "the light is seen");
    assert_is_up_to_date(&mut stage, "light");
    for change in [
        (|look: &mut VolumeLook| look.wet.shine = 0.3) as fn(&mut VolumeLook),
        |look| look.wet.passes = 9,
        |look| look.wet.edge_voxels = 1.5,
        |look| look.wet.is_shaded = false,
    ] {
        let before = stage.shot();
        change(&mut stage.look());
        let [walked, shaded] = stage.redrawn();
        assert!(walked == 0 && shaded > ALL / 8, "{walked} {shaded} pixels");
        assert!(stage.shot() != before, "the change is seen: {:?}", stage.look().wet);
        assert_is_up_to_date(&mut stage, "film");
    }
}

#[test]
fn a_box_that_moves_is_walked_where_it_is_and_was() {
    for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
        let mut stage = Stage::with_materials(volume_of(SIZE, DVec3::ONE, specimen), veil());
        stage.look().method = method;
        let world = stage.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.003, 0.003, 0.003));
        let material = StandardMaterial { base_color: Color::srgb(0.0, 0.6, 0.0), unlit: true, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let place = |x: f32| Transform::from_xyz(x, 0.002, 0.009).with_rotation(Quat::from_rotation_y(x * 90.0));
        let cube = world.spawn((Mesh3d(mesh), MeshMaterial3d(material.clone()), place(-0.012))).id();
        let mut last = stage.shot();
        // One that comes later.
        let mesh = stage.app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.004, 0.002, 0.005));
        let new = (Mesh3d(mesh), MeshMaterial3d(material), Transform::from_xyz(-0.004, -0.006, 0.007));
        let new = stage.app.world_mut().spawn(new).id();
        assert_is_up_to_date(&mut stage, "new box");
        assert!(stage.shot() != last, "the new box is seen");
        stage.app.world_mut().despawn(new);
        assert!(stage.shot() == last, "nothing is left of the new box");
        for k in 1..5 {
            stage.set(cube, place(-0.012 + 0.003 * k as f32));
            let [walked, shaded] = stage.redrawn();
            let most = if method == VolumeMethod::Rays { ALL / 6 } else { ALL };
            assert!(walked > 20 && walked < most && shaded < ALL / 4, "{method:?}: {walked} {shaded} pixels");
            let shot = stage.shot();
            assert!(shot != last, "the box is seen");
            assert_is_up_to_date(&mut stage, "moved box");
            last = shot;
        }
        // Hidden, shown, of another shape, gone.
        stage.set(cube, Visibility::Hidden);
        assert_is_up_to_date(&mut stage, "hidden box");
        stage.set(cube, Visibility::Inherited);
        assert_is_up_to_date(&mut stage, "shown box");
        let larger = stage.app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.008, 0.004, 0.006));
        stage.set(cube, Mesh3d(larger.clone()));
        assert_is_up_to_date(&mut stage, "another box");
        let mut meshes = stage.app.world_mut().resource_mut::<Assets<Mesh>>();
        *meshes.get_mut(&larger).expect("it was added") = Cuboid::new(0.002, 0.012, 0.003).into();
        assert_is_up_to_date(&mut stage, "a mesh that was changed");
        stage.app.world_mut().despawn(cube);
        let gone = stage.shot();
        assert_is_up_to_date(&mut stage, "despawned box");
        assert!(gone.colour.iter().all(|texel| texel[1] < 0.9), "nothing is left of the box");
    }
}

#[test]
fn drilling_walks_and_uploads_what_it_touches() {
    for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
        let mut stage = specimen_stage();
        stage.look().method = method;
        let whole = stage.shot();
        let mut cuts = Vec::new();
        for k in 0..4 {
            let from = Vec3::new(-0.010 + 0.002 * k as f32, -0.003, 0.008);
            stage.drill(from, from + Vec3::new(0.001, 0.001, -0.002), 3e-3);
            let [walked, shaded] = stage.redrawn();
            // Slices cannot be taken back one by one: all of them are drawn again.
            let most = if method == VolumeMethod::Rays { ALL / 4 } else { ALL };
            assert!(walked > 20 && walked < most && shaded < ALL / 3, "{method:?}: {walked} {shaded} pixels");
            let uploaded = stage.uploaded();
            assert!((100..60_000).contains(&uploaded), "{uploaded} bytes");
            assert_is_up_to_date(&mut stage, "drilled");
            cuts.push(stage.shot());
        }
        for k in (0..4).rev() {
            assert!(stage.cut().undo());
            let expected = if k > 0 { &cuts[k - 1] } else { &whole };
            assert!(&stage.shot() == expected, "{method:?}: undoing stroke {k} restores the picture");
        }
        for expected in &cuts {
            assert!(stage.cut().redo());
            assert!(&stage.shot() == expected, "{method:?}: redoing restores the picture");
        }
        stage.cut().reset();
        assert!(stage.shot() == whole, "{method:?}: a reset restores the picture");
        // Two changes between frames, one of which takes the other back.
        stage.drill(Vec3::new(-0.010, -0.003, 0.008), Vec3::new(-0.008, -0.003, 0.006), 3e-3);
        assert!(stage.cut().undo());
        assert!(stage.shot() == whole, "{method:?}: nothing is left of what no frame saw");
    }
}

#[test]
fn another_transfer_function_uploads_no_voxels() {
    let mut stage = specimen_stage();
    let veiled = stage.shot();
    let volume = stage.volume;
    let blocks = (SIZE / 4).element_product();
    for transfer in [solid([40, 200, 90]), points(&[]), veil()] {
        stage.set(volume, transfer.clone());
        let [walked, _] = stage.redrawn();
        let uploaded = stage.uploaded();
        assert!(uploaded <= u64::from(1024 * 16 + blocks), "{uploaded} bytes");
        assert!(uploaded >= 1024 * 16, "{uploaded} bytes are no table");
        assert!(walked > 0 || transfer.points.is_empty(), "nothing was walked");
        let shot = stage.shot();
        let mut fresh = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), transfer);
        assert!(shot == fresh.shot(), "the picture is that of a volume that had this from the start");
    }
    assert!(stage.shot() == veiled, "the first one restores the picture");
    // A step that is not the same bakes another table, and nothing else either.
    stage.look().step_voxels = 0.5;
    stage.redrawn();
    assert!(stage.uploaded() <= u64::from(1024 * 16 + blocks), "{} bytes", stage.uploaded());
}

#[test]
fn what_was_hidden_comes_back_as_it_is_by_then() {
    let mut stage = specimen_stage();
    let whole = stage.shot();
    let volume = stage.volume;
    stage.set(volume, Visibility::Hidden);
    assert!(stage.shot().colour.iter().all(|texel| *texel == [0.0; 4]), "nothing is seen of a hidden volume");
    stage.set(volume, Visibility::Inherited);
    assert!(stage.shot() == whole, "the picture comes back");
    // Drilled, and in other colours, while nobody sees it.
    stage.set(volume, Visibility::Hidden);
    stage.app.warm_up();
    stage.drill(Vec3::new(-0.010, -0.003, 0.008), Vec3::new(-0.008, -0.003, 0.004), 4e-3);
    stage.app.idle();
    stage.drill(Vec3::new(-0.006, -0.003, 0.008), Vec3::new(-0.004, -0.003, 0.004), 4e-3);
    stage.app.warm_up();
    stage.set(volume, Visibility::Inherited);
    let drilled = stage.shot();
    assert!(drilled != whole, "the hole is seen");
    assert_is_up_to_date(&mut stage, "drilled while hidden");
    // Seen from elsewhere and again from here.
    let camera = stage.camera;
    let here = *stage.app.world().get::<Transform>(camera).expect("it is placed");
    stage.aim(Vec3::new(0.0, 0.0, 0.09), Vec3::new(0.0, 0.0, 0.2));
    assert!(stage.shot().colour.iter().all(|texel| *texel == [0.0; 4]), "the camera looks away");
    assert!(stage.cut().undo());
    stage.app.idle();
    assert!(stage.cut().redo());
    stage.set(camera, here);
    assert!(stage.shot() == drilled, "the picture comes back");
    // A camera that pauses.
    let set_active = |stage: &mut Stage, is_active| {
        stage.app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = is_active;
    };
    set_active(&mut stage, false);
    stage.app.warm_up();
    assert!(stage.cut().undo() && stage.cut().undo());
    stage.app.warm_up();
    set_active(&mut stage, true);
    assert!(stage.shot() == whole, "a camera that paused shows what is there by then");
}

#[test]
fn a_target_of_another_size_is_filled() {
    let mut stage = specimen_stage();
    let first = stage.shot();
    let target = stage.app.target().image;
    let resize = |stage: &mut Stage, size: UVec2| {
        let mut image = Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        image.asset_usage = RenderAssetUsages::default();
        let mut images = stage.app.world_mut().resource_mut::<Assets<Image>>();
        images.insert(target.id(), image).expect("its place is there");
    };
    resize(&mut stage, UVec2::new(200, 60));
    stage.app.warm_up();
    // Larger, and at once smaller.
    resize(&mut stage, UVec2::new(40, 130));
    stage.app.idle();
    resize(&mut stage, SIZE_PX);
    assert!(stage.shot() == first, "the picture comes back with its size");
}

#[test]
fn a_mask_comes_and_goes() {
    let mut stage = specimen_stage();
    let camera = stage.camera;
    let open = stage.shot();
    let [walked_open, _] = {
        stage.aim(Vec3::new(0.021, 0.03, 0.09), Vec3::ZERO);
        stage.redrawn()
    };
    assert!(walked_open > 0);
    stage.aim(super::stage::EYE, Vec3::ZERO);
    stage.set(camera, ScopeMask { radius: 0.5, softness: 0.0, ..default() });
    let masked = stage.shot();
    let (mut inside, mut outside) = (0, 0);
    for (place, (masked, open)) in masked.colour.iter().zip(&open.colour).enumerate() {
        let at = Vec2::new((place as u32 % SIZE_PX.x) as f32, (place as u32 / SIZE_PX.x) as f32) + 0.5;
        let radius = at.distance(SIZE_PX.as_vec2() * 0.5) / (SIZE_PX.y as f32 * 0.5);
        if open[3] < 0.1 {
            continue;
        }
        if radius < 0.42 {
            // Smoothing takes in neighbours, so only colours at the rim of the mask may change.
            inside += usize::from(masked[3] == open[3]);
            assert!((masked[3] - open[3]).abs() < 1e-3, "{masked:?} {open:?}");
        } else if radius > 0.52 {
            outside += 1;
            assert_eq!(masked[3], 0.0, "nothing is drawn where the mask hides it");
        }
    }
    assert!(inside > 500 && outside > 200, "{inside} {outside} pixels");
    stage.app.world_mut().entity_mut(camera).remove::<ScopeMask>();
    assert!(stage.shot() == open, "without its mask the picture is whole");
}

#[test]
fn a_volume_that_moves_behind_another_is_seen_through_it() {
    let veil = points(&[(0.4, [255, 255, 255], 0.0), (0.6, [255, 255, 255], 0.08)]);
    let mut stage = Stage::new(ball(20.0), veil);
    let other = add_volume(&mut stage.app, ball(6.0), solid([0, 255, 0]));
    // Its middle is farther away, so that it is drawn first.
    let place = |x: f32| Transform::from_xyz(x, -0.002, -0.003);
    stage.set(other, place(-0.006));
    stage.app.warm_up();
    let first = stage.shot();
    for x in [-0.003, 0.004, 0.008] {
        stage.set(other, place(x));
        assert_is_up_to_date(&mut stage, "moved volume");
    }
    stage.set(other, Visibility::Hidden);
    assert_is_up_to_date(&mut stage, "hidden volume");
    stage.set(other, Visibility::Inherited);
    assert_is_up_to_date(&mut stage, "shown volume");
    stage.set(other, solid([0, 0, 255]));
    assert_is_up_to_date(&mut stage, "recoloured volume");
    stage.set(other, points(&[]));
    assert_is_up_to_date(&mut stage, "invisible volume");
    stage.set(other, solid([0, 255, 0]));
    stage.set(other, place(-0.006));
    assert!(stage.shot() == first, "the first picture comes back");
    stage.app.world_mut().despawn(other);
    assert_is_up_to_date(&mut stage, "despawned volume");
}

/// An app whose pipelines compile while frames go on, as they do in games.
struct Late {
    app: App,
    target: Handle<Image>,
}

impl Late {
    fn new() -> Self {
        let mut app = App::new();
        let plugins =
            headless_render_plugins().set(RenderPlugin { synchronous_pipeline_compilation: false, ..default() });
        app.add_plugins((plugins, PbrPlugin::default(), SurgeryPlugins));
        app.insert_resource(GlobalAmbientLight { brightness: 1000.0, ..GlobalAmbientLight::NONE });
        let mut image = Image::new_target_texture(SIZE_PX.x, SIZE_PX.y, TextureFormat::Rgba8UnormSrgb, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        let target = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let place = Transform::from_xyz(0.0, 0.0, 0.09);
        let onto = RenderTarget::Image(target.clone().into());
        app.world_mut().spawn((Camera3d::default(), onto, lens(), Tonemapping::None, Msaa::Off, place));
        app.finish();
        app.cleanup();
        Self { app, target }
    }

    /// Frames until every pipeline is there; says how often one was not.
    fn settle(&mut self) -> u32 {
        let (mut quiet, mut waited) = (0, 0);
        while quiet < 8 {
            self.app.update();
            let cache = self.app.sub_app(RenderApp).world().resource::<PipelineCache>();
            let is_busy = cache.pipelines().any(|pipeline| !matches!(pipeline.state, CachedPipelineState::Ok(_)));
            quiet = if is_busy { 0 } else { quiet + 1 };
            waited += u32::from(is_busy);
            std::thread::sleep(std::time::Duration::from_millis(1));
            assert!(waited < 60_000, "pipelines take a minute");
        }
        waited
    }

    fn capture(&mut self) -> Vec<u8> {
        let taken: Arc<Mutex<Option<Vec<u8>>>> = default();
        let slot = taken.clone();
        self.app.world_mut().spawn(Screenshot::image(self.target.clone())).observe(
            move |shot: On<ScreenshotCaptured>| {
                *slot.lock().expect("only this closure locks it") = shot.image.data.clone();
            },
        );
        for _ in 0..1000 {
            self.app.update();
            if let Some(pixels) = taken.lock().expect("only the observer locks it").take() {
                return pixels;
            }
        }
        panic!("no screenshot came");
    }
}

#[test]
fn what_appears_when_its_pipeline_is_ready_is_noticed() {
    let mut late = Late::new();
    let veil = points(&[(0.4, [255, 255, 255], 0.0), (0.6, [255, 255, 255], 0.08)]);
    let volume = late.app.world_mut().resource_mut::<Assets<_>>().add(ball(15.0));
    let volume = late.app.world_mut().spawn((CtVolume(volume), veil)).id();
    // The volume's own pipelines come late here.
    assert!(late.settle() > 0, "pipelines were there at once: this test sees nothing");
    let veiled = late.capture();
    assert!(veiled.chunks(4).filter(|pixel| pixel[0] > 100).count() > 1000, "the volume is seen");
    // And those of a box that stands in it.
    let world = late.app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(0.008, 0.008, 0.008));
    let material = StandardMaterial { base_color: Color::BLACK, unlit: true, ..default() };
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material)));
    assert!(late.settle() > 0, "the box was there at once: this test sees nothing");
    let seen = late.capture();
    let mut look = late.app.world_mut().get_mut::<VolumeLook>(volume).expect("it comes with the volume");
    look.step_voxels = 0.5;
    late.settle();
    late.app.world_mut().get_mut::<VolumeLook>(volume).expect("it comes with the volume").step_voxels = 1.0;
    late.settle();
    let anew = late.capture();
    assert!(veiled != anew, "the box is seen");
    let differing = seen.chunks(4).zip(anew.chunks(4)).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "{differing} pixels differ from a picture that is drawn anew");
}
