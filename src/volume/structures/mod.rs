//! Named parts of a volume: which voxel belongs to what, how hard it is and how it bleeds.

mod automatic;
mod changes;
mod labels;
mod palette;
mod thresholds;
mod typical;

pub use changes::StructureChanges;
pub(super) use changes::build;
pub use palette::{Palette, SnapReport};
pub use thresholds::{SolidRamp, ThresholdBand, Thresholds};

use super::error::VolumeFault;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

/// What a structure is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub enum Tissue {
    /// Dense bone: the cortex, the ossicles, the labyrinth.
    #[default]
    CorticalBone,
    /// Bone with marrow.
    CancellousBone,
    /// Teeth.
    Tooth,
    /// Cartilage.
    Cartilage,
    /// A nerve with its sheath.
    Nerve,
    /// A vessel that bleeds when opened.
    Vessel,
    /// The hard membrane around the brain.
    Dura,
    /// Anything soft beside these.
    Soft,
}

/// A named part of a volume.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct Structure {
    /// Its name, as a report shows it.
    pub name: String,
    /// Colour, sRGB.
    pub colour: [u8; 3],
    /// What it is made of.
    pub tissue: Tissue,
    /// How hard it is to remove, as a multiple of cortical bone; positive.
    pub hardness: f32,
    /// Blood that a cubic millimetre of it lets out per second after it was opened, millilitres.
    pub bleeding_ml_per_s_mm3: f32,
    /// Whether it must not be touched: warnings are given near it.
    pub is_critical: bool,
}

/// The structures of a volume, and which voxel belongs to which.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct Structures {
    list: Vec<Structure>,
    labels: Vec<u8>,
    solid: Vec<u8>,
}

impl Structure {
    /// Whether its numbers make sense.
    fn check(&self) -> Result<(), VolumeFault> {
        let bad = |field: &str, reason: String| Err(VolumeFault::BadGrid { field: field.into(), reason });
        let Self { name, hardness, bleeding_ml_per_s_mm3: rate, .. } = self;
        if !(hardness.is_finite() && *hardness > 0.0) {
            return bad("hardness", format!("{hardness} of {name} is not a positive number"));
        }
        if !(rate.is_finite() && *rate >= 0.0) {
            return bad("bleeding_ml_per_s_mm3", format!("{rate} of {name} is not a number from 0 upwards"));
        }
        Ok(())
    }
}

impl Structures {
    /// Structures by their labels: a voxel with label `n > 0` belongs to `list[n - 1]`, one with label 0 to none of them.
    /// `solid` says how much of each voxel is filled with tissue that can be removed: 0 for air, 255 for all of it, less where a
    /// surface passes through the voxel. Both have one entry per voxel, `i` running fastest.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] where `labels` and `solid` differ in length, a label has no structure, more than 255 structures
    /// are named, or a hardness or bleeding rate is not a positive number (a rate may be 0).
    pub fn new(list: Vec<Structure>, labels: Vec<u8>, solid: Vec<u8>) -> Result<Self, VolumeFault> {
        let bad = |field: &str, reason: String| Err(VolumeFault::BadGrid { field: field.into(), reason });
        if list.len() > 255 {
            return bad("structures", format!("{} are named; at most 255 can be", list.len()));
        }
        if labels.len() != solid.len() {
            return bad("structures", format!("{} labels for {} voxels", labels.len(), solid.len()));
        }
        if let Some(&label) = labels.iter().max()
            && usize::from(label) > list.len()
        {
            return bad("labels", format!("label {label} is used, but only {} structures are named", list.len()));
        }
        for structure in &list {
            structure.check()?;
        }
        Ok(Self { list, labels, solid })
    }

    /// The structures; label `n` belongs to the entry `n - 1`.
    pub fn list(&self) -> &[Structure] {
        &self.list
    }

    /// Label of each voxel, 0 for none.
    pub fn labels(&self) -> &[u8] {
        &self.labels
    }

    /// How much of each voxel is filled, 0 to 255.
    pub fn solid(&self) -> &[u8] {
        &self.solid
    }

    /// The structure with a label.
    pub fn of_label(&self, label: u8) -> Option<&Structure> {
        self.list.get(usize::from(label).checked_sub(1)?)
    }

    /// The same voxels with another list of as many structures.
    pub(super) fn with_list(&self, list: Vec<Structure>) -> Self {
        debug_assert_eq!(list.len(), self.list.len());
        Self { list, labels: self.labels.clone(), solid: self.solid.clone() }
    }

    /// The label of the structure with a name.
    pub fn label_of(&self, name: &str) -> Option<u8> {
        self.list.iter().position(|structure| structure.name == name).map(|place| place as u8 + 1)
    }
}
