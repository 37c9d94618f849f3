//! The solver: nodes of a tree of cells, moved in small substeps.
//!
//! It is XPBD in small substeps (Macklin, Storey, Lu et al. 2019, "Small steps in physics simulation"): each substep moves all
//! nodes as if they were free, then relaxes one cell after another, and takes the velocities from what came out.
//! Each relaxation is an implicit step of that cell's energy; the substeps are short against what sound needs to pass a cell of soft
//! tissue, so that forces come out right without iterating. What is too stiff for that (bone) comes out somewhat softer than it is,
//! and still hardly gives way. Unlike implicit steps with a global system it needs no solver that has to converge, and contacts take
//! part as further constraints.
//!
//! The cells are relaxed forth and then back in every substep, each time with half of their stiffness. That is a map times its own
//! transpose: symmetric, with eigenvalues from 0 to 1, and a motion that takes its velocities from such a map never gains energy,
//! however stiff the cells are, as far as it is linear. Nor does it prefer a side. A sweep whose direction changes from substep to
//! substep costs half of that and prefers no side either, but its map changes in time, and shakes tissue of which sound passes about a
//! cell in a substep (some 1e5 to 1e6 Pa) ever harder. Two sweeps are also nearer to the true stiffness, so that fewer substeps do.
//!
//! Space: the box's own axes, metres. Nodes hold displacements: a body at rest is all zeros, and stays so bit for bit.

mod cell;
mod lanes;
mod prepare;

use super::tissue::ElasticTissue;
use crate::deform::lattice::Tree;
use cell::{Cells, Node};
use glam::{DVec3, Vec3};

/// Speeds end here, metres per second: single precision would not last for what is beyond.
const MOST_SPEED_M_PER_S: f32 = 100.0;

/// How often a cell is relaxed in a substep: forth and back.
const SWEEPS: f64 = 2.0;

/// A constrained node, which stays in the middle of those that it follows.
#[derive(Clone, Debug)]
struct Following {
    node: u32,
    of: [u32; 4],
    count: u32,
    /// Where corrections of it are gathered.
    gathered: u32,
}

/// What cells, nodes and their motion are. All vectors are in the box's axes, metres.
#[derive(Clone, Debug)]
pub(super) struct Solver {
    /// Displacements with the inverse masses; behind those of the tree's vertices there are places to work.
    nodes: Vec<Node>,
    before: Vec<Node>,
    velocities: Vec<Node>,
    /// What acts on the nodes in this step, newtons.
    forces_n: Vec<Vec3>,
    masses_kg: Vec<f32>,
    pinned: Vec<bool>,
    cells: Vec<Cells>,
    following: Vec<Following>,
    /// Place in `following` by node.
    follows: Vec<Option<u32>>,
    vertex_count: usize,
    /// For which length of substeps the cells were prepared, seconds.
    prepared_for_s: (f64, f64),
}

/// What a step needs to know besides the cells.
#[derive(Clone, Copy, Debug)]
pub(super) struct StepSettings {
    pub dt_s: f64,
    pub substeps: u32,
    pub gravity_m_per_s2: Vec3,
    pub drag_per_s: f32,
}

impl Solver {
    /// Nodes at rest. `cells` are tissue and fill of each patch; sides of the box in metres.
    pub fn new(tree: &Tree, cells: &[(ElasticTissue, f32)], box_sides_m: DVec3) -> Self {
        let vertex_count = tree.vertex_count();
        let constraints = tree.constraints();
        let mut follows = vec![None; vertex_count];
        let following: Vec<Following> = constraints
            .iter()
            .enumerate()
            .map(|(n, constraint)| {
                follows[constraint.vertex] = Some(n as u32);
                let mut of = [0; 4];
                for (place, &vertex) in of.iter_mut().zip(&constraint.of) {
                    *place = vertex as u32;
                }
                let count = constraint.of.len() as u32;
                Following { node: constraint.vertex as u32, of, count, gathered: (vertex_count + 1 + n) as u32 }
            })
            .collect();
        let slots = vertex_count + 1 + following.len();
        let mut made = Self {
            nodes: vec![[0.0; 4]; slots],
            before: vec![[0.0; 4]; slots],
            velocities: vec![[0.0; 4]; slots],
            forces_n: vec![Vec3::ZERO; vertex_count],
            masses_kg: vec![0.0; vertex_count],
            pinned: vec![false; vertex_count],
            cells: Vec::new(),
            following,
            follows,
            vertex_count,
            prepared_for_s: (0.0, 0.0),
        };
        made.weigh(tree, cells, box_sides_m);
        made
    }

    /// Displacement of a node.
    #[inline]
    pub fn displacement(&self, node: usize) -> Vec3 {
        let [x, y, z, _] = self.nodes[node];
        Vec3::new(x, y, z)
    }

    /// Displacement at the beginning of the substep.
    #[inline]
    pub fn displacement_before(&self, node: usize) -> Vec3 {
        let [x, y, z, _] = self.before[node];
        Vec3::new(x, y, z)
    }

    pub fn velocity(&self, node: usize) -> Vec3 {
        let [x, y, z, _] = self.velocities[node];
        Vec3::new(x, y, z)
    }

    pub fn mass_kg(&self, node: usize) -> f32 {
        self.masses_kg[node]
    }

    pub fn is_pinned(&self, node: usize) -> bool {
        self.pinned[node]
    }

    /// Puts a node somewhere, with a velocity. Constrained ones are put right by [`Solver::follow`].
    pub fn place(&mut self, node: usize, displacement_m: Vec3, velocity_m_per_s: Vec3) {
        for axis in 0..3 {
            self.nodes[node][axis] = displacement_m[axis];
            self.velocities[node][axis] = velocity_m_per_s[axis];
        }
    }

    pub fn pin(&mut self, node: usize, is_pinned: bool) {
        if self.pinned[node] != is_pinned {
            self.pinned[node] = is_pinned;
            self.prepared_for_s = (0.0, 0.0);
        }
    }

    pub fn push(&mut self, node: usize, force_n: Vec3) {
        self.forces_n[node] += force_n;
    }

    /// The free nodes that a vertex depends on, and by which shares.
    #[inline]
    pub fn free_nodes(&self, vertex: u32, mut each: impl FnMut(u32, f32)) {
        match self.follows[vertex as usize] {
            None => each(vertex, 1.0),
            Some(n) => {
                let following = &self.following[n as usize];
                let share = 1.0 / following.count as f32;
                following.of[..following.count as usize].iter().for_each(|&node| each(node, share));
            }
        }
    }

    /// Inverse of a free node's mass; 0 where it is pinned.
    #[inline]
    pub fn mobility(&self, node: u32) -> f32 {
        self.nodes[node as usize][3]
    }

    /// Moves a free node.
    #[inline]
    pub fn shift(&mut self, node: u32, by: Vec3) {
        let node = &mut self.nodes[node as usize];
        node[0] += by.x;
        node[1] += by.y;
        node[2] += by.z;
    }

    /// Puts all constrained nodes into the middle of those that they follow.
    pub fn follow(&mut self) {
        for n in 0..self.following.len() {
            follow(&mut self.nodes, &self.following[n]);
            follow(&mut self.velocities, &self.following[n]);
        }
    }

    /// Puts the constrained node of a vertex right, if it is one.
    #[inline]
    pub fn follow_one(&mut self, vertex: u32) {
        if let Some(n) = self.follows[vertex as usize] {
            follow(&mut self.nodes, &self.following[n as usize]);
        }
    }

    /// A step in substeps; `constrain` is called in each, after the cells, with its number.
    pub fn step(
        &mut self,
        tree: &Tree,
        cells: &[(ElasticTissue, f32)],
        box_sides_m: DVec3,
        settings: &StepSettings,
        mut constrain: impl FnMut(&mut Self, u32),
    ) {
        let substeps = settings.substeps.max(1);
        let substep_s = settings.dt_s / f64::from(substeps);
        if self.prepared_for_s != (substep_s, settings.dt_s) {
            self.prepare(tree, cells, box_sides_m, substep_s, settings.dt_s);
            self.prepared_for_s = (substep_s, settings.dt_s);
        }
        let dt_s = substep_s as f32;
        let keep = (-settings.drag_per_s.max(0.0) * dt_s).exp();
        for substep in 0..substeps {
            self.begin(dt_s, settings.gravity_m_per_s2);
            for is_backward in [false, true] {
                run(Sweep::Relax { is_backward }, &mut self.cells, &self.following, &mut self.nodes);
            }
            constrain(self, substep);
            self.end(dt_s, keep);
        }
        run(Sweep::Damp, &mut self.cells, &self.following, &mut self.velocities);
        self.follow();
        self.forces_n.fill(Vec3::ZERO);
    }

    /// Moves free nodes as if there were no cells.
    fn begin(&mut self, dt_s: f32, gravity_m_per_s2: Vec3) {
        let free = self.nodes.iter_mut().zip(&mut self.before).zip(&mut self.velocities).zip(&self.forces_n);
        for (((node, before), velocity), force_n) in free {
            *before = *node;
            if node[3] == 0.0 {
                continue;
            }
            for axis in 0..3 {
                velocity[axis] += dt_s * (gravity_m_per_s2[axis] + node[3] * force_n[axis]);
                node[axis] += dt_s * velocity[axis];
            }
        }
    }

    fn end(&mut self, dt_s: f32, keep: f32) {
        let per_s = keep / dt_s;
        let moved = self.nodes.iter().zip(&self.before).zip(&mut self.velocities).take(self.vertex_count);
        for ((node, before), velocity) in moved {
            let v = Vec3::new(node[0] - before[0], node[1] - before[1], node[2] - before[2]) * per_s;
            // Not `clamp_length`: what is at rest stays so bit for bit.
            let speed = v.length();
            let v = if speed > MOST_SPEED_M_PER_S { v * (MOST_SPEED_M_PER_S / speed) } else { v };
            velocity[..3].copy_from_slice(&v.to_array());
        }
    }

    /// Whether all numbers are finite.
    pub fn is_sound(&self) -> bool {
        let sum = |nodes: &[Node]| nodes.iter().flatten().map(|part| part * 0.0).sum::<f32>();
        sum(&self.nodes) == 0.0 && sum(&self.velocities) == 0.0
    }

    /// Goes back to what the nodes of another moment were, without motion.
    pub fn restore(&mut self, nodes: &[Node]) {
        for (node, other) in self.nodes.iter_mut().zip(nodes) {
            node[..3].copy_from_slice(&other[..3]);
        }
        for velocity in &mut self.velocities {
            velocity[..3].fill(0.0);
        }
        for cells in &mut self.cells {
            cells.turn = prepare::unturned();
        }
        self.forces_n.fill(Vec3::ZERO);
    }

    /// The nodes, to come back to them.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Greatest speed of a node, metres per second.
    pub fn greatest_speed(&self) -> f32 {
        let speeds = (0..self.vertex_count).map(|node| self.velocity(node).length_squared());
        speeds.fold(0.0, f32::max).sqrt()
    }
}

#[inline(always)]
fn follow(nodes: &mut [Node], following: &Following) {
    let mut sum = [0.0; 3];
    for &node in &following.of[..following.count as usize] {
        for axis in 0..3 {
            sum[axis] += nodes[node as usize][axis];
        }
    }
    let share = 1.0 / following.count as f32;
    for axis in 0..3 {
        nodes[following.node as usize][axis] = sum[axis] * share;
    }
}

/// Hands what was done to a constrained node to those that it follows.
#[inline(always)]
fn hand_on(nodes: &mut [Node], following: &Following) {
    let gathered = nodes[following.gathered as usize];
    let share = 1.0 / following.count as f32;
    for &node in &following.of[..following.count as usize] {
        let node = &mut nodes[node as usize];
        let by = node[3] * share;
        for axis in 0..3 {
            node[axis] += by * gathered[axis];
        }
    }
    nodes[following.gathered as usize] = [0.0; 4];
}

#[derive(Clone, Copy)]
enum Sweep {
    Relax { is_backward: bool },
    Damp,
}

#[inline(always)]
fn sweep(what: Sweep, cells: &mut [Cells], following: &[Following], nodes: &mut [Node]) {
    let count = cells.len();
    for n in 0..count {
        let is_backward = matches!(what, Sweep::Relax { is_backward: true });
        let cells = &mut cells[if is_backward { count - 1 - n } else { n }];
        for &n in &cells.following {
            follow(nodes, &following[n as usize]);
        }
        match what {
            Sweep::Relax { .. } => cell::relax(cells, nodes),
            Sweep::Damp => cell::damp(cells, nodes),
        }
        for &n in &cells.following {
            hand_on(nodes, &following[n as usize]);
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_avx2(what: Sweep, cells: &mut [Cells], following: &[Following], nodes: &mut [Node]) {
    sweep(what, cells, following, nodes);
}

/// Goes over all cells with the best that the processor has. Nothing is fused, so the bits are the same.
#[allow(unsafe_code)]
fn run(what: Sweep, cells: &mut [Cells], following: &[Following], nodes: &mut [Node]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has the only feature that the function asks for.
        unsafe { sweep_avx2(what, cells, following, nodes) };
        return;
    }
    sweep(what, cells, following, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_processors_leave_the_same_bits() {
        let tree = Tree::uniform(2).expect("a tree");
        let cells = vec![(ElasticTissue::LIVER, 1.0); tree.patches().len()];
        let sides_m = DVec3::new(0.2, 0.15, 0.1);
        let mut solver = Solver::new(&tree, &cells, sides_m);
        for node in 0..tree.vertex_count() {
            let wave = |by: f32| 0.01 * (by * node as f32).sin();
            solver.place(node, Vec3::new(wave(1.0), wave(2.0), wave(3.0)), Vec3::new(wave(4.0), 0.0, wave(5.0)));
        }
        solver.prepare(&tree, &cells, sides_m, 1e-3, 16e-3);
        let mut plain = solver.clone();
        for is_backward in [false, true, false] {
            run(Sweep::Relax { is_backward }, &mut solver.cells, &solver.following, &mut solver.nodes);
            sweep(Sweep::Relax { is_backward }, &mut plain.cells, &plain.following, &mut plain.nodes);
        }
        run(Sweep::Damp, &mut solver.cells, &solver.following, &mut solver.velocities);
        sweep(Sweep::Damp, &mut plain.cells, &plain.following, &mut plain.velocities);
        let bits = |nodes: &[Node]| nodes.iter().flatten().map(|part| part.to_bits()).collect::<Vec<u32>>();
        assert_eq!(bits(&solver.nodes), bits(&plain.nodes));
        assert_eq!(bits(&solver.velocities), bits(&plain.velocities));
        assert!(solver.is_sound());
    }
}
