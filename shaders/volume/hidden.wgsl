// The depth that slices are tested against: the scene's in the beginning; then the near plane wherever so much opacity was gathered
// that nothing shines through any more. Space: pixels of the viewport.

#import bevy_surgery::volume::covering_triangle
#ifdef SCENE
#import bevy_surgery::volume::volume
#ifdef MULTISAMPLED
@group(2) @binding(0) var scene: texture_depth_multisampled_2d;
#else
@group(2) @binding(0) var scene: texture_depth_2d;
#endif
#else
@group(2) @binding(0) var colours: texture_2d<f32>;
#endif

const OPAQUE: f32 = 0.98;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    // Reversed depth: the near plane is at 1.
    return vec4(covering_triangle(index).xy, 1.0, 1.0);
}

#ifdef SCENE
@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @builtin(frag_depth) f32 {
    let texel = vec2<i32>(at.xy + volume.viewport.xy);
#ifdef MULTISAMPLED
    // Of several samples the farthest counts, as for rays.
    var farthest = textureLoad(scene, texel, 0);
    for (var k = 1; k < i32(textureNumSamples(scene)); k++) {
        farthest = min(farthest, textureLoad(scene, texel, k));
    }
    return farthest;
#else
    return textureLoad(scene, texel, 0);
#endif
}
#else
@fragment
fn fragment(@builtin(position) at: vec4<f32>) {
    if textureLoad(colours, vec2<i32>(at.xy), 0).a <= OPAQUE {
        discard;
    }
}
#endif
