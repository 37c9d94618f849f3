//! Lattices that move by themselves.

use crate::support::told;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;

fn lattice() -> DeformLattice {
    DeformLattice::new(Vec3::ZERO, Vec3::ONE, 2).expect("a lattice")
}

fn frame(time_s: f32, by: Vec3) -> KeyFrame {
    KeyFrame { time_s, translations: vec![by; 125] }
}

fn key_frames(interpolation: KeyInterpolation, loops: bool) -> LatticeAnimation {
    let frames =
        vec![frame(0.0, Vec3::ZERO), frame(0.5, Vec3::X * 0.1), frame(1.5, Vec3::Y * 0.1), frame(2.0, Vec3::ZERO)];
    LatticeAnimation::new(LatticeMotion::KeyFrames(KeyFrames { frames, interpolation, loops }))
}

fn at(animation: &LatticeAnimation, time_s: f64) -> Vec3 {
    animation.translations_at(lattice().tree(), time_s).expect("it plays")[60]
}

#[test]
fn key_frames_are_met_and_what_lies_between_is_between() {
    for interpolation in [KeyInterpolation::Linear, KeyInterpolation::Smooth] {
        for loops in [false, true] {
            let animation = key_frames(interpolation, loops);
            for (time_s, expected) in [(0.0, Vec3::ZERO), (0.5, Vec3::X * 0.1), (1.5, Vec3::Y * 0.1), (2.0, Vec3::ZERO)]
            {
                assert!(at(&animation, time_s).distance(expected) < 1e-7, "{interpolation:?} at {time_s} s");
                // Nothing jumps.
                let around = at(&animation, time_s - 1e-4).distance(at(&animation, time_s + 1e-4));
                assert!(around < 1e-4, "{interpolation:?} at {time_s} s: {around}");
            }
            // Before and after.
            let (before, after) = (at(&animation, -0.25), at(&animation, 2.25));
            if loops {
                assert!(before.distance(at(&animation, 1.75)) < 1e-6 && after.distance(at(&animation, 0.25)) < 1e-6);
                assert!(at(&animation, 1e5 + 0.5).distance(Vec3::X * 0.1) < 1e-5);
            } else {
                assert_eq!([before, after], [Vec3::ZERO; 2]);
            }
        }
    }
    assert!(at(&key_frames(KeyInterpolation::Linear, false), 1.0).distance(Vec3::new(0.05, 0.05, 0.0)) < 1e-7);
    let mut backwards = key_frames(KeyInterpolation::Linear, true);
    (backwards.speed, backwards.offset_s) = (-2.0, 0.1);
    assert!(at(&backwards, 0.3).distance(at(&key_frames(KeyInterpolation::Linear, true), 1.5)) < 1e-6);
}

#[test]
fn smooth_velocities_do_not_jump_and_linear_ones_do() {
    let velocity = |animation: &LatticeAnimation, time_s: f64| {
        (at(animation, time_s + 1e-3) - at(animation, time_s - 1e-3)) / 2e-3
    };
    for loops in [false, true] {
        let jump = |interpolation: KeyInterpolation, time_s: f64| {
            let animation = key_frames(interpolation, loops);
            velocity(&animation, time_s - 2e-3).distance(velocity(&animation, time_s + 2e-3))
        };
        for time_s in [0.5, 1.5] {
            assert!(jump(KeyInterpolation::Smooth, time_s) < 0.01 && jump(KeyInterpolation::Linear, time_s) > 0.05);
        }
        // Also where it begins again.
        assert!(!loops || jump(KeyInterpolation::Smooth, 2.0) < 0.01);
    }
}

#[test]
fn a_wave_runs_along_and_swells() {
    let wave = TravellingWave { amplitude: 0.1, wavelength: 0.5, frequency_hz: 2.0, head: 0.2, ..default() };
    let place = |z: f64| DVec3::new(0.3, 0.8, z);
    // Half a wave later on the way it is where it was a quarter of a second before: it goes 1 per second. Amplitudes apart.
    let swell = |z: f64| 0.1 * (0.2 + 0.8 * z * z);
    for (z, time_s) in [(0.4, 0.1), (0.7, 0.33), (1.0, 5.0)] {
        let (here, there) =
            (wave.translation_at(place(z), time_s), wave.translation_at(place(z - 0.25), time_s - 0.25));
        assert!((here.x / swell(z) - there.x / swell(z - 0.25)).abs() < 1e-6, "{here} and {there}");
        assert_eq!((here.y, here.z), (0.0, 0.0));
    }
    let most = (0..1000).map(|n| wave.translation_at(place(1.0), f64::from(n) * 1e-3).x).fold(0.0, f64::max);
    assert!((most - 0.1).abs() < 1e-4, "{most}");
    // Backwards along another axis is the same body turned round.
    let turned = TravellingWave { along: Vec3::NEG_Y * 3.0, across: Vec3::Z * 0.2, ..wave };
    let there = turned.translation_at(DVec3::new(0.3, 1.0 - 0.7, 0.5), 0.4);
    assert!((there.z - wave.translation_at(place(0.7), 0.4).x).abs() < 1e-6);
}

#[test]
fn animations_move_lattices_by_simulated_time() {
    let run = |steps: u32| {
        let mut app = TestApp::cpu();
        let wave = LatticeAnimation::new(LatticeMotion::Wave(TravellingWave::default()));
        let entity = app.world_mut().spawn((lattice(), wave.clone())).id();
        app.step(steps);
        let lattice = app.world().get::<DeformLattice>(entity).expect("it is there");
        let time_s = app.world().resource::<Time<Fixed>>().elapsed_secs_f64();
        assert!((time_s - f64::from(steps) / 60.0).abs() < 1e-6);
        let expected = wave.translations_at(lattice.tree(), time_s).expect("it plays");
        assert_eq!(lattice.translations(), expected);
        assert!(!lattice.is_at_rest() && lattice.revision() >= u64::from(steps));
        lattice.check_folds().expect("the default wave folds nothing");
        lattice.translations().to_vec()
    };
    assert_eq!(run(37), run(37), "the same bits");
}

#[test]
fn what_cannot_be_played_is_told_once_and_nothing_is_lost() {
    let before = told("cannot be played").len();
    let mut app = TestApp::cpu();
    let mut dragged = lattice();
    dragged.drag_vertex(62, Vec3::Y * 0.05).expect("free");
    let entity = app.world_mut().spawn((dragged.clone(), key_frames(KeyInterpolation::Smooth, true))).id();
    let mut animation = app.world_mut().get_mut::<LatticeAnimation>(entity).expect("it is there");
    let LatticeMotion::KeyFrames(frames) = &mut animation.motion else { panic!("key frames") };
    frames.frames[2].translations.pop();
    app.step(5);
    let warnings = told("cannot be played");
    assert_eq!(warnings.len() - before, 1, "{warnings:?}");
    let message = warnings.last().expect("one");
    assert!(message.contains(&entity.to_string()) && message.contains("124") && message.contains("125"), "{message}");
    assert_eq!(app.world().get::<DeformLattice>(entity), Some(&dragged));
    let tree = dragged.tree();
    let play = |frames: Vec<KeyFrame>| {
        let frames = KeyFrames { frames, ..default() };
        LatticeAnimation::new(LatticeMotion::KeyFrames(frames)).translations_at(tree, 0.25)
    };
    assert_eq!(play(vec![]), Err(LatticeError::NoKeyFrames));
    let twice = play(vec![frame(0.0, Vec3::ZERO), frame(0.0, Vec3::ONE)]);
    assert_eq!(twice, Err(LatticeError::KeyFrameTime { frame: 1, time_s: 0.0 }));
    assert!(matches!(play(vec![frame(f32::NAN, Vec3::ZERO)]), Err(LatticeError::KeyFrameTime { frame: 0, .. })));
    assert!(matches!(play(vec![frame(0.0, Vec3::NAN)]), Err(LatticeError::NotFinite { .. })));
    assert_eq!(play(vec![frame(7.0, Vec3::X)]), Ok(vec![Vec3::X; 125]), "one frame holds");
    let still = TravellingWave { along: Vec3::ZERO, ..default() };
    let refused = LatticeAnimation::new(LatticeMotion::Wave(still)).translations_at(tree, 0.0);
    assert!(matches!(refused, Err(LatticeError::NotFinite { .. })), "{refused:?}");
}
