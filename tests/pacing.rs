//! Simulated time keeps up with measured time, or says that it does not.

use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use std::time::Duration;

#[derive(Resource, Default)]
struct Steps(u32);

/// Steps, and seconds given up, of frames of this length.
fn run(app: &mut TestApp, frame: Duration, frames: u32) -> (u32, f64) {
    app.init_resource::<Steps>().add_systems(FixedUpdate, |mut steps: ResMut<Steps>| steps.0 += 1);
    app.idle();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(frame));
    for _ in 0..frames {
        app.update();
    }
    (app.world().resource::<Steps>().0, app.world().resource::<Pacing>().lost_s)
}

#[test]
fn slow_frames_run_more_steps() {
    for (milliseconds, frames) in [(4, 250), (40, 25), (100, 10), (160, 6)] {
        let (steps, lost_s) = run(&mut TestApp::cpu(), Duration::from_millis(milliseconds), frames);
        let wanted = milliseconds as f64 * f64::from(frames) * 0.06;
        assert!((f64::from(steps) - wanted).abs() <= 1.0, "{steps} of {wanted} steps at {milliseconds} ms");
        assert_eq!(lost_s, 0.0);
    }
}

#[test]
fn too_slow_a_machine_is_bounded_and_told() {
    let mut app = TestApp::cpu();
    let (steps, lost_s) = run(&mut app, Duration::from_secs(1), 5);
    assert!((50..=51).contains(&steps), "ten steps a frame, not {steps}");
    assert!((lost_s - (5.0 - 50.0 / 60.0)).abs() < 0.02, "{lost_s} s given up");
    assert_eq!(app.world().resource::<Pacing>().steps, 10);
    // Whoever has faster steps can have more of them.
    app.world_mut().resource_mut::<Pacing>().max_steps_per_frame = 60;
    let before = app.world().resource::<Steps>().0;
    app.update();
    app.update();
    assert!(app.world().resource::<Steps>().0 - before >= 110);
}

#[test]
fn scaled_time_has_the_same_bound() {
    for (speed, wanted) in [(4.0_f32, 10), (0.1, 6)] {
        let mut app = TestApp::cpu();
        app.idle();
        app.world_mut().resource_mut::<Time<Virtual>>().set_relative_speed(speed);
        // A tenth of the speed asks for six steps a second.
        let (steps, lost_s) = run(&mut app, Duration::from_secs(1), 3);
        assert!((3 * wanted - 2..=3 * wanted + 1).contains(&steps), "{steps} steps in three frames at speed {speed}");
        assert_eq!(lost_s > 0.1, speed > 1.0, "{lost_s} s given up at speed {speed}");
    }
}

#[test]
fn a_bound_of_the_app_is_kept() {
    let mut app = TestApp::cpu();
    app.idle();
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_millis(50));
    let (steps, _) = run(&mut app, Duration::from_secs(1), 4);
    assert!((11..=12).contains(&steps), "{steps} steps in four frames of 50 ms");
}
