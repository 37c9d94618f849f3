// Layer 1: the organ's skin. Triangular tiles of cell noise, Lambert shading under the organ's lights, a soft sheen.
// Spaces: tile (barycentric), world. Colours are linear; the result is scene-referred radiance times the view's
// exposure, as Bevy's own materials write it. Rust twin: `skin/render/prepare.rs`.

#import bevy_surgery::lights::incident
#import bevy_surgery::organ::{CornerVertex, organ, raised, secondary_vertex, to_eye, to_target, view}

struct SkinUniform {
    tint: vec3<f32>,
    mottle: f32,
    mottle_frequency_per_m: f32,
    scatter: f32,
    sheen: f32,
    sheen_exponent: f32,
    relief_m: f32,
}

@group(2) @binding(0) var<uniform> skin: SkinUniform;
@group(2) @binding(1) var<storage, read> tile_choices: array<u32>;
@group(2) @binding(2) var tiles: texture_2d_array<f32>;
@group(2) @binding(3) var tiles_sampler: sampler;

const PI: f32 = 3.141592653589793;
// How soon relief fades with the square of a pixel's size in texels, and how much rougher the sheen is then.
const FADE: f32 = 0.012;
const ROUGHEN: f32 = 0.0015;

struct Varying {
    @invariant @builtin(position) clip: vec4<f32>,
    @location(0) position_world_m: vec3<f32>,
    @location(1) normal_world: vec3<f32>,
    @location(2) tile_uv: vec2<f32>,
    @location(3) @interpolate(flat) tile: u32,
    // Soft patches: brightness and hue, both around 1.
    @location(4) mottle: vec2<f32>,
}

fn hash(cell: vec3<i32>) -> f32 {
    var h = bitcast<u32>(cell.x) * 0x8da6b343u ^ bitcast<u32>(cell.y) * 0xd8163841u ^ bitcast<u32>(cell.z) * 0xcb1ab31fu;
    h = (h ^ (h >> 15u)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12u)) * 0x297a2d39u;
    return f32(h >> 8u) / 16777216.0;
}

// Smooth value noise in [-1, 1].
fn patches(at: vec3<f32>) -> f32 {
    let cell = vec3<i32>(floor(at));
    let t = smoothstep(vec3(0.0), vec3(1.0), fract(at));
    var sum = 0.0;
    for (var k = 0; k < 8; k++) {
        let corner = vec3(k & 1, (k >> 1u) & 1, k >> 2u);
        let w = select(1.0 - t, t, corner == vec3(1));
        sum += w.x * w.y * w.z * hash(cell + corner);
    }
    return 2.0 * sum - 1.0;
}

// Corners of the tile in texture coordinates. Rust twin: `tiles::tile_uv`.
fn tile_uv(barycentric: vec3<f32>, rotation: u32) -> vec2<f32> {
    var b = barycentric;
    if rotation == 1u {
        b = b.yzx;
    } else if rotation == 2u {
        b = b.zxy;
    }
    // A thirty-second of the texture is padding; corners lie on texel centres.
    return 1.0 / 32.0 + 0.5 / f32(textureDimensions(tiles).x) + 15.0 / 16.0 * b.yz;
}

@vertex
fn vertex(corner: CornerVertex) -> Varying {
    let at = secondary_vertex(corner);
    let choice = tile_choices[corner.texture_triangle];
    let xy = corner.tile_barycentric;
    let place = corner.rest_position_m * skin.mottle_frequency_per_m;
    var out: Varying;
    out.clip = view.clip_from_world * vec4(at.position_world_m, 1.0);
    out.position_world_m = at.position_world_m;
    out.normal_world = at.normal_world;
    out.tile_uv = tile_uv(vec3(xy, 1.0 - xy.x - xy.y), choice % 3u);
    out.tile = choice / 3u;
    out.mottle = 1.0 + skin.mottle * vec2(
        0.65 * patches(place) + 0.35 * patches(2.7 * place + 17.0),
        0.5 * patches(0.8 * place - 31.0),
    );
    return out;
}

@fragment
fn fragment(in: Varying, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let texel = textureSample(tiles, tiles_sampler, in.tile_uv, in.tile).rgb;
    let hue = vec3(in.mottle.y, 1.0, 2.0 - in.mottle.y);
    let albedo = texel * skin.tint * in.mottle.x * mix(vec3(1.0), hue, 0.5);
    let eye = to_eye(in.position_world_m);
    // Seen from behind (an open surface, a hollow organ): shade the side that is seen.
    let is_outside = is_front == (organ.handedness > 0.0);
    let normal = normalize(select(-in.normal_world, in.normal_world, is_outside));
    // Pale septa lie deeper than the lobules between them; the moist surface shows it by its reflections only. Where
    // a pixel covers several texels, their relief is too fine to be seen and makes the surface rougher instead.
    let texels = fwidth(in.tile_uv) * f32(textureDimensions(tiles).x);
    let seen = 1.0 / (1.0 + FADE * dot(texels, texels));
    let glossy = raised(normal, in.position_world_m, -seen * skin.relief_m * dot(texel, vec3(0.6, 0.3, 0.1)));
    let exponent = skin.sheen_exponent / (1.0 + ROUGHEN * (1.0 - seen) * skin.sheen_exponent);
    // The shade's edge turns red: long paths through flesh absorb the other colours.
    let wrap = skin.scatter * vec3(1.0, 0.45, 0.35);
    var diffuse = organ.lights.ambient * PI;
    var sheen = vec3(0.0);
    // Software drivers run the body of a `for` once more than it turns. Unused lights are dark.
    var k = 0u;
    loop {
        let light = organ.lights.lights[k];
        let beam = incident(light, in.position_world_m);
        let cosine = dot(normal, beam.to_light);
        diffuse += beam.illuminance_lux * (max(vec3(cosine) + wrap, vec3(0.0)) / ((1.0 + wrap) * (1.0 + wrap)) + light.ambient_fraction);
        let halfway = normalize(beam.to_light + eye);
        let lobe = pow(max(dot(glossy, halfway), 0.0), exponent) * (exponent + 2.0) * 0.125;
        let facing = 1.0 - max(dot(eye, halfway), 0.0);
        let fresnel = 0.028 + 0.972 * facing * facing * facing * facing * facing;
        sheen += beam.illuminance_lux * max(cosine, 0.0) * lobe * fresnel;
        k++;
        continuing {
            break if k >= organ.lights.count;
        }
    }
    let radiance = (albedo * diffuse + skin.sheen * sheen) / PI;
    return to_target(radiance, 1.0);
}
