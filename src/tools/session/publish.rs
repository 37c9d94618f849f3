//! From the simulation to the servo loop: where the device stands, what the hand holds, what is near it.

use super::organs::Around;
use super::{Memory, ServoSession};
use crate::deform::elastic::{BodyContact, GraspHeld};
use crate::gravity::SurgeryGravity;
use crate::haptics::force::{SurfaceFeel, ToolLoad, TurningBurr};
use crate::haptics::servo::{MAX_BODIES, ServoBody, ServoRig, ServoScene, ServoShape, ServoTool};
use crate::organ::{OrganModel, refit_pickers};
use crate::pool::SuctionState;
use crate::schedule::SurgerySystems;
use crate::tools::bodies::Bodies;
use crate::tools::{RigFrame, Tool, ToolKind, ToolMotion, ToolRig, ToolState, tool_number};
use crate::volume::FollowLattices;
use bevy::math::{DAffine3, DVec3};
use bevy::prelude::*;

/// Drag of a tip that sucks nothing but fluid, newton seconds per metre.
const SUCTION_DRAG_N_S_PER_M: f64 = 2.0;
/// Length of a shaft that is looked at, metres; further back no one feels it.
const SHAFT_FELT_M: f64 = 0.12;

pub(super) fn build(app: &mut App) {
    let has_bodies = resource_exists::<Assets<OrganModel>>;
    app.add_message::<BodyContact>().add_message::<GraspHeld>().init_resource::<SurgeryGravity>().add_systems(
        FixedUpdate,
        publish_scenes.in_set(SurgerySystems::Publish).after(refit_pickers).after(FollowLattices).run_if(has_bodies),
    );
}

type Held = (
    Entity,
    &'static Tool,
    &'static ToolState,
    &'static ToolMotion,
    &'static ToolRig,
    &'static mut ServoSession,
    Option<&'static SuctionState>,
);

fn publish_scenes(
    mut tools: Query<Held>,
    frames: Query<&GlobalTransform>,
    felt: Bodies,
    gravity: Res<SurgeryGravity>,
    mut answers: MessageReader<BodyContact>,
    mut held: MessageReader<GraspHeld>,
    time: Res<Time>,
) {
    let (answers, held): (Vec<_>, Vec<_>) = (answers.read().collect(), held.read().collect());
    for (entity, tool, state, motion, rig, mut session, suction) in &mut tools {
        let session = &mut *session;
        let number = tool_number(entity);
        let frame = match rig.frame {
            RigFrame::World => Some(GlobalTransform::IDENTITY),
            RigFrame::Of(frame) => frames.get(frame).ok().copied(),
        };
        let servo_rig = ServoRig {
            world_from_device: frame.map_or(DAffine3::IDENTITY, |frame| rig.world_from_device(&frame)),
            force_scale: f64::from(rig.force_scale),
            revision: rig.revision(),
            // Without its frame a tool is nowhere.
            is_engaged: !rig.is_clutched() && frame.is_some() && tool.is_solid(),
        };
        let pull_n = held.iter().filter(|held| held.tool == number).map(|held| held.force_world_n.as_dvec3()).sum();
        let load = ToolLoad {
            mass_kg: f64::from(tool.geometry.mass_kg),
            held_mass_kg: 0.0,
            gravity_m_per_s2: gravity.world_m_per_s2.as_dvec3(),
            drag_n_s_per_m: suction.map_or(0.0, |took| {
                let liquid = if took.fluid_ml_s > 0.0 { f64::from(1.0 - took.air_share) } else { 0.0 };
                SUCTION_DRAG_N_S_PER_M * liquid
            }),
            pull_n,
        };
        let servo_tool = servo_tool(tool, state, rig, load);
        let answers = answers.iter().filter(|answer| answer.tool == number).copied();
        let pressed_m = motion.to.map(|place| place.tip_in_world_m.as_dvec3());
        let bodies = bodies(&mut session.memory, tool, &servo_tool, &felt, answers, pressed_m);
        session.link.get().publish(ServoScene {
            time_s: time.elapsed_secs_f64(),
            interval_s: time.delta_secs_f64(),
            rig: servo_rig,
            tool: servo_tool,
            bodies,
        });
    }
}

fn servo_tool(tool: &Tool, state: &ToolState, rig: &ToolRig, load: ToolLoad) -> ServoTool {
    let burr = match tool.kind {
        ToolKind::Drill(head) => Some(TurningBurr {
            burr: head.burr,
            speed_rpm: f64::from(head.full_speed_rpm * state.command.pedal),
            flutes: head.flutes,
            friction: f64::from(head.friction),
            vibration: f64::from(head.vibration),
            stiffness_n_per_m: SurfaceFeel::BONE.stiffness_n_per_m,
        }),
        _ => None,
    };
    ServoTool {
        tip_in_handle_m: rig.tip_in_handle_m.as_dvec3(),
        tip_radius_m: f64::from(tool.tip_radius_m()),
        shaft_length_m: f64::from(tool.geometry.shaft_length_m).min(SHAFT_FELT_M),
        shaft_radius_m: f64::from(tool.geometry.shaft_radius_m),
        burr,
        load,
    }
}

/// The bodies near a tool, the nearest first.
fn bodies<'a>(
    memory: &mut Memory,
    tool: &Tool,
    servo_tool: &ServoTool,
    felt: &Bodies,
    answers: impl Iterator<Item = &'a BodyContact>,
    pressed_m: Option<DVec3>,
) -> Vec<ServoBody> {
    let Memory { last, organs, bones, soft } = memory;
    if !last.is_tracked || !tool.is_solid() {
        return Vec::new();
    }
    let tip_m = last.proxy_in_world_m;
    let back_m = tip_m + last.world_from_tool * DVec3::Z * servo_tool.shaft_length_m.max(0.0);
    let around = Around { tip_m, back_m };
    let tip_radius_m = f64::from(tool.tip_radius_m());
    organs.begin();
    bones.begin();
    soft.begin();
    for answer in answers {
        // They answer to where the tool was pressed to, not to the proxy.
        soft.take(answer, pressed_m.unwrap_or(tip_m), tip_radius_m, &felt.feel_of_organ(answer.body));
    }
    soft.end();
    let mut found: Vec<(f64, ServoBody)> = Vec::new();
    for organ in felt.organs() {
        let id = organ.entity.to_bits();
        if let Some(patch) = soft.patch(organ.entity) {
            organs.remember(organ.entity, &organ.shape, organ.world_from_organ);
            found.push((0.0, ServoBody { id, shape: ServoShape::Contact(patch) }));
            continue;
        }
        if let Some((distance_m, patch)) = organs.patch(&organ, &around) {
            found.push((distance_m, ServoBody { id, shape: ServoShape::Surface(patch) }));
        }
    }
    organs.end();
    let is_turning = servo_tool.turning().is_some();
    for volume in felt.volumes() {
        let id = volume.entity.to_bits();
        if let Some(patch) = soft.patch(volume.entity) {
            found.push((0.0, ServoBody { id, shape: ServoShape::Contact(patch) }));
            continue;
        }
        if let Some(patch) = bones.patch(&volume, tip_m, tip_radius_m, !is_turning) {
            found.push((0.0, ServoBody { id, shape: ServoShape::Bone(patch) }));
        }
    }
    bones.end();
    // By distance; equally near ones by their number, whatever order they were found in.
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
    found.truncate(MAX_BODIES);
    found.into_iter().map(|(_, body)| body).collect()
}
