//! Which boxes changed, for whoever keeps a copy.

use super::super::grid::VoxelBox;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};

/// Changes that are remembered.
const REMEMBERED: usize = 256;
/// Boxes that a reader gets at most.
const BOXES: usize = 8;

/// Boxes with the revision that they led to. Cuts number their revisions from different beginnings, so that a reader who finds
/// another cut in the place of the one it copied is told to take everything.
#[derive(Clone)]
pub(super) struct Changes {
    revision: u64,
    /// Readers at an earlier revision than this take everything.
    known_since: u64,
    boxes: VecDeque<(u64, VoxelBox)>,
}

impl Changes {
    pub fn new() -> Self {
        static CUTS: AtomicU64 = AtomicU64::new(1);
        let revision = CUTS.fetch_add(1, Ordering::Relaxed) << 40;
        Self { revision, known_since: revision, boxes: VecDeque::new() }
    }

    pub fn revision(&self) -> u64 {
        self.revision
    }

    pub fn push(&mut self, changed: VoxelBox) {
        self.revision += 1;
        if self.boxes.len() == REMEMBERED
            && let Some((revision, _)) = self.boxes.pop_front()
        {
            self.known_since = revision;
        }
        self.boxes.push_back((self.revision, changed));
    }

    pub fn everything(&mut self) {
        self.revision += 1;
        self.known_since = self.revision;
        self.boxes.clear();
    }

    pub fn since(&self, revision: u64) -> Option<Vec<VoxelBox>> {
        if !(self.known_since..=self.revision).contains(&revision) {
            return None;
        }
        let mut merged: Vec<VoxelBox> = Vec::new();
        let first = self.boxes.partition_point(|&(led_to, _)| led_to <= revision);
        for &(_, changed) in self.boxes.range(first..) {
            merge(&mut merged, changed);
        }
        Some(merged)
    }
}

/// Adds a box: to one that it does not grow by much, otherwise on its own, or to the one that it grows least.
fn merge(boxes: &mut Vec<VoxelBox>, mut added: VoxelBox) {
    loop {
        let grown = |other: &VoxelBox| other.union(&added).count() as i64 - other.count() as i64 - added.count() as i64;
        let Some((place, extra)) = boxes.iter().map(grown).enumerate().min_by_key(|&(_, extra)| extra) else { break };
        // A box of its own costs a transfer of its own, some thousands of voxels' worth.
        if boxes.len() < BOXES && extra > 4096 {
            break;
        }
        added = boxes.swap_remove(place).union(&added);
    }
    boxes.push(added);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec3;

    fn cube(at: u32, side: u32) -> VoxelBox {
        VoxelBox { min: UVec3::splat(at), max: UVec3::splat(at + side) }
    }

    #[test]
    fn readers_get_what_they_have_not_seen() {
        let mut changes = Changes::new();
        let start = changes.revision();
        assert_eq!(changes.since(start), Some(vec![]));
        changes.push(cube(0, 16));
        let seen = changes.revision();
        changes.push(cube(100, 16));
        assert_eq!(changes.since(seen), Some(vec![cube(100, 16)]));
        assert_eq!(changes.since(start).map(|boxes| boxes.len()), Some(2), "far boxes stay apart");
        changes.push(cube(4, 16));
        let boxes = changes.since(start).expect("known");
        assert_eq!(boxes.len(), 2, "near ones merge: {boxes:?}");
        assert!(boxes.contains(&cube(0, 20)));
        assert_eq!(changes.since(start - 1), None);
        assert_eq!(changes.since(changes.revision() + 1), None, "of another cut");
        changes.everything();
        assert_eq!(changes.since(seen), None);
        assert_eq!(changes.since(changes.revision()), Some(vec![]));
    }

    #[test]
    fn long_absence_means_everything_and_boxes_are_few() {
        let mut changes = Changes::new();
        let start = changes.revision();
        for step in 0..REMEMBERED as u32 {
            changes.push(cube(step * 50, 10));
        }
        let boxes = changes.since(start).expect("just remembered");
        assert!(boxes.len() <= BOXES);
        for step in 0..REMEMBERED as u32 {
            let inside = |of: &VoxelBox| of.intersection(&cube(step * 50, 10)) == cube(step * 50, 10);
            assert!(boxes.iter().any(inside), "box {step} is lost");
        }
        changes.push(cube(0, 1));
        assert_eq!(changes.since(start), None);
    }
}
