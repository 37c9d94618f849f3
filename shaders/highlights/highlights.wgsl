// Layer 3: the lamp's reflections on moist tissue, added to what is there. Rust twins: `highlights/profile.rs` (tables),
// `highlights/radiance.rs` (the whole), `highlights/render/prepare.rs` (uniform).
//
// Spaces: world, metres and radians, and the plane of tilts: how far a normal n is from the halfway vector h of eye and
// light, by Lambert's equal-area map, t = (n - (n.h) h) sqrt(2 / (1 + n.h)), so that |t| = 2 sin(angle / 2).
//
// A ring light of radius a whose middle is L away is mirrored on the circle |t| = t0, tan(2 t0) = a / (L e.h), where e
// points to the eye. It is drawn with the true e of the pixel, and e.h = 1 for a camera's own lamp. Seen at an angle c =
// cos(axis, h) the ring is an ellipse, c times as wide along the axis' projection k; t is stretched along k by s, s^2 = (t0^2 / 2 +
// r^2) / (c^2 t0^2 / 2 + r^2), with roughness r: equal second moments, so that a sharp ring is undistorted and a blurred one round.
//
// Table: rows of 256 texels over |t| / t0 from 0 to X = 1 + 5 (2 r D_far / a), holding 2 pi r^2 p at distance D = L e.h; a
// row per distance, evenly in log2 D, first those of the dry roughness, then those of the wet. Ramp: texel i is at (i -
// 32) / 31, and holds its distance from 0; sampled at t / (t0 X'), X' = 1 + 5 (2 r D / a), so that its error stays under a
// hundredth of the ring's radius for as long as there is a ring to see (r < 0.6 t0).
//
// Most of an organ mirrors nothing to the eye: triangles where nothing can be seen are left out of the index buffer
// (`highlights/render/cull.rs`), because software drivers take both sides of every branch in the fragment shader. They also
// run the body of a `for` once more than it turns, so loops end by `break if`.
//
// Radiance: F E (n.l) p / (4 (e.h)^2) with illuminance E and Schlick's F.

#import bevy_surgery::lights::{DIRECTIONAL, LightUniform, RING, incident}
#import bevy_surgery::organ::{CornerVertex, map_uv, organ, secondary_vertex, to_eye, to_target, view}

struct HighlightRing {
    log2_nearest_m: f32,
    slices_per_octave: f32,
    slice_count: f32,
    first_row: f32,
}

struct HighlightsUniform {
    rings: array<HighlightRing, 2>,
    strength: f32,
    reflectance: f32,
    dry_roughness: f32,
    wet_roughness: f32,
    film_relief_m: f32,
    grain_tilt: f32,
    grain_frequency_per_m: f32,
    // Beyond this tilt nothing is seen of a light without a ring: roughness, grain and film together.
    // By how much the organ's transform enlarges angles between normals, and lengths.
    has_gloss: u32,
    is_over: u32,
}

@group(2) @binding(0) var<uniform> highlights: HighlightsUniform;
@group(2) @binding(1) var table: texture_2d<f32>;
@group(2) @binding(2) var ramp: texture_2d<f32>;
@group(2) @binding(3) var table_sampler: sampler;
@group(2) @binding(4) var gloss: texture_2d<f32>;
@group(2) @binding(5) var gloss_sampler: sampler;

const PI: f32 = 3.141592653589793;
const REACH: f32 = 5.0;
const LEAST_RING_RADIUS_M: f32 = 1e-6;
const NEUTRAL: f32 = 128.0 / 255.0;
// No drop's rim is steeper, and no grain stronger than this many times its deviation: what is rejected early counts on it.
const STEEPEST_FILM: f32 = 0.4;
const STRONGEST_GRAIN: f32 = 2.0;

struct Varying {
    @invariant @builtin(position) clip: vec4<f32>,
    @location(0) position_world_m: vec3<f32>,
    @location(1) normal_world: vec3<f32>,
    @location(2) rest_position_m: vec3<f32>,
    @location(3) chart_direction: vec3<f32>,
}

struct Mirror {
    to_light: vec3<f32>,
    halfway: vec3<f32>,
    // Cosine between eye and halfway vector.
    facing: f32,
    // Distance to the light times this cosine, metres.
    distance_m: f32,
}

fn mirror(light: LightUniform, point_world_m: vec3<f32>, eye: vec3<f32>) -> Mirror {
    let path = light.position_world_m - point_world_m;
    let length_m = sqrt(max(dot(path, path), 1e-12));
    let to_light = select(path / length_m, -light.direction_world, light.kind == DIRECTIONAL);
    let sum = to_light + eye;
    let sum_length = max(length(sum), 1e-3);
    let facing = 0.5 * sum_length;
    return Mirror(to_light, sum / sum_length, facing, length_m * facing);
}

@vertex
fn vertex(corner: CornerVertex) -> Varying {
    let at = secondary_vertex(corner);
    var out: Varying;
    out.clip = view.clip_from_world * vec4(at.position_world_m, 1.0);
    out.position_world_m = at.position_world_m;
    out.normal_world = at.normal_world;
    out.rest_position_m = corner.rest_position_m;
    out.chart_direction = corner.chart_direction;
    return out;
}

// What the profiles of both roughnesses have in common.
struct RingView {
    axis: vec3<f32>,
    ring_radius_m: f32,
    axis_flat: vec3<f32>,
    // Tilt at which the ring is mirrored, radians.
    tilt: f32,
    distance_m: f32,
    // Place among the rows, from 0.
    slice: f32,
    across: vec3<f32>,
    along: vec3<f32>,
}

fn ring_view(ring: HighlightRing, light: LightUniform, at: Mirror) -> RingView {
    var out: RingView;
    out.axis = light.direction_world;
    out.ring_radius_m = max(light.ring_radius_m, LEAST_RING_RADIUS_M);
    out.axis_flat = light.direction_world - dot(light.direction_world, at.halfway) * at.halfway;
    out.tilt = 0.5 * atan(out.ring_radius_m / at.distance_m);
    out.distance_m = at.distance_m;
    out.slice = clamp((log2(at.distance_m) - ring.log2_nearest_m) * ring.slices_per_octave, 0.0, ring.slice_count - 1.0);
    // Coordinates across the halfway vector (Duff et al. 2017, "Building an orthonormal basis, revisited").
    let h = at.halfway;
    let side = select(-1.0, 1.0, h.z >= 0.0);
    let a = -1.0 / (side + h.z);
    let b = h.x * h.y * a;
    out.across = vec3(1.0 + side * h.x * h.x * a, side * b, -side * h.x);
    out.along = vec3(b, side + h.y * h.y * a, -h.y);
    return out;
}

// The profile of a ring light for a tilt; `first_row` is that of the roughness.
fn ring_density(ring: HighlightRing, seen: RingView, flat: vec3<f32>, roughness: f32, first_row: f32) -> f32 {
    // Foreshortening.
    let relative = roughness / seen.tilt;
    let foreshortened = dot(seen.axis_flat, seen.axis_flat);
    let squared = max(1.0 - foreshortened + 2.0 * relative * relative, 1e-4);
    let stretch = sqrt(1.0 + foreshortened / squared);
    let stretched = flat + seen.axis_flat * (dot(flat, seen.axis) / (squared * (stretch + 1.0)));
    let spread = 2.0 * REACH * roughness / seen.ring_radius_m;
    let domain = 1.0 + spread * seen.distance_m;
    let place = vec2(dot(stretched, seen.across), dot(stretched, seen.along)) / (seen.tilt * domain);
    let radius = textureSampleLevel(ramp, table_sampler, (place * 31.0 + 32.5) / 64.0, 0.0).r * domain;
    let farthest_m = exp2(ring.log2_nearest_m + (ring.slice_count - 1.0) / ring.slices_per_octave);
    let row = (first_row + seen.slice + 0.5) / f32(textureDimensions(table).y);
    let profile = textureSampleLevel(table, table_sampler, vec2(radius / (1.0 + spread * farthest_m), row), 0.0).r;
    // The ramp's rim is the end of what it can measure.
    return select(0.0, stretch * profile / (2.0 * PI * roughness * roughness), dot(place, place) < 1.0);
}

// The profile of a light without a ring.
fn point_density(flat: vec3<f32>, roughness: f32) -> f32 {
    let variance = roughness * roughness;
    return exp(-0.5 * dot(flat, flat) / variance) / (2.0 * PI * variance);
}

fn hash(cell: vec3<i32>) -> f32 {
    var h = bitcast<u32>(cell.x) * 0x8da6b343u ^ bitcast<u32>(cell.y) * 0xd8163841u ^ bitcast<u32>(cell.z) * 0xcb1ab31fu;
    h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12u)) * 0x297a2d39u;
    return f32(h >> 8u) / 8388608.0 - 1.0;
}

// Gradient of smooth value noise; each component has a standard deviation of about a half.
fn grain(at: vec3<f32>) -> vec3<f32> {
    let cell = vec3<i32>(floor(at));
    let f = fract(at);
    let t = f * f * (3.0 - 2.0 * f);
    let dt = 6.0 * f * (1.0 - f);
    var gradient = vec3(0.0);
    for (var k = 0; k < 8; k++) {
        let corner = vec3(k & 1, (k >> 1u) & 1, k >> 2u);
        let w = select(1.0 - t, t, corner == vec3(1));
        let dw = select(-dt, dt, corner == vec3(1));
        gradient += hash(cell + corner) * vec3(dw.x * w.y * w.z, w.x * dw.y * w.z, w.x * w.y * dw.z);
    }
    return gradient;
}

// How (u, v) of the map changes along a change of the chart's direction: the derivative of `map_uv`.
fn map_uv_along(d: vec3<f32>, change: vec3<f32>) -> vec2<f32> {
    if organ.is_planar != 0u {
        return change.xy;
    }
    let from_axis = max(length(d.xz), 1e-6);
    let du = (d.z * change.x - d.x * change.z) / (from_axis * from_axis);
    let outwards = dot(d.xz, change.xz) / from_axis;
    let dv = (d.y * outwards - from_axis * change.y) / dot(d, d);
    return vec2(du / (2.0 * PI), dv / PI);
}

fn wetness(gloss_value: f32) -> f32 {
    return saturate((gloss_value - NEUTRAL) / (1.0 - NEUTRAL));
}

fn gloss_at(uv: vec2<f32>) -> f32 {
    return textureSampleLevel(gloss, gloss_sampler, uv, 0.0).r;
}

struct Surface {
    normal: vec3<f32>,
    wetness: f32,
    // Share of the reflection that is left where it is dull.
    shine: f32,
}

// Normal and wetness under the film. Differences are taken over a texel where the map is magnified, so that a drop's
// rim is smooth.
fn filmed(
    normal: vec3<f32>,
    chart: vec3<f32>,
    chart_x: vec3<f32>,
    chart_y: vec3<f32>,
    along_x: vec3<f32>,
    along_y: vec3<f32>,
) -> Surface {
    let uv = map_uv(chart);
    let centre = gloss_at(uv);
    let shine = saturate(centre / NEUTRAL);
    if highlights.is_over == 0u {
        return Surface(normal, 0.0, shine);
    }
    let size = vec2<f32>(textureDimensions(gloss));
    let uv_x = map_uv_along(chart, chart_x);
    let uv_y = map_uv_along(chart, chart_y);
    let pixels_x = max(0.5, 0.7 / max(length(uv_x * size), 1e-4));
    let pixels_y = max(0.5, 0.7 / max(length(uv_y * size), 1e-4));
    let ahead = vec2(gloss_at(uv + uv_x * pixels_x), gloss_at(uv + uv_y * pixels_y));
    let behind = vec2(gloss_at(uv - uv_x * pixels_x), gloss_at(uv - uv_y * pixels_y));
    let wet_ahead = vec2(wetness(ahead.x), wetness(ahead.y));
    let wet_behind = vec2(wetness(behind.x), wetness(behind.y));
    let rise = 0.5 * highlights.film_relief_m * (wet_ahead - wet_behind) / vec2(pixels_x, pixels_y);
    // As `raised` of `organ.wgsl`, by differences of our own.
    let across_x = cross(along_y, normal);
    let across_y = cross(normal, along_x);
    let area = dot(along_x, across_x);
    let slope = sign(area) * (rise.x * across_x + rise.y * across_y);
    let steepest = STEEPEST_FILM * abs(area) / max(length(slope), 1e-20);
    let tilted = normalize(abs(area) * normal - slope * min(steepest, 1.0));
    return Surface(tilted, wetness(centre), shine);
}

@fragment
fn fragment(in: Varying, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let along_x = dpdx(in.position_world_m);
    let along_y = dpdy(in.position_world_m);
    let chart_x = dpdx(in.chart_direction);
    let chart_y = dpdy(in.chart_direction);
    let eye = to_eye(in.position_world_m);
    // Seen from behind (an open surface, a hollow organ): the side that is seen reflects.
    let is_outside = is_front == (organ.handedness > 0.0);
    let smooth_normal = normalize(select(-in.normal_world, in.normal_world, is_outside));
    var surface = Surface(smooth_normal, 0.0, 1.0);
    if highlights.has_gloss != 0u {
        surface = filmed(smooth_normal, in.chart_direction, chart_x, chart_y, along_x, along_y);
    }
    // Grain finer than a pixel is not seen.
    let cells = max(length(along_x), length(along_y)) * highlights.grain_frequency_per_m;
    let grain_tilt = highlights.grain_tilt * (1.0 - surface.wetness) * saturate(2.0 - 2.0 * cells);
    if grain_tilt > 0.0 {
        // Bent, or the lattice of the noise would show.
        let place = in.rest_position_m * highlights.grain_frequency_per_m;
        let slope = grain(place + 0.45 * sin(2.1 * place.yzx + vec3(0.0, 2.0, 4.0)));
        // Turns with the organ, and keeps its steepness when the organ is scaled.
        let turned = (organ.world_from_organ_normal * vec4(slope, 0.0)).xyz;
        var tilt = turned * (2.0 * length(slope) / max(length(turned), 1e-20));
        tilt -= dot(tilt, smooth_normal) * smooth_normal;
        tilt *= grain_tilt * min(1.0, STRONGEST_GRAIN / max(length(tilt), 1e-6));
        surface.normal = normalize(surface.normal + tilt);
    }
    var radiance = vec3(0.0);
    var k = 0u;
    loop {
        let light = organ.lights.lights[k];
        let at = mirror(light, in.position_world_m, eye);
        let cosine = dot(surface.normal, at.halfway);
        let flat = (surface.normal - cosine * at.halfway) * sqrt(2.0 / max(1.0 + cosine, 1e-4));
        var densities = vec2(0.0);
        if light.kind == RING {
            let ring = highlights.rings[min(k, 1u)];
            let seen = ring_view(ring, light, at);
            densities.x = ring_density(ring, seen, flat, highlights.dry_roughness, ring.first_row);
            densities.y = ring_density(ring, seen, flat, highlights.wet_roughness, ring.first_row + ring.slice_count);
        } else {
            densities.x = point_density(flat, highlights.dry_roughness);
            densities.y = point_density(flat, highlights.wet_roughness);
        }
        let grazing = 1.0 - min(at.facing, 1.0);
        let grazing_squared = grazing * grazing;
        let fresnel = mix(grazing_squared * grazing_squared * grazing, 1.0, highlights.reflectance);
        let lit = max(dot(surface.normal, at.to_light), 0.0);
        let reflected = fresnel * lit * mix(densities.x, densities.y, surface.wetness) / (4.0 * at.facing * at.facing);
        // A light that is seen against is mirrored nowhere.
        radiance += incident(light, in.position_world_m).illuminance_lux * select(0.0, reflected, at.facing > 1e-3);
        k++;
        continuing {
            break if k >= organ.lights.count;
        }
    }
    return to_target(highlights.strength * surface.shine * radiance, 1.0);
}
