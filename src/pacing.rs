//! Keeps simulated time at measured time, and says so where the machine is too slow for that (paper of 2002, section 5.4).
//!
//! Steps have a fixed length, and a frame runs as many as the time since the last one asks for. A machine on which
//! that takes longer than the time itself would fall ever farther behind; so the steps of a frame are bounded, the time
//! beyond is given up, and [`Pacing`] tells how much.

use bevy::ecs::message::message_update_system;
use bevy::prelude::*;
use bevy::time::TimeSystems;
use std::time::Duration;

/// How the steps keep up with time.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(Resource, Clone)]
pub struct Pacing {
    /// Most steps of a frame. At the default of 10, sixty steps a second keep up down to six frames a second.
    pub max_steps_per_frame: u32,
    /// Steps that the last frame ran.
    pub steps: u32,
    /// Time that was given up since the start, seconds.
    pub lost_s: f64,
    /// Time that the last frame gave up, seconds.
    pub lost_last_frame_s: f64,
}

impl Default for Pacing {
    fn default() -> Self {
        Self { max_steps_per_frame: 10, steps: 0, lost_s: 0.0, lost_last_frame_s: 0.0 }
    }
}

/// The bound that this module set, to tell it from one that the app sets.
#[derive(Resource, Default)]
struct OwnBound(Option<Duration>);

pub(crate) fn build(app: &mut App) {
    app.init_resource::<Pacing>()
        .init_resource::<OwnBound>()
        .register_type::<Pacing>()
        // Bevy's update of messages takes the whole world, and has nothing to do with these.
        .add_systems(First, bound_steps.before(TimeSystems).ambiguous_with(message_update_system))
        .add_systems(First, measure_lost_time.after(TimeSystems).ambiguous_with(message_update_system))
        .add_systems(FixedFirst, |mut pacing: ResMut<Pacing>| pacing.steps += 1);
}

/// Bevy bounds the virtual time of a frame; a bound that the app chose is kept.
fn bound_steps(
    pacing: Res<Pacing>,
    fixed: Res<Time<Fixed>>,
    mut time: ResMut<Time<Virtual>>,
    mut own: ResMut<OwnBound>,
    mut bevys_own: Local<Option<Duration>>,
) {
    let bevys_own = *bevys_own.get_or_insert_with(|| Time::<Virtual>::default().max_delta());
    let is_chosen = time.max_delta() != bevys_own && Some(time.max_delta()) != own.0;
    // A little more than that many steps, so that rounding does not cost one.
    let steps = f64::from(pacing.max_steps_per_frame.max(1)) + 0.01;
    // Bevy bounds measured time, before it is sped up.
    let bound = fixed.timestep().mul_f64(steps / time.relative_speed_f64().clamp(1e-3, 1e6));
    if !is_chosen && time.max_delta() != bound {
        time.set_max_delta(bound);
        own.0 = Some(bound);
    }
}

fn measure_lost_time(mut pacing: ResMut<Pacing>, real: Res<Time<Real>>, time: Res<Time<Virtual>>) {
    let wanted_s = real.delta_secs_f64() * time.effective_speed_f64();
    let lost_s = wanted_s - time.delta_secs_f64();
    // Rounding of durations to nanoseconds is no loss.
    pacing.lost_last_frame_s = if lost_s > 1e-6 { lost_s } else { 0.0 };
    pacing.lost_s += pacing.lost_last_frame_s;
    pacing.steps = 0;
}
