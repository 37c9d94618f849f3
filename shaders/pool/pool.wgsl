// A pool in a view, and its optics. Spaces: pool (metres, the surface's plane is XY, Z is up; light comes in it too), target
// (pixels of the view's target and the depth that its depth texture holds), clip. Rust twins: `pool/render/composite/uniform.rs`,
// `pool/software.rs`.
#define_import_path bevy_surgery::pool

#import bevy_surgery::lights::OrganLights

struct PoolUniform {
    clip_from_pool: mat4x4<f32>,
    target_from_pool: mat4x4<f32>,
    pool_from_target: mat4x4<f32>,
    // The last two rows of the above: height of a point times its fourth coordinate, and that one.
    height_row: vec4<f32>,
    unit_row: vec4<f32>,
    // Cube maps are left-handed: this turns and mirrors.
    environment_from_pool: mat4x4<f32>,
    // The eye's place (fourth coordinate 1), or the direction to it in parallel views (0).
    eye_pool: vec4<f32>,
    // The part of the target that may be read, pixels: least x, y, greatest x, y.
    readable_px: vec4<f32>,
    grid_size: vec2<f32>,
    cell_m: f32,
    level_m: f32,
    // Pixels that a metre takes where the clip-space w is 1.
    pixels_per_metre: f32,
    // Wave height in metres per millimetre of the texels, and its bound.
    metres_per_height: f32,
    greatest_wave_m: f32,
    meniscus_width_m: f32,
    water_absorption_per_m: vec3<f32>,
    blood_scattering_per_m: f32,
    blood_absorption_per_m: vec3<f32>,
    dust_scattering_per_m: f32,
    blood_colour: vec3<f32>,
    water_index: f32,
    dust_colour: vec3<f32>,
    blood_index: f32,
    // Six numbers.
    meniscus: array<vec4<f32>, 2>,
    meniscus_light: f32,
    meniscus_reach_m: f32,
    // 1 where the ground is seen refracted, else 0; 1 for the paper's Fresnel term, 0 for Schlick's.
    refracts: f32,
    is_paper_fresnel: f32,
    // Radiance of the map, or of the lamps and the room, per what is worked out.
    environment_strength: f32,
    room: f32,
    lamp_radius_m: f32,
    bubble_m: f32,
    // Place, one over the square of the radius, amount.
    foam: array<vec4<f32>, 16>,
    foam_count: u32,
    // Their places and directions are the pool's.
    lights: OrganLights,
}

@group(1) @binding(0) var<uniform> pool: PoolUniform;

const PI: f32 = 3.141592653589793;

// What is dissolved, as shares.
struct Mixture {
    blood: f32,
    dust: f32,
}

fn refractive_index(mixture: Mixture) -> f32 {
    return mix(pool.water_index, pool.blood_index, mixture.blood);
}

// Share of the light that is reflected (equation 5, or Schlick's).
fn fresnel(cosine: f32, index: f32) -> f32 {
    let rest = 1.0 - saturate(cosine);
    let square = rest * rest;
    let root = (index - 1.0) / (index + 1.0);
    let straight = root * root;
    return mix(straight + (1.0 - straight) * square * square * rest, square, pool.is_paper_fresnel);
}

// Algorithm 3, interpolated: each entry counts by how near the count is to it.
fn meniscus(count: f32) -> f32 {
    let first = saturate(1.0 - abs(count - vec4(0.0, 1.0, 2.0, 3.0)));
    let last = saturate(1.0 - abs(count - vec2(4.0, 5.0)));
    return dot(first, pool.meniscus[0]) + dot(last, pool.meniscus[1].xy);
}

fn scattering_per_m(mixture: Mixture) -> vec2<f32> {
    return vec2(pool.blood_scattering_per_m, pool.dust_scattering_per_m) * vec2(mixture.blood, mixture.dust);
}

// Share of the light that gets through so many metres.
fn transmittance(mixture: Mixture, path_m: f32) -> vec3<f32> {
    let scattering = scattering_per_m(mixture);
    let absorption = pool.water_absorption_per_m + pool.blood_absorption_per_m * mixture.blood;
    return exp(-(absorption + scattering.x + scattering.y) * path_m);
}

// Share of the light on the surface that the fluid itself sends back: what each layer scatters, less what is absorbed on the
// way down to it and up again.
fn in_scattered(mixture: Mixture, path_m: f32) -> vec3<f32> {
    let scattering = scattering_per_m(mixture);
    let source = pool.blood_colour * scattering.x + pool.dust_colour * scattering.y;
    let absorption = pool.water_absorption_per_m + pool.blood_absorption_per_m * mixture.blood;
    let lost = max(scattering.x + scattering.y + 2.0 * absorption, vec3(1e-6));
    return source / lost * (1.0 - exp(-lost * path_m));
}
