// What the surface of a pool mirrors where the camera has no environment map: an operating theatre. The room is dim; ring lights
// are rings with a dark middle, where the microscope's objectives are; other lamps are disks. Space: pool.
#define_import_path bevy_surgery::pool::surroundings

#import bevy_surgery::lights::{DIRECTIONAL, POINT, RING}
#import bevy_surgery::pool::{PI, pool}

// Half angle of the disk as which a directional light is seen.
const FAR_LAMP_RAD: f32 = 0.03;
// Radius of a ring's dark middle, and the softness of edges, as shares of its radius.
const DARK_MIDDLE: f32 = 0.55;
const SOFTNESS: f32 = 0.12;

// Radiance from a direction at a place, before exposure. `white` is what a white sheet at that place would send out; between
// neighbouring pixels the direction turns by `footprint`.
fn surroundings(place_m: vec3<f32>, direction: vec3<f32>, footprint: f32, white: vec3<f32>) -> vec3<f32> {
    // Drapes and hands throw some of the light back; more comes from above than from the sides.
    var radiance = white * pool.room * (0.25 + 0.75 * saturate(direction.z));
    var k = 0u;
    loop {
        let light = pool.lights.lights[min(k, 9u)];
        let is_far = light.kind == DIRECTIONAL;
        let is_ring = light.kind == RING;
        let path = select(light.position_world_m - place_m, -light.direction_world, is_far);
        let per_metre = inverseSqrt(max(dot(path, path), 1e-12));
        let to_light = path * per_metre;
        let radius_m = select(pool.lamp_radius_m, max(light.ring_radius_m, 1e-3), is_ring);
        let half_angle = select(radius_m * per_metre, FAR_LAMP_RAD, is_far);
        let cone = saturate(dot(-light.direction_world, to_light) * light.cone_scale + light.cone_offset);
        let shines = select(cone * cone, 1.0, is_far || light.kind == POINT);
        // Candela over the lamp's area, or lux over its solid angle.
        let area = PI * select(radius_m * radius_m, FAR_LAMP_RAD * FAR_LAMP_RAD, is_far);
        let dark = select(0.0, DARK_MIDDLE, is_ring);
        let off = length(direction - to_light) / half_angle;
        // Edges are as soft as a pixel is wide, and the lamp so much darker that its light stays the same.
        let soft = SOFTNESS + footprint / half_angle;
        let disk = 1.0 - smoothstep(1.0 - soft, 1.0 + soft, off);
        let hole = select(smoothstep(dark - soft, dark + soft, off), 1.0, !is_ring);
        radiance += light.colour * (shines * disk * hole / (area * (1.0 - dark * dark) * (1.0 + soft * soft)));
        k++;
        continuing {
            break if k >= pool.lights.count;
        }
    }
    return radiance;
}
