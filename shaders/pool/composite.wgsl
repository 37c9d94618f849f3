// The surface of a pool over what was drawn before (paper of 2009, sections 5.1 to 5.3). Spaces: pool, target, clip; see
// `pool.wgsl`. Rust twin: `pool/software.rs`.

#import bevy_surgery::lights::incident
#import bevy_surgery::organ::{exposed_to_target, view}
#import bevy_surgery::pool::{Mixture, PI, fresnel, in_scattered, meniscus, pool, refractive_index, transmittance}
#ifdef FOAM
#import bevy_surgery::pool::foam::foam
#endif
#ifndef ENVIRONMENT_MAP
#import bevy_surgery::pool::surroundings::surroundings
#endif

@group(1) @binding(1) var surface: texture_2d<f32>;
@group(1) @binding(2) var surface_sampler: sampler;
@group(1) @binding(3) var scene: texture_2d<f32>;
#ifdef MULTISAMPLED
@group(1) @binding(4) var scene_depth: texture_depth_multisampled_2d;
#else
@group(1) @binding(4) var scene_depth: texture_depth_2d;
#endif
@group(1) @binding(5) var environment: texture_cube<f32>;
@group(1) @binding(6) var environment_sampler: sampler;

const TILE: u32 = 32u;
// Thinner fluid is none: rounding of depths must not draw a film over a ground at the level.
const THINNEST_M: f32 = 5e-6;
// What is farther under the surface than this counts as so deep.
const DEEPEST_M: f32 = 1.0;
// The steepest that waves are drawn.
const STEEPEST: f32 = 0.8;
const HALF_ROOT_3: f32 = 0.8660254037844386;
const MOST: f32 = 60000.0;

struct Varying {
    @builtin(position) position: vec4<f32>,
    // On the calm surface.
    @location(0) place_m: vec2<f32>,
    // What a white sheet on the surface would send out, before exposure.
    @location(1) white: vec3<f32>,
}

struct Shown {
    @location(0) colour: vec4<f32>,
#ifdef MULTISAMPLED
    @builtin(sample_mask) samples: u32,
#endif
}

fn to_eye(at_m: vec3<f32>) -> vec3<f32> {
    return normalize(pool.eye_pool.xyz - at_m * pool.eye_pool.w);
}

// A tile of the calm surface, with the depth of the highest wave: what lies nearer hides it.
@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) tile: vec2<u32>) -> Varying {
    let cell = min(vec2<f32>((tile + vec2(index & 1u, index >> 1u)) * TILE), pool.grid_size);
    let at_m = vec3((cell - 0.5 * pool.grid_size) * pool.cell_m, pool.level_m);
    var position = pool.clip_from_pool * vec4(at_m, 1.0);
    let eye = to_eye(at_m);
    let lifted = pool.clip_from_pool * vec4(at_m + eye * (pool.greatest_wave_m / max(eye.z, 1e-3)), 1.0);
    // Where the eye is among the waves nothing hides them.
    let z = select(1.0, lifted.z / lifted.w, lifted.w > 1e-6);
    position.z = min(z, 1.0) * position.w;
    var lux = pool.lights.ambient * PI;
    for (var k = 0u; k < pool.lights.count; k++) {
        let light = pool.lights.lights[k];
        let beam = incident(light, at_m);
        lux += beam.illuminance_lux * (max(beam.to_light.z, 0.0) + light.ambient_fraction);
    }
    return Varying(position, at_m.xy, lux / PI);
}

// Depth of a pixel; of several samples the nearest one, so that whatever is not all under the surface counts as above it.
fn depth_at(texel: vec2<i32>) -> f32 {
#ifdef MULTISAMPLED
    var nearest = 0.0;
    for (var sample = 0u; sample < textureNumSamples(scene_depth); sample++) {
        nearest = max(nearest, textureLoad(scene_depth, texel, sample));
    }
    return nearest;
#else
    return textureLoad(scene_depth, texel, 0);
#endif
}

fn readable(texel: vec2<f32>) -> vec2<f32> {
    return clamp(texel, pool.readable_px.xy, pool.readable_px.zw - 1.0);
}

// Whether what a pixel shows lies under a height; without a division, so that it also holds where nothing was drawn.
fn is_under(pixel: vec2<f32>, z: f32, height_m: f32) -> bool {
    let target_point = vec4(pixel, z, 1.0);
    return dot(pool.height_row, target_point) < height_m * dot(pool.unit_row, target_point);
}

fn point_of(pixel: vec2<f32>, z: f32) -> vec3<f32> {
    let point = pool.pool_from_target * vec4(pixel, z, 1.0);
    return point.xyz / max(point.w, 1e-9);
}

// By how much a pixel's ground stands above the surface as a wall of the meniscus does: 0 to 1.
fn wall_at(pixel: vec2<f32>, height_m: f32) -> f32 {
    let texel = floor(readable(pixel));
    let target_point = vec4(texel + 0.5, depth_at(vec2<i32>(texel)), 1.0);
    let above_m = dot(pool.height_row, target_point) / max(dot(pool.unit_row, target_point), 1e-9) - height_m;
    return saturate(above_m / (0.5 * pool.meniscus_width_m)) * saturate(2.0 - above_m / pool.meniscus_reach_m);
}

// The same in a direction: the meniscus fades towards its width.
fn wall_towards(pixel: vec2<f32>, across: vec2<f32>, height_m: f32) -> f32 {
    return mix(wall_at(pixel + across, height_m), wall_at(pixel + 0.4 * across, height_m), 0.65);
}

fn height_of(texel: vec4<f32>) -> f32 {
    let height_m = texel.x * pool.metres_per_height / max(texel.w, 1e-3);
    return clamp(height_m, -pool.greatest_wave_m, pool.greatest_wave_m);
}

// Beside walls there is no slope across them.
fn height_beside(uv: vec2<f32>, own_m: f32) -> f32 {
    let texel = textureSampleLevel(surface, surface_sampler, uv, 0.0);
    return select(own_m, height_of(texel), texel.w > 0.25);
}

// Colour of the ground at a place of the picture, from those of the four texels around it that lie under the surface.
fn ground_at(pixel: vec2<f32>, height_m: f32) -> vec3<f32> {
    let corner = floor(pixel - 0.5);
    let share = pixel - 0.5 - corner;
    var colour = vec3(0.0);
    var weight = 0.0;
    var any_colour = vec3(0.0);
    for (var k = 0u; k < 4u; k++) {
        let side = vec2<f32>(vec2(k & 1u, k >> 1u));
        let texel = readable(corner + side);
        let place = vec2<i32>(texel);
        let near = mix(1.0 - share, share, side);
        let own = near.x * near.y;
        let here = textureLoad(scene, place, 0).rgb;
        let counts = select(0.0, own, is_under(texel + 0.5, depth_at(place), height_m));
        colour += here * counts;
        weight += counts;
        any_colour += here * own;
    }
    // A pixel of which only some samples lie under it has no other colour than the mean of all.
    return select(any_colour, colour / max(weight, 1e-6), weight > 1e-3);
}

@fragment
fn fragment(in: Varying) -> Shown {
    let pixel = in.position.xy;
    // The calm surface, then where the ray meets the height that it has there. Around that place three samples in a triangle
    // give height and slope; what is dissolved hardly differs.
    let eye = to_eye(vec3(in.place_m, pool.level_m));
    let per_metre = 1.0 / (pool.grid_size * pool.cell_m);
    let own = textureSampleLevel(surface, surface_sampler, in.place_m * per_metre + 0.5, 0.0);
    let calm_m = height_of(own);
    let place_m = in.place_m + eye.xy * (calm_m / max(eye.z, 0.05));
    let uv = place_m * per_metre + 0.5;
    let side = 1.0 / pool.grid_size;
    let first_m = height_beside(uv + vec2(side.x, 0.0), calm_m);
    let second_m = height_beside(uv + vec2(-0.5, HALF_ROOT_3) * side, calm_m);
    let third_m = height_beside(uv - vec2(0.5, HALF_ROOT_3) * side, calm_m);
    let height_m = pool.level_m + (first_m + second_m + third_m) / 3.0;
    let mixture_share = saturate(own.yz / max(own.w, 1e-3));
    let mixture = Mixture(mixture_share.x, mixture_share.y);

#ifdef MULTISAMPLED
    // Samples that something covers stay as they are; the others share one value, for the farthest of them.
    var samples = 0u;
    var z = 1.0;
    for (var sample = 0u; sample < textureNumSamples(scene_depth); sample++) {
        let now = textureLoad(scene_depth, vec2<i32>(pixel), sample);
        let covers = is_under(pixel, now, height_m - THINNEST_M);
        samples |= select(0u, 1u << sample, covers);
        z = select(z, min(z, now), covers);
    }
    let is_seen = samples != 0u;
#else
    let z = textureLoad(scene_depth, vec2<i32>(pixel), 0);
    let is_seen = is_under(pixel, z, height_m - THINNEST_M);
#endif

    var slope = vec2(2.0 * first_m - second_m - third_m, 2.0 * HALF_ROOT_3 * (second_m - third_m)) / (3.0 * pool.cell_m);
    slope *= min(1.0, STEEPEST / max(length(slope), 1e-6));
    let normal = normalize(vec3(-slope, 1.0));
    // Walls around, for the meniscus.
    let across_px = max(pool.meniscus_width_m * pool.pixels_per_metre * in.position.w, 1.0);
    let right = wall_towards(pixel, vec2(across_px, 0.0), height_m);
    let left = wall_towards(pixel, vec2(-across_px, 0.0), height_m);
    let down = wall_towards(pixel, vec2(0.0, across_px), height_m);
    let up = wall_towards(pixel, vec2(0.0, -across_px), height_m);

    // Refraction (equations 7 and 8): the ground is taken to be as deep where the refracted ray meets it as where it is seen.
    let index = refractive_index(mixture);
    let surface_m = vec3(place_m, height_m);
    let depth_m = clamp(height_m - point_of(pixel, z).z, 0.0, DEEPEST_M);
    let bent = refract(-eye, normal, 1.0 / index);
    let hit = pool.target_from_pool * vec4(surface_m + bent * (depth_m / max(-bent.z, 0.1)), 1.0);
    let shift = (readable(hit.xy / hit.w) - pixel) * pool.refracts;
    // Never onto what stands out of the fluid: half as far, or not at all.
    let whole = floor(pixel + shift);
    let midway = floor(pixel + 0.5 * shift);
    let whole_z = depth_at(vec2<i32>(whole));
    let midway_z = depth_at(vec2<i32>(midway));
    let midway_share = select(0.0, 0.5, is_under(midway + 0.5, midway_z, height_m));
    let share = select(midway_share, 1.0, is_under(whole + 0.5, whole_z, height_m));
    let seen_z = select(select(z, midway_z, share > 0.25), whole_z, share > 0.75);
    let seen_px = pixel + share * shift;
    let ground = ground_at(seen_px, height_m);

    // Absorption along the way that the light took: down to what is seen, and up to the eye.
    let seen_m = point_of(select(floor(seen_px) + 0.5, pixel, share < 0.25), seen_z);
    let path_m = min(distance(seen_m, surface_m), DEEPEST_M);
    let light_path_m = clamp(height_m - seen_m.z, 0.0, DEEPEST_M);
    let through = transmittance(mixture, path_m + light_path_m);
    let scattered = in.white * in_scattered(mixture, path_m);

    // What the surface mirrors. The meniscus is so curved that it mirrors all that is around, a lamp always among it.
    let reflectivity = fresnel(dot(normal, eye), index);
    let rim = min(meniscus(right + left + down + up), 1.0 - reflectivity);
    let mirrored = reflect(-eye, normal);
#ifdef ENVIRONMENT_MAP
    let direction = (pool.environment_from_pool * vec4(mirrored, 0.0)).xyz;
    let coarsest = f32(textureNumLevels(environment) - 1u);
    let from_around = textureSampleLevel(environment, environment_sampler, direction, 0.0).rgb;
    let mean = textureSampleLevel(environment, environment_sampler, direction, coarsest).rgb * pool.environment_strength;
#else
    let footprint = length(fwidth(mirrored)) * 0.5;
    let from_around = surroundings(surface_m, mirrored, footprint, in.white);
    let mean = in.white * (pool.meniscus_light * pool.environment_strength);
#endif
    var kept = through * (1.0 - reflectivity - rim);
    var added = scattered * (1.0 - reflectivity - rim) + from_around * (reflectivity * pool.environment_strength)
        + mean * rim;
#ifdef FOAM
    let bubbles = foam(place_m);
    let cover = 0.22 * bubbles.x + 0.5 * bubbles.y;
    kept *= 1.0 - cover;
    added = mix(added, in.white * 0.9, cover);
#endif
    // What was there before is exposed, and tonemapped where later passes do not: only what is added needs that still.
    let shown = ground * kept + exposed_to_target(vec4(min(added * view.exposure, vec3(MOST)), 1.0)).rgb;
    let colour = vec4(min(shown, vec3(MOST)), 1.0);
    // Only now, because differences between neighbouring pixels need all of them.
    if !is_seen || own.w <= 0.0 {
        discard;
    }
#ifdef MULTISAMPLED
    return Shown(colour, samples);
#else
    return Shown(colour);
#endif
}
