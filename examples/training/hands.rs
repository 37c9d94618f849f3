//! The trainee's hands: the mouse holds the instrument that was chosen, or devices hold one each.

use crate::common::{Args, Stage, Viewer, hold_device};
use bevy::input::mouse::{AccumulatedMouseScroll, MouseScrollUnit};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::scripted::ScriptedHand;
use bevy_surgery::scenario::{Guide, ScenarioEye, ScenarioRun, ScenarioSystems};
use bevy_surgery::tools::{HoldDevice, SenseDevices};

/// Which instrument the mouse holds, and how far in front of the eye.
#[derive(Resource, Default)]
struct Mouse {
    tool: usize,
    reach_m: Option<f32>,
}

/// Most that the wheel moves at a notch, metres.
const NOTCH_M: f32 = 1e-3;

pub fn build(app: &mut App) {
    app.init_resource::<Mouse>().add_systems(Update, take_devices);
    if app.world().resource::<Stage>().viewer != Viewer::Person {
        return;
    }
    app.add_systems(Update, (choose, reach)).add_systems(
        FixedUpdate,
        hold.in_set(SurgerySystems::Sense)
            .after(SenseDevices)
            .before(ScenarioSystems::Lead)
            .run_if(not(resource_exists::<ScriptedHand>)),
    );
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

fn choose(
    keys: Res<ButtonInput<KeyCode>>,
    mut mouse: ResMut<Mouse>,
    mut guide: ResMut<Guide>,
    mut run: ResMut<ScenarioRun>,
) {
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
    if keys.just_pressed(KeyCode::KeyG) {
        guide.is_on = !guide.is_on;
    }
    if keys.just_pressed(KeyCode::Backspace) {
        run.stop();
    }
}

fn reach(mut mouse: ResMut<Mouse>, wheel: Res<AccumulatedMouseScroll>) {
    let notches = match wheel.unit {
        MouseScrollUnit::Line => wheel.delta.y,
        MouseScrollUnit::Pixel => wheel.delta.y / MouseScrollUnit::SCROLL_UNIT_CONVERSION_FACTOR,
    };
    if let Some(reach_m) = mouse.reach_m.as_mut().filter(|_| notches != 0.0) {
        *reach_m = (*reach_m + notches * NOTCH_M).clamp(0.02, 0.5);
    }
}

/// The tip is on the mouse's ray, as far from the eye as the wheel says.
fn hold(
    mut mouse: ResMut<Mouse>,
    run: Res<ScenarioRun>,
    buttons: Res<ButtonInput<MouseButton>>,
    keys: Res<ButtonInput<KeyCode>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    eyes: Query<(&Camera, &GlobalTransform), With<ScenarioEye>>,
    mut tools: Query<(&Name, &mut ToolPose, &mut ToolCommand), (With<Tool>, Without<HoldDevice>)>,
) {
    let Some((camera, eye)) = eyes.iter().next() else { return };
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    let ray = cursor.and_then(|at| camera.viewport_to_world(eye, at).ok());
    // At first as far as the middle of the scene, less what an instrument is held over it.
    let reach_m = *mouse.reach_m.get_or_insert_with(|| eye.translation().length() - 0.06);
    let wanted = run.scenario().tools.get(mouse.tool).map(|tool| tool.name.as_str());
    for (name, mut pose, mut command) in &mut tools {
        let Some(ray) = ray.filter(|_| wanted == Some(name.as_str())) else {
            pose.set_if_neq(ToolPose { is_tracked: false, ..*pose });
            continue;
        };
        let tip_m = ray.get_point(reach_m);
        let back = *eye.back() + 0.6 * *eye.right() + 0.3 * *eye.down();
        *pose = ToolPose::with_shaft_towards(tip_m, tip_m + back);
        let share = |button| f32::from(u8::from(buttons.pressed(button)));
        let (pedal, second_pedal) = (share(MouseButton::Left), share(MouseButton::Right));
        *command = ToolCommand { pedal, second_pedal, grip: pedal, next_burr: keys.pressed(KeyCode::KeyB) };
    }
}
