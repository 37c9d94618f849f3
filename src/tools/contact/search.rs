//! Which bodies every tool touches in this step.

use super::bodies::{OrganBody, Placed, VolumeBody};
use super::sweep::{Solid, sweep};
use super::{Contact, NEAR_M, ToolContacts, ToolPart};
use crate::deform::elastic::BodyContact;
use crate::haptics::force::SurfaceFeel;
use crate::tools::bodies::Bodies;
use crate::tools::pose::ToolPlace;
use crate::tools::{Tool, ToolForce, ToolMotion, tool_number};
use bevy::math::DVec3;
use bevy::prelude::*;

/// How far around a part is looked, metres: the tip, and a shaft.
const SEARCH_M: [f64; 2] = [NEAR_M, 2e-3];
/// How deep in an organ a part may be whose contact lasts, metres. Nobody is deep in bone.
const DEEP_M: f64 = 0.1;
/// Forces reckoned by depth grow no further, newtons.
const MOST_FORCE_N: f64 = 20.0;

/// Ends of a part of a tool at a place; a ball has both at one.
fn ends(tool: &Tool, part: ToolPart, place: &ToolPlace) -> Option<([DVec3; 2], f64)> {
    let tip_m = place.tip_in_world_m.as_dvec3();
    let back = place.back_in_world().as_dvec3();
    match part {
        ToolPart::Tip => Some(([tip_m; 2], f64::from(tool.tip_radius_m()))),
        ToolPart::Shaft => {
            let (length_m, radius_m) =
                (f64::from(tool.geometry.shaft_length_m), f64::from(tool.geometry.shaft_radius_m));
            // What the tip touches is the tip's.
            let start_m = f64::from(tool.tip_radius_m()) + radius_m;
            let is_there = length_m.is_finite() && radius_m.is_finite() && length_m > start_m && radius_m >= 0.0;
            is_there.then(|| ([tip_m + back * start_m, tip_m + back * length_m], radius_m))
        }
    }
}

type Touching = (Entity, &'static Tool, &'static ToolMotion, &'static ToolForce, &'static mut ToolContacts);

/// Finds the contacts of every tool.
pub(in crate::tools) fn find_contacts(
    mut tools: Query<Touching>,
    bodies: Bodies,
    mut answers: MessageReader<BodyContact>,
) {
    let answers: Vec<BodyContact> = answers.read().copied().collect();
    for (entity, tool, motion, force, mut contacts) in &mut tools {
        let number = tool_number(entity);
        let before = std::mem::take(&mut contacts.bypass_change_detection().list);
        let was_near = !contacts.near.is_empty();
        contacts.bypass_change_detection().near.clear();
        let known_n = |body: Entity| {
            // A soft body gives way: what it answered last says more than how deep the tool is in its surface.
            let of_tool = answers.iter().filter(|answer| answer.body == body && answer.tool == number);
            let answered_n = of_tool.map(|answer| answer.force_world_n).sum::<Vec3>().length();
            let is_soft = bodies.is_soft(body);
            force.of_body_n(body).or(is_soft.then_some(answered_n))
        };
        let mut search =
            Search { tool, motion, known_n, before: &before, contacts: contacts.bypass_change_detection() };
        if tool.is_solid() && motion.to.is_some() {
            for organ in bodies.organs() {
                let Some(placed) = Placed::new(organ.world_from_organ) else { continue };
                let surface = organ.model.surface(&organ.shape);
                let body = OrganBody { placed, picker: organ.picker, surface, is_hollow: organ.is_hollow };
                search.touch(organ.entity, &body, &organ.feel, DEEP_M);
            }
            for volume in bodies.volumes() {
                let Some(placed) = Placed::new(volume.world_from_volume) else { continue };
                let lattice = volume.deformed.map(|deformed| (deformed.lattice(), volume.picker.grid()));
                let body = VolumeBody { placed, picker: volume.picker, cut: volume.cut, lattice };
                search.touch(volume.entity, &body, &volume.feel, 0.0);
            }
            search.contacts.list.sort_by_key(|contact| (contact.body, contact.part));
            search.contacts.near.sort();
        }
        if contacts.list != before || was_near || !contacts.near.is_empty() {
            contacts.set_changed();
        }
    }
}

struct Search<'a, F> {
    tool: &'a Tool,
    motion: &'a ToolMotion,
    /// The force of a body, where it is known.
    known_n: F,
    before: &'a [Contact],
    contacts: &'a mut ToolContacts,
}

impl<F: Fn(Entity) -> Option<f32>> Search<'_, F> {
    fn touch(&mut self, body: Entity, solid: &impl Solid, feel: &SurfaceFeel, deep_m: f64) {
        let Some(to) = &self.motion.to else { return };
        let known_n = (self.known_n)(body);
        for part in [ToolPart::Tip, ToolPart::Shaft] {
            let Some((to_m, radius_m)) = ends(self.tool, part, to) else { continue };
            let from_m = self.motion.from.and_then(|from| ends(self.tool, part, &from)).map(|(ends_m, _)| ends_m);
            let lasts = self.before.iter().any(|contact| contact.body == body && contact.part == part);
            let search_m = if lasts { deep_m.max(SEARCH_M[part as usize]) } else { SEARCH_M[part as usize] };
            let swept = sweep(solid, from_m, to_m, radius_m, search_m);
            let is_near = swept.touch.is_some() || swept.gap_m.is_some_and(|gap_m| gap_m <= NEAR_M);
            if is_near && !self.contacts.near.contains(&body) {
                self.contacts.near.push(body);
            }
            let Some(touch) = swept.touch else { continue };
            // A part that is measured together with the other one has the whole force where it is alone.
            let force_n = match known_n {
                Some(known_n) => known_n,
                None => (feel.stiffness_n_per_m * touch.depth_m).clamp(0.0, MOST_FORCE_N) as f32,
            };
            self.contacts.list.push(Contact {
                body,
                part,
                point_world_m: touch.near.point_m.as_vec3(),
                normal_world: touch.near.normal.as_vec3(),
                depth_m: touch.depth_m as f32,
                matter: touch.near.matter,
                force_n,
            });
        }
    }
}
