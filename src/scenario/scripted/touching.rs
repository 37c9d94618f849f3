//! A place of an organ is touched: towards it, onto it, away from it.

use super::{Deed, ScriptedHand, Sight, Task};
use crate::organ::SurfacePoint;
use crate::tools::{ToolCommand, ToolPose};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// How far over a place the hand waits, metres.
const OVER_M: f32 = 0.02;
/// Turns a second of the tip over an area.
const TURNS_PER_S: f32 = 0.7;

/// How far it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Touching {
    stage: Stage,
    /// How long it has touched, seconds.
    touched_s: f32,
    /// How far beside its aim it is, in the directions along the surface, metres.
    beside_m: Option<Vec2>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    #[default]
    Over,
    Down,
    On,
    Away,
}

/// Does a step of it; whether it is done.
pub(super) fn touch(
    hand: &mut ScriptedHand,
    task: &Task,
    tool: usize,
    sight: &Sight,
    deeds: &mut Vec<Deed>,
    dt_s: f32,
) -> bool {
    let Task::Touch { organ, uv, radius_m, for_s, burns, not_before_s } = task else { return true };
    let skill = hand.skill;
    let run = &*sight.run;
    if run.time_s() as f32 <= *not_before_s || hand.task_s < skill.pause_s {
        return false;
    }
    let Some((at_m, normal)) = place(organ, *uv, sight) else { return true };
    let beside_m = match hand.touching.beside_m {
        Some(beside_m) => beside_m,
        None => {
            let beside_m = Vec2::new(hand.any(), hand.any()).normalize_or(Vec2::X) * skill.aim_error_m;
            hand.touching.beside_m = Some(beside_m);
            beside_m
        }
    };
    let (right, up) = normal.any_orthonormal_pair();
    let tip_radius_m = run.observed.as_ref().map_or(1e-3, |of| of.logged_tools[tool].tool.tip_radius_m());
    let aim_m = at_m + right * beside_m.x + up * beside_m.y;
    let over_m = aim_m + normal * OVER_M;
    let on_m = aim_m + normal * (tip_radius_m - skill.press_m);
    let mut pedal = 0.0;
    let mut is_done = false;
    match hand.touching.stage {
        Stage::Over => {
            if hand.tip_m.is_none() {
                hand.tip_m = Some(over_m + normal * OVER_M);
            }
            if hand.go(over_m, skill.speed_m_per_s, dt_s) {
                hand.touching.stage = Stage::Down;
            }
        }
        Stage::Down => {
            if hand.go(on_m, 0.5 * skill.speed_m_per_s, dt_s) {
                hand.touching.stage = Stage::On;
            }
        }
        Stage::On => {
            hand.touching.touched_s += dt_s;
            let share = (hand.touching.touched_s / for_s).min(1.0);
            // Outwards in windings, so that every part of the disk has the same time.
            let turn = Vec2::from_angle(TAU * TURNS_PER_S * hand.touching.touched_s) * share.sqrt() * *radius_m;
            hand.tip_m = Some(on_m + right * turn.x + up * turn.y);
            pedal = if *burns { 1.0 } else { 0.0 };
            if hand.touching.touched_s >= *for_s {
                hand.touching.stage = Stage::Away;
            }
        }
        Stage::Away => is_done = hand.go(over_m, skill.speed_m_per_s, dt_s),
    }
    let tip_m = hand.tip_m.unwrap_or(over_m);
    // Held as from the trocar above.
    let back = (normal + Vec3::new(0.4, 0.6, 0.5)).normalize_or(Vec3::Y);
    deeds.push(Deed {
        tool,
        pose: ToolPose::with_shaft_towards(tip_m, tip_m + back),
        command: ToolCommand { pedal, ..default() },
    });
    is_done
}

/// A place of an organ in the world, and its normal.
fn place(organ: &str, uv: Vec2, sight: &Sight) -> Option<(Vec3, Vec3)> {
    let (_, handle, shape, transform) = sight.organs.iter().find(|(name, ..)| name.as_str() == organ)?;
    let model = sight.models.as_ref()?.get(&handle.0).filter(|model| shape.is_of(model))?;
    let point: SurfacePoint = model.atlas.locate_uv(uv.as_dvec2(), &model.table)?;
    let surface = model.surface(shape);
    let at_m = transform.transform_point(surface.position_m(point).as_vec3());
    let normal = transform.affine().transform_vector3(surface.normal(point).as_vec3()).normalize_or(Vec3::Y);
    Some((at_m, normal))
}
