//! The procedural temporal bone: the same at every size and on any number of threads, and put together like a real one.

use bevy_surgery::volume::Volume;
use bevy_surgery::volume::phantom::{PHANTOM_SIDE_MM, PhantomOptions, phantom};
use bevy_surgery::volume::structures::Structures;
use glam::{IVec3, UVec3, Vec3};
use std::sync::{Arc, OnceLock};

fn of_size(size: u32) -> Volume {
    phantom(&PhantomOptions { size, ..Default::default() }).expect("a phantom")
}

/// The phantom that most tests look at, made once.
fn shared() -> &'static Volume {
    static PHANTOM: OnceLock<Volume> = OnceLock::new();
    PHANTOM.get_or_init(|| of_size(128))
}

/// The same with the voxels that thin structures need.
fn fine() -> &'static Volume {
    static PHANTOM: OnceLock<Volume> = OnceLock::new();
    PHANTOM.get_or_init(|| of_size(256))
}

fn structures(volume: &Volume) -> &Arc<Structures> {
    volume.structures().expect("a phantom has structures")
}

/// Cubic millimetres of every structure, and of all of them.
fn mm3_by_name(volume: &Volume) -> Vec<(String, f64)> {
    let structures = structures(volume);
    let mut filled = vec![0u64; structures.list().len() + 1];
    structures.labels().iter().zip(structures.solid()).for_each(|(&label, &solid)| {
        filled[usize::from(label)] += u64::from(solid);
    });
    let mm3 = |filled: u64| filled as f64 / 255.0 * volume.grid().voxel_mm3();
    let named =
        structures.list().iter().zip(&filled[1..]).map(|(structure, &filled)| (structure.name.clone(), mm3(filled)));
    named.chain([("all".to_string(), mm3(filled.iter().sum()))]).collect()
}

/// The voxel at a place in millimetres from the middle.
fn voxel_at(volume: &Volume, p: Vec3) -> usize {
    let size = volume.grid().size;
    let place = (p / PHANTOM_SIDE_MM as f32 + 0.5) * size.as_vec3();
    volume.grid().index(place.as_uvec3().min(size - 1))
}

fn place_mm(volume: &Volume, index: usize) -> Vec3 {
    let size = volume.grid().size;
    let voxel = UVec3::new(index as u32 % size.x, index as u32 / size.x % size.y, index as u32 / (size.x * size.y));
    ((voxel.as_vec3() + 0.5) / size.as_vec3() - 0.5) * PHANTOM_SIDE_MM as f32
}

fn neighbours(volume: &Volume, index: usize) -> Vec<usize> {
    let size = volume.grid().size.as_ivec3();
    let voxel = (place_mm(volume, index) / PHANTOM_SIDE_MM as f32 + 0.5) * size.as_vec3();
    let mut near = Vec::with_capacity(26);
    for step in 0..27 {
        let place = voxel.as_ivec3() + IVec3::new(step % 3, step / 3 % 3, step / 9) - 1;
        if step != 13 && place.cmpge(IVec3::ZERO).all() && place.cmplt(size).all() {
            near.push(volume.grid().index(place.as_uvec3()));
        }
    }
    near
}

/// Voxels of a structure, and how many of them the greatest connected part has.
fn connected(volume: &Volume, name: &str) -> (usize, usize) {
    let structures = structures(volume);
    let label = structures.label_of(name).expect("a structure of the phantom");
    let labels = structures.labels();
    let mut seen = vec![false; labels.len()];
    let (mut all, mut greatest) = (0, 0);
    for start in 0..labels.len() {
        if labels[start] != label || seen[start] {
            continue;
        }
        let (mut stack, mut part) = (vec![start], 0);
        seen[start] = true;
        while let Some(index) = stack.pop() {
            part += 1;
            for near in neighbours(volume, index) {
                if labels[near] == label && !seen[near] {
                    seen[near] = true;
                    stack.push(near);
                }
            }
        }
        all += part;
        greatest = greatest.max(part);
    }
    (all, greatest)
}

#[test]
fn every_size_shows_the_same_bone() {
    let [coarse, middle, fine] = [&of_size(64), shared(), fine()].map(mm3_by_name);
    println!("mm3 at 64, 128, 256:");
    for ((coarse, middle), fine) in coarse.iter().zip(&middle).zip(&fine) {
        println!("  {:24} {:9.1} {:9.1} {:9.1}", fine.0, coarse.1, middle.1, fine.1);
        // One label per voxel rounds thin things: only what is thicker than a few voxels keeps its volume to a percent.
        let thick = ["all", "Cortical bone", "Air cell walls", "Otic capsule", "Sigmoid sinus"];
        let thick = thick.contains(&fine.0.as_str());
        let off = |other: f64| (other / fine.1 - 1.0).abs();
        assert!(!thick || off(coarse.1) < 0.01, "{} at 64^3: {:.1} and {:.1} mm3", fine.0, coarse.1, fine.1);
        let allowed = if thick {
            0.01
        } else if fine.1 > 50.0 {
            0.05
        } else {
            f64::INFINITY
        };
        assert!(off(middle.1) < allowed, "{} at 128^3: {:.1} and {:.1} mm3", fine.0, middle.1, fine.1);
        assert!(coarse.1 > 0.0 && middle.1 > 0.0, "{} is lost", fine.0);
    }
}

#[test]
fn options_decide_every_bit() {
    let make = |options: PhantomOptions, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let volume = pool.install(|| phantom(&options)).expect("a phantom");
        (volume.content_hash(), structures(&volume).clone())
    };
    let options = PhantomOptions { size: 50, ..Default::default() };
    let one = make(options, 1);
    assert!(one == make(options, 4), "threads change nothing");
    assert!(one != make(PhantomOptions { seed: 2, ..options }, 4), "seeds do");
}

#[test]
fn what_makes_no_phantom_is_refused() {
    let refused = |options| phantom(&options).expect_err("must be refused").to_string();
    let options = PhantomOptions::default();
    assert!(refused(PhantomOptions { size: 16, ..options }).contains("16"));
    assert!(refused(PhantomOptions { size: 513, ..options }).contains("513"));
    assert!(refused(PhantomOptions { pneumatization: f32::NAN, ..options }).contains("pneumatization"));
}

#[test]
fn seeds_give_different_bones_that_all_hold_together() {
    for seed in [0, 7, u64::MAX] {
        let volume = phantom(&PhantomOptions { size: 64, seed, ..Default::default() }).expect("a phantom");
        for (name, mm3) in mm3_by_name(&volume) {
            assert!(mm3 > 0.0, "seed {seed}: no {name}");
        }
        let (all, greatest) = connected(&volume, "Sigmoid sinus");
        assert_eq!(all, greatest, "seed {seed}: the sinus is in pieces");
    }
}

#[test]
fn values_are_those_of_a_ct() {
    let volume = shared();
    let structures = structures(volume);
    let mut sums = vec![(0.0, 0); structures.list().len() + 1];
    for (index, (&label, &solid)) in structures.labels().iter().zip(structures.solid()).enumerate() {
        assert_eq!(label > 0, solid > 0, "voxel {index}: filled means labelled");
        let value = volume.value(index);
        if solid == 0 {
            assert!(value < -990.0, "air of {value} HU");
        } else if solid == 255 && !neighbours(volume, index).iter().any(|&near| structures.labels()[near] != label) {
            sums[usize::from(label)].0 += value;
            sums[usize::from(label)].1 += 1;
        }
    }
    let mean = |name: &str| {
        let (sum, count) = sums[usize::from(structures.label_of(name).unwrap())];
        assert!(count > 20, "{count} voxels inside {name}");
        sum / f64::from(count)
    };
    assert!((1500.0..1800.0).contains(&mean("Cortical bone")));
    assert!((900.0..1200.0).contains(&mean("Air cell walls")));
    assert!((1950.0..2200.0).contains(&mean("Otic capsule")));
    assert!((40.0..90.0).contains(&mean("Sigmoid sinus")));
    assert!(volume.range()[0] <= -1000.0 && volume.range()[1] > 2000.0, "{:?}", volume.range());
}

#[test]
fn cells_lie_under_an_unbroken_cortex() {
    let volume = shared();
    let structures = structures(volume);
    let [cortex, walls] = ["Cortical bone", "Air cell walls"].map(|name| structures.label_of(name).unwrap());
    let (mut columns, mut with_cells) = (0, 0);
    for y in -10..8 {
        for x in -9..2 {
            // From the camera's side inwards.
            let at = |depth_mm: f32| voxel_at(volume, Vec3::new(x as f32, y as f32, 23.8 - depth_mm));
            let mut depths = (0..240).map(|step| step as f32 * 0.1);
            let surface = depths.find(|&depth| structures.solid()[at(depth)] > 127).expect("bone in front");
            for step in 0..15 {
                let (deep, index) = (step as f32 * 0.1, at(surface + step as f32 * 0.1));
                assert!(structures.labels()[index] == cortex, "column {x} {y}: label {deep} mm deep");
                // The surface is slanted by up to 45 degrees and fades over three voxels.
                let solid = structures.solid()[index];
                assert!(step < 10 || solid > 250, "column {x} {y}: {solid} of 255 {deep} mm deep");
            }
            columns += 1;
            let below: Vec<usize> = (20..140).map(|step| at(surface + step as f32 * 0.1)).collect();
            let has = |label| below.iter().any(|&index| structures.labels()[index] == label);
            with_cells += usize::from(has(walls) && has(0));
        }
    }
    assert!(with_cells as f64 > 0.9 * columns as f64, "cells under {with_cells} of {columns} columns");
}

#[test]
fn nerves_vessels_and_ossicles_are_whole() {
    let volume = fine();
    for name in ["Facial nerve", "Chorda tympani", "Sigmoid sinus", "Internal carotid artery", "Malleus", "Incus"] {
        let (all, greatest) = connected(volume, name);
        assert_eq!(all, greatest, "{name} is in pieces");
    }
    // The nerve comes in through the inner auditory canal, turns twice and leaves below.
    let labels = structures(volume).labels();
    let label = |name: &str| structures(volume).label_of(name).unwrap();
    let nerve = label("Facial nerve");
    for place in [[9.6, 4.4, -12.2], [2.4, 1.4, -6.7], [0.3, -10.0, -3.5]] {
        assert_eq!(labels[voxel_at(volume, Vec3::from_array(place))], nerve, "{place:?}");
    }
    // In its canal it lies in bone all round, but for its branch, down to where it leaves.
    let bone = [label("Cortical bone"), label("Otic capsule"), label("Bony labyrinth"), label("Chorda tympani")];
    let mut inside = 0;
    for (index, _) in labels.iter().enumerate().filter(|(_, label)| **label == nerve) {
        let p = place_mm(volume, index);
        if p.y > -10.0 && p.z > -11.0 {
            inside += 1;
            for near in neighbours(volume, index) {
                assert!(labels[near] == nerve || bone.contains(&labels[near]), "{p} touches label {}", labels[near]);
            }
        }
    }
    assert!(inside > 1000, "{inside}");
    // Under the mastoid the sinus is covered by its plate.
    let sinus = label("Sigmoid sinus");
    for (index, _) in labels.iter().enumerate().filter(|(_, label)| **label == sinus) {
        let p = place_mm(volume, index);
        if p.z > 4.0 && p.y.abs() < 8.0 && p.x > -16.0 {
            for near in neighbours(volume, index) {
                assert!([sinus, bone[0]].contains(&labels[near]), "{p} touches label {}", labels[near]);
            }
        }
    }
}

#[test]
fn a_sclerotic_mastoid_has_no_cells() {
    let walls = |pneumatization| {
        let options = PhantomOptions { size: 64, pneumatization, ..Default::default() };
        let volume = phantom(&options).expect("a phantom");
        mm3_by_name(&volume)[1].1
    };
    let (none, usual) = (walls(0.0), walls(PhantomOptions::default().pneumatization));
    assert!(none > 1.5 * usual, "{none:.0} and {usual:.0} mm3");
}

#[test]
fn what_must_not_be_touched_is_critical() {
    let critical: Vec<&str> =
        structures(shared()).list().iter().filter(|structure| structure.is_critical).map(|s| s.name.as_str()).collect();
    assert_eq!(
        critical,
        [
            "Bony labyrinth",
            "Facial nerve",
            "Chorda tympani",
            "Sigmoid sinus",
            "Dura",
            "Internal carotid artery",
            "Internal auditory canal",
            "Malleus",
            "Incus",
            "Stapes"
        ]
    );
}
