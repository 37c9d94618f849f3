//! Mouse and keys.

use crate::drill::{Aim, Drill, FORCES_N};
use crate::irrigate::OtherHand;
use crate::panel::Notice;
use crate::{Patient, figure};
use bevy::input::mouse::AccumulatedMouseScroll;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_surgery::prelude::*;
use bevy_surgery::view::StereoEye;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrShape};
use bevy_surgery::volume::{CtVolume, CutVolume, Volume, VolumeLook, VolumeMethod};

/// Where the cut is saved, in the working folder.
const CUT_FILE: &str = "mastoid.cut";

pub fn build(app: &mut App) {
    app.add_systems(Update, (hold_drill, hold_tube, choose_burr, change_cut, change_look, change_view));
}

fn hold_drill(
    mut drill: ResMut<Drill>,
    buttons: Res<ButtonInput<MouseButton>>,
    scroll: Res<AccumulatedMouseScroll>,
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(&Camera, &GlobalTransform), Or<(With<Microscope>, With<StereoEye>)>>,
) {
    let cursor = windows.iter().next().and_then(Window::cursor_position);
    let under_cursor = |(camera, eye): (&Camera, &GlobalTransform)| {
        let at = cursor?;
        let is_seen = camera.is_active && camera.logical_viewport_rect().is_some_and(|picture| picture.contains(at));
        let ray = is_seen.then(|| camera.viewport_to_world(eye, at).ok())??;
        Some(Aim::of_right_hand(eye, ray))
    };
    drill.aim = cameras.iter().find_map(under_cursor);
    drill.is_on = buttons.pressed(MouseButton::Left);
    // Trackpads scroll by pixels, in many small amounts.
    let notches = scroll.delta.y.clamp(-1.0, 1.0);
    if notches != 0.0 {
        drill.force_n = (drill.force_n + 0.25 * notches).clamp(FORCES_N[0], FORCES_N[1]);
    }
}

fn hold_tube(mut hand: ResMut<OtherHand>, keys: Res<ButtonInput<KeyCode>>) {
    hand.is_sucking = keys.pressed(KeyCode::Space);
    hand.is_irrigating ^= keys.just_pressed(KeyCode::KeyI);
    hand.seals |= keys.just_pressed(KeyCode::KeyK);
}

fn choose_burr(mut drill: ResMut<Drill>, keys: Res<ButtonInput<KeyCode>>) {
    let mut burr = drill.burr;
    for (key, kind, diameter_m) in [
        (KeyCode::Digit1, BurrKind::Cutting, 6e-3),
        (KeyCode::Digit2, BurrKind::Cutting, 4e-3),
        (KeyCode::Digit3, BurrKind::Cutting, 2e-3),
        (KeyCode::Digit4, BurrKind::Diamond, 3e-3),
        (KeyCode::Digit5, BurrKind::Polishing, 2e-3),
    ] {
        if keys.just_pressed(key) {
            burr = Burr { kind, diameter_m, shape: BurrShape::Sphere };
        }
    }
    let length_m = 2.0 * burr.diameter_m;
    for (key, shape) in [
        (KeyCode::KeyS, BurrShape::Sphere),
        (KeyCode::KeyC, BurrShape::Cylinder { length_m }),
        (KeyCode::KeyM, BurrShape::Matchstick { length_m }),
    ] {
        if keys.just_pressed(key) {
            burr.shape = shape;
        }
    }
    if burr != drill.burr {
        drill.burr = burr;
    }
}

fn change_cut(
    keys: Res<ButtonInput<KeyCode>>,
    volumes: Res<Assets<Volume>>,
    mut patients: Query<(&CtVolume, &mut CutVolume), With<Patient>>,
    mut notice: ResMut<Notice>,
) {
    let wanted = [KeyCode::KeyU, KeyCode::KeyY, KeyCode::KeyR, KeyCode::F5, KeyCode::F9];
    let Some(key) = wanted.into_iter().find(|key| keys.just_pressed(*key)) else { return };
    for (source, mut cut) in &mut patients {
        let Some(volume) = volumes.get(&source.0) else { continue };
        let said = match key {
            KeyCode::KeyU if cut.can_undo() => {
                cut.undo();
                "taken back".into()
            }
            KeyCode::KeyU => "nothing to take back".into(),
            KeyCode::KeyY if cut.can_redo() => {
                cut.redo();
                "brought again".into()
            }
            KeyCode::KeyY => "nothing to bring again".into(),
            KeyCode::KeyR => {
                cut.reset();
                "whole again".into()
            }
            KeyCode::F5 => match std::fs::write(CUT_FILE, cut.save(volume.content_hash())) {
                Ok(()) => format!("saved to {CUT_FILE}"),
                Err(error) => format!("{CUT_FILE}: {error}"),
            },
            _ => {
                let read = std::fs::read(CUT_FILE).map_err(|error| error.to_string());
                let loaded = read.and_then(|bytes| {
                    CutVolume::load(&bytes, volume.grid().size, volume.content_hash())
                        .map_err(|error| error.to_string())
                });
                match loaded {
                    Ok(loaded) => {
                        *cut = loaded;
                        format!("loaded from {CUT_FILE}")
                    }
                    Err(error) => format!("{CUT_FILE}: {error}"),
                }
            }
        };
        notice.0 = said;
    }
}

fn change_look(
    keys: Res<ButtonInput<KeyCode>>,
    mut shading: Local<Option<usize>>,
    mut patients: Query<(&mut VolumeLook, &GlobalTransform), With<Patient>>,
    eyes: Query<&GlobalTransform, With<Microscope>>,
    mut notice: ResMut<Notice>,
) {
    for (mut look, place) in &mut patients {
        if keys.just_pressed(KeyCode::KeyT) {
            look.method = match look.method {
                VolumeMethod::Rays => VolumeMethod::Slices,
                _ => VolumeMethod::Rays,
            };
            notice.0 = format!("shown by {:?}", look.method).to_lowercase();
        }
        if keys.just_pressed(KeyCode::KeyW) {
            // What is shown at first is the third one.
            let next = (shading.unwrap_or(2) + 1) % figure::SHADINGS.len();
            figure::shade(&mut look, next);
            *shading = Some(next);
            notice.0 = format!("shaded as in figure 7{}", ["a", "b", "c", "d"][next]);
        }
        if keys.just_pressed(KeyCode::KeyP) {
            // Half a volume stays: what lies behind its middle, seen from here.
            let away = eyes.iter().next().map_or(Vec3::NEG_Z, |eye| *eye.forward());
            let plane = (place.rotation().inverse() * away).extend(0.0);
            look.clip_planes = if look.clip_planes.is_empty() { vec![plane] } else { Vec::new() };
        }
    }
}

fn change_view(keys: Res<ButtonInput<KeyCode>>, mut views: Query<(&mut Microscope, Option<&mut StereoPair>)>) {
    let pressed = |of: [KeyCode; 2]| keys.any_just_pressed(of);
    for (mut microscope, pair) in &mut views {
        if pressed([KeyCode::Equal, KeyCode::NumpadAdd]) {
            microscope.magnify();
        }
        if pressed([KeyCode::Minus, KeyCode::NumpadSubtract]) {
            microscope.reduce();
        }
        let Some(mut pair) = pair else { continue };
        for (key, by_m) in [(KeyCode::Comma, -2e-3), (KeyCode::Period, 2e-3)] {
            if keys.just_pressed(key) {
                pair.interocular_m = (pair.interocular_m + by_m).clamp(0.0, 0.08);
            }
        }
    }
}
