//! Which boxes changed, for whoever keeps a copy.

use super::super::grid::VoxelBox;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, Ordering};

/// Changes that are remembered.
const REMEMBERED: usize = 256;
/// Boxes that a reader gets at most.
const BOXES: usize = 8;

/// Boxes with the revision that they led to. No two changes of any cuts, clones included, have the same revision, so that a
/// reader who finds another cut in the place of the one it copied is told to take everything.
#[derive(Clone)]
pub(super) struct Changes {
    /// Shared by clones, and by nobody else.
    pub lineage: u64,
    revision: u64,
    /// Readers at an earlier revision than this take everything.
    known_since: u64,
    boxes: VecDeque<(u64, VoxelBox)>,
}

impl Changes {
    pub fn new() -> Self {
        let revision = next_revision();
        Self { lineage: revision, revision, known_since: revision, boxes: VecDeque::new() }
    }

    pub fn revision(&self) -> u64 {
        self.revision
    }

    pub fn push(&mut self, changed: VoxelBox) {
        self.revision = next_revision();
        if self.boxes.len() == REMEMBERED
            && let Some((revision, _)) = self.boxes.pop_front()
        {
            self.known_since = revision;
        }
        self.boxes.push_back((self.revision, changed));
    }

    /// Notes many boxes as a few.
    pub fn push_all(&mut self, changed: impl IntoIterator<Item = VoxelBox>) {
        let mut merged = Vec::new();
        changed.into_iter().for_each(|one| merge(&mut merged, one));
        merged.into_iter().for_each(|one| self.push(one));
    }

    pub fn since(&self, revision: u64) -> Option<Vec<VoxelBox>> {
        let is_known =
            revision == self.known_since || self.boxes.binary_search_by_key(&revision, |&(led_to, _)| led_to).is_ok();
        if !is_known {
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

fn next_revision() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
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
        assert_eq!(changes.since(changes.revision()), Some(vec![]));
        let mut other = changes.clone();
        changes.push(cube(0, 1));
        other.push(cube(50, 1));
        assert_eq!(other.since(changes.revision()), None, "a clone goes its own way");
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
