//! All integration tests in one binary: linking Bevy is the slow part.

mod documents;
mod harness;
mod highlights;
mod organ_asset;
mod organ_atlas;
mod organ_chart;
mod organ_load;
mod organ_pick;
mod organ_picking;
mod organ_texture_mesh;
mod pacing;
mod reactions_drops;
mod reactions_heat;
mod reactions_model;
mod reactions_paint;
mod reactions_pass;
mod reactions_regions;
mod reflection;
mod schedule;
mod shaders;
mod skin_library;
mod skin_pass;
mod skin_texture;
mod skin_tiles;
mod support;
mod view;
