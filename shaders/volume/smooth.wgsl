// One pass of smoothing of normals: the 3x3 neighbours count the less the farther their depth is from the pixel's own
// (paper of 2009, section 5.4). CPU twin: `volume/software/smooth.rs`.

#import bevy_surgery::volume::{NOTHING, covering_triangle, volume}

@group(2) @binding(0) var relief: texture_2d<f32>;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = vec2<i32>(at.xy);
    let last = vec2<i32>(textureDimensions(relief)) - 1;
    let own = textureLoad(relief, texel, 0);
    let steepness = 1.0 / volume.edge_voxels;
    var sum = vec3(0.0);
    // Pixels that show nothing leave after one neighbour.
    var k = select(0, 8, own.w == NOTHING);
    loop {
        let neighbour = clamp(texel + vec2(k % 3, k / 3) - 1, vec2(0), last);
        let other = textureLoad(relief, neighbour, 0);
        sum += max(0.0, 1.0 - abs(other.w - own.w) * steepness) * other.xyz;
        k++;
        continuing {
            break if k > 8;
        }
    }
    let squared = dot(sum, sum);
    return vec4(select(own.xyz, sum * inverseSqrt(squared), squared > 1e-12), own.w);
}
