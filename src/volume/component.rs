//! A volume in the world.

use super::transfer::TransferFunction;
use super::{CutVolume, RemovedTissue, Volume, VolumeLook};
use bevy::prelude::*;

/// Shows a [`Volume`] at the entity's transform: its middle at the origin, in metres.
///
/// A [`CutVolume`] is added once the volume is loaded, and a [`TransferFunction`] that suits it where there is none.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform, VolumeLook)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct CtVolume(pub Handle<Volume>);

/// In `PreUpdate`: volumes that have arrived get their [`CutVolume`].
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PrepareCuts;

pub(super) fn build(app: &mut App) {
    app.register_type::<CtVolume>()
        .register_type::<VolumeLook>()
        .add_systems(PreUpdate, begin_cuts.in_set(PrepareCuts));
}

/// The volume that a [`CutVolume`] belongs to.
#[derive(Component)]
struct CutOf(AssetId<Volume>);

type Body = (Entity, &'static CtVolume, Option<Ref<'static, CutVolume>>, Option<&'static CutOf>, Has<TransferFunction>);

/// Gives volumes that have arrived an untouched cut, and again when the volume was exchanged.
fn begin_cuts(mut commands: Commands, volumes: Res<Assets<Volume>>, bodies: Query<Body>) {
    for (entity, body, mut cut, cut_of, has_transfer) in &bodies {
        let id = body.0.id();
        if cut_of.is_none_or(|cut_of| cut_of.0 != id) {
            commands.entity(entity).insert(CutOf(id));
            // A cut that came together with the volume is its own; an older one is not.
            if cut_of.is_some() && cut.take_if(|cut| !cut.is_changed()).is_some() {
                commands.entity(entity).remove::<CutVolume>();
            }
        }
        let Some(volume) = volumes.get(&body.0) else { continue };
        if cut.is_none_or(|cut| cut.size() != volume.grid().size) {
            commands.entity(entity).insert((CutVolume::new(volume.grid().size), RemovedTissue::default()));
        }
        if !has_transfer {
            commands.entity(entity).insert(TransferFunction::for_volume(volume));
        }
    }
}
