//! A tree of boxes over the triangles of a patch.

use glam::{Vec3, Vec3A};

/// Triangles of a leaf, at most.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Node {
    min: Vec3A,
    /// First triangle of a leaf, else the right child; the left one follows its parent.
    at: u32,
    max: Vec3A,
    /// Triangles of a leaf; 0 for others.
    count: u32,
}

/// Boxes over triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    order: Vec<u32>,
    /// Boxes of the triangles, in that order.
    boxes: Vec<[Vec3A; 2]>,
}

impl BoxTree {
    /// A tree over boxes.
    pub(super) fn new(boxes: &[[Vec3; 2]]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..boxes.len() as u32).collect(), boxes: Vec::new() };
        if !boxes.is_empty() {
            let mut order = std::mem::take(&mut tree.order);
            tree.split(boxes, &mut order, 0);
            tree.boxes = order.iter().map(|&index| boxes[index as usize].map(Vec3A::from)).collect();
            tree.order = order;
        }
        tree
    }

    fn split(&mut self, boxes: &[[Vec3; 2]], order: &mut [u32], first: usize) {
        let bounds = |[min, max]: [Vec3; 2], index: &u32| {
            let [least, greatest] = boxes[*index as usize];
            [min.min(least), max.max(greatest)]
        };
        let empty = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let [min, max] = order.iter().fold(empty, bounds);
        let place = self.nodes.len();
        let (min, max) = (Vec3A::from(min), Vec3A::from(max));
        self.nodes.push(Node { min, max, at: first as u32, count: order.len() as u32 });
        if order.len() <= LEAF {
            return;
        }
        let middle = |index: u32| boxes[index as usize][0] + boxes[index as usize][1];
        let [least, greatest] = order.iter().fold(empty, |[min, max], &index| {
            let middle = middle(index);
            [min.min(middle), max.max(middle)]
        });
        let axis = (greatest - least).max_position();
        let half = order.len() / 2;
        // Ties by number, so that the same triangles always give the same tree.
        order.select_nth_unstable_by(half, |&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]).then(a.cmp(&b)));
        let (left, right) = order.split_at_mut(half);
        self.split(boxes, left, first);
        self.nodes[place].at = self.nodes.len() as u32;
        self.nodes[place].count = 0;
        self.split(boxes, right, first + half);
    }

    /// Visits the triangles whose boxes may meet a box.
    pub(super) fn visit(&self, min: Vec3, max: Vec3, mut visit: impl FnMut(u32)) {
        if self.nodes.is_empty() {
            return;
        }
        let (min, max) = (Vec3A::from(min), Vec3A::from(max));
        let misses = |least: Vec3A, greatest: Vec3A| (least.cmpgt(max) | greatest.cmplt(min)).any();
        // A median tree over all triangles that fit into memory is never deeper.
        let mut stack = [0_u32; 64];
        let mut left = 1;
        while left > 0 {
            left -= 1;
            let place = stack[left];
            let node = &self.nodes[place as usize];
            if misses(node.min, node.max) {
                continue;
            }
            if node.count > 0 {
                let leaf = node.at as usize..node.at as usize + node.count as usize;
                for (&triangle, &[least, greatest]) in self.order[leaf.clone()].iter().zip(&self.boxes[leaf]) {
                    if !misses(least, greatest) {
                        visit(triangle);
                    }
                }
            } else {
                stack[left] = node.at;
                stack[left + 1] = place + 1;
                left += 2;
            }
        }
    }
}
