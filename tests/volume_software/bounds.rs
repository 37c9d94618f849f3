//! What bounds a volume's picture: empty space, cuts, clip planes, the scene, bad numbers.

use super::*;
use bevy::math::Vec4;
use bevy_surgery::volume::VoxelBox;
use bevy_surgery::volume::blocks::{BlockDistances, BlockRanges};
use bevy_surgery::volume::software::{march, plane_in_voxels};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn random_vector(random: &mut Pcg32, length: f32) -> Vec3 {
    let mut part = || random.random_range(-1.0..1.0_f32);
    Vec3::new(part(), part(), part()).normalize_or(Vec3::X) * length
}

#[test]
fn skipping_what_is_empty_changes_nothing() {
    let mut random = Pcg32::seed_from_u64(5);
    let (mut skips, mut samples, mut all_samples) = (0, 0, 0);
    for case in 0..40 {
        let size = UVec3::from_array(std::array::from_fn(|_| random.random_range(1..40)));
        // A few lumps in the void; the first and last voxel span the range.
        let lumps: Vec<(Vec3, f32)> = (0..6)
            .map(|_| {
                (
                    size.as_vec3() * Vec3::from_array(std::array::from_fn(|_| random.random::<f32>())),
                    random.random_range(0.5..4.0),
                )
            })
            .collect();
        let last = size.as_vec3() - 1.0;
        let mut volume_size = size;
        volume_size.x = size.x.max(2);
        let volume = volume_of(volume_size, DVec3::new(1.0, 1.5, 0.8), |voxel| {
            if voxel == Vec3::ZERO {
                return 0.0;
            }
            if voxel == last.with_x(volume_size.x as f32 - 1.0) {
                return 1.0;
            }
            lumps.iter().map(|(middle, radius)| 0.8 - voxel.distance(*middle) / radius).fold(0.0, f32::max)
        });
        let threshold = random.random_range(0..900);
        let opacity = random.random_range(0.01..1.0_f32);
        let table: Vec<[f32; 4]> = (0..TABLE_ENTRIES)
            .map(|entry| {
                [entry as f32 / 1023.0, 1.0, 0.3, if entry > threshold && entry % 300 > 40 { opacity } else { 0.0 }]
            })
            .collect();
        let ranges = BlockRanges::new(&volume);
        let mut distances = BlockDistances::new(&ranges, &table);
        let mut field = RenderField::new(&volume);
        // Cut away some boxes.
        for _ in 0..case % 4 {
            let corners: [UVec3; 2] = std::array::from_fn(|_| {
                UVec3::from_array(volume_size.to_array().map(|side| random.random_range(0..side)))
            });
            let cut = VoxelBox { min: corners[0].min(corners[1]), max: corners[0].max(corners[1]) + 1 };
            field.cut(cut, |_, into| into.fill(0));
            distances.update(cut, |of, into| {
                let [width, height, _] = of.size().to_array();
                for (place, into) in (0..).zip(into) {
                    let voxel = of.min + UVec3::new(place % width, place / width % height, place / (width * height));
                    *into = (field.remaining(voxel.as_vec3()) * 255.0).round() as u8;
                }
            });
        }
        let reach = if case % 5 == 0 { 0.01 } else { 0.08 };
        let (eye, target) = (random_vector(&mut random, reach), random_vector(&mut random, 0.004));
        let size_px = UVec2::new(24, 20);
        let lens = if case % 3 == 0 {
            Mat4::orthographic_rh(-0.02, 0.02, -0.02, 0.02, 1.0, -1.0)
        } else {
            perspective(size_px, random.random_range(0.2..1.5))
        };
        let rays = rays_from(&volume, size_px, lens, eye, target);
        let step_m = random.random_range(0.2e-3..2e-3_f32);
        let plain = MarchScene { step_m, near_m: -0.05, ..scene(&field, &table) };
        let (all, some) = (march(&rays, &plain), march(&rays, &MarchScene { distances: Some(&distances), ..plain }));
        assert!(all.colour == some.colour, "case {case}: colours");
        assert!(all.normal == some.normal, "case {case}: normals");
        assert!(all.depth_m == some.depth_m && all.end_depth_m == some.end_depth_m, "case {case}: depths");
        assert_eq!(all.counts.visible_samples, some.counts.visible_samples, "case {case}");
        skips += some.counts.skips;
        samples += some.counts.samples;
        all_samples += all.counts.samples;
    }
    assert!(skips > 5_000 && samples * 2 < all_samples, "{skips} skips, {samples} of {all_samples} samples");
}

#[test]
fn what_is_cut_away_is_not_drawn() {
    let volume = ball();
    let table = solid_table(1.0);
    let mut field = RenderField::new(&volume);
    let rays = rays_from(&volume, UVec2::new(40, 40), perspective(UVec2::new(40, 40), 0.2), Vec3::Z * 0.2, Vec3::ZERO);
    let whole = march(&rays, &scene(&field, &table));
    // The front of the ball, down to 5 voxels before its middle.
    let front = VoxelBox { min: UVec3::new(0, 0, 37), max: UVec3::splat(64) };
    field.cut(front, |of, into| {
        assert_eq!(of, front);
        into.fill(0);
    });
    let cut = march(&rays, &scene(&field, &table));
    let mut count = 0;
    for (place, pixel) in pixels(rays.size_px()) {
        let Some([enter_m, _]) = chord_m(&rays, pixel) else { continue };
        let face = rays.ray(pixel).at(enter_m);
        if face.distance(MIDDLE.with_z(face.z)) > 14.0 || face.z < 40.0 {
            continue;
        }
        // Remaining opacity falls from 1 to 0 between the voxels 36 and 37; normals are those of the new face.
        let (before, after) = (whole.depth_m[place], rays.ray(pixel).at(cut.depth_m[place]));
        assert!(cut.depth_m[place] > before);
        assert!(after.z > 35.0 && after.z < 37.0, "the new surface at {pixel} is at {after}");
        assert!(cut.normal[place][2] > 0.99, "{:?}", cut.normal[place]);
        count += 1;
    }
    assert!(count > 300, "{count} pixels");
    field.cut(front, |_, into| into.fill(255));
    let restored = march(&rays, &scene(&field, &table));
    assert_eq!((restored.colour, restored.normal), (whole.colour, whole.normal));
}

#[test]
fn clip_planes_cut_exactly() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let rays = rays_from(&volume, UVec2::new(48, 48), perspective(UVec2::new(48, 48), 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    let volume_from_voxel = volume.grid().volume_from_voxel();
    let in_volume =
        [Vec3::new(0.3, 0.2, -1.0).normalize().extend(0.004), Vec3::new(1.0, 0.4, 0.0).normalize().extend(0.006)];
    let clip_planes = in_volume.map(|plane| plane_in_voxels(plane, &volume_from_voxel));
    for voxel in [Vec3::ZERO, Vec3::new(3.0, 50.0, 20.0)] {
        let metres = in_volume[0].dot(volume_from_voxel.transform_point3(voxel).extend(1.0));
        assert!((clip_planes[0].dot(voxel.extend(1.0)) - metres).abs() < 1e-7);
    }
    let image = march(&rays, &MarchScene { clip_planes: &clip_planes, ..scene(&field, &table) });
    let inside =
        |voxel: Vec3| clip_planes.iter().map(|plane| plane.dot(voxel.extend(1.0))).fold(f32::INFINITY, f32::min);
    let mut on_planes = 0;
    for (place, pixel) in pixels(rays.size_px()) {
        // The first plane where the ball is and nothing is clipped.
        let Some([enter_m, leave_m]) = chord_m(&rays, pixel) else { continue };
        let mut planes = ((enter_m / STEP_M).ceil() as i32..=(leave_m / STEP_M) as i32).map(|k| k as f32 * STEP_M);
        match planes.find(|&depth_m| inside(rays.ray(pixel).at(depth_m)) >= 0.0) {
            Some(depth_m) if opacity(&image, place) == 1.0 => {
                let off = (image.depth_m[place] - depth_m).abs();
                assert!(off < 1.01 * STEP_M, "{off} m off at {pixel}");
                // Away from the ball's skin it is that plane and no other.
                if depth_m > enter_m + 3.0 * STEP_M {
                    assert_eq!(image.depth_m[place], depth_m);
                    on_planes += 1;
                }
            }
            Some(depth_m) => assert!(leave_m - depth_m < 2.0 * STEP_M, "nothing at {pixel}"),
            None => assert_eq!(opacity(&image, place), 0.0, "{pixel} is clipped"),
        }
        if opacity(&image, place) > 0.0 {
            assert!(inside(rays.ray(pixel).at(image.depth_m[place])) > -1e-6, "{pixel} shows what is clipped");
        }
    }
    assert!(on_planes > 200, "{on_planes}");
    let nothing = [Vec4::new(0.0, 0.0, 0.0, -1.0)];
    assert_eq!(march(&rays, &MarchScene { clip_planes: &nothing, ..scene(&field, &table) }).counts.rays, 0);
}

#[test]
fn the_scene_hides_what_is_behind_it() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(0.05));
    let size_px = UVec2::new(40, 40);
    let rays = rays_from(&volume, size_px, perspective(size_px, 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    let plain = scene(&field, &table);
    let whole = march(&rays, &plain);
    let with = |depth_m: f32| {
        let depths = vec![depth_m; 1600];
        march(&rays, &MarchScene { scene_depth_m: Some(&depths), ..plain })
    };
    let (before, behind, through) = (with(0.1), with(0.5), with(0.2001));
    assert_eq!((before.counts.covered, before.counts.rays), (0, 0));
    assert!(before.end_depth_m.iter().all(|&end_m| end_m == 0.1));
    assert_eq!(behind.colour, whole.colour);
    // Up to a depth is as good as clipped there: the camera looks along -z, the middle is 0.2 m away.
    let clip_planes = [Vec4::new(0.0, 0.0, 1.0, -31.4)];
    let clipped = march(&rays, &MarchScene { clip_planes: &clip_planes, ..plain });
    assert_eq!(through.colour, clipped.colour);
    assert!(through.counts.covered > 400 && through.counts.samples < whole.counts.samples);
    for place in (0..1600).filter(|&place| opacity(&through, place) > 0.5) {
        assert_eq!(through.end_depth_m[place], 0.2001);
    }
    // Front and back make up the whole.
    let back = march(&rays, &MarchScene { near_m: 0.2001, ..plain });
    for place in 0..1600 {
        let light = (1.0 - opacity(&through, place)) * (1.0 - opacity(&back, place));
        assert!((light - (1.0 - opacity(&whole, place))).abs() < 1e-5);
    }
}

#[test]
fn rays_past_the_volume_end_at_the_scene() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let rays = rays_from(&volume, UVec2::new(2, 2), perspective(UVec2::new(2, 2), 0.3), Vec3::Z * 0.2, Vec3::Z);
    let depths = [0.3, f32::INFINITY, 1.0, 0.01];
    let image = march(&rays, &MarchScene { scene_depth_m: Some(&depths), ..scene(&field, &table) });
    assert_eq!(image.end_depth_m, depths);
    assert_eq!(image.colour, [[0.0; 4]; 4]);
    assert_eq!((image.normal, image.depth_m), (vec![[0.0; 3]; 4], vec![0.0; 4]));
}

#[test]
fn numbers_that_make_no_sense_make_no_picture_and_no_panic() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(1.0));
    let size_px = UVec2::new(5, 4);
    let rays = rays_from(&volume, size_px, perspective(size_px, 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    for step_m in [0.0, -1e-3, f32::NAN, f32::INFINITY] {
        let image = march(&rays, &MarchScene { step_m, ..scene(&field, &table) });
        assert_eq!(image.counts.covered, 0, "steps of {step_m}");
    }
    // Missing entries have no opacity, missing depths hide nothing.
    assert_eq!(march(&rays, &scene(&field, &table[..100])).counts.covered, 0);
    let image = march(&rays, &MarchScene { scene_depth_m: Some(&[]), ..scene(&field, &table) });
    assert_eq!(image.counts.covered, march(&rays, &scene(&field, &table)).counts.covered);
    let none = rays_from(&volume, UVec2::new(0, 4), perspective(UVec2::ONE, 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    assert!(march(&none, &scene(&field, &table)).colour.is_empty());
    let mut same = field.clone();
    same.cut(VoxelBox { min: UVec3::splat(70), max: UVec3::splat(80) }, |_, _| panic!("nothing to ask for"));
    assert_eq!(same, field);
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let volume = ball();
    let (field, table) = (RenderField::new(&volume), solid_table(0.1));
    let rays = rays_from(&volume, UVec2::new(33, 47), perspective(UVec2::new(33, 47), 0.3), Vec3::Z * 0.2, Vec3::ZERO);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| (march(&rays, &scene(&field, &table)), RenderField::new(&volume), BlockRanges::new(&volume)))
    };
    let (one, three) = (with(1), with(3));
    assert!(one == three);
}
