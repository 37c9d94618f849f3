//! What is wrong with a body that cannot be.

use crate::deform::LatticeError;
use bevy::prelude::*;
use thiserror::Error;

/// Why a body cannot be made or changed. A refused change leaves the body as it was.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
pub enum ElasticError {
    /// The box's edges are not at right angles.
    #[error("the lattice's box is sheared: its edges {edges_m:?} m must be at right angles for an elastic body")]
    Sheared {
        /// The edges, body space, metres.
        edges_m: [Vec3; 3],
    },
    /// No cell holds anything.
    #[error("no cell of the lattice holds any tissue: is the organ or the volume inside its box?")]
    Empty,
    /// There is no such vertex, or it follows others.
    #[error("vertex {vertex} cannot be pinned: the lattice has {count} vertices, and constrained ones follow others")]
    NoVertex {
        /// What was asked for.
        vertex: usize,
        /// Vertices of the lattice.
        count: usize,
    },
    /// Another number of cells than the lattice has patches.
    #[error("cells: {found} of them for {expected} patches")]
    WrongCells {
        /// Cells that were given.
        found: usize,
        /// Patches of the lattice.
        expected: usize,
    },
    /// A cell of a tissue that is not in the list.
    #[error("cell {cell}: there is no tissue number {number}")]
    NoTissue {
        /// The cell.
        cell: usize,
        /// The tissue's number.
        number: usize,
    },
    /// There can be no such lattice.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// Another box than the body's.
    #[error("the lattice has another box than the body was made for; make the body anew")]
    OtherBox,
}
