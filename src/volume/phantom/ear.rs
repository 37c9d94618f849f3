//! The parts of the ear in the bone.

use super::anatomy::NEAR;
use super::noise::field;
use super::shapes::{Tube, ball, blend, cone, disc, ellipsoid};
use glam::Vec3;

/// The parts of the ear.
pub(super) struct Ear {
    pub(super) canal: Tube,
    pub(super) facial: Tube,
    pub(super) chorda: Tube,
    pub(super) carotid: Tube,
    cochlea: Tube,
    pub(super) antrum: Vec3,
}

impl Ear {
    pub(super) fn new(shift: f32) -> Self {
        let knot = |x, y, z, radius| (Vec3::new(x, y, z), radius);
        let canal = [
            knot(13.0, -3.5, 30.0, 5.2),
            knot(12.0, -2.6, 14.0, 4.2),
            knot(10.6, -1.6, 6.0, 3.7),
            knot(8.8, -0.6, -1.8, 3.7),
        ];
        // Through the inner canal to the geniculum, along the tympanum, round the second bend and down to the foramen.
        let facial = [
            knot(2.5, 3.0, -27.0, 0.6),
            knot(7.8, 3.8, -16.5, 0.55),
            knot(9.6, 4.4, -12.2, 0.8),
            knot(6.5, 3.1, -9.8, 0.65),
            knot(2.4, 1.4, -6.7, 0.7),
            knot(0.7, -3.0, -5.0, 0.75),
            knot(0.3, -10.0, -3.5, 0.75),
            knot(0.9, -16.0, -2.5, 0.8),
            knot(3.0, -27.0, -1.0, 0.8),
        ];
        let chorda = [
            knot(0.4, -9.0, -3.7, 0.3),
            knot(4.0, -3.0, -3.6, 0.3),
            // Between the malleus and the incus.
            knot(5.6, 1.6, -6.0, 0.3),
            knot(8.2, 2.8, -7.4, 0.3),
            knot(14.0, 0.5, -7.5, 0.3),
        ];
        let carotid = [
            knot(14.8, -16.0, -12.0, 2.5),
            knot(14.8, -10.0, -12.5, 2.5),
            knot(15.4, -6.8, -16.0, 2.5),
            knot(17.5, -4.5, -28.0, 2.4),
        ];
        Self {
            canal: Tube::through(&canal, 3),
            facial: Tube::through(&facial, 4),
            chorda: Tube::through(&chorda, 3),
            carotid: Tube::through(&carotid, 3),
            cochlea: cochlea(),
            antrum: Vec3::new(-1.0, 6.8 + shift, 0.0),
        }
    }

    pub(super) fn antrum_distance(&self, p: Vec3, noise: u32) -> f32 {
        let antrum = ellipsoid(p, self.antrum, Vec3::new(4.2, 3.6, 5.2));
        let aditus = cone(p, (self.antrum + Vec3::new(0.5, -0.4, -1.5), 2.6), (Vec3::new(5.5, 5.0, -6.4), 2.1));
        let smooth = blend(antrum, aditus, 1.5);
        if smooth.abs() > 1.5 { smooth } else { smooth + 0.5 * field(p / 2.2, noise ^ 5) }
    }

    /// The middle ear with the space above it.
    pub(super) fn tympanum(&self, p: Vec3) -> f32 {
        let middle = ellipsoid(p, Vec3::new(8.2, -0.2, -7.1), Vec3::new(5.4, 6.2, 2.6));
        let attic = ellipsoid(p, Vec3::new(6.2, 4.8, -6.8), Vec3::new(4.2, 3.2, 2.9));
        blend(middle, attic, 1.0)
    }

    pub(super) fn drum(&self, p: Vec3) -> f32 {
        let axis = Vec3::new(0.18, -0.1, 0.98).normalize();
        disc(p, Vec3::new(8.5, -0.5, -4.75), axis, 4.1, 0.15)
    }

    pub(super) fn auditory_canal(&self, p: Vec3) -> f32 {
        cone(p, (Vec3::new(1.5, 2.2, -28.0), 3.2), (Vec3::new(7.4, 2.6, -17.0), 2.0))
    }

    /// The spaces of the inner ear: vestibule, three canals and cochlea.
    pub(super) fn labyrinth(&self, p: Vec3) -> f32 {
        let v = Vec3::new;
        let bound = ball(p, v(4.5, 1.5, -13.0), 12.5);
        if bound > NEAR {
            return bound;
        }
        let vestibule = ellipsoid(p, v(4.4, 1.2, -12.8), v(2.1, 2.5, 1.7));
        let lateral = ring(p, v(1.2, 2.5, -10.6), v(0.1, 0.88, 0.45), 3.0);
        let posterior = ring(p, v(-1.6, 0.4, -13.2), v(-0.8, 0.0, -0.6), 2.9);
        let superior = ring(p, v(1.8, 5.0, -13.2), v(0.42, 0.0, -0.91), 3.1);
        vestibule.min(lateral).min(posterior).min(superior).min(self.cochlea.distance(p))
    }
}

/// A semicircular canal, closed to a ring through the vestibule.
fn ring(p: Vec3, centre: Vec3, axis: Vec3, radius: f32) -> f32 {
    const CANAL_RADIUS: f32 = 0.55;
    let axis = axis.normalize();
    let local = p - centre;
    let height = local.dot(axis);
    let out = (local - axis * height).length() - radius;
    out.hypot(height) - CANAL_RADIUS
}

/// Two and a half turns from the vestibule to the tip, which points forwards and outwards.
fn cochlea() -> Tube {
    let axis = Vec3::new(0.5, -0.15, 0.85).normalize();
    let (side, up) = axis.any_orthonormal_pair();
    let centre = Vec3::new(10.4, -0.6, -14.4);
    const PIECES: usize = 30;
    let mut points = vec![(Vec3::new(5.0, 0.0, -12.8), 1.0)];
    points.extend((0..=PIECES).map(|piece| {
        let share = piece as f32 / PIECES as f32;
        let (sin, cos) = (share * 2.5 * std::f32::consts::TAU + 2.6).sin_cos();
        let radius = 3.3 - 2.6 * share;
        (centre + (side * cos + up * sin) * radius + axis * 2.8 * share, 1.0 - 0.5 * share)
    }));
    Tube::straight(&points)
}

pub(super) fn malleus(p: Vec3) -> f32 {
    let v = Vec3::new;
    let head = ellipsoid(p, v(7.6, 4.6, -6.6), v(1.15, 1.35, 1.15));
    let handle = cone(p, (v(7.8, 3.6, -6.3), 0.6), (v(8.6, -1.0, -5.2), 0.38));
    let process = cone(p, (v(8.0, 2.6, -6.1), 0.4), (v(8.4, 2.2, -5.0), 0.3));
    blend(blend(head, handle, 0.8), process, 0.3)
}

pub(super) fn incus(p: Vec3) -> f32 {
    let v = Vec3::new;
    let body = ellipsoid(p, v(5.4, 4.7, -6.8), v(1.25, 1.35, 1.0));
    let short = cone(p, (v(5.0, 4.8, -6.7), 0.75), (v(2.6, 4.5, -6.2), 0.4));
    let long = cone(p, (v(5.4, 4.0, -6.9), 0.65), (v(5.8, 1.0, -7.5), 0.38));
    blend(body, blend(short, long, 0.5), 0.7)
}

pub(super) fn stapes(p: Vec3) -> f32 {
    let v = Vec3::new;
    let head = cone(p, (v(5.85, 0.85, -8.0), 0.4), (v(5.8, 0.85, -8.4), 0.36));
    let crus = |x: f32| cone(p, (v(5.8, 0.85, -8.6), 0.26), (v(5.6 + x, 0.85, -10.4), 0.24));
    let footplate = disc(p, v(5.6, 0.85, -10.6), Vec3::Z, 1.5, 0.17);
    head.min(crus(-1.0)).min(crus(1.0)).min(footplate)
}
