// Pressure: what makes the flow free of divergence. Rust twin: `pool/solver/project.rs`. An invocation does 4 x 4 cells.
#import bevy_surgery::pool_flow::{flow, tile_cell, place_of}

// Open sides of four cells in a row: bits 0 to 3 left, 4 to 7 right, 8 to 11 below, 12 to 15 above. By place / 4.
@group(1) @binding(0) var<storage, read> sides: array<u32>;
// Four cells of a row each.
@group(1) @binding(1) var<storage, read> pressure: array<vec4<f32>>;
@group(1) @binding(2) var<storage, read_write> next: array<vec4<f32>>;
// Two cells of a row each.
@group(1) @binding(3) var<storage, read> velocity: array<vec4<f32>>;
@group(1) @binding(3) var<storage, read_write> velocity_out: array<vec4<f32>>;
@group(1) @binding(4) var<storage, read> divergence: array<vec4<f32>>;
@group(1) @binding(4) var<storage, read_write> divergence_out: array<vec4<f32>>;
// The round before `pressure`.
@group(1) @binding(5) var<storage, read> before: array<vec4<f32>>;

fn open(bits: u32, shift: u32) -> vec4<f32> {
    return vec4<f32>((vec4(bits >> shift) >> vec4(0u, 1u, 2u, 3u)) & vec4(1u));
}

// The first four cells of an invocation, as a place / 4.
fn first_four(tile: u32, local: vec2<u32>) -> u32 {
    return place_of(tile_cell(tile) + local * 4u) / 4u;
}

// A round of Jacobi's iteration for four cells.
fn relax(four: u32, below: vec4<f32>, own: vec4<f32>, above: vec4<f32>, divergence: vec4<f32>) -> vec4<f32> {
    let bits = sides[four];
    let left = vec4(pressure[four - 1u].w, own.xyz);
    let right = vec4(own.yzw, pressure[four + 1u].x);
    let open_left = open(bits, 0u);
    let open_right = open(bits, 4u);
    let open_below = open(bits, 8u);
    let open_above = open(bits, 12u);
    let count = (open_left + open_right) + (open_below + open_above);
    let sum = (open_left * left + open_right * right) + (open_below * below + open_above * above);
    // A cell without neighbours has no divergence either.
    return (sum - divergence) / max(count, vec4(1.0));
}

// Divergence, and the first round.
@compute @workgroup_size(8, 8)
fn first_round(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let step = flow.stride / 4u;
    var four = first_four(group.x, local.xy);
    var below = pressure[four - step];
    var own = pressure[four];
    var low = velocity[four * 2u];
    var high = velocity[four * 2u + 1u];
    for (var row = 0u; row < 4u; row += 1u) {
        let above = pressure[four + step];
        let low_above = velocity[(four + step) * 2u];
        let high_above = velocity[(four + step) * 2u + 1u];
        let u = vec4(low.xz, high.xz);
        let v = vec4(low.yw, high.yw);
        let right = vec4(u.yzw, velocity[four * 2u + 2u].x);
        let div = right - u + vec4(low_above.yw, high_above.yw) - v;
        divergence_out[four] = div;
        next[four] = relax(four, below, own, above, div);
        below = own;
        own = above;
        low = low_above;
        high = high_above;
        four += step;
    }
}

@compute @workgroup_size(8, 8)
fn round(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let step = flow.stride / 4u;
    var four = first_four(group.x, local.xy);
    var below = pressure[four - step];
    var own = pressure[four];
    for (var row = 0u; row < 4u; row += 1u) {
        let above = pressure[four + step];
        next[four] = relax(four, below, own, above, divergence[four]);
        below = own;
        own = above;
        four += step;
    }
}

// Takes the differences of a pressure, on the left and below, off two cells each.
fn slower(velocities: vec4<f32>, u: vec2<f32>, v: vec2<f32>) -> vec4<f32> {
    return velocities - vec4(u.x, v.x, u.y, v.y);
}

// Takes the differences of the last two rounds' mean off the velocity; the mean is kept as the next step's first guess.
@compute @workgroup_size(8, 8)
fn subtract(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let step = flow.stride / 4u;
    var four = first_four(group.x, local.xy);
    var below = 0.5 * (pressure[four - step] + before[four - step]);
    for (var row = 0u; row < 4u; row += 1u) {
        let own = 0.5 * (pressure[four] + before[four]);
        let left = vec4(0.5 * (pressure[four - 1u].w + before[four - 1u].w), own.xyz);
        let bits = sides[four];
        let u = open(bits, 0u) * (own - left);
        let v = open(bits, 8u) * (own - below);
        next[four] = own;
        velocity_out[four * 2u] = slower(velocity_out[four * 2u], u.xy, v.xy);
        velocity_out[four * 2u + 1u] = slower(velocity_out[four * 2u + 1u], u.zw, v.zw);
        below = own;
        four += step;
    }
}

@group(1) @binding(5) var<storage, read_write> reflected: array<vec4<f32>>;

// The velocity reflected at the last step's pressure.
@compute @workgroup_size(8, 8)
fn reflect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let step = flow.stride / 4u;
    var four = first_four(group.x, local.xy);
    var below = pressure[four - step];
    for (var row = 0u; row < 4u; row += 1u) {
        let own = pressure[four];
        let left = vec4(pressure[four - 1u].w, own.xyz);
        let bits = sides[four];
        let u = open(bits, 0u) * (own - left);
        let v = open(bits, 8u) * (own - below);
        reflected[four * 2u] = slower(velocity[four * 2u], u.xy, v.xy);
        reflected[four * 2u + 1u] = slower(velocity[four * 2u + 1u], u.zw, v.zw);
        below = own;
        four += step;
    }
}
