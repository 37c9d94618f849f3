// Sums over the whole pool, always in the same order. With READINGS the last of the four numbers is the greatest instead.
// 16 workgroups of `gather`, then one of `finish`.
#import bevy_surgery::pool_flow::flow

// One per invocation of what made them.
@group(1) @binding(0) var<storage, read> amounts: array<vec4<f32>>;
@group(1) @binding(1) var<storage, read_write> gathered: array<vec4<f32>>;
#ifdef READINGS
// Blood and dust in cells full of it, cells that are hidden, greatest velocity.
@group(1) @binding(2) var<storage, read_write> readings: vec4<f32>;
#else
// Factors that bring what is dissolved to the amounts that are kept.
@group(1) @binding(2) var<storage, read_write> scale: vec2<f32>;
#endif

// What sources do is divided by the scale.
const LEAST_SCALE: f32 = 1e-6;
const INVOCATIONS: u32 = 1024u;

var<workgroup> shared_sums: array<vec4<f32>, 64>;

fn joined(a: vec4<f32>, b: vec4<f32>) -> vec4<f32> {
#ifdef READINGS
    return vec4(a.xyz + b.xyz, max(a.w, b.w));
#else
    return a + b;
#endif
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) invocation: vec3<u32>) {
    var sum = vec4(0.0);
    for (var k = invocation.x; k < flow.tiles * 128u; k += INVOCATIONS) {
        sum = joined(sum, amounts[k]);
    }
    gathered[invocation.x] = sum;
}

@compute @workgroup_size(64)
fn finish(@builtin(local_invocation_index) own: u32) {
    var sum = vec4(0.0);
    for (var k = own; k < INVOCATIONS; k += 64u) {
        sum = joined(sum, gathered[k]);
    }
    shared_sums[own] = sum;
    for (var half = 32u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if own < half {
            shared_sums[own] = joined(shared_sums[own], shared_sums[own + half]);
        }
    }
    if own == 0u {
        let total = shared_sums[0];
#ifdef READINGS
        readings = total;
#else
        // Interpolation does not keep amounts: what is missing or too much is shared out over all that there is.
        let factor = max(total.xy / max(total.zw, vec2(1e-30)) * flow.keep, vec2(LEAST_SCALE));
        scale = select(vec2(1.0), factor, total.zw > vec2(0.0));
#endif
    }
}
