//! Everything that tools touch.

use crate::deform::elastic::ElasticBody;
use crate::haptics::force::SurfaceFeel;
use crate::organ::pick::OrganPicker;
use crate::organ::{Hollow, Organ, OrganModel, OrganShape};
use crate::volume::pick::VolumePicker;
use crate::volume::{CutVolume, DeformedVolume, PickedVolume};
use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

/// Marks an organ or a volume that is only seen: instruments pass through it, and scenarios take no notice of it. So is the wall of an
/// abdomen, through which shafts go.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct Intangible;

type OrganParts = (
    Entity,
    &'static Organ,
    Ref<'static, OrganShape>,
    &'static OrganPicker,
    &'static GlobalTransform,
    Has<Hollow>,
    Option<&'static SurfaceFeel>,
);
type VolumeParts = (
    Entity,
    &'static PickedVolume,
    &'static CutVolume,
    &'static GlobalTransform,
    Option<&'static DeformedVolume>,
    Option<&'static SurfaceFeel>,
);

/// Organs and volumes in the world.
#[derive(SystemParam)]
pub(super) struct Bodies<'w, 's> {
    organs: Query<'w, 's, OrganParts, Without<Intangible>>,
    models: Res<'w, Assets<OrganModel>>,
    volumes: Query<'w, 's, VolumeParts, Without<Intangible>>,
    soft: Query<'w, 's, (), With<ElasticBody>>,
}

/// An organ that can be touched.
pub(super) struct TouchedOrgan<'a> {
    pub(super) entity: Entity,
    pub(super) model: &'a OrganModel,
    pub(super) shape: Ref<'a, OrganShape>,
    pub(super) picker: &'a OrganPicker,
    pub(super) world_from_organ: Affine3A,
    pub(super) is_hollow: bool,
    pub(super) feel: SurfaceFeel,
}

/// A volume that can be touched.
pub(super) struct TouchedVolume<'a> {
    pub(super) entity: Entity,
    pub(super) picker: &'a VolumePicker,
    pub(super) cut: &'a CutVolume,
    pub(super) world_from_volume: Affine3A,
    pub(super) deformed: Option<&'a DeformedVolume>,
    pub(super) feel: SurfaceFeel,
}

impl Bodies<'_, '_> {
    /// Organs whose model is there, in the shape that they have now.
    pub(super) fn organs(&self) -> impl Iterator<Item = TouchedOrgan<'_>> {
        self.organs.iter().filter_map(|(entity, organ, shape, picker, transform, is_hollow, feel)| {
            let model = self.models.get(&organ.0).filter(|model| shape.is_of(model))?;
            let feel = feel.copied().unwrap_or(SurfaceFeel::LIVER);
            Some(TouchedOrgan { entity, model, shape, picker, world_from_organ: transform.affine(), is_hollow, feel })
        })
    }

    /// Volumes, and what is left of them.
    pub(super) fn volumes(&self) -> impl Iterator<Item = TouchedVolume<'_>> {
        self.volumes.iter().filter_map(|(entity, PickedVolume(picker), cut, transform, deformed, feel)| {
            // A volume that is being exchanged: neither the one nor the other.
            let is_of = picker.grid().size == cut.size();
            let feel = feel.copied().unwrap_or(SurfaceFeel::BONE);
            let world_from_volume = transform.affine();
            is_of.then_some(TouchedVolume { entity, picker, cut, world_from_volume, deformed, feel })
        })
    }

    /// Whether a body gives way.
    pub(super) fn is_soft(&self, body: Entity) -> bool {
        self.soft.contains(body)
    }

    /// How a soft body feels.
    pub(super) fn feel_of_organ(&self, body: Entity) -> SurfaceFeel {
        self.organs.get(body).ok().and_then(|(.., feel)| feel.copied()).unwrap_or(SurfaceFeel::LIVER)
    }
}
