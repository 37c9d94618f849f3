//! The proxy: where the tool would be if nothing could be entered, and the force that draws the hand there.
//!
//! **It cannot pass.** Everything solid near it is asked for half-spaces that are free and that hold the proxy. What all of them
//! leave free is convex: the straight way to the place in it nearest to the handle is free, too. So the proxy goes there, asks
//! again, and goes on until it does not move any more. Neither how far the handle is nor how fast it got there matters.
//!
//! **Friction.** A proxy that was in contact stays where it is on the surface while the handle pulls less than the static
//! coefficient times the pressure; beyond that it follows, and lags behind by the dynamic one.

use super::half_space::{HalfSpace, nearest_in_all};
use super::surface::Around;
use super::{ContactPatch, Coupling, SurfacePatch};
use bevy::reflect::Reflect;
use glam::DVec3;

/// How many contacts are told of a step.
pub const MAX_CONTACTS: usize = 4;
/// Straight pieces of a step, at most.
const PIECES: usize = 16;
/// How far the proxy may be above a curved surface at the end of a tick, metres: the next brings it down.
const FLAT_M: f64 = 4e-6;
/// The proxy has arrived when it moves less, metres.
const ARRIVED_M: f64 = 1e-6;

/// A capsule of a tool, relative to its tip and turned as the tool is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ToolCapsule {
    /// Ends of its axis, from the middle of the tip, world axes, metres; twice the same for a ball.
    pub ends_m: [DVec3; 2],
    /// Metres.
    pub radius_m: f64,
}

/// Something solid.
#[derive(Clone, Copy, Debug)]
pub enum Obstacle<'a> {
    /// Triangles.
    Surface(&'a SurfacePatch),
    /// A plane or a ball.
    Contact(&'a ContactPatch),
}

/// What a step looks at: a part of the tool at a place, and how far it may go.
pub(super) struct Reach {
    /// The tip's middle.
    pub(super) place_m: DVec3,
    /// The part's axis there.
    pub(super) segment_m: [DVec3; 2],
    pub(super) radius_m: f64,
    /// How far it may go before it looks again.
    pub(super) step_m: f64,
    /// Where the tip wants to be.
    pub(super) goal_m: DVec3,
    /// How far things have moved.
    pub(super) share: f64,
    pub(super) obstacle: u32,
}

impl Reach {
    /// How far above a plane through the origin the tip must be so that the part is wholly above it.
    pub(super) fn level_m(&self, normal: DVec3) -> f64 {
        let lowest = self.segment_m.map(|end| normal.dot(end - self.place_m));
        self.radius_m - lowest[0].min(lowest[1])
    }

    pub(super) fn middle_m(&self) -> DVec3 {
        (self.segment_m[0] + self.segment_m[1]) * 0.5
    }
}

/// One place at which a tool touches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct ProxyContact {
    /// Which body of the scene.
    pub body: u32,
    /// Which triangle of its patch.
    pub element: u32,
    /// Where, world, metres.
    pub point_m: DVec3,
    /// Away from the body.
    pub normal: DVec3,
    /// Force of the body on the tool, newtons.
    pub force_n: DVec3,
    /// How far the handle is behind the surface, metres.
    pub depth_m: f64,
}

/// What came out of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProxyStep {
    /// Spring, damper and friction, on the hand, newtons.
    pub force_n: DVec3,
    /// Work of what moves by itself on the proxy, joules.
    pub lent_j: f64,
    /// Where it touches.
    pub contacts: [ProxyContact; MAX_CONTACTS],
    /// How many contacts.
    pub count: usize,
    /// Whether it rests on what it touches instead of sliding.
    pub sticks: bool,
}

/// The proxy and what it remembers of the tick before.
#[derive(Clone, Debug)]
pub struct Proxy {
    place_m: DVec3,
    /// Not held by anything until it was once outside.
    is_free: bool,
    touched: Option<Touched>,
    last_force_n: DVec3,
    sticks: bool,
    spaces: Vec<HalfSpace>,
    /// What each part of the tool has near it of each obstacle.
    around: Vec<Around>,
    path: [DVec3; PIECES + 1],
}

#[derive(Clone, Copy, Debug)]
struct Touched {
    obstacle: u32,
    element: u32,
    point_m: DVec3,
}

impl Default for Proxy {
    fn default() -> Self {
        Self {
            place_m: DVec3::ZERO,
            is_free: false,
            touched: None,
            last_force_n: DVec3::ZERO,
            sticks: false,
            // More triangles than these within a tip's reach would be smaller than what can be felt; the vectors grow if need be.
            spaces: Vec::with_capacity(256),
            around: Vec::new(),
            path: [DVec3::ZERO; PIECES + 1],
        }
    }
}

impl Proxy {
    /// Where the tip is shown, world, metres.
    pub fn place_m(&self) -> DVec3 {
        self.place_m
    }

    /// Whether it is outside of everything solid. One that began inside exerts no force until the hand has drawn it out.
    pub fn is_free(&self) -> bool {
        self.is_free
    }

    /// Begins anew where the handle is.
    pub fn reset(&mut self, place_m: DVec3) {
        self.place_m = place_m;
        self.is_free = false;
        self.forget();
    }

    /// Other triangles: what was touched has another number now.
    pub fn forget(&mut self) {
        self.touched = None;
        self.last_force_n = DVec3::ZERO;
        self.sticks = false;
    }

    /// Moves to a place that something else has worked out.
    pub(crate) fn put(&mut self, place_m: DVec3) {
        self.place_m = place_m;
    }

    /// One tick: follows the handle as far as the obstacles let it. `shares` say how far these have moved, before and now.
    pub fn step(
        &mut self,
        goal_m: DVec3,
        velocity_m_per_s: DVec3,
        tool: &[ToolCapsule],
        obstacles: &[Obstacle],
        shares: [f64; 2],
        coupling: &Coupling,
    ) -> ProxyStep {
        let mut done = ProxyStep::default();
        if !goal_m.is_finite() {
            return done;
        }
        if !self.is_free && !self.begin(goal_m, tool, obstacles, shares[1]) {
            return done;
        }
        let carried_m = self.carried(obstacles, shares);
        done.lent_j = self.last_force_n.dot(carried_m);
        self.place_m += carried_m;
        let from_m = self.place_m;
        let was_touching = self.touched.is_some();
        let Some((pushes, aim_m, pieces)) = self.slide(goal_m, tool, obstacles, shares[1]) else {
            self.forget();
            return done;
        };
        let normal_m = aim_m - goal_m;
        let depth_m = normal_m.length();
        self.place_m = aim_m;
        let mut total = (0.0, 0.0, [0.0; 2]);
        for &(_, push_m, index) in pushes.iter().flatten() {
            let feel = self.spaces[index].feel;
            let (stiffness, damping) = coupling.limited(&feel);
            total.0 += stiffness * push_m;
            total.1 += push_m;
            total.2[0] += feel.static_friction * push_m;
            total.2[1] += feel.dynamic_friction * push_m;
            let space = self.spaces[index];
            let closing = velocity_m_per_s.dot(space.normal);
            // A damper never pulls the hand back in.
            let force_n = space.normal * (stiffness * push_m - damping * closing).max(0.0);
            done.force_n += force_n;
            if done.count < MAX_CONTACTS && push_m > 0.0 {
                done.contacts[done.count] = ProxyContact {
                    body: space.obstacle,
                    element: space.element,
                    point_m: space.point_m,
                    normal: space.normal,
                    force_n,
                    depth_m: push_m,
                };
                done.count += 1;
            }
        }
        let touches = done.count > 0;
        if touches && was_touching && total.1 > 0.0 {
            let frictions = total.2.map(|weighted| weighted / total.1);
            self.rub(from_m, depth_m, frictions, pieces);
            done.sticks = self.sticks;
            done.force_n += (self.place_m - aim_m) * (total.0 / total.1);
        } else {
            self.sticks = touches;
        }
        self.touched = (0..done.count)
            .map(|index| &done.contacts[index])
            .max_by(|a, b| a.depth_m.total_cmp(&b.depth_m))
            .map(|contact| Touched { obstacle: contact.body, element: contact.element, point_m: contact.point_m });
        self.last_force_n = done.force_n;
        done
    }

    /// Stick or slip: walks back along the way that the proxy came.
    fn rub(&mut self, from_m: DVec3, depth_m: f64, [resting, sliding]: [f64; 2], pieces: usize) {
        let away_m = self.place_m.distance(from_m);
        let holds = if self.sticks { resting } else { sliding };
        self.sticks = away_m <= holds * depth_m;
        let mut back_m = if self.sticks { f64::INFINITY } else { sliding * depth_m };
        for piece in (0..pieces).rev() {
            let (start, end) = (self.path[piece], self.path[piece + 1]);
            let length = start.distance(end);
            if back_m < length {
                self.place_m = end + (start - end) * (back_m / length);
                return;
            }
            back_m -= length;
            self.place_m = start;
        }
    }

    /// What touches moves: the proxy rides on it.
    fn carried(&self, obstacles: &[Obstacle], shares: [f64; 2]) -> DVec3 {
        let Some(touched) = self.touched else { return DVec3::ZERO };
        match obstacles.get(touched.obstacle as usize) {
            Some(Obstacle::Surface(patch)) => patch.motion_of(touched.element, touched.point_m, shares),
            Some(Obstacle::Contact(contact)) => contact.motion(shares),
            None => DVec3::ZERO,
        }
    }

    fn begin(&mut self, goal_m: DVec3, tool: &[ToolCapsule], obstacles: &[Obstacle], share: f64) -> bool {
        self.place_m = goal_m;
        self.gather(goal_m, 0.0, tool, obstacles, share);
        let touches = self.spaces.iter().any(|space| space.height_m(goal_m) < -1e-6);
        self.is_free = !touches
            && !obstacles.iter().enumerate().any(|(obstacle, of)| match of {
                Obstacle::Contact(_) => false,
                Obstacle::Surface(patch) => patch.is_inside(&Reach {
                    place_m: goal_m,
                    segment_m: [goal_m; 2],
                    radius_m: 0.0,
                    step_m: 0.0,
                    goal_m,
                    share,
                    obstacle: obstacle as u32,
                }),
            });
        self.is_free
    }

    fn gather(&mut self, goal_m: DVec3, step_m: f64, tool: &[ToolCapsule], obstacles: &[Obstacle], share: f64) {
        self.spaces.clear();
        if self.around.len() < tool.len() * obstacles.len() {
            self.around.resize_with(tool.len() * obstacles.len(), Around::default);
        }
        let mut around = self.around.iter_mut();
        for part in tool {
            for (obstacle, of) in obstacles.iter().enumerate() {
                let Some(around) = around.next() else { return };
                let reach = Reach {
                    place_m: self.place_m,
                    segment_m: part.ends_m.map(|end| self.place_m + end),
                    radius_m: part.radius_m,
                    step_m,
                    goal_m,
                    share,
                    obstacle: obstacle as u32,
                };
                match of {
                    Obstacle::Surface(patch) => patch.gather(&reach, around, &mut self.spaces),
                    Obstacle::Contact(contact) => contact.gather(&reach, &mut self.spaces),
                }
            }
        }
    }

    /// Goes to the free place nearest to the goal, piece by piece: what holds it there, where that is, and how many pieces it took.
    /// None where nothing is free.
    fn slide(
        &mut self,
        goal_m: DVec3,
        tool: &[ToolCapsule],
        obstacles: &[Obstacle],
        share: f64,
    ) -> Option<([Option<(DVec3, f64, usize)>; 3], DVec3, usize)> {
        let start_m = self.place_m;
        self.path[0] = start_m;
        let thinnest_m = tool.iter().map(|part| part.radius_m).fold(f64::INFINITY, f64::min).clamp(1e-5, 0.1);
        let mut step_m = 0.25 * thinnest_m;
        let mut holds = [None; 3];
        let mut pieces = 0;
        while pieces < PIECES {
            let place_m = self.place_m;
            let look_m = step_m.min(place_m.distance(goal_m)).max(ARRIVED_M);
            self.gather(goal_m, look_m, tool, obstacles, share);
            let Some(found) = nearest_in_all(goal_m, &self.spaces) else {
                // Squeezed between things that move towards one another: it stays.
                let is_held = self.spaces.iter().any(|space| space.height_m(goal_m) < 0.0);
                self.place_m = place_m;
                return is_held.then_some((holds, place_m, pieces));
            };
            let way_m = found.place_m - place_m;
            let length_m = way_m.length();
            let is_whole = length_m <= look_m;
            let next_m = if is_whole { found.place_m } else { place_m + way_m * (look_m / length_m) };
            let leaves = self.leaves_patch(place_m, next_m, &found.held_by[..found.count], obstacles);
            let next_m = if leaves { place_m } else { next_m };
            pieces += 1;
            self.path[pieces] = next_m;
            self.place_m = next_m;
            for (index, hold) in holds.iter_mut().enumerate() {
                let of = found.held_by[index];
                *hold = (index < found.count).then(|| (self.spaces[of].normal, found.push_m[index], of));
            }
            if is_whole && length_m * length_m < 2.0 * thinnest_m * FLAT_M
                || next_m.distance_squared(place_m) < ARRIVED_M * ARRIVED_M
            {
                break;
            }
            // In the open longer strides are worth a look further ahead.
            step_m = if self.spaces.is_empty() { step_m * 2.0 } else { step_m };
        }
        let aim_m = self.place_m;
        self.place_m = start_m;
        Some((holds, aim_m, pieces))
    }

    /// No further along a surface than its patch knows it.
    fn leaves_patch(&self, from_m: DVec3, to_m: DVec3, held_by: &[usize], obstacles: &[Obstacle]) -> bool {
        held_by.iter().any(|&index| match obstacles.get(self.spaces[index].obstacle as usize) {
            Some(Obstacle::Surface(patch)) => {
                let away_m = to_m.distance(patch.centre_m);
                away_m > patch.reach_m && away_m > from_m.distance(patch.centre_m)
            }
            _ => false,
        })
    }
}
