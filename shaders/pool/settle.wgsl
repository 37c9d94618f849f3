// After a new mask: nothing is left in what became wall. For all tiles of the grid, wet or not.
#import bevy_surgery::pool_flow::{flow, place_of, mask, has, WET, OPEN_X, OPEN_Y, ROWS}

@group(1) @binding(0) var<storage, read_write> velocity: array<vec2<f32>>;
@group(1) @binding(1) var<storage, read_write> dissolved: array<vec2<f32>>;
@group(1) @binding(2) var<storage, read_write> pressure: array<f32>;
// Later only tiles with fluid are written.
@group(1) @binding(3) var surface: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(32, 4)
fn settle(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    var cell = group.xy * 32u + vec2(local.x, local.y * ROWS);
    var place = place_of(cell);
    for (var row = 0u; row < ROWS; row += 1u) {
        let bits = mask[place];
        velocity[place] = select(vec2(0.0), velocity[place], vec2((bits & OPEN_X) != 0u, (bits & OPEN_Y) != 0u));
        dissolved[place] = select(vec2(0.0), dissolved[place], vec2((bits & WET) != 0u));
        pressure[place] = select(0.0, pressure[place], (bits & WET) != 0u);
        if all(cell < flow.size) {
            textureStore(surface, cell, vec4(0.0));
        }
        place += flow.stride;
        cell.y += 1u;
    }
}
