//! The bone as layers of distance fields.
//!
//! Millimetres from the middle of the cube: x to the front of the head, y to its top, z outwards through the ear, which makes a
//! right ear as the surgeon sees it. Places and sizes are those that anatomy books give for an adult, rounded.

use super::PhantomOptions;
use super::body::{ALL_PARTS, Body, Variation};
use super::cells::{Foam, FoamOptions};
use super::ear::{Ear, incus, malleus, stapes};
use super::interpolated::Interpolated;
use super::noise::field;
use super::shapes::{common, ellipsoid};
use crate::volume::structures::{Structure, Tissue};
use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
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
    /// Whether its surface is blurred over a few voxels, as a scanner does it. Only for what is much thicker than voxels are.
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
        thin(label::SINUS, 60.0, |site| {
            // Where the sinus runs along the vault it lies beneath the bone, elsewhere it ends where it leaves the bone.
            site.along_bone(site.sinus(), 1.2).min(site.sinus().max(site.p.x + 13.0))
        }),
        // Cut off where it comes into the bone.
        thin(label::CAROTID, 70.0, |site| site.ear.carotid.distance(site.p).max(-11.0 - site.p.y)),
        thin(label::AUDITORY_CANAL, 30.0, |site| site.ear.auditory_canal(site.p)),
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
    region: Interpolated,
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
        let region = Interpolated::of(foam.low, foam.high, |p| cell_region(&body, &ear, p));
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
    pub(super) p: Vec3,
    parts: u32,
    body: &'a Body,
    ear: &'a Ear,
    region: &'a Interpolated,
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

    pub(super) fn mass(&self) -> f32 {
        self.once(0, |site| site.body.mass(site.p, site.parts))
    }

    pub(super) fn fossae(&self) -> f32 {
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
