//! A volume in the world.

use super::transfer::TransferFunction;
use super::{CutVolume, Volume, VolumeLook};
use bevy::prelude::*;
use tracing::warn;

/// Shows a [`Volume`] at the entity's transform: its middle at the origin, in metres.
///
/// A [`CutVolume`] is added once the volume is loaded, and a [`TransferFunction`] that suits it where there is none. A volume
/// without [`Structures`](super::structures::Structures) is shown, but neither picked nor drilled; loaders find some.
#[derive(Component, Clone, Debug, Default, FromTemplate, PartialEq, Reflect)]
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
#[derive(Component, PartialEq)]
struct CutOf {
    volume: AssetId<Volume>,
    /// Whose clones are still the same cut.
    lineage: Option<u64>,
}

/// The transfer function that was chosen because there was none.
#[derive(Component)]
struct Suited(TransferFunction);

/// Whether a volume's transfer function was chosen because there was none.
#[cfg(feature = "scenes")]
pub(crate) fn has_suited_transfer(entity: EntityRef) -> bool {
    entity.get::<Suited>().is_some_and(|suited| entity.get() == Some(&suited.0))
}

type Body = (
    Entity,
    &'static CtVolume,
    Option<&'static CutVolume>,
    Option<&'static CutOf>,
    Option<&'static TransferFunction>,
    Option<&'static Suited>,
);

/// Gives volumes that have arrived an untouched cut, and again when the volume was exchanged.
fn begin_cuts(mut commands: Commands, volumes: Res<Assets<Volume>>, bodies: Query<Body>) {
    for (entity, body, mut cut, cut_of, transfer, suited) in &bodies {
        let id = body.0.id();
        let is_exchanged = cut_of.is_some_and(|cut_of| cut_of.volume != id);
        // A cut that came together with the new volume is its own; the old one's is not.
        if is_exchanged && cut.take_if(|cut| cut_of.is_some_and(|of| of.lineage == Some(cut.lineage()))).is_some() {
            commands.entity(entity).try_remove::<CutVolume>();
        }
        let now = CutOf { volume: id, lineage: cut.map(CutVolume::lineage) };
        if cut_of != Some(&now) {
            commands.entity(entity).try_insert(now);
        }
        // Likewise a transfer function that nobody chose.
        let is_suited = transfer.is_some() && transfer == suited.map(|suited| &suited.0);
        if is_exchanged && is_suited {
            commands.entity(entity).try_remove::<(TransferFunction, Suited)>();
            continue;
        }
        let Some(volume) = volumes.get(&body.0) else { continue };
        if cut.is_none_or(|cut| cut.size() != volume.grid().size) {
            if volume.structures().is_none() {
                warn!(
                    "a volume without structures is shown, but neither picked nor drilled: see Structures::for_volume"
                );
            }
            commands.entity(entity).try_insert(CutVolume::new(volume.grid().size));
        }
        if transfer.is_none() {
            let chosen = TransferFunction::for_volume(volume);
            commands.entity(entity).try_insert((Suited(chosen.clone()), chosen));
        }
    }
}
