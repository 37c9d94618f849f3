//! One step of a run: what is to be judged, and what is to be written down.

use super::bodies::{Observed, Place};
use super::exposure::{EVERY_STEPS, can_be_seen};
use super::scene::Scene;
use super::tools::collisions;
use super::volumes::VolumePlace;
use crate::pool::VesselOpened;
use crate::reactions::{OrganReacted, ReactionEvent};
use crate::scenario::judge::{Facts, RemovalFacts, StructureFacts, ToolFacts};
use crate::scenario::log::{BleedingRecord, ContactRecord, LogRecord, ReactionRecord, RemovalRecord, ToolSample};
use crate::tools::{
    Contact, ContactMatter, ContactPhase, Tool, ToolKind, ToolMotion, ToolPose, ToolState, ToolTouched,
};
use crate::volume::VoxelsRemoved;
use crate::volume::rest::RestMap;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// What has happened in a step, as messages tell.
#[derive(SystemParam)]
pub(in crate::scenario) struct Events<'w, 's> {
    touched: MessageReader<'w, 's, ToolTouched>,
    removed: MessageReader<'w, 's, VoxelsRemoved>,
    reacted: MessageReader<'w, 's, OrganReacted>,
    opened: MessageReader<'w, 's, VesselOpened>,
}

impl Events<'_, '_> {
    /// Forgets what has happened so far.
    pub fn clear(&mut self) {
        self.touched.clear();
        self.removed.clear();
        self.reacted.clear();
        self.opened.clear();
    }
}

/// Diameter of the burr of an instrument while that turns, metres.
fn turning_burr_m(tool: &Tool, state: &ToolState) -> Option<f32> {
    match tool.kind {
        ToolKind::Drill(head) if state.command.pedal > 0.0 => Some(head.burr.diameter_m),
        _ => None,
    }
}

impl Observed {
    /// Looks at a step: what it was, and the records of it.
    pub(in crate::scenario) fn look(
        &mut self,
        step: u64,
        dt_s: f32,
        scene: &Scene,
        events: &mut Events,
    ) -> (Facts, Vec<LogRecord>) {
        let mut records = Vec::new();
        for volume in &mut self.volumes {
            if let Ok((_, _, _, Some(cut), ..)) = scene.volumes.get(volume.entity) {
                volume.follow(cut);
            }
        }
        let mut facts = Facts { step, dt_s, ..Facts::default() };
        self.look_at_tools(dt_s, scene, &mut facts, &mut records);
        self.tell_contacts(events, &mut records);
        self.look_at_removals(events, scene, &mut facts, &mut records);
        self.tell_reactions(events, &mut records);
        facts.structures =
            (0..self.structures.len()).map(|place| self.look_at_structure(place, &facts, scene)).collect();
        facts.lesions = self.lesions.iter_mut().map(|lesions| lesions.look(step, scene)).collect();
        self.look_at_blood(scene, &mut facts, &mut records);
        (facts, records)
    }

    fn body(&self, entity: Entity) -> Option<u32> {
        self.bodies.iter().position(|body| *body == entity).map(|place| place as u32)
    }

    fn tool(&self, entity: Entity) -> Option<u32> {
        self.tools.iter().position(|tool| *tool == entity).map(|place| place as u32)
    }

    fn look_at_tools(&self, dt_s: f32, scene: &Scene, facts: &mut Facts, records: &mut Vec<LogRecord>) {
        let mut placed = Vec::new();
        for (number, &entity) in self.tools.iter().enumerate() {
            let Ok((_, _, tool, pose, motion, command, force, contacts, state)) = scene.tools.get(entity) else {
                facts.tools.push(ToolFacts::default());
                placed.push(None);
                continue;
            };
            let tip_m = motion.to.map(|place| place.tip_in_world_m);
            let speed_m_per_s = motion
                .from
                .zip(motion.to)
                .map_or(0.0, |(from, to)| from.tip_in_world_m.distance(to.tip_in_world_m) / dt_s.max(1e-6));
            let force_n = contacts.list.iter().map(|contact| contact.force_n).sum();
            placed.push(motion.to.map(|place| (tool, place)));
            let critical = |tip_m: Vec3| {
                let distances = self.volumes.iter().filter_map(|volume| {
                    let (_, _, _, _, Some(picked), _, transform, deformed, _) =
                        scene.volumes.get(volume.entity).ok()?
                    else {
                        return None;
                    };
                    let at = VolumePlace::of(tip_m, &picked.0, transform, deformed);
                    volume.critical_m(&at, tool.tip_radius_m())
                });
                distances.reduce(f32::min)
            };
            let critical_m = tip_m.and_then(critical);
            let turning_burr_m = turning_burr_m(tool, state);
            facts.tools.push(ToolFacts { tip_m, speed_m_per_s, force_n, turning_burr_m, critical_m });
            let (pose, is_dropped) = logged_pose(pose, motion);
            let finite = |number: f32| if number.is_finite() { number } else { 0.0 };
            let forces_n = force.is_known.then(|| {
                let known = force.by_body.iter().filter_map(|of| Some((self.body(of.body)?, of.force_world_n)));
                known.filter(|(_, force_n)| force_n.is_finite()).collect()
            });
            records.push(LogRecord::Sample(ToolSample {
                tool: number as u32,
                pose,
                is_dropped,
                command: crate::tools::ToolCommand {
                    pedal: finite(command.pedal),
                    second_pedal: finite(command.second_pedal),
                    grip: finite(command.grip),
                    next_burr: command.next_burr,
                },
                forces_n,
                drilling_n: force.drilling_n.filter(|force_n| force_n.is_finite()),
                contact_n: finite(force_n),
                critical_m,
            }));
        }
        facts.collisions = collisions(&placed);
    }

    fn tell_contacts(&self, events: &mut Events, records: &mut Vec<LogRecord>) {
        let mut told = Vec::new();
        for touched in events.touched.read().filter(|touched| touched.phase != ContactPhase::Lasts) {
            let (Some(tool), Some(body)) = (self.tool(touched.tool), self.body(touched.contact.body)) else { continue };
            let Contact { part, point_world_m, depth_m, force_n, matter, .. } = touched.contact;
            let (label, uv) = match matter {
                ContactMatter::Volume { label, .. } => (Some(label), None),
                ContactMatter::Organ { uv, .. } => (None, Some(uv)),
            };
            let is_on = touched.phase == ContactPhase::Began;
            let record = ContactRecord { tool, body, label, uv, part, is_on, point_m: point_world_m, depth_m, force_n };
            told.push(record);
        }
        // Instruments are asked in an order that another program may not have.
        told.sort_by_key(|record| (record.tool, record.body, record.part));
        records.extend(told.into_iter().map(LogRecord::Contact));
    }

    fn look_at_removals(&self, events: &mut Events, scene: &Scene, facts: &mut Facts, records: &mut Vec<LogRecord>) {
        for removed in events.removed.read() {
            let Some(body) = self.body(removed.volume) else { continue };
            let tool = removed.tool.and_then(|tool| self.tool(tool));
            let centroid_m = removed.centroid_world_m;
            let seen = self.was_seen(removed, scene).map(|seen| f32::from(u8::from(seen)));
            facts.removals.push(RemovalFacts { tool, mm3: removed.total_mm3 as f32, seen, centroid_m });
            let by_label_mm3 = removed.by_label_mm3.clone();
            records.push(LogRecord::Removal(RemovalRecord { tool, body, by_label_mm3, centroid_m, seen }));
        }
    }

    /// Whether the eye saw what was removed: from there to the eye no matter lies further off than the burr reaches (Sewell 2008).
    fn was_seen(&self, removed: &VoxelsRemoved, scene: &Scene) -> Option<bool> {
        let eye_m = scene.eye()?.translation();
        let (_, _, _, Some(cut), Some(picked), _, transform, deformed, _) = scene.volumes.get(removed.volume).ok()?
        else {
            return None;
        };
        let volume_from_world = transform.affine().inverse();
        let [mut at_m, mut eye_m] = [removed.centroid_world_m, eye_m].map(|at| volume_from_world.transform_point3(at));
        if let Some(deformed) = deformed {
            let map = RestMap::new(deformed.lattice(), picked.0.grid());
            (at_m, eye_m) = (map.rest(at_m), map.rest(eye_m));
        }
        let burr_m = removed.tool.and_then(|tool| scene.tools.get(tool).ok());
        let radius_m = burr_m.map_or(2e-3, |(_, _, tool, ..)| tool.tip_radius_m());
        Some(can_be_seen(&picked.0, cut, at_m, eye_m, radius_m))
    }

    fn tell_reactions(&self, events: &mut Events, records: &mut Vec<LogRecord>) {
        for reacted in events.reacted.read() {
            let Some(body) = self.body(reacted.organ) else { continue };
            // Drops fall by the dozen, and matter to nobody's score.
            if let ReactionEvent::WoundSealed { .. } = reacted.event {
                let what = "wound sealed".into();
                records.push(LogRecord::Reaction(ReactionRecord { body, what, uv: None }));
            }
        }
        for opened in events.opened.read() {
            let Some(body) = self.body(opened.volume) else { continue };
            let volume = self.volumes.iter().find(|volume| volume.entity == opened.volume);
            let name = volume.and_then(|volume| volume.structures.of_label(opened.label));
            let what = name.map_or_else(|| "vessel opened".into(), |name| format!("vessel opened: {}", name.name));
            records.push(LogRecord::Reaction(ReactionRecord { body, what, uv: None }));
        }
    }

    fn look_at_structure(&self, place: usize, facts: &Facts, scene: &Scene) -> StructureFacts {
        let watched = &self.structures[place];
        let mut found = StructureFacts {
            is_touched: vec![false; self.tools.len()],
            distance_m: vec![None; self.tools.len()],
            ..StructureFacts::default()
        };
        let (mut removed_mm3, mut whole_mm3) = (0.0, 0.0);
        for place in &watched.places {
            if let Place::Label { volume, label } = *place {
                let of = &self.volumes[volume];
                let Ok((_, _, _, _, _, removed, ..)) = scene.volumes.get(of.entity) else { continue };
                removed_mm3 += removed.map_or(0.0, |removed| removed.of_label_mm3(label));
                whole_mm3 += of.whole_mm3.get(usize::from(label)).copied().unwrap_or(0.0);
            }
            for (number, &entity) in self.tools.iter().enumerate() {
                found.is_touched[number] |= self.touches(entity, place, scene);
                let Some(tip_m) = facts.tools[number].tip_m.filter(|_| watched.band_m > 0.0) else { continue };
                let nearer = self.distance_m(entity, tip_m, place, watched.band_m, scene);
                let nearest = [found.distance_m[number], nearer].into_iter().flatten().reduce(f32::min);
                found.distance_m[number] = nearest;
            }
        }
        found.removed_mm3 = removed_mm3 as f32;
        found.removed_share = if whole_mm3 > 0.0 { (removed_mm3 / whole_mm3) as f32 } else { 0.0 };
        if let Some(exposure) = watched.exposure.as_ref().filter(|_| facts.step.is_multiple_of(EVERY_STEPS)) {
            let eye_m = scene.eye().map(GlobalTransform::translation);
            found.exposed_share = eye_m.and_then(|eye_m| exposure.share(&self.volumes, scene, eye_m));
        }
        found
    }

    fn touches(&self, tool: Entity, place: &Place, scene: &Scene) -> bool {
        let Ok((.., contacts, _)) = scene.tools.get(tool) else { return false };
        contacts.list.iter().any(|contact| match (*place, contact.matter) {
            (Place::Label { volume, label }, ContactMatter::Volume { label: touched, .. }) => {
                contact.body == self.volumes[volume].entity && label == touched
            }
            (Place::Organ(organ), ContactMatter::Organ { .. }) => contact.body == organ,
            _ => false,
        })
    }

    /// How far the surface of a tip is from a structure; none where that is further than anyone asks.
    fn distance_m(&self, tool: Entity, tip_m: Vec3, place: &Place, band_m: f32, scene: &Scene) -> Option<f32> {
        let (_, _, tool, ..) = scene.tools.get(tool).ok()?;
        let radius_m = tool.tip_radius_m();
        match *place {
            Place::Label { volume, label } => {
                let of = &self.volumes[volume];
                let (_, _, _, _, Some(picked), _, transform, deformed, _) = scene.volumes.get(of.entity).ok()? else {
                    return None;
                };
                of.distance_m(label, &VolumePlace::of(tip_m, &picked.0, transform, deformed), radius_m)
            }
            Place::Organ(organ) => {
                let (_, _, _, _, Some(picker), _, transform) = scene.organs.get(organ).ok()? else { return None };
                let organ_from_world = transform.affine().inverse();
                let scale = organ_from_world.matrix3.determinant().abs().cbrt().max(1e-9);
                let at_m = organ_from_world.transform_point3(tip_m).as_dvec3();
                let hit = picker.nearest(at_m, f64::from((band_m + radius_m) * scale))?;
                Some(((hit.distance_m as f32) / scale - radius_m).max(0.0))
            }
        }
    }

    /// Blood that was lost since ever, millilitres.
    pub(super) fn lost_ml(&self, scene: &Scene) -> f64 {
        let in_pools: f64 = scene.pools.iter().map(|(_, water)| water.bled_ml).sum();
        let of_organs: f64 = (self.bodies.iter())
            .filter_map(|body| scene.organs.get(*body).ok()?.5)
            .map(|reactions| reactions.tally().bled_m3 * 1e6)
            .sum();
        in_pools + of_organs
    }

    fn look_at_blood(&mut self, scene: &Scene, facts: &mut Facts, records: &mut Vec<LogRecord>) {
        let bleeders = scene.bleeders.iter().map(|bleeder| f64::from(bleeder.flow_ml_s(0.0)));
        let organs = self.bodies.iter().filter_map(|body| scene.organs.get(*body).ok()?.5);
        let wounds = organs.flat_map(|reactions| reactions.wounds()).map(|wound| wound.rate_m3_per_s() * 1e6);
        let rates: Vec<f64> = bleeders.chain(wounds).filter(|rate_ml_s| *rate_ml_s > 0.0).collect();
        facts.lost_ml = self.lost_ml(scene) - self.lost_before_ml;
        facts.bleeding_ml_s = rates.iter().sum();
        let wet = scene.pools.iter().filter(|(state, _)| state.field_cells > 0);
        facts.hidden = wet.map(|(state, _)| state.hidden_share).reduce(f32::max);
        let record = BleedingRecord {
            lost_ml: facts.lost_ml,
            rate_ml_s: facts.bleeding_ml_s,
            sources: rates.len() as u32,
            hidden: facts.hidden,
        };
        if self.told_blood.as_ref().is_none_or(|told| is_other(told, &record)) {
            self.told_blood = Some(record.clone());
            records.push(LogRecord::Bleeding(record));
        }
    }
}

/// Whether blood has changed so much that it is worth a record.
fn is_other(told: &BleedingRecord, now: &BleedingRecord) -> bool {
    let differs = |a: Option<f32>, b: Option<f32>| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() > 0.02,
        (a, b) => a.is_some() != b.is_some(),
    };
    told.sources != now.sources
        || (now.lost_ml - told.lost_ml).abs() > 0.1
        || (now.rate_ml_s - told.rate_ml_s).abs() > 0.05 * told.rate_ml_s.max(0.01)
        || differs(told.hidden, now.hidden)
}

/// A pose as the log has it, and whether it was none: then the last one that was.
fn logged_pose(pose: &ToolPose, motion: &ToolMotion) -> (ToolPose, bool) {
    let is_place = pose.place.tip_in_world_m.is_finite() && pose.place.world_from_tool.is_finite();
    if is_place {
        return (*pose, false);
    }
    let place = motion.to.unwrap_or_default();
    (ToolPose { place, is_tracked: pose.is_tracked }, pose.is_tracked)
}
