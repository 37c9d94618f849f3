//! Soft bodies: how deep a tool is pressed into them, and what the loop is told of how they answered.
//!
//! The proxy of the loop stays on the surface; a soft body has to be pressed in to answer at all. So the tool goes in behind the
//! proxy as far as the hand is, and the body's answer to that, a force at a depth, comes back as a plane with that stiffness
//! ([`ContactPatch`]). The loop is never without one: until the body has answered, its surface is what the loop feels.

use super::kept::Kept;
use crate::deform::elastic::BodyContact;
use crate::haptics::device::DeviceLimits;
use crate::haptics::force::{ContactPatch, ContactShape, SurfaceFeel};
use crate::haptics::servo::ServoState;
use bevy::math::DVec3;
use bevy::prelude::*;

/// No tool goes deeper into a soft body than this, metres, however far the hand is.
const DEEPEST_M: f64 = 0.02;
/// How far around the tool a plane stands for the body, metres.
const PLANE_M: f64 = 0.02;
/// Softest and stiffest that a body can be, newtons per metre.
const STIFFNESS_N_PER_M: [f64; 2] = [10.0, 5000.0];
/// Share of a newly found stiffness that counts at once; the rest is what it was before.
const NEW_SHARE: f64 = 0.3;

/// Where the tip is, pressed in where what it touches is soft.
pub(super) fn pressed_in(state: &ServoState, limits: &DeviceLimits, is_soft: impl Fn(Entity) -> bool) -> DVec3 {
    let proxy_m = state.proxy_in_world_m;
    let touched = state.contacts().iter().filter(|contact| Entity::try_from_bits(contact.body).is_some_and(&is_soft));
    // In along the firmest of the soft contacts: aside the proxy knows best.
    let Some(firmest) = touched.max_by(|a, b| a.force_n.length_squared().total_cmp(&b.force_n.length_squared())) else {
        return proxy_m;
    };
    let depth_m = (proxy_m - state.tip_in_world_m).dot(firmest.normal).max(0.0);
    // No deeper than where the hand's greatest force would hold it.
    let stiffness = firmest.force_n.length() / firmest.depth_m.max(1e-6);
    let strongest_n = if limits.max_force_n > 0.0 { limits.max_force_n } else { DeviceLimits::INVERSE3.max_force_n };
    let most_m = (strongest_n / stiffness.max(STIFFNESS_N_PER_M[0])).min(DEEPEST_M);
    proxy_m - firmest.normal * depth_m.min(most_m)
}

/// How a body that a tool presses has answered so far; one that does not answer in a step is not touched any more.
pub(super) struct Answer {
    stiffness_n_per_m: f64,
    point_m: DVec3,
    patch: ContactPatch,
}

impl Kept<Answer> {
    /// Takes the answer of a body to a tool with its tip there.
    pub(super) fn take(&mut self, contact: &BodyContact, tip_m: DVec3, tip_radius_m: f64, feel: &SurfaceFeel) {
        let force_n = contact.force_world_n.as_dvec3();
        let (Some(normal), strength_n) = (force_n.try_normalize(), force_n.length()) else { return };
        if !(strength_n > 1e-4 && contact.depth_m > 0.0) {
            return;
        }
        let found = strength_n / f64::from(contact.depth_m).max(2e-4);
        let before = self.get(contact.body);
        let stiffness =
            before.map_or(found, |before| before.stiffness_n_per_m + NEW_SHARE * (found - before.stiffness_n_per_m));
        let stiffness_n_per_m = stiffness.clamp(STIFFNESS_N_PER_M[0], STIFFNESS_N_PER_M[1]);
        // Where the tool would just touch a body with that stiffness.
        let point_m = tip_m + normal * (strength_n / stiffness_n_per_m - tip_radius_m);
        let moved_m = before.map_or(DVec3::ZERO, |before| normal * normal.dot(point_m - before.point_m));
        let shape = ContactShape::Plane { point_m, normal, radius_m: PLANE_M };
        let patch = ContactPatch { shape, moved_m, feel: SurfaceFeel { stiffness_n_per_m, ..*feel } };
        self.insert(contact.body, Answer { stiffness_n_per_m, point_m, patch });
    }

    /// The plane that stands for a body.
    pub(super) fn patch(&self, body: Entity) -> Option<ContactPatch> {
        self.get(body).map(|answer| answer.patch)
    }
}
