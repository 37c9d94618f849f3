//! A cavity is drilled: in windings, deeper and deeper, as hard as the hand presses, and not nearer to what is critical than it dares.

use super::{Deed, ScriptedHand, Sight, Task};
use crate::scenario::GoalKind;
use crate::tools::{ToolCommand, ToolKind, ToolPose};
use bevy::prelude::*;
use std::f32::consts::TAU;

/// Radius of the field, metres.
const FIELD_M: f32 = 9e-3;
/// How fast a burr goes down to the bone, and at most into it, metres a second.
const DOWN_M_PER_S: [f32; 2] = [0.03, 0.006];
/// How far over the middle of what is to be reached it begins, metres.
const OVER_M: f32 = 0.035;
/// Where the other hand is, seen along the axis: to the left of the burr and over it, metres.
const BESIDE_M: [f32; 2] = [9e-3, 4e-3];

/// How far it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Drilling {
    /// Height over the field's middle along the axis, metres.
    height_m: Option<f32>,
    /// Where in the windings it is.
    turn_rad: f32,
    outwards: f32,
    is_inwards: bool,
    /// By how much more the other hand is lifted, because it felt bone there, metres.
    lifted_m: f32,
}

/// Does a step of it; whether it is done.
pub(super) fn drill(
    hand: &mut ScriptedHand,
    task: &Task,
    tool: usize,
    sight: &Sight,
    deeds: &mut Vec<Deed>,
    dt_s: f32,
) -> bool {
    let Task::Drill { structures } = task else { return true };
    let (skill, run) = (hand.skill, &*sight.run);
    let Some(observed) = run.observed.as_ref() else { return true };
    if hand.task_s < skill.pause_s {
        return false;
    }
    let is_drilled =
        |kind: &GoalKind| matches!(kind, GoalKind::Remove { .. } | GoalKind::Expose { .. } | GoalKind::Reach { .. });
    let mut goals = run.scenario().goals.iter().zip(run.goals()).filter(|(goal, _)| is_drilled(&goal.kind));
    if goals.all(|(_, state)| state.is_reached) {
        return true;
    }
    let Some((middle_m, axis)) = observed.field(structures, run.eye.as_ref().map(|eye| eye.eye_world_m)) else {
        return true;
    };
    let facts = run.facts().tools.get(tool).cloned().unwrap_or_default();
    let drilling = &mut hand.drilling;
    // Windings out and back, with the same speed everywhere.
    let radius_m = (drilling.outwards * FIELD_M).max(1e-3);
    drilling.turn_rad = (drilling.turn_rad + skill.stroke_m_per_s / radius_m * dt_s) % TAU;
    let burr_m = match observed.logged_tools[tool].tool.kind {
        ToolKind::Drill(head) => head.burr.diameter_m,
        _ => 4e-3,
    };
    // One winding outwards by half a burr.
    let out = 0.5 * burr_m / TAU * (skill.stroke_m_per_s / radius_m) * dt_s / FIELD_M;
    drilling.outwards += if drilling.is_inwards { -out } else { out };
    if !(0.0..=1.0).contains(&drilling.outwards) {
        drilling.is_inwards = drilling.outwards > 0.5;
        drilling.outwards = drilling.outwards.clamp(0.0, 1.0);
    }
    // The hand gives way to force, and lifts before what is critical.
    let mut height_m = drilling.height_m.unwrap_or(OVER_M);
    let too_near = skill.margin_m > 0.0 && facts.critical_m.is_some_and(|distance_m| distance_m < skill.margin_m);
    let [free_m_per_s, most_m_per_s] = DOWN_M_PER_S;
    let speed = if too_near {
        -free_m_per_s
    } else if facts.force_n <= 0.0 && height_m > 0.5 * OVER_M {
        free_m_per_s
    } else {
        (most_m_per_s * (1.0 - facts.force_n / skill.drill_n)).clamp(-free_m_per_s, most_m_per_s)
    };
    height_m -= speed * dt_s;
    drilling.height_m = Some(height_m);
    let (right, up) = across(axis);
    let turn = Vec2::from_angle(drilling.turn_rad) * drilling.outwards * FIELD_M;
    let tip_m = middle_m + axis * height_m + right * turn.x + up * turn.y;
    hand.tip_m = Some(tip_m);
    let back = (axis + right * 0.7 - up * 0.4).normalize_or(axis);
    let pose = ToolPose::with_shaft_towards(tip_m, tip_m + back);
    deeds.push(Deed { tool, pose, command: ToolCommand { pedal: 1.0, ..default() } });
    let other = observed.logged_tools.iter().position(|tool| tool.tool.kind == ToolKind::SuctionIrrigator);
    if let Some(other) = other {
        let felt_n = run.facts().tools.get(other).map_or(0.0, |facts| facts.force_n);
        let lifted_m = &mut hand.drilling.lifted_m;
        *lifted_m = (*lifted_m + if felt_n > 0.0 { 0.06 } else { -0.004 } * dt_s).clamp(0.0, 0.02);
        let [aside_m, over_m] = BESIDE_M;
        let tip_m = tip_m - right * aside_m + axis * (over_m + *lifted_m);
        let back = (axis - right * 0.7 - up * 0.4).normalize_or(axis);
        let pedal = f32::from(u8::from(skill.sucks));
        let pose = ToolPose::with_shaft_towards(tip_m, tip_m + back);
        deeds.push(Deed { tool: other, pose, command: ToolCommand { pedal, ..default() } });
    }
    false
}

/// To the right of one who looks along an axis from its end, and upwards.
fn across(axis: Vec3) -> (Vec3, Vec3) {
    let along = if axis.y.abs() > 0.9 { Vec3::NEG_Z } else { Vec3::Y };
    let right = along.cross(axis).normalize_or(Vec3::X);
    (right, axis.cross(right))
}
