//! Where an organ's vertices are now.

use super::OrganModel;
use super::mesh::vertex_normals_into;
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;

/// Shows an [`OrganModel`] at the entity's transform.
///
/// [`OrganShape`] is added once the model is loaded. Add a [`Skin`](crate::skin::Skin) to see it.
#[derive(Component, Clone, Debug, Default, FromTemplate, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
#[require(Transform)]
#[cfg_attr(feature = "render", require(Visibility))]
pub struct Organ(pub Handle<OrganModel>);

/// Draws both sides of a closed [`Organ`]: for hollow ones that a scope is inside of.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct Hollow;

/// The organ's primary vertices as they are now, in the organ's space.
///
/// Deformation writes [`OrganShape::move_vertices`] in [`SurgerySystems::Deform`]; the normals follow in
/// [`SurgerySystems::Publish`], the box for culling before the frame is drawn. The skin's secondary vertices are fixed
/// combinations of these.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct OrganShape {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    normals_are_stale: bool,
    /// Whose vertices these are.
    #[reflect(ignore)]
    model: Option<OrganModel>,
}

impl OrganShape {
    /// The shape at rest.
    pub fn at_rest(model: &OrganModel) -> Self {
        Self {
            positions_m: model.mesh.positions_m.clone(),
            normals: model.mesh.vertex_normals(),
            normals_are_stale: false,
            model: Some(model.clone()),
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

    /// Whether these are the vertices of a model. An organ whose model is exchanged keeps its old shape until the new
    /// model has arrived.
    pub fn is_of(&self, model: &OrganModel) -> bool {
        self.model.as_ref().is_some_and(|own| own.is_same(model))
    }

    /// The positions, to be written. Their number cannot change.
    pub fn move_vertices(&mut self) -> &mut [Vec3] {
        self.normals_are_stale = true;
        &mut self.positions_m
    }
}

/// The models that organs wait for: those that are not loaded, or whose shape they do not have yet. An organ whose
/// model is exchanged keeps its old shape until the new model has arrived.
pub fn awaited_models<'w>(
    models: &Assets<OrganModel>,
    organs: impl Iterator<Item = (&'w Organ, Option<&'w OrganShape>)>,
) -> Vec<Handle<OrganModel>> {
    let is_shaped = |organ: &Organ, shape: Option<&OrganShape>| {
        models.get(&organ.0).zip(shape).is_some_and(|(model, shape)| shape.is_of(model))
    };
    organs.filter(|(organ, shape)| !is_shaped(organ, *shape)).map(|(organ, _)| organ.0.clone()).collect()
}

/// In `PreUpdate`: organs whose model has arrived get their [`OrganShape`].
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ShapeOrgans;

pub(super) fn build(app: &mut App) {
    app.register_type::<Organ>()
        .register_type::<OrganShape>()
        .register_type::<Hollow>()
        .keep_large_component(|shape: &OrganShape| size_of_val(shape.positions_m()) + size_of_val(shape.normals()))
        .add_systems(PreUpdate, shape_loaded_organs.in_set(ShapeOrgans))
        .add_systems(FixedUpdate, follow_moved_vertices.in_set(SurgerySystems::Publish));
}

/// Gives organs their rest shape when the model has arrived, and again when it was exchanged.
fn shape_loaded_organs(
    mut commands: Commands,
    models: Res<Assets<OrganModel>>,
    organs: Query<(Entity, &Organ, Option<&OrganShape>)>,
) {
    for (entity, organ, shape) in &organs {
        if let Some(model) = models.get(&organ.0)
            && !shape.is_some_and(|shape| shape.is_of(model))
        {
            commands.entity(entity).insert(OrganShape::at_rest(model));
        }
    }
}

pub(super) fn follow_moved_vertices(mut shapes: Query<&mut OrganShape, Changed<OrganShape>>) {
    for mut shape in shapes.iter_mut().filter(|shape| shape.normals_are_stale) {
        let OrganShape { positions_m, normals, normals_are_stale, model: Some(model) } = &mut *shape else { continue };
        vertex_normals_into(positions_m, &model.mesh.triangles, normals);
        *normals_are_stale = false;
    }
}
