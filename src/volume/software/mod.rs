//! Volumes drawn without a GPU: the counterpart of the passes in `shaders/volume`, for tests and for pictures without one.
//!
//! - samples lie on planes across the view at the depths `k * step` (k a whole number), the same planes for every pixel; rays
//!   and slices therefore take the same samples
//! - a sample's value is interpolated trilinearly and looks up colour and opacity for one step; its opacity is multiplied with
//!   the interpolated remaining opacity of the cut; its gradient is interpolated from central differences at the voxels
//! - [`march`] goes front to back, skips empty blocks and stops early; [`composite_slices`] goes back to front through all
//! - [`composite_aligned`] takes slices that are aligned with a deformed volume instead of the view
//! - [`smooth`] evens out normals without crossing edges, [`shade`] lights the picture (paper of 2009, section 5.4)
//!
//! Every pixel is worked out by itself: the result does not depend on the number of threads.

mod aligned;
mod field;
mod march;
mod rays;
mod shade;
mod slices;
mod smooth;

pub use aligned::{AlignedField, composite_aligned};
pub use field::RenderField;
#[cfg(feature = "render")]
pub(crate) use field::encoded;
pub use march::{MarchCounts, MarchScene, VolumeImage, march};
pub use rays::{ViewRays, VoxelRay, plane_in_voxels};
pub use shade::{IncidentLight, shade};
pub use slices::composite_slices;
pub use smooth::{NormalImage, smooth};

/// Opacity from which on a ray is not followed any further.
pub const ENOUGH_OPACITY: f32 = 0.98;
