// Walks a ray per pixel through a volume. CPU twin: `volume/software/march.rs`.
//
// One loop, and in it one look at the blocks, one jump and one sample: pixels next to each other run in lockstep, and with
// loops inside the loop each waits where the others still jump or sample, which took half as long again.

#import bevy_surgery::volume::{NOTHING, covering_triangle, normal_of, ray_through, relative_depth, volume}
#import bevy_surgery::volume_field::{gradient_at, place_of, sample_at, scene_depth_m}

// How far from each block of 4^3 voxels the next one is that may show something, in blocks; 0 for such a block.
@group(1) @binding(6) var blocks: texture_3d<u32>;

const OPAQUE: f32 = 0.98;

struct Buffers {
    // Premultiplied, linear.
    @location(0) colour: vec4<f32>,
    // Unit normal in the world, relative depth.
    @location(1) relief: vec4<f32>,
    // Mean depth, depth where the ray ended; metres.
    @location(2) depth_m: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> Buffers {
    let ray = ray_through(at.xy);
    // Directions along an axis have no inverse: a step to the side that no picture shows.
    let least = vec3(1e-7 * max(max(abs(ray.along.x), abs(ray.along.y)), abs(ray.along.z)));
    let along = select(ray.along, least, abs(ray.along) < least);
    let inverse = 1.0 / along;
    let a = (volume.low - ray.origin) * inverse;
    let b = (volume.high - ray.origin) * inverse;
    let enter = min(a, b);
    let leave = max(a, b);
    var first_m = max(max(enter.x, enter.y), max(enter.z, volume.near_m));
    var last_m = min(min(leave.x, leave.y), min(leave.z, scene_depth_m(at.xy)));
    for (var plane = 0u; plane < volume.clip_plane_count; plane++) {
        let p = volume.clip_planes[plane];
        let start = dot(p, vec4(ray.origin, 1.0));
        let slope = dot(p.xyz, along);
        let cut_m = -start / slope;
        first_m = select(first_m, max(first_m, cut_m), slope > 0.0);
        last_m = select(last_m, min(last_m, cut_m), slope < 0.0);
        last_m = select(last_m, -1.0, slope == 0.0 && start < 0.0);
    }
    var k = ceil(first_m / volume.step_m);
    let last = min(floor(last_m / volume.step_m), k + 8192.0);
    // Places and blocks by number of steps.
    let first_place = place_of(ray.origin);
    let step_place = along * volume.step_m / volume.size;
    let first_block = (ray.origin + 0.5) * 0.25;
    let step_block = along * (volume.step_m * 0.25);
    let inverse_block = 1.0 / step_block;
    var colour = vec3(0.0);
    var opacity = 0.0;
    var gradient = vec3(0.0);
    var depth = 0.0;
    // Samples up to this one lie in a block that may show something.
    var known = k - 1.0;
    loop {
        if k > known {
            let block = floor(first_block + step_block * k);
            let distance = f32(textureLoad(blocks, vec3<i32>(block), 0).r);
            let reach = max(distance - 1.0, 0.0);
            let exit = select(block - reach, block + reach + 1.0, along > vec3(0.0));
            let exits = (exit - first_block) * inverse_block;
            let leave = min(exits.x, min(exits.y, exits.z));
            let is_empty = distance > 0.0;
            k = select(k, max(k + 1.0, ceil(leave)), is_empty);
            known = select(leave, k, is_empty);
        }
        // After a jump it may show nothing; then the block that it is in is looked at next.
        let place = first_place + step_place * k;
        let here = sample_at(place);
        let weight = select((1.0 - opacity) * here.opacity, 0.0, k > last);
        if weight > 0.0 {
            gradient += weight * gradient_at(place);
        }
        colour += weight * here.colour;
        depth += weight * k;
        opacity += weight;
        k += 1.0;
        continuing {
            break if opacity > OPAQUE || k > last;
        }
    }
    let end_m = min(k, last) * volume.step_m;
    let mean_m = depth * volume.step_m / max(opacity, 1e-6);
    let is_empty = opacity < 1.0 / 512.0;
    return Buffers(
        vec4(colour, opacity),
        select(vec4(normal_of(gradient, ray), relative_depth(mean_m)), vec4(0.0, 0.0, 0.0, NOTHING), is_empty),
        vec2(mean_m, end_m),
    );
}
