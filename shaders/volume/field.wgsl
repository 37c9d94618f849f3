// What a volume is made of at a place, shared by the passes that walk through it. Space: voxel. Rust twins:
// `volume/render/texels.rs`, `volume/software`.
#define_import_path bevy_surgery::volume_field

#import bevy_surgery::volume::{volume, depth_m_of}

// Value as a share of the range, and what drilling left of the opacity.
@group(1) @binding(1) var field: texture_3d<f32>;
// Gradient of their product, divided by the square root of its length. Signed: software drivers interpolate unsigned
// numbers of 8 bits faster, but to 8 bits only, which shows in reflections.
@group(1) @binding(2) var gradients: texture_3d<f32>;
@group(1) @binding(3) var linear_sampler: sampler;
// Linear colour and opacity of a step, by value.
@group(1) @binding(4) var table: texture_2d<f32>;
#ifdef OWN_COLOURS
@group(1) @binding(5) var colours: texture_3d<f32>;
#endif
#ifdef MULTISAMPLED
@group(2) @binding(0) var scene: texture_depth_multisampled_2d;
#else
@group(2) @binding(0) var scene: texture_depth_2d;
#endif

const ENTRIES: f32 = 1023.0;

struct Sample {
    colour: vec3<f32>,
    opacity: f32,
}

// Texture coordinates of a place.
fn place_of(voxel: vec3<f32>) -> vec3<f32> {
    return (voxel + 0.5) / volume.size;
}

fn sample_at(place: vec3<f32>) -> Sample {
    let value = textureSampleLevel(field, linear_sampler, place, 0.0).rg;
    let looked_up = textureLoad(table, vec2(i32(value.x * ENTRIES + 0.5), 0), 0);
#ifdef OWN_COLOURS
    let colour = textureSampleLevel(colours, linear_sampler, place, 0.0).rgb;
#else
    let colour = looked_up.rgb;
#endif
    return Sample(colour, looked_up.a * value.y);
}

fn gradient_at(place: vec3<f32>) -> vec3<f32> {
    return textureSampleLevel(gradients, linear_sampler, place, 0.0).rgb;
}

// Depth of the opaque scene behind a pixel of the viewport, metres. Of several samples the farthest counts: the others
// reject what lies behind them when the volume is put into the picture.
fn scene_depth_m(pixel: vec2<f32>) -> f32 {
    let texel = vec2<i32>(pixel + volume.viewport.xy);
#ifdef MULTISAMPLED
    var farthest = textureLoad(scene, texel, 0);
    for (var k = 1; k < i32(textureNumSamples(scene)); k++) {
        farthest = min(farthest, textureLoad(scene, texel, k));
    }
#else
    let farthest = textureLoad(scene, texel, 0);
#endif
    return select(depth_m_of(farthest), 3e38, farthest <= 0.0);
}
