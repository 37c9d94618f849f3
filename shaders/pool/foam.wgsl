// Bubbles that a burr whips up: one at most in each square of a lattice, at random. Space: pool.
#define_import_path bevy_surgery::pool::foam

#import bevy_surgery::pool::pool

// Three random numbers of a square (Jarzynski and Olano 2020, pcg3d).
fn random(cell: vec2<i32>) -> vec3<f32> {
    var v = vec3(bitcast<vec2<u32>>(cell), 7u) * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v = v ^ (v >> vec3(16u));
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return vec3<f32>(v >> vec3(8u)) / 16777216.0;
}

// How much of a place bubbles cover, and how much of that is their bright rim.
fn foam(place_m: vec2<f32>) -> vec2<f32> {
    var amount = 0.0;
    var k = 0u;
    loop {
        let spot = pool.foam[min(k, 15u)];
        let offset_m = place_m - spot.xy;
        let near = saturate(1.0 - dot(offset_m, offset_m) * spot.z);
        amount += spot.w * near * near;
        k++;
        continuing {
            break if k >= pool.foam_count;
        }
    }
    let at = place_m / pool.bubble_m;
    var found = vec2(0.0);
    for (var near = 0; near < 4; near++) {
        // Rows are shifted against one another, so that bubbles do not stand in columns.
        let row = i32(floor(at.y - 0.5)) + (near >> 1u);
        let shift = fract(f32(row) * 0.6180339887);
        let cell = vec2(i32(floor(at.x + shift - 0.5)) + (near & 1), row);
        let chance = random(cell);
        let radius = 0.18 + 0.27 * fract(chance.z * 16.0);
        // Within the square, so that no bubble is cut.
        let middle = vec2<f32>(cell) + mix(vec2(radius), vec2(1.0 - radius), chance.xy);
        let off = length(at + vec2(shift, 0.0) - middle) / radius;
        let inside = (1.0 - smoothstep(0.85, 1.1, off)) * select(0.0, 1.0, chance.z < amount);
        let rim = smoothstep(0.45, 0.9, off);
        found = max(found, vec2(inside, inside * rim));
    }
    return found;
}
