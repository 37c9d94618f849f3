//! How much of each voxel a moving burr covers.
//!
//! A voxel counts as covered by `clamp(1/2 - d / w, 0, 1)`, with the signed distance `d` of its centre from the burr's surface
//! and the voxel's width `w` in the direction of the surface's normal (that of the ellipsoid within the voxel). Summed over
//! voxels, such a ramp gives a curved body too much: a ball of radius `r` gets `r^3 + r w^2 / 4` in place of `r^3`. The radius
//! is lessened by what makes the sum right, for balls and for rounds of tubes each by its own amount, about `w^2 / (12 r)` and
//! `w^2 / (24 r)`; for the edges of a cylinder its ends are drawn in.

use super::bricks::{LANES, Lanes};
use super::burr::{Burr, BurrShape};
use super::frame::GridFrame;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Part of a burr's way that is cut at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Ends of the tube's middle line, grid frame, millimetres.
    pub ends_mm: [DVec3; 2],
    /// Share of the time that the whole way takes.
    pub time_share: f64,
}

/// Voxels between the bead that a turned body leaves and the surface it should have.
const SCALLOP_VOXELS: f64 = 0.05;
/// Voxels that a stroke looks at before its poses are taken farther apart than [`SCALLOP_VOXELS`] asks: only a leap through the
/// whole volume gets there.
const MAX_VISITS: f64 = (1 << 27) as f64;

/// The parts of a stroke that can touch the grid.
///
/// A ball that moves covers a tube, without error, and long tubes are taken apart to keep what lies around them small. Other
/// shapes are placed so often that the ridges between two places stay below a twentieth of a voxel.
pub(super) fn pieces(
    frame: &GridFrame,
    size: DVec3,
    burr: &Burr,
    from: [DVec3; 2],
    to: [DVec3; 2],
) -> impl Iterator<Item = Piece> + use<> {
    let radius_mm = f64::from(burr.diameter_m) * 500.0;
    let half_mm = match burr.shape {
        BurrShape::Sphere => 0.0,
        BurrShape::Cylinder { length_m } => f64::from(length_m) * 500.0,
        BurrShape::Matchstick { length_m } => (f64::from(length_m) * 500.0 - radius_mm).max(0.0),
    };
    let is_ball = half_mm == 0.0;
    let reach_mm = half_mm + radius_mm + 2.0 * frame.upper.z_axis.length().max(frame.ramp_mm);
    let clipped = frame.clip(size, from[0], to[0], reach_mm);
    let [first, last] = clipped.unwrap_or([0.0, 0.0]);
    let at = move |share: f64| {
        let axis = from[1].lerp(to[1], share).try_normalize().unwrap_or(to[1]);
        (from[0].lerp(to[0], share), axis)
    };
    let ends = move |share: f64| {
        let (centre, axis) = at(share);
        [centre - axis * half_mm, centre + axis * half_mm]
    };
    let way_mm = {
        let (a, b) = (ends(first), ends(last));
        a[0].distance(b[0]).max(a[1].distance(b[1]))
    };
    let count = if way_mm == 0.0 || clipped.is_none() {
        0.0
    } else if is_ball {
        (way_mm / radius_mm.max(4.0 * frame.ramp_mm)).ceil()
    } else {
        let step_mm = (8.0 * radius_mm * SCALLOP_VOXELS * frame.ramp_mm).sqrt().max(0.25 * frame.ramp_mm);
        let visited = (8.0 * (half_mm + radius_mm).powi(3) / frame.voxel_mm3).min(size.element_product());
        (way_mm / step_mm).ceil().min((MAX_VISITS / visited).ceil())
    };
    let spent = last - first;
    let places = match (clipped.is_some(), is_ball) {
        (false, _) => 0,
        (true, true) => (count as usize).max(1),
        (true, false) => count as usize + 1,
    };
    (0..places).map(move |place| {
        if count == 0.0 {
            return Piece { ends_mm: ends(last), time_share: if way_mm == 0.0 { 1.0 } else { spent } };
        }
        let share = |place: usize| if place as f64 == count { last } else { first + spent * place as f64 / count };
        if is_ball {
            let ends_mm = [at(share(place)).0, at(share(place + 1)).0];
            return Piece { ends_mm, time_share: spent / count };
        }
        // The burr is half as long at the first and at the last place as it is at the others.
        let is_outer = place == 0 || place == count as usize;
        Piece { ends_mm: ends(share(place)), time_share: spent / count * if is_outer { 0.5 } else { 1.0 } }
    })
}

/// The line around which a body lies: everything within a distance of it can be touched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tube {
    /// The end that coordinates are relative to, grid frame, millimetres.
    pub origin_mm: DVec3,
    /// From there to the other end.
    pub along_mm: Vec3,
    pub reach_mm: f32,
}

impl Tube {
    /// Least and greatest x on the row at `y` and `z`, relative to the origin.
    #[inline]
    pub fn row_mm(&self, y: f32, z: f32) -> Option<[f32; 2]> {
        let along = self.along_mm;
        let square = along.y * along.y + along.z * along.z;
        let t = if square > 0.0 { ((y * along.y + z * along.z) / square).clamp(0.0, 1.0) } else { 0.0 };
        let (y, z) = (y - t * along.y, z - t * along.z);
        let rest = self.reach_mm * self.reach_mm - y * y - z * z;
        if rest <= 0.0 {
            return None;
        }
        let half = rest.sqrt();
        Some([along.x.min(0.0) - half, along.x.max(0.0) + half])
    }
}

/// What lanes are compared with.
pub(super) trait Body {
    /// What each voxel of a row may keep, not yet clamped to 0..1, and how much more it may keep per millimetre by which the
    /// body shrinks. `x` is relative to the tube's origin, as are `y` and `z`.
    fn keep(&self, x: &Lanes, y: f32, z: f32, keep: &mut Lanes, per_mm: &mut Lanes);
}

#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Width of a voxel by direction.
#[derive(Clone, Copy)]
struct Ramp {
    width_mm: f32,
    /// The upper triangle of the grid's axes, by columns.
    upper: [f32; 6],
}

impl Ramp {
    fn new(frame: &GridFrame) -> Self {
        let [x, y, z] = [frame.upper.x_axis, frame.upper.y_axis, frame.upper.z_axis].map(|axis| axis.as_vec3());
        Self { width_mm: frame.ramp_mm as f32, upper: [x.x, y.x, y.y, z.x, z.y, z.z] }
    }

    /// One over the width along a vector of a length, and the width's square.
    #[inline(always)]
    fn along<const ISOTROPIC: bool>(&self, x: f32, y: f32, z: f32, length: f32) -> (f32, f32) {
        if ISOTROPIC {
            return (1.0 / self.width_mm, self.width_mm * self.width_mm);
        }
        let [a, b, c, d, e, f] = self.upper;
        let (p, q, r) = (a * x, b * x + c * y, d * x + e * y + f * z);
        // The smallest of additions makes it the mean width where the vector is 0.
        let tiny = 1e-6 * self.width_mm;
        let length = length + tiny;
        let scaled = (p * p + q * q + r * r).sqrt() + tiny * self.width_mm;
        let inverse = length / scaled;
        (inverse, 1.0 / (inverse * inverse))
    }
}

/// Radius of a ball whose ramp of a width sums up to a ball of radius `r`.
fn ball_radius(r: f64, w: f64) -> f64 {
    if r.powi(3) < w.powi(3) / 4.0 {
        // The ramp does not reach 0 at the centre: a cone in four dimensions.
        return (4.0 * w * r.powi(3)).powf(0.25) - w / 2.0;
    }
    let mut radius = r - w * w / (12.0 * r);
    for _ in 0..4 {
        let excess = radius.powi(3) + radius * w * w / 4.0 - r.powi(3);
        radius -= excess / (3.0 * radius * radius + w * w / 4.0);
    }
    radius
}

/// The same for a round in a plane.
fn round_radius(r: f64, w: f64) -> f64 {
    if r * r < w * w / 3.0 { (3.0 * w * r * r).cbrt() - w / 2.0 } else { (r * r - w * w / 12.0).sqrt() }
}

/// The same for half of a slab.
fn slab_half(half: f64, w: f64) -> f64 {
    if half < w / 2.0 { (2.0 * half * w).sqrt() - w / 2.0 } else { half }
}

/// A ball that moves along a line, or a matchstick at rest.
pub(super) struct Capsule<const MOVES: bool, const ISOTROPIC: bool> {
    along: Vec3,
    per_square: f32,
    radius: f32,
    /// By how much the radius is lessened, over the width's square.
    ball: f32,
    round: f32,
    ramp: Ramp,
}

impl<const MOVES: bool, const ISOTROPIC: bool> Capsule<MOVES, ISOTROPIC> {
    pub fn new(frame: &GridFrame, radius_mm: f64, tube: &Tube) -> Self {
        let w = frame.ramp_mm;
        let square = tube.along_mm.length_squared();
        let lessened = |radius: f64| ((radius_mm - radius) / (w * w)) as f32;
        let ball = lessened(ball_radius(radius_mm, w));
        Self {
            along: tube.along_mm,
            per_square: if square > 0.0 { 1.0 / square } else { 0.0 },
            radius: radius_mm as f32,
            ball,
            round: if square > 0.0 { lessened(round_radius(radius_mm, w)) } else { ball },
            ramp: Ramp::new(frame),
        }
    }
}

impl<const MOVES: bool, const ISOTROPIC: bool> Body for Capsule<MOVES, ISOTROPIC> {
    #[inline(always)]
    fn keep(&self, x: &Lanes, y: f32, z: f32, keep: &mut Lanes, per_mm: &mut Lanes) {
        let along = self.along;
        let row = y * along.y + z * along.z;
        for lane in 0..LANES {
            let (mut px, mut py, mut pz) = (x[lane], y, z);
            let mut less = self.ball;
            if MOVES {
                let t = (px * along.x + row) * self.per_square;
                // Arithmetic in place of a choice, which would not be vectorised. The round reaches a trifle beyond its ends,
                // so that no voxel falls between those of two pieces.
                less -= (if t * (1.0 - t) > -1e-3 { 1.0 } else { 0.0 }) * (self.ball - self.round);
                let t = lesser(greater(t, 0.0), 1.0);
                px -= t * along.x;
                py -= t * along.y;
                pz -= t * along.z;
            }
            let distance = (px * px + py * py + pz * pz).sqrt();
            let (per_width, square) = self.ramp.along::<ISOTROPIC>(px, py, pz, distance);
            keep[lane] = 0.5 + (distance - self.radius + less * square) * per_width;
            per_mm[lane] = per_width;
        }
    }
}

/// A cylinder with flat ends, at rest.
pub(super) struct Cylinder<const ISOTROPIC: bool> {
    /// Middle, relative to the tube's origin.
    middle: Vec3,
    axis: Vec3,
    radius: f32,
    half: f32,
    round: f32,
    per_width_of_ends: f32,
    ramp: Ramp,
}

impl<const ISOTROPIC: bool> Cylinder<ISOTROPIC> {
    pub fn new(frame: &GridFrame, radius_mm: f64, tube: &Tube) -> Self {
        let ramp = Ramp::new(frame);
        let axis = tube.along_mm.normalize_or_zero();
        let (per_width, square) = ramp.along::<ISOTROPIC>(axis.x, axis.y, axis.z, 1.0);
        let half = f64::from(tube.along_mm.length()) * 0.5;
        let w = frame.ramp_mm;
        // Around an edge the ramp gains what a rounded corner outside and a sharp one inside have over the faces.
        let drawn_in = (1.0 + PI / 4.0) / 12.0 * f64::from(square) / radius_mm;
        Self {
            middle: tube.along_mm * 0.5,
            axis,
            radius: radius_mm as f32,
            half: (slab_half(half, f64::from(1.0 / per_width)) - drawn_in.min(half * 0.5)) as f32,
            round: ((radius_mm - round_radius(radius_mm, w)) / (w * w)) as f32,
            per_width_of_ends: per_width,
            ramp,
        }
    }
}

impl<const ISOTROPIC: bool> Body for Cylinder<ISOTROPIC> {
    #[inline(always)]
    fn keep(&self, x: &Lanes, y: f32, z: f32, keep: &mut Lanes, per_mm: &mut Lanes) {
        let axis = self.axis;
        let (y, z) = (y - self.middle.y, z - self.middle.z);
        for lane in 0..LANES {
            let x = x[lane] - self.middle.x;
            let along = x * axis.x + y * axis.y + z * axis.z;
            let (px, py, pz) = (x - along * axis.x, y - along * axis.y, z - along * axis.z);
            let from_axis = (px * px + py * py + pz * pz).sqrt();
            let (per_width, square) = self.ramp.along::<ISOTROPIC>(px, py, pz, from_axis);
            let beside = from_axis - self.radius + self.round * square;
            let beyond = along.abs() - self.half;
            let (outer_beside, outer_beyond) = (greater(beside, 0.0), greater(beyond, 0.0));
            let outside = (outer_beside * outer_beside + outer_beyond * outer_beyond).sqrt();
            let distance = lesser(greater(beside, beyond), 0.0) + outside;
            let per_width = if beside > beyond { per_width } else { self.per_width_of_ends };
            keep[lane] = 0.5 + distance * per_width;
            per_mm[lane] = per_width;
        }
    }
}
