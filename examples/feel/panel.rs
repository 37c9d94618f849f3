//! What the device says and what the loop does, in words: an aid for setting a device up.

use crate::common::{Args, Backend, add_interface};
use crate::objects::{Hardness, Object};
use crate::{Hand, Viewpoint};
use bevy::prelude::*;
use bevy::text::FontSize;
use bevy_surgery::haptics::device::DeviceInfo;
use bevy_surgery::haptics::servo::ServoState;
use bevy_surgery::prelude::*;
use bevy_surgery::tools::{DeviceRefused, ServoReading, ServoSession};
use glam::DVec3;
use std::collections::VecDeque;

/// Where the handle has been, and where it was lately.
#[derive(Resource, Default)]
struct Reached {
    extent_m: Option<[DVec3; 2]>,
    lately_m: VecDeque<DVec3>,
}

/// Samples of the last second or so.
const LATELY: usize = 60;

#[derive(Component)]
struct Words;

pub fn build(app: &mut App) {
    app.init_resource::<Reached>().add_systems(FixedUpdate, reach.in_set(SurgerySystems::Judge));
    if app.world().resource::<Args>().backend == Some(Backend::Cpu) {
        return;
    }
    add_interface(app);
    app.add_systems(Startup, spawn.after(crate::setup)).add_systems(Update, write);
}

fn spawn(mut commands: Commands, cameras: Query<Entity, With<Viewpoint>>) -> Result {
    let camera = UiTargetCamera(cameras.single()?);
    let font = TextFont { font_size: FontSize::Px(12.0), ..default() };
    let place = Node { position_type: PositionType::Absolute, left: px(10), top: px(8), ..default() };
    commands.spawn((Words, camera, Text::default(), font, TextColor(Color::srgb(0.85, 0.88, 0.9)), place));
    Ok(())
}

fn reach(
    mut reached: ResMut<Reached>,
    keys: Option<Res<ButtonInput<KeyCode>>>,
    hands: Query<&ServoReading, With<Hand>>,
) {
    if keys.is_some_and(|keys| keys.just_pressed(KeyCode::KeyC)) {
        *reached = Reached::default();
    }
    let Some(state) = hands.iter().next().map(|reading| &reading.state).filter(|state| state.is_tracked) else {
        return;
    };
    let at_m = state.sample.position_m;
    let [low, high] = reached.extent_m.unwrap_or([at_m; 2]);
    reached.extent_m = Some([low.min(at_m), high.max(at_m)]);
    reached.lately_m.push_back(at_m);
    if reached.lately_m.len() > LATELY {
        reached.lately_m.pop_front();
    }
}

impl Reached {
    /// How much the handle trembles, root mean square about its middle, metres.
    fn tremble_m(&self) -> f64 {
        let count = self.lately_m.len().max(1) as f64;
        let middle = self.lately_m.iter().sum::<DVec3>() / count;
        (self.lately_m.iter().map(|at| at.distance_squared(middle)).sum::<f64>() / count).sqrt()
    }
}

fn write(
    mut words: Query<&mut Text, With<Words>>,
    hands: Query<(&ServoReading, Option<&ServoSession>, Option<&DeviceRefused>), With<Hand>>,
    object: Res<Object>,
    hardness: Res<Hardness>,
    reached: Res<Reached>,
) {
    let (Ok(mut text), Ok((reading, session, refused))) = (words.single_mut(), hands.single()) else { return };
    let device = match (session, refused) {
        (Some(session), _) => of_device(session.device()),
        (None, Some(DeviceRefused(fault))) => format!("no device: {fault}"),
        (None, None) => "the device is being opened".into(),
    };
    let object = format!("{:?}, {:.0} % of its hardness", *object, 100.0 * hardness.0);
    let said = format!("{device}\n\n{}\n{}\n{object}", of_loop(&reading.state), of_hand(&reading.state, &reached));
    if text.0 != said {
        text.0 = said;
    }
}

fn of_device(device: &DeviceInfo) -> String {
    let limits = &device.limits;
    let force = if device.has_force {
        format!("{:.1} N, {:.0} N/m at most", limits.max_force_n, limits.max_stiffness_n_per_m)
    } else {
        "shows its force, without motors".into()
    };
    format!("{} ({})\n{force}", device.name, device.id)
}

fn of_loop(state: &ServoState) -> String {
    let timing = &state.timing;
    let pace = if timing.ticks > 0 {
        format!(
            "{:.1} Hz, late {:.0} us (p99 {:.0}, most {:.0}), {} missed\ncomputes {:.1} us (p99 {:.1}, most {:.0})",
            timing.rate_hz,
            timing.late_p50_s * 1e6,
            timing.late_p99_s * 1e6,
            timing.late_max_s * 1e6,
            timing.missed,
            timing.compute_p50_s * 1e6,
            timing.compute_p99_s * 1e6,
            timing.compute_max_s * 1e6,
        )
    } else {
        format!("stepped by the simulation, tick {}", state.tick)
    };
    let force = state.force_in_device_n;
    format!(
        "{pace}\nforce {:.2} N  [{:+.2} {:+.2} {:+.2}]  {:?}\n{} contacts{}, extra work {:.2} mJ",
        force.length(),
        force.x,
        force.y,
        force.z,
        state.force_state,
        state.contact_count,
        if state.sticks { ", sticks" } else { "" },
        state.excess_j * 1e3,
    )
}

fn of_hand(state: &ServoState, reached: &Reached) -> String {
    if !state.is_tracked {
        return "the handle is not seen".into();
    }
    let mm = |place: DVec3| {
        let mm = place * 1e3;
        format!("[{:+.1} {:+.1} {:+.1}] mm", mm.x, mm.y, mm.z)
    };
    let sample = &state.sample;
    let [low, high] = reached.extent_m.unwrap_or([sample.position_m; 2]);
    let grip = sample.grip_rad.map_or(String::new(), |grip| format!(", grip {:.0} degrees", grip.to_degrees()));
    format!(
        "handle {}, spread over the last second {:.2} mm\nbeen from {} to {}\nbuttons {:b}, pedals {:.2} {:.2}{grip}\n",
        mm(sample.position_m),
        reached.tremble_m() * 1e3,
        mm(low),
        mm(high),
        sample.buttons,
        sample.axes[0],
        sample.axes[1],
    )
}
