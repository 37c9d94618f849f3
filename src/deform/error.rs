//! What is wrong with a lattice that cannot be.

use super::lattice::{MAX_LEVEL, Patch};
use bevy::reflect::Reflect;
use glam::{DVec3, Vec3};
use thiserror::Error;

/// Why a lattice cannot be made, changed or undone. A refused change leaves the lattice as it was.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
pub enum LatticeError {
    /// The box has no inside.
    #[error("box: a lattice from {low_m} m to {high_m} m has no inside; each side must be a finite length above 0")]
    EmptyBox {
        /// Lower corner that was asked for, metres.
        low_m: Vec3,
        /// Upper corner that was asked for, metres.
        high_m: Vec3,
    },
    /// Deeper than any lattice is.
    #[error("level: patches of level {level} cannot be; the deepest is {MAX_LEVEL}")]
    TooDeep {
        /// Level that was asked for.
        level: u32,
    },
    /// There is no such patch, or it is subdivided itself.
    #[error("patch: the lattice has no patch {patch}; it may have been subdivided")]
    NoPatch {
        /// What was asked for.
        patch: Patch,
    },
    /// There is no such vertex.
    #[error("vertex: the lattice has {count} vertices, and none is number {vertex}")]
    NoVertex {
        /// What was asked for.
        vertex: usize,
        /// Vertices of the lattice.
        count: usize,
    },
    /// A vertex between patches of different levels follows its neighbours.
    #[error(
        "vertex {vertex} is constrained: it follows the vertices {of:?} of a coarser patch (move those, or subdivide it)"
    )]
    Constrained {
        /// What was to be moved.
        vertex: usize,
        /// What it follows.
        of: Vec<usize>,
    },
    /// A translation that is no number.
    #[error("translation of vertex {vertex}: {translation} is not finite")]
    NotFinite {
        /// Whose translation.
        vertex: usize,
        /// The translation, in shares of the box.
        translation: Vec3,
    },
    /// Another number of translations than there are vertices.
    #[error("translations: {found} of them for {expected} vertices")]
    WrongCount {
        /// Translations that were given.
        found: usize,
        /// Vertices of the lattice.
        expected: usize,
    },
    /// A patch is turned inside out somewhere, so that two places show the same matter and there is no way back.
    #[error(
        "the lattice folds over itself in patch {patch}: matter there takes {determinant:.3} times as much \
         of the rest as of what is shown; move its vertices less, or subdivide it"
    )]
    Folded {
        /// The patch.
        patch: Patch,
        /// Least determinant of the Jacobian that was found in it: 0 or less, or so little more that it cannot be undone.
        determinant: f64,
    },
    /// A place that cannot be undone: not a number.
    #[error("place: {place} is not finite")]
    NoPlace {
        /// What was asked for, in shares of the box.
        place: DVec3,
    },
    /// Nothing to fit a lattice to.
    #[error("pairs: none are given; a lattice is fitted to one at least")]
    NoPairs,
    /// A fit without smoothness has no single answer.
    #[error(
        "smoothness: {smoothness} is not a number above 0; without any, vertices that no pair touches could be anywhere"
    )]
    NotSmooth {
        /// What was asked for.
        smoothness: f64,
    },
    /// An animation without key frames.
    #[error("key frames: there are none")]
    NoKeyFrames,
    /// A key frame that does not follow the one before it.
    #[error("key frame {frame}: its time, {time_s} s, is not a number above that of the one before it")]
    KeyFrameTime {
        /// Which one, from 0.
        frame: usize,
        /// Its time, seconds.
        time_s: f32,
    },
    /// A key frame of another lattice.
    #[error("key frame {frame}: {found} translations for {expected} vertices")]
    KeyFrameCount {
        /// Which one, from 0.
        frame: usize,
        /// Translations that it has.
        found: usize,
        /// Vertices of the lattice.
        expected: usize,
    },
}
