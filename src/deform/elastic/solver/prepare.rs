//! What is known of the cells before a step: masses, which cells go together, and their matrices.

use super::cell::{Cells, PATTERNS, counted, entry, sign};
use super::lanes::{LANES, Lanes};
use super::{Following, SWEEPS, Solver};
use crate::deform::elastic::tissue::ElasticTissue;
use crate::deform::lattice::Tree;
use glam::DVec3;

/// Share of tissue that cells without any count as: they follow their neighbours like a froth of the same tissue, and hold nothing.
const FROTH: f64 = 1e-3;

/// Least softness of a pattern as a share of its mobility. What is stiffer could not be told from it in single precision.
const LEAST_SOFTNESS: f64 = 1e-4;

/// Share of its tissue that a cell has.
fn share(fill: f32) -> f64 {
    f64::from(fill).clamp(FROTH, 1.0)
}

/// Rotation of a cell at rest.
pub(super) fn unturned() -> [Lanes; 4] {
    [Lanes::ZERO, Lanes::ZERO, Lanes::ZERO, Lanes::splat(1.0)]
}

impl Solver {
    /// Gives each node an eighth of the cells around it; what constrained ones have goes to those that they follow.
    pub(super) fn weigh(&mut self, tree: &Tree, cells: &[(ElasticTissue, f32)], box_sides_m: DVec3) {
        let mut masses_kg = vec![0.0_f64; self.vertex_count];
        for (number, (patch, (tissue, fill))) in tree.patches().iter().zip(cells).enumerate() {
            let volume_m3 = (box_sides_m * patch.side()).element_product();
            let eighth_kg = f64::from(tissue.density_kg_per_m3) * volume_m3 * share(*fill) / 8.0;
            for vertex in tree.corners(number) {
                self.free_nodes(vertex as u32, |node, by| masses_kg[node as usize] += eighth_kg * f64::from(by));
            }
        }
        self.masses_kg = masses_kg.iter().map(|mass_kg| *mass_kg as f32).collect();
    }

    /// Makes what depends on the pins and on the length of the substeps.
    pub(super) fn prepare(
        &mut self,
        tree: &Tree,
        cells: &[(ElasticTissue, f32)],
        box_sides_m: DVec3,
        substep_s: f64,
        step_s: f64,
    ) {
        for node in 0..self.vertex_count {
            let is_free = !self.pinned[node] && self.follows[node].is_none();
            let inverse = if is_free && self.masses_kg[node] > 0.0 { 1.0 / self.masses_kg[node] } else { 0.0 };
            self.nodes[node][3] = inverse;
            if inverse == 0.0 && self.follows[node].is_none() {
                self.velocities[node] = [0.0; 4];
            }
            self.velocities[node][3] = inverse;
        }
        let turns = self.turns();
        self.cells = self.groups(tree);
        let cell_count = cells.len();
        for group in 0..self.cells.len() {
            for lane in 0..LANES {
                let number = self.cells[group].numbers[lane] as usize;
                if number >= cell_count {
                    continue;
                }
                let sides_m = box_sides_m * tree.patches()[number].side();
                let made = self.matrices(tree.corners(number), &cells[number], sides_m, substep_s, step_s);
                let cells = &mut self.cells[group];
                made.put(cells, lane);
                if let Some(turn) = turns.get(number) {
                    (0..4).for_each(|part| cells.turn[part].0[lane] = turn[part]);
                }
            }
        }
        // Constrained nodes pass corrections on whole: their places weigh one.
        for following in &self.following {
            self.nodes[following.node as usize][3] = 1.0;
            self.velocities[following.node as usize][3] = 1.0;
        }
    }

    /// Rotations of the cells by their numbers.
    fn turns(&self) -> Vec<[f32; 4]> {
        let mut turns = Vec::new();
        for cells in &self.cells {
            for lane in 0..LANES {
                let number = cells.numbers[lane] as usize;
                if number == u32::MAX as usize {
                    continue;
                }
                if turns.len() <= number {
                    turns.resize(number + 1, [0.0, 0.0, 0.0, 1.0]);
                }
                turns[number] = cells.turn.map(|part| part.0[lane]);
            }
        }
        turns
    }

    /// Cells in groups of eight that share no free node.
    fn groups(&self, tree: &Tree) -> Vec<Cells> {
        let mut taken: Vec<u64> = vec![0; self.vertex_count];
        let mut colours: Vec<Vec<u32>> = Vec::new();
        for number in 0..tree.patches().len() {
            let mut used = 0_u64;
            for vertex in tree.corners(number) {
                self.free_nodes(vertex as u32, |node, _| used |= taken[node as usize]);
            }
            // 64 colours are more than neighbours can need; the last would take what is left over.
            let colour = (used.trailing_ones() as usize).min(63);
            for vertex in tree.corners(number) {
                self.free_nodes(vertex as u32, |node, _| taken[node as usize] |= 1 << colour);
            }
            if colours.len() <= colour {
                colours.resize(colour + 1, Vec::new());
            }
            colours[colour].push(number as u32);
        }
        let nobody = self.vertex_count as u32;
        let mut groups = Vec::new();
        for members in colours.iter().flat_map(|colour| colour.chunks(LANES)) {
            let mut group = Cells::empty(nobody);
            for (lane, &number) in members.iter().enumerate() {
                group.numbers[lane] = number;
                for (corner, vertex) in tree.corners(number as usize).into_iter().enumerate() {
                    group.corners[corner][lane] = vertex as u32;
                    group.targets[corner][lane] = match self.follows[vertex] {
                        None => vertex as u32,
                        Some(n) => {
                            if !group.following.contains(&n) {
                                group.following.push(n);
                            }
                            let Following { gathered, .. } = self.following[n as usize];
                            gathered
                        }
                    };
                }
            }
            groups.push(group);
        }
        groups
    }

    fn matrices(
        &self,
        corners: [usize; 8],
        (tissue, fill): &(ElasticTissue, f32),
        sides_m: DVec3,
        substep_s: f64,
        step_s: f64,
    ) -> Matrices {
        // How each free node moves with each pattern.
        let mut nodes: Vec<(u32, [f64; PATTERNS])> = Vec::with_capacity(16);
        for (corner, vertex) in corners.into_iter().enumerate() {
            self.free_nodes(vertex as u32, |node, by| {
                let place = nodes.iter().position(|(own, _)| *own == node).unwrap_or_else(|| {
                    nodes.push((node, [0.0; PATTERNS]));
                    nodes.len() - 1
                });
                for (pattern, sum) in nodes[place].1.iter_mut().enumerate() {
                    *sum += sign(pattern, corner) * f64::from(by) / 8.0;
                }
            });
        }
        let mut mobility = [[0.0; PATTERNS]; PATTERNS];
        for (node, gradients) in &nodes {
            let inverse_mass = f64::from(self.mobility(*node));
            for row in 0..PATTERNS {
                for column in 0..PATTERNS {
                    mobility[row][column] += inverse_mass * gradients[row] * gradients[column];
                }
            }
        }
        let (mu, lambda) = tissue.lame_pa();
        let volume_m3 = sides_m.element_product() * share(*fill);
        let half_m = sides_m * 0.5;
        let square = |axis: usize| 1.0 / (half_m[axis] * half_m[axis]);
        let even = |axis: usize| 2.0 * mu * volume_m3 * square(axis);
        let bent = |a: usize, b: usize| mu * volume_m3 / 3.0 * (square(a) + square(b));
        let all = mu * volume_m3 / 9.0 * (square(0) + square(1) + square(2));
        let stiffness = [even(0), even(1), even(2), bent(0, 1), bent(1, 2), bent(2, 0), all];

        let trace = (0..PATTERNS).map(|n| mobility[n][n]).fold(0.0, f64::max);
        let softness =
            stiffness.map(|stiffness| (SWEEPS / (stiffness * substep_s * substep_s)).max(LEAST_SOFTNESS * trace));
        let ratio = (0..PATTERNS).map(|n| mobility[n][n] / softness[n]).fold(0.0, f64::max);
        let counts = counted(ratio);
        let mut matrix = mobility.map(|row| row.map(|part| part * counts));
        (0..PATTERNS).for_each(|n| matrix[n][n] += softness[n]);
        let bound = |row: usize| mobility[row].iter().map(|part| part.abs()).sum::<f64>();
        let viscosity = |n: usize| {
            let by = stiffness[n] * f64::from(tissue.damping_s.max(0.0)) * step_s;
            if by > 0.0 { 1.0 / (bound(n) + 1.0 / by) } else { 0.0 }
        };
        let strained = (0..3).map(|n| viscosity(n) / square(n)).fold(f64::INFINITY, f64::min);
        let straight: f64 = (0..3).map(|n| mobility[n][n] * square(n)).sum();
        let volume_softness = (SWEEPS / (lambda * volume_m3 * substep_s * substep_s)).min(1e30);
        Matrices {
            response: inverse(matrix),
            half_m,
            left: DVec3::new(softness[0], softness[1], softness[2]) / counts,
            beyond: 1.0 / counts - 1.0,
            mobility: [mobility[0][0], mobility[0][1], mobility[0][2], mobility[1][1], mobility[1][2], mobility[2][2]],
            volume_softness,
            volume_counted: counted(straight / volume_softness),
            volume_floor: 0.1 * straight,
            viscosity: [strained, viscosity(3), viscosity(4), viscosity(5), viscosity(6)],
        }
    }
}

/// What a cell is given, in double precision.
struct Matrices {
    response: [[f64; PATTERNS]; PATTERNS],
    half_m: DVec3,
    left: DVec3,
    beyond: f64,
    mobility: [f64; 6],
    volume_softness: f64,
    volume_counted: f64,
    volume_floor: f64,
    viscosity: [f64; 5],
}

impl Matrices {
    fn put(&self, cells: &mut Cells, lane: usize) {
        for row in 0..PATTERNS {
            for column in row..PATTERNS {
                cells.response[entry(row, column)].0[lane] = self.response[row][column] as f32;
            }
        }
        for axis in 0..3 {
            cells.half_side[axis].0[lane] = self.half_m[axis] as f32;
            cells.per_half_side[axis].0[lane] = (1.0 / self.half_m[axis]) as f32;
            cells.left[axis].0[lane] = self.left[axis] as f32;
        }
        (0..6).for_each(|n| cells.mobility[n].0[lane] = self.mobility[n] as f32);
        // A cell without any mobility and of a gas would divide by nothing.
        cells.volume_softness.0[lane] = self.volume_softness.clamp(1e-30, 1e30) as f32;
        cells.beyond.0[lane] = self.beyond as f32;
        cells.volume_counted.0[lane] = self.volume_counted as f32;
        cells.volume_floor.0[lane] = self.volume_floor as f32;
        (0..5).for_each(|n| cells.viscosity[n].0[lane] = self.viscosity[n] as f32);
    }
}

impl Cells {
    /// Eight cells that are none: their corners are a node that does not move.
    fn empty(nobody: u32) -> Self {
        Self {
            numbers: [u32::MAX; LANES],
            corners: [[nobody; LANES]; 8],
            targets: [[nobody; LANES]; 8],
            response: [Lanes::ZERO; 28],
            half_side: [Lanes::splat(1.0); 3],
            per_half_side: [Lanes::splat(1.0); 3],
            left: [Lanes::ZERO; 3],
            mobility: [Lanes::ZERO; 6],
            volume_softness: Lanes::splat(1.0),
            beyond: Lanes::ZERO,
            volume_counted: Lanes::splat(1.0),
            volume_floor: Lanes::ZERO,
            viscosity: [Lanes::ZERO; 5],
            turn: unturned(),
            following: Vec::new(),
        }
    }
}

/// Inverse of a symmetric matrix whose diagonal outweighs rounding, by elimination.
fn inverse(mut matrix: [[f64; PATTERNS]; PATTERNS]) -> [[f64; PATTERNS]; PATTERNS] {
    let mut made = [[0.0; PATTERNS]; PATTERNS];
    (0..PATTERNS).for_each(|n| made[n][n] = 1.0);
    for pivot in 0..PATTERNS {
        let by = 1.0 / matrix[pivot][pivot];
        for column in 0..PATTERNS {
            matrix[pivot][column] *= by;
            made[pivot][column] *= by;
        }
        for row in (0..PATTERNS).filter(|row| *row != pivot) {
            let factor = matrix[row][pivot];
            for column in 0..PATTERNS {
                matrix[row][column] -= factor * matrix[pivot][column];
                made[row][column] -= factor * made[pivot][column];
            }
        }
    }
    made
}
