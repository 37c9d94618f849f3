// Viscosity and diffusion: implicit rounds of Jacobi's iteration. Rust twin: `pool/solver/diffuse.rs`.
#import bevy_surgery::pool_flow::{flow, tile_cell, place_of, mask, has, WET, OPEN_X, OPEN_Y, ROWS}

// What is blurred, two numbers per place, and its rounds.
@group(1) @binding(0) var<storage, read> blurred: array<vec2<f32>>;
@group(1) @binding(1) var<storage, read> now: array<vec2<f32>>;
@group(1) @binding(2) var<storage, read_write> next: array<vec2<f32>>;

// Whether the two numbers of a place take part, as factors.
fn there(place: u32, bits: vec2<u32>) -> vec2<f32> {
    let own = mask[place];
    return vec2(has(own, bits.x), has(own, bits.y));
}

fn blur(group: u32, local: vec2<u32>, bits: vec2<u32>, strength: f32) {
    var place = place_of(tile_cell(group) + vec2(local.x, local.y * ROWS));
    for (var row = 0u; row < ROWS; row += 1u) {
        let left = there(place - 1u, bits);
        let right = there(place + 1u, bits);
        let below = there(place - flow.stride, bits);
        let above = there(place + flow.stride, bits);
        let count = left + right + below + above;
        let sum = left * now[place - 1u] + right * now[place + 1u] + below * now[place - flow.stride]
            + above * now[place + flow.stride];
        next[place] = there(place, bits) * (blurred[place] + strength * sum) / (1.0 + strength * count);
        place += flow.stride;
    }
}

@compute @workgroup_size(32, 4)
fn blur_velocity(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    blur(group.x, local.xy, vec2(OPEN_X, OPEN_Y), flow.viscosity);
}

@compute @workgroup_size(32, 4)
fn blur_dissolved(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    blur(group.x, local.xy, vec2(WET, WET), flow.diffusion);
}

// Amounts before and after the step, per invocation.
@group(1) @binding(1) var<storage, read_write> amounts: array<vec4<f32>>;

// The amounts after, anew: few rounds do not keep them.
@compute @workgroup_size(32, 4)
fn count_again(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var place = place_of(tile_cell(group.x) + vec2(local.x, local.y * ROWS));
    var sum = vec2(0.0);
    for (var row = 0u; row < ROWS; row += 1u) {
        sum += blurred[place];
        place += flow.stride;
    }
    let slot = group.x * 128u + local.y * 32u + local.x;
    amounts[slot] = vec4(amounts[slot].xy, sum);
}
