//! CT volumes that are drilled: the asset, its structures, what was removed, and two ways to show it.

pub mod aligned;
mod asset;
pub mod blocks;
mod component;
pub mod critical;
pub mod cut;
mod data;
mod deformed;
mod drilling;
mod elastic;
pub mod error;
mod grid;
mod lattice;
pub mod load;
mod look;
mod near;
pub mod phantom;
pub mod pick;
mod pick_deformed;
mod picking;
#[cfg(feature = "render")]
mod render;
pub(crate) mod rest;
mod soft;
pub mod software;
pub mod structures;
pub mod transfer;
mod warp;
mod watch;

pub use asset::{LoadVolume, MakePhantom, VolumeLoadFailed, VolumeLoader};
#[cfg(feature = "scenes")]
pub(crate) use component::has_suited_transfer;
pub use component::{CtVolume, PrepareCuts};
pub use cut::CutVolume;
pub use data::{MAX_SIDE, MAX_VOXELS, Volume, Voxels, check_size};
pub use deformed::{DeformedVolume, FollowLattices};
pub use drilling::{DrillVolume, DrillVolumes, RemovedTissue, VoxelsRemoved};
pub use grid::{VolumeGrid, VoxelBox};
pub use lattice::VoxelLattice;
pub use look::{MAX_CLIP_PLANES, MAX_SMOOTHING_PASSES, SmoothedNormals, VolumeLook, VolumeMethod, WetShading};
pub use near::MatterHit;
pub use picking::{PickedVolume, VolumeHitInWorld, VolumePicking};
#[cfg(feature = "render")]
pub use render::{AlignedUniform, DeformUniform, PatchFramesTexel, PatchRectTexel, VolumeRedraws, VolumeUniform};
pub use soft::SoftVolume;
pub use watch::WatchCritical;

use bevy::prelude::*;

/// Makes the types known that are neither components nor in messages.
fn register(app: &mut App) {
    app.register_type::<MatterHit>()
        .register_type::<VolumeGrid>()
        .register_type::<VoxelBox>()
        .register_type::<VoxelLattice>()
        .register_type::<Voxels>()
        .register_type::<CutVolume>()
        .register_type::<cut::CutError>()
        .register_type::<cut::BurrError>()
        .register_type::<cut::Removal>()
        .register_type::<error::VolumeError>()
        .register_type::<error::VolumeFault>()
        .register_type::<load::VolumeFormat>()
        .register_type::<load::LoadReport>()
        .register_type::<phantom::PhantomOptions>()
        .register_type::<blocks::BlockRanges>()
        .register_type::<blocks::BlockDistances>()
        .register_type::<critical::StructureDistance>();
    structures::build(app);
    app.register_type::<structures::Structure>()
        .register_type::<structures::Structures>()
        .register_type::<structures::Tissue>()
        .register_type::<structures::Palette>()
        .register_type::<structures::SnapReport>()
        .register_type::<structures::SolidRamp>()
        .register_type::<structures::ThresholdBand>()
        .register_type::<structures::Thresholds>()
        .register_type::<transfer::ControlPoint>()
        .register_type::<transfer::ValueScale>()
        .register_type::<transfer::ColourSource>()
        .register_type::<transfer::TransferFunction>()
        .register_type::<transfer::TransferTable>();
    app.register_type::<software::RenderField>()
        .register_type::<software::NormalImage>()
        .register_type::<software::VolumeImage>()
        .register_type::<software::MarchCounts>()
        .register_type::<software::ViewRays>()
        .register_type::<software::VoxelRay>()
        .register_type::<software::IncidentLight>();
    app.register_type::<aligned::PatchFrames>()
        .register_type::<aligned::PatchRect>()
        .register_type::<aligned::PolygonVertex>()
        .register_type::<aligned::PatchPolygons>()
        .register_type::<aligned::SliceStack>()
        .register_type::<aligned::ShowingBlocks>();
}

/// Loads volumes, keeps what was cut, and shows them. See the [module](self).
pub struct VolumePlugin;

impl Plugin for VolumePlugin {
    fn build(&self, app: &mut App) {
        asset::build(app);
        component::build(app);
        deformed::build(app);
        drilling::build(app);
        picking::build(app);
        soft::build(app);
        watch::build(app);
        #[cfg(feature = "render")]
        render::build(app);
        register(app);
    }
}
