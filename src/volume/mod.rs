//! CT volumes that are drilled: the asset, its structures, what was removed, and two ways to show it.

mod asset;
pub mod blocks;
mod component;
pub mod critical;
pub mod cut;
mod data;
mod drilling;
pub mod error;
mod grid;
pub mod load;
mod look;
pub mod phantom;
pub mod pick;
mod picking;
#[cfg(feature = "render")]
mod render;
pub mod software;
pub mod structures;
pub mod transfer;
mod watch;

pub use asset::{LoadVolume, VolumeLoadFailed, VolumeLoader};
pub use component::{CtVolume, PrepareCuts};
pub use cut::CutVolume;
pub use data::{MAX_SIDE, MAX_VOXELS, Volume, Voxels, check_size};
pub use drilling::{DrillVolume, DrillVolumes, RemovedTissue, VoxelsRemoved};
pub use grid::{VolumeGrid, VoxelBox};
pub use look::{MAX_CLIP_PLANES, MAX_SMOOTHING_PASSES, SmoothedNormals, VolumeLook, VolumeMethod, WetShading};
pub use picking::{PickedVolume, VolumeHitInWorld, VolumePicking};
#[cfg(feature = "render")]
pub use render::{VolumeRedraws, VolumeUniform};
pub use watch::WatchCritical;

use bevy::prelude::*;

/// Loads volumes, keeps what was cut, and shows them. See the [module](self).
pub struct VolumePlugin;

impl Plugin for VolumePlugin {
    fn build(&self, app: &mut App) {
        asset::build(app);
        component::build(app);
        drilling::build(app);
        picking::build(app);
        watch::build(app);
        #[cfg(feature = "render")]
        render::build(app);
    }
}
