//! From layers to voxels.

use super::anatomy::{AIR, AIR_HU, Anatomy, Filling, Layer, label, layers};
use super::cells::FoamPart;
use super::noise::field;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// Samples along the edge of the blocks in which layers are sorted out.
const SAMPLES_PER_BLOCK: u32 = 8;
/// Distance fields of blended and roughened bodies change by up to this many millimetres per millimetre.
const STEEPNESS: f32 = 1.5;

/// Width over which blurred surfaces fade, in voxels: narrower, and gradients of the values would show the voxels as rings.
const BLUR_VOXELS: f32 = 3.0;
/// But no wider than this, millimetres.
const MOST_BLUR_MM: f32 = 1.2;

/// The voxels of a phantom, `x` fastest.
pub(super) struct Voxels {
    pub(super) hu: Vec<i16>,
    pub(super) labels: Vec<u8>,
    pub(super) solid: Vec<u8>,
}

/// What is evaluated: a cube about the origin.
pub(super) struct Lattice {
    /// Voxels along each side.
    pub(super) size: u32,
    /// Samples along each side of a voxel.
    pub(super) samples: u32,
    /// The cube's side, millimetres.
    pub(super) side_mm: f32,
    pub(super) noise: u32,
}

impl Lattice {
    fn voxel_mm(&self) -> f32 {
        self.side_mm / self.size as f32
    }

    /// Width over which a surface fades. Sharp ones fade over a sample: they are as sharp as whole voxels allow.
    fn blur_mm(&self, is_blurred: bool) -> f32 {
        let voxel = self.voxel_mm();
        if is_blurred { (BLUR_VOXELS * voxel).min(MOST_BLUR_MM) } else { voxel / self.samples as f32 }
    }

    /// The corner of a voxel with the least coordinates, in millimetres.
    fn corner_mm(&self, voxel: UVec3) -> Vec3 {
        voxel.as_vec3() * self.voxel_mm() - 0.5 * self.side_mm
    }
}

/// Shares of the labels in a sample or voxel, and its Hounsfield units.
#[derive(Clone, Copy)]
struct Mixture {
    shares: [f32; label::COUNT],
    hu: f32,
}

impl Mixture {
    fn of(label: u8, hu: f32) -> Self {
        let mut shares = [0.0; label::COUNT];
        shares[usize::from(label)] = 1.0;
        Self { shares, hu }
    }

    /// Puts a layer on top that covers a share of the sample.
    fn cover(&mut self, layer: &Layer, share: f32) {
        self.shares.iter_mut().for_each(|amount| *amount *= 1.0 - share);
        self.shares[usize::from(layer.label)] += share;
        self.hu += (layer.hu - self.hu) * share;
    }
}

/// Evaluates the layers at every voxel. Each voxel is the mean of its samples, and each sample takes in the layers by how far
/// their surfaces pass from its middle, so surfaces have no steps and volumes do not depend on the size of the voxels.
pub(super) fn fill(anatomy: &Anatomy, lattice: &Lattice) -> Voxels {
    let layers = layers();
    let size = lattice.size as usize;
    let count = size.pow(3);
    let mut voxels = Voxels { hu: vec![0; count], labels: vec![0; count], solid: vec![0; count] };
    let block = (SAMPLES_PER_BLOCK / lattice.samples).max(1);
    let slab = block as usize * size * size;
    voxels
        .hu
        .par_chunks_mut(slab)
        .zip(voxels.labels.par_chunks_mut(slab).zip(voxels.solid.par_chunks_mut(slab)))
        .enumerate()
        .for_each(|(slab, (hu, (labels, solid)))| {
            let mut work = Block::default();
            let k = slab as u32 * block;
            for j in (0..lattice.size).step_by(block as usize) {
                for i in (0..lattice.size).step_by(block as usize) {
                    let low = UVec3::new(i, j, k);
                    let high = (low + block).min(UVec3::splat(lattice.size));
                    work.prepare(anatomy, &layers, lattice, low, high);
                    for voxel in voxels_in(low, high) {
                        let mixture = work.voxel(anatomy, &layers, lattice, voxel);
                        let place = ((voxel.z - k) as usize * size + voxel.y as usize) * size + voxel.x as usize;
                        (hu[place], labels[place], solid[place]) = stored(&mixture, lattice, voxel);
                    }
                }
            }
        });
    voxels
}

fn voxels_in(low: UVec3, high: UVec3) -> impl Iterator<Item = UVec3> {
    (low.z..high.z)
        .flat_map(move |z| (low.y..high.y).flat_map(move |y| (low.x..high.x).map(move |x| UVec3::new(x, y, z))))
}

/// Hounsfield units, label and filling of a voxel. The label is that of the tissue with the greatest share, however much air
/// there is beside it.
fn stored(mixture: &Mixture, lattice: &Lattice, voxel: UVec3) -> (i16, u8, u8) {
    let Mixture { shares, mut hu } = *mixture;
    let solid = ((1.0 - shares[usize::from(AIR)]) * 255.0).round().clamp(0.0, 255.0) as u8;
    let mut most = AIR;
    if solid > 0 {
        most = label::CORTEX;
        for other in label::CORTEX..label::COUNT as u8 {
            if shares[usize::from(other)] > shares[usize::from(most)] {
                most = other;
            }
        }
    }
    let bone: f32 = shares[usize::from(label::CORTEX)..=usize::from(label::OTIC_CAPSULE)].iter().sum();
    if bone > 0.0 {
        // Bone is not equally dense throughout.
        const GRAIN_MM: f32 = 1.1;
        const GRAIN_HU: f32 = 110.0;
        let middle = lattice.corner_mm(voxel) + 0.5 * lattice.voxel_mm();
        hu += bone * GRAIN_HU * field(middle / GRAIN_MM, lattice.noise);
    }
    (hu.round() as i16, most, solid)
}

/// A block of voxels with what matters in it.
#[derive(Default)]
struct Block {
    /// What fills all of it before the active layers are put on top.
    base: Option<Mixture>,
    active: Vec<usize>,
    parts: u32,
    cells: FoamPart,
}

impl Block {
    fn prepare(&mut self, anatomy: &Anatomy, layers: &[Layer], lattice: &Lattice, low: UVec3, high: UVec3) {
        let (from, to) = (lattice.corner_mm(low), lattice.corner_mm(high));
        let (middle, radius) = (0.5 * (from + to), 0.5 * from.distance(to));
        let reach = STEEPNESS * radius + 0.5 * lattice.blur_mm(true);
        self.parts = anatomy.parts_near(middle, radius);
        let site = anatomy.site(middle, self.parts);
        let mut base = Mixture::of(AIR, AIR_HU);
        self.active.clear();
        for (place, layer) in layers.iter().enumerate() {
            let distance = (layer.distance)(&site);
            if distance > reach {
                continue;
            }
            if layer.filling == Filling::Solid && distance < -reach {
                base = Mixture::of(layer.label, layer.hu);
                self.active.clear();
            } else {
                self.active.push(place);
            }
        }
        if self.active.iter().any(|&place| layers[place].filling == Filling::Cells) {
            anatomy.foam.gather(middle, radius, &mut self.cells);
        }
        self.base = Some(base);
    }

    fn voxel(&mut self, anatomy: &Anatomy, layers: &[Layer], lattice: &Lattice, voxel: UVec3) -> Mixture {
        let base = self.base.unwrap_or(Mixture::of(AIR, AIR_HU));
        if self.active.is_empty() {
            return base;
        }
        let step = lattice.voxel_mm() / lattice.samples as f32;
        let corner = lattice.corner_mm(voxel);
        if lattice.samples > 1 {
            // Where no sharp surface passes through the voxel, one sample tells everything: the mean of a linear fade is that in
            // the middle.
            let half_diagonal = 0.5 * 3f32.sqrt() * lattice.voxel_mm();
            let (mixture, clearance) = self.sample(anatomy, layers, lattice, corner + 0.5 * lattice.voxel_mm(), base);
            if clearance > half_diagonal {
                return mixture;
            }
        }
        let mut sum = Mixture { shares: [0.0; label::COUNT], hu: 0.0 };
        for sample in voxels_in(UVec3::ZERO, UVec3::splat(lattice.samples)) {
            let p = corner + (sample.as_vec3() + 0.5) * step;
            let (mixture, _) = self.sample(anatomy, layers, lattice, p, base);
            sum.hu += mixture.hu;
            sum.shares.iter_mut().zip(mixture.shares).for_each(|(sum, share)| *sum += share);
        }
        let share = 1.0 / lattice.samples.pow(3) as f32;
        sum.hu *= share;
        sum.shares.iter_mut().for_each(|sum| *sum *= share);
        sum
    }

    /// What is at a place, and how far away the nearest sharp surface begins to fade.
    fn sample(
        &mut self,
        anatomy: &Anatomy,
        layers: &[Layer],
        lattice: &Lattice,
        p: Vec3,
        base: Mixture,
    ) -> (Mixture, f32) {
        let site = anatomy.site(p, self.parts);
        let (mut mixture, mut clearance) = (base, f32::INFINITY);
        for &place in &self.active {
            let layer = &layers[place];
            let blur = lattice.blur_mm(layer.is_blurred);
            let mut distance = (layer.distance)(&site);
            if layer.filling == Filling::Cells && distance < 0.5 * blur {
                distance = distance.max(anatomy.foam.distance(p, &mut self.cells));
            }
            let own_clearance = if layer.is_blurred { f32::INFINITY } else { distance.abs() - 0.5 * blur };
            clearance = clearance.min(own_clearance);
            let share = (0.5 - distance / blur).clamp(0.0, 1.0);
            if share == 1.0 {
                // What is beneath is hidden, and so are its surfaces.
                clearance = own_clearance;
                mixture = Mixture::of(layer.label, layer.hu);
            } else if share > 0.0 {
                mixture.cover(layer, share);
            }
        }
        (mixture, clearance)
    }
}
