//! A burr that turns in bone.
//!
//! How far it is in follows from how much bone it covers; the force grows with that and points out of the bone. The burr is not the
//! handle: it follows it, but is never deeper in than half its radius. So the side on which it is stays known however hard one
//! pushes, and it gets no further than bone is removed.

use super::bone::{BoneBrick, BurrOverlap, overlap};
use super::{Coupling, SurfaceFeel};
use crate::volume::cut::Burr;
use bevy::reflect::Reflect;
use glam::DVec3;

/// A burr and how it turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct TurningBurr {
    /// Its outline.
    pub burr: Burr,
    /// Turns per minute; by the right hand about the axis, that points from the tip to the hand.
    pub speed_rpm: f64,
    /// Cutting edges.
    pub flutes: u32,
    /// Tangential over normal force.
    pub friction: f64,
    /// Vibration as a share of the normal force.
    pub vibration: f64,
    /// Stiffness of cortical bone under it, newtons per metre; the loop takes no more than the device bears.
    pub stiffness_n_per_m: f64,
}

/// Greatest vibration, newtons.
const MAX_VIBRATION_N: f64 = 0.3;
/// Share of the loop's rate up to which a vibration is shown as it is.
const SHOWN_SHARE: f64 = 0.3;
/// Looks at the bone per tick, at most: enough for two metres per second.
const MOST_STRIDES: f64 = 4.0;
/// A burr goes in as deep as this share of its radius.
const DEEPEST: f64 = 0.5;

/// What a running burr does in bone; for the cutting, the sound and the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct BurrContact {
    /// How deep it is in, metres.
    pub depth_m: f64,
    /// Volume of bone in it, cubic metres.
    pub overlap_m3: f64,
    /// Out of the bone.
    pub normal: DVec3,
    /// With how much it presses, newtons.
    pub force_n: f64,
    /// Hardness of what it is in, as a multiple of cortical bone.
    pub hardness: f64,
    /// The label of most of what it is in.
    pub label: u8,
    /// How often a flute strikes, hertz.
    pub strikes_hz: f64,
}

/// What a tick of it gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BurrPush {
    /// Spring along the normal, on the hand, newtons.
    pub spring_n: DVec3,
    /// What its turning adds: drag to the side and vibration, newtons.
    pub turning_n: DVec3,
    /// Where the burr is, world, metres.
    pub place_m: DVec3,
    /// Whether it is as deep in as it goes.
    pub is_held: bool,
    /// What it does in the bone.
    pub contact: BurrContact,
}

impl TurningBurr {
    /// How often a flute strikes, hertz.
    pub fn strikes_hz(&self) -> f64 {
        (self.speed_rpm.abs() / 60.0) * f64::from(self.flutes.max(1))
    }

    /// What the vibration is shown as in a loop with a period: beyond what that can show, a whole fraction of it.
    pub fn shown_hz(&self, period_s: f64) -> f64 {
        let (strikes, most) = (self.strikes_hz(), SHOWN_SHARE / period_s.max(1e-6));
        if strikes <= most { strikes } else { strikes / (strikes / most).ceil() }
    }

    /// A tick in bone: the burr goes from where it was towards a goal; beyond it the handle may be further. `phase` counts turns of the vibration.
    pub fn push(
        &self,
        brick: &BoneBrick,
        from_m: DVec3,
        goal_m: DVec3,
        handle_m: DVec3,
        axis: DVec3,
        coupling: &Coupling,
        phase: f64,
    ) -> BurrPush {
        let radius_m = f64::from(self.burr.diameter_m) * 0.5;
        let deepest_m = DEEPEST * radius_m;
        let (mut place_m, found) = self.follow(brick, from_m, goal_m, axis, deepest_m);
        let mut push = BurrPush { place_m, ..BurrPush::default() };
        push.contact.strikes_hz = self.strikes_hz();
        if found.depth_m <= 0.0 {
            return push;
        }
        let wanted =
            SurfaceFeel { stiffness_n_per_m: self.stiffness_n_per_m.max(0.0) * found.hardness, ..SurfaceFeel::BONE };
        let (stiffness, _) = coupling.limited(&wanted);
        let (most, _) = coupling.limited(&SurfaceFeel { stiffness_n_per_m: f64::INFINITY, ..wanted });
        push.is_held = found.depth_m >= deepest_m;
        // Beyond the deepest the handle leaves the burr behind, and the coupling draws it back.
        let over_m = (found.depth_m - deepest_m).max(0.0);
        place_m += found.normal * over_m;
        let behind_m = (place_m - handle_m).dot(found.normal).max(0.0);
        let normal_n = stiffness * found.depth_m.min(deepest_m) + most * behind_m;
        push.place_m = place_m;
        push.spring_n = found.normal * normal_n;
        // The burr's surface moves along `axis x outwards`; bone holds it back where it touches, at minus the normal.
        let turn = axis.normalize_or_zero() * self.speed_rpm.signum();
        let aside = turn.cross(found.normal);
        let runs = if self.speed_rpm == 0.0 { 0.0 } else { 1.0 };
        let vibration_n =
            (self.vibration.max(0.0) * normal_n).min(MAX_VIBRATION_N) * (std::f64::consts::TAU * phase).sin();
        let along = aside.try_normalize().unwrap_or(found.normal);
        push.turning_n = runs * (aside * (self.friction.max(0.0) * normal_n) + along * vibration_n);
        push.contact = BurrContact {
            depth_m: found.depth_m.min(deepest_m),
            overlap_m3: found.volume_m3,
            normal: found.normal,
            force_n: normal_n,
            hardness: found.hardness,
            label: found.label,
            strikes_hz: push.contact.strikes_hz,
        };
        push
    }

    /// Goes towards the handle in steps so short that no wall is passed, and slides along what is too deep.
    fn follow(
        &self,
        brick: &BoneBrick,
        from_m: DVec3,
        goal_m: DVec3,
        axis: DVec3,
        deepest_m: f64,
    ) -> (DVec3, BurrOverlap) {
        let stride_m = deepest_m * 0.5;
        let steps = ((goal_m - from_m).length() / stride_m).ceil().clamp(1.0, MOST_STRIDES) as u32;
        let mut place_m = from_m;
        let mut found = BurrOverlap::default();
        for step in 0..steps {
            let (way_m, before_m) = (goal_m - place_m, place_m);
            place_m += (way_m / f64::from(steps - step)).clamp_length_max(stride_m);
            found = overlap(brick, &self.burr, place_m, axis);
            if found.depth_m > deepest_m && step + 1 < steps {
                place_m += found.normal * (found.depth_m - deepest_m);
                // It presses and does not move: looking again finds the same.
                if place_m.distance(before_m) < 0.2 * stride_m {
                    found.depth_m = deepest_m;
                    break;
                }
            }
        }
        (place_m, found)
    }
}
