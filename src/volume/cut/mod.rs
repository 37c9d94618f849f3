//! What was cut out of a volume, and the burrs that cut it.
//!
//! A [`CutVolume`] says of each voxel how much of its opacity remains; the volume itself never changes. Drilling
//! removes mm³ per second, whatever the size of the voxels and the length of the step ([`CutVolume::drill`]). Strokes
//! can be undone, the whole can be saved, and whoever keeps a copy (a texture, a hierarchy of blocks, a distance field)
//! asks for the boxes that changed since it last looked.
//!
//! # What a burr removes
//!
//! **Rate.** Preston's equation, with which grinding is reckoned: per second a burr can remove `k * force * surface
//! speed` mm³ of cortical bone, `surface speed = pi * diameter * turns per second` ([`Burr::cortical_mm3_per_s`]).
//! Other tissue takes as many times longer as it is harder: a voxel costs `hardness * solid * voxel volume` of the
//! step's budget.
//!
//! **Place.** The body that the burr covers on its way, with a ramp of one voxel's width at its surface whose sum is
//! the body's volume, also for burrs of two or three voxels (`sweep.rs`). A voxel keeps at most `1 - coverage`, so the
//! same pose removes nothing twice, however many steps it is held. What is empty costs nothing and is lowered as well:
//! else interpolation would leave a veil on cut surfaces.
//!
//! **Both.** Where the budget does not suffice for the body, the body is shrunk by moving its surface inwards, evenly,
//! until what it removes costs the budget. The cost falls piecewise linearly with the distance by which the surface
//! moves, and Newton's method within an interval finds it to a ten-thousandth. So the middle of the burr goes first and
//! surfaces stay crisp and round. Nothing is carried into the next step: budget that finds nothing to remove is lost,
//! as it is for a burr that turns in the air.
//!
//! All lengths are millimetres, in a frame along the grid's axes (`frame.rs`): neither the voxels' size and shape nor
//! the length of a step has a say in how much is removed.

mod bricks;
mod burr;
mod changes;
mod drill;
mod frame;
mod gather;
mod journal;
mod save;
mod sweep;

pub use burr::{BURR_DIAMETERS_M, Burr, BurrError, BurrKind, BurrPose, BurrShape, BurrStroke, MAX_BURR_LENGTH_M};
pub use drill::Removal;
pub use save::CutError;

use super::data::{Volume, check_size};
use super::grid::VoxelBox;
use super::structures::Structures;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bricks::Bricks;
use changes::Changes;
use gather::Scratch;
use glam::{UVec3, Vec3};
use journal::Journal;
use std::fmt;

/// Bytes that undo and redo keep unless [`CutVolume::set_undo_limit`] says otherwise.
pub const UNDO_BYTES: usize = 64 << 20;

/// Remaining opacity of each voxel of a volume, from 1, untouched, to 0, removed.
///
/// Memory is taken in bricks of 16³ voxels where something was cut. Two are equal if their voxels are.
#[derive(Clone, Component, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct CutVolume {
    bricks: Bricks,
    journal: Journal,
    changes: Changes,
    scratch: Scratch,
}

impl fmt::Debug for CutVolume {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let stored = self.bricks.list.iter().flatten().count();
        f.debug_struct("CutVolume")
            .field("size", &self.bricks.size)
            .field("bricks", &stored)
            .field("revision", &self.revision())
            .finish_non_exhaustive()
    }
}

impl PartialEq for CutVolume {
    fn eq(&self, other: &Self) -> bool {
        self.bricks.same(&other.bricks)
    }
}

impl CutVolume {
    /// An untouched one for a volume of a size. A size that no volume has ([`check_size`]) is taken for 0.
    pub fn new(size: UVec3) -> Self {
        let size = if check_size(size).is_ok() { size } else { UVec3::ZERO };
        let bricks = Bricks::new(size);
        let journal = Journal::new(bricks.list.len(), UNDO_BYTES);
        Self { bricks, journal, changes: Changes::new(), scratch: Scratch::default() }
    }

    /// Voxels along each axis.
    pub fn size(&self) -> UVec3 {
        self.bricks.size
    }

    /// Remaining opacity of a voxel; 1 outside the grid.
    pub fn remaining(&self, voxel: UVec3) -> f32 {
        self.bricks.get(voxel)
    }

    /// Remaining opacity at voxel coordinates, trilinear, clamped to the edge; 1 where a coordinate is not a number.
    pub fn sample(&self, voxel: Vec3) -> f32 {
        self.bricks.sample(voxel)
    }

    /// Copies the voxels of a box, x fastest, from 0 for removed to 255 for untouched, rounded. Those outside the grid are
    /// untouched; of a box with more voxels than `into` has, the first are copied.
    pub fn copy_remaining(&self, of: VoxelBox, into: &mut [u8]) {
        self.bricks.copy(of, into);
    }

    /// Whether nothing was cut in a box. May be false for untouched voxels that share a brick with cut ones.
    pub fn is_untouched(&self, of: VoxelBox) -> bool {
        self.bricks.is_untouched(of)
    }

    /// A number that grows with every change, and differs from that of any other cut that was not cloned from this one.
    pub fn revision(&self) -> u64 {
        self.changes.revision()
    }

    /// The boxes that changed since a revision: at most 8, merged where they are near. None if everything may have changed:
    /// the revision is too long ago, or another cut's.
    pub fn changes_since(&self, revision: u64) -> Option<Vec<VoxelBox>> {
        self.changes.since(revision)
    }

    /// Bytes of its bricks, as if none of them were shared with a clone.
    pub(crate) fn bytes(&self) -> usize {
        self.bricks.list.iter().flatten().count() * bricks::VOXELS * size_of::<f32>()
    }

    /// A number that this cut shares with its clones only.
    pub(crate) fn lineage(&self) -> u64 {
        self.changes.lineage
    }

    /// Removes what a burr takes during a step of `dt_s` seconds, as the [module](self) describes. Nothing is removed
    /// if a number is not finite, the burr's sizes or its axis are none, force or time are not positive, or the cut, the volume
    /// and the structures differ in size. Voxels of label 0 are as hard as cortical bone.
    pub fn drill(&mut self, volume: &Volume, structures: &Structures, stroke: &BurrStroke, dt_s: f64) -> Removal {
        drill::drill(self, volume, structures, stroke, dt_s)
    }

    /// Begins a stroke: what is drilled until the next call is undone together. Without any call everything is one stroke.
    pub fn begin_stroke(&mut self) {
        self.journal.close();
    }

    /// Whether there is a stroke to undo.
    pub fn can_undo(&self) -> bool {
        self.journal.can_undo()
    }

    /// Whether there is a stroke to redo.
    pub fn can_redo(&self) -> bool {
        self.journal.can_redo()
    }

    /// Takes the last stroke, or a reset, back; false if there is none. Drilling afterwards begins a new stroke.
    pub fn undo(&mut self) -> bool {
        let Some(mut step) = self.journal.undo() else { return false };
        self.exchange(&mut step);
        self.journal.undid(step);
        true
    }

    /// Brings the last undone stroke back; false if there is none, or something was drilled since.
    pub fn redo(&mut self) -> bool {
        let Some(mut step) = self.journal.redo() else { return false };
        self.exchange(&mut step);
        self.journal.redid(step);
        true
    }

    fn exchange(&mut self, step: &mut journal::Step) {
        for (place, brick) in &mut step.bricks {
            std::mem::swap(&mut self.bricks.list[*place as usize], brick);
        }
        self.changes.push_all(step.bricks.iter().map(|(place, _)| self.bricks.bounds(*place as usize)));
    }

    /// Bytes of bricks that undo and redo keep, 64 MiB at first. Beyond that the oldest strokes are forgotten; the latest is
    /// kept whatever it takes, so memory stays below this and one more copy of the cut.
    pub fn set_undo_limit(&mut self, bytes: usize) {
        self.journal.limit(bytes);
    }

    /// Makes everything untouched again. Can be undone as a stroke can.
    pub fn reset(&mut self) {
        self.journal.close();
        let mut changed = Vec::new();
        for (place, brick) in self.bricks.list.iter_mut().enumerate() {
            if brick.is_some() {
                self.journal.note(place, brick);
                *brick = None;
                changed.push(place);
            }
        }
        self.journal.close();
        self.changes.push_all(changed.into_iter().map(|place| self.bricks.bounds(place)));
    }
}
