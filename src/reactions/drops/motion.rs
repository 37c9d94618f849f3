//! Motion of a drop's head (Neyret, Heiss and Senegas 2002, section 5.3): gravity, surface reaction, friction and
//! retention along the surface, and falling off where the surface cannot hold it.
//!
//! The drop is a point of mass on the surface. Square to the interpolated normal the surface takes every force up, as
//! long as it pushes: what is left is the tangential pull. Linear friction is integrated exactly over each sub-step, so
//! that it may be as stiff as it likes; the pull, which varies with the normal, by the trapezoidal rule (without friction
//! this is the velocity Verlet method). Everything that has a direction goes along by parallel transport.

use super::settings::DropSettings;
use super::walk::{Walk, WalkStop, turned, walk};
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use bevy::reflect::Reflect;
use glam::DVec3;

/// Longest sub-step, seconds. It does not depend on the caller's step, so that the path hardly does.
const LONGEST_SUBSTEP_S: f64 = 1.0 / 240.0;

/// Most sub-steps of a step; where they do not suffice they get longer.
const MOST_SUBSTEPS: u32 = 512;

/// Shortest chord over which the curvature is told from the rounding of single-precision normals, metres.
const LEAST_CHORD_M: f64 = 1e-7;

/// Share of gravity within which a pull away from the surface is rounding.
const PULL_NOISE: f64 = 1e-6;

/// What of a drop moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct DropHead {
    /// Where its middle is.
    pub point: SurfacePoint,
    /// Velocity along the surface, organ space, metres per second.
    pub velocity_m_per_s: DVec3,
    /// Its liquid, cubic metres.
    pub volume_m3: f64,
}

impl DropHead {
    /// Takes the film of a way of this length from the drop and returns its volume, cubic metres: at most all there is.
    pub fn shed(&mut self, settings: &DropSettings, distance_m: f64) -> f64 {
        let film_m3 = settings.film_volume_m3(settings.radius_m(self.volume_m3), distance_m);
        let film_m3 = film_m3.min(self.volume_m3.max(0.0));
        self.volume_m3 -= film_m3;
        film_m3
    }
}

/// What became of a drop in a step.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub enum DropFate {
    /// It moved on.
    Slides {
        /// Length of its path, metres.
        distance_m: f64,
    },
    /// It did not move.
    Sticks,
    /// It fell off: its weight and what throws it outward pulled harder than it clings. The head is where it let go.
    Falls,
    /// It ran over a border of the surface, where its head is now.
    Leaves,
    /// It, its step or the surface under it is no longer made of finite numbers; the head is as it was.
    Lost,
}

impl DropSettings {
    /// Moves a drop for a step of `dt_s` seconds, under gravity given in the organ's space (m/s2).
    ///
    /// A velocity that is not tangential is projected first. The normals may point to either side, in which case drops
    /// run on that side: hand in turned ones for the inner wall of a hollow organ. Film is not shed here; see
    /// [`DropHead::shed`]. Where `dt_s` is not positive, nothing moves.
    pub fn step(
        &self,
        surface: &Surface,
        gravity_m_per_s2: DVec3,
        is_wet: bool,
        head: &mut DropHead,
        dt_s: f64,
    ) -> DropFate {
        let settings = self.tamed();
        let is_sound = gravity_m_per_s2.is_finite() && head.velocity_m_per_s.is_finite() && dt_s.is_finite();
        let vertices = surface.atlas.chart().directions.len();
        let has_face = (head.point.face as usize) < surface.atlas.chart().triangles.len();
        let has_vertices = surface.positions_m.len().min(surface.normals.len()) >= vertices;
        if !(is_sound && has_face && has_vertices && head.volume_m3 >= 0.0 && head.point.barycentric.is_finite()) {
            return DropFate::Lost;
        }
        let radius_m = settings.radius_m(head.volume_m3);
        let laws = Laws {
            gravity_m_per_s2,
            friction_per_s: settings.friction_per_s(radius_m, is_wet),
            retention_m_per_s2: settings.retention_m_per_s2(radius_m, is_wet),
            adhesion_m_per_s2: settings.adhesion_m_per_s2(radius_m),
            stride_m: settings.stride_m,
        };
        match laws.run(surface, *head, dt_s) {
            Some((moved, fate)) if moved.velocity_m_per_s.is_finite() => {
                *head = moved;
                fate
            }
            _ => DropFate::Lost,
        }
    }
}

/// What holds for one drop during one step.
struct Laws {
    gravity_m_per_s2: DVec3,
    friction_per_s: f64,
    retention_m_per_s2: f64,
    adhesion_m_per_s2: f64,
    stride_m: f64,
}

/// A part of a step, as planned from its start.
struct Plan {
    duration_s: f64,
    displacement_m: DVec3,
    /// What pulls besides friction: the tangential pull less the retention, m/s2.
    drive_m_per_s2: DVec3,
    /// Direction of motion, which retention works against; zero without retention.
    forward: DVec3,
    /// Whether retention brings the drop to rest at its end.
    rests: bool,
}

impl Laws {
    /// The drop after a step and what became of it; `None` where the surface is broken.
    fn run(&self, surface: &Surface, mut head: DropHead, dt_s: f64) -> Option<(DropHead, DropFate)> {
        let mut normal = surface.normal(head.point);
        let mut velocity = along(head.velocity_m_per_s, normal);
        let mut pull = along(self.gravity_m_per_s2, normal);
        head.velocity_m_per_s = velocity;
        if self.pulls_off(normal, 0.0) {
            return Some((head, DropFate::Falls));
        }
        // Nothing of no size can move; it would be infinitely slow.
        let can_move = self.friction_per_s.is_finite() && self.retention_m_per_s2.is_finite();
        if !can_move {
            head.velocity_m_per_s = DVec3::ZERO;
            return Some((head, DropFate::Sticks));
        }

        let mut left_s = dt_s;
        let mut distance_m = 0.0;
        for substep in 0..MOST_SUBSTEPS {
            if left_s <= 0.0 || velocity == DVec3::ZERO && pull.length() <= self.retention_m_per_s2 {
                break;
            }
            let least_s = left_s / f64::from(MOST_SUBSTEPS - substep);
            let plan = self.plan(velocity, pull, left_s, least_s);
            left_s -= plan.duration_s;
            let length_m = plan.displacement_m.length();
            let phi = Phi::new(self.friction_per_s * plan.duration_s);
            let mut ended = velocity * phi.decay + plan.drive_m_per_s2 * (plan.duration_s * phi.first);
            if length_m > 0.0 {
                let path = step_over(surface, head.point, normal, plan.displacement_m)?;
                distance_m += path.walked.distance_m;
                let next_pull = along(self.gravity_m_per_s2, path.normal);
                let next_drive = path.back(next_pull) - plan.forward * self.retention_m_per_s2;
                ended += (next_drive - plan.drive_m_per_s2) * (plan.duration_s * phi.second);
                // Retention stops what moves but pushes nothing back.
                let rests = plan.rests || ended.dot(plan.forward) < 0.0;
                velocity = if rests { DVec3::ZERO } else { path.forth(ended) };
                head = DropHead { point: path.walked.point, velocity_m_per_s: velocity, ..head };
                (normal, pull) = (path.normal, next_pull);
                if path.walked.stop == WalkStop::Border {
                    return Some((head, DropFate::Leaves));
                }
                if self.pulls_off(normal, path.curvature_per_m * velocity.length_squared()) {
                    return Some((head, DropFate::Falls));
                }
            } else {
                velocity = if plan.rests { DVec3::ZERO } else { ended };
                head.velocity_m_per_s = velocity;
            }
        }
        let fate = if distance_m > 0.0 { DropFate::Slides { distance_m } } else { DropFate::Sticks };
        Some((head, fate))
    }

    /// Whether weight and centrifugal acceleration pull the drop off.
    fn pulls_off(&self, normal: DVec3, centrifugal_m_per_s2: f64) -> bool {
        let pull = self.gravity_m_per_s2.dot(normal) + centrifugal_m_per_s2;
        pull > self.adhesion_m_per_s2 + PULL_NOISE * self.gravity_m_per_s2.length()
    }

    /// Plans the next sub-step: not longer than a stride unless it would be shorter than `least_s`.
    fn plan(&self, velocity: DVec3, pull: DVec3, left_s: f64, least_s: f64) -> Plan {
        let duration_s = left_s.min(LONGEST_SUBSTEP_S.max(least_s));
        let free_m = self.displacement_m(velocity, pull, duration_s);
        let (forward, drive_m_per_s2) = if self.retention_m_per_s2 > 0.0 {
            // Stiff friction leaves nothing of the old direction, weak friction all of it. But what still has to turn
            // round is first brought to rest.
            let forward = free_m.normalize_or(pull.normalize_or_zero());
            let forward = if velocity.dot(forward) < 0.0 { velocity.normalize_or_zero() } else { forward };
            (forward, pull - forward * self.retention_m_per_s2)
        } else {
            (DVec3::ZERO, pull)
        };
        let mut plan = Plan { duration_s, displacement_m: free_m, drive_m_per_s2, forward, rests: false };
        if let Some(rest_s) = self.time_to_rest_s(velocity.dot(forward), drive_m_per_s2.dot(forward))
            && rest_s <= duration_s
        {
            plan.duration_s = rest_s;
            plan.rests = true;
        }
        plan.displacement_m = self.displacement_m(velocity, drive_m_per_s2, plan.duration_s);
        let strides = plan.displacement_m.length() / self.stride_m;
        if strides > 1.0 && plan.duration_s > least_s {
            plan.duration_s = (plan.duration_s / strides).max(least_s);
            plan.rests = false;
            plan.displacement_m = self.displacement_m(velocity, drive_m_per_s2, plan.duration_s);
        }
        plan
    }

    /// Way under a constant drive.
    fn displacement_m(&self, velocity: DVec3, drive_m_per_s2: DVec3, duration_s: f64) -> DVec3 {
        let phi = Phi::new(self.friction_per_s * duration_s);
        velocity * (duration_s * phi.first) + drive_m_per_s2 * (duration_s * duration_s * phi.second)
    }

    /// When a speed comes to zero under a constant drive against it.
    fn time_to_rest_s(&self, speed_m_per_s: f64, drive_m_per_s2: f64) -> Option<f64> {
        (drive_m_per_s2 < 0.0).then(|| {
            let free_s = speed_m_per_s.max(0.0) / -drive_m_per_s2;
            let share = self.friction_per_s * free_s;
            if share > 0.0 { free_s * (share.ln_1p() / share) } else { free_s }
        })
    }
}

/// The part of a vector along the surface.
fn along(vector: DVec3, normal: DVec3) -> DVec3 {
    vector - normal * normal.dot(vector)
}

/// A walk between two places, with the smooth surface at both.
struct Path {
    walked: Walk,
    /// Interpolated normal at its end.
    normal: DVec3,
    /// Forward and sideways along the smooth surface, at the start and at the end.
    axes: [[DVec3; 2]; 2],
    /// Curvature of the surface in the direction of the walk, positive where it bulges outward, 1/m.
    curvature_per_m: f64,
}

impl Path {
    /// A vector along the surface at the start, carried to the end.
    fn forth(&self, vector: DVec3) -> DVec3 {
        self.axes[1][0] * vector.dot(self.axes[0][0]) + self.axes[1][1] * vector.dot(self.axes[0][1])
    }

    /// A vector along the surface at the end, carried to the start.
    fn back(&self, vector: DVec3) -> DVec3 {
        self.axes[0][0] * vector.dot(self.axes[1][0]) + self.axes[0][1] * vector.dot(self.axes[1][1])
    }
}

/// Walks a displacement along the smooth surface (not zero): `None` where the surface is broken.
fn step_over(surface: &Surface, start: SurfacePoint, normal: DVec3, displacement_m: DVec3) -> Option<Path> {
    // Where drops run on the inner side, the flat faces must be seen from there too.
    let seen_from =
        |side: DVec3, face_normal: DVec3| if side.dot(face_normal) < 0.0 { -face_normal } else { face_normal };
    let start_face_normal = seen_from(normal, surface.face_normal(start.face));
    let walked = walk(surface, start, turned(displacement_m, normal, start_face_normal)).ok()?;
    let end_normal = surface.normal(walked.point);
    let ahead = turned(walked.direction, seen_from(end_normal, walked.face_normal), end_normal);
    let ahead = along(ahead, end_normal).normalize_or_zero();
    let chord = surface.position_m(walked.point) - surface.position_m(start);
    let square = chord.length_squared();
    let curvature_per_m =
        if square > LEAST_CHORD_M * LEAST_CHORD_M { (end_normal - normal).dot(chord) / square } else { 0.0 };
    let forward = displacement_m.normalize_or_zero();
    let axes = [[forward, normal.cross(forward)], [ahead, end_normal.cross(ahead)]];
    Some(Path { walked, normal: end_normal, axes, curvature_per_m })
}

/// Functions of friction times duration that give the exact solution under linear friction (Cox and Matthews 2002).
struct Phi {
    /// What is left of the velocity.
    decay: f64,
    /// Mean of what is left: velocity to way, acceleration to velocity.
    first: f64,
    /// A constant acceleration's share of way, a growing one's of velocity.
    second: f64,
}

impl Phi {
    fn new(friction: f64) -> Self {
        let first = if friction > 0.0 { -(-friction).exp_m1() / friction } else { 1.0 };
        let second = if friction > 0.1 {
            (1.0 - first) / friction
        } else {
            // The difference would lose its digits; this series has the last one by its tenth term.
            (0..10).rev().fold(0.0, |sum, k| (1.0 - friction * sum) / f64::from(k + 2))
        };
        Self { decay: (-friction).exp(), first, second }
    }
}
