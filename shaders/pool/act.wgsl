// Sources act on the fluid: jets, burrs, suction, blood and dust. Rust twins: `pool/solver/act.rs`, `pool/source.rs`.
// Each kernel has a range of the sources and a list of the tiles that these reach.
#import bevy_surgery::pool_flow::{flow, place_of, pool_from_cell, mask, WET, OPEN_X, OPEN_Y, ROWS}

struct FlowSource {
    // In the pool's plane.
    place_m: vec2<f32>,
    push_m_s: vec2<f32>,
    // Added to places before the noise is looked up.
    stir_offset_m: vec2<f32>,
    // Blood and dust where its weight is 1, as shares of a cell.
    share: vec2<f32>,
    radius_m: f32,
    stir_m_s: f32,
    flow_m2_s: f32,
    clear: f32,
}

@group(1) @binding(0) var<storage, read> sources: array<FlowSource>;
@group(1) @binding(1) var<storage, read> noise: array<vec2<f32>>;
@group(1) @binding(2) var<storage, read_write> velocity: array<vec2<f32>>;
@group(1) @binding(3) var<storage, read_write> dissolved: array<vec2<f32>>;
// What the last step left to do to what is dissolved.
@group(1) @binding(4) var<storage, read> scale: vec2<f32>;

// Like `tiles`, of all steps of a frame.
@group(1) @binding(5) var<storage, read> reached: array<u32>;

const SOURCE_REACH: f32 = 3.0;
const FLOW_REACH: f32 = 16.0;
const TAU: f32 = 6.283185307179586;

// A whole number within 0 and the noise's side, which repeats. Division may be off by a little.
fn wrapped(cell: vec2<f32>) -> vec2<u32> {
    let side = f32(flow.noise_side);
    var within = cell - side * floor(cell / side);
    within += select(vec2(0.0), vec2(side), within < vec2(0.0));
    within -= select(vec2(0.0), vec2(side), within >= vec2(side));
    return vec2<u32>(within);
}

fn noise_at(place_m: vec2<f32>) -> vec2<f32> {
    let at = place_m / flow.noise_period_m * f32(flow.noise_side);
    let first = floor(at);
    let share = at - first;
    let low = wrapped(first);
    let high = select(low + 1u, vec2(0u), low + 1u == vec2(flow.noise_side));
    let row = low.y * flow.noise_side;
    let next_row = high.y * flow.noise_side;
    return mix(
        mix(noise[row + low.x], noise[row + high.x], share.x),
        mix(noise[next_row + low.x], noise[next_row + high.x], share.x),
        share.y,
    );
}

// 1 in the middle, 0 beyond the reach.
fn weight_at(source: FlowSource, offset_m: vec2<f32>) -> f32 {
    let square = dot(offset_m, offset_m) / (source.radius_m * source.radius_m);
    return select(exp(-0.5 * square), 0.0, square > SOURCE_REACH * SOURCE_REACH);
}

fn push_at(source: FlowSource, place_m: vec2<f32>) -> vec2<f32> {
    let stir = source.stir_m_s * noise_at(place_m + source.stir_offset_m);
    return weight_at(source, place_m - source.place_m) * (source.push_m_s + stir);
}

fn flow_at(source: FlowSource, offset_m: vec2<f32>) -> vec2<f32> {
    let square = dot(offset_m, offset_m) / (source.radius_m * source.radius_m);
    let fade = max(1.0 - square / (FLOW_REACH * FLOW_REACH), 0.0);
    // (1 - exp(-s/2)) / s, which is 1/2 in the middle.
    let core = select((1.0 - exp(-0.5 * square)) / max(square, 1e-3), 0.5 - square / 8.0, square < 1e-3);
    let per_m = source.flow_m2_s / (TAU * source.radius_m * source.radius_m);
    return offset_m * (per_m * core * fade);
}

// First cell of a tile of a list.
fn reached_cell(tile: u32) -> vec2<u32> {
    let corner = reached[tile];
    return vec2(corner & 0xffffu, corner >> 16u);
}

fn add_velocity(place: u32, bits: u32, by: vec2<f32>) {
    velocity[place] += select(vec2(0.0), by, vec2((bits & OPEN_X) != 0u, (bits & OPEN_Y) != 0u));
}

// Before the pressure: jets and burrs.
@compute @workgroup_size(32, 4)
fn push(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = reached_cell(flow.push_tile + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    let half_m = 0.5 * flow.cell_m;
    for (var row = 0u; row < ROWS; row += 1u) {
        let middle_m = pool_from_cell(vec2<f32>(cell));
        var by = vec2(0.0);
        for (var k = 0u; k < flow.pushing; k += 1u) {
            let source = sources[flow.first_pushing + k];
            by.x += push_at(source, middle_m - vec2(half_m, 0.0)).x;
            by.y += push_at(source, middle_m - vec2(0.0, half_m)).y;
        }
        add_velocity(place, mask[place], by);
        place += flow.stride;
        cell.y += 1u;
    }
}

// After the pressure: what flows in and out, which a pressure without sources would take away; and what is dissolved. The
// scale stays to be done, so that tiles beyond reach need not be touched.
@compute @workgroup_size(32, 4)
fn act(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = reached_cell(flow.act_tile + group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    let half_m = 0.5 * flow.cell_m;
    for (var row = 0u; row < ROWS; row += 1u) {
        let middle_m = pool_from_cell(vec2<f32>(cell));
        var by = vec2(0.0);
        var shares = dissolved[place] * scale;
        for (var k = 0u; k < flow.acting; k += 1u) {
            let source = sources[flow.first_acting + k];
            let offset_m = middle_m - source.place_m;
            by.x += flow_at(source, offset_m - vec2(half_m, 0.0)).x;
            by.y += flow_at(source, offset_m - vec2(0.0, half_m)).y;
            let weight = weight_at(source, offset_m);
            let left = shares * (1.0 - clamp(source.clear * weight, 0.0, 1.0));
            let after = clamp(left + source.share * weight, vec2(0.0), vec2(1.0));
            // Others leave everything as it is, even what numerics brought beyond 1.
            let dissolves = source.clear > 0.0 || any(source.share != vec2(0.0));
            shares = select(shares, after, dissolves && weight > 0.0);
        }
        let bits = mask[place];
        add_velocity(place, bits, by);
        dissolved[place] = select(vec2(0.0), shares / scale, (bits & WET) != 0u);
        place += flow.stride;
        cell.y += 1u;
    }
}
