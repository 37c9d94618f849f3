// The lights of an organ. Spaces: everything in the world, metres; photometric units as in Bevy (lux, candela).
// Rust twin: `render/lights.rs`.
#define_import_path bevy_surgery::lights

const DIRECTIONAL: u32 = 0u;
const POINT: u32 = 1u;
const SPOT: u32 = 2u;
const RING: u32 = 3u;

struct LightUniform {
    colour: vec3<f32>,
    kind: u32,
    position_world_m: vec3<f32>,
    inverse_range_squared: f32,
    direction_world: vec3<f32>,
    ring_radius_m: f32,
    cone_scale: f32,
    cone_offset: f32,
    ambient_fraction: f32,
}

struct OrganLights {
    lights: array<LightUniform, 10>,
    ambient: vec3<f32>,
    count: u32,
}

// What one light sends to a point.
struct Incident {
    // Unit vector from the point to the light.
    to_light: vec3<f32>,
    // Illuminance in lux of a surface that faces the light.
    illuminance_lux: vec3<f32>,
}

fn incident(light: LightUniform, point_world_m: vec3<f32>) -> Incident {
    if light.kind == DIRECTIONAL {
        return Incident(-light.direction_world, light.colour);
    }
    let path = light.position_world_m - point_world_m;
    let length_squared = dot(path, path);
    let to_light = path * inverseSqrt(max(length_squared, 1e-12));
    // A ring of radius r on the axis: every point of it is sqrt(d^2 + r^2) away.
    let distance_squared = length_squared + light.ring_radius_m * light.ring_radius_m;
    let range = distance_squared * light.inverse_range_squared;
    let window = saturate(1.0 - range * range);
    var attenuation = window * window / max(distance_squared, 1e-8);
    if light.kind != POINT {
        let cone = saturate(dot(-light.direction_world, to_light) * light.cone_scale + light.cone_offset);
        attenuation *= cone * cone;
    }
    return Incident(to_light, light.colour * attenuation);
}
