//! An elastic body: a lattice's cells as tissue, moved by what acts on them.

use super::error::ElasticError;
use super::inverse;
use super::saved::SavedBody;
use super::solver::{Solver, StepSettings};
use super::surface::{Embedded, TouchSurface};
use super::tissue::ElasticTissue;
use super::touch::{BodyEvent, Hold, Press};
use super::touching::Touching;
use crate::deform::lattice::{DeformLattice, Tree};
use bevy::prelude::*;
use glam::{Affine3A, DVec3, Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// Slower than this everywhere, and for [`STEPS_TO_SLEEP`] steps, a body that nothing touches sleeps; metres per second.
const ASLEEP_BELOW_M_PER_S: f32 = 1e-4;
const STEPS_TO_SLEEP: u32 = 30;

/// What a cell of a body holds.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct ElasticCell {
    /// Tissue.
    pub tissue: ElasticTissue,
    /// Share of the cell that is tissue, 0 to 1: mass and stiffness are that much less. Where nothing is, cells follow their
    /// neighbours and hold nothing.
    pub fill: f32,
}

/// Makes a [`DeformLattice`] respond to gravity and instruments: each of its patches is a cell of tissue.
///
/// The solver works in the body's own space and forward: it knows where matter goes. [`ElasticBody::publish`] turns that into the
/// lattice's translations, which say where matter comes from. See the [module](super) for how it works.
#[derive(Component, Clone, Debug, Reflect, Serialize, Deserialize)]
#[serde(try_from = "SavedBody", into = "SavedBody")]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug, Serialize, Deserialize)]
pub struct ElasticBody {
    /// Substeps of a step. More make stiff tissue stiffer and waves livelier. 12 by default.
    pub substeps: u32,
    /// How fast motion dies down by itself, per second: what lies around an organ takes part in that. 1 by default.
    pub drag_per_s: f32,
    /// Gravity under which the body rests as it was made, body space, metres per second squared: a scanned organ lay in a
    /// patient, and its own weight does not make it sag once more. Only what differs from it moves the body, which is right to first order as
    /// long as it is held by its pins. Zero by default.
    pub rests_under_m_per_s2: Vec3,
    /// Whether the lattice follows. Needed by volumes; organs ride without it.
    pub publishes: bool,
    pub(super) tree: Tree,
    body_from_box: Affine3A,
    /// Turns from the box's axes to those of the body.
    body_from_axes: Mat3,
    sides_m: DVec3,
    cells: Vec<(ElasticTissue, f32)>,
    pub(super) solver: Solver,
    pub(super) touching: Touching,
    surface: TouchSurface,
    /// What the lattice was given last, shares of the box.
    published: Vec<Vec3>,
    good: Vec<[f32; 4]>,
    still_steps: u32,
    last_gravity: Vec3,
    has_moved: bool,
    faults: BodyFaults,
}

/// What went wrong so far and was put right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
pub struct BodyFaults {
    /// Steps that ended in numbers that are not finite: the body went back to how it was, without motion.
    pub restored_steps: u64,
    /// Inputs that were not finite and did not count.
    pub odd_inputs: u64,
    /// Translations that could not be found because cells were inverted or left the box; the vertices kept their last ones.
    pub kept_translations: u64,
}

impl ElasticBody {
    /// A body at rest over a lattice. `cell_at` says what is in a cell from its middle, body space, metres. Numbers that cannot be
    /// are brought into range ([`ElasticTissue::bounded`]).
    pub fn new(lattice: &DeformLattice, mut cell_at: impl FnMut(Vec3) -> ElasticCell) -> Result<Self, ElasticError> {
        let body_from_box = lattice.body_from_box();
        let edges_m = [body_from_box.matrix3.x_axis, body_from_box.matrix3.y_axis, body_from_box.matrix3.z_axis];
        let sides_m = DVec3::from_array(edges_m.map(|edge| edge.as_dvec3().length()));
        let axes = [0, 1, 2].map(|n| edges_m[n].as_dvec3() / sides_m[n]);
        let is_sheared = [(0, 1), (1, 2), (2, 0)].iter().any(|&(a, b)| axes[a].dot(axes[b]).abs() > 1e-4);
        if is_sheared {
            return Err(ElasticError::Sheared { edges_m: edges_m.map(Vec3::from) });
        }
        let tree = lattice.tree().clone();
        let cells: Vec<(ElasticTissue, f32)> = tree
            .patches()
            .iter()
            .map(|patch| {
                let middle = patch.low() + DVec3::splat(0.5 * patch.side());
                let cell = cell_at(body_from_box.transform_point3(middle.as_vec3()));
                let fill = if cell.fill.is_finite() { cell.fill.clamp(0.0, 1.0) } else { 0.0 };
                (cell.tissue.bounded(), fill)
            })
            .collect();
        if cells.iter().all(|(_, fill)| *fill == 0.0) {
            return Err(ElasticError::Empty);
        }
        let solver = Solver::new(&tree, &cells, sides_m);
        let surface = TouchSurface::of_cells(&tree, |number| cells[number].1, sides_m);
        let published = vec![Vec3::ZERO; tree.vertex_count()];
        let [x, y, z] = axes.map(|axis| axis.as_vec3());
        Ok(Self {
            substeps: 12,
            drag_per_s: 1.0,
            rests_under_m_per_s2: Vec3::ZERO,
            publishes: true,
            tree,
            body_from_box,
            body_from_axes: Mat3::from_cols(x, y, z),
            sides_m,
            cells,
            solver,
            touching: Touching::default(),
            surface,
            published,
            good: Vec::new(),
            still_steps: 0,
            last_gravity: Vec3::ZERO,
            has_moved: false,
            faults: BodyFaults::default(),
        })
    }

    /// A body of one tissue that fills the box.
    pub fn uniform(lattice: &DeformLattice, tissue: ElasticTissue) -> Result<Self, ElasticError> {
        Self::new(lattice, |_| ElasticCell { tissue, fill: 1.0 })
    }

    /// Pins all vertices that rest where a rule says so; body space, metres. Constrained ones follow the others.
    pub fn pinned_where(mut self, mut is_pinned: impl FnMut(Vec3) -> bool) -> Self {
        for vertex in 0..self.tree.vertex_count() {
            if !self.tree.is_constrained(vertex) && is_pinned(self.rest_m(vertex)) {
                self.solver.pin(vertex, true);
            }
        }
        self
    }

    /// Pins a vertex where it is, or lets it go.
    pub fn pin(&mut self, vertex: usize, is_pinned: bool) -> Result<(), ElasticError> {
        let count = self.tree.vertex_count();
        if vertex >= count || self.tree.is_constrained(vertex) {
            return Err(ElasticError::NoVertex { vertex, count });
        }
        self.solver.pin(vertex, is_pinned);
        self.still_steps = 0;
        Ok(())
    }

    /// Whether a vertex is pinned.
    pub fn is_pinned(&self, vertex: usize) -> bool {
        self.solver.is_pinned(vertex)
    }

    /// Cells, vertices and which of those follow others.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Leads from shares of the box to the body's own space, metres.
    pub fn body_from_box(&self) -> Affine3A {
        self.body_from_box
    }

    /// What is in a cell, by the number of its patch.
    pub fn cell(&self, number: usize) -> ElasticCell {
        let (tissue, fill) = self.cells[number];
        ElasticCell { tissue, fill }
    }

    /// Side lengths of the box, metres.
    pub fn sides_m(&self) -> DVec3 {
        self.sides_m
    }

    /// Where a vertex rests; body space, metres.
    pub fn rest_m(&self, vertex: usize) -> Vec3 {
        self.body_from_box.transform_point3(self.tree.place_of(vertex).as_vec3())
    }

    /// How far a vertex is from where it rests; body space, metres.
    pub fn displacement_m(&self, vertex: usize) -> Vec3 {
        self.body_from_axes * self.solver.displacement(vertex)
    }

    /// Velocity of a vertex; body space, metres per second.
    pub fn velocity_m_per_s(&self, vertex: usize) -> Vec3 {
        self.body_from_axes * self.solver.velocity(vertex)
    }

    /// Mass that moves with a vertex, kilograms. That of constrained vertices counts with those that they follow.
    pub fn mass_kg(&self, vertex: usize) -> f32 {
        self.solver.mass_kg(vertex)
    }

    /// Sets how far vertices are from where they rest, and how fast they move, from their rest places; body space, metres. Pinned ones are
    /// held where they are put.
    pub fn displace(&mut self, mut displacement_and_velocity: impl FnMut(Vec3) -> (Vec3, Vec3)) {
        let axes_from_body = self.body_from_axes.transpose();
        for vertex in 0..self.tree.vertex_count() {
            let (by, velocity) = displacement_and_velocity(self.rest_m(vertex));
            if by.is_finite() && velocity.is_finite() {
                self.solver.place(vertex, axes_from_body * by, axes_from_body * velocity);
            } else {
                self.faults.odd_inputs += 1;
            }
        }
        self.solver.follow();
        self.still_steps = 0;
        self.has_moved = true;
    }

    /// Pushes at a place in the next step; rest place in body space, metres, force in newtons.
    pub fn apply_force(&mut self, rest_m: Vec3, force_n: Vec3) {
        if !(rest_m.is_finite() && force_n.is_finite()) {
            self.faults.odd_inputs += 1;
            return;
        }
        let embedded = self.embed(rest_m);
        let force_n = self.body_from_axes.transpose() * force_n;
        for (corner, weight) in embedded.corners.into_iter().zip(embedded.weights) {
            let mut shares = [(0, 0.0); 4];
            let mut count = 0;
            self.solver.free_nodes(corner, |node, share| {
                shares[count] = (node, share);
                count += 1;
            });
            for &(node, share) in &shares[..count] {
                self.solver.push(node as usize, force_n * (weight * share));
            }
        }
        self.still_steps = 0;
    }

    /// How a rest place of the body rides.
    pub(crate) fn embed(&self, rest_m: Vec3) -> Embedded {
        Embedded::new(&self.tree, self.body_from_box.inverse().transform_point3(rest_m).as_dvec3())
    }

    /// How far something that rides is from where it rests; body space, metres.
    #[inline]
    pub(crate) fn displacement_of(&self, embedded: &Embedded) -> Vec3 {
        self.body_from_axes * embedded.displacement(|node| self.solver.displacement(node))
    }

    /// Where matter is now that rests at a place; body space, metres. What rests beyond the box moves like its side.
    pub fn moved_m(&self, rest_m: Vec3) -> Vec3 {
        rest_m + self.displacement_of(&self.embed(rest_m))
    }

    /// The surface by which it is touched: triangles that run counter-clockwise seen from outside, over places that rest in body
    /// space, metres. Without it that is the outside of the filled cells.
    pub fn set_surface(&mut self, positions_m: &[Vec3], triangles: &[[u32; 3]]) {
        let count = positions_m.len() as u32;
        let triangles = triangles.iter().copied().filter(|face| face.iter().all(|vertex| *vertex < count)).collect();
        let points = positions_m.iter().map(|&rest_m| self.embed(rest_m)).collect();
        let rest_m = positions_m.iter().map(|&rest_m| self.axes_point(rest_m)).collect();
        self.surface = TouchSurface { points, rest_m, triangles };
        self.touching.forget();
    }

    /// A point of body space in the solver's: along the box's axes from its corner.
    fn axes_point(&self, point_m: Vec3) -> Vec3 {
        let box_from_body = self.body_from_box.inverse();
        (box_from_body.transform_point3(point_m).as_dvec3() * self.sides_m).as_vec3()
    }

    /// From the box's axes to the body's space.
    fn body_from_axes(&self) -> Affine3A {
        Affine3A::from_mat3_translation(self.body_from_axes, self.body_from_box.translation.into())
    }

    /// Moves the vertices of its surface, body space, out of the instruments of the last step.
    pub(crate) fn clear_of_tools(&self, positions_m: &mut [Vec3]) {
        if positions_m.len() == self.surface.points.len() {
            self.touching.clear(positions_m, &self.surface.triangles, &self.body_from_axes());
        }
    }

    /// A step of the given length under gravity (body space), with what instruments do in it.
    pub fn step(&mut self, dt_s: f64, gravity_m_per_s2: Vec3, presses: &[Press], holds: &[Hold]) -> Vec<BodyEvent> {
        let axes_from_body = self.body_from_axes.transpose();
        let net = gravity_m_per_s2 - self.rests_under_m_per_s2;
        let gravity = if net.is_finite() { axes_from_body * net } else { self.last_gravity };
        let is_left_alone = presses.is_empty() && holds.is_empty() && gravity == self.last_gravity;
        self.faults.odd_inputs += u64::from(!net.is_finite());
        if !(dt_s.is_finite() && dt_s > 0.0) || (is_left_alone && self.is_asleep()) {
            self.touching.forget_tools();
            self.has_moved = false;
            return Vec::new();
        }
        self.last_gravity = gravity;
        self.good.clear();
        self.good.extend_from_slice(self.solver.nodes());
        let settings = StepSettings {
            // A step of a second and more is no step.
            dt_s: dt_s.min(0.1),
            substeps: self.substeps.clamp(1, 1000),
            gravity_m_per_s2: gravity,
            drag_per_s: if self.drag_per_s.is_nan() { 0.0 } else { self.drag_per_s },
        };
        let to_axes = self.body_from_axes().inverse();
        self.faults.odd_inputs += self.touching.begin(presses, holds, &to_axes, &self.surface, &self.solver, &settings);
        let Self { tree, cells, solver, touching, surface, .. } = self;
        solver
            .step(tree, cells, self.sides_m, &settings, |solver, substep| touching.constrain(solver, surface, substep));
        let mut events = Vec::new();
        if self.solver.is_sound() {
            let stretch_of = |patch: usize| super::measure::stretch(&self.tree, &self.solver, self.sides_m, patch);
            // A cell that the surface only brushes is as soft as it is empty, and stretches more than the tissue in it.
            let tears_at = |patch: usize| {
                let (tissue, fill) = &self.cells[patch];
                1.0 + (tissue.tears_at_stretch - 1.0) / fill.max(0.1)
            };
            events = self.touching.end(&self.surface, &self.solver, &self.body_from_axes(), stretch_of, tears_at);
        } else {
            let good = std::mem::take(&mut self.good);
            self.solver.restore(&good);
            self.good = good;
            self.touching.forget();
            self.faults.restored_steps += 1;
        }
        let is_still = is_left_alone && self.solver.greatest_speed() < ASLEEP_BELOW_M_PER_S;
        self.still_steps = if is_still { self.still_steps + 1 } else { 0 };
        self.has_moved = true;
        events
    }

    /// Whether nothing has moved for half a second, nor will until something acts on the body.
    pub fn is_asleep(&self) -> bool {
        self.still_steps >= STEPS_TO_SLEEP
    }

    /// Whether the last step moved it.
    pub fn has_moved(&self) -> bool {
        self.has_moved
    }

    /// What went wrong so far.
    pub fn faults(&self) -> BodyFaults {
        self.faults
    }

    /// Elastic and kinetic energy, joules (gravity's aside): what bends and twists cells is left out.
    pub fn energy_j(&self) -> f64 {
        super::measure::energy_j(&self.tree, &self.solver, &self.cells, self.sides_m)
    }

    /// Greatest stretch in the middle of a cell, by the number of its patch: 1 at rest.
    pub fn stretch(&self, number: usize) -> f32 {
        super::measure::stretch(&self.tree, &self.solver, self.sides_m, number)
    }

    /// Volume of a cell by the number of its patch as a share of what it was at rest, in its middle; below 0 it is inverted.
    pub fn volume_share(&self, number: usize) -> f32 {
        super::measure::gradient(&self.tree, &self.solver, self.sides_m, number).determinant() as f32
    }

    /// Writes into the lattice where matter comes from: at each vertex, where what is there now rests (paper of 2001, equation 2).
    ///
    /// A vertex for which that is not found keeps its last translation, and is counted in [`ElasticBody::faults`].
    pub fn publish(&mut self, lattice: &mut DeformLattice) -> Result<(), ElasticError> {
        if lattice.tree() != &self.tree {
            return Err(ElasticError::OtherBox);
        }
        let by: Vec<DVec3> = (0..self.tree.vertex_count())
            .map(|vertex| self.solver.displacement(vertex).as_dvec3() / self.sides_m)
            .collect();
        for vertex in 0..by.len() {
            if self.tree.is_constrained(vertex) {
                continue;
            }
            let place = self.tree.place_of(vertex);
            let guesses = [place + self.published[vertex].as_dvec3(), place - by[vertex], place];
            match inverse::found(&self.tree, &by, place, &guesses) {
                Some(rest) => self.published[vertex] = (rest - place).as_vec3(),
                None => self.faults.kept_translations += 1,
            }
        }
        // Finite by construction, and as many as there are vertices.
        lattice.set_translations(&self.published).map_err(|_| ElasticError::OtherBox)
    }

    /// Makes cells of other tissue. What fills them, where all of it is and how fast it moves stays as it is. `tissue_at` gets the middle
    /// of a cell, body space, metres, and what it is made of.
    pub fn change_tissue(&mut self, mut tissue_at: impl FnMut(Vec3, ElasticTissue) -> ElasticTissue) {
        for (patch, cell) in self.tree.patches().iter().zip(&mut self.cells) {
            let middle = patch.low() + DVec3::splat(0.5 * patch.side());
            cell.0 = tissue_at(self.body_from_box.transform_point3(middle.as_vec3()), cell.0).bounded();
        }
        let mut solver = Solver::new(&self.tree, &self.cells, self.sides_m);
        for vertex in 0..self.tree.vertex_count() {
            solver.place(vertex, self.solver.displacement(vertex), self.solver.velocity(vertex));
            solver.pin(vertex, self.solver.is_pinned(vertex));
        }
        solver.follow();
        self.solver = solver;
        self.touching.forget();
        self.still_steps = 0;
    }

    /// Takes over a lattice's other tree over the same box: one that was subdivided, say. Places and velocities go on as they are, and
    /// cells take the tissue of those that they lie in.
    pub fn follow_tree(&mut self, lattice: &DeformLattice) -> Result<(), ElasticError> {
        if lattice.body_from_box() != self.body_from_box {
            return Err(ElasticError::OtherBox);
        }
        let tree = lattice.tree().clone();
        let middle = |n: usize| tree.patches()[n].low() + DVec3::splat(0.5 * tree.patches()[n].side());
        let cells: Vec<_> = (0..tree.patches().len()).map(|n| self.cells[self.tree.patch_at(middle(n))]).collect();
        let mut solver = Solver::new(&tree, &cells, self.sides_m);
        let mut published = Vec::with_capacity(tree.vertex_count());
        for vertex in 0..tree.vertex_count() {
            let old = Embedded::new(&self.tree, tree.place_of(vertex));
            let displacement = old.displacement(|node| self.solver.displacement(node));
            solver.place(vertex, displacement, old.displacement(|node| self.solver.velocity(node)));
            published.push(old.displacement(|node| self.published[node]));
            // Between pinned vertices nothing moved, and nothing does from now on.
            let is_pinned = |n: usize| old.weights[n] == 0.0 || self.solver.is_pinned(old.corners[n] as usize);
            solver.pin(vertex, !tree.is_constrained(vertex) && (0..8).all(is_pinned));
        }
        solver.follow();
        let places: Vec<Vec3> = self.surface.rest_m.clone();
        (self.tree, self.cells, self.solver, self.published) = (tree, cells, solver, published);
        self.surface.points =
            places.iter().map(|rest| Embedded::new(&self.tree, rest.as_dvec3() / self.sides_m)).collect();
        self.touching.forget();
        self.still_steps = 0;
        Ok(())
    }
}
