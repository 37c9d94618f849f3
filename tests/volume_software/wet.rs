//! Smoothing of normals and the light on them.

use super::*;
use bevy_surgery::volume::software::{IncidentLight, NormalImage, march, shade, smooth};
use bevy_surgery::volume::{SmoothedNormals, WetShading};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f32::consts::PI;

fn normals_of(size_px: UVec2, texel: impl FnMut(UVec2) -> (Vec3, f32)) -> NormalImage {
    let mut texel = texel;
    let texels = pixels(size_px).map(|(_, pixel)| texel(pixel)).map(|(normal, depth)| normal.extend(depth).to_array());
    NormalImage { size_px, texels: texels.collect() }
}

fn normal(image: &NormalImage, x: u32, y: u32) -> Vec3 {
    image.normal((y * image.size_px.x + x) as usize).expect("a covered pixel")
}

#[test]
fn edges_are_not_smeared() {
    let (left, right) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.6, 0.0, 0.8));
    // How much of the other side's direction pixels beside the edge take on after eight passes.
    let leakage = |step_voxels: f32| {
        let image =
            normals_of(UVec2::new(20, 9), |pixel| if pixel.x < 10 { (left, 3.0) } else { (right, 3.0 + step_voxels) });
        let smoothed = smooth(&image, 8, 4.0);
        assert!(smoothed.texels.iter().zip(&image.texels).all(|(after, before)| after[3] == before[3]), "depths stay");
        (0..10).map(|x| (0.6 - normal(&smoothed, x, 4).x) / 1.2).fold(0.0, f32::max)
    };
    let leaks: Vec<f32> = [0.0, 1.0, 2.0, 3.0, 3.9, 4.0, 4.1, 30.0].map(leakage).to_vec();
    println!("leakage by height of the step: {leaks:?}");
    assert!(leaks[..5].windows(2).all(|pair| pair[0] > pair[1] && pair[1] > 0.0), "{leaks:?}");
    assert!(leaks[0] > 0.4, "without a step both sides mix: {leaks:?}");
    assert!(leaks[5..].iter().all(|&leak| leak < 1e-6), "{leaks:?}");
}

#[test]
fn noise_falls_as_much_as_box_filters_lower_it() {
    let mut random = Pcg32::seed_from_u64(2);
    // A plane with small errors of its normals.
    let mut error = || random.random_range(-0.05..0.05_f32);
    let image = normals_of(UVec2::new(150, 150), |_| (Vec3::new(error(), error(), 1.0).normalize(), 7.0));
    let spread = |image: &NormalImage| {
        let inner = pixels(image.size_px)
            .filter(|(_, pixel)| pixel.cmpge(UVec2::splat(10)).all() && pixel.cmplt(UVec2::splat(140)).all());
        let squares: Vec<f32> = inner.map(|(place, _)| image.texels[place][0].powi(2)).collect();
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    };
    let before = spread(&image);
    assert!((before - 0.1 / 12_f32.sqrt()).abs() < 1e-3, "{before}");
    let mut kernel = vec![1.0];
    for passes in 1..=6 {
        // Weights of so many means of three along one axis.
        let wider = (0..kernel.len() + 2).map(|at| {
            let own = (at.saturating_sub(2)..=at).filter_map(|from| kernel.get(from));
            own.sum::<f32>() / 3.0
        });
        kernel = wider.collect();
        // Along both axes: what independent errors are multiplied with.
        let expected = kernel.iter().map(|weight| weight * weight).sum::<f32>();
        let share = spread(&smooth(&image, passes, 2.0)) / before;
        assert!((share / expected - 1.0).abs() < 0.1, "{share} instead of {expected} after {passes} passes");
    }
}

#[test]
fn pixels_that_show_nothing_take_no_part() {
    let tilted = Vec3::new(0.0, 0.6, 0.8);
    let image =
        normals_of(
            UVec2::new(9, 9),
            |pixel| if pixel == UVec2::splat(4) { (tilted, 1.0) } else { (Vec3::ZERO, 60_000.0) },
        );
    let smoothed = smooth(&image, 5, 4.0);
    assert!(normal(&smoothed, 4, 4).distance(tilted) < 1e-6);
    assert_eq!((0..81).filter(|&place| smoothed.normal(place).is_some()).count(), 1);
    assert_eq!(smoothed.normal(81), None);
    for (passes, edge_voxels) in [(0, 4.0), (3, 0.0), (3, -1.0), (3, f32::NAN)] {
        assert_eq!(smooth(&image, passes, edge_voxels), image);
    }
    assert_eq!(smooth(&NormalImage::default(), 3, 4.0), NormalImage::default());
    // Opposite normals leave none; the pixel keeps its own.
    let opposite = normals_of(UVec2::new(2, 1), |pixel| (if pixel.x == 0 { Vec3::X } else { Vec3::NEG_X }, 0.0));
    let smoothed = smooth(&opposite, 1, 4.0);
    assert!(smoothed.texels.iter().all(|texel| texel.iter().all(|part| part.is_finite())));
}

/// A white opaque picture of 9x9 pixels at the depth of the volume's middle, with normals to choose.
fn plane(normal: impl Fn(UVec2) -> Vec3) -> (ViewRays, VolumeImage) {
    let size_px = UVec2::splat(9);
    let rays = rays_from(&ball(), size_px, perspective(size_px, 0.1), Vec3::Z * 0.2, Vec3::ZERO);
    let image = VolumeImage {
        size_px,
        colour: vec![[0.5, 0.25, 1.0, 1.0]; 81],
        normal: pixels(size_px).map(|(_, pixel)| normal(pixel).to_array()).collect(),
        depth_m: vec![0.2; 81],
        end_depth_m: vec![0.2; 81],
        ..VolumeImage::default()
    };
    (rays, image)
}

fn lamp(to_light: Vec3) -> impl Fn(Vec3, &mut Vec<IncidentLight>) + Sync {
    move |_, lights| {
        lights.push(IncidentLight { to_light, illuminance_lux: Vec3::new(PI, 2.0 * PI, PI), ambient_fraction: 0.0 })
    }
}

fn close(a: [f32; 4], b: [f32; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4 * b.abs().max(1.0))
}

#[test]
fn diffuse_light_follows_lambert() {
    let tilt = 0.7_f32;
    let (rays, image) = plane(|_| Vec3::new(tilt.sin(), 0.0, tilt.cos()));
    let dry = WetShading { shine: 0.0, ..WetShading::default() };
    let lit = shade(&image, &rays, &dry, Vec3::ZERO, lamp(Vec3::Z));
    let cosine = tilt.cos();
    assert!(lit.iter().all(|&texel| close(texel, [0.5 * cosine, 0.5 * cosine, cosine, 1.0])), "{:?}", lit[40]);
    // From behind only the ambient light is left.
    let lit = shade(&image, &rays, &dry, Vec3::splat(0.3), lamp(Vec3::NEG_Z));
    assert!(lit.iter().all(|&texel| close(texel, [0.15, 0.075, 0.3, 1.0])), "{:?}", lit[40]);
    let flat = WetShading { is_shaded: false, ..WetShading::default() };
    let lit = shade(&image, &rays, &flat, Vec3::ZERO, lamp(Vec3::NEG_Z));
    assert!(lit.iter().all(|&texel| close(texel, [0.5, 0.25, 1.0, 1.0])), "{:?}", lit[40]);
}

#[test]
fn the_film_reflects_like_water() {
    let (rays, mut image) = plane(|_| Vec3::Z);
    image.colour = vec![[0.0, 0.0, 0.0, 0.5]; 81];
    let wet = WetShading { shine: 0.8, shine_exponent: 100.0, ..WetShading::default() };
    // Light and viewer along the normal: the lobe's peak, at the reflectance of water.
    let peak = 0.8 * 0.5 * 0.02 * 102.0 / 8.0;
    let lit = shade(&image, &rays, &wet, Vec3::ZERO, lamp(Vec3::Z));
    assert!(close(lit[40], [peak, 2.0 * peak, peak, 0.5]), "{:?} instead of {peak}", lit[40]);
    assert!(lit[0][0] < lit[40][0], "corners are seen at an angle");
    // Twenty degrees off the mirrored direction the lobe has fallen by a known factor.
    let angle = 20_f32.to_radians();
    let lit = shade(&image, &rays, &wet, Vec3::ZERO, lamp(Vec3::new(angle.sin(), 0.0, angle.cos())));
    let half = (angle / 2.0).cos();
    let fresnel = 0.02 + 0.98 * (1.0 - half).powi(5);
    let expected = 0.8 * 0.5 * fresnel * 102.0 / 8.0 * half.powi(100) * angle.cos();
    assert!((lit[40][0] / expected - 1.0).abs() < 1e-3, "{} instead of {expected}", lit[40][0]);
    // Nothing is mirrored from behind, and nothing lights what is not there.
    assert_eq!(shade(&image, &rays, &wet, Vec3::ZERO, lamp(Vec3::NEG_Z))[40], [0.0, 0.0, 0.0, 0.5]);
    image.colour = vec![[0.0; 4]; 81];
    assert_eq!(shade(&image, &rays, &wet, Vec3::ONE, lamp(Vec3::Z)), image.colour);
}

#[test]
fn smoothed_normals_feed_what_they_are_asked_to() {
    let (rays, image) =
        plane(|pixel| Vec3::new(if (pixel.x + pixel.y) % 2 == 0 { 0.5 } else { -0.5 }, 0.0, 1.0).normalize());
    let lit = |smoothed: SmoothedNormals, shine: f32| {
        let wet = WetShading { smoothed, shine, ..WetShading::default() };
        shade(&image, &rays, &wet, Vec3::ZERO, lamp(Vec3::new(0.6, 0.0, 0.8)))
    };
    let contrast = |lit: &[[f32; 4]]| (lit[40][0] - lit[41][0]).abs();
    let grain = contrast(&lit(SmoothedNormals::None, 0.0));
    assert!(grain > 0.1, "{grain}");
    // Reflections are smoothed: the diffuse light stays as it is.
    assert_eq!(lit(SmoothedNormals::Reflections, 0.0), lit(SmoothedNormals::None, 0.0));
    assert!(contrast(&lit(SmoothedNormals::All, 0.0)) < 0.1 * grain);
    // What shines: the difference that the film makes.
    let film = |smoothed| {
        let (wet, dry) = (lit(smoothed, 1.0), lit(smoothed, 0.0));
        wet.iter().zip(dry).map(|(wet, dry)| [wet[0] - dry[0], 0.0, 0.0, 0.0]).collect::<Vec<_>>()
    };
    assert!(contrast(&film(SmoothedNormals::Reflections)) < 0.1 * contrast(&film(SmoothedNormals::None)));
}

#[test]
fn lights_are_asked_for_at_the_surface() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let rays = rays_from(&volume, UVec2::splat(20), perspective(UVec2::splat(20), 0.15), Vec3::Z * 0.2, Vec3::ZERO);
    let image = march(&rays, &scene(&field, &table));
    let lit = shade(&image, &rays, &WetShading::default(), Vec3::ZERO, |world, lights| {
        assert!((world.length() - RADIUS * 1e-3).abs() < 1.2e-3, "{world} is not on the ball");
        lights.push(IncidentLight { to_light: Vec3::Z, illuminance_lux: Vec3::ONE, ambient_fraction: 0.1 });
    });
    assert!(lit.iter().zip(&image.colour).all(|(lit, colour)| (lit[0] > 0.0) == (colour[3] > 0.0)));
    assert!(lit[10 * 20 + 10][0] > 0.3);
}
