//! The bone as a body: its outer shape, its surface and the spaces of the brain.

use super::anatomy::Site;
use super::noise::field;
use super::shapes::{Tube, ball, blend, common, cone, ellipsoid, without};
use glam::Vec3;

/// Lengths in the phantom that a seed varies, millimetres.
pub(super) struct Variation {
    pub(super) noise: u32,
    pub(super) sinus: Vec3,
    pub(super) tegmen: f32,
    pub(super) antrum: f32,
}

/// The bone itself and what runs along it.
pub(super) struct Body {
    pub(super) noise: u32,
    tegmen: f32,
    pub(super) sinus: Tube,
}

impl Body {
    pub(super) fn new(variation: &Variation) -> Self {
        let knot = |x, y, z, radius| (Vec3::new(x, y, z) + variation.sinus, radius);
        // From the transverse sinus over the two bends to the bulb of the jugular vein.
        let sinus = [
            knot(-27.0, 8.5, -1.5, 4.0),
            knot(-19.0, 8.0, 2.0, 4.2),
            knot(-14.0, 3.5, 4.0, 4.4),
            knot(-12.0, -4.0, 2.5, 4.4),
            knot(-9.5, -10.5, -2.5, 4.0),
            knot(-3.5, -12.5, -9.0, 4.0),
            knot(3.0, -9.5, -13.0, 4.4),
            knot(4.5, -15.0, -13.5, 3.6),
            knot(4.5, -27.0, -12.5, 3.6),
        ];
        Self { noise: variation.noise, tegmen: variation.tegmen, sinus: Tube::through(&sinus, 3) }
    }

    /// The bone before the spaces of the brain are taken out of it, made of those parts that matter at a place.
    pub(super) fn mass(&self, p: Vec3, parts: u32) -> f32 {
        let mut mass = f32::INFINITY;
        for (part, fillet) in FILLETS.into_iter().enumerate() {
            if parts & (1 << part) != 0 {
                let distance = self.part(p, part);
                mass = if mass.is_finite() { blend(mass, distance, fillet) } else { distance };
            }
        }
        mass
    }

    /// The parts of the mass that a blend with the others does not swallow anywhere in a ball.
    pub(super) fn parts_near(&self, p: Vec3, radius: f32) -> u32 {
        let distances: [f32; FILLETS.len()] = std::array::from_fn(|part| self.part(p, part));
        let nearest = distances.into_iter().fold(f32::INFINITY, f32::min);
        // Every fillet may pull the surface of the others outwards by a quarter of its radius.
        let slack = 2.0 * 1.5 * radius + 0.25 * FILLETS.iter().sum::<f32>();
        (0..FILLETS.len()).filter(|&part| distances[part] < nearest + FILLETS[part] + slack).map(|part| 1 << part).sum()
    }

    fn part(&self, p: Vec3, part: usize) -> f32 {
        let v = Vec3::new;
        match part {
            // The mastoid with its process.
            0 => ellipsoid(p, v(-4.0, 0.0, 3.0), v(14.5, 16.0, 15.5)),
            1 => cone(p, (v(-3.0, -7.0, 7.0), 9.8), (v(0.0, -16.5, 8.0), 5.2)),
            // The bone around the ear canal.
            2 => cone(p, (v(10.5, -1.5, 7.0), 7.6), (v(7.5, -0.5, -4.0), 7.5)),
            // The root of the zygoma, and the vault of the skull.
            3 => cone(p, (v(5.0, 7.0, 11.0), 5.0), (v(27.0, 5.5, 18.5), 2.6)),
            4 => {
                let skull = self.outer_table(p);
                let border = -0.94 * (p.y - 1.0 - 0.35 * p.x);
                common(common(skull, -(skull + SQUAMA), 1.5), border, 2.0)
            }
            // The pyramid.
            5 => cone(p, (v(0.0, 1.0, 0.0), 12.0), (v(12.0, 2.0, -26.0), 9.0)),
            // The bone around the carotid artery, below the pyramid.
            6 => cone(p, (v(15.0, -6.2, -13.0), 4.2), (v(17.5, -4.0, -26.0), 4.6)),
            // The styloid process.
            _ => cone(p, (v(6.0, -9.0, -3.0), 2.8), (v(9.5, -22.0, 0.5), 0.9)),
        }
    }

    /// The bone with its roughness: what a scalpel and an elevator leave of a surface that muscles were attached to.
    pub(super) fn bone(&self, site: &Site) -> f32 {
        let p = site.p;
        let smooth = without(site.mass(), site.fossae(), 1.5);
        // Beyond the depth of roughness and marks, and of the widest blur on top, the surface is too far away to matter.
        let reach = 1.1 + if p.z > MARKED_Z { 1.0 } else { 0.0 };
        if smooth.abs() > reach {
            return smooth - 0.5 * smooth.signum();
        }
        let muscle = 0.5 + 0.5 * (-(p.y + 8.0) / 6.0).clamp(-1.0, 1.0);
        let rough = 0.3 * field(p / 5.0, self.noise)
            + 0.1 * field(p / 2.3, self.noise ^ 4)
            + (0.03 + 0.06 * muscle) * field(p / 1.3, self.noise ^ 1);
        let marks = if p.z > MARKED_Z { self.marks(p) } else { 0.0 };
        smooth + rough + marks
    }

    /// Depth of what marks the outer surface, seen from outside: sutures, the small holes above and behind the ear canal that
    /// show the way to the antrum, and the hole of a vein.
    fn marks(&self, p: Vec3) -> f32 {
        let dent = |distance: f32, width: f32| (-(distance / width).powi(2)).exp();
        let wave = |place: f32| (1.9 * place).sin() + 0.6 * (4.3 * place + 1.0).sin();
        let mut depth = 0.0;
        // Between the mastoid and the parietal bone, and behind the mastoid.
        if p.x < -7.0 {
            depth += 0.3 * dent(p.y - 10.5 - 0.5 * wave(p.x), 0.35) * ((-7.0 - p.x) / 3.0).min(1.0);
        }
        if p.y < 10.0 && p.x < -12.0 {
            depth += 0.3 * dent(p.x + 18.0 - 0.2 * p.y - 0.45 * wave(p.y), 0.35) * ((10.0 - p.y) / 2.0).min(1.0);
        }
        // Between the mastoid and the bone of the ear canal.
        let behind_canal = dent(p.y + 5.5, 4.0);
        depth += 0.35 * dent(p.x - 5.6 - 0.08 * p.y - 0.15 * wave(p.y), 0.4) * behind_canal;
        let holes = dent(Vec3::new(p.x - 3.6, p.y - 4.6, 0.0).length(), 3.0);
        if holes > 0.05 {
            depth += 1.1 * holes * (field(p / 1.1, self.noise ^ 6) - 0.22).max(0.0);
        }
        depth + 1.4 * dent(Vec3::new(p.x + 14.5, p.y + 2.5, 0.0).length(), 0.75)
    }

    /// The spaces of the brain.
    pub(super) fn fossae(&self, p: Vec3) -> f32 {
        blend(self.middle_fossa(p), self.posterior_fossa(p), 1.0)
    }

    /// Distance to the vault of the skull.
    fn outer_table(&self, p: Vec3) -> f32 {
        ball(p, Vec3::new(2.0, 4.0, -40.0), 54.0)
    }

    /// The space of the temporal lobe, above the tegmen.
    fn middle_fossa(&self, p: Vec3) -> f32 {
        let eminence = 1.6 * (-(Vec3::new(p.x - 1.5, 0.0, p.z + 13.0) / 5.0).length_squared()).exp();
        let tegmen = 12.3 + self.tegmen + 0.1 * p.z + eminence - p.y;
        common(0.97 * tegmen, self.outer_table(p) + SQUAMA, 4.0)
    }

    /// The space of the cerebellum, behind the pyramid.
    fn posterior_fossa(&self, p: Vec3) -> f32 {
        common(12.6 + 0.8 * p.x + 0.6 * p.z, self.outer_table(p) + SQUAMA, 4.0)
    }

    pub(super) fn dura(&self, site: &Site) -> f32 {
        let fossae = site.fossae();
        let shell = (fossae - 1.2).max(-fossae - DURA);
        if shell > 1.0 { shell } else { shell.max(site.mass() - 0.3) }
    }
}

/// Radii of the fillets between each part of the bone and the parts before it, millimetres.
const FILLETS: [f32; 8] = [5.0, 5.0, 6.0, 3.5, 4.0, 4.0, 3.0, 1.5];
/// All parts of the mass.
pub(super) const ALL_PARTS: u32 = (1 << FILLETS.len()) - 1;

/// From here outwards the surface bears marks.
const MARKED_Z: f32 = 4.0;
/// Thickness of the skull's vault.
const SQUAMA: f32 = 4.6;
/// Thickness of the dura.
const DURA: f32 = 1.1;
