// Puts a shaded volume into the picture. Space: pixels of the viewport.

#import bevy_surgery::organ::exposed_to_target
#import bevy_surgery::volume::{SOLID, clip_z_of, covering_triangle, volume}

@group(2) @binding(0) var lit: texture_2d<f32>;
@group(2) @binding(1) var depths_m: texture_2d<f32>;

struct Seen {
    @location(0) colour: vec4<f32>,
    @builtin(frag_depth) clip_z: f32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> Seen {
    let texel = vec2<i32>(at.xy - volume.viewport.xy);
    let colour = textureLoad(lit, texel, 0);
    // What is solid hides later passes; mist does not.
#ifdef SOLID_PART
    if colour.a < SOLID {
        discard;
    }
#else
    if colour.a >= SOLID || colour.a <= 0.0 {
        discard;
    }
#endif
    let opacity = max(colour.a, 1e-6);
    let shown = exposed_to_target(vec4(colour.rgb / opacity, opacity));
    return Seen(vec4(shown.rgb * opacity, opacity), clip_z_of(textureLoad(depths_m, texel, 0).r));
}
