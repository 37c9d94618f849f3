// Layer 2: blood, burns and pale skin, from the reaction map. The map is premultiplied in the sRGB encoding, as it was
// painted; what it shows is lit like the skin below. Spaces: chart, world. Rust twin: `reactions/paint`.

#import bevy_surgery::lights::incident
#import bevy_surgery::organ::{CornerVertex, map_uv, organ, secondary_vertex, to_target, view}

@group(2) @binding(0) var reaction_map: texture_2d<f32>;
@group(2) @binding(1) var reaction_sampler: sampler;

const PI: f32 = 3.141592653589793;
// How far light creeps round into the shade, as in the skin's flesh.
const WRAP: f32 = 0.15;

struct Varying {
    @invariant @builtin(position) clip: vec4<f32>,
    @location(0) position_world_m: vec3<f32>,
    @location(1) normal_world: vec3<f32>,
    @location(2) chart_direction: vec3<f32>,
}

@vertex
fn vertex(corner: CornerVertex) -> Varying {
    let at = secondary_vertex(corner);
    var out: Varying;
    out.clip = view.clip_from_world * vec4(at.position_world_m, 1.0);
    out.position_world_m = at.position_world_m;
    out.normal_world = at.normal_world;
    out.chart_direction = corner.chart_direction;
    return out;
}

fn linear_from_srgb(encoded: vec3<f32>) -> vec3<f32> {
    let low = encoded / 12.92;
    let high = pow((encoded + 0.055) / 1.055, vec3(2.4));
    return select(high, low, encoded <= vec3(0.04045));
}

@fragment
fn fragment(in: Varying, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    let texel = textureSampleLevel(reaction_map, reaction_sampler, map_uv(in.chart_direction), 0.0);
    // Most of an organ shows nothing: no light is computed there.
    if texel.a < 0.002 {
        return vec4(0.0);
    }
    let albedo = linear_from_srgb(min(texel.rgb / texel.a, vec3(1.0)));
    let is_outside = is_front == (organ.handedness > 0.0);
    let normal = normalize(select(-in.normal_world, in.normal_world, is_outside));
    var diffuse = organ.lights.ambient * PI;
    // Software drivers run the body of a `for` once more than it turns. Unused lights are dark.
    var k = 0u;
    loop {
        let light = organ.lights.lights[k];
        let beam = incident(light, in.position_world_m);
        let cosine = max(dot(normal, beam.to_light) + WRAP, 0.0) / ((1.0 + WRAP) * (1.0 + WRAP));
        diffuse += beam.illuminance_lux * (cosine + light.ambient_fraction);
        k++;
        continuing {
            break if k >= organ.lights.count;
        }
    }
    return to_target(albedo * diffuse / PI, texel.a);
}
