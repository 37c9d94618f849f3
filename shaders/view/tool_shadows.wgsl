// Shadows of tools on what was drawn since Bevy's opaque pass. Spaces: clip space of the view and of the lamp, texels of
// the shadow map. Writes the share of light that is left into alpha; blending multiplies the picture by it.
// Rust twin: `ShadowLens::occlusion` in `view/tool_shadows/lens.rs`.

struct ToolShadowUniform {
    lamp_from_clip: mat4x4<f32>,
    // Texels beyond which no look-up can find a caster: least x, y, greatest x, y.
    reach_px: vec4<f32>,
    // Radius of the look-ups at the lamp's near distance, and its bounds, texels.
    radius_at_near_px: f32,
    least_radius_px: f32,
    greatest_radius_px: f32,
    strength: f32,
    resolution_px: f32,
}

@group(0) @binding(0) var<uniform> shadow: ToolShadowUniform;
@group(0) @binding(1) var map: texture_depth_2d;
#ifdef MULTISAMPLED
@group(0) @binding(2) var scene: texture_depth_multisampled_2d;
@group(0) @binding(3) var kept: texture_depth_multisampled_2d;
#else
@group(0) @binding(2) var scene: texture_depth_2d;
@group(0) @binding(3) var kept: texture_depth_2d;
#endif

const TAPS: u32 = 12u;
const TAU: f32 = 6.283185307179586;
// Cosine and sine of the golden angle, by which look-ups turn.
const GOLDEN: vec2<f32> = vec2(-0.7373688780783197, 0.6754902942615238);

struct Varying {
    @builtin(position) position: vec4<f32>,
    // The pixel's place at depth 0 in the lamp's clip space: the rest of the way is along one column.
    @location(0) lamp_at_zero: vec4<f32>,
}

struct Shade {
    @location(0) colour: vec4<f32>,
#ifdef MULTISAMPLED
    @builtin(sample_mask) samples: u32,
#endif
}

// One triangle over the whole viewport.
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Varying {
    let ndc = vec2(f32(index >> 1u), f32(index & 1u)) * 4.0 - 1.0;
    let clip = vec4(ndc, 0.0, 1.0);
    return Varying(clip, shadow.lamp_from_clip * clip);
}

// Jimenez 2014: neighbouring pixels get values far apart, so that the eye averages them.
fn interleaved_gradient_noise(pixel: vec2<f32>) -> f32 {
    return fract(52.9829189 * fract(dot(pixel, vec2(0.06711056, 0.00583715))));
}

@fragment
fn fragment(in: Varying) -> Shade {
    let pixel = vec2<i32>(in.position.xy);
#ifdef MULTISAMPLED
    // Samples that tools cover stay as they are; the others share one value.
    var samples = 0u;
    var depth = 0.0;
    let count = textureNumSamples(scene);
    var sample = 0u;
    loop {
        let now = textureLoad(scene, pixel, sample);
        if now != textureLoad(kept, pixel, sample) {
            samples |= 1u << sample;
            depth = max(depth, now);
        }
        continuing {
            sample += 1u;
            break if sample >= count;
        }
    }
    let receives = samples != 0u;
#else
    let depth = textureLoad(scene, pixel, 0);
    let receives = depth != textureLoad(kept, pixel, 0);
#endif
    let lamp = in.lamp_at_zero + shadow.lamp_from_clip[2] * depth;
    let place = lamp.xyz / lamp.w;
    let texel = (place.xy * vec2(0.5, -0.5) + 0.5) * shadow.resolution_px;
    let is_reached = receives && lamp.w > 0.0 && all(texel > shadow.reach_px.xy) && all(texel < shadow.reach_px.zw);
    let radius_px = clamp(shadow.radius_at_near_px * place.z, shadow.least_radius_px, shadow.greatest_radius_px);
    let turn = TAU * interleaved_gradient_noise(floor(in.position.xy));
    var direction = vec2(cos(turn), sin(turn));
    var blocked = 0u;
    var tap = 0u;
    // Software Vulkan goes on until the last pixel of a block is done: the others are done at once.
    let end = select(1u, TAPS, is_reached);
    loop {
        // A spiral that fills the disk evenly.
        let offset = direction * (radius_px * sqrt((f32(tap) + 0.5) / f32(TAPS)));
        // The outermost texels are always empty, so that beyond the map nothing is in shadow.
        let looked_up = vec2<i32>(clamp(texel + offset, vec2(0.0), vec2(shadow.resolution_px - 1.0)));
        // Depth is reversed: what is nearer to the lamp is greater.
        blocked += select(0u, 1u, textureLoad(map, looked_up, 0) > place.z);
        direction = vec2(direction.x * GOLDEN.x - direction.y * GOLDEN.y, direction.x * GOLDEN.y + direction.y * GOLDEN.x);
        continuing {
            tap += 1u;
            break if tap >= end;
        }
    }
    // Lit pixels keep their bits.
    if !is_reached || blocked == 0u {
        discard;
    }
    let left = 1.0 - shadow.strength * f32(blocked) / f32(TAPS);
#ifdef MULTISAMPLED
    return Shade(vec4(0.0, 0.0, 0.0, left), samples);
#else
    return Shade(vec4(0.0, 0.0, 0.0, left));
#endif
}
