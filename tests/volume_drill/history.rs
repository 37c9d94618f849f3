//! Undo, redo, reset; what readers of a cut are told; the same bits each time.

use super::phantom::{PLENTY_N, Phantom, all_of, ball, cylinder, resting, upright, whole};
use bevy_surgery::volume::cut::CutVolume;
use bevy_surgery::volume::{VolumeGrid, VoxelBox};
use glam::{DVec3, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn phantom() -> Phantom {
    Phantom::solid(VolumeGrid::upright(UVec3::new(70, 50, 45), DVec3::splat(0.25)))
}

/// One stroke of several steps.
fn stroke(phantom: &Phantom, cut: &mut CutVolume, seed: u64) {
    let mut rng = Pcg32::seed_from_u64(seed);
    let mut point = || DVec3::from_array([0; 3].map(|_| rng.random_range(-5.0..5.0)));
    let (from, to) = (point(), point());
    cut.begin_stroke();
    phantom.follow(cut, ball(3.0), 100.0, 60, 0.2, |t| from.lerp(to, t / 0.2));
}

#[test]
fn strokes_are_undone_and_redone() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    assert!(!cut.undo() && !cut.redo() && !cut.can_undo() && !cut.can_redo());
    let mut states = vec![cut.clone()];
    for seed in 0..6 {
        stroke(&phantom, &mut cut, seed);
        assert!(cut != states[states.len() - 1]);
        states.push(cut.clone());
    }
    for state in states[..6].iter().rev() {
        assert!(cut.undo());
        assert!(&cut == state);
    }
    assert!(!cut.undo());
    for state in &states[1..4] {
        assert!(cut.redo());
        assert!(&cut == state);
    }
    // A new stroke takes the place of those that were undone.
    stroke(&phantom, &mut cut, 77);
    assert!(!cut.can_redo() && !cut.redo());
    assert!(cut.undo() && cut == states[3]);
    assert!(cut.undo() && cut == states[2]);
}

#[test]
fn a_reset_is_whole_and_can_be_undone() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    stroke(&phantom, &mut cut, 1);
    stroke(&phantom, &mut cut, 2);
    let (before, seen) = (cut.clone(), cut.revision());
    cut.reset();
    assert!(cut == phantom.cut() && cut.is_untouched(whole(&cut)));
    assert!(cut.revision() > seen);
    let changed = cut.changes_since(seen).expect("it is known what was cut before");
    for place in 0..cut.size().element_product() {
        let size = cut.size();
        let voxel = UVec3::new(place % size.x, place / size.x % size.y, place / (size.x * size.y));
        let is_told = changed.iter().any(|of| voxel.cmpge(of.min).all() && voxel.cmplt(of.max).all());
        assert!(is_told || before.remaining(voxel) == 1.0, "{voxel}");
    }
    stroke(&phantom, &mut cut, 3);
    assert!(cut.undo() && cut == phantom.cut());
    assert!(cut.undo() && cut == before);
    assert!(cut.redo() && cut == phantom.cut());
}

#[test]
fn old_strokes_are_forgotten_beyond_the_limit() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    for seed in 0..30 {
        stroke(&phantom, &mut cut, seed);
    }
    let last = cut.clone();
    cut.set_undo_limit(400_000);
    let mut undone = 0;
    while cut.undo() {
        undone += 1;
    }
    assert!((1..20).contains(&undone), "{undone} strokes of 16 KiB a brick");
    for _ in 0..undone {
        assert!(cut.redo());
    }
    assert!(!cut.redo() && cut == last);
    cut.set_undo_limit(0);
    assert!(cut.undo(), "the latest is always kept");
    assert!(cut.redo() && cut == last);
    stroke(&phantom, &mut cut, 99);
    assert!(cut.undo() && cut == last && !cut.undo());
}

#[test]
fn readers_are_told_of_every_change() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    let mut rng = Pcg32::seed_from_u64(5);
    let bounds = whole(&cut);
    let (mut mirror, mut seen) = (vec![255; bounds.count()], cut.revision());
    for step in 0..60 {
        match rng.random_range(0..10) {
            0 => drop(cut.undo()),
            1 => drop(cut.redo()),
            2 if step % 7 == 0 => cut.reset(),
            _ => stroke(&phantom, &mut cut, step),
        }
        if rng.random_range(0..3) == 0 {
            continue;
        }
        let boxes = cut.changes_since(seen).unwrap_or_else(|| vec![bounds]);
        assert!(boxes.len() <= 8);
        seen = cut.revision();
        for changed in boxes {
            let mut bytes = vec![0; changed.count()];
            cut.copy_remaining(changed, &mut bytes);
            let size = changed.size();
            for (place, byte) in bytes.into_iter().enumerate() {
                let place = place as u32;
                let local = UVec3::new(place % size.x, place / size.x % size.y, place / (size.x * size.y));
                mirror[phantom.grid().index(changed.min + local)] = byte;
            }
        }
        let mut all = vec![0; bounds.count()];
        cut.copy_remaining(bounds, &mut all);
        assert!(all == mirror, "step {step}: a change was not told");
    }
}

#[test]
fn a_step_tells_which_voxels_it_changed() {
    let phantom = Phantom::block(64);
    let mut cut = phantom.cut();
    for step in 0..40 {
        let before = all_of(&cut);
        let at = |step: f64| upright(DVec3::new(-6.0 + 0.3 * step, 9.5, 0.04 * step));
        let mut one = resting(ball(3.0), at(f64::from(step)), 3.0);
        one.to = at(f64::from(step) + 1.0);
        let changed = phantom.drill(&mut cut, &one, 1.0 / 60.0).changed.expect("it drills");
        let mut tight: Option<VoxelBox> = None;
        for (index, (before, after)) in before.into_iter().zip(all_of(&cut)).enumerate() {
            assert!(after <= before, "remaining only falls");
            if after < before {
                let index = index as u32;
                let voxel = UVec3::new(index % 64, index / 64 % 64, index / 4096);
                let one = VoxelBox { min: voxel, max: voxel + 1 };
                tight = Some(tight.map_or(one, |tight| tight.union(&one)));
            }
        }
        assert_eq!(Some(changed), tight);
    }
}

#[test]
fn the_same_strokes_give_the_same_bits() {
    let phantom = Phantom::block(64);
    let run = |interrupted: bool| {
        let mut cut = phantom.cut();
        let mut removals = Vec::new();
        for step in 0..50 {
            let at = |step: f64| upright(DVec3::new(-6.0 + 0.2 * step, 9.5, 0.3 * (step * 0.5).sin()));
            let burr = if step % 2 == 0 { ball(4.0) } else { cylinder(2.0, 3.0) };
            let mut one = resting(burr, at(f64::from(step)), 4.0);
            one.to = at(f64::from(step) + 1.0);
            removals.push(phantom.drill(&mut cut, &one, 1.0 / 60.0));
            if interrupted {
                // A copy, a saved one, or one that was undone and redone goes on as the original does.
                cut = match step % 3 {
                    0 => cut.clone(),
                    1 => CutVolume::load(&cut.save([7; 32]), cut.size(), [7; 32]).expect("just saved"),
                    _ => {
                        assert!(cut.undo() && cut.redo());
                        cut
                    }
                };
            }
        }
        (removals, all_of(&cut))
    };
    let first = run(false);
    assert!(first.0.iter().map(|removal| removal.total_mm3).sum::<f64>() > 1.0);
    assert!(run(false) == first);
    assert!(run(true) == first);
}

#[test]
fn samples_and_copies_agree_with_voxels() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    for seed in 0..4 {
        stroke(&phantom, &mut cut, seed);
    }
    let mut rng = Pcg32::seed_from_u64(8);
    let size = cut.size();
    for _ in 0..200 {
        let a = UVec3::from_array(size.to_array().map(|side| rng.random_range(0..side + 5)));
        let b = UVec3::from_array(size.to_array().map(|side| rng.random_range(0..side + 5)));
        let of = VoxelBox { min: a.min(b), max: a.max(b) };
        let mut bytes = vec![1; of.count()];
        cut.copy_remaining(of, &mut bytes);
        let inner = of.size();
        for (place, byte) in bytes.into_iter().enumerate() {
            let place = place as u32;
            let local = UVec3::new(place % inner.x, place / inner.x % inner.y, place / (inner.x * inner.y));
            assert_eq!(byte, (cut.remaining(of.min + local) * 255.0 + 0.5) as u8);
        }
        if cut.is_untouched(of) {
            let mut bytes = vec![1; of.count()];
            cut.copy_remaining(of, &mut bytes);
            assert!(bytes.iter().all(|&byte| byte == 255));
        }
    }
    let voxel = UVec3::new(30, 24, 22);
    assert_eq!(cut.sample(voxel.as_vec3()), cut.remaining(voxel));
    for _ in 0..500 {
        let at = Vec3::from_array(size.as_vec3().to_array().map(|side| rng.random_range(-1.0..side)));
        let inside = at.clamp(Vec3::ZERO, size.as_vec3() - 1.0);
        let mut expected = 0.0;
        for corner in 0..8 {
            let voxel =
                (inside.floor().as_uvec3() + UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2)).min(size - 1);
            let part = inside - inside.floor();
            let weight = |axis: usize| if corner >> axis & 1 == 1 { part[axis] } else { 1.0 - part[axis] };
            expected += weight(0) * weight(1) * weight(2) * cut.remaining(voxel);
        }
        assert!((cut.sample(at) - expected).abs() < 1e-5);
    }
    assert_eq!(cut.sample(Vec3::NAN), 1.0);
    assert_eq!(cut.sample(Vec3::splat(f32::INFINITY)), 1.0);
    // Too small a slice gets the first rows.
    let mut few = [9; 100];
    cut.copy_remaining(whole(&cut), &mut few);
    assert!(few.iter().all(|&byte| byte == 255));
}

#[test]
fn untouched_is_told_by_bricks() {
    let phantom = phantom();
    let mut cut = phantom.cut();
    assert!(cut.is_untouched(whole(&cut)));
    // Voxel coordinates 8, 8, 8: within the first brick.
    let at_mm = (DVec3::splat(8.0) - (phantom.grid().size.as_dvec3() - 1.0) * 0.5) * 0.25;
    phantom.drill(&mut cut, &resting(ball(1.0), upright(at_mm), PLENTY_N), 1.0);
    let cube = |min: u32, max: u32| VoxelBox { min: UVec3::splat(min), max: UVec3::splat(max) };
    assert!(!cut.is_untouched(cube(0, 1)) && !cut.is_untouched(cube(8, 40)));
    assert!(cut.is_untouched(cube(16, 40)) && cut.is_untouched(cube(3, 3)) && cut.is_untouched(cube(500, 600)));
}
