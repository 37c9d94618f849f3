//! The loop in its thread: that it runs, stops, and survives.

use super::scene::{engine, floor, scene};
use bevy_surgery::haptics::device::DeviceLimits;
use bevy_surgery::haptics::force::SurfaceFeel;
use bevy_surgery::haptics::servo::{ServoFault, ServoLink, ServoShape, ServoState, ServoThread};
use glam::DVec3;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Publishes every few milliseconds until the loop's state is as wanted; none after ten seconds.
fn wait(link: &mut ServoLink, publishes: bool, wanted: impl Fn(&ServoState) -> bool) -> Option<ServoState> {
    let until = Instant::now() + Duration::from_secs(10);
    while Instant::now() < until {
        if publishes {
            link.publish(scene(vec![ServoShape::Surface(Arc::new(floor(0.0, SurfaceFeel::LIVER)))]));
        }
        std::thread::sleep(Duration::from_millis(5));
        let state = link.state();
        if wanted(&state) {
            return Some(state);
        }
    }
    None
}

#[test]
fn it_starts_presses_fades_and_stops() {
    let (engine, mut link, bench) = engine(DeviceLimits::OMNI);
    bench.lock().expect("the bench").sample.position_m = DVec3::Y * 0.004;
    let thread = ServoThread::start(engine).expect("a thread");
    wait(&mut link, true, |state| state.tick > 300).expect("it runs");
    // In steps that a hand can do.
    for step in 1..=40 {
        bench.lock().expect("the bench").sample.position_m = DVec3::Y * (0.004 - 0.2e-3 * f64::from(step));
        wait(&mut link, true, |_| true);
    }
    // A machine that is busy may stall the loop, which then waits for a hand that lets go; no matter here how often.
    let pressed = wait(&mut link, true, |state| state.contact_force_n.y > 1.0).expect("it touches");
    assert!(pressed.contact_count == 1 && pressed.proxy_in_world_m.y > 0.9e-3);
    // The simulation is silent now.
    wait(&mut link, false, |state| state.force_in_device_n == DVec3::ZERO).expect("the watchdog takes the force away");
    assert!(thread.is_running());
    let engine = thread.stop().expect("the engine");
    assert!(engine.is_over() && link.state().is_over);
    let timing = engine.state().timing;
    assert!(timing.ticks > 0 && timing.rate_hz > 0.0 && timing.compute_p50_s > 0.0, "{timing:?}");
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    let writes = bench.lock().expect("the bench").writes;
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(bench.lock().expect("the bench").writes, writes, "nobody writes any more");
}

#[test]
fn a_panic_leaves_zero_force_and_a_message() {
    let (engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let thread = ServoThread::start(engine).expect("a thread");
    wait(&mut link, true, |state| state.tick > 10).expect("it runs");
    {
        let mut bench = bench.lock().expect("the bench");
        (bench.told.force_n, bench.panics) = (DVec3::X, true);
    }
    wait(&mut link, true, |state| state.is_over).expect("it stops");
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
    let faults: Vec<_> = link.faults().collect();
    assert!(matches!(&faults[..], [ServoFault::Panic(why)] if why.contains("the driver is broken")), "{faults:?}");
    let until = Instant::now() + Duration::from_secs(10);
    while thread.is_running() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(!thread.is_running());
    assert!(thread.stop().is_some_and(|engine| engine.is_over()), "the engine comes back, and may get another device");
}

#[test]
fn dropping_it_stops_it() {
    let (engine, mut link, bench) = engine(DeviceLimits::OMNI);
    let thread = ServoThread::start(engine).expect("a thread");
    wait(&mut link, true, |state| state.tick > 10).expect("it runs");
    drop(thread);
    assert!(link.state().is_over);
    assert_eq!(bench.lock().expect("the bench").told.force_n, DVec3::ZERO);
}
