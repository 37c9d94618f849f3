//! Deformed volumes voxel by voxel, held against SimpleITK and scipy.

use crate::deform_support::{gently_moved, random_tree};
use crate::support::real_file;
use bevy::math::{DVec3, UVec3, Vec3};
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::volume::load::{VolumeLoadOptions, load_path};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use serde_json::Value;

/// The formula of `script/warp-reference`.
fn known_lattice(level: u32, amplitude: f64) -> DeformLattice {
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, level).expect("a lattice");
    let known = |p: DVec3| DVec3::new((6.0 * p.y + 1.0).sin(), (5.0 * p.z + 2.0).sin(), (7.0 * p.x).cos()) * amplitude;
    lattice.set_from(known).expect("numbers");
    lattice
}

#[test]
fn warps_agree_with_simpleitk_and_scipy() {
    for fixture in ["warp-head-2", "warp-head-3", "warp-tooth-2", "warp-tooth-3"] {
        let path = format!("{}/tests/fixtures/{fixture}.json", env!("CARGO_MANIFEST_DIR"));
        let known: Value = serde_json::from_slice(&std::fs::read(path).expect("a fixture")).expect("JSON");
        let name = known["file"].as_str().expect("a name");
        let Some(path) = real_file(&format!("ct/{name}")) else { continue };
        let (volume, _) = load_path(path, &VolumeLoadOptions::default()).expect("a real volume loads");
        let number = |value: &Value| value.as_f64().expect("a number");
        let lattice = known_lattice(known["level"].as_u64().expect("a level") as u32, number(&known["amplitude"]));
        let size: Vec<f64> = known["size"].as_array().expect("three").iter().map(number).collect();
        assert_eq!(volume.grid().size.as_dvec3().to_array().to_vec(), size);
        let warped = volume.warped(&lattice).expect("a volume");
        let [least, greatest] = volume.range();
        let (slope, _) = volume.rescale();
        let whole =
            if matches!(volume.voxels(), Voxels::F32(_)) { 1e-6 * (greatest - least) } else { 0.5001 * slope.abs() };
        let voxels = known["voxels"].as_array().expect("voxels");
        let (mut worst, mut compared, mut moved) = (0.0_f64, 0, 0);
        for (n, voxel) in voxels.iter().enumerate() {
            let at: Vec<u32> = voxel.as_array().expect("three").iter().map(|part| number(part) as u32).collect();
            let at = UVec3::new(at[0], at[1], at[2]);
            let ours = volume.warped_value(&lattice, at);
            let index = volume.grid().index(at);
            for peer in ["scipy", "simpleitk"] {
                let Some(theirs) = known[peer][n].as_f64() else { continue };
                worst = worst.max((ours - theirs).abs() / (greatest - least));
                compared += 1;
            }
            assert!((warped.value(index) - ours).abs() <= whole, "{at}: {ours} is stored as {}", warped.value(index));
            moved += usize::from((ours - volume.value(index)).abs() > 0.05 * (greatest - least));
        }
        println!("{fixture}: {compared} values, {moved} voxels changed; worst {worst:.1e} of the range");
        assert!(compared > 550 && moved > 50, "{compared} {moved}");
        assert!(worst < 1e-7, "{fixture}: {worst}");
    }
}

fn grid(size: UVec3) -> VolumeGrid {
    VolumeGrid::upright(size, DVec3::new(0.5, 1.0, 2.0))
}

fn noise(size: UVec3, seed: u64) -> Volume {
    let mut random = Pcg32::seed_from_u64(seed);
    let count = grid(size).count();
    Volume::new(grid(size), Voxels::F32((0..count).map(|_| random.random_range(-1.0..1.0)).collect()), 2.0, 5.0)
        .expect("a volume")
}

#[test]
fn rows_are_what_single_voxels_are() {
    for (seed, size) in
        [(1, UVec3::new(33, 20, 17)), (2, UVec3::new(1, 9, 70)), (3, UVec3::new(2, 1, 1)), (4, UVec3::splat(40))]
    {
        let volume = noise(size, seed);
        let lattice = gently_moved(random_tree(seed, 5, 6), seed, 0.9);
        let warped = volume.warped(&lattice).expect("a volume");
        for index in 0..volume.grid().count() as u32 {
            let at = UVec3::new(index % size.x, index / size.x % size.y, index / size.x / size.y);
            let (ours, single) = (warped.value(index as usize), volume.warped_value(&lattice, at));
            assert!((ours - single).abs() < 1e-5, "{at} of {size}: {ours} and {single}");
        }
    }
}

#[test]
fn at_rest_nothing_changes_and_a_whole_voxel_is_a_shift() {
    let size = UVec3::new(16, 8, 4);
    let volume = noise(size, 7);
    let mut lattice = volume.grid().lattice(2).expect("a lattice");
    assert_eq!(volume.warped(&lattice).expect("a volume").voxels(), volume.voxels());
    // Translations lead to what is shown, so matter moves the other way; beyond the edge the last voxels go on.
    lattice.set_from(|_| DVec3::new(3.0 / 16.0, 0.0, -1.0 / 4.0)).expect("numbers");
    let warped = volume.warped(&lattice).expect("a volume");
    for index in 0..volume.grid().count() as u32 {
        let at = UVec3::new(index % 16, index / 16 % 8, index / 128);
        let from = UVec3::new((at.x + 3).min(15), at.y, at.z.saturating_sub(1));
        let (ours, theirs) = (warped.value(index as usize), volume.value(volume.grid().index(from)));
        assert!((ours - theirs).abs() < 1e-5, "{at}: {ours} and {theirs}");
    }
}

#[test]
fn a_grids_lattice_lies_over_its_voxels() {
    let grid = grid(UVec3::new(10, 20, 5));
    let lattice = grid.lattice(1).expect("a lattice");
    for voxel in [Vec3::ZERO, Vec3::new(9.0, 3.0, 2.0)] {
        let in_box = lattice.box_from_body().transform_point3(grid.volume_from_voxel().transform_point3(voxel));
        assert!(in_box.distance((voxel + 0.5) / grid.size.as_vec3()) < 1e-5);
    }
    assert!(grid.lattice(40).is_err());
}

#[test]
fn every_kind_of_voxel_and_structures_move_along() {
    let size = UVec3::new(12, 10, 8);
    let count = grid(size).count();
    let mut random = Pcg32::seed_from_u64(5);
    let bytes: Vec<u8> = (0..count).map(|_| random.random()).collect();
    let lattice = gently_moved(random_tree(5, 3, 4), 5, 0.9);
    let warped =
        |voxels: Voxels| Volume::new(grid(size), voxels, 1.0, 0.0).expect("a volume").warped(&lattice).expect("one");
    let floats = warped(Voxels::F32(bytes.iter().map(|&byte| byte.into()).collect()));
    let whole = [
        warped(Voxels::U8(bytes.clone())),
        warped(Voxels::I16(bytes.iter().map(|&byte| byte.into()).collect())),
        warped(Voxels::U16(bytes.iter().map(|&byte| byte.into()).collect())),
        warped(Voxels::Rgba(bytes.iter().map(|&byte| [255, 0, 128, byte]).collect())),
    ];
    for volume in &whole {
        for index in 0..count {
            assert!((volume.value(index) - floats.value(index)).abs() <= 0.5001);
        }
    }
    let Voxels::Rgba(colours) = whole[3].voxels() else { panic!("still colours") };
    assert!(colours.iter().all(|colour| colour[3] == 0 || colour[..3] == [255, 0, 128]), "colours do not fade");
    let structure = Structure {
        name: "half".into(),
        colour: [200, 0, 0],
        tissue: Tissue::Soft,
        hardness: 1.0,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical: false,
    };
    let labels: Vec<u8> = (0..count).map(|index| u8::from(index % 12 < 6)).collect();
    let structures = Structures::new(vec![structure], labels.clone(), vec![255; count]).expect("structures");
    let volume = noise(size, 1).with_structures(structures).expect("they fit");
    let mut lattice = volume.grid().lattice(1).expect("a lattice");
    lattice.set_from(|_| DVec3::X * 2.0 / 12.0).expect("numbers");
    let warped = volume.warped(&lattice).expect("a volume");
    let moved = warped.structures().expect("they move along");
    let expected: Vec<u8> = (0..count).map(|index| u8::from(index % 12 < 4)).collect();
    assert_eq!(moved.labels(), expected);
    assert!(moved.solid().iter().all(|&solid| solid == 255));
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let volume = noise(UVec3::new(50, 30, 20), 3);
    let lattice = gently_moved(random_tree(3, 4, 6), 3, 0.9);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| volume.warped(&lattice).expect("a volume").content_hash())
    };
    assert_eq!(on(1), on(4));
    assert_eq!(on(1), on(3));
}
