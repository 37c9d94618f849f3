//! Bevy plugins for surgical training: organs with living skin that bleeds and burns under an endoscope, and the house that
//! deformation, instruments and scored scenarios are built into.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_surgery::prelude::*;
//!
//! fn main() {
//!     App::new().add_plugins((DefaultPlugins, SurgeryPlugins)).add_systems(Startup, setup).run();
//! }
//!
//! fn setup(mut commands: Commands, mut models: ResMut<Assets<OrganModel>>) -> Result {
//!     // The liver that ships with the crate; `AssetServer::load` takes OBJ, STL, PLY and glTF files of your own.
//!     let liver = OrganModel::procedural_liver(&OrganOptions::default())?;
//!     commands.spawn((Organ(models.add(liver)), Skin::liver(), Reactions::default(), Highlights::default()));
//!     commands.spawn((Endoscope::default(), Transform::from_xyz(0.0, 0.12, 0.22).looking_at(Vec3::ZERO, Vec3::Y)));
//!     Ok(())
//! }
//! ```
//!
//! The crate `bevy_panorbit_camera` lets a mouse turn the endoscope about what it looks at, as in the example `liver`:
//!
//! ```ignore
//! use bevy_panorbit_camera::{PanOrbitCamera, PanOrbitCameraPlugin};
//! app.add_plugins(PanOrbitCameraPlugin);
//! commands.spawn((Endoscope::default(), PanOrbitCamera { zoom_lower_limit: 0.02, ..default() }));
//! ```
//!
//! Lengths are metres, angles radians, light photometric as in Bevy. The models run on the CPU, deterministically and
//! without a GPU; the GPU shows them. With `default-features = false` nothing but the models is built.

// Systems take what they need, and queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]
#![warn(missing_docs)]

pub mod checkpoint;
pub mod deform;
pub mod diagnostics;
mod files;
pub mod gravity;
pub mod haptics;
pub mod highlights;
mod order;
pub mod organ;
pub mod pacing;
#[cfg(feature = "panels")]
pub mod panels;
pub mod pool;
pub mod reactions;
mod ready;
#[cfg(feature = "render")]
pub mod render;
pub mod scenario;
#[cfg(feature = "scenes")]
pub mod scenes;
pub mod schedule;
pub mod skin;
pub mod sound;
pub mod testing;
pub mod tools;
#[cfg(feature = "render")]
pub mod view;
pub mod volume;

/// What a scene needs, in one import.
pub mod prelude {
    pub use crate::SurgeryPlugins;
    pub use crate::deform::elastic::{
        BodyContact, ElasticBody, ElasticTissue, GraspBody, GraspHeld, GraspSlipped, PressBody, TissueTorn, ToolShape,
    };
    pub use crate::deform::{
        AffineField, DeformBodies, DeformLattice, DeformPlugin, KeyFrame, KeyFrames, KeyInterpolation,
        LatticeAnimation, LatticeError, LatticeMotion, NormalDeformation, Patch, TravellingWave,
    };
    pub use crate::gravity::SurgeryGravity;
    pub use crate::haptics::force::SurfaceFeel;
    pub use crate::highlights::{HighlightCover, Highlights, HighlightsPlugin};
    pub use crate::organ::clean::{Topology, Weld};
    pub use crate::organ::load::{LoadOptions, MeshUnit};
    pub use crate::organ::{
        ChartKind, Hollow, LoadOrgan, Organ, OrganHit, OrganModel, OrganOptions, OrganPicking, OrganPlugin, OrganShape,
        OrganSource, SurfacePoint, procedural_ellipsoid,
    };
    pub use crate::pacing::Pacing;
    pub use crate::pool::{
        Bleeder, BleedingControl, BleedingRules, Cavity, FluidSolver, Pool, PoolBackend, PoolFault, PoolFluid,
        PoolLevel, PoolLook, PoolPlugin, PoolState, SolverSettings, SuctionGurgled, SuctionIrrigator, TreatBleeders,
        VesselOpened, WaterBudget,
    };
    pub use crate::reactions::burn::Cautery;
    pub use crate::reactions::kind::{AddReactionKind, KindId, ReactionKind, ReactionKinds};
    pub use crate::reactions::{
        OrganReacted, OrganTouch, ReactionAction, ReactionEvent, ReactionModel, Reactions, ReactionsPlugin, Wound,
    };
    #[cfg(feature = "render")]
    pub use crate::render::{OrganPasses, SurgeryRenderPlugin};
    #[cfg(feature = "scenes")]
    pub use crate::scenes::{
        SceneComponents, ScenesPlugin, author_scene, liver_scene, load_scene, mastoid_scene, scene_text,
        soft_volume_scene,
    };
    pub use crate::schedule::{SurgerySchedulePlugin, SurgerySystems};
    pub use crate::skin::tiles::TileOptions;
    pub use crate::skin::{OrganPreset, Skin, SkinPlugin, TileSource};
    pub use crate::sound::{SoundPlugin, ToolSound};
    pub use crate::tools::{
        Contact, ContactMatter, ContactPhase, DrillHead, Electrodes, Intangible, Jaws, Tool, ToolCommand, ToolContacts,
        ToolForce, ToolGeometry, ToolHand, ToolKind, ToolMotion, ToolPart, ToolPlace, ToolPose, ToolTouched, ToolWork,
        ToolsPlugin, TouchTools,
    };
    #[cfg(feature = "render")]
    pub use crate::view::{
        Endoscope, Microscope, MicroscopeLamp, MonitorView, ScopeLight, ScopeMask, StereoPair, SurgeryViewPlugin,
        ToolShadow, ToolShadows,
    };
    pub use crate::volume::critical::CriticalDistances;
    pub use crate::volume::cut::{Burr, BurrKind, BurrPose, BurrShape};
    pub use crate::volume::load::VolumeLoadOptions;
    pub use crate::volume::phantom::{PhantomOptions, phantom};
    pub use crate::volume::structures::{Structure, Structures, Tissue};
    pub use crate::volume::transfer::{ColourSource, ControlPoint, TransferFunction};
    pub use crate::volume::{
        CtVolume, CutVolume, DrillVolume, LoadVolume, MakePhantom, RemovedTissue, SmoothedNormals, SoftVolume, Volume,
        VolumeGrid, VolumeHitInWorld, VolumeLoadFailed, VolumeLook, VolumeMethod, VolumePicking, VolumePlugin, Voxels,
        VoxelsRemoved, WatchCritical, WetShading,
    };
}

use bevy::app::{PluginGroup, PluginGroupBuilder};

/// Everything, in the order in which it must be added.
///
/// Take members out or set them one by one, as with Bevy's own groups:
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_surgery::{SurgeryPlugins, schedule::SurgerySchedulePlugin, skin::SkinPlugin};
/// # App::new().add_plugins((MinimalPlugins, AssetPlugin::default())).add_plugins(
/// SurgeryPlugins.build().disable::<SkinPlugin>().set(SurgerySchedulePlugin { steps_per_second: Some(120.0) })
/// # );
/// ```
///
/// | member | gives | needs |
/// |---|---|---|
/// | [`SurgerySchedulePlugin`](schedule::SurgerySchedulePlugin) | [`SurgerySystems`](schedule::SurgerySystems), 60 steps a second | |
/// | [`SurgeryRenderPlugin`](render::SurgeryRenderPlugin) (feature `render`) | shaders, light list, [`OrganPasses`](render::OrganPasses) | |
/// | [`OrganPlugin`](organ::OrganPlugin) | organ loaders, [`Organ`](organ::Organ), [`OrganShape`](organ::OrganShape) | schedule |
/// | [`SkinPlugin`](skin::SkinPlugin) | [`Skin`](skin::Skin) | organ; render to be seen |
/// | [`ReactionsPlugin`](reactions::ReactionsPlugin) | [`Reactions`](reactions::Reactions), [`OrganTouch`](reactions::OrganTouch) | organ; render to be seen |
/// | [`HighlightsPlugin`](highlights::HighlightsPlugin) | [`Highlights`](highlights::Highlights) | organ; render to be seen |
/// | [`DeformPlugin`](deform::DeformPlugin) | [`DeformLattice`](deform::DeformLattice), [`LatticeAnimation`](deform::LatticeAnimation), [`ElasticBody`](deform::elastic::ElasticBody), organs that ride in them | organ |
/// | [`HapticsPlugin`](haptics::HapticsPlugin) | the types of [`haptics`]: devices, force models, the servo loop | |
/// | [`VolumePlugin`](volume::VolumePlugin) | [`CtVolume`](volume::CtVolume), [`LoadVolume`](volume::LoadVolume), [`DrillVolume`](volume::DrillVolume) | schedule; render to be seen |
/// | [`PoolPlugin`](pool::PoolPlugin) | [`Pool`](pool::Pool), [`SuctionIrrigator`](pool::SuctionIrrigator), [`Bleeder`](pool::Bleeder) | schedule, volume; render to be seen |
/// | [`ToolsPlugin`](tools::ToolsPlugin) | instruments | schedule |
/// | [`SoundPlugin`](sound::SoundPlugin) | [`ToolSound`](sound::ToolSound) | tools; feature `sound` and Bevy's `AudioPlugin` to be heard |
/// | [`ScenarioPlugin`](scenario::ScenarioPlugin) | [`ScenarioRun`](scenario::ScenarioRun): goals, rules, log, replay | all above |
/// | [`SurgeryViewPlugin`](view::SurgeryViewPlugin) (feature `render`) | [`Endoscope`](view::Endoscope), [`Microscope`](view::Microscope), [`ScopeLight`](view::ScopeLight), [`ScopeMask`](view::ScopeMask), [`StereoPair`](view::StereoPair), [`MonitorView`](view::MonitorView), [`ToolShadows`](view::ToolShadows) | render |
/// | [`ScenesPlugin`](scenes::ScenesPlugin) (feature `scenes`) | saved scenes ([`scene_text`](scenes::scene_text), [`load_scene`](scenes::load_scene)), ready ones ([`liver_scene`](scenes::liver_scene)); Bevy's plugins for scenes where nobody added them | all above |
pub struct SurgeryPlugins;

impl PluginGroup for SurgeryPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>().add(schedule::SurgerySchedulePlugin::default());
        #[cfg(feature = "render")]
        let group = group.add(render::SurgeryRenderPlugin);
        let group = group
            .add(organ::OrganPlugin::default())
            .add(deform::DeformPlugin)
            .add(haptics::HapticsPlugin)
            .add(skin::SkinPlugin)
            .add(reactions::ReactionsPlugin)
            .add(highlights::HighlightsPlugin)
            .add(volume::VolumePlugin)
            .add(pool::PoolPlugin)
            .add(tools::ToolsPlugin)
            .add(sound::SoundPlugin)
            .add(scenario::ScenarioPlugin);
        #[cfg(feature = "render")]
        let group = group.add(view::SurgeryViewPlugin);
        #[cfg(feature = "scenes")]
        let group = group.add(scenes::ScenesPlugin);
        group
    }
}
