//! What is wrong with a pool that cannot be.

use bevy::ecs::entity::Entity;
use bevy::reflect::Reflect;
use glam::UVec2;
use thiserror::Error;

/// Why there is no such pool.
#[derive(Clone, Debug, Error, PartialEq, Reflect)]
pub enum PoolError {
    /// The grid's size is out of range.
    #[error("size: a pool of {} x {} cells cannot be; each side takes from {least} to {most}", size.x, size.y)]
    Size {
        /// Cells that were asked for.
        size: UVec2,
        /// Fewest cells along a side.
        least: u32,
        /// Most cells along a side.
        most: u32,
    },
    /// The cells have no length that can be worked with.
    #[error("cell_m: {cell_m} m is no side of a cell; it must be a number from 1e-6 to 1")]
    Cell {
        /// Side of a cell that was asked for, metres.
        cell_m: f32,
    },
    /// A mask has another number of cells than the grid.
    #[error("a mask of {} x {} cells does not fit a pool of {} x {}", found.x, found.y, expected.x, expected.y)]
    MaskSize {
        /// Cells of the mask.
        found: UVec2,
        /// Cells of the grid.
        expected: UVec2,
    },
    /// The entity that a pool names has no volume.
    #[error("volume: {volume} is no volume; give the pool an entity with a CtVolume")]
    NoVolume {
        /// The entity.
        volume: Entity,
    },
    /// The volume has no structures, so that nothing says where its bone is.
    #[error("volume: {volume} has no structures, so nothing says where its bone is; see Structures::for_volume")]
    NoStructures {
        /// The volume.
        volume: Entity,
    },
    /// A level that is none.
    #[error("level: {level_m} m is no level; it must be a finite number of metres over the pool's origin")]
    Level {
        /// The level.
        level_m: f32,
    },
    /// A level that lies beyond the volume.
    #[error(
        "level: at {level_m} m over the pool's origin there is no volume; it reaches from {least_m} m to {most_m} m there"
    )]
    LevelOutside {
        /// The level, metres.
        level_m: f32,
        /// Lowest part of the volume, metres.
        least_m: f32,
        /// Highest part of it, metres.
        most_m: f32,
    },
    /// The pool's grid lies beside its volume.
    #[error("the pool lies beside its volume: none of its columns meets bone; move the pool's entity over it")]
    Beside,
    /// The transform cannot be used.
    #[error("the transform of the pool or its volume has no inverse, or numbers that are not finite")]
    Transform,
}
