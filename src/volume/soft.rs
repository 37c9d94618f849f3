//! Volumes that give way: the lattice and the body that a scene asks for.

use super::{CtVolume, PrepareCuts, Volume};
use crate::checkpoint::KeepState;
use crate::deform::DeformLattice;
use crate::deform::elastic::{ElasticBody, ElasticCell, ElasticError, ElasticTissue};
use crate::gravity::SurgeryGravity;
use bevy::prelude::*;
use tracing::error;

/// Makes a volume give way: a [`DeformLattice`] and an [`ElasticBody`] are inserted beside its [`CtVolume`] when the volume is
/// there, and again when that or this is changed.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct SoftVolume {
    /// Halvings of the volume's box: `2^level` cells along each side, 0 to 6.
    pub level: u32,
    /// What it is made of wherever something is; none for what its structures are made of
    /// ([`ElasticBody::of_volume`]).
    pub tissue: Option<ElasticTissue>,
    /// Vertices that lie within this share of the box behind its back (-Z) stay where they are, as if they had grown on to what
    /// is behind; 0 for none, 1 for all.
    pub held_share: f32,
    /// Whether its own weight, as it lies when it is made, does not make it sag: a scanned organ has sagged already.
    pub has_sagged: bool,
}

impl Default for SoftVolume {
    fn default() -> Self {
        Self { level: 3, tissue: None, held_share: 0.15, has_sagged: true }
    }
}

/// The volume that lattice and body were made for.
#[derive(Component, Clone, PartialEq)]
struct SoftOf(AssetId<Volume>);

pub(super) fn build(app: &mut App) {
    app.init_resource::<SurgeryGravity>()
        .register_type::<SoftVolume>()
        .keep_component::<SoftOf>()
        .add_systems(PreUpdate, soften.after(PrepareCuts));
}

fn soften(
    mut commands: Commands,
    soft: Query<(Entity, &CtVolume, Ref<SoftVolume>, Option<&SoftOf>)>,
    volumes: Res<Assets<Volume>>,
    gravity: Res<SurgeryGravity>,
    places: TransformHelper,
) {
    for (entity, body, soft, done) in &soft {
        let now = SoftOf(body.0.id());
        if done == Some(&now) && !soft.is_changed() {
            continue;
        }
        let Some(volume) = volumes.get(&body.0) else { continue };
        let mut entity = commands.entity(entity);
        entity.try_insert(now);
        let place = places.compute_global_transform(entity.id()).unwrap_or_default();
        let gravity_m_per_s2 = place.affine().inverse().transform_vector3(gravity.world_m_per_s2);
        match soft.make(volume, gravity_m_per_s2) {
            Ok(made) => entity.try_insert(made),
            Err(reason) => {
                error!("a SoftVolume stays rigid: {reason}");
                entity.try_remove::<(DeformLattice, ElasticBody)>()
            }
        };
    }
}

impl SoftVolume {
    /// The lattice and the body of a volume that lies under a gravity, in the volume's own space, metres per second squared.
    ///
    /// # Errors
    /// [`ElasticError`] for a level beyond the deepest, and a volume in which nothing is.
    pub fn make(&self, volume: &Volume, gravity_m_per_s2: Vec3) -> Result<(DeformLattice, ElasticBody), ElasticError> {
        let lattice = volume.grid().lattice(self.level)?;
        let by_structure = ElasticBody::of_volume(&lattice, volume)?;
        let body = match self.tissue {
            None => by_structure,
            Some(tissue) => {
                let fills: Vec<f32> =
                    (0..lattice.tree().patches().len()).map(|cell| by_structure.cell(cell).fill).collect();
                let mut fills = fills.into_iter();
                ElasticBody::new(&lattice, |_| ElasticCell { tissue, fill: fills.next().unwrap_or(0.0) })?
            }
        };
        let half_m: f32 = volume.grid().half_axes_m().iter().map(|half| half.z.abs()).sum();
        let held_share = if self.held_share.is_finite() { self.held_share.clamp(0.0, 1.0) } else { 0.0 };
        // A hair more than the share, so that the vertices on its border belong to it.
        let most_m = half_m * (2.0 * held_share - 1.0 + 1e-4);
        let mut body = body.pinned_where(|rest_m| held_share > 0.0 && rest_m.z <= most_m);
        if self.has_sagged && gravity_m_per_s2.is_finite() {
            body.rests_under_m_per_s2 = gravity_m_per_s2;
        }
        Ok((lattice, body))
    }
}
