//! Keys: everything can be done without a mouse.

use crate::files::{self, Pending};
use crate::pointer::Hand;
use crate::{Designer, menu, replay, rest, view};
use bevy::gizmos::transform_gizmo::{TransformGizmoMode, TransformGizmoSettings, TransformGizmoSpace};
use bevy::prelude::*;
use bevy_egui::egui::{self, Key, Modifiers};
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_surgery::panels::{change_speed, edit, outline, redo, settle, single_step, toggle_pause, undo};

/// What is shown by F1.
const KEYS: &[(&str, &str)] = &[
    ("F1", "this list"),
    ("Ctrl+N, O, S, Shift+S", "new, open, save, save as"),
    ("Ctrl+Z, Ctrl+Shift+Z", "undo, redo"),
    ("Ctrl+R", "reset: as it was set up"),
    ("Ctrl+Q", "quit"),
    ("Page up, Page down", "choose the one before or after in the tree"),
    ("Tab, Shift+Tab; Escape", "to the next or last control of a panel, where arrows and Enter set it; out of it"),
    ("Delete", "remove what is chosen"),
    ("Alt+arrows, Alt+Page up, down", "move what is chosen by 1 mm (Shift: 10 mm) along x, z and y"),
    ("W, E, R; X", "gizmo moves, turns, scales; along its own axes"),
    ("1 to 4", "a click chooses, presses (whitens), bleeds, burns"),
    ("Arrows; +, -", "turn the designer's eye; nearer, farther"),
    ("F; C", "frame what is chosen; next camera"),
    ("Space, . (dot)", "play or pause; single step"),
    (", and /", "slower, faster"),
    ("Home, End, [ and ]", "a run's beginning and end; the event before and after"),
];

pub fn build(app: &mut App) {
    app.add_systems(Update, turn_eye);
}

pub fn help(context: &egui::Context, is_open: &mut bool) {
    egui::Window::new("Keys").open(is_open).resizable(false).anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(
        context,
        |ui| {
            egui::Grid::new("keys").striped(true).show(ui, |ui| {
                for (keys, what) in KEYS {
                    ui.strong(*keys);
                    ui.label(*what);
                    ui.end_row();
                }
            });
        },
    );
}

/// Does what the pressed keys say, unless they go to a panel.
pub fn press(world: &mut World, context: &egui::Context) {
    let pressed = |modifiers: Modifiers, key: Key| context.input_mut(|input| input.consume_key(modifiers, key));
    let command = Modifiers::COMMAND;
    world.resource_scope(|world, mut designer: Mut<Designer>| {
        // Who clicks into the picture, or presses Escape, has left the panels.
        let leaves = context.input(|input| {
            let at = input.pointer.press_origin().map(|at| Vec2::new(at.x, at.y));
            input.key_pressed(Key::Escape) || at.is_some_and(|at| designer.picture.contains(at))
        });
        if leaves && let Some(focused) = context.memory(|memory| memory.focused()) {
            context.memory_mut(|memory| memory.surrender_focus(focused));
        }
        if pressed(Modifiers::NONE, Key::F1) {
            designer.shows_help = !designer.shows_help;
        }
        if pressed(command | Modifiers::SHIFT, Key::Z) || pressed(command, Key::Y) {
            redo(world);
        }
        if pressed(command, Key::Z) {
            undo(world);
        }
        if pressed(command | Modifiers::SHIFT, Key::S) {
            files::ask_where(world);
        }
        if pressed(command, Key::S) {
            files::save(world, &mut designer);
        }
        if pressed(command, Key::O) {
            files::ask_what(world, false);
        }
        if pressed(command, Key::N) {
            files::when_safe(world, &mut designer, Pending::New);
        }
        if pressed(command, Key::Q) {
            files::when_safe(world, &mut designer, Pending::Quit);
        }
        if pressed(command, Key::R) {
            rest::reset(world, &mut designer);
        }
        if context.text_edit_focused() || designer.asks.is_some() {
            return;
        }
        // A control that was reached with Tab has these.
        let is_in_panel = context.memory(|memory| memory.focused().is_some());
        if !is_in_panel && pressed(Modifiers::NONE, Key::Space) {
            toggle_pause(world);
        }
        if !is_in_panel && pressed(Modifiers::NONE, Key::Delete) {
            menu::remove_chosen(world, &mut designer);
        }
        if pressed(Modifiers::NONE, Key::Period) {
            single_step(world);
        }
        for (key, by) in [(Key::Comma, -1), (Key::Slash, 1)] {
            if pressed(Modifiers::NONE, key) {
                change_speed(world, by);
            }
        }
        if pressed(Modifiers::NONE, Key::F) {
            view::frame(world, designer.chosen);
        }
        if pressed(Modifiers::NONE, Key::C) {
            view::next_camera(world, &mut designer);
        }
        for (key, hand) in
            [Key::Num1, Key::Num2, Key::Num3, Key::Num4].into_iter().zip(Hand::ALL.map(|(hand, ..)| hand))
        {
            if pressed(Modifiers::NONE, key) {
                designer.hand = hand;
            }
        }
        gizmo(world, &pressed);
        nudge(world, designer.chosen, &pressed);
        choose(world, &mut designer, &pressed);
        replay::keys(world, &mut designer, &pressed);
    });
}

fn gizmo(world: &mut World, pressed: &impl Fn(Modifiers, Key) -> bool) {
    let mut settings = world.resource_mut::<TransformGizmoSettings>();
    for (key, mode) in [
        (Key::W, TransformGizmoMode::Translate),
        (Key::E, TransformGizmoMode::Rotate),
        (Key::R, TransformGizmoMode::Scale),
    ] {
        if pressed(Modifiers::NONE, key) {
            settings.mode = mode;
        }
    }
    if pressed(Modifiers::NONE, Key::X) {
        settings.space = match settings.space {
            TransformGizmoSpace::World => TransformGizmoSpace::Local,
            TransformGizmoSpace::Local => TransformGizmoSpace::World,
        };
    }
}

/// Moves what is chosen by a millimetre or ten.
fn nudge(world: &mut World, chosen: Option<Entity>, pressed: &impl Fn(Modifiers, Key) -> bool) {
    let Some((chosen, place)) = chosen.and_then(|chosen| Some((chosen, *world.get::<Transform>(chosen)?))) else {
        return;
    };
    for (key, along) in [
        (Key::ArrowLeft, Vec3::NEG_X),
        (Key::ArrowRight, Vec3::X),
        (Key::ArrowUp, Vec3::NEG_Z),
        (Key::ArrowDown, Vec3::Z),
        (Key::PageUp, Vec3::Y),
        (Key::PageDown, Vec3::NEG_Y),
    ] {
        for (modifiers, by_m) in [(Modifiers::ALT | Modifiers::SHIFT, 1e-2), (Modifiers::ALT, 1e-3)] {
            if pressed(modifiers, key) {
                edit(world, chosen, Transform { translation: place.translation + along * by_m, ..place }, "Move");
                settle(world);
                return;
            }
        }
    }
}

/// The one before or after in the tree.
fn choose(world: &mut World, designer: &mut Designer, pressed: &impl Fn(Modifiers, Key) -> bool) {
    for (key, by) in [(Key::PageUp, -1), (Key::PageDown, 1)] {
        if pressed(Modifiers::NONE, key) {
            let all = outline(world);
            let place = designer.chosen.and_then(|chosen| all.iter().position(|entity| *entity == chosen));
            let next = place.map_or(0, |place| place as i64 + by).rem_euclid(all.len().max(1) as i64);
            designer.chosen = all.get(next as usize).copied();
        }
    }
}

/// Arrows turn the designer's own eye.
fn turn_eye(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time<Real>>,
    wants: Option<Res<bevy_egui::input::EguiWantsInput>>,
    mut eyes: Query<&mut PanOrbitCamera>,
) {
    let held = |key| f32::from(u8::from(keys.pressed(key)));
    let is_other = [KeyCode::AltLeft, KeyCode::AltRight, KeyCode::ControlLeft, KeyCode::ControlRight];
    if wants.is_some_and(|wants| wants.wants_any_keyboard_input()) || keys.any_pressed(is_other) {
        return;
    }
    let turned = 1.5 * time.delta_secs();
    let yaw = held(KeyCode::ArrowRight) - held(KeyCode::ArrowLeft);
    let pitch = held(KeyCode::ArrowUp) - held(KeyCode::ArrowDown);
    let far = held(KeyCode::Minus) + held(KeyCode::NumpadSubtract) - held(KeyCode::Equal) - held(KeyCode::NumpadAdd);
    for mut eye in &mut eyes {
        if (yaw, pitch, far) != (0.0, 0.0, 0.0) {
            eye.target_yaw += yaw * turned;
            eye.target_pitch += pitch * turned;
            eye.target_radius *= (far * time.delta_secs()).exp();
        }
    }
}
