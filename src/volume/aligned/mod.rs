//! Slices that are aligned with a deformed volume instead of the view (paper of 2001, sections 4 and 4.1): the geometry, without a
//! GPU.
//!
//! The box of a lattice is cut across one of its own axes, the one that the view looks along most. Every patch then shows a
//! rectangle of each plane that passes through it. These rectangles never move; what a deformation changes are the texture
//! coordinates at their corners, and at a fifth vertex in their middle, so that four triangles come near to the trilinear field
//! (figure 6).
//!
//! - [`PatchPolygons`]: the rectangles of all patches for the three axes, and their vertices between the key frames of a
//!   patch's front and back (section 4.1)
//! - [`SliceStack`]: which axis and which order a view takes, and where the planes are
//! - [`ShowingBlocks`], [`visible_polygons`]: which rectangles can show something
//!
//! Places are shares of the lattice's box unless a name says otherwise. Across an axis `a`, `u` is the next axis and `v` the one
//! after it, in turn.

mod polygons;
mod showing;
mod stack;

pub use polygons::{LEAVES, PatchFrames, PatchPolygons, PatchRect, PolygonVertex, polygon_vertex};
pub use showing::{ShowingBlocks, visible_polygons};
pub use stack::{MAX_SLICES, SliceStack};

#[cfg(test)]
mod tests;
