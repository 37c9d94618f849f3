//! Where an organ's vertices are now.

use super::OrganModel;
use super::mesh::vertex_normals_into;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;

/// Shows an [`OrganModel`] at the entity's transform.
///
/// [`OrganShape`] is added once the model is loaded. Add a [`Skin`](crate::skin::Skin) to see it.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct Organ(pub Handle<OrganModel>);

/// The organ's primary vertices as they are now, in the organ's space.
///
/// Deformation writes [`OrganShape::move_vertices`] in [`SurgerySystems::Deform`]; normals and bounds follow in
/// [`SurgerySystems::Publish`]. The skin's secondary vertices are fixed combinations of these.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct OrganShape {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    revision: u64,
    normals_are_stale: bool,
}

impl OrganShape {
    /// The shape at rest.
    pub fn at_rest(model: &OrganModel) -> Self {
        Self {
            positions_m: model.mesh.positions_m.clone(),
            normals: model.mesh.vertex_normals(),
            revision: 0,
            normals_are_stale: false,
        }
    }

    /// Positions of the primary vertices, organ space, metres.
    pub fn positions_m(&self) -> &[Vec3] {
        &self.positions_m
    }

    /// Unit normals of the primary vertices, organ space.
    pub fn normals(&self) -> &[Vec3] {
        &self.normals
    }

    /// Counts the changes, so that copies elsewhere know when they are old.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The positions, to be written. Their number cannot change.
    pub fn move_vertices(&mut self) -> &mut [Vec3] {
        self.revision += 1;
        self.normals_are_stale = true;
        &mut self.positions_m
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<Organ>()
        .register_type::<OrganShape>()
        .add_systems(PreUpdate, shape_loaded_organs)
        .add_systems(FixedUpdate, follow_moved_vertices.in_set(SurgerySystems::Publish));
}

/// Gives organs their rest shape when the model has arrived, and again when it was replaced.
fn shape_loaded_organs(
    mut commands: Commands,
    models: Res<Assets<OrganModel>>,
    mut events: MessageReader<AssetEvent<OrganModel>>,
    organs: Query<(Entity, Ref<Organ>, Has<OrganShape>)>,
) {
    let mut replaced = Vec::new();
    for event in events.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Added { id } = event {
            replaced.push(*id);
        }
    }
    for (entity, organ, has_shape) in &organs {
        let is_due = !has_shape || organ.is_changed() || replaced.contains(&organ.0.id());
        if let Some(model) = models.get(&organ.0).filter(|_| is_due) {
            commands.entity(entity).insert(OrganShape::at_rest(model));
        }
    }
}

fn follow_moved_vertices(
    models: Res<Assets<OrganModel>>,
    mut organs: Query<(&Organ, &mut OrganShape), Changed<OrganShape>>,
) {
    for (organ, mut shape) in &mut organs {
        let Some(model) = models.get(&organ.0).filter(|_| shape.normals_are_stale) else { continue };
        let shape = &mut *shape;
        vertex_normals_into(&shape.positions_m, &model.mesh.triangles, &mut shape.normals);
        shape.normals_are_stale = false;
    }
}
