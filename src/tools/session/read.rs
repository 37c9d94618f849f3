//! From the servo loop to the tool.

use super::soft::pressed_in;
use super::{ServoFaulted, ServoReading, ServoSession, ToolControls, called};
use crate::deform::elastic::ElasticBody;
use crate::haptics::servo::ServoState;
use crate::tools::force::BodyForce;
use crate::tools::{Tool, ToolCommand, ToolForce, ToolPose, ToolRig};
use bevy::prelude::*;
use tracing::warn;

type Held = (
    Entity,
    &'static Tool,
    &'static mut ServoSession,
    &'static ToolControls,
    &'static mut ToolRig,
    &'static mut ToolPose,
    &'static mut ToolCommand,
    &'static mut ToolForce,
    &'static mut ServoReading,
    Option<&'static Name>,
);

pub(super) fn read_devices(
    mut tools: Query<Held>,
    bodies: Query<(), With<ElasticBody>>,
    mut faulted: MessageWriter<ServoFaulted>,
    time: Res<Time>,
) {
    for (entity, tool, mut session, controls, mut rig, mut pose, mut command, mut force, mut reading, name) in
        &mut tools
    {
        let session = &mut *session;
        session.advance(time.delta_secs_f64());
        let state = session.link.get().state();
        for fault in session.link.get().faults() {
            warn!("{}: {fault}", called(entity, name));
            faulted.write(ServoFaulted { tool: entity, fault });
        }
        let is_held = state.is_tracked && !state.is_over;
        let is_clutched = is_held && controls.clutch.value(&state.sample) >= ToolCommand::DOWN;
        if is_clutched != rig.is_clutched() {
            rig.hold_clutch(is_clutched, state.sample.position_m);
        }
        // While the clutch is held, and until the loop knows where it has led, the tool stays where it was.
        let is_led = is_held && state.is_held && !is_clutched && state.rig_revision == rig.revision();
        if is_led {
            let tip_m = pressed_in(&state, &session.device.limits, |body| bodies.contains(body));
            let placed = ToolPose::at(tip_m.as_vec3(), state.world_from_tool.as_quat());
            pose.set_if_neq(placed);
        } else if !is_held {
            pose.set_if_neq(ToolPose { is_tracked: false, ..*pose });
        }
        let pressed = if is_led { controls.command(&state.sample, &tool.kind) } else { ToolCommand::default() };
        command.set_if_neq(pressed);
        force.set_if_neq(measured(&session.memory.last, &state, is_led));
        reading.set_if_neq(ServoReading { device: session.device.id.clone(), state });
        session.memory.last = state;
    }
}

/// What the loop says that bodies press with.
fn measured(last: &ServoState, state: &ServoState, is_led: bool) -> ToolForce {
    let contacts = state.contacts().iter().filter_map(|contact| {
        let body = Entity::try_from_bits(contact.body)?;
        Some(BodyForce { body, force_world_n: contact.force_n.as_vec3() })
    });
    let by_body = if is_led { contacts.collect() } else { Vec::new() };
    let lived_s = state.time_s - last.time_s;
    let impulse_n_s = state.burr_impulse_n_s - last.burr_impulse_n_s;
    let drilling_n = (is_led && lived_s > 0.0).then(|| (impulse_n_s / lived_s).max(0.0) as f32);
    ToolForce { by_body, drilling_n: drilling_n.or(Some(0.0)), is_known: true }
}
