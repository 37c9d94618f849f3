//! Strokes that nobody should make.

use super::phantom::{PLENTY_N, Phantom, SPEED_RPM, all_of, ball, cylinder, matchstick, resting, upright};
use bevy_surgery::volume::VolumeGrid;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrPose, BurrShape, BurrStroke, CutVolume, Removal};
use glam::{DAffine3, DMat3, DVec3, UVec3, Vec3};
use proptest::prelude::*;

fn small() -> Phantom {
    Phantom::solid(VolumeGrid::upright(UVec3::new(21, 33, 18), DVec3::new(0.3, 0.25, 0.4)))
}

#[test]
fn what_is_not_a_number_removes_nothing() {
    let phantom = small();
    let mut cut = phantom.cut();
    let good = resting(cylinder(2.0, 3.0), upright(DVec3::ZERO), 5.0);
    let pose = |centre_m, axis| BurrPose { centre_m, axis };
    let mut bad = Vec::new();
    for number in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        bad.push(BurrStroke { force_n: number, ..good });
        bad.push(BurrStroke { speed_rpm: number, ..good });
        for (centre_m, axis) in [
            (Vec3::new(0.0, number, 0.0), Vec3::Y),
            (Vec3::ZERO, Vec3::new(number, 0.0, 1.0)),
            (Vec3::ZERO, Vec3::ZERO),
        ] {
            bad.push(BurrStroke { from: pose(centre_m, axis), ..good });
            bad.push(BurrStroke { to: pose(centre_m, axis), ..good });
        }
        bad.push(BurrStroke { burr: Burr { diameter_m: number, ..good.burr }, ..good });
        bad.push(BurrStroke { burr: Burr { shape: BurrShape::Cylinder { length_m: number }, ..good.burr }, ..good });
    }
    for force_n in [0.0, -3.0] {
        bad.push(BurrStroke { force_n, ..good });
    }
    bad.push(BurrStroke { speed_rpm: 0.0, ..good });
    bad.push(BurrStroke { burr: ball(50.0), ..good });
    for stroke in bad {
        assert_eq!(phantom.drill(&mut cut, &stroke, 0.01), Removal::default(), "{stroke:?}");
    }
    for dt_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(phantom.drill(&mut cut, &good, dt_s), Removal::default(), "{dt_s} s");
    }
    assert!(cut == phantom.cut() && !cut.can_undo());
    // A ball needs no axis, and another volume's cut is left alone.
    let ball =
        BurrStroke { burr: ball(2.0), from: pose(Vec3::ZERO, Vec3::NAN), to: pose(Vec3::ZERO, Vec3::ZERO), ..good };
    assert!(phantom.drill(&mut cut, &ball, 0.01).total_mm3 > 0.0);
    let mut other = CutVolume::new(UVec3::splat(21));
    assert_eq!(phantom.drill(&mut other, &good, 0.01), Removal::default());
    assert!(phantom.drill(&mut cut, &good, 0.01).total_mm3 > 0.0);
}

#[test]
fn far_away_nothing_happens_and_a_leap_through_is_cut() {
    let phantom = small();
    let mut cut = phantom.cut();
    for at in [DVec3::splat(1e4), DVec3::new(0.0, -9.0, 0.0), DVec3::new(1e30, 0.0, 0.0)] {
        let stroke = resting(matchstick(2.0, 8.0), upright(at), PLENTY_N);
        assert_eq!(phantom.drill(&mut cut, &stroke, 0.01), Removal::default());
    }
    for burr in [ball(1.5), cylinder(1.5, 2.0), matchstick(1.5, 2.0)] {
        let mut cut = phantom.cut();
        // A kilometre in a step, right through the middle.
        let (from, to) = (upright(DVec3::new(-6e5, 0.0, 0.0)), upright(DVec3::new(4e5, 0.0, 0.0)));
        let stroke = BurrStroke { from, to, ..resting(burr, from, PLENTY_N) };
        // It is within the grid for a hundred-thousandth of the time: a day's budget for the step.
        let removal = phantom.drill(&mut cut, &stroke, 86_400.0);
        let changed = removal.changed.expect("through the middle");
        assert_eq!((changed.min.x, changed.max.x), (0, 21), "{burr:?}");
        let middle = (0..21).map(|x| cut.remaining(UVec3::new(x, 16, 9))).fold(0.0, f32::max);
        assert_eq!(middle, 0.0, "{burr:?}");
    }
}

#[test]
fn time_outside_the_volume_removes_nothing_inside() {
    // Half of the way lies within reach of the grid, so half of the budget is spent there.
    let phantom = Phantom::solid(VolumeGrid::upright(UVec3::splat(60), DVec3::splat(0.25)));
    let burr = ball(4.0);
    let stroke = |from: f64, to: f64| BurrStroke {
        from: upright(DVec3::new(from, 0.0, 0.0)),
        to: upright(DVec3::new(to, 0.0, 0.0)),
        ..resting(burr, upright(DVec3::ZERO), 1.0)
    };
    let inside = phantom.drill(&mut phantom.cut(), &stroke(-4.0, 4.0), 0.1).total_mm3;
    let far = phantom.drill(&mut phantom.cut(), &stroke(-4.0, 1604.0), 0.1).total_mm3;
    assert!((inside / (burr.cortical_mm3_per_s(1.0, SPEED_RPM) * 0.1) - 1.0).abs() < 1e-3);
    assert!(far < 0.01 * inside, "{far} {inside}");
}

#[test]
fn burrs_larger_than_the_grid_and_voxels_larger_than_the_burr() {
    for spacing_mm in [1e-4, 1e-2, 3.0, 500.0] {
        let phantom = Phantom::solid(VolumeGrid::upright(UVec3::splat(12), DVec3::splat(spacing_mm)));
        for burr in [ball(6.0), cylinder(1.0, 20.0), matchstick(1.0, 20.0)] {
            let mut cut = phantom.cut();
            let at = |x: f64| upright(DVec3::new(x, 0.0, 0.0) * spacing_mm);
            let stroke = BurrStroke { to: at(6.0), ..resting(burr, at(-6.0), PLENTY_N) };
            let removal = phantom.drill(&mut cut, &stroke, 10.0);
            let most = phantom.grid().voxel_mm3() * phantom.grid().count() as f64;
            // What is thinner than half a voxel may pass between voxels.
            assert!((0.0..=most * 1.0001).contains(&removal.total_mm3), "{spacing_mm}: {removal:?}");
            if spacing_mm < 0.1 {
                assert!(all_of(&cut).into_iter().all(|remaining| remaining == 0.0));
            }
        }
    }
}

#[test]
fn sizes_that_no_volume_has_hold_nothing() {
    for size in [UVec3::ZERO, UVec3::MAX, UVec3::new(5, 0, 5), UVec3::splat(2048)] {
        let mut cut = CutVolume::new(size);
        assert_eq!(cut.size(), UVec3::ZERO);
        assert_eq!(cut.remaining(UVec3::ZERO), 1.0);
        assert_eq!(cut.sample(Vec3::ZERO), 1.0);
        cut.reset();
        assert!(!cut.undo() && CutVolume::load(&cut.save([0; 32]), UVec3::ZERO, [0; 32]).is_ok());
    }
}

fn any_pose() -> impl Strategy<Value = BurrPose> {
    let number = prop_oneof![8 => -6e-3..6e-3f32, 1 => any::<f32>(), 1 => -1e3..1e3f32];
    let axis = prop_oneof![4 => -1.0..1.0f32, 1 => any::<f32>()];
    (prop::array::uniform3(number), prop::array::uniform3(axis))
        .prop_map(|(centre, axis)| BurrPose { centre_m: centre.into(), axis: axis.into() })
}

fn any_burr() -> impl Strategy<Value = Burr> {
    let kind = prop_oneof![Just(BurrKind::Cutting), Just(BurrKind::Diamond), Just(BurrKind::Polishing)];
    let length = prop_oneof![6 => 1e-3..2e-2f32, 1 => any::<f32>()];
    let shape = (0..3, length).prop_map(|(shape, length_m)| match shape {
        0 => BurrShape::Sphere,
        1 => BurrShape::Cylinder { length_m },
        _ => BurrShape::Matchstick { length_m },
    });
    let diameter = prop_oneof![9 => 1e-3..6e-3f32, 1 => any::<f32>()];
    (kind, shape, diameter).prop_map(|(kind, shape, diameter_m)| Burr { kind, shape, diameter_m })
}

fn any_axes() -> impl Strategy<Value = DMat3> {
    let spacing = prop::array::uniform3(0.05..1.0f64);
    (spacing, prop::array::uniform3(-0.6..0.6f64), any::<bool>()).prop_map(|(spacing, skew, is_mirrored)| {
        let sign = if is_mirrored { -1.0 } else { 1.0 };
        DMat3::from_cols(
            DVec3::new(0.0, spacing[0] * sign, 0.0),
            DVec3::new(spacing[1], spacing[1] * skew[0], 0.0),
            DVec3::new(spacing[2] * skew[1], spacing[2] * skew[2], spacing[2]),
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_stroke_leaves_a_cut_that_is_one(
        axes in any_axes(),
        strokes in prop::collection::vec((any_burr(), any_pose(), any_pose(), prop_oneof![4 => 0.0..50.0f32, 1 => any::<f32>()],
            prop_oneof![5 => 1e-4..1.0f64, 1 => any::<f64>()]), 1..6),
    ) {
        let grid = VolumeGrid {
            size: UVec3::new(19, 23, 35),
            lps_mm_from_voxel: DAffine3::from_mat3_translation(axes, DVec3::new(7.0, 8.0, -9.0)),
        };
        let phantom = Phantom::new(grid, |voxel| ((voxel.x * 40) as u8, (voxel.y % 3) as u8));
        let mut cut = phantom.cut();
        let mut last = all_of(&cut);
        for (burr, from, to, force_n, dt_s) in strokes {
            let removal = phantom.drill(&mut cut, &BurrStroke { burr, from, to, force_n, speed_rpm: SPEED_RPM }, dt_s);
            let now = all_of(&cut);
            let mut mm3 = 0.0;
            for (index, (before, after)) in last.iter().zip(&now).enumerate() {
                prop_assert!((0.0..=1.0).contains(after) && after <= before);
                mm3 += f64::from(before - after) * f64::from(phantom.structures.solid()[index]) / 255.0;
            }
            mm3 *= grid.voxel_mm3();
            prop_assert!((removal.total_mm3 - mm3).abs() < 1e-3 * mm3 + 1e-6, "{} {}", removal.total_mm3, mm3);
            prop_assert_eq!(removal.changed.is_some(), now != last);
            prop_assert!(removal.by_label_mm3.iter().all(|&(_, mm3)| mm3 > 0.0 && mm3.is_finite()));
            prop_assert!(removal.by_label_mm3.is_sorted_by_key(|&(label, _)| label));
            prop_assert!(removal.centroid_m.is_none_or(|centroid| centroid.is_finite()));
            let budget = burr.cortical_mm3_per_s(force_n, SPEED_RPM) * if dt_s.is_nan() { 0.0 } else { dt_s.max(0.0) };
            let hardest = removal.by_label_mm3.iter().map(|&(label, mm3)| mm3 * [1.0, 2.0, 1.0][usize::from(label)]).sum::<f64>();
            prop_assert!(hardest <= budget * 1.001 + 1e-6, "{} of {}", hardest, budget);
            last = now;
        }
        while cut.undo() {}
        prop_assert!(cut == phantom.cut());
    }
}
