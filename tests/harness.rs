//! The harness itself: exact steps, pictures, and that it fails when it should.

use crate::support::{plain_skin, sphere_organ};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::render::shader_path;
use bevy_surgery::testing::TestApp;
use std::panic::{AssertUnwindSafe, catch_unwind};

#[derive(Resource, Default)]
struct Counted(u32);

fn count(app: &mut TestApp) {
    app.init_resource::<Counted>().add_systems(FixedUpdate, |mut counted: ResMut<Counted>| counted.0 += 1);
}

fn counted(app: &TestApp) -> u32 {
    app.world().resource::<Counted>().0
}

/// What a closure panics with.
fn panic_of(closure: impl FnOnce()) -> Option<String> {
    let payload = catch_unwind(AssertUnwindSafe(closure)).err()?;
    let text = payload.downcast_ref::<String>().cloned();
    text.or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
}

#[test]
fn steps_are_exact_from_the_first() {
    let mut app = TestApp::cpu();
    count(&mut app);
    app.step(1);
    assert_eq!(counted(&app), 1);
    app.idle();
    app.idle();
    assert_eq!(counted(&app), 1, "idling takes no step");
    app.step(599);
    assert_eq!(counted(&app), 600);
    let stepped = app.world().resource::<Time<Fixed>>().elapsed_secs_f64();
    assert!((stepped - 10.0).abs() < 1e-6, "600 steps at 60 Hz are 10 s, not {stepped}");
}

#[test]
fn a_falling_body_obeys_the_closed_form() {
    #[derive(Resource, Default)]
    struct Fall {
        speed: f64,
        depth: f64,
    }
    let mut app = TestApp::cpu();
    app.init_resource::<Fall>().add_systems(
        FixedUpdate,
        (|time: Res<Time>, mut fall: ResMut<Fall>| {
            let dt = time.delta_secs_f64();
            fall.depth += (fall.speed + 0.5 * 9.81 * dt) * dt;
            fall.speed += 9.81 * dt;
        })
        .in_set(SurgerySystems::Deform),
    );
    app.step(120);
    let depth = app.world().resource::<Fall>().depth;
    assert!((depth - 0.5 * 9.81 * 4.0).abs() < 1e-6, "half a t squared after 2 s, not {depth}");
}

#[test]
fn a_paused_clock_is_noticed() {
    let mut app = TestApp::cpu();
    count(&mut app);
    app.step(1);
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    let reason = panic_of(|| app.step(1)).expect("no step ran, and the harness must say so");
    assert!(reason.contains("paused"), "{reason}");
}

#[test]
fn drawing_takes_exact_steps_too_and_capture_takes_none() {
    let mut app = TestApp::gpu(32, 32);
    count(&mut app);
    app.spawn_camera(Transform::default());
    app.insert_resource(ClearColor(Color::srgb_u8(10, 200, 30)));
    app.step(3);
    let picture = app.capture();
    assert_eq!(counted(&app), 3);
    assert_eq!(picture.dimensions(), (32, 32));
    assert_eq!(picture.get_pixel(5, 7).0, [10, 200, 30, 255]);
}

#[test]
fn a_black_picture_fails() {
    let mut app = TestApp::gpu(16, 16);
    app.spawn_camera(Transform::default());
    app.insert_resource(ClearColor(Color::BLACK));
    let reason = panic_of(|| drop(app.capture())).expect("a black picture must not pass");
    assert!(reason.contains("black"), "{reason}");
    let allowed = app.capture_even_if_black();
    assert!(allowed.pixels().all(|pixel| pixel.0[..3] == [0, 0, 0]));
}

#[test]
fn a_broken_shader_fails() {
    let mut app = TestApp::gpu(32, 32);
    app.spawn_camera(Transform::from_xyz(0.0, 0.0, 0.5));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.1));
    app.world_mut().spawn((Organ(organ), plain_skin([200, 90, 60])));
    app.warm_up();
    let shader = app.world().resource::<AssetServer>().load::<Shader>(shader_path("skin/skin.wgsl"));
    let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
    let broken = Shader::from_wgsl("@fragment fn fragment() -> nonsense { return 1; }", "skin/skin.wgsl");
    shaders.insert(shader.id(), broken).expect("the shader's place is there");
    let reason = panic_of(|| app.step(3)).expect("a shader that does not compile must fail the test");
    assert!(reason.contains("pipeline skin failed"), "{reason}");
}

#[test]
fn a_wgpu_error_fails() {
    use bevy::render::render_resource::{BufferDescriptor, BufferUsages};
    let mut app = TestApp::gpu(16, 16);
    app.spawn_camera(Transform::default());
    app.step(1);
    let reason = panic_of(|| {
        let device = app.world().resource::<bevy::render::renderer::RenderDevice>();
        device.create_buffer(&BufferDescriptor {
            label: Some("invalid"),
            size: 16,
            usage: BufferUsages::empty(),
            mapped_at_creation: false,
        });
        app.step(2);
    });
    assert!(reason.expect("an invalid buffer must fail the test").contains("Validation"));
}

#[test]
fn a_file_that_is_no_organ_fails_with_its_name() {
    let mut app = TestApp::gpu(16, 16);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("rubbish.obj");
    std::fs::write(&file, "v 0 0 nan\nf 1 1 1\n").expect("written");
    let organ: Handle<OrganModel> =
        app.world().resource::<AssetServer>().load_builder().override_unapproved().load(file);
    app.world_mut().spawn(Organ(organ));
    let reason = panic_of(|| app.warm_up()).expect("an organ that cannot load must fail the warm-up");
    assert!(reason.contains("rubbish.obj"), "{reason}");
}
