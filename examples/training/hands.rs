//! The trainee's hands: the mouse holds the instrument that was chosen, or devices hold one each.

use crate::common::{Args, hold_device, opens_window};
use bevy::input::InputSystems;
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::{Guide, RunPhase, ScenarioEye, ScenarioRun, ScenarioSystems};
use bevy_surgery::tools::{HoldDevice, SenseDevices};

/// Which instrument the mouse holds, and where. Not there where nobody holds one.
#[derive(Resource)]
pub struct Mouse {
    pub tool: usize,
    /// How far the tip's surface is over what is under the cursor, metres; below 0 it presses.
    over_m: f32,
    /// How far in front of the eye that was last, metres.
    reach_m: Option<f32>,
}

impl Default for Mouse {
    fn default() -> Self {
        Self { tool: 0, over_m: 5e-3, reach_m: None }
    }
}

/// What the wheel moves at a notch, metres.
const NOTCH_M: f32 = 5e-4;
/// How far in front of the eye things are looked for, metres.
const FAR_M: f32 = 0.4;

pub fn build(app: &mut App) {
    app.add_systems(PreUpdate, stop.after(InputSystems)).add_systems(Update, (take_devices, switch_guidance));
    let args = app.world().resource::<Args>();
    let is_led = args.replay.is_some() && args.retry_at.is_none();
    if is_led || args.expert || args.novice || !opens_window(args) {
        return;
    }
    app.init_resource::<Mouse>()
        .add_systems(Update, (choose, reach))
        .add_systems(FixedUpdate, hold.in_set(SurgerySystems::Sense).after(SenseDevices).before(ScenarioSystems::Lead));
}

/// The first instrument of each hand gets that hand's device.
fn take_devices(
    mut commands: Commands,
    args: Res<Args>,
    tools: Query<(Entity, &Tool), Added<Tool>>,
    held: Query<&Tool, With<HoldDevice>>,
) {
    let mut taken: Vec<ToolHand> = held.iter().map(|tool| tool.hand).collect();
    for (entity, tool) in &tools {
        if !taken.contains(&tool.hand) {
            taken.push(tool.hand);
            hold_device(&mut commands, entity, &args, tool.hand);
        }
    }
}

/// Escape ends the run, so that it is judged; when it is over, it ends the program as in the other examples.
fn stop(keys: Option<ResMut<ButtonInput<KeyCode>>>, mut run: ResMut<ScenarioRun>) {
    let Some(mut keys) = keys.filter(|_| *run.phase() == RunPhase::Running) else { return };
    if keys.bypass_change_detection().clear_just_pressed(KeyCode::Escape) {
        run.stop();
    }
}

fn switch_guidance(keys: Option<Res<ButtonInput<KeyCode>>>, mut guide: ResMut<Guide>) {
    if keys.is_some_and(|keys| keys.just_pressed(KeyCode::KeyG)) {
        guide.is_on = !guide.is_on;
    }
}

fn choose(keys: Res<ButtonInput<KeyCode>>, mut mouse: ResMut<Mouse>) {
    let digits = [
        KeyCode::Digit1,
        KeyCode::Digit2,
        KeyCode::Digit3,
        KeyCode::Digit4,
        KeyCode::Digit5,
        KeyCode::Digit6,
        KeyCode::Digit7,
        KeyCode::Digit8,
        KeyCode::Digit9,
    ];
    if let Some(tool) = digits.iter().position(|digit| keys.just_pressed(*digit)) {
        mouse.tool = tool;
    }
}

fn reach(mut mouse: ResMut<Mouse>, wheel: Res<AccumulatedMouseScroll>) {
    let notches = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    mouse.over_m = (mouse.over_m - notches * NOTCH_M).clamp(-0.01, 0.1);
}

/// The tip is on the mouse's ray, as far over what is there as the wheel says.
fn hold(
    mut mouse: ResMut<Mouse>,
    run: Res<ScenarioRun>,
    buttons: Res<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    eyes: Query<(&Camera, &GlobalTransform), With<ScenarioEye>>,
    hollows: Query<(), With<Hollow>>,
    organs: OrganPicking,
    volumes: VolumePicking,
    mut tools: Query<(&Name, &Tool, &mut ToolPose, &mut ToolCommand), Without<HoldDevice>>,
) {
    let Some((camera, eye)) = eyes.iter().next() else { return };
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    let ray = cursor.and_then(|at| camera.viewport_to_world(eye, at).ok());
    let under_m = ray.and_then(|ray| {
        let organ = organs.cast_ray_at(ray, FAR_M, |organ| !hollows.contains(organ)).map(|hit| hit.distance_m);
        let volume = volumes.cast_ray(ray, FAR_M).map(|hit| hit.distance_m);
        organ.into_iter().chain(volume).min_by(f32::total_cmp)
    });
    mouse.reach_m = under_m.or(mouse.reach_m);
    // Beside everything it stays as far away as it was, at first as the middle of the scene.
    let reach_m = mouse.reach_m.unwrap_or(eye.translation().length()) - mouse.over_m;
    let wanted = run.scenario().tools.get(mouse.tool).map(|tool| tool.name.as_str());
    for (name, tool, mut pose, mut command) in &mut tools {
        let Some(ray) = ray.filter(|_| wanted == Some(name.as_str())) else {
            pose.set_if_neq(ToolPose { is_tracked: false, ..*pose });
            continue;
        };
        let tip_m = ray.get_point(reach_m - tool.tip_radius_m());
        let back = *eye.back() + 0.6 * *eye.right() + 0.3 * *eye.down();
        *pose = ToolPose::with_shaft_towards(tip_m, tip_m + back);
        let share = |button| f32::from(u8::from(buttons.pressed(button)));
        let (pedal, second_pedal) = (share(MouseButton::Left), share(MouseButton::Right));
        *command = ToolCommand { pedal, second_pedal, grip: pedal, next_burr: keys.pressed(KeyCode::KeyB) };
    }
}
