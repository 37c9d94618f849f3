//! The microscope, its two eyes, and monitors.

use crate::support::{plain_skin, sphere_organ};
use bevy::camera::primitives::Frustum;
use bevy::camera::{CameraProjection, Projection, RenderTarget, Viewport};
use bevy::light::GlobalAmbientLight;
use bevy::prelude::*;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::view::{StereoEye, StereoEyes};
use image::RgbaImage;

/// A microscope that looks down from the origin along -Z at something 25 cm away, for two eyes.
fn pair(width_px: u32, height_px: u32, pair: StereoPair) -> (TestApp, Entity) {
    let mut app = TestApp::gpu(width_px, height_px);
    app.insert_resource(ClearColor(Color::srgb_u8(0, 200, 0)))
        .insert_resource(GlobalAmbientLight { brightness: 1500.0, ..default() });
    let target = RenderTarget::Image(app.target().image.into());
    let rig = app.world_mut().spawn((Microscope::default(), pair, target)).id();
    app.idle();
    app.idle();
    (app, rig)
}

fn eyes(app: &TestApp, rig: Entity) -> [Entity; 2] {
    let eyes = app.world().get::<StereoEyes>(rig).expect("a pair has eyes");
    assert_eq!(app.world().get::<StereoEye>(eyes.left), Some(&StereoEye::Left));
    assert_eq!(app.world().get::<StereoEye>(eyes.right), Some(&StereoEye::Right));
    [eyes.left, eyes.right]
}

/// Where a camera sees a point, in halves of its picture.
fn seen(app: &TestApp, camera: Entity, point: Vec3) -> Vec2 {
    let entity = app.world().entity(camera);
    let (camera, place) = (entity.get::<Camera>().expect("a camera"), entity.get::<GlobalTransform>().expect("placed"));
    camera.world_to_ndc(place, point).expect("before the camera").truncate()
}

#[test]
fn eyes_see_the_parallax_of_the_closed_form() {
    let (mut app, rig) = pair(240, 120, StereoPair::default());
    let [left, right] = eyes(&app, rig);
    // The field of 50 mm under 25 cm, over a square half.
    let tan_half = 0.1;
    let points = [(0.0, 0.0, 0.25), (0.01, -0.02, 0.25), (0.0, 0.0, 0.2), (-0.015, 0.01, 0.22), (0.02, 0.02, 0.4)];
    let mut check = |settings: StereoPair, convergence_m: f32| {
        app.world_mut().entity_mut(rig).insert(settings.clone());
        app.idle();
        for (x, y, depth_m) in points {
            let point = Vec3::new(x, y, -depth_m);
            let (from_left, from_right) = (seen(&app, left, point), seen(&app, right, point));
            let parallax = from_left.x - from_right.x;
            let wanted = settings.parallax(depth_m, convergence_m, tan_half);
            let closed = settings.interocular_m * (1.0 / depth_m - 1.0 / convergence_m) / tan_half;
            assert!((wanted - closed).abs() < 1e-6);
            assert!((parallax - wanted).abs() < 1e-5, "{parallax} instead of {wanted} for {settings:?} at {point}");
            assert!((from_left.y - from_right.y).abs() < 1e-6, "eyes never see one higher than the other");
            assert!((from_left.y - y / depth_m / tan_half).abs() < 1e-5, "{from_left}");
            // The middle of both is what one eye between them sees.
            let middle = (from_left.x + from_right.x) / 2.0;
            assert!((middle - x / depth_m / tan_half).abs() < 1e-5, "{middle}");
            // What is seen is not culled, at the shifted edges neither.
            for eye in [left, right] {
                let frustum = app.world().get::<Frustum>(eye).expect("a camera has one");
                for share in [-0.999, 0.999] {
                    let entity = app.world().entity(eye);
                    let (camera, place) = (entity.get::<Camera>(), entity.get::<GlobalTransform>());
                    let edge = camera
                        .zip(place)
                        .and_then(|(camera, place)| camera.ndc_to_world(place, Vec3::new(share, 0.0, 0.01 / depth_m)));
                    let edge = edge.expect("on the picture's edge");
                    assert!((edge.z + depth_m).abs() < 1e-4, "{edge}");
                    assert!(frustum.half_spaces.iter().all(|half| half.normal_d().dot(edge.extend(1.0)) > -1e-6));
                }
            }
        }
    };
    check(StereoPair::default(), 0.25);
    check(StereoPair { interocular_m: 0.06, ..default() }, 0.25);
    check(StereoPair { interocular_m: 0.0, ..default() }, 0.25);
    check(StereoPair { convergence_m: Some(0.3), ..default() }, 0.3);
    app.world_mut().get_mut::<Microscope>(rig).expect("a microscope").working_distance_m = 0.3;
    app.idle();
    let apart = seen(&app, left, Vec3::NEG_Z * 0.3) - seen(&app, right, Vec3::NEG_Z * 0.3);
    assert!(apart.length() < 1e-5, "focus and convergence go together");
}

#[test]
fn each_eye_has_its_half() {
    let (mut app, rig) = pair(241, 120, StereoPair::default());
    let halves = |app: &TestApp| {
        eyes(app, rig).map(|eye| {
            let camera = app.world().get::<Camera>(eye).expect("a camera");
            assert!(camera.is_active);
            let rect = camera.physical_viewport_rect().expect("a viewport");
            (rect.min.x, rect.width(), rect.height(), camera.order)
        })
    };
    assert_eq!(halves(&app), [(0, 120, 120, 0), (120, 120, 120, 1)]);
    assert!(!app.world().get::<Camera>(rig).expect("a camera").is_active, "the eyes draw instead of it");
    app.world_mut().get_mut::<StereoPair>(rig).expect("a pair").is_crossed = true;
    app.world_mut().get_mut::<Camera>(rig).expect("a camera").order = 5;
    app.idle();
    assert_eq!(halves(&app), [(120, 120, 120, 5), (0, 120, 120, 6)]);
    // A part of the target, as between an editor's panels.
    let part = Viewport { physical_position: UVec2::new(30, 20), physical_size: UVec2::new(100, 60), ..default() };
    app.world_mut().get_mut::<Camera>(rig).expect("a camera").viewport = Some(part);
    app.idle();
    assert_eq!(halves(&app), [(80, 50, 60, 5), (30, 50, 60, 6)]);
    app.world_mut().get_mut::<Camera>(rig).expect("a camera").viewport = None;
    app.idle();
    // Another size of the target, and a setting of the camera.
    let image = app.target().image;
    let mut images = app.world_mut().resource_mut::<Assets<Image>>();
    let mut image = images.get_mut(&image).expect("the target");
    image.resize(bevy::render::render_resource::Extent3d { width: 100, height: 50, depth_or_array_layers: 1 });
    drop(image);
    app.world_mut().entity_mut(rig).insert(Msaa::Sample4).remove::<ScopeMask>();
    app.idle();
    app.idle();
    assert_eq!(halves(&app), [(50, 50, 50, 5), (0, 50, 50, 6)]);
    let before = eyes(&app, rig);
    for eye in before {
        assert_eq!(app.world().get::<Msaa>(eye), Some(&Msaa::Sample4));
        assert_eq!(app.world().get::<ScopeMask>(eye), None);
    }
    app.world_mut().get_mut::<StereoPair>(rig).expect("a pair").is_active = false;
    app.idle();
    for camera in before.into_iter().chain([rig]) {
        assert!(!app.world().get::<Camera>(camera).expect("a camera").is_active, "switched off");
    }
    app.world_mut().entity_mut(rig).remove::<StereoPair>();
    app.idle();
    assert!(app.world().get::<Camera>(rig).expect("a camera").is_active);
    assert!(before.iter().all(|eye| app.world().get_entity(*eye).is_err()), "the eyes are closed");
    app.world_mut().entity_mut(rig).insert(StereoPair::default());
    app.idle();
    assert_eq!(eyes(&app, rig).map(|eye| before.contains(&eye)), [false, false], "and open again");
    app.world_mut().entity_mut(rig).despawn();
    app.idle();
    let mut left = app.world_mut().query::<&StereoEye>();
    assert_eq!(left.iter(app.world()).count(), 0);
}

#[test]
fn the_field_fits_into_a_narrow_half() {
    // Halves of 60 x 120: the field's 50 mm go from side to side.
    let (app, rig) = pair(120, 120, StereoPair::default());
    for eye in eyes(&app, rig) {
        assert!((seen(&app, eye, Vec3::new(0.025, 0.0, -0.25)) - Vec2::X).length() < 1e-4);
        assert!((seen(&app, eye, Vec3::new(0.0, 0.025, -0.25)) - Vec2::new(0.0, 0.5)).length() < 1e-4);
    }
}

/// Mean place of the organ's pixels in one half.
fn centre(picture: &RgbaImage, from: u32, to: u32) -> Vec2 {
    let organ = picture.enumerate_pixels().filter(|(x, _, p)| (from..to).contains(x) && p.0[0] > p.0[1]);
    let (sum, count) =
        organ.fold((Vec2::ZERO, 0), |(sum, count), (x, y, _)| (sum + Vec2::new(x as f32, y as f32) + 0.5, count + 1));
    assert!(count > 20, "{count} pixels of the organ in {from}..{to}");
    sum / count as f32
}

#[test]
fn both_halves_are_round_and_show_the_scene() {
    for (msaa, width) in [(Msaa::Off, 240), (Msaa::Sample4, 240), (Msaa::Off, 160)] {
        let (mut app, rig) = pair(width, 120, StereoPair { interocular_m: 0.05, ..default() });
        app.world_mut().entity_mut(rig).insert(msaa);
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.005));
        let depth_m = 0.2;
        app.world_mut().spawn((Organ(organ), plain_skin([200, 120, 90]), Transform::from_xyz(0.0, 0.0, -depth_m)));
        let picture = app.capture();
        let half = width / 2;
        let radius = half.min(120) as f32 / 2.0;
        for (x, y, pixel) in picture.enumerate_pixels() {
            let place = Vec2::new((x % half) as f32 + 0.5 - half as f32 / 2.0, y as f32 + 0.5 - 60.0) / radius;
            let is_dark = pixel.0[..3].iter().all(|value| *value < 3);
            if place.length() > 1.03 {
                assert!(is_dark, "{x},{y} lies outside the circle of its half and is {pixel:?}");
            } else if place.length() < 0.95 {
                assert!(!is_dark, "{x},{y} lies inside the circle of its half and is dark");
            }
        }
        let parallax = centre(&picture, 0, half) - centre(&picture, half, width) + Vec2::X * half as f32;
        let tan_half = 0.1 * (half as f32 / 120.0).max(1.0);
        let wanted =
            app.world().get::<StereoPair>(rig).expect("a pair").parallax(depth_m, 0.25, tan_half) * half as f32 / 2.0;
        assert!((parallax.x - wanted).abs() < 0.7 && parallax.y.abs() < 0.5, "{parallax} pixels instead of {wanted}");
    }
}

#[test]
fn a_monitor_follows_another_camera() {
    let mut app = TestApp::gpu(120, 90);
    app.insert_resource(ClearColor(Color::srgb_u8(0, 200, 0)));
    let target = RenderTarget::Image(app.target().image.into());
    let arm = app.world_mut().spawn(Transform::from_xyz(0.1, 0.0, 0.0)).id();
    let scope = (Microscope::default(), target, Transform::from_xyz(0.0, 0.0, 0.3), ChildOf(arm));
    let scope = app.world_mut().spawn(scope).id();
    let mut screen = Image::new_target_texture(200, 50, TextureFormat::Rgba8UnormSrgb, None);
    screen.texture_descriptor.usage |= TextureUsages::COPY_SRC;
    let screen = app.world_mut().resource_mut::<Assets<Image>>().add(screen);
    let cart = app.world_mut().spawn(Transform::from_xyz(3.0, 1.0, 0.0).with_rotation(Quat::from_rotation_y(1.0))).id();
    let monitor = (MonitorView { of: scope }, RenderTarget::Image(screen.into()), ChildOf(cart));
    let monitor = app.world_mut().spawn(monitor).id();
    app.idle();
    let compare = |app: &TestApp, wanted_rad: f32| {
        let place = |entity| *app.world().get::<GlobalTransform>(entity).expect("placed");
        let apart = place(scope).affine().inverse() * place(monitor).affine();
        assert!(apart.abs_diff_eq(bevy::math::Affine3A::IDENTITY, 1e-5), "{apart:?}");
        let clip = |entity| app.world().get::<Camera>(entity).expect("a camera").computed.clip_from_view;
        let (own, others) = (clip(monitor), clip(scope));
        // The same height, each its own width.
        assert!((own.y_axis.y - 1.0 / (wanted_rad / 2.0).tan()).abs() < 1e-3, "{own}");
        assert_eq!(own.y_axis.y, others.y_axis.y);
        assert!(
            (own.y_axis.y / own.x_axis.x - 4.0).abs() < 1e-5
                && (others.y_axis.y / others.x_axis.x - 4.0 / 3.0).abs() < 1e-5
        );
    };
    let field = |magnification: f32| 2.0 * (0.1 / magnification / 0.25_f32).atan();
    compare(&app, field(4.0));
    // In the frame in which it moves, not in the next.
    app.world_mut().get_mut::<Transform>(arm).expect("placed").rotate_y(0.3);
    app.world_mut().get_mut::<Transform>(scope).expect("placed").translation.y += 0.05;
    app.world_mut().get_mut::<Microscope>(scope).expect("a microscope").magnify();
    app.idle();
    compare(&app, field(6.0));
    app.world_mut().entity_mut(scope).insert(StereoPair::default());
    app.idle();
    compare(&app, field(6.0));
    let other = Projection::Orthographic(OrthographicProjection::default_3d());
    app.world_mut().entity_mut(scope).insert(other);
    app.idle();
    assert!(matches!(app.world().get::<Projection>(monitor), Some(Projection::Orthographic(_))));
    app.world_mut().entity_mut(scope).despawn();
    app.idle();
    app.warm_up();
}

#[test]
fn the_lens_follows_the_magnification_and_the_lamp_the_focus() {
    let mut app = TestApp::gpu(120, 90);
    let target = RenderTarget::Image(app.target().image.into());
    let place = Transform::from_xyz(0.0, 0.4, 0.0).looking_at(Vec3::ZERO, Vec3::Z);
    let scope = app.world_mut().spawn((Microscope::default(), target, place)).id();
    let lamp = app.world_mut().spawn((MicroscopeLamp::default(), ChildOf(scope))).id();
    for (step, focus_m) in [(0, 0.25), (4, 0.25), (2, 0.4), (99, 0.4)] {
        let mut microscope = app.world_mut().get_mut::<Microscope>(scope).expect("a microscope");
        (microscope.step, microscope.working_distance_m) = (step, focus_m);
        let wanted = Microscope { step, working_distance_m: focus_m, ..default() };
        app.idle();
        let Some(Projection::Perspective(lens)) = app.world().get::<Projection>(scope) else {
            panic!("no perspective")
        };
        assert_eq!((lens.fov, lens.near, lens.far()), (wanted.field_of_view_rad(), 0.01, 10.0));
        // The rim of the field touches the picture's border.
        let above = app.world().get::<GlobalTransform>(scope).expect("placed");
        let rim = above.transform_point(Vec3::new(0.0, wanted.field_m() / 2.0, -focus_m));
        assert!((seen(&app, scope, rim) - Vec2::Y).length() < 1e-3);
        let beam = app.world().get::<GlobalTransform>(lamp).expect("placed");
        let focus = above.translation() + above.forward() * focus_m;
        assert!((focus - beam.translation()).normalize().dot(*beam.forward()) > 0.999999);
        let map = app.world().get::<ToolShadows>(lamp).expect("it has shadows").half_angle_rad;
        assert!((map.tan() * focus_m / wanted.field_m() - 1.0).abs() < 1e-5, "the map covers two fields");
        assert!(app.world().get::<ScopeLight>(lamp).is_some() && app.world().get::<ScopeLight>(scope).is_none());
    }
}
