//! A tree of boxes over the triangles of a patch.
//!
//! Triangles are sorted along a curve that fills space; four neighbours share a box, four of those boxes the next, and so on. So
//! the tree needs no search when it is made, sixty times a second, and four boxes are compared at once when it is asked, a thousand
//! times a second.

use glam::{DVec3, Vec3, Vec3A, Vec4};
use std::sync::atomic::{AtomicU64, Ordering};

/// Four boxes, an axis each in its own lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Four {
    min: [Vec4; 3],
    max: [Vec4; 3],
    /// The first of the four nodes below; of a leaf, its first place in the order.
    below: u32,
}

impl Four {
    /// Around up to four boxes; lanes without one contain nothing and meet nothing.
    fn of(boxes: &[[Vec3A; 2]], below: u32) -> Self {
        let (mut min, mut max) = ([[f32::INFINITY; 4]; 3], [[f32::NEG_INFINITY; 4]; 3]);
        for (lane, [least, greatest]) in boxes.iter().enumerate() {
            for axis in 0..3 {
                (min[axis][lane], max[axis][lane]) = (least[axis], greatest[axis]);
            }
        }
        Self { min: min.map(Vec4::from_array), max: max.map(Vec4::from_array), below }
    }

    /// Which of the four may be within reach.
    fn hits(&self, look: &Look) -> u32 {
        if look.is_ball { self.hits_ball(look) } else { self.hits_capsule(look) }
    }

    fn hits_ball(&self, look: &Look) -> u32 {
        let beyond = |axis: usize| {
            let way = (self.min[axis] - look.from[axis]).max(look.from[axis] - self.max[axis]).max(Vec4::ZERO);
            way * way
        };
        (beyond(0) + beyond(1) + beyond(2)).cmple(look.radius2).bitmask()
    }

    /// By the balls around the boxes: a box around a shaft that lies aslant would hold most of an organ.
    fn hits_capsule(&self, look: &Look) -> u32 {
        let from = |axis: usize| (self.min[axis] + self.max[axis]) * 0.5 - look.from[axis];
        let along = from(0) * look.along[0] + from(1) * look.along[1] + from(2) * look.along[2];
        let share = (along * look.per_length2).clamp(Vec4::ZERO, Vec4::ONE);
        let square = |of: Vec4| of * of;
        let aside2 = |axis: usize| square(from(axis) - look.along[axis] * share);
        let half2 = |axis: usize| square((self.max[axis] - self.min[axis]) * 0.5);
        let reach2 = look.radius2 + half2(0) + half2(1) + half2(2);
        // Without a root: the square of a sum is at most twice the sum of the squares.
        (aside2(0) + aside2(1) + aside2(2)).cmple(reach2 * 2.0).bitmask()
    }
}

/// What looks for triangles: a ball, or a capsule.
#[derive(Clone, Copy, Debug)]
pub(super) struct Look {
    ends: [Vec3; 2],
    radius: f32,
    from: [Vec4; 3],
    along: [Vec4; 3],
    per_length2: Vec4,
    radius2: Vec4,
    is_ball: bool,
}

impl Look {
    /// Within a distance of a segment, which may be a point.
    pub(super) fn new(segment_m: [DVec3; 2], radius_m: f64) -> Self {
        // Rounding to single precision must not lose a triangle.
        let largest_m = segment_m[0].abs().max(segment_m[1].abs()).max_element();
        Self::within(segment_m.map(|end| end.as_vec3()), (radius_m + 1e-6 * (1.0 + largest_m)) as f32)
    }

    fn within(ends: [Vec3; 2], radius: f32) -> Self {
        let along = ends[1] - ends[0];
        Self {
            ends,
            radius,
            from: ends[0].to_array().map(Vec4::splat),
            along: along.to_array().map(Vec4::splat),
            per_length2: Vec4::splat(along.length_squared().recip().min(f32::MAX)),
            radius2: Vec4::splat(radius * radius),
            is_ball: ends[0] == ends[1],
        }
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
    pub(super) fn new(boxes: &[[Vec3A; 2]]) -> Self {
        if boxes.is_empty() {
            return Self::default();
        }
        let order = along_curve(boxes);
        let leaves = order.len().div_ceil(4);
        let mut nodes = Vec::with_capacity(leaves + leaves / 3 + 16);
        let mut level: Vec<[Vec3A; 2]> = order.iter().map(|&triangle| boxes[triangle as usize]).collect();
        let mut first = 0;
        loop {
            let below = (first..).step_by(4);
            first = nodes.len() as u32;
            nodes.extend(level.chunks(4).zip(below).map(|(boxes, below)| Four::of(boxes, below)));
            if level.len() <= 4 {
                break;
            }
            level = level.chunks(4).map(around).collect();
        }
        let made = MADE.fetch_add(1, Ordering::Relaxed) + 1;
        Self { nodes, leaves: leaves as u32, order, made }
    }

    /// Finds the leaves that may have something within reach.
    fn find(&self, look: &Look, mut found: impl FnMut(&Four)) {
        let Some(root) = self.nodes.len().checked_sub(1) else { return };
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
            let mut hits = node.hits(look);
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

    /// Visits the triangles that may be within reach.
    pub(super) fn visit(&self, look: &Look, mut visit: impl FnMut(u32)) {
        self.find(look, |leaf| self.visit_leaf(leaf, leaf.hits(look), &mut visit));
    }

    /// The same, for one who asks again and again nearby.
    pub(super) fn visit_near(&self, near: &mut NearLeaves, look: &Look, mut visit: impl FnMut(u32)) {
        let strayed = look.ends[0].distance(near.ends[0]).max(look.ends[1].distance(near.ends[1]));
        // What was remembered for a much longer look holds too many to go through.
        let is_far = near.radius > look.radius * 1.5 + MARGIN_M;
        if near.made != Some(self.made) || strayed + look.radius > near.radius || is_far {
            (near.made, near.ends) = (Some(self.made), look.ends);
            near.radius = look.radius + MARGIN_M.min(look.radius * 0.5);
            near.leaves.clear();
            self.find(&Look::within(near.ends, near.radius), |leaf| near.leaves.push(leaf.below / 4));
        }
        for &place in &near.leaves {
            let leaf = &self.nodes[place as usize];
            self.visit_leaf(leaf, leaf.hits(look), &mut visit);
        }
    }
}

/// The box around some.
fn around(boxes: &[[Vec3A; 2]]) -> [Vec3A; 2] {
    boxes.iter().fold([Vec3A::INFINITY, Vec3A::NEG_INFINITY], |[min, max], of| [min.min(of[0]), max.max(of[1])])
}

/// How much further around leaves are remembered, metres: some ticks of a fast hand.
const MARGIN_M: f32 = 0.5e-3;

/// Leaves of a tree around a place: the next places are near.
#[derive(Clone, Debug, Default)]
pub(super) struct NearLeaves {
    made: Option<u64>,
    /// The segment that they were looked for around, and how far around it.
    ends: [Vec3; 2],
    radius: f32,
    leaves: Vec<u32>,
}

/// Boxes in the order of their middles along a curve of Z shape; equal ones by number, so that the same boxes always come the same.
fn along_curve(boxes: &[[Vec3A; 2]]) -> Vec<u32> {
    let middle = |&[min, max]: &[Vec3A; 2]| min + max;
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
