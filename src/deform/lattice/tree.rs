//! The octree of patches: which there are, their vertices, and which of those follow others.

use super::MAX_LEVEL;
use crate::deform::LatticeError;
use bevy::reflect::Reflect;
use glam::{DVec3, IVec3, UVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;

/// Cells of the finest level along a side of the box: vertices lie on this grid.
const FINEST: u32 = 1 << MAX_LEVEL;

/// A sub-cube of the box: one of `2^level` along each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub struct Patch {
    /// How often the box was halved.
    pub level: u32,
    /// Which one along x, y and z.
    pub cell: UVec3,
}

impl fmt::Display for Patch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "({}, {}, {}) of level {}", self.cell.x, self.cell.y, self.cell.z, self.level)
    }
}

impl Patch {
    /// Length of its edges, in shares of the box.
    pub fn side(&self) -> f64 {
        1.0 / f64::from(1_u32 << self.level)
    }

    /// Its lower corner, in shares of the box.
    pub fn low(&self) -> DVec3 {
        self.cell.as_dvec3() * self.side()
    }

    /// Its eight halves, x fastest.
    pub fn halves(&self) -> [Patch; 8] {
        std::array::from_fn(|n| Patch { level: self.level + 1, cell: self.cell * 2 + corner(n) })
    }

    /// Lower corner and side on the finest grid.
    fn on_finest(&self) -> (UVec3, u32) {
        let side = FINEST >> self.level;
        (self.cell * side, side)
    }

    /// Place in an order in which patches that are close together follow one another, and every patch follows those before it
    /// in space: the bits of its lower corner, interleaved.
    fn order(&self) -> (u64, u32) {
        let low = self.on_finest().0;
        let spread = |part: u32| (0..=MAX_LEVEL).fold(0_u64, |sum, bit| sum | u64::from(part >> bit & 1) << (3 * bit));
        (spread(low.x) | spread(low.y) << 1 | spread(low.z) << 2, self.level)
    }
}

impl PartialOrd for Patch {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Patch {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.order().cmp(&other.order())
    }
}

/// Corner `n` of a cube: along axis `a` on the upper side where bit `a` is set.
pub(crate) fn corner(n: usize) -> UVec3 {
    UVec3::new(n as u32 & 1, n as u32 >> 1 & 1, n as u32 >> 2 & 1)
}

/// A vertex that lies on an edge or a face of a coarser patch, and stays in its middle (paper of 2001, equations 5 and 6).
#[derive(Clone, Debug, PartialEq, Eq, Reflect)]
pub struct Constraint {
    /// The vertex.
    pub vertex: usize,
    /// The ends of the edge (two of them), or the corners of the face (four of them). None of these is constrained itself.
    pub of: Vec<usize>,
}

/// What a subdivision did.
#[derive(Clone, Debug, Default, PartialEq, Eq, Reflect)]
pub struct Subdivision {
    /// Patches that were halved along each axis, in the order in which it was done: those that had to be, so that neighbours
    /// differ by one level at most, and the one that was asked for last.
    pub halved: Vec<Patch>,
}

/// The patches of a lattice, its vertices, and which of those follow others. Neighbouring patches, also those that touch in an
/// edge or a corner only, differ by one level at most.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct Tree {
    patches: Vec<Patch>,
    /// Vertices of each patch, in the order of [`corner`].
    corners: Vec<[u32; 8]>,
    /// Vertices on the finest grid, z slowest, x fastest.
    vertices: Vec<UVec3>,
    constraints: Vec<Constraint>,
    is_constrained: Vec<bool>,
    deepest: u32,
    /// Patch by cell of the deepest level.
    located: Vec<u32>,
}

impl Tree {
    /// A tree with all patches of one level.
    pub fn uniform(level: u32) -> Result<Self, LatticeError> {
        if level > MAX_LEVEL {
            return Err(LatticeError::TooDeep { level });
        }
        let side = 1 << level;
        let cells = (0..side).flat_map(|z| (0..side).flat_map(move |y| (0..side).map(move |x| UVec3::new(x, y, z))));
        Ok(Self::new(cells.map(|cell| Patch { level, cell }).collect()))
    }

    /// The tree that has just these patches, in any order.
    pub(super) fn of_patches(wanted: &[Patch]) -> Result<Self, LatticeError> {
        if let Some(patch) = wanted.iter().find(|patch| patch.level > MAX_LEVEL) {
            return Err(LatticeError::TooDeep { level: patch.level });
        }
        if let Some(&patch) = wanted.iter().find(|patch| patch.cell.cmpge(UVec3::splat(1 << patch.level)).any()) {
            return Err(LatticeError::NoPatch { patch });
        }
        let mut tree = Self::uniform(0)?;
        // What a wanted patch is a part of was halved, the coarsest first.
        for level in 0..MAX_LEVEL {
            let finer = wanted.iter().filter(|patch| patch.level > level);
            let halved = finer.map(|patch| Patch { level, cell: patch.cell >> (patch.level - level) });
            let halved: Vec<Patch> = halved.collect::<BTreeSet<_>>().into_iter().collect();
            let halved: Vec<Patch> = halved.into_iter().filter(|patch| tree.number_of(*patch).is_some()).collect();
            tree.subdivide_all(&halved)?;
        }
        let wanted: BTreeSet<Patch> = wanted.iter().copied().collect();
        let differs = tree.patches.iter().find(|patch| !wanted.contains(patch));
        match differs.or_else(|| wanted.iter().find(|patch| tree.number_of(**patch).is_none())) {
            Some(&patch) => Err(LatticeError::NoPatch { patch }),
            None => Ok(tree),
        }
    }

    /// The tree with some patches that fill the box and obey the rule of neighbours.
    fn new(patches: BTreeSet<Patch>) -> Self {
        let patches: Vec<Patch> = patches.into_iter().collect();
        let deepest = patches.iter().map(|patch| patch.level).max().unwrap_or(0);
        let mut vertices: Vec<UVec3> = patches
            .iter()
            .flat_map(|patch| {
                let (low, side) = patch.on_finest();
                (0..8).map(move |n| low + corner(n) * side)
            })
            .collect();
        let order = |at: &UVec3| (at.z, at.y, at.x);
        vertices.sort_by_key(order);
        vertices.dedup();
        let find = |at: UVec3| vertices.binary_search_by_key(&order(&at), order).ok();
        let corners = patches
            .iter()
            .map(|patch| {
                let (low, side) = patch.on_finest();
                std::array::from_fn(|n| find(low + corner(n) * side).unwrap_or_default() as u32)
            })
            .collect();
        let cells = 1_usize << deepest;
        let mut located = vec![0; cells * cells * cells];
        for (number, patch) in patches.iter().enumerate() {
            let span = 1 << (deepest - patch.level);
            let low = patch.cell * span;
            for z in low.z..low.z + span {
                for y in low.y..low.y + span {
                    let first = (z as usize * cells + y as usize) * cells + low.x as usize;
                    located[first..first + span as usize].fill(number as u32);
                }
            }
        }
        let is_constrained = vec![false; vertices.len()];
        let mut made = Self { patches, corners, vertices, constraints: Vec::new(), is_constrained, deepest, located };
        made.constraints = (0..made.vertices.len()).filter_map(|vertex| made.constraint_of(vertex)).collect();
        for constraint in &made.constraints {
            made.is_constrained[constraint.vertex] = true;
        }
        made
    }

    /// What a vertex follows, if it lies inside an edge or a face of a patch.
    fn constraint_of(&self, vertex: usize) -> Option<Constraint> {
        let at = self.vertices[vertex];
        // The side of the coarsest cells that have it as a corner: its coordinates are multiples of it, and not all of them of
        // twice as much.
        let side = (at | UVec3::splat(FINEST)).to_array().map(|part| 1 << part.trailing_zeros()).into_iter().min()?;
        let odd: Vec<usize> = (0..3).filter(|&axis| at[axis] / side % 2 == 1).collect();
        if side == FINEST || odd.len() == 3 || odd.is_empty() {
            return None;
        }
        // Coarser cells of twice the side around it: along its odd axes it is in their middle, along the others between two.
        let is_in_coarser = (0..8).any(|n| {
            let away = corner(n).as_ivec3() * 2 - 1;
            let inside = at.as_ivec3() * 2 + away;
            let is_own = odd.iter().all(|&axis| away[axis] == 1);
            is_own
                && inside.cmpge(IVec3::ZERO).all()
                && inside.cmplt(IVec3::splat(2 * FINEST as i32)).all()
                && self.patches[self.patch_on_finest((inside / 2).as_uvec3())].on_finest().1 > side
        });
        let mut of = vec![at];
        for &axis in &odd {
            of = of
                .into_iter()
                .flat_map(|at| {
                    let by = UVec3::AXES[axis] * side;
                    [at - by, at + by]
                })
                .collect();
        }
        let of = of.into_iter().map(|at| self.find(at)).collect::<Option<Vec<usize>>>();
        is_in_coarser.then_some(of).flatten().map(|of| Constraint { vertex, of })
    }

    /// The patch of a cell of the finest grid.
    fn patch_on_finest(&self, cell: UVec3) -> usize {
        let cell = cell / (FINEST >> self.deepest);
        let cells = 1_usize << self.deepest;
        self.located[(cell.z as usize * cells + cell.y as usize) * cells + cell.x as usize] as usize
    }

    fn find(&self, at: UVec3) -> Option<usize> {
        let order = |at: &UVec3| (at.z, at.y, at.x);
        self.vertices.binary_search_by_key(&order(&at), order).ok()
    }

    /// Halves a patch along each axis, and before it every neighbour that would be too coarse.
    pub fn subdivide(&mut self, patch: Patch) -> Result<Subdivision, LatticeError> {
        self.subdivide_all(&[patch])
    }

    /// Halves several patches at once, as [`Tree::subdivide`] does with one.
    pub fn subdivide_all(&mut self, asked: &[Patch]) -> Result<Subdivision, LatticeError> {
        if let Some(patch) = asked.iter().find(|patch| patch.level >= MAX_LEVEL) {
            return Err(LatticeError::TooDeep { level: patch.level + 1 });
        }
        if let Some(&patch) = asked.iter().find(|patch| self.number_of(**patch).is_none()) {
            return Err(LatticeError::NoPatch { patch });
        }
        let mut patches: BTreeSet<Patch> = self.patches.iter().copied().collect();
        let mut halved = Vec::new();
        // Coarse neighbours go before the patch that needs them halved.
        let mut waiting: Vec<Patch> = asked.iter().rev().copied().collect();
        while let Some(&patch) = waiting.last() {
            if !patches.contains(&patch) {
                waiting.pop();
                continue;
            }
            let coarser: Vec<Patch> = coarser_neighbours(&patches, patch);
            if coarser.is_empty() {
                waiting.pop();
                patches.remove(&patch);
                patches.extend(patch.halves());
                halved.push(patch);
            } else {
                waiting.extend(coarser.into_iter().rev());
            }
        }
        *self = Self::new(patches);
        Ok(Subdivision { halved })
    }

    /// The patches, in the order of their numbers.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// Number of a patch, if the tree has it.
    pub fn number_of(&self, patch: Patch) -> Option<usize> {
        self.patches.binary_search(&patch).ok()
    }

    /// The vertices of a patch by its number, in the order of the patch's corners: x fastest, z slowest.
    pub fn corners(&self, number: usize) -> [usize; 8] {
        self.corners[number].map(|vertex| vertex as usize)
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// Where a vertex rests, in shares of the box.
    pub fn place_of(&self, vertex: usize) -> DVec3 {
        self.vertices[vertex].as_dvec3() / f64::from(FINEST)
    }

    /// The vertex nearest to a place.
    pub fn nearest_vertex(&self, place: DVec3) -> usize {
        let number = self.patch_at(place);
        let (low, side) = self.patches[number].on_finest();
        // Besides the corners there may be vertices of finer neighbours in the middle of edges and faces.
        let middles = (0..27).filter_map(|n| {
            let twice = UVec3::new(n % 3, n / 3 % 3, n / 9) * side;
            (side > 1).then(|| self.find(low + twice / 2)).flatten()
        });
        let distance = |vertex: &usize| self.place_of(*vertex).distance_squared(place);
        let corners = self.corners(number);
        corners.into_iter().chain(middles).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(corners[0])
    }

    /// The vertices that follow others, in the order of their numbers.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// What a vertex follows, if it does.
    #[inline]
    pub fn constraint(&self, vertex: usize) -> Option<&Constraint> {
        if !self.is_constrained[vertex] {
            return None;
        }
        let number = self.constraints.binary_search_by_key(&vertex, |constraint| constraint.vertex).ok()?;
        Some(&self.constraints[number])
    }

    /// Whether a vertex follows others.
    pub fn is_constrained(&self, vertex: usize) -> bool {
        self.is_constrained[vertex]
    }

    /// Whether a vertex lies on the box's sides.
    pub fn is_on_side(&self, vertex: usize) -> bool {
        let at = self.vertices[vertex];
        at.cmpeq(UVec3::ZERO).any() || at.cmpeq(UVec3::splat(FINEST)).any()
    }

    /// Level of the deepest patches.
    pub fn deepest(&self) -> u32 {
        self.deepest
    }

    /// Whether all patches are of one level.
    pub fn is_uniform(&self) -> bool {
        self.patches.len() == 1 << (3 * self.deepest)
    }

    /// Number of the patch at a place; outside of the box that of the nearest one.
    #[inline]
    pub fn patch_at(&self, place: DVec3) -> usize {
        let cells = 1_u32 << self.deepest;
        // Numbers below 0, and what is no number, become 0.
        let cell = |part: f64| (part * f64::from(cells)).min(f64::from(cells - 1)) as u32 as usize;
        let (x, y, z) = (cell(place.x), cell(place.y), cell(place.z));
        self.located[(z * cells as usize + y) * cells as usize + x] as usize
    }
}

/// Patches that touch one, if only in an edge or a corner, and are coarser.
fn coarser_neighbours(patches: &BTreeSet<Patch>, patch: Patch) -> Vec<Patch> {
    let mut found = BTreeSet::new();
    let cells = 1_i32 << patch.level;
    for n in 0..27 {
        let cell = patch.cell.as_ivec3() + IVec3::new(n % 3, n / 3 % 3, n / 9) - 1;
        if cell.cmplt(IVec3::ZERO).any() || cell.cmpge(IVec3::splat(cells)).any() {
            continue;
        }
        let ancestors = (1..=patch.level).map(|up| Patch { level: patch.level - up, cell: cell.as_uvec3() >> up });
        found.extend(ancestors.filter(|ancestor| patches.contains(ancestor)));
    }
    found.into_iter().collect()
}
