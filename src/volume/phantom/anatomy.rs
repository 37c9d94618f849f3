//! The bone as layers of distance fields.
//!
//! Millimetres from the middle of the cube: x to the front of the head, y to its top, z outwards through the ear, which makes a
//! right ear as the surgeon sees it. Places and sizes are those that anatomy books give for an adult, rounded.

use super::PhantomOptions;
use super::cells::{Foam, FoamOptions};
use super::noise::field;
use super::shapes::{Tube, ball, blend, common, cone, disc, ellipsoid, without};
use crate::volume::structures::{Structure, Tissue};
use glam::{UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use rayon::prelude::*;
use std::cell::Cell;

/// Hounsfield units of air.
pub(super) const AIR_HU: f32 = -1000.0;
/// The label of air.
pub(super) const AIR: u8 = 0;

/// Labels of the structures, in the order of [`structures`].
pub(super) mod label {
    pub const CORTEX: u8 = 1;
    pub const SEPTA: u8 = 2;
    pub const OTIC_CAPSULE: u8 = 3;
    pub const LABYRINTH: u8 = 4;
    pub const FACIAL_NERVE: u8 = 5;
    pub const CHORDA: u8 = 6;
    pub const SINUS: u8 = 7;
    pub const DURA: u8 = 8;
    pub const CAROTID: u8 = 9;
    pub const AUDITORY_CANAL: u8 = 10;
    pub const MALLEUS: u8 = 11;
    pub const INCUS: u8 = 12;
    pub const STAPES: u8 = 13;
    pub const SKIN: u8 = 14;
    /// Number of labels, with air.
    pub const COUNT: usize = 15;
}

/// The structures of the phantom by their labels.
pub(super) fn structures() -> Vec<Structure> {
    use Tissue::{CancellousBone, CorticalBone, Nerve, Soft, Vessel};
    let named = Structure::new;
    vec![
        named("Cortical bone", [236, 221, 190], CorticalBone),
        named("Air cell walls", [226, 200, 163], CancellousBone),
        // The hardest bone of the body.
        named("Otic capsule", [250, 241, 217], CorticalBone).with_hardness(1.3),
        named("Bony labyrinth", [96, 140, 150], Soft).critical(),
        named("Facial nerve", [248, 214, 92], Nerve).critical(),
        named("Chorda tympani", [214, 182, 74], Nerve).critical(),
        named("Sigmoid sinus", [74, 88, 158], Vessel).critical(),
        named("Dura", [158, 172, 192], Tissue::Dura).critical(),
        named("Internal carotid artery", [186, 44, 38], Vessel).with_bleeding(0.2).critical(),
        named("Internal auditory canal", [240, 158, 84], Nerve).critical(),
        named("Malleus", [242, 224, 196], CorticalBone).critical(),
        named("Incus", [236, 212, 178], CorticalBone).critical(),
        named("Stapes", [250, 236, 212], CorticalBone).critical(),
        named("Ear canal skin", [212, 150, 132], Soft),
    ]
}

/// What fills a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filling {
    /// One material.
    Solid,
    /// Air cells, within the body.
    Cells,
}

/// A body that replaces what earlier layers put in its place.
pub(super) struct Layer {
    pub(super) label: u8,
    pub(super) hu: f32,
    pub(super) filling: Filling,
    /// Whether its surface is blurred over two voxels, as a scanner does it. Only for what is much thicker than voxels are.
    pub(super) is_blurred: bool,
    /// Distance to it, millimetres, negative inside. What lies farther away than [`NEAR`] may be given by a lower bound.
    pub(super) distance: fn(&Site) -> f32,
}

/// The layers from first to last.
pub(super) fn layers() -> Vec<Layer> {
    let thin = |label, hu, distance| Layer { label, hu, filling: Filling::Solid, is_blurred: false, distance };
    let thick = |label, hu, distance| Layer { is_blurred: true, ..thin(label, hu, distance) };
    vec![
        // The dura reaches into the bone, which is put on top of it: no gap is left between them.
        thin(label::DURA, 90.0, |site| site.body.dura(site)),
        thick(label::CORTEX, 1650.0, |site| site.bone()),
        thin(label::SEPTA, 1050.0, |site| site.cell_region()),
        Layer { filling: Filling::Cells, ..thin(AIR, AIR_HU, |site| site.cell_region()) },
        thick(AIR, AIR_HU, |site| site.ear.antrum_distance(site.p, site.body.noise)),
        // A plate of bone parts every structure from the cells and spaces around it.
        thin(label::CORTEX, 1500.0, |site| site.in_bone(site.sinus() - SINUS_PLATE)),
        thin(label::CORTEX, 1650.0, |site| site.in_bone(site.canal() - CANAL_WALL)),
        thin(label::OTIC_CAPSULE, 2100.0, |site| site.in_bone(site.labyrinth() - OTIC_CAPSULE)),
        thick(AIR, AIR_HU, |site| site.ear.tympanum(site.p)),
        thin(label::CORTEX, 1750.0, |site| site.in_bone(site.facial() - FACIAL_CANAL)),
        thin(label::SKIN, 40.0, |site| site.in_bone(site.canal() - CANAL_SKIN)),
        thick(AIR, AIR_HU, |site| site.canal()),
        thin(label::SKIN, 60.0, |site| site.ear.drum(site.p)),
        thick(label::SINUS, 60.0, |site| {
            // Where the sinus runs along the vault it lies beneath the bone, elsewhere it ends where it leaves the bone.
            site.along_bone(site.sinus(), 1.2).min(site.sinus().max(site.p.x + 13.0))
        }),
        thick(label::CAROTID, 70.0, |site| site.along_bone(site.ear.carotid.distance(site.p), 0.8)),
        thick(label::AUDITORY_CANAL, 30.0, |site| site.ear.auditory_canal(site.p)),
        thin(label::LABYRINTH, 15.0, |site| site.labyrinth()),
        thin(label::FACIAL_NERVE, 45.0, |site| site.along_bone(site.facial(), 1.5)),
        thin(label::CHORDA, 45.0, |site| site.ear.chorda.distance(site.p)),
        thin(label::MALLEUS, 1800.0, |site| malleus(site.p)),
        thin(label::INCUS, 1800.0, |site| incus(site.p)),
        thin(label::STAPES, 1500.0, |site| stapes(site.p)),
    ]
}

/// Distance beyond which bodies may be given by bounds, millimetres.
pub(super) const NEAR: f32 = 4.0;

/// All that is built before voxels are filled.
pub(super) struct Anatomy {
    body: Body,
    ear: Ear,
    /// Where air cells are found, on a lattice: it has many parts, and nobody sees where exactly it ends.
    region: Lattice,
    pub(super) foam: Foam,
}

impl Anatomy {
    pub(super) fn new(options: &PhantomOptions) -> Self {
        let mut random = Pcg32::seed_from_u64(options.seed);
        let mut within = |amount: f32| random.random_range(-amount..=amount);
        let variation = Variation {
            sinus: Vec3::new(within(0.8), 0.0, within(0.8)),
            tegmen: within(0.8),
            antrum: within(0.4),
            noise: random.random(),
        };
        let (body, ear) = (Body::new(&variation), Ear::new(variation.antrum));
        let foam = foam_options(options);
        let region = Lattice::of(foam.low, foam.high, |p| cell_region(&body, &ear, p));
        let share = options.pneumatization.clamp(0.0, 1.0);
        let foam = Foam::new(foam, |point, chance| {
            let outwards = (0.02 * (point.distance(ear.antrum) - 6.0)).clamp(0.0, 0.3);
            region.at(point) > -0.4 || chance > share * (1.0 - outwards)
        });
        Self { body, ear, region, foam }
    }

    /// Which parts of the bone matter in a ball.
    pub(super) fn parts_near(&self, p: Vec3, radius: f32) -> u32 {
        self.body.parts_near(p, radius)
    }

    /// A place in which only some parts of the bone matter.
    pub(super) fn site(&self, p: Vec3, parts: u32) -> Site<'_> {
        Site { p, parts, body: &self.body, ear: &self.ear, region: &self.region, known: Default::default() }
    }
}

/// A place, and what is known about it so far: several layers ask for the same distances.
pub(super) struct Site<'a> {
    p: Vec3,
    parts: u32,
    body: &'a Body,
    ear: &'a Ear,
    region: &'a Lattice,
    known: [Cell<Option<f32>>; 8],
}

impl Site<'_> {
    fn once(&self, slot: usize, of: impl Fn(&Self) -> f32) -> f32 {
        if let Some(known) = self.known[slot].get() {
            return known;
        }
        let value = of(self);
        self.known[slot].set(Some(value));
        value
    }

    fn mass(&self) -> f32 {
        self.once(0, |site| site.body.mass(site.p, site.parts))
    }

    fn fossae(&self) -> f32 {
        self.once(1, |site| site.body.fossae(site.p))
    }

    fn bone(&self) -> f32 {
        self.once(2, |site| site.body.bone(site))
    }

    fn cell_region(&self) -> f32 {
        self.once(3, |site| site.region.at(site.p))
    }

    fn sinus(&self) -> f32 {
        self.once(4, |site| site.body.sinus.distance(site.p))
    }

    fn canal(&self) -> f32 {
        self.once(5, |site| site.ear.canal.distance(site.p))
    }

    fn facial(&self) -> f32 {
        self.once(6, |site| site.ear.facial.distance(site.p))
    }

    fn labyrinth(&self) -> f32 {
        self.once(7, |site| site.ear.labyrinth(site.p))
    }

    /// The part of a body that lies in bone.
    fn in_bone(&self, body: f32) -> f32 {
        if body > 1.0 { body } else { common(body, self.bone(), 0.3) }
    }

    /// The part of a body that lies in bone or up to some millimetres outside.
    fn along_bone(&self, body: f32, outside: f32) -> f32 {
        if body > 1.0 { body } else { common(body, self.mass() - outside, 0.5) }
    }
}

/// A smooth function on a lattice in a box.
struct Lattice {
    low: Vec3,
    count: UVec3,
    values: Vec<f32>,
}

/// Step of lattices, millimetres.
const LATTICE_MM: f32 = 1.0;

impl Lattice {
    fn of(low: Vec3, high: Vec3, value: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let count = ((high - low) / LATTICE_MM).ceil().as_uvec3() + 1;
        let row = |row: u32| {
            let (j, k) = (row % count.y, row / count.y);
            (0..count.x).map(|i| value(low + UVec3::new(i, j, k).as_vec3() * LATTICE_MM)).collect::<Vec<f32>>()
        };
        let values = (0..count.y * count.z).into_par_iter().flat_map_iter(row).collect();
        Self { low, count, values }
    }

    /// The value between lattice points; outside the box it grows with the distance from it.
    fn at(&self, p: Vec3) -> f32 {
        let place = (p - self.low) / LATTICE_MM;
        let last = (self.count - 1).as_vec3();
        let inside = place.clamp(Vec3::ZERO, last);
        let outside = (place - inside).length() * LATTICE_MM;
        let cell = inside.as_uvec3().min(self.count - 2);
        let f = inside - cell.as_vec3();
        let at = |i, j, k| {
            let node = cell + UVec3::new(i, j, k);
            self.values[((node.z * self.count.y + node.y) * self.count.x + node.x) as usize]
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |j, k| mix(at(0, j, k), at(1, j, k), f.x);
        let face = |k| mix(row(0, k), row(1, k), f.y);
        mix(face(0), face(1), f.z) + outside
    }
}

/// Lengths in the phantom that a seed varies, millimetres.
struct Variation {
    noise: u32,
    sinus: Vec3,
    tegmen: f32,
    antrum: f32,
}

/// Bone between the sinus and the air cells.
const SINUS_PLATE: f32 = 0.8;
/// Bone around the ear canal.
const CANAL_WALL: f32 = 1.5;
/// Skin in the ear canal.
const CANAL_SKIN: f32 = 0.5;
/// Bone around the spaces of the inner ear.
const OTIC_CAPSULE: f32 = 1.5;
/// Bone around the facial nerve.
const FACIAL_CANAL: f32 = 0.7;
/// Bone without cells under the outer surface, and under the dura.
const CORTEX: [f32; 2] = [2.3, 1.0];

fn foam_options(options: &PhantomOptions) -> FoamOptions {
    FoamOptions {
        low: Vec3::new(-20.0, -22.0, -14.0),
        high: Vec3::new(15.0, 16.0, 20.0),
        centre: Vec3::new(-2.0, 4.0, 2.0),
        spacing_mm: [3.3, 1.7],
        shrink_mm: 11.0,
        wall_mm: 0.34,
        open_share: 0.22,
        seed: options.seed ^ 0x5eed_ce11,
    }
}

/// Where air cells are found.
fn cell_region(body: &Body, ear: &Ear, p: Vec3) -> f32 {
    let mastoid = ellipsoid(p, Vec3::new(-2.5, -1.5, 2.0), Vec3::new(16.5, 20.0, 16.5));
    let cortex = body.mass(p, ALL_PARTS) + CORTEX[0] + 0.5 * field(p / 4.0, body.noise ^ 3);
    let under_dura = CORTEX[1] - body.fossae(p);
    let kept = (ear.labyrinth(p) - OTIC_CAPSULE - 0.6).min(ear.canal.distance(p) - CANAL_WALL);
    common(common(mastoid, cortex, 1.0).max(under_dura), -kept, 0.5)
}

/// The bone itself and what runs along it.
struct Body {
    noise: u32,
    tegmen: f32,
    sinus: Tube,
}

impl Body {
    fn new(variation: &Variation) -> Self {
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
    fn mass(&self, p: Vec3, parts: u32) -> f32 {
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
    fn parts_near(&self, p: Vec3, radius: f32) -> u32 {
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
            // The styloid process.
            _ => cone(p, (v(6.0, -9.0, -3.0), 2.8), (v(9.5, -22.0, 0.5), 0.9)),
        }
    }

    /// The bone with its roughness: what a scalpel and an elevator leave of a surface that muscles were attached to.
    fn bone(&self, site: &Site) -> f32 {
        let p = site.p;
        let smooth = without(site.mass(), site.fossae(), 1.5);
        if smooth.abs() > 1.0 {
            return smooth;
        }
        let muscle = 0.5 + 0.5 * (-(p.y + 8.0) / 6.0).clamp(-1.0, 1.0);
        let rough = 0.3 * field(p / 5.0, self.noise)
            + 0.1 * field(p / 2.3, self.noise ^ 4)
            + (0.03 + 0.06 * muscle) * field(p / 1.3, self.noise ^ 1);
        let marks = if p.z > 4.0 { self.marks(p) } else { 0.0 };
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
        depth + 1.6 * dent(Vec3::new(p.x + 14.5, p.y + 2.5, 0.0).length(), 0.75)
    }

    /// The spaces of the brain.
    fn fossae(&self, p: Vec3) -> f32 {
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

    fn dura(&self, site: &Site) -> f32 {
        let fossae = site.fossae();
        let shell = (fossae - 1.2).max(-fossae - DURA);
        if shell > 1.0 { shell } else { shell.max(site.mass() - 0.3) }
    }
}

/// Radii of the fillets between each part of the bone and the parts before it, millimetres.
const FILLETS: [f32; 7] = [5.0, 5.0, 6.0, 3.5, 4.0, 4.0, 1.5];
const ALL_PARTS: u32 = (1 << FILLETS.len()) - 1;

/// Thickness of the skull's vault.
const SQUAMA: f32 = 4.6;
/// Thickness of the dura.
const DURA: f32 = 1.1;

/// The parts of the ear.
struct Ear {
    canal: Tube,
    facial: Tube,
    chorda: Tube,
    carotid: Tube,
    cochlea: Tube,
    antrum: Vec3,
}

impl Ear {
    fn new(shift: f32) -> Self {
        let knot = |x, y, z, radius| (Vec3::new(x, y, z), radius);
        let canal = [knot(13.0, -3.5, 30.0, 5.2), knot(12.0, -2.6, 14.0, 4.2), knot(10.6, -1.6, 6.0, 3.7), knot(8.8, -0.6, -1.8, 3.7)];
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
            knot(6.2, 1.8, -5.7, 0.3),
            knot(9.6, 2.4, -6.0, 0.3),
            knot(14.0, 0.5, -7.5, 0.3),
        ];
        let carotid =
            [knot(14.0, -27.0, -11.0, 2.8), knot(13.5, -9.0, -12.0, 2.8), knot(14.5, -3.0, -15.0, 2.8), knot(17.0, -1.0, -28.0, 2.7)];
        Self {
            canal: Tube::through(&canal, 3),
            facial: Tube::through(&facial, 4),
            chorda: Tube::through(&chorda, 3),
            carotid: Tube::through(&carotid, 3),
            cochlea: cochlea(),
            antrum: Vec3::new(-1.0, 6.8 + shift, 0.0),
        }
    }

    fn antrum_distance(&self, p: Vec3, noise: u32) -> f32 {
        let antrum = ellipsoid(p, self.antrum, Vec3::new(4.2, 3.6, 5.2));
        let aditus = cone(p, (self.antrum + Vec3::new(0.5, -0.4, -1.5), 2.6), (Vec3::new(5.5, 5.0, -6.4), 2.1));
        let smooth = blend(antrum, aditus, 1.5);
        if smooth.abs() > 1.5 { smooth } else { smooth + 0.5 * field(p / 2.2, noise ^ 5) }
    }

    /// The middle ear with the space above it.
    fn tympanum(&self, p: Vec3) -> f32 {
        let middle = ellipsoid(p, Vec3::new(8.2, -0.2, -7.1), Vec3::new(5.4, 6.2, 2.6));
        let attic = ellipsoid(p, Vec3::new(6.2, 4.8, -6.8), Vec3::new(4.2, 3.2, 2.9));
        blend(middle, attic, 1.0)
    }

    fn drum(&self, p: Vec3) -> f32 {
        let axis = Vec3::new(0.18, -0.1, 0.98).normalize();
        disc(p, Vec3::new(8.5, -0.5, -4.75), axis, 4.1, 0.15)
    }

    fn auditory_canal(&self, p: Vec3) -> f32 {
        cone(p, (Vec3::new(1.5, 2.2, -28.0), 3.2), (Vec3::new(7.4, 2.6, -17.0), 2.0))
    }

    /// The spaces of the inner ear: vestibule, three canals and cochlea.
    fn labyrinth(&self, p: Vec3) -> f32 {
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
    Tube::straight(points)
}

fn malleus(p: Vec3) -> f32 {
    let v = Vec3::new;
    let head = ellipsoid(p, v(7.6, 4.6, -6.6), v(1.15, 1.35, 1.15));
    let handle = cone(p, (v(7.8, 3.6, -6.3), 0.6), (v(8.6, -1.0, -5.2), 0.38));
    let process = cone(p, (v(8.0, 2.6, -6.1), 0.4), (v(8.4, 2.2, -5.0), 0.3));
    blend(blend(head, handle, 0.8), process, 0.3)
}

fn incus(p: Vec3) -> f32 {
    let v = Vec3::new;
    let body = ellipsoid(p, v(5.4, 4.7, -6.8), v(1.25, 1.35, 1.0));
    let short = cone(p, (v(5.0, 4.8, -6.7), 0.75), (v(2.6, 4.5, -6.2), 0.4));
    let long = cone(p, (v(5.4, 4.0, -6.9), 0.65), (v(5.8, 1.0, -7.5), 0.38));
    blend(body, blend(short, long, 0.5), 0.7)
}

fn stapes(p: Vec3) -> f32 {
    let v = Vec3::new;
    let head = cone(p, (v(5.85, 0.85, -8.0), 0.4), (v(5.8, 0.85, -8.4), 0.36));
    let crus = |x: f32| cone(p, (v(5.8, 0.85, -8.6), 0.26), (v(5.6 + x, 0.85, -10.4), 0.24));
    let footplate = disc(p, v(5.6, 0.85, -10.6), Vec3::Z, 1.5, 0.17);
    head.min(crus(-1.0)).min(crus(1.0)).min(footplate)
}
