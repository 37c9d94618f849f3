//! A tree of boxes over the triangles of a patch.
//!
//! Triangles are sorted along a curve that fills space; four neighbours share a box, four of those boxes the next, and so on. So
//! the tree needs no search when it is made, sixty times a second, and four boxes are compared at once when it is asked, a thousand
//! times a second.

use glam::{BVec4A, Vec3, Vec3A, Vec4};
use std::sync::atomic::{AtomicU64, Ordering};

/// Four boxes, an axis each in its own lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Four {
    min: [Vec4; 3],
    max: [Vec4; 3],
    /// The first of the four nodes below; of a leaf, its first place in the order.
    below: u32,
}

/// Contains nothing and meets nothing.
const EMPTY: Four = Four { min: [Vec4::INFINITY; 3], max: [Vec4::NEG_INFINITY; 3], below: 0 };

impl Four {
    fn set(&mut self, lane: usize, [min, max]: [Vec3; 2]) {
        for axis in 0..3 {
            self.min[axis][lane] = min[axis];
            self.max[axis][lane] = max[axis];
        }
    }

    /// The box around all four.
    fn bounds(&self) -> [Vec3; 2] {
        [Vec3::from_array(self.min.map(Vec4::min_element)), Vec3::from_array(self.max.map(Vec4::max_element))]
    }

    /// Which of the four a ball meets, by the square of its radius.
    fn hits_ball(&self, middle: &[Vec4; 3], radius2: Vec4) -> u32 {
        let beyond = |axis: usize| {
            let way = (self.min[axis] - middle[axis]).max(middle[axis] - self.max[axis]).max(Vec4::ZERO);
            way * way
        };
        (beyond(0) + beyond(1) + beyond(2)).cmple(radius2).bitmask()
    }

    /// Which of the four meet a box.
    fn hits(&self, min: &[Vec4; 3], max: &[Vec4; 3]) -> u32 {
        let along = |axis: usize| -> BVec4A { self.min[axis].cmple(max[axis]) & self.max[axis].cmpge(min[axis]) };
        (along(0) & along(1) & along(2)).bitmask()
    }
}

/// Boxes over triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct BoxTree {
    /// The leaves first, the root last.
    nodes: Vec<Four>,
    leaves: u32,
    order: Vec<u32>,
    /// Tells it from all others that were made, so that what was remembered of one is not taken for another's.
    made: u64,
}

/// Trees made so far; an empty one is the nought.
static MADE: AtomicU64 = AtomicU64::new(0);

impl PartialEq for BoxTree {
    fn eq(&self, other: &Self) -> bool {
        (&self.nodes, &self.order) == (&other.nodes, &other.order)
    }
}

impl BoxTree {
    /// A tree over boxes.
    pub(super) fn new(boxes: &[[Vec3; 2]]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let order = along_curve(boxes);
        let leaves = order.len().div_ceil(4);
        let mut nodes = Vec::with_capacity(leaves + leaves / 3 + 16);
        for (leaf, triangles) in order.chunks(4).enumerate() {
            let mut node = Four { below: leaf as u32 * 4, ..EMPTY };
            triangles.iter().enumerate().for_each(|(lane, &triangle)| node.set(lane, boxes[triangle as usize]));
            nodes.push(node);
        }
        let mut level = 0..leaves;
        while level.len() > 1 {
            for first in level.clone().step_by(4) {
                let mut node = Four { below: first as u32, ..EMPTY };
                #[allow(clippy::needless_range_loop, reason = "the number of the node is needed, too")]
                for below in first..level.end.min(first + 4) {
                    node.set(below - first, nodes[below].bounds());
                }
                nodes.push(node);
            }
            level = level.end..nodes.len();
        }
        let made = MADE.fetch_add(1, Ordering::Relaxed) + 1;
        Self { nodes, leaves: leaves as u32, order, made }
    }

    /// Finds the leaves that meet a box.
    fn find(&self, min: Vec3, max: Vec3, mut found: impl FnMut(&Four)) {
        let Some(root) = self.nodes.len().checked_sub(1) else { return };
        let (min, max) = (min.to_array().map(Vec4::splat), max.to_array().map(Vec4::splat));
        // Sixteen levels of four are as many triangles as have numbers; each leaves three nodes behind.
        let mut stack = [0_u32; 64];
        stack[0] = root as u32;
        let mut left = 1;
        while left > 0 {
            left -= 1;
            let place = stack[left];
            let node = &self.nodes[place as usize];
            if place < self.leaves {
                found(node);
                continue;
            }
            let mut hits = node.hits(&min, &max);
            while hits != 0 {
                stack[left] = node.below + hits.trailing_zeros();
                left += 1;
                hits &= hits - 1;
            }
        }
    }

    /// Visits the triangles of some of a leaf's boxes.
    fn visit_leaf(&self, leaf: &Four, mut hits: u32, visit: &mut impl FnMut(u32)) {
        while hits != 0 {
            visit(self.order[(leaf.below + hits.trailing_zeros()) as usize]);
            hits &= hits - 1;
        }
    }

    /// Visits the triangles whose boxes may meet a box.
    pub(super) fn visit(&self, min: Vec3, max: Vec3, mut visit: impl FnMut(u32)) {
        let ends = [min, max].map(|end| end.to_array().map(Vec4::splat));
        self.find(min, max, |leaf| self.visit_leaf(leaf, leaf.hits(&ends[0], &ends[1]), &mut visit));
    }

    /// The same, for one who asks again and again nearby, and for a ball where that is what the box is around.
    pub(super) fn visit_near(
        &self,
        near: &mut NearLeaves,
        [min, max]: [Vec3; 2],
        ball: Option<(Vec3, f32)>,
        mut visit: impl FnMut(u32),
    ) {
        // What was remembered for a much longer look holds too many to go through.
        let is_far = || ((near.max - near.min).cmpgt((max - min) * 1.5 + 2.0 * MARGIN_M)).any();
        if near.made != Some(self.made) || min.cmplt(near.min).any() || max.cmpgt(near.max).any() || is_far() {
            let margin = MARGIN_M.min((max - min).min_element() * 0.25);
            (near.made, near.min, near.max) = (Some(self.made), min - margin, max + margin);
            near.leaves.clear();
            let leaf_of = |node: &Four| node.below / 4;
            self.find(near.min, near.max, |leaf| near.leaves.push(leaf_of(leaf)));
        }
        let ends = [min, max].map(|end| end.to_array().map(Vec4::splat));
        let ball = ball.map(|(middle, radius)| (middle.to_array().map(Vec4::splat), Vec4::splat(radius * radius)));
        for &place in &near.leaves {
            let leaf = &self.nodes[place as usize];
            let hits = match &ball {
                Some((middle, radius2)) => leaf.hits_ball(middle, *radius2),
                None => leaf.hits(&ends[0], &ends[1]),
            };
            self.visit_leaf(leaf, hits, &mut visit);
        }
    }
}

/// How much further on each side leaves are remembered, metres: some ticks of a fast hand.
const MARGIN_M: f32 = 0.5e-3;

/// Leaves of a tree around a place: the next places are near.
#[derive(Clone, Debug, Default)]
pub(super) struct NearLeaves {
    made: Option<u64>,
    min: Vec3,
    max: Vec3,
    leaves: Vec<u32>,
}

/// Boxes in the order of their middles along a curve of Z shape; equal ones by number, so that the same boxes always come the same.
fn along_curve(boxes: &[[Vec3; 2]]) -> Vec<u32> {
    let middle = |&[min, max]: &[Vec3; 2]| Vec3A::from(min) + Vec3A::from(max);
    let (mut least, mut greatest) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
    for at in boxes.iter().map(middle) {
        (least, greatest) = (least.min(at), greatest.max(at));
    }
    const SIDE: f32 = 1023.0;
    let scale = SIDE / (greatest - least).max_element().max(f32::MIN_POSITIVE);
    let mut sorted: Vec<(u32, u32)> = boxes
        .iter()
        .zip(0..)
        .map(|(of, number)| {
            let [x, y, z] = ((middle(of) - least) * scale).to_array().map(|place| spread_bits(place.min(SIDE) as u32));
            (x | y << 1 | z << 2, number)
        })
        .collect();
    let mut other = vec![(0, 0); sorted.len()];
    // Ten bits at a time, from the lowest: equal ones stay in order.
    for shift in [0, 10, 20] {
        let digit = |key: u32| (key >> shift & 1023) as usize;
        let mut starts = [0_u32; 1024];
        sorted.iter().for_each(|&(key, _)| starts[digit(key)] += 1);
        let mut start = 0;
        for count in &mut starts {
            start += std::mem::replace(count, start);
        }
        for &(key, number) in &sorted {
            let place = &mut starts[digit(key)];
            other[*place as usize] = (key, number);
            *place += 1;
        }
        std::mem::swap(&mut sorted, &mut other);
    }
    sorted.into_iter().map(|(_, number)| number).collect()
}

/// Ten bits with two empty ones between each and the next.
fn spread_bits(bits: u32) -> u32 {
    let bits = (bits | bits << 16) & 0x0300_00ff;
    let bits = (bits | bits << 8) & 0x0300_f00f;
    let bits = (bits | bits << 4) & 0x030c_30c3;
    (bits | bits << 2) & 0x0924_9249
}
