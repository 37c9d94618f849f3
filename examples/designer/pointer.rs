//! What a click in the picture does.

use crate::Designer;
use crate::view::OwnView;
use bevy::ecs::system::SystemState;
use bevy::gizmos::transform_gizmo::{TransformGizmoFocus, TransformGizmoState};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_egui::input::EguiWantsInput;
use bevy_panorbit_camera::PanOrbitCamera;
use bevy_surgery::panels::note_change;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::{ReactionAction, Wound};
use std::any::TypeId;

/// What a click does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hand {
    /// Chooses what is there.
    #[default]
    Choose,
    /// Presses the organ: it whitens.
    Press,
    /// Opens a vessel.
    Bleed,
    /// Burns.
    Burn,
}

impl Hand {
    /// All of them, with their names and what they do.
    pub const ALL: [(Self, &'static str, &'static str); 4] = [
        (Self::Choose, "Choose", "A click chooses what is there (1)"),
        (Self::Press, "Press", "Pressing the button presses the organ, which whitens (2)"),
        (Self::Bleed, "Bleed", "A click opens a vessel of the organ (3)"),
        (Self::Burn, "Burn", "Pressing the button burns the organ (4)"),
    ];
}

/// How far the pointer may move for it to be a click, points.
const STILL: f32 = 4.0;
/// Instruments of others have numbers from 0.
const OWN_INSTRUMENT: u32 = u32::MAX - 7;

/// What is held just now.
#[derive(Resource, Default)]
pub struct Pointing {
    pressed_at: Option<Vec2>,
    /// Whether something else took the press: a handle, the gizmo.
    pub is_taken: bool,
    /// A click that opens a vessel in the next step: it may be shorter than one.
    opens: Option<Ray3d>,
}

pub fn build(app: &mut App) {
    app.init_resource::<Pointing>()
        .add_systems(PreUpdate, (free_or_hold_eye, focus_gizmo))
        .add_systems(Update, (click, note_gizmo))
        .add_systems(FixedUpdate, act.in_set(SurgerySystems::Sense));
}

/// The ray under the pointer, where it is over the picture.
pub fn ray(
    designer: &Designer,
    windows: &Query<&Window, With<PrimaryWindow>>,
    cameras: &Query<(Entity, &Camera, &GlobalTransform, Has<OwnView>), With<Camera3d>>,
) -> Option<(Vec2, Ray3d)> {
    let at = windows.iter().next()?.cursor_position()?;
    if !designer.picture.contains(at) {
        return None;
    }
    let wanted = |(entity, .., is_own): &(Entity, &Camera, &GlobalTransform, bool)| match designer.through {
        Some(through) => *entity == through,
        None => *is_own,
    };
    let (_, camera, place, _) = cameras.iter().find(wanted)?;
    Some((at, camera.viewport_to_world(place, at).ok()?))
}

/// The eye is turned with the left button only where that does nothing else.
fn free_or_hold_eye(
    designer: Res<Designer>,
    pointing: Res<Pointing>,
    gizmo: Res<TransformGizmoState>,
    wants: Option<Res<EguiWantsInput>>,
    mut eyes: Query<&mut PanOrbitCamera>,
) {
    let is_panels = wants.is_some_and(|wants| wants.wants_any_pointer_input());
    let is_busy = gizmo.active || gizmo.hovered_axis.is_some() || pointing.is_taken;
    let is_free = !is_panels && !is_busy && designer.through.is_none();
    for mut eye in &mut eyes {
        eye.enabled = is_free;
        // With an instrument in hand the eye is turned with the middle button.
        eye.button_orbit = if designer.hand == Hand::Choose { MouseButton::Left } else { MouseButton::Middle };
    }
}

fn focus_gizmo(
    designer: Res<Designer>,
    focused: Query<Entity, With<TransformGizmoFocus>>,
    places: Query<(), With<Transform>>,
    mut commands: Commands,
) {
    let wanted = designer.chosen.filter(|chosen| places.contains(*chosen) && designer.hand == Hand::Choose);
    for entity in focused.iter().filter(|entity| Some(*entity) != wanted) {
        commands.entity(entity).remove::<TransformGizmoFocus>();
    }
    if let Some(wanted) = wanted.filter(|wanted| !focused.contains(*wanted)) {
        commands.entity(wanted).insert(TransformGizmoFocus);
    }
}

/// A drag of the gizmo is an edit.
fn note_gizmo(world: &mut World, mut before: Local<Option<(Entity, Transform)>>) {
    let state = world.resource::<TransformGizmoState>();
    if state.active {
        if before.is_none() {
            *before = state.entity.map(|entity| (entity, state.start_transform));
        }
    } else if let Some((entity, transform)) = before.take() {
        note_change(world, entity, TypeId::of::<Transform>(), Some(Box::new(transform)), "Move");
    }
}

/// Chooses what is clicked.
fn click(
    mut designer: ResMut<Designer>,
    mut pointing: ResMut<Pointing>,
    buttons: Res<ButtonInput<MouseButton>>,
    windows: Query<&Window, With<PrimaryWindow>>,
    cameras: Query<(Entity, &Camera, &GlobalTransform, Has<OwnView>), With<Camera3d>>,
    gizmo: Res<TransformGizmoState>,
    wants: Option<Res<EguiWantsInput>>,
    organs: OrganPicking,
    volumes: VolumePicking,
    time: Res<Time<Virtual>>,
) {
    let under = ray(&designer, &windows, &cameras);
    if buttons.just_pressed(MouseButton::Left) {
        let is_panels = wants.is_some_and(|wants| wants.wants_any_pointer_input());
        let is_free = !is_panels && !gizmo.active && gizmo.hovered_axis.is_none();
        let pressed = under.filter(|_| is_free);
        pointing.pressed_at = pressed.map(|(at, _)| at);
        pointing.opens = pressed.filter(|_| designer.hand == Hand::Bleed).map(|(_, ray)| ray);
        if pressed.is_some() && designer.hand != Hand::Choose && time.is_paused() {
            designer.status = "Nothing happens while it is paused: Space plays".into();
        }
    }
    if !buttons.just_released(MouseButton::Left) {
        return;
    }
    let Some((at, ray)) = under else { return };
    let is_click = pointing.pressed_at.take().is_some_and(|pressed| pressed.distance(at) < STILL);
    if !is_click || designer.hand != Hand::Choose || pointing.is_taken {
        return;
    }
    let organ = organs.cast_ray(ray, 100.0).map(|hit| (hit.distance_m, hit.organ));
    let volume = volumes.cast_ray(ray, 100.0).map(|hit| (hit.distance_m, hit.volume));
    let nearest = [organ, volume].into_iter().flatten().min_by(|one, other| one.0.total_cmp(&other.0));
    designer.chosen = nearest.map(|(_, entity)| entity);
}

type Acting = (
    Res<'static, Designer>,
    ResMut<'static, Pointing>,
    Res<'static, ButtonInput<MouseButton>>,
    Query<'static, 'static, &'static Window, With<PrimaryWindow>>,
    Query<'static, 'static, (Entity, &'static Camera, &'static GlobalTransform, Has<OwnView>), With<Camera3d>>,
    OrganPicking<'static, 'static>,
    MessageWriter<'static, OrganTouch>,
);

/// Presses, opens vessels and burns.
fn act(world: &mut World, state: &mut SystemState<Acting>) {
    let Ok((designer, mut pointing, buttons, windows, cameras, organs, mut touches)) = state.get_mut(world) else {
        return;
    };
    let action = match designer.hand {
        Hand::Choose => return,
        Hand::Press => ReactionAction::Press { pressure: 1.0, radius_m: 4e-3 },
        Hand::Bleed => ReactionAction::Wound(Wound::default()),
        Hand::Burn => ReactionAction::Cauterize(default()),
    };
    let is_held = buttons.pressed(MouseButton::Left) && pointing.pressed_at.is_some() && !pointing.is_taken;
    let along = match designer.hand {
        Hand::Bleed => pointing.opens.take(),
        _ if is_held => ray(&designer, &windows, &cameras).map(|(_, ray)| ray),
        _ => None,
    };
    let Some(ray) = along else { return };
    if let Some(hit) = organs.cast_ray(ray, 100.0) {
        touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: OWN_INSTRUMENT, action });
    }
}
