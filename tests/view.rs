//! The endoscope: lens, light and round picture.

use crate::support::{plain_skin, sphere_organ};
use bevy::camera::{Projection, RenderTarget};
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

fn scope(mask: ScopeMask) -> TestApp {
    let mut app = TestApp::gpu(120, 90);
    app.insert_resource(ClearColor(Color::srgb_u8(0, 200, 0)));
    let target = RenderTarget::Image(app.target().image.into());
    app.world_mut().spawn((Endoscope::default(), mask, target, Transform::from_xyz(0.0, 0.0, 0.3)));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.05));
    app.world_mut().spawn((Organ(organ), plain_skin([200, 120, 90])));
    app
}

#[test]
fn the_picture_is_round_and_lit() {
    let picture = scope(ScopeMask { radius: 0.9, softness: 0.02, ..default() }).capture();
    for (x, y, pixel) in picture.enumerate_pixels() {
        let place = Vec2::new(x as f32 + 0.5 - 60.0, y as f32 + 0.5 - 45.0) / 45.0;
        let is_dark = pixel.0[..3].iter().all(|value| *value < 3);
        if place.length() > 0.95 {
            assert!(is_dark, "{x},{y} lies outside the circle and is {pixel:?}");
        } else if place.length() < 0.88 {
            assert!(!is_dark, "{x},{y} lies inside the circle and is dark");
        }
    }
    let centre = picture.get_pixel(60, 45).0;
    assert!(centre[0] > centre[1] && centre[1] > centre[2], "the organ is lit by the scope alone: {centre:?}");
}

#[test]
fn a_scope_without_mask_fills_the_frame() {
    let mut app = scope(ScopeMask::default());
    let mut scopes = app.world_mut().query_filtered::<Entity, With<Endoscope>>();
    let entity = scopes.single(app.world()).expect("one scope");
    assert_eq!(app.capture().get_pixel(1, 1).0[1], 0, "masked");
    app.world_mut().entity_mut(entity).remove::<ScopeMask>();
    assert!(app.capture().get_pixel(1, 1).0[1] > 50, "the corner shows the background");
}

#[test]
fn the_lens_follows_the_component() {
    let mut app = scope(ScopeMask::default());
    app.step(1);
    let mut scopes = app.world_mut().query::<(&mut Endoscope, &Projection)>();
    let fov = |app: &mut TestApp| match app.world_mut().query::<&Projection>().single(app.world()) {
        Ok(Projection::Perspective(lens)) => lens.fov,
        other => panic!("{other:?}"),
    };
    assert!((fov(&mut app) - 60_f32.to_radians()).abs() < 1e-6);
    scopes.single_mut(app.world_mut()).expect("one scope").0.field_of_view_rad = 1.3;
    app.step(1);
    assert!((fov(&mut app) - 1.3).abs() < 1e-6);
}

#[test]
fn the_mask_hides_the_same_with_multisampling() {
    let pictures = [Msaa::Off, Msaa::Sample4].map(|msaa| {
        let mut app = scope(ScopeMask::default());
        let mut scopes = app.world_mut().query_filtered::<Entity, With<Endoscope>>();
        let entity = scopes.single(app.world()).expect("one scope");
        app.world_mut().entity_mut(entity).insert(msaa);
        app.capture()
    });
    let differs = |(a, b): &(&image::Rgba<u8>, &image::Rgba<u8>)| (0..3).any(|k| a.0[k].abs_diff(b.0[k]) > 40);
    let count = pictures[0].pixels().zip(pictures[1].pixels()).filter(differs).count();
    assert!(count < 60, "{count} pixels differ: more than the organ's rim");
}
