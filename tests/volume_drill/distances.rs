//! Distances to critical structures.

use super::phantom::{PLENTY_N, ball, resting, structure};
use bevy_surgery::volume::critical::{CriticalDistances, StructureDistance};
use bevy_surgery::volume::cut::{BurrPose, CutVolume};
use bevy_surgery::volume::load::load_path;
use bevy_surgery::volume::structures::Structures;
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use glam::{DAffine3, DMat3, DVec3, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;

const BAND_MM: f32 = 2.5;

struct Scene {
    volume: Volume,
    structures: Structures,
}

/// Two crooked nerves (labels 2 and 4) and an ordinary structure in slabs of 0.3 x 0.4 x 0.7 mm.
fn scene(grid: VolumeGrid) -> Scene {
    let mut labels = vec![1u8; grid.count()];
    let mut rng = Pcg32::seed_from_u64(4);
    for label in [2, 4] {
        let mut at = grid.size.as_dvec3() * rng.random_range(0.25..0.6);
        for _ in 0..60 {
            at += DVec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.3)));
            let voxel = at.max(DVec3::ZERO).as_uvec3().min(grid.size - 2);
            for corner in 0..8 {
                labels[grid.index(voxel + UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2))] = label;
            }
        }
    }
    let list = ["bone", "nerve", "none", "other nerve"].map(|name| structure(name, 1.0, name != "bone")).to_vec();
    let structures = Structures::new(list, labels, vec![255; grid.count()]).expect("structures");
    Scene { volume: Volume::new(grid, Voxels::U8(vec![9; grid.count()]), 1.0, 0.0).expect("a volume"), structures }
}

fn slabs() -> VolumeGrid {
    VolumeGrid::upright(UVec3::new(40, 34, 22), DVec3::new(0.3, 0.4, 0.7))
}

fn voxels(size: UVec3) -> impl Iterator<Item = UVec3> {
    (0..size.x * size.y * size.z)
        .map(move |index| UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y)))
}

/// Distance to the nearest voxel of a label that is left, by looking at all of them.
fn brute_mm(scene: &Scene, cut: &CutVolume, label: u8) -> Vec<f64> {
    let grid = scene.volume.grid();
    let is_there =
        |&voxel: &UVec3| scene.structures.labels()[grid.index(voxel)] == label && cut.remaining(voxel) >= 0.5;
    let there: Vec<UVec3> = voxels(grid.size).filter(is_there).collect();
    let axes = grid.lps_mm_from_voxel.matrix3;
    let nearest = |voxel: UVec3| {
        let to = |other: &UVec3| (axes * (other.as_dvec3() - voxel.as_dvec3())).length();
        there.iter().map(to).fold(f64::INFINITY, f64::min)
    };
    voxels(grid.size).map(nearest).collect()
}

fn assert_is_brute(field: &StructureDistance, scene: &Scene, cut: &CutVolume) {
    let brute = brute_mm(scene, cut, field.label());
    let mut within = 0;
    for (voxel, expected) in voxels(cut.size()).zip(brute) {
        let found = field.distance_mm(voxel.as_vec3());
        match found {
            Some(mm) => {
                within += 1;
                assert!((f64::from(mm) - expected).abs() < 0.0051, "{voxel}: {mm} mm, not {expected}")
            }
            None => assert!(expected > f64::from(BAND_MM) - 0.006, "{voxel}: {expected} mm"),
        }
    }
    assert!(within > 2000, "{within} voxels in the band");
}

#[test]
fn distances_are_euclidean() {
    let scene = scene(slabs());
    let cut = CutVolume::new(scene.volume.grid().size);
    for label in [2, 4] {
        let field = StructureDistance::build(scene.volume.grid(), &scene.structures, &cut, label, BAND_MM);
        assert_is_brute(&field.expect("a nerve"), &scene, &cut);
    }
    assert!(StructureDistance::build(scene.volume.grid(), &scene.structures, &cut, 3, BAND_MM).is_none());
    let other = CutVolume::new(UVec3::splat(9));
    assert!(StructureDistance::build(scene.volume.grid(), &scene.structures, &other, 2, BAND_MM).is_none());
}

#[test]
fn drilling_and_undoing_keep_them_right() {
    let scene = scene(slabs());
    let grid = scene.volume.grid();
    let mut cut = CutVolume::new(grid.size);
    let build = |cut: &CutVolume, label| {
        StructureDistance::build(grid, &scene.structures, cut, label, BAND_MM).expect("a nerve")
    };
    let untouched = build(&cut, 2);
    let mut all = CriticalDistances::build(grid, &scene.structures, &cut, BAND_MM);
    assert!(!all.update(&scene.structures, &cut));
    let nerve: Vec<UVec3> =
        voxels(grid.size).filter(|&voxel| scene.structures.labels()[grid.index(voxel)] == 2).collect();
    let mut changes = 0;
    for step in 0..10 {
        let centre_m = grid.volume_from_voxel().transform_point3(nerve[step * 17 % nerve.len()].as_vec3());
        let stroke = resting(ball(1.2), BurrPose { centre_m, axis: Vec3::Y }, PLENTY_N);
        cut.begin_stroke();
        cut.drill(&scene.volume, &scene.structures, &stroke, 1.0);
        changes += usize::from(all.update(&scene.structures, &cut));
        assert_eq!(all.fields()[0], build(&cut, 2), "step {step}");
        assert_eq!(all.fields()[1], build(&cut, 4), "step {step}");
    }
    assert!(changes >= 5, "{changes} steps hit a nerve");
    assert!(all.fields()[0] != untouched);
    assert_is_brute(&all.fields()[0], &scene, &cut);
    for _ in 0..4 {
        assert!(cut.undo());
    }
    all.update(&scene.structures, &cut);
    assert_eq!(all.fields()[0], build(&cut, 2));
    cut.reset();
    assert!(all.update(&scene.structures, &cut));
    assert_eq!(all.fields()[0], untouched);
}

#[test]
fn updates_stay_local() {
    let scene = scene(slabs());
    let grid = scene.volume.grid();
    let mut cut = CutVolume::new(grid.size);
    let mut field = StructureDistance::build(grid, &scene.structures, &cut, 2, BAND_MM).expect("a nerve");
    let voxel = voxels(grid.size).find(|&voxel| scene.structures.labels()[grid.index(voxel)] == 2).expect("a nerve");
    let centre_m = grid.volume_from_voxel().transform_point3(voxel.as_vec3());
    let stroke = resting(ball(1.0), BurrPose { centre_m, axis: Vec3::Y }, PLENTY_N);
    let removal = cut.drill(&scene.volume, &scene.structures, &stroke, 1.0);
    let anew = field.update(&scene.structures, &cut, removal.changed.expect("it drills")).expect("the nerve was hit");
    assert!(anew.count() < field.bounds().count() / 2, "{anew:?} of {:?}", field.bounds());
    assert_eq!(field.update(&scene.structures, &cut, removal.changed.expect("it drills")), None, "nothing new");
    // Bone beside the nerve is nothing to the field.
    let far = grid.volume_from_voxel().transform_point3(Vec3::new(38.0, 2.0, 20.0));
    let stroke = resting(ball(1.0), BurrPose { centre_m: far, axis: Vec3::Y }, PLENTY_N);
    let removal = cut.drill(&scene.volume, &scene.structures, &stroke, 1.0);
    assert_eq!(field.update(&scene.structures, &cut, removal.changed.expect("it drills")), None);
}

#[test]
fn the_nearest_of_all_is_found() {
    let scene = scene(slabs());
    let grid = scene.volume.grid();
    let cut = CutVolume::new(grid.size);
    let all = CriticalDistances::build(grid, &scene.structures, &cut, BAND_MM);
    assert_eq!(all.fields().iter().map(StructureDistance::label).collect::<Vec<_>>(), [2, 4]);
    let brute = [2, 4].map(|label| brute_mm(&scene, &cut, label));
    let mut seen = [0; 2];
    for (index, voxel) in voxels(grid.size).enumerate() {
        let Some((label, mm)) = all.nearest(voxel.as_vec3()) else { continue };
        let which = usize::from(label == 4);
        seen[which] += 1;
        assert!((f64::from(mm) - brute[which][index]).abs() < 0.0051);
        assert!(brute[which][index] <= brute[1 - which][index] + 0.011);
    }
    assert!(seen.iter().all(|&count| count > 500), "{seen:?}");
    for outside in [Vec3::splat(-3.0), Vec3::NAN, Vec3::splat(1e9), Vec3::new(5.0, 5.0, f32::NEG_INFINITY)] {
        assert_eq!(all.nearest(outside), None);
    }
    // Between voxels it is in between.
    let field = &all.fields()[0];
    let low = field.bounds().min.as_vec3() + 4.0;
    let corners: Vec<f32> = (0..8)
        .filter_map(|c| field.distance_mm(low + Vec3::new((c & 1) as f32, (c >> 1 & 1) as f32, (c >> 2) as f32)))
        .collect();
    if let (8, Some(middle)) = (corners.len(), field.distance_mm(low + 0.5)) {
        assert!((middle - corners.iter().sum::<f32>() / 8.0).abs() < 1e-4);
    }
}

#[test]
fn a_burr_outside_the_grid_is_warned_as_well() {
    let grid = slabs();
    let mut labels = vec![1u8; grid.count()];
    // A nerve that runs along the grid's side.
    let nerve = [UVec3::new(0, 12, 9), UVec3::new(0, 13, 9), UVec3::new(0, 13, 10)];
    nerve.iter().for_each(|&voxel| labels[grid.index(voxel)] = 2);
    let list = ["bone", "nerve"].map(|name| structure(name, 1.0, name == "nerve")).to_vec();
    let structures = Structures::new(list, labels, vec![255; grid.count()]).expect("structures");
    let cut = CutVolume::new(grid.size);
    let field = StructureDistance::build(&grid, &structures, &cut, 2, BAND_MM).expect("a nerve");
    let spacing_mm = grid.spacing_mm().as_vec3();
    let mut within = 0;
    for place in voxels(UVec3::new(9, 20, 14)) {
        let voxel = place.as_vec3() + Vec3::new(-9.0, 2.0, 2.0);
        let distances_mm = nerve.iter().map(|nerve| ((voxel - nerve.as_vec3()) * spacing_mm).length());
        let expected_mm = distances_mm.fold(f32::INFINITY, f32::min);
        match field.distance_mm(voxel) {
            // What lies in the side itself is at a right angle, so that the bound is exact.
            Some(mm) => {
                within += 1;
                assert!((mm - expected_mm).abs() < 0.0051, "{voxel}: {mm} mm, not {expected_mm}");
            }
            None => assert!(expected_mm > BAND_MM - 0.006, "{voxel}: {expected_mm} mm"),
        }
    }
    assert!(within > 300, "{within} places in the band");
}

#[test]
fn skewed_grids_warn_rather_early_than_late() {
    let axes = DMat3::from_cols(DVec3::new(0.4, 0.0, 0.0), DVec3::new(0.1, 0.4, 0.0), DVec3::new(0.0, 0.12, 0.5));
    let grid = VolumeGrid { size: UVec3::new(30, 30, 30), lps_mm_from_voxel: DAffine3::from_mat3(axes) };
    let scene = scene(grid);
    let cut = CutVolume::new(grid.size);
    let field = StructureDistance::build(&grid, &scene.structures, &cut, 2, BAND_MM).expect("a nerve");
    for (voxel, expected) in voxels(grid.size).zip(brute_mm(&scene, &cut, 2)) {
        match field.distance_mm(voxel.as_vec3()) {
            Some(mm) => {
                let mm = f64::from(mm);
                assert!(mm < expected + 0.0051 && mm > 0.5 * expected - 0.01, "{voxel}: {mm} of {expected}");
            }
            None => assert!(expected > f64::from(BAND_MM) - 0.006),
        }
    }
}

#[test]
fn the_real_bones_structures_are_where_they_are() {
    let Some(path) = crate::support::real_file("ct/temporal-bone-png") else { return };
    let (bone, _) = load_path(path, &Default::default()).expect("the real bone");
    let structures = Structures::for_volume(&bone).expect("it has a palette");
    let grid = bone.grid();
    let cut = CutVolume::new(grid.size);
    let all = CriticalDistances::build(grid, &structures, &cut, 6.0);
    assert!(all.fields().len() > 10, "{} critical structures", all.fields().len());
    let spacing_mm = grid.spacing_mm().as_vec3();
    let mut rng = Pcg32::seed_from_u64(8);
    let mut within = 0;
    for place in 0..150 {
        // Also outside of the grid's sides, where a burr rests on sawn bone.
        let field = &all.fields()[place % all.fields().len()];
        let (low, high) = (field.bounds().min.as_vec3() - 6.0, field.bounds().max.as_vec3() + 6.0);
        let voxel = Vec3::from_array([0, 1, 2].map(|axis| rng.random_range(low[axis]..high[axis]).round()));
        let to = |(place, &label): (usize, &u8)| {
            if label != field.label() {
                return f32::INFINITY;
            }
            let [place, width, height] = [place as u32, grid.size.x, grid.size.y];
            let at = UVec3::new(place % width, place / width % height, place / (width * height));
            ((at.as_vec3() - voxel) * spacing_mm).length()
        };
        let nearest_mm = structures.labels().par_iter().enumerate().map(to).reduce(|| f32::INFINITY, f32::min);
        let is_inside = voxel.cmpge(Vec3::ZERO).all() && voxel.cmplt(grid.size.as_vec3()).all();
        // Outside it is a lower bound.
        let least_mm = if is_inside { nearest_mm } else { 0.7 * nearest_mm };
        match field.distance_mm(voxel) {
            Some(mm) => {
                within += 1;
                assert!(mm < nearest_mm + 0.01 && mm > least_mm - 0.01, "{voxel}: {mm} mm, not {nearest_mm}");
            }
            None => assert!(nearest_mm > 5.99, "label {} at {voxel}: {nearest_mm} mm", field.label()),
        }
    }
    assert!(within > 15, "{within} distances within the band");
}
