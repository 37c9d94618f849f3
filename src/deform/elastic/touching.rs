//! Instruments as constraints of the solver: what touches the surface pushes it out, what holds it takes it along.

use super::contact::{Penetration, penetration, push_out, triangles_near};
use super::solver::{Solver, StepSettings};
use super::surface::{Embedded, TouchSurface};
use super::touch::{BodyEvent, Hold, Press, ToolShape};
use glam::{Affine3A, Quat, Vec3};
use std::collections::BTreeMap;

/// Around the way of an instrument, what of the surface is looked at, metres.
const MARGIN_M: f32 = 0.006;

/// An instrument in this step; the solver's space.
#[derive(Clone, Debug)]
struct Touch {
    press: Press,
    /// Where it was at the beginning.
    from: ToolShape,
    near: Vec<u32>,
    impulse: Vec3,
    /// The deepest contact of the last substep: triangle, and where in it.
    deepest: Option<(u32, Penetration)>,
}

/// Tissue between jaws; the solver's space.
#[derive(Clone, Debug)]
struct Grasp {
    held: Vec<(Embedded, Vec3, Vec3)>,
    from_m: Vec3,
    from_rotation: Quat,
    impulse: Vec3,
    hold: Hold,
    /// The tissue is gone, and the jaws are still closed.
    is_empty: bool,
}

/// What instruments do to a body, from step to step.
#[derive(Clone, Debug, Default)]
pub(super) struct Touching {
    touches: Vec<Touch>,
    /// In the order in which their holds were told.
    grasps: Vec<Grasp>,
    last_shapes: BTreeMap<u32, ToolShape>,
    substeps: u32,
    substep_s: f32,
    /// Shares of free nodes in a place, kept between calls.
    shares: Vec<(u32, f32)>,
}

impl Touching {
    /// Forgets where instruments were, and lets go of all.
    pub fn forget(&mut self) {
        self.grasps.clear();
        self.forget_tools();
    }

    /// There are none any more.
    pub fn forget_tools(&mut self) {
        self.touches.clear();
        self.last_shapes.clear();
    }

    /// Takes the instruments of a step; returns how many inputs are none.
    pub fn begin(
        &mut self,
        presses: &[Press],
        holds: &[Hold],
        to_axes: &Affine3A,
        surface: &TouchSurface,
        solver: &Solver,
        settings: &StepSettings,
    ) -> u64 {
        self.substeps = settings.substeps;
        self.substep_s = (settings.dt_s / f64::from(settings.substeps)) as f32;
        let mut odd = 0;
        self.touches.clear();
        let mut shapes = BTreeMap::new();
        let positions: Vec<Vec3> = if presses.is_empty() {
            Vec::new()
        } else {
            (0..surface.points.len() as u32).map(|point| surface.position(point, solver)).collect()
        };
        for press in presses {
            let shape = press.shape.transformed(to_axes);
            if !(shape.is_sound() && press.friction.is_finite()) || shapes.contains_key(&press.tool) {
                odd += 1;
                continue;
            }
            let from = self.last_shapes.get(&press.tool).copied().unwrap_or(shape);
            let near = triangles_near(&positions, &surface.triangles, [from.axis(), shape.axis()], MARGIN_M);
            shapes.insert(press.tool, shape);
            let press = Press { shape, ..*press };
            self.touches.push(Touch { press, from, near, impulse: Vec3::ZERO, deepest: None });
        }
        self.last_shapes = shapes;

        let turn = Quat::from_mat3a(&to_axes.matrix3).normalize();
        self.grasps.retain(|grasp| holds.iter().any(|hold| hold.tool == grasp.hold.tool));
        for hold in holds {
            let at = to_axes.transform_point3(hold.position_m);
            let rotation = (turn * hold.rotation).normalize();
            let is_sound = at.is_finite()
                && rotation.is_finite()
                && hold.radius_m.is_finite()
                && hold.most_pull_n.is_finite()
                && hold.radius_m > 0.0;
            if !is_sound {
                odd += 1;
                // Jaws that are nowhere hold what they held, where they were.
                continue;
            }
            let moved = Hold { position_m: at, rotation, ..*hold };
            match self.grasps.iter_mut().find(|grasp| grasp.hold.tool == hold.tool) {
                Some(grasp) => grasp.hold = moved,
                None => self.grasps.push(Grasp::close(moved, surface, solver)),
            }
        }
        self.grasps.sort_by_key(|grasp| holds.iter().position(|hold| hold.tool == grasp.hold.tool));
        self.grasps.iter_mut().for_each(|grasp| grasp.impulse = Vec3::ZERO);
        odd
    }

    /// Pushes and pulls in a substep.
    pub fn constrain(&mut self, solver: &mut Solver, surface: &TouchSurface, substep: u32) {
        let share = (substep + 1) as f32 / self.substeps as f32;
        let shares = &mut self.shares;
        for grasp in self.grasps.iter_mut().filter(|grasp| !grasp.is_empty) {
            let at = grasp.from_m.lerp(grasp.hold.position_m, share);
            let rotation = grasp.from_rotation.slerp(grasp.hold.rotation, share);
            for (embedded, rest_m, offset_m) in &grasp.held {
                let is = rest_m + displaced(embedded, solver);
                let goal = at + rotation * *offset_m;
                collect(shares, solver, embedded, 1.0);
                grasp.impulse += shift(shares, solver, goal - is);
                shares.clear();
            }
        }
        for touch in &mut self.touches {
            let before = touch.from.lerp(&touch.press.shape, share - 1.0 / self.substeps as f32);
            let shape = touch.from.lerp(&touch.press.shape, share);
            touch.deepest = None;
            for &face in &touch.near {
                let corners = surface.triangles[face as usize];
                let Some(found) = penetration(corners.map(|point| surface.position(point, solver)), shape.axis())
                else {
                    continue;
                };
                for (corner, weight) in corners.into_iter().zip(found.weights) {
                    collect(shares, solver, &surface.points[corner as usize], weight);
                }
                touch.impulse += shift(shares, solver, found.away * found.depth_m);
                // What slides along is held back by as much as friction can.
                let slid = slide(&corners, &found, surface, solver) - (shape.axis().0 - before.axis().0);
                let slid = slid - found.away * slid.dot(found.away);
                let length = slid.length();
                if length > 0.0 && touch.press.friction > 0.0 {
                    let back = (touch.press.friction * found.depth_m).min(length);
                    touch.impulse += shift(shares, solver, slid * (-back / length));
                }
                shares.clear();
                if touch.deepest.is_none_or(|(_, deepest)| deepest.depth_m < found.depth_m) {
                    touch.deepest = Some((face, found));
                }
            }
        }
    }

    /// Moves the surface's points, body space, out of the instruments.
    pub fn clear(&self, positions_m: &mut [Vec3], triangles: &[[u32; 3]], body_from_axes: &Affine3A) {
        for touch in &self.touches {
            push_out(positions_m, triangles, &touch.near, touch.press.shape.transformed(body_from_axes).axis());
        }
    }

    /// Tells what happened in the step, and lets go of what slips or tears.
    pub fn end(
        &mut self,
        surface: &TouchSurface,
        solver: &Solver,
        body_from_axes: &Affine3A,
        stretch: impl Fn(usize) -> f32,
        tears_at: impl Fn(usize) -> f32,
    ) -> Vec<BodyEvent> {
        let mut events = Vec::new();
        // Impulses were summed as mass times length: a force is that over the substep's square, on average over the substeps.
        let per_square = 1.0 / (self.substep_s * self.substep_s * self.substeps as f32);
        for touch in &self.touches {
            let Some((face, found)) = touch.deepest else { continue };
            let corners = surface.triangles[face as usize];
            let (mut at, mut moved) = (Vec3::ZERO, Vec3::ZERO);
            for (corner, weight) in corners.into_iter().zip(found.weights) {
                let now = surface.position(corner, solver);
                at += now * weight;
                moved += (now - surface.rest_m[corner as usize]) * weight;
            }
            events.push(BodyEvent::Touched {
                tool: touch.press.tool,
                force_n: body_from_axes.transform_vector3(-touch.impulse * per_square),
                depth_m: moved.dot(found.away).max(0.0),
                position_m: body_from_axes.transform_point3(at),
            });
        }
        for grasp in &mut self.grasps {
            grasp.from_m = grasp.hold.position_m;
            grasp.from_rotation = grasp.hold.rotation;
            if grasp.is_empty {
                continue;
            }
            let (tool, pull) = (grasp.hold.tool, -grasp.impulse * per_square);
            let (pull_n, position_m) = (pull.length(), body_from_axes.transform_point3(grasp.from_m));
            let patches = grasp.held.iter().map(|(embedded, ..)| embedded.patch as usize);
            // How near each cell is to tearing, and its stretch.
            let (strain, stretch) = patches
                .map(|patch| ((stretch(patch) - 1.0) / (tears_at(patch) - 1.0).max(1e-6), stretch(patch)))
                .fold((0.0, 1.0), |most: (f32, f32), own| if own.0 > most.0 { own } else { most });
            if strain > 1.0 {
                events.push(BodyEvent::Torn { tool, pull_n, stretch, position_m });
                grasp.let_go();
            } else if pull_n > grasp.hold.most_pull_n {
                events.push(BodyEvent::Slipped { tool, pull_n, position_m });
                grasp.let_go();
            } else {
                let force_n = body_from_axes.transform_vector3(pull);
                events.push(BodyEvent::Held { tool, force_n, stretch });
            }
        }
        events
    }
}

impl Grasp {
    /// Takes hold of what of the surface is between jaws; of the nearest of it where that is less than a point.
    fn close(hold: Hold, surface: &TouchSurface, solver: &Solver) -> Self {
        let mut near: Vec<(f32, usize)> = (0..surface.points.len())
            .map(|point| (surface.position(point as u32, solver).distance(hold.position_m), point))
            .filter(|(distance, _)| *distance <= 3.0 * hold.radius_m)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let within = near.iter().filter(|(distance, _)| *distance <= hold.radius_m).count().max(1);
        let back = hold.rotation.inverse();
        let held: Vec<_> = near
            .iter()
            .take(within)
            .map(|&(_, point)| {
                let offset_m = back * (surface.position(point as u32, solver) - hold.position_m);
                (surface.points[point], surface.rest_m[point], offset_m)
            })
            .collect();
        let is_empty = held.is_empty();
        let (from_m, from_rotation) = (hold.position_m, hold.rotation);
        Self { held, from_m, from_rotation, impulse: Vec3::ZERO, hold, is_empty }
    }

    fn let_go(&mut self) {
        self.held.clear();
        self.is_empty = true;
    }
}

fn displaced(embedded: &Embedded, solver: &mut Solver) -> Vec3 {
    embedded.corners.iter().for_each(|&corner| solver.follow_one(corner));
    embedded.displacement(|node| solver.displacement(node))
}

/// Adds the free nodes of a place, with a weight.
fn collect(shares: &mut Vec<(u32, f32)>, solver: &Solver, embedded: &Embedded, weight: f32) {
    for (&corner, &own) in embedded.corners.iter().zip(&embedded.weights) {
        if own * weight == 0.0 {
            continue;
        }
        solver.free_nodes(corner, |node, share| {
            let by = own * weight * share;
            match shares.iter_mut().find(|(other, _)| *other == node) {
                Some((_, sum)) => *sum += by,
                None => shares.push((node, by)),
            }
        });
    }
}

/// Moves nodes so that the place that depends on them moves by a vector; returns the impulse times the substep.
fn shift(shares: &[(u32, f32)], solver: &mut Solver, by: Vec3) -> Vec3 {
    let mobility: f32 = shares.iter().map(|&(node, share)| share * share * solver.mobility(node)).sum();
    if mobility.is_nan() || mobility <= 0.0 || !by.is_finite() {
        return Vec3::ZERO;
    }
    let impulse = by / mobility;
    for &(node, share) in shares {
        let mobility = solver.mobility(node);
        solver.shift(node, impulse * (share * mobility));
    }
    impulse
}

/// How far a place of a triangle has moved in this substep.
fn slide(corners: &[u32; 3], found: &Penetration, surface: &TouchSurface, solver: &Solver) -> Vec3 {
    let mut moved = Vec3::ZERO;
    for (&corner, weight) in corners.iter().zip(found.weights) {
        let embedded = &surface.points[corner as usize];
        moved += embedded.displacement(|node| solver.displacement(node) - solver.displacement_before(node)) * weight;
    }
    moved
}
