//! What undo and redo bring back: the bricks as they were before each stroke.

use super::bricks::{Brick, VOXELS};
use std::collections::VecDeque;

/// Bricks as they were before a stroke, or after it, if it was undone.
#[derive(Clone, Default)]
pub(super) struct Step {
    pub bricks: Vec<(u32, Option<Brick>)>,
}

impl Step {
    fn bytes(&self) -> usize {
        let stored = self.bricks.iter().filter(|(_, brick)| brick.is_some()).count();
        stored * VOXELS * size_of::<f32>() + self.bricks.len() * size_of::<(u32, Option<Brick>)>()
    }
}

/// Strokes that can be undone and redone. Bricks are shared with the cut until they change, so that a stroke costs a copy of
/// those it touches and that had been cut before.
#[derive(Clone)]
pub(super) struct Journal {
    done: VecDeque<Step>,
    undone: Vec<Step>,
    /// Bytes of all steps but an open one.
    bytes: usize,
    limit_bytes: usize,
    /// Whether the last of `done` takes further bricks.
    is_open: bool,
    /// Number of the stroke that last touched a brick, by its place.
    touched_in: Vec<u64>,
    stroke: u64,
}

impl Journal {
    pub fn new(bricks: usize, limit_bytes: usize) -> Self {
        Self {
            done: VecDeque::new(),
            undone: Vec::new(),
            bytes: 0,
            limit_bytes,
            is_open: false,
            touched_in: vec![0; bricks],
            stroke: 0,
        }
    }

    pub fn limit(&mut self, bytes: usize) {
        self.limit_bytes = bytes;
        self.close();
    }

    /// Ends the stroke; the next brick to change begins another.
    pub fn close(&mut self) {
        if self.is_open {
            self.is_open = false;
            self.bytes += self.done.back().map_or(0, Step::bytes);
        }
        self.trim(1);
    }

    /// Oldest strokes go first, then the redo that is farthest away; `kept` of them stay whatever they take.
    fn trim(&mut self, kept: usize) {
        while self.bytes > self.limit_bytes && self.done.len() + self.undone.len() > kept {
            let oldest = if self.done.is_empty() { Some(self.undone.remove(0)) } else { self.done.pop_front() };
            self.bytes -= oldest.map_or(0, |step| step.bytes());
        }
    }

    /// Notes a brick before it changes.
    pub fn note(&mut self, place: usize, brick: &Option<Brick>) {
        if !self.is_open {
            for step in self.undone.drain(..) {
                self.bytes -= step.bytes();
            }
            self.trim(0);
            self.done.push_back(Step::default());
            self.is_open = true;
            self.stroke += 1;
        }
        if self.touched_in[place] == self.stroke {
            return;
        }
        self.touched_in[place] = self.stroke;
        if let Some(step) = self.done.back_mut() {
            step.bricks.push((place as u32, brick.clone()));
        }
    }

    pub fn can_undo(&self) -> bool {
        !self.done.is_empty()
    }

    pub fn can_redo(&self) -> bool {
        !self.undone.is_empty()
    }

    /// The last stroke, whose bricks the caller exchanges with its own and gives to [`Journal::undid`].
    pub fn undo(&mut self) -> Option<Step> {
        self.close();
        let step = self.done.pop_back()?;
        self.bytes -= step.bytes();
        Some(step)
    }

    pub fn undid(&mut self, step: Step) {
        self.bytes += step.bytes();
        self.undone.push(step);
        self.trim(1);
    }

    /// The last undone stroke, whose bricks the caller exchanges with its own and gives to [`Journal::redid`].
    pub fn redo(&mut self) -> Option<Step> {
        let step = self.undone.pop()?;
        self.bytes -= step.bytes();
        Some(step)
    }

    pub fn redid(&mut self, step: Step) {
        self.bytes += step.bytes();
        self.done.push_back(step);
        self.trim(1);
    }
}
