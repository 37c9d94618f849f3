//! Bodies in the ECS: messages in, a step, the lattice told, messages out.

use super::body::{BodyFaults, ElasticBody};
use super::error::ElasticError;
use super::messages::{BodyContact, GraspBody, GraspHeld, GraspSlipped, PressBody, TissueTorn};
use super::touch::{BodyEvent, Hold, Press};
use crate::checkpoint::KeepState;
use crate::deform::DeformBodies;
use crate::deform::lattice::DeformLattice;
use crate::gravity::SurgeryGravity;
use bevy::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use tracing::warn;

/// In [`DeformBodies`]: bodies take their step and tell their lattices. Who moves a lattice by hand does it before, who
/// reads where matter is comes after.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct StepBodies;

/// Most entities that are no bodies and whose messages are told of.
const MOST_UNKNOWN: usize = 64;

pub(in crate::deform) fn build(app: &mut App) {
    app.init_resource::<SurgeryGravity>()
        .register_type::<SurgeryGravity>()
        .register_type::<ElasticBody>()
        .register_type::<super::ElasticCell>()
        .register_type::<super::ElasticTissue>()
        .register_type::<ElasticError>()
        .register_type::<BodyFaults>()
        .register_type::<super::ToolShape>()
        .register_type::<Press>()
        .register_type::<Hold>()
        .register_type::<BodyEvent>()
        .register_type::<PressBody>()
        .register_type::<GraspBody>()
        .register_type::<BodyContact>()
        .register_type::<GraspHeld>()
        .register_type::<GraspSlipped>()
        .register_type::<TissueTorn>()
        .add_message::<PressBody>()
        .add_message::<GraspBody>()
        .add_message::<BodyContact>()
        .add_message::<GraspHeld>()
        .add_message::<GraspSlipped>()
        .add_message::<TissueTorn>()
        // Nodes, the cells between them, and what tools touch.
        .keep_large_component(|body: &ElasticBody| body.tree().vertex_count() * 512)
        .carry_messages::<BodyContact>()
        .carry_messages::<GraspSlipped>()
        .carry_messages::<TissueTorn>()
        .configure_sets(FixedUpdate, StepBodies.in_set(DeformBodies))
        .add_systems(
            FixedUpdate,
            (follow_lattices, super::super::organs::refresh_rides, step_bodies, publish).chain().in_set(StepBodies),
        );
}

fn named(entity: Entity, name: Option<&Name>) -> String {
    name.map_or_else(|| format!("body {entity}"), |name| format!("body \"{name}\" ({entity})"))
}

/// Bodies go over to trees that were subdivided.
fn follow_lattices(
    mut bodies: Query<(Entity, &mut ElasticBody, Option<Ref<DeformLattice>>, Option<&Name>)>,
    mut told_of: Local<BTreeSet<Entity>>,
) {
    for (entity, mut body, lattice, name) in &mut bodies {
        let fault = match &lattice {
            None if body.publishes => {
                Some("it has no DeformLattice: only organs see how it moves (set `publishes` to false?)".to_string())
            }
            Some(lattice) if lattice.is_changed() && lattice.tree() != body.tree() => {
                body.follow_tree(lattice).err().map(|error| format!("{error}; the body goes on with the old lattice"))
            }
            _ => None,
        };
        if let Some(fault) = fault
            && told_of.insert(entity)
        {
            warn!("{}: {fault}", named(entity, name));
        }
    }
}

/// What instruments do to one body.
#[derive(Default)]
struct Acts {
    presses: Vec<Press>,
    holds: Vec<Hold>,
}

#[derive(bevy::ecs::system::SystemParam)]
struct Answers<'w> {
    contacts: MessageWriter<'w, BodyContact>,
    held: MessageWriter<'w, GraspHeld>,
    slipped: MessageWriter<'w, GraspSlipped>,
    torn: MessageWriter<'w, TissueTorn>,
}

fn step_bodies(
    mut presses: MessageReader<PressBody>,
    mut grasps: MessageReader<GraspBody>,
    mut answers: Answers,
    mut bodies: Query<(Entity, &mut ElasticBody, &GlobalTransform, Option<&Name>)>,
    gravity: Res<SurgeryGravity>,
    time: Res<Time>,
    mut told_of: Local<BTreeSet<Entity>>,
    mut told_faults: Local<BTreeMap<Entity, BodyFaults>>,
) {
    let mut acts: BTreeMap<Entity, Acts> = BTreeMap::new();
    let mut space_of = |entity: Entity| -> Option<Spaces> {
        let Ok((_, _, transform, _)) = bodies.get(entity) else {
            if told_of.len() < MOST_UNKNOWN && told_of.insert(entity) {
                warn!("an instrument names {entity}, which has no ElasticBody (despawned?); it is left out");
            }
            return None;
        };
        Some(Spaces::of(transform))
    };
    for press in presses.read() {
        if let Some(space) = space_of(press.body) {
            let shape = press.shape.transformed(&space.body_from_world);
            acts.entry(press.body).or_default().presses.push(Press {
                tool: press.tool,
                shape,
                friction: press.friction,
            });
        }
    }
    for grasp in grasps.read() {
        if let Some(space) = space_of(grasp.body) {
            acts.entry(grasp.body).or_default().holds.push(Hold {
                tool: grasp.tool,
                position_m: space.body_from_world.transform_point3(grasp.position_world_m),
                rotation: space.turn.inverse() * grasp.rotation_world,
                radius_m: grasp.radius_m / space.scale,
                most_pull_n: grasp.friction * grasp.grip_force_n,
            });
        }
    }
    for (entity, mut body, transform, name) in &mut bodies {
        let space = Spaces::of(transform);
        let down = space.body_from_world.transform_vector3(gravity.world_m_per_s2);
        let acts = acts.remove(&entity).unwrap_or_default();
        for event in body.step(time.delta_secs_f64(), down, &acts.presses, &acts.holds) {
            answers.tell(entity, &event, &space);
        }
        let (faults, told) = (body.faults(), told_faults.entry(entity).or_default());
        if faults.restored_steps > 0 && told.restored_steps == 0 {
            warn!(
                "{}: a step ended in numbers that are not finite; it went back to the step before",
                named(entity, name)
            );
        }
        if faults.odd_inputs > 0 && told.odd_inputs == 0 {
            warn!(
                "{}: what an instrument, gravity or a force said was no number; it did not count",
                named(entity, name)
            );
        }
        *told = BodyFaults { kept_translations: told.kept_translations, ..faults };
    }
}

/// The spaces of a body.
struct Spaces {
    world_from_body: bevy::math::Affine3A,
    body_from_world: bevy::math::Affine3A,
    turn: Quat,
    scale: f32,
}

impl Spaces {
    fn of(transform: &GlobalTransform) -> Self {
        let world_from_body = transform.affine();
        let (scale, turn, _) = world_from_body.to_scale_rotation_translation();
        let scale = scale.element_product().abs().cbrt();
        Self { world_from_body, body_from_world: world_from_body.inverse(), turn, scale }
    }
}

impl Answers<'_> {
    fn tell(&mut self, body: Entity, event: &BodyEvent, space: &Spaces) {
        let place = |position_m: Vec3| space.world_from_body.transform_point3(position_m);
        match *event {
            BodyEvent::Touched { tool, force_n, depth_m, position_m } => {
                let (force_world_n, position_world_m) = (space.turn * force_n, place(position_m));
                self.contacts.write(BodyContact { body, tool, force_world_n, depth_m, position_world_m });
            }
            BodyEvent::Held { tool, force_n, stretch } => {
                self.held.write(GraspHeld { body, tool, force_world_n: space.turn * force_n, stretch });
            }
            BodyEvent::Slipped { tool, pull_n, position_m } => {
                self.slipped.write(GraspSlipped { body, tool, pull_n, position_world_m: place(position_m) });
            }
            BodyEvent::Torn { tool, pull_n, stretch, position_m } => {
                self.torn.write(TissueTorn { body, tool, pull_n, stretch, position_world_m: place(position_m) });
            }
        }
    }
}

/// Tells lattices what moved.
fn publish(
    mut bodies: Query<(Entity, &mut ElasticBody, &mut DeformLattice, Option<&Name>)>,
    mut told_of: Local<BTreeSet<Entity>>,
) {
    for (entity, mut body, mut lattice, name) in &mut bodies {
        if !body.publishes || !body.has_moved() || lattice.tree() != body.tree() {
            continue;
        }
        let before = body.faults().kept_translations;
        if let Err(error) = body.publish(&mut lattice) {
            warn!("{}: {error}", named(entity, name));
        }
        if body.faults().kept_translations > before && told_of.insert(entity) {
            warn!(
                "{}: some cells are inverted or outside of the box, where the lattice cannot follow; it keeps what it had there",
                named(entity, name)
            );
        }
    }
}
