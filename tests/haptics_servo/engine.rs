//! The whole loop, stepped by hand.

use super::scene::{bone_below, engine, floor, go, scene, tick_at};
use bevy_surgery::haptics::device::{DeviceFault, DeviceLimits};
use bevy_surgery::haptics::force::{BonePatch, SurfaceFeel, ToolLoad, TurningBurr};
use bevy_surgery::haptics::safety::ForceState;
use bevy_surgery::haptics::servo::{ServoFault, ServoRig, ServoScene, ServoShape, ServoState};
use glam::{DAffine3, DQuat, DVec3, Vec3};
use std::sync::Arc;

const WALL: SurfaceFeel =
    SurfaceFeel { stiffness_n_per_m: 300.0, damping_n_s_per_m: 0.0, static_friction: 0.0, dynamic_friction: 0.0 };

fn on_a_floor() -> ServoScene {
    scene(vec![ServoShape::Surface(Arc::new(floor(0.0, WALL)))])
}

const ABOVE: DVec3 = DVec3::new(0.0, 0.01, 0.0);
const PRESSED: DVec3 = DVec3::new(0.0, -0.004, 0.0);

#[test]
fn a_hand_feels_the_floor_and_the_simulation_hears_of_it() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE; 2], 100);
    go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE, PRESSED], 200);
    go(&mut engine, &mut link, &bench, &on_a_floor(), [PRESSED; 2], 100);
    let told_n = bench.lock().expect("the bench").told.force_n;
    assert!((told_n - DVec3::Y * 1.5).length() < 1e-3, "{told_n}");
    let state = link.state();
    assert_eq!((state.tick, state.force_state, state.contact_count), (400, ForceState::Whole, 1));
    let contact = state.contacts()[0];
    assert_eq!(contact.body, 7);
    assert!((contact.depth_m - 0.005).abs() < 1e-6 && contact.normal.distance(DVec3::Y) < 1e-9);
    assert!(state.proxy_in_world_m.distance(DVec3::Y * 1e-3) < 1e-6 && state.tip_in_world_m == PRESSED);
    assert!(state.force_in_device_n == told_n && state.is_tracked);
}

#[test]
fn the_same_steps_give_the_same_bits() {
    let run = || {
        let (mut engine, mut link, bench) = engine(DeviceLimits::FALCON);
        let burr = TurningBurr {
            speed_rpm: 3e4,
            flutes: 6,
            friction: 0.2,
            vibration: 0.1,
            stiffness_n_per_m: 900.0,
            ..Default::default()
        };
        let bone = BonePatch::new(bone_below(Vec3::new(0.1, 1.0, 0.3).normalize(), 40, 0.3e-3), SurfaceFeel::BONE);
        let mut to = scene(vec![
            ServoShape::Bone(Arc::new(bone)),
            ServoShape::Surface(Arc::new(floor(0.2e-3, SurfaceFeel::LIVER))),
        ]);
        to.tool.burr = Some(burr);
        let mut states: Vec<ServoState> = Vec::new();
        for tick in 0..600 {
            if tick % 16 == 0 {
                link.publish(to.clone());
            }
            let turn = f64::from(tick) * 0.02;
            tick_at(&mut engine, &bench, DVec3::new(2e-3 * turn.sin(), 4e-3 * turn.cos() + 2e-3, 1e-3 * turn));
            states.push(link.state());
        }
        states
    };
    let (first, second) = (run(), run());
    assert!(first.iter().any(|state| state.burr.force_n > 0.1 && state.burr_body == Some(7)));
    assert!(first.iter().any(|state| state.contact_count > 0));
    assert_eq!(format!("{first:?}"), format!("{second:?}"));
}

#[test]
fn a_rig_turns_scales_and_clutches() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let turned = DQuat::from_rotation_z(0.5);
    let mut to = on_a_floor();
    // Twice as large in the world, turned, moved; forces halved.
    let world_from_device = DAffine3::from_scale_rotation_translation(DVec3::splat(2.0), turned, DVec3::Y * 0.02);
    to.rig = ServoRig { world_from_device, force_scale: 0.5, ..ServoRig::default() };
    let device = |world: DVec3| world_from_device.inverse().transform_point3(world);
    go(&mut engine, &mut link, &bench, &to, [device(ABOVE); 2], 100);
    go(&mut engine, &mut link, &bench, &to, [device(ABOVE), device(PRESSED)], 200);
    go(&mut engine, &mut link, &bench, &to, [device(PRESSED); 2], 100);
    let told_n = bench.lock().expect("the bench").told.force_n;
    assert!((told_n - turned.inverse() * DVec3::Y * 0.75).length() < 1e-3, "{told_n}");
    // A clutch lets go at once, and where it ends the loop begins anew: pressed in there is no force.
    to.rig.is_engaged = false;
    go(&mut engine, &mut link, &bench, &to, [device(PRESSED); 2], 3);
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    assert_eq!(link.state().force_state, ForceState::NotHeld);
    to.rig = ServoRig { is_engaged: true, revision: 1, ..to.rig };
    go(&mut engine, &mut link, &bench, &to, [device(PRESSED); 2], 100);
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
}

#[test]
fn a_rig_that_has_jumped_begins_anew() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let mut to = on_a_floor();
    go(&mut engine, &mut link, &bench, &to, [ABOVE; 2], 100);
    // The hand is where it was; the tool is in the floor now, and is not held there.
    to.rig.world_from_device = DAffine3::from_translation(DVec3::Y * -0.013);
    to.rig.revision = 1;
    for _ in 0..100 {
        go(&mut engine, &mut link, &bench, &to, [ABOVE; 2], 1);
        assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    }
    assert!(link.state().tip_in_world_m.distance(DVec3::Y * -0.003) < 1e-12, "{}", link.state().tip_in_world_m);
}

#[test]
fn a_rig_that_moves_is_followed_smoothly() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let mut to = on_a_floor();
    go(&mut engine, &mut link, &bench, &to, [ABOVE; 2], 32);
    to.rig.world_from_device = DAffine3::from_translation(DVec3::X * 0.016);
    link.publish(to);
    let mut last = 0.0;
    for _ in 0..20 {
        tick_at(&mut engine, &bench, ABOVE);
        let x = link.state().tip_in_world_m.x;
        assert!(x - last < 1.1e-3 && x >= last, "{x} after {last}");
        last = x;
    }
    assert!((last - 0.016).abs() < 1e-12, "{last}");
}

#[test]
fn jumps_lost_poses_and_silence_take_the_force_away() {
    let pressed = || {
        let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
        go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE; 2], 100);
        go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE, PRESSED], 200);
        assert!(bench.lock().expect("the bench").told.force_n.y > 1.4);
        (engine, link, bench)
    };
    // A jump: zero at once; the proxy is where the handle is now, and nothing holds it there.
    let (mut engine, mut link, bench) = pressed();
    for _ in 0..100 {
        tick_at(&mut engine, &bench, DVec3::new(0.03, -0.004, 0.0));
        assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    }
    assert_eq!(link.state().jumps, 1);
    // Poses that are none are passed over for a while, then the force is gone.
    let (mut engine, mut link, bench) = pressed();
    tick_at(&mut engine, &bench, DVec3::NAN);
    assert!(bench.lock().expect("the bench").told.force_n.y > 1.4);
    (0..25).for_each(|_| tick_at(&mut engine, &bench, DVec3::NAN));
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    assert!(link.state().dropped_samples >= 25 && !link.state().is_tracked);
    // A simulation that is silent.
    let (mut engine, mut link, bench) = pressed();
    (0..90).for_each(|_| tick_at(&mut engine, &bench, PRESSED));
    assert!(bench.lock().expect("the bench").told.force_n.y > 1.4);
    (0..80).for_each(|_| tick_at(&mut engine, &bench, PRESSED));
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    go(&mut engine, &mut link, &bench, &on_a_floor(), [PRESSED; 2], 200);
    assert!(bench.lock().expect("the bench").told.force_n.y > 1.4, "it comes back");
    // Another scene with nonsense in it.
    let (mut engine, mut link, bench) = pressed();
    let mut odd = on_a_floor();
    odd.tool.load = ToolLoad { pull_n: DVec3::NAN, mass_kg: f64::INFINITY, ..ToolLoad::default() };
    odd.rig.force_scale = f64::NAN;
    go(&mut engine, &mut link, &bench, &odd, [PRESSED; 2], 20);
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
}

#[test]
fn a_device_that_is_lost_stops_the_loop_until_there_is_another() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE; 2], 10);
    let warm = DeviceFault::Warning { id: "bench:1".into(), reason: "warm motors".into() };
    bench.lock().expect("the bench").fault = Some(warm.clone());
    (0..5).for_each(|_| engine.tick(1e-3));
    assert_eq!(link.faults().collect::<Vec<_>>(), vec![ServoFault::Device(warm)], "told once");
    let gone = DeviceFault::Gone { id: "bench:1".into(), reason: "unplugged".into() };
    bench.lock().expect("the bench").fault = Some(gone.clone());
    (0..5).for_each(|_| engine.tick(1e-3));
    assert_eq!(link.faults().collect::<Vec<_>>(), vec![ServoFault::Device(gone)]);
    assert!(engine.is_over() && link.state().is_over);
    let (device, bench) = super::scene::BenchDevice::new(DeviceLimits::TOUCH);
    drop(engine.replace_device(Box::new(device)));
    go(&mut engine, &mut link, &bench, &on_a_floor(), [ABOVE; 2], 10);
    assert!(!link.state().is_over && link.state().is_tracked);
    drop(engine);
    assert!(link.state().is_over, "who drops it leaves zero force");
}

#[test]
fn weight_and_drag_are_felt_in_the_air() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let mut to = scene(Vec::new());
    to.tool.load = ToolLoad {
        mass_kg: 0.05,
        held_mass_kg: 0.03,
        gravity_m_per_s2: DVec3::Y * -9.81,
        drag_n_s_per_m: 2.0,
        pull_n: DVec3::Z * 0.1,
    };
    go(&mut engine, &mut link, &bench, &to, [DVec3::ZERO; 2], 200);
    let told_n = bench.lock().expect("the bench").told.force_n;
    assert!((told_n - DVec3::new(0.0, -0.08 * 9.81, 0.1)).length() < 1e-9, "{told_n}");
    go(&mut engine, &mut link, &bench, &to, [DVec3::ZERO, DVec3::X * 0.05], 200);
    let told_n = bench.lock().expect("the bench").told.force_n;
    assert!((told_n.x + 0.5).abs() < 0.01, "2 N s/m at 0.25 m/s: {told_n}");
}

#[test]
fn a_device_without_motors_still_cuts() {
    let (mut engine, mut link, bench) = engine(DeviceLimits::NO_FORCE);
    let bone = BonePatch::new(bone_below(Vec3::Y, 40, 0.3e-3), SurfaceFeel::BONE);
    let mut to = scene(vec![ServoShape::Bone(Arc::new(bone))]);
    to.tool.burr = Some(TurningBurr { speed_rpm: 3e4, flutes: 6, stiffness_n_per_m: 400.0, ..Default::default() });
    go(&mut engine, &mut link, &bench, &to, [ABOVE, DVec3::Y * 1e-3], 200);
    let before = link.state();
    go(&mut engine, &mut link, &bench, &to, [DVec3::Y * 1e-3, DVec3::Y * -50e-3], 200);
    let state = link.state();
    assert!(before.burr.force_n > 0.1 && state.burr.force_n > before.burr.force_n);
    assert!(state.burr.force_n <= DeviceLimits::INVERSE3.max_force_n, "{:?}", state.burr);
    let mean_n = (state.burr_impulse_n_s - before.burr_impulse_n_s) / (state.time_s - before.time_s);
    assert!(mean_n > before.burr.force_n && mean_n <= state.burr.force_n, "{mean_n}");
    let told = bench.lock().expect("the bench").told;
    assert!(told.force_n == DVec3::ZERO && told.rumble > 0.5, "{told:?}");
    assert!(state.proxy_in_world_m.y > 0.5e-3, "it goes no further than bone is removed: {}", state.proxy_in_world_m);
}
