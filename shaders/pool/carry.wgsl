// Carries quantities with the flow. Rust twin: `pool/solver/advect.rs`. With DEEP for tiles without walls within reach.
#import bevy_surgery::pool_flow::{flow, tile_cell, place_of, mask, has, WET, OPEN_X, OPEN_Y, KNOWN_X, KNOWN_Y, ROWS}

// What carries: velocities, two numbers per place.
@group(1) @binding(0) var<storage, read> velocity: array<f32>;
// What is carried, two numbers per place: velocities as well, or what is dissolved.
@group(1) @binding(1) var<storage, read> source: array<f32>;
@group(1) @binding(2) var<storage, read_write> carried: array<f32>;
// For `correct_*`: what `carry_*` made of the source.
@group(1) @binding(3) var<storage, read> once: array<f32>;
// For what is dissolved: factors that the last step left to do.
@group(1) @binding(4) var<storage, read> scale: vec2<f32>;
// Amounts before and after, per invocation.
@group(1) @binding(5) var<storage, read_write> amounts: array<vec4<f32>>;

const MAX_CELLS_PER_STEP: f32 = 24.0;

// Four neighbours of a place, of which the first is given.
struct Corners {
    place: u32,
    weights: vec4<f32>,
}

fn corners_around(at: vec2<f32>) -> Corners {
    // The frame is counted. What is no number must not lead out of memory.
    let moved = clamp(at + 1.0, vec2(0.0), vec2<f32>(flow.size) + 1.0);
    let cell = vec2<u32>(moved);
    let share = moved - vec2<f32>(cell);
    let rest = 1.0 - share;
    let weights = vec4(rest.x * rest.y, share.x * rest.y, rest.x * share.y, share.x * share.y);
    return Corners(cell.y * flow.stride + cell.x + 3u, weights);
}

fn sum_of(values: vec4<f32>) -> f32 {
    return (values.x + values.y) + (values.z + values.w);
}

fn source_at(place: u32, axis: u32) -> vec4<f32> {
    let low = place * 2u + axis;
    let high = low + flow.stride * 2u;
    return vec4(source[low], source[low + 2u], source[high], source[high + 2u]);
}

fn once_at(place: u32, axis: u32) -> vec4<f32> {
    let low = place * 2u + axis;
    let high = low + flow.stride * 2u;
    return vec4(once[low], once[low + 2u], once[high], once[high + 2u]);
}

fn way_of(velocity: vec2<f32>) -> vec2<f32> {
    return clamp(velocity * flow.cells_per_velocity, vec2(-MAX_CELLS_PER_STEP), vec2(MAX_CELLS_PER_STEP));
}

#ifdef DEEP
fn origin_of(here: vec2<f32>, way: vec2<f32>, offset: vec2<f32>, bits: u32) -> vec2<f32> {
    return here - way;
}

fn weights_of(corners: Corners, known: u32) -> vec4<f32> {
    return corners.weights;
}

fn mean_of(values: vec4<f32>, weights: vec4<f32>, otherwise: f32) -> f32 {
    return sum_of(values * weights);
}

fn bounds_of(values: vec4<f32>, weights: vec4<f32>) -> vec2<f32> {
    return vec2(
        min(min(values.x, values.y), min(values.z, values.w)),
        max(max(values.x, values.y), max(values.z, values.w)),
    );
}

fn bits_at(place: u32) -> u32 {
    return 31u;
}
#else
// Where the flow comes from, in cells from the first number of the field; it stops before walls.
fn origin_of(here: vec2<f32>, way: vec2<f32>, offset: vec2<f32>, bits: u32) -> vec2<f32> {
    let farthest = max(abs(way.x), abs(way.y));
    let is_free = f32((bits >> 8u) & 255u) > farthest + 2.0;
    // One step is enough where nothing is in the way.
    let steps = select(max(ceil(farthest), 1.0), 1.0, is_free || bits == 0u);
    var reached = here;
    for (var step = 1.0; step <= steps; step += 1.0) {
        let next = here - way * (step / steps);
        let cell = floor(next + offset + 0.5);
        // Steps are no longer than a cell, so that the frame stops them.
        let place = u32(i32(cell.y) + 1) * flow.stride + u32(i32(cell.x) + 4);
        if !is_free && (mask[place] & WET) == 0u {
            break;
        }
        reached = next;
    }
    return reached;
}

// Weights of those corners alone that mean something.
fn weights_of(corners: Corners, known: u32) -> vec4<f32> {
    let low = corners.place;
    let high = low + flow.stride;
    return corners.weights * vec4(
        has(mask[low], known),
        has(mask[low + 1u], known),
        has(mask[high], known),
        has(mask[high + 1u], known),
    );
}

fn mean_of(values: vec4<f32>, weights: vec4<f32>, otherwise: f32) -> f32 {
    let weight = sum_of(weights);
    return select(otherwise, sum_of(values * weights) / max(weight, 1e-6), weight > 1e-6);
}

// Least and greatest of the corners that mean something; the first is greater than the second where none does.
fn bounds_of(values: vec4<f32>, known: vec4<f32>) -> vec2<f32> {
    let low = select(vec4(3e38), values, known > vec4(0.0));
    let high = select(vec4(-3e38), values, known > vec4(0.0));
    return vec2(min(min(low.x, low.y), min(low.z, low.w)), max(max(high.x, high.y), max(high.z, high.w)));
}

fn bits_at(place: u32) -> u32 {
    return mask[place];
}
#endif

// A side's velocity from where the flow comes from.
fn carry_side(here: vec2<f32>, place: u32, axis: u32, own: vec2<f32>, offset: vec2<f32>, bits: u32, known: u32) -> f32 {
    let corners = corners_around(origin_of(here, way_of(own), offset, bits));
    let weights = weights_of(corners, known);
    return mean_of(source_at(corners.place, axis), weights, source[place * 2u + axis]);
}

// Takes half of what comes back wrong off a side's velocity, within the numbers that it was made of.
fn correct_side(here: vec2<f32>, place: u32, axis: u32, own: vec2<f32>, offset: vec2<f32>, bits: u32, known: u32) -> f32 {
    let way = way_of(own);
    let there = corners_around(origin_of(here, -way, offset, bits));
    let gone = once[place * 2u + axis];
    let returned = mean_of(once_at(there.place, axis), weights_of(there, known), gone);
    let corners = corners_around(origin_of(here, way, offset, bits));
    let bounds = bounds_of(source_at(corners.place, axis), known_of(corners, known));
    let corrected = clamp(gone + 0.5 * (source[place * 2u + axis] - returned), bounds.x, bounds.y);
    return select(gone, corrected, bounds.x <= bounds.y);
}

// 1 for those corners that mean something.
fn known_of(corners: Corners, known: u32) -> vec4<f32> {
#ifdef DEEP
    return vec4(1.0);
#else
    let low = corners.place;
    let high = low + flow.stride;
    return vec4(has(mask[low], known), has(mask[low + 1u], known), has(mask[high], known), has(mask[high + 1u], known));
#endif
}

fn first_tile() -> u32 {
#ifdef DEEP
    return 0u;
#else
    return flow.deep_tiles;
#endif
}

// Velocities at the left and the lower side of a cell, each in full.
struct Sides {
    left: vec2<f32>,
    below: vec2<f32>,
}

// What is handed from row to row.
struct Edge {
    // Through left sides of the row below, at the cell and on its right.
    u: vec2<f32>,
    // Through lower sides of this row, on the left of the cell and at the cell.
    v: vec2<f32>,
}

fn edge_at(place: u32) -> Edge {
    let below = (place - flow.stride) * 2u;
    return Edge(vec2(velocity[below], velocity[below + 2u]), vec2(velocity[place * 2u - 1u], velocity[place * 2u + 1u]));
}

fn sides_at(place: u32, edge: ptr<function, Edge>) -> Sides {
    let above = (place + flow.stride) * 2u;
    let u = vec2(velocity[place * 2u], velocity[place * 2u + 2u]);
    let v = vec2(velocity[above - 1u], velocity[above + 1u]);
    let left = vec2(u.x, 0.25 * (((*edge).v.x + (*edge).v.y) + (v.x + v.y)));
    let below = vec2(0.25 * (((*edge).u.x + (*edge).u.y) + (u.x + u.y)), (*edge).v.y);
    (*edge).u = u;
    (*edge).v = v;
    return Sides(left, below);
}

@compute @workgroup_size(32, 4)
fn carry_velocity(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = tile_cell(first_tile() + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    var edge = edge_at(place);
    for (var row = 0u; row < ROWS; row += 1u) {
        let sides = sides_at(place, &edge);
        let here = vec2<f32>(cell);
        let bits = bits_at(place);
        let u = carry_side(here, place, 0u, sides.left, vec2(-0.5, 0.0), bits, KNOWN_X);
        let v = carry_side(here, place, 1u, sides.below, vec2(0.0, -0.5), bits, KNOWN_Y);
        carried[place * 2u] = select(0.0, u, (bits & OPEN_X) != 0u);
        carried[place * 2u + 1u] = select(0.0, v, (bits & OPEN_Y) != 0u);
        place += flow.stride;
        cell.y += 1u;
    }
}

@compute @workgroup_size(32, 4)
fn correct_velocity(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = tile_cell(first_tile() + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    var edge = edge_at(place);
    for (var row = 0u; row < ROWS; row += 1u) {
        let sides = sides_at(place, &edge);
        let here = vec2<f32>(cell);
        let bits = bits_at(place);
        let u = correct_side(here, place, 0u, sides.left, vec2(-0.5, 0.0), bits, KNOWN_X);
        let v = correct_side(here, place, 1u, sides.below, vec2(0.0, -0.5), bits, KNOWN_Y);
        carried[place * 2u] = select(0.0, u, (bits & OPEN_X) != 0u);
        carried[place * 2u + 1u] = select(0.0, v, (bits & OPEN_Y) != 0u);
        place += flow.stride;
        cell.y += 1u;
    }
}

// In the middle of a cell; `v_own` is the velocity through its lower side, and becomes that through its upper one.
fn middle_velocity(place: u32, v_own: ptr<function, f32>) -> vec2<f32> {
    let v_above = velocity[(place + flow.stride) * 2u + 1u];
    let middle = vec2(0.5 * (velocity[place * 2u] + velocity[place * 2u + 2u]), 0.5 * (*v_own + v_above));
    *v_own = v_above;
    return middle;
}

fn slot_of(group: u32, local: vec2<u32>) -> u32 {
    return (first_tile() + group) * 128u + local.y * 32u + local.x;
}

@compute @workgroup_size(32, 4)
fn carry_dissolved(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = tile_cell(first_tile() + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    var v_own = velocity[place * 2u + 1u];
    var sum = vec4(0.0);
    let factor = scale;
    for (var row = 0u; row < ROWS; row += 1u) {
        let bits = bits_at(place);
        let way = way_of(middle_velocity(place, &v_own));
        let corners = corners_around(origin_of(vec2<f32>(cell), way, vec2(0.0), bits));
        let weights = weights_of(corners, WET);
        let own = vec2(source[place * 2u], source[place * 2u + 1u]);
        let blood = mean_of(source_at(corners.place, 0u), weights, own.x);
        let dust = mean_of(source_at(corners.place, 1u), weights, own.y);
        let next = select(vec2(0.0), vec2(blood, dust) * factor, (bits & WET) != 0u);
        carried[place * 2u] = next.x;
        carried[place * 2u + 1u] = next.y;
        sum += vec4(own * factor, next);
        place += flow.stride;
        cell.y += 1u;
    }
    amounts[slot_of(group.x, local.xy)] = sum;
}

// After `carry_dissolved`, which made `once` and brought the scale to it.
@compute @workgroup_size(32, 4)
fn correct_dissolved(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = tile_cell(first_tile() + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    var v_own = velocity[place * 2u + 1u];
    var sum = vec4(0.0);
    let factor = scale;
    for (var row = 0u; row < ROWS; row += 1u) {
        let bits = bits_at(place);
        let here = vec2<f32>(cell);
        let way = way_of(middle_velocity(place, &v_own));
        let there = corners_around(origin_of(here, -way, vec2(0.0), bits));
        let back = weights_of(there, WET);
        let gone = vec2(once[place * 2u], once[place * 2u + 1u]);
        let blood_back = mean_of(once_at(there.place, 0u), back, gone.x);
        let dust_back = mean_of(once_at(there.place, 1u), back, gone.y);
        let corners = corners_around(origin_of(here, way, vec2(0.0), bits));
        let known = known_of(corners, WET);
        let blood = bounds_of(source_at(corners.place, 0u) * factor.x, known);
        let dust = bounds_of(source_at(corners.place, 1u) * factor.y, known);
        let own = vec2(source[place * 2u], source[place * 2u + 1u]) * factor;
        let corrected = gone + 0.5 * (own - vec2(blood_back, dust_back));
        let low = vec2(blood.x, dust.x);
        let high = vec2(blood.y, dust.y);
        let within = select(gone, clamp(corrected, low, high), low <= high);
        let next = select(vec2(0.0), within, (bits & WET) != 0u);
        carried[place * 2u] = next.x;
        carried[place * 2u + 1u] = next.y;
        sum += vec4(own, next);
        place += flow.stride;
        cell.y += 1u;
    }
    amounts[slot_of(group.x, local.xy)] = sum;
}
