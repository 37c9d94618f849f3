//! What there is in a world to look at.

use crate::deform::DeformLattice;
use crate::organ::pick::OrganPicker;
use crate::organ::{LoadOrgan, Organ, OrganLoadFailed, OrganModel, OrganShape};
use crate::pool::{Bleeder, PoolState, WaterBudget};
use crate::reactions::ReactionModel;
use crate::tools::{Intangible, Tool, ToolCommand, ToolContacts, ToolForce, ToolMotion, ToolPose, ToolState};
use crate::volume::{
    CtVolume, CutVolume, DeformedVolume, LoadVolume, MakePhantom, PickedVolume, RemovedTissue, VolumeLoadFailed,
};
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

/// From here the trainee looks: whatever goals and rules say can be seen is seen from here, along -Z. Put it beside the camera; in
/// a world without cameras, on any entity.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
pub struct ScenarioEye;

pub(in crate::scenario) type OrganParts = (
    Entity,
    Option<&'static Name>,
    &'static Organ,
    Option<&'static OrganShape>,
    Option<&'static OrganPicker>,
    Option<&'static ReactionModel>,
    &'static GlobalTransform,
);
pub(in crate::scenario) type VolumeParts = (
    Entity,
    Option<&'static Name>,
    &'static CtVolume,
    Option<&'static CutVolume>,
    Option<&'static PickedVolume>,
    Option<&'static RemovedTissue>,
    &'static GlobalTransform,
    Option<&'static DeformedVolume>,
    Has<VolumeLoadFailed>,
);
pub(in crate::scenario) type ToolParts = (
    Entity,
    Option<&'static Name>,
    &'static Tool,
    &'static ToolPose,
    &'static ToolMotion,
    &'static ToolCommand,
    &'static ToolForce,
    &'static ToolContacts,
    &'static ToolState,
);

type Unmade = (With<LoadOrgan>, Without<Organ>, Without<OrganLoadFailed>);
type Unbuilt = (With<MakePhantom>, Without<CtVolume>, Without<VolumeLoadFailed>);

/// Everything that is looked at.
#[derive(SystemParam)]
pub(in crate::scenario) struct Scene<'w, 's> {
    pub organs: Query<'w, 's, OrganParts, Without<Intangible>>,
    pub models: Option<Res<'w, Assets<OrganModel>>>,
    pub volumes: Query<'w, 's, VolumeParts, Without<Intangible>>,
    pub tools: Query<'w, 's, ToolParts>,
    pub pools: Query<'w, 's, (&'static PoolState, &'static WaterBudget)>,
    pub bleeders: Query<'w, 's, &'static Bleeder>,
    pub lattices: Query<'w, 's, &'static DeformLattice>,
    pub loading: Query<'w, 's, (), (With<LoadVolume>, Without<CtVolume>, Without<VolumeLoadFailed>)>,
    pub making: Query<'w, 's, (), Or<(Unmade, Unbuilt)>>,
    pub eyes: Query<'w, 's, &'static GlobalTransform, With<ScenarioEye>>,
}

impl Scene<'_, '_> {
    /// Whether all that was spawned is there: organs have their shapes, volumes their cuts.
    pub fn is_ready(&self) -> bool {
        let organs = self.organs.iter().all(|(_, _, _, shape, picker, ..)| shape.is_some() && picker.is_some());
        let volumes = self.volumes.iter().all(|(_, _, _, cut, picked, ..)| cut.is_some() && picked.is_some());
        organs && volumes && self.loading.is_empty() && self.making.is_empty()
    }

    /// Where the eye is.
    pub fn eye(&self) -> Option<&GlobalTransform> {
        self.eyes.iter().next()
    }
}
