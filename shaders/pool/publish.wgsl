// What others see of the flow: a texture for the picture, and amounts for the readings.
#import bevy_surgery::pool_flow::{flow, tile_cell, place_of, mask, has, WET, ROWS}

// Two numbers per place each.
@group(1) @binding(0) var<storage, read> velocity: array<f32>;
@group(1) @binding(1) var<storage, read> dissolved: array<vec2<f32>>;
@group(1) @binding(2) var<storage, read> pressure: array<f32>;
// What the last step left to do to what is dissolved.
@group(1) @binding(3) var<storage, read> scale: vec2<f32>;
// Blood, dust, cells that are hidden, greatest velocity; per invocation.
@group(1) @binding(4) var<storage, read_write> amounts: array<vec4<f32>>;
// Height of the surface in millimetres, shares of blood and dust, 1 where there is fluid.
@group(1) @binding(5) var surface: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(32, 4)
fn publish(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = tile_cell(group.x) + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    var sums = vec4(0.0);
    for (var row = 0u; row < ROWS; row += 1u) {
        let wet = has(mask[place], WET);
        let shares = dissolved[place] * scale;
        let right = velocity[place * 2u + 2u];
        let above = velocity[(place + flow.stride) * 2u + 1u];
        let middle = 0.5 * vec2(velocity[place * 2u] + right, velocity[place * 2u + 1u] + above);
        let hidden = select(0.0, wet, shares.x + flow.dust_hides * shares.y >= flow.hidden_from);
        sums = vec4(sums.xyz + vec3(shares, hidden), max(sums.w, length(middle)));
        // Tiles reach beyond the grid.
        if all(cell < flow.size) {
            textureStore(surface, cell, vec4(pressure[place] * flow.mm_per_pressure, shares, wet));
        }
        place += flow.stride;
        cell.y += 1u;
    }
    amounts[group.x * 128u + local.y * 32u + local.x] = sums;
}
