//! Volumes that a lattice deforms, in the ECS: what picking, drilling and drawing read of the lattice.

use super::{CtVolume, LoadVolume, MakePhantom, PrepareCuts, Volume, VolumeLook, VoxelLattice};
use crate::checkpoint::KeepState;
use crate::deform::{DeformLattice, NormalDeformation};
use crate::organ::Organ;
use crate::schedule::SurgerySystems;
use bevy::ecs::change_detection::Tick;
use bevy::prelude::*;
use std::sync::Arc;
use tracing::warn;

/// The [`DeformLattice`] of a [`CtVolume`] in its voxel coordinates. Kept beside it: as it is since the last step, and, when the
/// frame is drawn, as it is then.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, PartialEq)]
pub struct DeformedVolume {
    lattice: Arc<VoxelLattice>,
    revision: u64,
    made_of: Source,
}

/// What a [`DeformedVolume`] was made of: the volume, and when its lattice and its look changed last. It is looked at in several
/// schedules, and made anew in the first of them only.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Source {
    volume: AssetId<Volume>,
    lattice: Tick,
    look: Tick,
}

impl DeformedVolume {
    /// The field.
    pub fn lattice(&self) -> &VoxelLattice {
        &self.lattice
    }

    /// The same, to be kept.
    #[cfg(feature = "render")]
    pub(super) fn shared(&self) -> Arc<VoxelLattice> {
        self.lattice.clone()
    }

    /// No two states of any lattice of an app have the same.
    pub fn revision(&self) -> u64 {
        self.revision
    }
}

/// In [`SurgerySystems::Publish`] and before a frame is drawn: volumes follow their lattices.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct FollowLattices;

/// The last revision that was given.
#[derive(Resource, Default)]
struct Revisions(u64);

pub(super) fn build(app: &mut App) {
    app.register_type::<DeformedVolume>()
        .init_resource::<Revisions>()
        .keep_component::<DeformedVolume>()
        // Lattices may come and move between the steps.
        .add_systems(PreUpdate, (follow_lattices.in_set(FollowLattices).after(PrepareCuts), warn_of_idle_lattices))
        .add_systems(FixedUpdate, follow_lattices.in_set(FollowLattices).in_set(SurgerySystems::Publish))
        .add_systems(PostUpdate, follow_lattices.in_set(FollowLattices));
}

type Idle = (Added<DeformLattice>, Without<CtVolume>, Without<LoadVolume>, Without<MakePhantom>, Without<Organ>);

/// Says so where a lattice has nothing to deform: neither a volume, also one that is still on its way, nor an organ.
fn warn_of_idle_lattices(idle: Query<(Entity, Option<&Name>), Idle>) {
    for (entity, name) in &idle {
        let name = name.map_or_else(|| entity.to_string(), |name| format!("\"{name}\" ({entity})"));
        warn!(
            "{name} has a DeformLattice and nothing that it could deform; give it a CtVolume, a LoadVolume or an Organ"
        );
    }
}

type Deformed = (
    Entity,
    &'static CtVolume,
    Ref<'static, DeformLattice>,
    Ref<'static, VolumeLook>,
    Option<&'static mut DeformedVolume>,
);

fn follow_lattices(
    mut commands: Commands,
    volumes: Res<Assets<Volume>>,
    mut deformed: Query<Deformed>,
    left: Query<Entity, (With<DeformedVolume>, Without<DeformLattice>)>,
    mut revisions: ResMut<Revisions>,
) {
    for entity in &left {
        commands.entity(entity).try_remove::<DeformedVolume>();
    }
    let are_replaced = volumes.is_changed();
    for (entity, source, lattice, look, mut shown) in &mut deformed {
        let made_of = Source { volume: source.0.id(), lattice: lattice.last_changed(), look: look.last_changed() };
        if !are_replaced && shown.as_ref().is_some_and(|shown| shown.made_of == made_of) {
            continue;
        }
        let Some(volume) = volumes.get(&source.0) else { continue };
        let mut now = VoxelLattice::new(&lattice, volume.grid());
        if look.deformed_normals != NormalDeformation::Exact {
            now = now.with_normals(look.deformed_normals, &lattice, volume.grid());
        }
        if let Some(shown) = &mut shown
            && *shown.lattice == now
        {
            shown.bypass_change_detection().made_of = made_of;
            continue;
        }
        revisions.0 += 1;
        let now = DeformedVolume { lattice: Arc::new(now), revision: revisions.0, made_of };
        match shown {
            Some(mut shown) => *shown = now,
            None => {
                commands.entity(entity).try_insert(now);
            }
        }
    }
}
