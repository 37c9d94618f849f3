//! Elastic bodies of volumes: each cell of the lattice is as stiff as what its voxels belong to.

use super::lattice::voxel_from_box;
use super::structures::Tissue;
use super::{Volume, VolumeGrid};
use crate::deform::elastic::{ElasticBody, ElasticCell, ElasticError, ElasticTissue};
use crate::deform::{DeformLattice, Patch};
use glam::{DAffine3, DVec3, UVec3};

/// Most places of a cell at which is looked along each axis.
const MOST_SAMPLES: u32 = 12;

impl Tissue {
    /// How the tissue gives way.
    pub fn typical_elasticity(self) -> ElasticTissue {
        match self {
            Self::CorticalBone | Self::Tooth => ElasticTissue::BONE,
            Self::CancellousBone => ElasticTissue { youngs_modulus_pa: 3e8, ..ElasticTissue::BONE },
            Self::Cartilage => ElasticTissue::CARTILAGE,
            Self::Dura => ElasticTissue { youngs_modulus_pa: 1e6, ..ElasticTissue::SKIN },
            Self::Nerve => ElasticTissue::BRAIN,
            Self::Vessel => ElasticTissue { youngs_modulus_pa: 3e5, ..ElasticTissue::SKIN },
            Self::Soft => ElasticTissue::MUSCLE,
        }
    }
}

impl ElasticBody {
    /// A body over a volume: cells hold as much tissue as their voxels are filled, with the mean stiffness and density of the
    /// structures that these belong to, and the rest from the structure that fills most. A volume without structures is soft
    /// tissue all over.
    ///
    /// # Errors
    /// As [`ElasticBody::new`].
    pub fn of_volume(lattice: &DeformLattice, volume: &Volume) -> Result<Self, ElasticError> {
        let voxel_from_box = voxel_from_box(lattice, volume.grid());
        // Cells are asked for in the order of the patches.
        let mut patches = lattice.tree().patches().iter();
        Self::new(lattice, |_| patches.next().map_or(EMPTY, |patch| cell_of(*patch, volume, &voxel_from_box)))
    }
}

const EMPTY: ElasticCell = ElasticCell { tissue: ElasticTissue::MUSCLE, fill: 0.0 };

fn cell_of(patch: Patch, volume: &Volume, voxel_from_box: &DAffine3) -> ElasticCell {
    let grid = volume.grid();
    let Some(structures) = volume.structures() else { return ElasticCell { fill: 1.0, ..EMPTY } };
    let samples = (grid.size.max_element() >> patch.level).clamp(1, MOST_SAMPLES);
    let mut filled = [0.0_f64; 256];
    for n in 0..samples.pow(3) {
        let at = UVec3::new(n % samples, n / samples % samples, n / (samples * samples));
        let share = (at.as_dvec3() + 0.5) / f64::from(samples);
        let Some(voxel) = voxel_at(grid, voxel_from_box.transform_point3(patch.low() + share * patch.side())) else {
            continue;
        };
        let place = grid.index(voxel);
        filled[usize::from(structures.labels()[place])] += f64::from(structures.solid()[place]) / 255.0;
    }
    let all: f64 = filled.iter().sum();
    if all <= 0.0 {
        return EMPTY;
    }
    let elasticity = |label: usize| {
        let structure = u8::try_from(label).ok().and_then(|label| structures.of_label(label));
        structure.map_or(Tissue::Soft, |structure| structure.tissue).typical_elasticity()
    };
    let mean = |of: fn(&ElasticTissue) -> f32| {
        let parts = filled.iter().enumerate().filter(|(_, share)| **share > 0.0);
        (parts.map(|(label, share)| f64::from(of(&elasticity(label))) * share).sum::<f64>() / all) as f32
    };
    let most = (0..filled.len()).fold(0, |most, label| if filled[label] > filled[most] { label } else { most });
    let tissue = ElasticTissue {
        youngs_modulus_pa: mean(|tissue| tissue.youngs_modulus_pa),
        density_kg_per_m3: mean(|tissue| tissue.density_kg_per_m3),
        ..elasticity(most)
    };
    ElasticCell { tissue, fill: (all / f64::from(samples.pow(3))) as f32 }
}

fn voxel_at(grid: &VolumeGrid, at: DVec3) -> Option<UVec3> {
    let nearest = (at + 0.5).floor();
    let is_inside = nearest.cmpge(DVec3::ZERO).all() && nearest.cmplt(grid.size.as_dvec3()).all();
    is_inside.then(|| nearest.as_uvec3())
}
