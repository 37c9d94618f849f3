//! Rays through shapes whose pictures are known.

use super::*;
use bevy::math::{Quat, Vec2};
use bevy_surgery::volume::blocks::{BlockDistances, BlockRanges};
use bevy_surgery::volume::software::{composite_slices, march};

#[test]
fn rays_go_through_their_pixels() {
    let volume = ball();
    let size_px = UVec2::new(40, 30);
    let mut asymmetric = perspective(size_px, 0.5);
    (asymmetric.z_axis.x, asymmetric.z_axis.y) = (0.3, -0.1);
    let flat = Mat4::orthographic_rh(-0.05, 0.07, -0.04, 0.06, 10.0, -1.0);
    let world_from_view = Affine3A::look_at_rh(Vec3::new(0.3, 0.2, 0.4), Vec3::splat(0.01), Vec3::Y).inverse();
    let world_from_volume = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 2.0, 0.5),
        Quat::from_rotation_x(0.7),
        Vec3::new(0.01, -0.02, 0.0),
    );
    let volume_from_voxel = volume.grid().volume_from_voxel();
    for clip_from_view in [perspective(size_px, 0.5), asymmetric, flat] {
        let rays = ViewRays::new(size_px, clip_from_view, world_from_view, world_from_volume, volume_from_voxel);
        let rays = rays.expect("a camera");
        for (_, pixel) in pixels(size_px).step_by(37) {
            for depth_m in [0.1, 0.5, 2.0] {
                let world = rays.world_from_voxel().transform_point3(rays.ray(pixel).at(depth_m));
                let view = world_from_view.inverse().transform_point3(world);
                assert!((view.z + depth_m).abs() < 1e-5, "{} instead of {depth_m}", -view.z);
                let clip = clip_from_view * view.extend(1.0);
                let ndc = Vec2::new(clip.x, -clip.y) / clip.w;
                let at_px = (ndc * 0.5 + 0.5) * size_px.as_vec2() - 0.5;
                assert!(at_px.distance(pixel.as_vec2()) < 2e-3, "{at_px} instead of {pixel}");
            }
        }
        let middle = world_from_view.inverse().transform_point3(world_from_volume.translation.into());
        assert!((rays.middle_depth_m() + middle.z).abs() < 1e-6);
        assert!((rays.voxel_edge_m() - 0.5e-3).abs() < 1e-8);
    }
    let flat_camera = Mat4::from_scale(Vec3::new(0.0, 1.0, 1.0));
    assert!(ViewRays::new(size_px, flat_camera, world_from_view, world_from_volume, volume_from_voxel).is_none());
}

#[test]
fn a_uniform_ball_absorbs_by_its_chord() {
    let volume = ball();
    let rays = rays_from(&volume, UVec2::new(90, 70), perspective(UVec2::new(90, 70), 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    let (field, table) = (RenderField::new(&volume), solid_table(0.05));
    let image = march(&rays, &scene(&field, &table));
    let (mut error, mut count) = (0.0, 0);
    for (place, pixel) in pixels(rays.size_px()) {
        // As many steps as the opacity tells of.
        let steps = (1.0 - opacity(&image, place)).ln() / 0.95_f32.ln();
        let Some([enter_m, leave_m]) = chord_m(&rays, pixel) else {
            assert!(steps < 3.0, "{steps} steps beside the ball at {pixel}");
            continue;
        };
        let expected = (leave_m - enter_m) / STEP_M;
        if expected > 8.0 {
            assert!((steps - expected).abs() < 1.2, "{steps} steps instead of {expected} at {pixel}");
            (error, count) = (error + steps - expected, count + 1);
            let [r, g, b, opacity] = image.colour[place];
            assert!([r, g, b].iter().all(|c| (c - opacity).abs() < 1e-5), "white, premultiplied");
            let before_middle = 0.5 * (enter_m + leave_m) - image.depth_m[place];
            assert!(image.depth_m[place] > enter_m && before_middle > -0.5 * STEP_M, "more of the front is seen");
        }
    }
    assert!(count > 1000, "{count} rays meet the ball");
    // Interpolating a ball between voxels makes it smaller by about a hundredth of a voxel on each side, more along chords.
    assert!((error / count as f32).abs() < 0.1, "{} steps too many", error / count as f32);
}

#[test]
fn an_opaque_ball_has_its_surface_and_its_normals() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    for eye in [Vec3::Z * 0.2, Vec3::new(0.1, -0.15, 0.08), Vec3::X * -0.15] {
        let rays = rays_from(&volume, UVec2::new(64, 48), perspective(UVec2::new(64, 48), 0.4), eye, Vec3::ZERO);
        let image = march(&rays, &scene(&field, &table));
        let mut all_off = Vec::new();
        for (place, pixel) in pixels(rays.size_px()) {
            let Some([enter_m, leave_m]) = chord_m(&rays, pixel).filter(|chord| chord[1] - chord[0] > 6.0 * STEP_M)
            else {
                continue;
            };
            assert_eq!(opacity(&image, place), 1.0);
            // The first plane behind the surface: half a step behind it on the average. Interpolation between voxels and the
            // table's entries move the surface by less than a tenth of a voxel.
            let late = (image.depth_m[place] - enter_m) / STEP_M;
            assert!((late - 0.5).abs() < 0.6, "{late} steps late at {pixel}");
            assert_eq!(image.depth_m[place], image.end_depth_m[place]);
            assert!(image.end_depth_m[place] < leave_m);
            let out = (rays.ray(pixel).at(enter_m) - MIDDLE).normalize();
            let off = Vec3::from_array(image.normal[place]).angle_between(out).to_degrees();
            assert!(off < 4.0, "the normal at {pixel} is off by {off} degrees");
            all_off.push(off);
        }
        let mean_off = all_off.iter().sum::<f32>() / all_off.len() as f32;
        assert!(all_off.len() > 300 && mean_off < 1.5, "{mean_off} degrees off in {} pixels", all_off.len());
        assert!(image.counts.covered <= image.counts.rays && image.counts.visible_samples == image.counts.covered);
    }
}

#[test]
fn normals_stand_on_surfaces_of_stretched_volumes_too() {
    let volume = volume_of(UVec3::new(64, 40, 80), DVec3::new(1.0, 1.7, 0.6), |voxel| {
        0.5 + (15.0 - voxel.distance(Vec3::new(31.5, 19.5, 39.5))) / 8.0
    });
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let world_from_volume =
        Affine3A::from_scale_rotation_translation(Vec3::new(2.0, 1.0, 1.4), Quat::from_rotation_y(0.6), Vec3::Y * 0.01);
    let world_from_view = Affine3A::look_at_rh(Vec3::new(0.1, 0.08, 0.25), Vec3::Y * 0.01, Vec3::Y).inverse();
    let volume_from_voxel = volume.grid().volume_from_voxel();
    let size_px = UVec2::new(60, 60);
    let rays = ViewRays::new(size_px, perspective(size_px, 0.5), world_from_view, world_from_volume, volume_from_voxel);
    let rays = rays.expect("a camera");
    let image = march(&rays, &MarchScene { step_m: 0.3e-3, ..scene(&field, &table) });
    // How far from the middle a place of the world is, in voxels.
    let voxel_from_world = rays.world_from_voxel().inverse();
    let radius = |world: Vec3| voxel_from_world.transform_point3(world).distance(Vec3::new(31.5, 19.5, 39.5));
    let mut count = 0;
    for (place, pixel) in pixels(size_px).filter(|(place, _)| opacity(&image, *place) > 0.9) {
        let at = rays.world_from_voxel().transform_point3(rays.ray(pixel).at(image.depth_m[place]));
        let slope = |axis: Vec3| radius(at + axis * 1e-3) - radius(at - axis * 1e-3);
        let out = Vec3::new(slope(Vec3::X), slope(Vec3::Y), slope(Vec3::Z));
        let off = Vec3::from_array(image.normal[place]).angle_between(out).to_degrees();
        let is_grazed = out.normalize().dot(rays.to_viewer(rays.ray(pixel))) < 0.2;
        assert!(is_grazed || off < 4.0, "the normal at {pixel} is off by {off} degrees");
        count += usize::from(!is_grazed);
    }
    assert!(count > 400, "{count} pixels");
}

#[test]
fn stopping_early_costs_less_than_a_fortieth() {
    let volume = ball();
    let rays = rays_from(&volume, UVec2::new(64, 64), perspective(UVec2::new(64, 64), 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    let (field, table) = (RenderField::new(&volume), solid_table(0.15));
    let (quick, full) = (march(&rays, &scene(&field, &table)), composite_slices(&rays, &scene(&field, &table)));
    let mut stopped = 0;
    for place in 0..64 * 64 {
        let worst = (0..4).map(|channel| (quick.colour[place][channel] - full.colour[place][channel]).abs());
        assert!(worst.fold(0.0, f32::max) < 0.025);
        // The mean depth moves by the share that is left out, of what lies behind.
        assert!((quick.depth_m[place] - full.depth_m[place]).abs() < 0.025 * 2.0 * RADIUS * STEP_M);
        stopped += usize::from(quick.end_depth_m[place] < full.end_depth_m[place]);
    }
    assert!(stopped > 500, "{stopped} rays stop early");
    assert!(quick.counts.samples < full.counts.samples);
    // Where no ray stops, both are the same sum, taken from either end.
    let table = solid_table(0.02);
    let (quick, full) = (march(&rays, &scene(&field, &table)), composite_slices(&rays, &scene(&field, &table)));
    for place in 0..64 * 64 {
        assert!((opacity(&quick, place) - opacity(&full, place)).abs() < 1e-5);
        assert!((quick.depth_m[place] - full.depth_m[place]).abs() < 1e-6);
        assert!(Vec3::from_array(quick.normal[place]).distance(Vec3::from_array(full.normal[place])) < 1e-2);
    }
}

#[test]
fn a_camera_inside_sees_the_walls_around_it() {
    // A hollow ball, seen from within.
    let volume = volume_of(UVec3::splat(64), DVec3::ONE, |voxel| 0.5 + (voxel.distance(MIDDLE) - RADIUS) / 8.0);
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let ranges = BlockRanges::new(&volume);
    let distances = BlockDistances::new(&ranges, &table);
    for (eye, target) in [(Vec3::ZERO, Vec3::X), (Vec3::new(0.004, -0.003, 0.006), Vec3::new(0.3, 0.5, -1.0))] {
        let rays = rays_from(&volume, UVec2::new(40, 40), perspective(UVec2::new(40, 40), 2.0), eye, target);
        let image = march(&rays, &MarchScene { distances: Some(&distances), ..scene(&field, &table) });
        for (place, pixel) in pixels(rays.size_px()) {
            let [_, wall_m] = chord_m(&rays, pixel).expect("walls on all sides");
            let late = (image.depth_m[place] - wall_m) / STEP_M;
            assert!((late - 0.5).abs() < 0.6, "{late} steps late at {pixel}");
            let at = rays.ray(pixel).at(wall_m);
            let off = Vec3::from_array(image.normal[place]).angle_between(MIDDLE - at).to_degrees();
            assert!(off < 3.0, "the normal at {pixel} is off by {off} degrees");
        }
    }
}

#[test]
fn a_camera_far_away_sees_what_an_orthographic_one_sees() {
    let volume = ball();
    let field = RenderField::new(&volume);
    let table: Vec<[f32; 4]> =
        (0..TABLE_ENTRIES).map(|entry| entry as f32 / 1023.0).map(|c| [c, 0.5, 1.0 - c, 0.1 * c]).collect();
    let size_px = UVec2::new(48, 48);
    let eye = Vec3::new(0.0, 12.0, 16.0);
    let far = rays_from(&volume, size_px, perspective(size_px, 0.064 / 20.0), eye, Vec3::ZERO);
    let flat = Mat4::orthographic_rh(-0.032, 0.032, -0.032, 0.032, 30.0, 0.01);
    let flat = rays_from(&volume, size_px, flat, eye, Vec3::ZERO);
    let (far, flat) = (march(&far, &scene(&field, &table)), march(&flat, &scene(&field, &table)));
    assert!(flat.counts.covered > 1000);
    for place in 0..48 * 48 {
        for channel in 0..4 {
            let difference = (far.colour[place][channel] - flat.colour[place][channel]).abs();
            assert!(difference < 0.01, "channel {channel} of pixel {place} differs by {difference}");
        }
    }
}

#[test]
fn a_volume_has_its_own_colours_in_linear_light() {
    let volume = ball();
    let count = volume.grid().count();
    assert!(RenderField::new(&volume).with_colours(vec![[0; 4]; count - 1]).is_none());
    let field = RenderField::new(&volume).with_colours(vec![[255, 188, 0, 255]; count]).expect("one for each voxel");
    let rays = rays_from(&volume, UVec2::ONE, perspective(UVec2::ONE, 0.01), Vec3::Z * 0.2, Vec3::ZERO);
    let [r, g, b, opacity] = march(&rays, &scene(&field, &solid_table(1.0))).colour[0];
    assert_eq!((r, b, opacity), (1.0, 0.0, 1.0));
    assert!((g - 0.5029).abs() < 1e-3, "{g}");
}

#[test]
fn the_grids_sides_are_surfaces() {
    // One voxel gives the range its other end.
    let hole = Vec3::new(6.0, 6.0, 2.0);
    let volume = volume_of(UVec3::splat(9), DVec3::ONE, |voxel| if voxel == hole { 0.0 } else { 1.0 });
    let field = RenderField::new(&volume);
    let middle = 4.0;
    for (at, inwards) in [
        (Vec3::new(0.0, middle, middle), Vec3::X),
        (Vec3::new(8.0, middle, middle), Vec3::NEG_X),
        (Vec3::new(middle, 0.0, middle), Vec3::Y),
        (Vec3::new(middle, middle, 8.0), Vec3::NEG_Z),
        (Vec3::new(middle, 8.0, 0.0), Vec3::new(0.0, -1.0, 1.0)),
    ] {
        let gradient = field.gradient(at);
        assert!(gradient.normalize().dot(inwards.normalize()) > 0.9999, "{at}: {gradient}");
    }
    assert_eq!(field.gradient(Vec3::splat(middle)), Vec3::ZERO);
}
