//! Instruments of a run: which they are, and whether they touch each other.

use super::scene::Scene;
use crate::organ::closest::of_segments;
use crate::scenario::Scenario;
use crate::scenario::log::LoggedTool;
use crate::tools::{Tool, ToolPlace};
use bevy::prelude::*;

/// The instruments that a scenario allows, in its order; where it names none, all that there are, by name.
pub(super) fn find(scenario: &Scenario, scene: &Scene) -> (Vec<Entity>, Vec<LoggedTool>) {
    let called = |name: Option<&Name>, entity: Entity| {
        name.map_or_else(|| format!("tool {}", entity.index()), |name| name.as_str().to_owned())
    };
    let mut there: Vec<(String, Entity, &Tool)> =
        scene.tools.iter().map(|(entity, name, tool, ..)| (called(name, entity), entity, tool)).collect();
    there.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.cmp(&b.1)));
    if !scenario.tools.is_empty() {
        let place = |name: &String| scenario.tools.iter().position(|tool| tool.name == *name);
        there.retain(|(name, ..)| place(name).is_some());
        there.sort_by_key(|(name, ..)| place(name));
        // Two of one name would both be meant; the first is.
        there.dedup_by(|a, b| a.0 == b.0);
    }
    there.into_iter().map(|(name, entity, tool)| (entity, LoggedTool { name, tool: tool.clone() })).unzip()
}

/// The balls and rods of an instrument at a place: ends and radius, world, metres.
fn parts(tool: &Tool, place: &ToolPlace) -> [([Vec3; 2], f32); 2] {
    let (tip_m, back) = (place.tip_in_world_m, place.back_in_world());
    let shaft_m = tip_m + back * tool.geometry.shaft_length_m.max(0.0);
    [([tip_m; 2], tool.tip_radius_m()), ([tip_m, shaft_m], tool.geometry.shaft_radius_m.max(0.0))]
}

/// Pairs of instruments that touch each other.
pub(super) fn collisions(tools: &[Option<(&Tool, ToolPlace)>]) -> Vec<[u32; 2]> {
    let mut found = Vec::new();
    for (a, first) in tools.iter().enumerate() {
        for (b, second) in tools.iter().enumerate().skip(a + 1) {
            let (Some((one, at)), Some((other, beside))) = (first, second) else { continue };
            if !(one.is_solid() && other.is_solid()) {
                continue;
            }
            let touches = parts(one, at).iter().any(|(ends, radius_m)| {
                parts(other, beside).iter().any(|(others, other_m)| {
                    let (from, to) = of_segments(ends.map(|end| end.as_dvec3()), others.map(|end| end.as_dvec3()));
                    from.distance(to) <= f64::from(radius_m + other_m)
                })
            });
            if touches {
                found.push([a as u32, b as u32]);
            }
        }
    }
    found
}
