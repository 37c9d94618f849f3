//! A volume: voxels with a place and a meaning.

use super::error::VolumeFault;
use super::grid::VolumeGrid;
use super::structures::{Structure, Structures};
use bevy::asset::Asset;
use bevy::reflect::Reflect;
use glam::UVec3;
use std::sync::Arc;

/// Longest side of a volume, voxels: what graphics hardware takes for a 3D texture.
pub const MAX_SIDE: u32 = 2048;
/// Most voxels of a volume.
pub const MAX_VOXELS: u64 = 1 << 29;

/// Stored numbers, one per voxel, `i` running fastest.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub enum Voxels {
    /// 8 bits without sign.
    U8(Vec<u8>),
    /// 16 bits with sign; Hounsfield units as scanners write them.
    I16(Vec<i16>),
    /// 16 bits without sign.
    U16(Vec<u16>),
    /// Floating point, always finite.
    F32(Vec<f32>),
    /// Colour (sRGB) and opacity; the opacity is the value.
    Rgba(Vec<[u8; 4]>),
}

impl Voxels {
    /// Number of voxels.
    pub fn count(&self) -> usize {
        match self {
            Self::U8(voxels) => voxels.len(),
            Self::I16(voxels) => voxels.len(),
            Self::U16(voxels) => voxels.len(),
            Self::F32(voxels) => voxels.len(),
            Self::Rgba(voxels) => voxels.len(),
        }
    }

    /// The stored number of a voxel by its place in memory; of a colour its opacity, 0 to 255.
    pub fn stored(&self, index: usize) -> f64 {
        match self {
            Self::U8(voxels) => voxels[index].into(),
            Self::I16(voxels) => voxels[index].into(),
            Self::U16(voxels) => voxels[index].into(),
            Self::F32(voxels) => voxels[index].into(),
            Self::Rgba(voxels) => voxels[index][3].into(),
        }
    }

    /// Least and greatest stored number.
    fn stored_range(&self) -> [f64; 2] {
        fn range<T: Copy + PartialOrd + Into<f64>>(voxels: &[T]) -> [f64; 2] {
            let Some(&first) = voxels.first() else { return [0.0, 0.0] };
            let (mut least, mut greatest) = (first, first);
            for &voxel in voxels {
                least = if voxel < least { voxel } else { least };
                greatest = if voxel > greatest { voxel } else { greatest };
            }
            [least.into(), greatest.into()]
        }
        match self {
            Self::U8(voxels) => range(voxels),
            Self::I16(voxels) => range(voxels),
            Self::U16(voxels) => range(voxels),
            Self::F32(voxels) => range(voxels),
            Self::Rgba(_) => [0.0, 255.0],
        }
    }
}

/// A CT volume, or any other scalar or coloured volume: an asset.
///
/// Its *value* at a voxel is `slope * stored + intercept`: Hounsfield units for CT, 0 to 255 for opacities.
#[derive(Asset, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug)]
pub struct Volume {
    grid: VolumeGrid,
    voxels: Arc<Voxels>,
    slope: f64,
    intercept: f64,
    range: [f64; 2],
    structures: Option<Arc<Structures>>,
}

impl Volume {
    /// A volume without structures.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] for sizes of 0, beyond [`MAX_SIDE`] or [`MAX_VOXELS`], another number of voxels than the grid
    /// has, spacings that are 0, not finite or so skewed that the grid is flat, a slope of 0, and voxels that are not finite.
    pub fn new(grid: VolumeGrid, voxels: Voxels, slope: f64, intercept: f64) -> Result<Self, VolumeFault> {
        check_size(grid.size)?;
        let bad = |field: &str, reason: String| Err(VolumeFault::BadGrid { field: field.into(), reason });
        if voxels.count() != grid.count() {
            return bad("size", format!("{} voxels for a grid of {}", voxels.count(), grid.size));
        }
        let spacing_mm = grid.spacing_mm();
        let affine = grid.lps_mm_from_voxel;
        if !affine.is_finite() || !spacing_mm.cmpgt(glam::DVec3::ZERO).all() {
            return bad("spacing", format!("{spacing_mm} mm; every spacing must be a positive number"));
        }
        if grid.voxel_mm3() < 1e-6 * spacing_mm.element_product() {
            return bad("directions", "two axes of the grid have the same direction".into());
        }
        if !(slope.is_finite() && intercept.is_finite() && slope != 0.0) {
            return bad("slope", format!("values of {slope} * stored + {intercept} mean nothing"));
        }
        if let Voxels::F32(voxels) = &voxels
            && let Some(place) = voxels.iter().position(|voxel| !voxel.is_finite())
        {
            return bad("voxels", format!("voxel number {place} is {}", voxels[place]));
        }
        let [a, b] = voxels.stored_range().map(|stored| slope * stored + intercept);
        Ok(Self { grid, voxels: voxels.into(), slope, intercept, range: [a.min(b), a.max(b)], structures: None })
    }

    /// The same volume with its structures named.
    ///
    /// # Errors
    /// [`VolumeFault::BadGrid`] if they belong to a grid of another size.
    pub fn with_structures(mut self, structures: Structures) -> Result<Self, VolumeFault> {
        if structures.labels().len() != self.grid.count() {
            return Err(VolumeFault::BadGrid {
                field: "structures".into(),
                reason: format!("{} labels for a grid of {}", structures.labels().len(), self.grid.size),
            });
        }
        self.structures = Some(structures.into());
        Ok(self)
    }

    /// Sets names, colours and properties of the structures, as many as there are.
    pub(super) fn set_structure_list(&mut self, list: Vec<Structure>) {
        self.structures = self.structures.as_ref().map(|structures| structures.with_list(list).into());
    }

    /// Where the voxels lie.
    pub fn grid(&self) -> &VolumeGrid {
        &self.grid
    }

    /// The stored numbers.
    pub fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Slope and intercept of the values.
    pub fn rescale(&self) -> (f64, f64) {
        (self.slope, self.intercept)
    }

    /// Least and greatest value.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// The named structures, if there are any.
    pub fn structures(&self) -> Option<&Arc<Structures>> {
        self.structures.as_ref()
    }

    /// Value of a voxel by its place in memory ([`VolumeGrid::index`]).
    pub fn value(&self, index: usize) -> f64 {
        self.slope * self.voxels.stored(index) + self.intercept
    }

    /// Value of a voxel as a share of the range, 0 to 1: what textures and lookup tables go by. 0 where all voxels are equal.
    pub fn normalized(&self, index: usize) -> f32 {
        let [least, greatest] = self.range;
        if greatest > least { ((self.value(index) - least) / (greatest - least)) as f32 } else { 0.0 }
    }

    /// blake3 of the grid and the stored numbers: what a saved cut belongs to.
    pub fn content_hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(bytemuck::bytes_of(&self.grid.size.to_array()));
        for number in self.grid.lps_mm_from_voxel.to_cols_array().into_iter().chain([self.slope, self.intercept]) {
            hasher.update(&number.to_le_bytes());
        }
        match &*self.voxels {
            Voxels::U8(voxels) => hasher.update(voxels),
            Voxels::I16(voxels) => hasher.update(bytemuck::cast_slice(voxels)),
            Voxels::U16(voxels) => hasher.update(bytemuck::cast_slice(voxels)),
            Voxels::F32(voxels) => hasher.update(bytemuck::cast_slice(voxels)),
            Voxels::Rgba(voxels) => hasher.update(bytemuck::cast_slice(voxels)),
        };
        *hasher.finalize().as_bytes()
    }
}

/// Refuses sizes that no volume has, before anything is allocated for them.
///
/// # Errors
/// [`VolumeFault::BadGrid`].
pub fn check_size(size: UVec3) -> Result<(), VolumeFault> {
    let bad = |reason: String| Err(VolumeFault::BadGrid { field: "size".into(), reason });
    if size.min_element() == 0 {
        return bad(format!("{size}; no side may be 0"));
    }
    if size.max_element() > MAX_SIDE {
        return bad(format!("{size}; a side has at most {MAX_SIDE} voxels"));
    }
    let count = size.to_array().into_iter().map(u64::from).product::<u64>();
    if count > MAX_VOXELS {
        return bad(format!("{size} are {count} voxels; at most {MAX_VOXELS} are read"));
    }
    Ok(())
}
