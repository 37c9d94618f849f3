// Walking along rays over what shows nothing, shared by the passes that do. Space: voxel, and blocks of 4^3 voxels; ways are
// counted in steps of `volume.step_m`. CPU twin: `volume/software/march.rs`.
#define_import_path bevy_surgery::volume_walk

#import bevy_surgery::volume::{Ray, volume}
#ifdef DEFORMED
#import bevy_surgery::volume_deform::rest_speeds
#endif

// Pixels along the side of the squares that have one start. Rust twin: `SQUARE_PX` in `volume/render/views.rs`.
const SQUARE_PX: f32 = 8.0;

// How far from each block of 4^3 voxels the next one is that may show something, in blocks; 0 for such a block.
@group(1) @binding(6) var blocks: texture_3d<u32>;

// First and last depth of a ray in what is drawn, metres; the box of what can be seen grown by some voxels.
fn drawn_range(ray: Ray, along: vec3<f32>, grown: f32) -> vec2<f32> {
    let inverse = 1.0 / along;
    let a = (volume.low - grown - ray.origin) * inverse;
    let b = (volume.high + grown - ray.origin) * inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    return vec2(max(max(enter.x, enter.y), max(enter.z, volume.near_m)), min(leave.x, min(leave.y, leave.z)));
}

// Directions along an axis have no inverse: a step to the side that no picture shows.
fn inclined(along: vec3<f32>) -> vec3<f32> {
    let least = vec3(1e-7 * max(max(abs(along.x), abs(along.y)), abs(along.z)));
    return select(along, least, abs(along) < least);
}

// How many steps matter takes at least to come by a block's length, forth and back along each axis.
struct Pace {
    forth: vec3<f32>,
    back: vec3<f32>,
}

fn pace_of(along: vec3<f32>) -> Pace {
    let step_block = along * (volume.step_m * 0.25);
#ifdef DEFORMED
    let speeds = rest_speeds(step_block);
    return Pace(1.0 / max(speeds.high, vec3(1e-9)), 1.0 / min(speeds.low, vec3(-1e-9)));
#else
    return Pace(1.0 / max(step_block, vec3(1e-9)), 1.0 / min(step_block, vec3(-1e-9)));
#endif
}

struct Look {
    // Steps in which nothing is passed that shows; less than 0 where something may show here.
    steps: f32,
    is_empty: bool,
}

// Looks at the block of some matter, its place in blocks. A margin in blocks keeps that far from what shows something.
fn look_at(at: vec3<f32>, pace: Pace, margin: f32) -> Look {
    let block = floor(at);
    // Beyond the grid it is as far to what shows something as it is to the grid, or as from the grid's nearest block.
    let inside = clamp(vec3<i32>(block), vec3(0), vec3<i32>(textureDimensions(blocks)) - 1);
    let beyond = abs(block - vec3<f32>(inside));
    let distance = max(f32(textureLoad(blocks, inside, 0).r), max(beyond.x, max(beyond.y, beyond.z)));
    let reach = distance - 1.0 - margin;
    let steps = min((block + reach + 1.0 - at) * pace.forth, (block - reach - at) * pace.back);
    return Look(min(steps.x, min(steps.y, steps.z)), reach >= 0.0);
}
