//! Slices aligned with a lattice, on the GPU (paper of 2001, sections 4 and 4.1).
//!
//! The polygons of a tree of patches lie in buffers that change with the tree only. Per frame the translations of the lattice's
//! vertices travel, and the numbers of the polygons that can show something. Slices are blended front to back, some at a time;
//! between these the pixels through which nothing shines any more are hidden, so that what lies behind costs a test of depth.

mod bodies;
mod draw;
mod pipelines;
mod view;

pub(super) use bodies::{AlignedBodies, AlignedBody, extract_bodies, write_bodies};
pub(super) use draw::{StackDrawing, draw_stack};
pub(super) use pipelines::{AlignedKey, AlignedPipelines, init};
pub(super) use view::AlignedView;
pub use view::{AlignedUniform, PatchFramesTexel, PatchRectTexel};

/// Depths that slices are tested against.
pub(super) const HIDDEN_FORMAT: bevy::render::render_resource::TextureFormat =
    bevy::render::render_resource::TextureFormat::Depth32Float;
