//! Bone whose volume is known, and ways to drill it.

use bevy_surgery::volume::cut::{Burr, BurrPose, BurrShape, BurrStroke, CutVolume, Removal};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::{Volume, VolumeGrid, VoxelBox, Voxels};
use glam::{DVec3, UVec3, Vec3};

/// Fast enough for any burr to take all that it covers.
pub const PLENTY_N: f32 = 1e6;
pub const SPEED_RPM: f32 = 40_000.0;
/// Label and hardness of the phantom's shell and of what is within.
pub const SHELL: (u8, f32) = (1, 2.0);
pub const CORE: (u8, f32) = (2, 1.0);
/// Side of the cube that a phantom's grid fills, half of the block in it, and half of its core, millimetres.
pub const SIDE_MM: f64 = 25.6;
pub const BLOCK_MM: f64 = 10.1;
pub const CORE_MM: f64 = 9.2;

pub struct Phantom {
    pub volume: Volume,
    pub structures: Structures,
}

pub fn structure(name: &str, hardness: f32, is_critical: bool) -> Structure {
    Structure {
        name: name.into(),
        colour: [230, 220, 200],
        tissue: Tissue::CorticalBone,
        hardness,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical,
    }
}

impl Phantom {
    /// Bytes of filling and labels by voxel.
    pub fn new(grid: VolumeGrid, mut voxel: impl FnMut(UVec3) -> (u8, u8)) -> Self {
        let size = grid.size;
        let voxels = (0..grid.count() as u32)
            .map(|index| voxel(UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y))));
        let (solid, labels): (Vec<u8>, Vec<u8>) = voxels.unzip();
        let list = vec![structure("shell", SHELL.1, false), structure("core", CORE.1, false)];
        let structures = Structures::new(list, labels, solid.clone()).expect("two structures");
        Self { volume: Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume"), structures }
    }

    /// Nothing but core.
    pub fn solid(grid: VolumeGrid) -> Self {
        Self::new(grid, |_| (255, CORE.0))
    }

    /// A block with a harder shell in a cube of 25.6 mm, filled to the exact share of each voxel.
    pub fn block(side: u32) -> Self {
        let spacing_mm = SIDE_MM / f64::from(side);
        let middle = (f64::from(side) - 1.0) * 0.5;
        let along = |index: u32| (f64::from(index) - middle) * spacing_mm;
        let filled = |index: u32| {
            let at = along(index).abs();
            ((BLOCK_MM - at) / spacing_mm + 0.5).clamp(0.0, 1.0)
        };
        let axis: Vec<(f64, f64)> = (0..side).map(|index| (filled(index), along(index).abs())).collect();
        Self::new(VolumeGrid::upright(UVec3::splat(side), DVec3::splat(spacing_mm)), |voxel| {
            let [x, y, z] = voxel.to_array().map(|index| axis[index as usize]);
            let is_core = x.1.max(y.1).max(z.1) < CORE_MM;
            ((x.0 * y.0 * z.0 * 255.0).round() as u8, if is_core { CORE.0 } else { SHELL.0 })
        })
    }

    pub fn grid(&self) -> &VolumeGrid {
        self.volume.grid()
    }

    pub fn cut(&self) -> CutVolume {
        CutVolume::new(self.grid().size)
    }

    pub fn drill(&self, cut: &mut CutVolume, stroke: &BurrStroke, dt_s: f64) -> Removal {
        cut.drill(&self.volume, &self.structures, stroke, dt_s)
    }

    /// Drills along a path in millimetres of the volume's space, by time.
    pub fn follow(
        &self,
        cut: &mut CutVolume,
        burr: Burr,
        force_n: f32,
        steps_per_s: u32,
        seconds: f64,
        path_mm: impl Fn(f64) -> DVec3,
    ) -> Removal {
        let steps = (seconds * f64::from(steps_per_s)).round() as u32;
        let dt_s = seconds / f64::from(steps);
        let pose = |step: u32| upright(path_mm(f64::from(step) * dt_s));
        let mut all = Removal::default();
        for step in 0..steps {
            let stroke = BurrStroke { burr, from: pose(step), to: pose(step + 1), force_n, speed_rpm: SPEED_RPM };
            add(&mut all, &self.drill(cut, &stroke, dt_s));
        }
        all
    }
}

/// Adds a step's removal; the centroid is the last step's.
pub fn add(all: &mut Removal, step: &Removal) {
    for &(label, mm3) in &step.by_label_mm3 {
        match all.by_label_mm3.iter_mut().find(|(known, _)| *known == label) {
            Some((_, sum)) => *sum += mm3,
            None => all.by_label_mm3.push((label, mm3)),
        }
    }
    all.by_label_mm3.sort_by_key(|&(label, _)| label);
    all.total_mm3 += step.total_mm3;
    all.centroid_m = step.centroid_m.or(all.centroid_m);
    all.changed = match (all.changed, step.changed) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    };
}

pub fn ball(diameter_mm: f32) -> Burr {
    Burr { diameter_m: diameter_mm * 1e-3, ..Burr::default() }
}

pub fn cylinder(diameter_mm: f32, length_mm: f32) -> Burr {
    Burr { shape: BurrShape::Cylinder { length_m: length_mm * 1e-3 }, ..ball(diameter_mm) }
}

pub fn matchstick(diameter_mm: f32, length_mm: f32) -> Burr {
    Burr { shape: BurrShape::Matchstick { length_m: length_mm * 1e-3 }, ..ball(diameter_mm) }
}

pub fn upright(centre_mm: DVec3) -> BurrPose {
    BurrPose { centre_m: (centre_mm * 1e-3).as_vec3(), axis: Vec3::Y }
}

pub fn resting(burr: Burr, pose: BurrPose, force_n: f32) -> BurrStroke {
    BurrStroke { burr, from: pose, to: pose, force_n, speed_rpm: SPEED_RPM }
}

/// All voxels of a cut, as they are.
pub fn all_of(cut: &CutVolume) -> Vec<f32> {
    let size = cut.size();
    let voxels = (0..size.x * size.y * size.z)
        .map(|index| UVec3::new(index % size.x, index / size.x % size.y, index / (size.x * size.y)));
    voxels.map(|voxel| cut.remaining(voxel)).collect()
}

pub fn whole(cut: &CutVolume) -> VoxelBox {
    VoxelBox { min: UVec3::ZERO, max: cut.size() }
}
