//! Organs that ride in a lattice: their primary vertices move with it, and all that is defined on their surface with them.
//!
//! With an [`ElasticBody`] they are embedded in its forward motion; with a [`DeformLattice`] alone they go where it shows the
//! matter that rests at their vertices.

use super::DeformBodies;
use super::elastic::{ElasticBody, ElasticCell, ElasticError, ElasticTissue, Embedded, StepBodies, inverse};
use super::error::LatticeError;
use super::lattice::{DeformLattice, Patch, Tree};
use crate::checkpoint::KeepState;
use crate::organ::pick::OrganPicker;
use crate::organ::{Organ, OrganModel, OrganShape, ShapeOrgans};
use bevy::prelude::*;
use glam::DVec3;
use std::collections::BTreeSet;
use tracing::warn;

/// Samples along each side of a cell that tell how much of it is inside an organ.
const SAMPLES: usize = 3;

impl DeformLattice {
    /// A lattice at rest around an organ, `2^level` patches along each side; `margin` is left on each side as a share of the organ's
    /// greatest extent.
    pub fn around_organ(model: &OrganModel, level: u32, margin: f32) -> Result<Self, LatticeError> {
        let (low_m, high_m) = model.mesh.bounds_m();
        let margin_m = Vec3::splat((high_m - low_m).max_element() * margin.max(0.0));
        Self::new(low_m - margin_m, high_m + margin_m, level)
    }

    /// Subdivides patches that a rule picks, until they are of a level; it is asked with a patch's lower and upper corner in the body's
    /// space, metres (of boxes that are not turned).
    pub fn refine_where(&mut self, level: u32, mut picks: impl FnMut(Vec3, Vec3) -> bool) -> Result<(), LatticeError> {
        let body_from_box = self.body_from_box();
        for coarser in 0..level {
            let picked: Vec<Patch> = self
                .tree()
                .patches()
                .iter()
                .filter(|patch| patch.level == coarser)
                .filter(|patch| {
                    let ends = [patch.low(), patch.low() + DVec3::splat(patch.side())];
                    let [a, b] = ends.map(|end| body_from_box.transform_point3(end.as_vec3()));
                    picks(a.min(b), a.max(b))
                })
                .copied()
                .collect();
            self.subdivide_all(&picked)?;
        }
        Ok(())
    }
}

impl ElasticBody {
    /// A body that an organ fills, of one tissue. Cells hold as much as is inside the organ's surface, and instruments touch that
    /// surface. An open (planar) organ fills its box.
    pub fn of_organ(
        lattice: &DeformLattice,
        model: &OrganModel,
        tissue: ElasticTissue,
    ) -> Result<ElasticBody, ElasticError> {
        let picker = OrganPicker::build(&model.mesh.triangles, &model.mesh.positions_m);
        let is_closed = model.atlas.is_spherical();
        let is_inside = |place_m: Vec3| {
            // A ray that leaves meets the inside of the surface first.
            picker.cast_ray(place_m.as_dvec3(), DVec3::X, f64::INFINITY).is_some_and(|hit| !hit.is_front)
        };
        let (tree, body_from_box) = (lattice.tree(), lattice.body_from_box());
        let mut numbers = 0..tree.patches().len();
        let mut body = ElasticBody::new(lattice, |_| {
            // Asked in the order of the patches.
            let patch = tree.patches()[numbers.next().unwrap_or_default()];
            let sample = |n: usize| {
                let cell =
                    DVec3::new((n % SAMPLES) as f64, (n / SAMPLES % SAMPLES) as f64, (n / SAMPLES / SAMPLES) as f64);
                let place = patch.low() + (cell + 0.5) * (patch.side() / SAMPLES as f64);
                body_from_box.transform_point3(place.as_vec3())
            };
            let count = SAMPLES * SAMPLES * SAMPLES;
            let inside = (0..count).filter(|&n| !is_closed || is_inside(sample(n))).count();
            let fill = inside as f32 / count as f32;
            let mut own = tissue;
            if fill < 1.0 {
                // The capsule lies in this cell, and what it adds is spread over the tissue in it.
                let sides = (0..3).map(|axis| body_from_box.matrix3.col(axis).length()).product::<f32>().cbrt();
                own.youngs_modulus_pa += tissue.capsule_n_per_m / (sides * patch.side() as f32 * fill.max(0.2));
            }
            ElasticCell { tissue: own, fill }
        })?;
        body.set_surface(&model.mesh.positions_m, &model.mesh.triangles);
        Ok(body)
    }
}

/// How an organ's vertices ride; added to organs with a lattice or a body.
#[derive(Component, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Default, Clone, Debug)]
pub struct OrganRide {
    model: Option<OrganModel>,
    tree: Option<Tree>,
    vertices: Vec<Embedded>,
    /// The vertices do not lie where the ride has them.
    is_new: bool,
}

impl OrganRide {
    fn is_of(&self, model: &OrganModel, tree: &Tree) -> bool {
        self.model.as_ref().is_some_and(|own| own.is_same(model)) && self.tree.as_ref() == Some(tree)
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<OrganRide>()
        .keep_large_component(|ride: &OrganRide| size_of_val(ride.vertices.as_slice()))
        .add_systems(PreUpdate, add_rides.after(ShapeOrgans))
        .add_systems(
            FixedUpdate,
            (move_with_bodies, move_with_lattices)
                .chain()
                .after(StepBodies)
                .in_set(DeformBodies)
                .run_if(resource_exists::<Assets<OrganModel>>),
        );
}

fn add_rides(
    mut commands: Commands,
    organs: Query<Entity, (With<OrganShape>, Without<OrganRide>, Or<(With<ElasticBody>, With<DeformLattice>)>)>,
) {
    for entity in &organs {
        commands.entity(entity).insert(OrganRide::default());
    }
}

/// Embeds organs anew whose model or tree was exchanged, and gives bodies their surface.
pub(super) fn refresh_rides(
    models: Option<Res<Assets<OrganModel>>>,
    mut organs: Query<(&Organ, &OrganShape, &mut OrganRide, &mut ElasticBody)>,
) {
    let Some(models) = models else { return };
    for (organ, shape, mut ride, mut body) in &mut organs {
        let Some(model) = models.get(&organ.0).filter(|model| shape.is_of(model)) else { continue };
        if ride.is_of(model, body.tree()) {
            continue;
        }
        if !ride.model.as_ref().is_some_and(|own| own.is_same(model)) {
            body.set_surface(&model.mesh.positions_m, &model.mesh.triangles);
        }
        let vertices = model.mesh.positions_m.iter().map(|&rest_m| body.embed(rest_m)).collect();
        *ride = OrganRide { model: Some(model.clone()), tree: Some(body.tree().clone()), vertices, is_new: true };
    }
}

/// Takes vertices along with bodies, and out of instruments where the cells are too coarse for that.
fn move_with_bodies(mut organs: Query<(&mut OrganShape, &mut OrganRide, &ElasticBody)>) {
    for (mut shape, mut ride, body) in &mut organs {
        let Some(model) = ride.model.clone().filter(|model| shape.is_of(model)) else { continue };
        if !(body.has_moved() || ride.is_new) || ride.tree.as_ref() != Some(body.tree()) {
            continue;
        }
        let positions_m = shape.move_vertices();
        for ((position_m, rest_m), vertex) in positions_m.iter_mut().zip(&model.mesh.positions_m).zip(&ride.vertices) {
            *position_m = *rest_m + body.displacement_of(vertex);
        }
        body.clear_of_tools(positions_m);
        ride.is_new = false;
    }
}

/// Moves organs that have a lattice alone to where it shows them.
fn move_with_lattices(
    mut organs: Query<
        (Entity, &mut OrganShape, &mut OrganRide, Ref<DeformLattice>, Option<&Name>),
        Without<ElasticBody>,
    >,
    models: Res<Assets<OrganModel>>,
    handles: Query<&Organ>,
    mut told_of: Local<BTreeSet<Entity>>,
) {
    for (entity, mut shape, mut ride, lattice, name) in &mut organs {
        let model = handles.get(entity).ok().and_then(|organ| models.get(&organ.0));
        let Some(model) = model.filter(|model| shape.is_of(model)) else { continue };
        let is_new = !ride.model.as_ref().is_some_and(|own| own.is_same(model));
        if !(is_new || lattice.is_changed()) {
            continue;
        }
        ride.model = Some(model.clone());
        let by: Vec<DVec3> = lattice.translations().iter().map(|translation| translation.as_dvec3()).collect();
        let (tree, box_from_body, body_from_box) = (lattice.tree(), lattice.box_from_body(), lattice.body_from_box());
        let mut lost = 0;
        for (position_m, rest_m) in shape.move_vertices().iter_mut().zip(&model.mesh.positions_m) {
            let rest = box_from_body.transform_point3(*rest_m).as_dvec3();
            let last = box_from_body.transform_point3(*position_m).as_dvec3();
            let guess = rest - lattice.translation_at(rest);
            match inverse::found(tree, &by, rest, &[guess, last, rest]) {
                // Straight from the translation, so that what rests stays bit for bit.
                Some(shown) => *position_m = *rest_m + body_from_box.transform_vector3((shown - rest).as_vec3()),
                None => lost += 1,
            }
        }
        if lost > 0 && told_of.insert(entity) {
            let name = name.map_or_else(|| format!("organ {entity}"), |name| format!("organ \"{name}\" ({entity})"));
            warn!("{name}: its lattice folds over itself at {lost} vertices; they stay where they were");
        }
    }
}
