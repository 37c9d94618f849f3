//! What of a world is authored and what follows from that. The one list of both, for saving and for tests.

use crate::deform::elastic::ElasticBody;
use crate::deform::{DeformLattice, LatticeAnimation, OrganRide};
use crate::haptics::force::SurfaceFeel;
use crate::highlights::Highlights;
use crate::organ::pick::OrganPicker;
use crate::organ::{Hollow, LoadOrgan, Organ, OrganLoadFailed, OrganShape};
use crate::pool::{
    Bleeder, BleedingRules, Cavity, FluidSolver, Pool, PoolBackend, PoolFault, PoolFluid, PoolLevel, PoolLook,
    PoolState, PoolSurface, SolverSettings, SuctionIrrigator, SuctionState, WaterBudget,
};
use crate::reactions::{ReactionModel, Reactions};
use crate::scenario::{ScenarioEye, ScenarioPart};
use crate::skin::Skin;
use crate::sound::ToolSound;
use crate::tools::{
    DeviceRefused, HoldDevice, Intangible, ServoReading, Tool, ToolCommand, ToolContacts, ToolControls, ToolForce,
    ToolMotion, ToolPose, ToolRig, ToolState, ToolWork,
};
use crate::volume::critical::CriticalDistances;
use crate::volume::structures::StructureChanges;
use crate::volume::transfer::TransferFunction;
use crate::volume::{
    CtVolume, CutVolume, DeformedVolume, LoadVolume, MakePhantom, PickedVolume, RemovedTissue, SoftVolume,
    VolumeLoadFailed, VolumeLook, WatchCritical,
};
use bevy::prelude::*;
use bevy::reflect::{GetTypeRegistration, TypePath, TypeRegistry};
use std::any::TypeId;
#[cfg(feature = "render")]
use {
    crate::pool::render::flow::{GpuFlow, PoolReadings},
    crate::skin::SkinTexture,
    crate::view::{
        Endoscope, Microscope, MicroscopeLamp, MonitorView, ScopeLight, ScopeMask, StereoEye, StereoEyes, StereoPair,
        ToolShadow, ToolShadows,
    },
    bevy::camera::visibility::RenderLayers,
    bevy::core_pipeline::tonemapping::Tonemapping,
};

/// A component by its type.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub id: TypeId,
    pub path: fn() -> &'static str,
    pub register: fn(&mut TypeRegistry),
}

impl Kind {
    fn of<C: Component + GetTypeRegistration + TypePath>() -> Self {
        Self { id: TypeId::of::<C>(), path: C::type_path, register: TypeRegistry::register::<C> }
    }
}

/// Lists components; those behind `seen` are there with the feature `render` only.
macro_rules! kinds {
    ($($component:ty),* $(,)?) => { vec![$(Kind::of::<$component>()),*] };
    ($($component:ty),*; seen: $($seen:ty),* $(,)?) => {{
        let kinds = kinds![$($component),*];
        #[cfg(feature = "render")]
        let kinds = [kinds, kinds![$($seen),*]].concat();
        kinds
    }};
}

/// Components of the crate that a designer sets: these are what a saved scene holds.
#[rustfmt::skip]
fn own() -> Vec<Kind> {
    kinds![
        // Organs.
        Organ, LoadOrgan, Hollow, Skin, Reactions, Highlights, SurfaceFeel, Intangible,
        // What gives way.
        DeformLattice, ElasticBody, LatticeAnimation, SoftVolume,
        // Volumes.
        CtVolume, LoadVolume, MakePhantom, VolumeLook, TransferFunction, StructureChanges, WatchCritical,
        // Fluid.
        Pool, PoolLevel, PoolFluid, PoolBackend, SolverSettings, BleedingRules, PoolLook, Bleeder, SuctionIrrigator,
        // Instruments.
        Tool, ToolPose, ToolRig, ToolControls, HoldDevice, ToolSound,
        // Training.
        ScenarioEye;
        seen: Endoscope, Microscope, MicroscopeLamp, ScopeLight, ScopeMask, StereoPair, MonitorView, ToolShadow,
        ToolShadows,
    ]
}

/// Components of Bevy that a scene of surgery is made of.
#[rustfmt::skip]
fn of_bevy() -> Vec<Kind> {
    kinds![
        Name;
        seen: Camera, Camera3d, Projection, Tonemapping, Msaa, RenderLayers, DirectionalLight, PointLight,
        SpotLight,
    ]
}

/// What holds a scene together. An entity with nothing else is saved where others hang from it.
fn frame() -> Vec<Kind> {
    kinds![Transform, ChildOf, Children; seen: Visibility]
}

/// Components of the crate that follow from the authored ones while the simulation runs, or are an input of the moment. They are
/// not saved. What was drilled has a file format of its own ([`CutVolume::save`]).
#[rustfmt::skip]
fn derived() -> Vec<Kind> {
    kinds![
        // Of organs.
        OrganShape, OrganPicker, OrganLoadFailed, ReactionModel, OrganRide,
        // Of volumes.
        CutVolume, RemovedTissue, PickedVolume, VolumeLoadFailed, DeformedVolume, CriticalDistances,
        // Of pools.
        Cavity, FluidSolver, PoolState, PoolFault, PoolSurface, WaterBudget, SuctionState,
        // Of instruments.
        ToolCommand, ToolMotion, ToolState, ToolContacts, ToolForce, ToolWork, DeviceRefused, ServoReading,
        // Of scenarios and scenes.
        ScenarioPart, NotAuthored;
        seen: GpuFlow, PoolReadings, SkinTexture, StereoEye, StereoEyes,
    ]
}

/// A component that another one makes: that one is saved in its place.
pub(super) struct MadeBy {
    pub made: Kind,
    pub by: Vec<Kind>,
}

pub(super) fn made() -> [MadeBy; 4] {
    [
        MadeBy { made: Kind::of::<Organ>(), by: kinds![LoadOrgan] },
        MadeBy { made: Kind::of::<CtVolume>(), by: kinds![LoadVolume, MakePhantom] },
        MadeBy { made: Kind::of::<DeformLattice>(), by: kinds![SoftVolume] },
        MadeBy { made: Kind::of::<ElasticBody>(), by: kinds![SoftVolume] },
    ]
}

/// Marks an entity of the program that is no part of the scene, and is not saved with it: an editor's own camera, handles, helpers.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct NotAuthored;

/// The components that saved scenes hold: those of the crate that a designer sets, those of Bevy that hold them together, and
/// those that an app adds to them.
///
/// What the simulation makes of them is not saved, but for places and poses as they are.
#[derive(Resource, Clone, Debug)]
pub struct SceneComponents {
    saved: WorldFilter,
    frame: WorldFilter,
}

impl Default for SceneComponents {
    fn default() -> Self {
        let filter =
            |kinds: Vec<Kind>| kinds.iter().fold(WorldFilter::deny_all(), |filter, kind| filter.allow_by_id(kind.id));
        Self { saved: filter([own(), of_bevy(), frame()].concat()), frame: filter(frame()) }
    }
}

/// Makes all types known that saved scenes hold, also where the plugins that use them are not there.
pub(super) fn register(app: &mut App) {
    let mut registry = app.world().resource::<AppTypeRegistry>().write();
    for kind in [own(), of_bevy(), frame()].concat() {
        (kind.register)(&mut registry);
    }
}

impl SceneComponents {
    /// Saves a component of the app too. It must be reflected and registered, with `#[reflect(Component)]`.
    pub fn author<C: Component>(&mut self) -> &mut Self {
        self.saved = std::mem::take(&mut self.saved).allow::<C>();
        self
    }

    /// Saves a component no longer.
    pub fn leave_out<C: Component>(&mut self) -> &mut Self {
        self.saved = std::mem::take(&mut self.saved).deny::<C>();
        self
    }

    /// Whether a component is saved.
    pub fn is_authored<C: Component>(&self) -> bool {
        self.saved.is_allowed::<C>()
    }

    /// Which components are saved, for Bevy's [`DynamicWorldBuilder`].
    pub fn filter(&self) -> &WorldFilter {
        &self.saved
    }

    /// Whether something on an entity is worth saving.
    pub(crate) fn count_on(&self, world: &World, entity: EntityRef) -> bool {
        entity.archetype().components().iter().any(|id| {
            let kind = world.components().get_info(*id).and_then(|info| info.type_id());
            kind.is_some_and(|kind| self.saved.is_allowed_by_id(kind) && !self.frame.is_allowed_by_id(kind))
        })
    }

    /// Type paths of the crate's components that a designer sets.
    pub fn authored_of_crate() -> Vec<&'static str> {
        own().iter().map(|kind| (kind.path)()).collect()
    }

    /// Type paths of the crate's components that follow from those, and are not saved.
    pub fn derived_of_crate() -> Vec<&'static str> {
        derived().iter().map(|kind| (kind.path)()).collect()
    }
}
