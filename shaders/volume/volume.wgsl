// A volume in a view, shared by the passes that draw it. Spaces: voxel (centre of voxel (i, j, k) at integers), world,
// pixels of the viewport. Depths are metres along the view's axis. Rust twin: `volume/render/uniform.rs`.
#define_import_path bevy_surgery::volume

#import bevy_surgery::lights::OrganLights

struct VolumeUniform {
    world_from_voxel: mat4x4<f32>,
    // Inverse transpose of the above, times `spacing_m`: gradients to normals.
    world_from_voxel_normal: mat4x4<f32>,
    // A pixel's ray in voxel coordinates is `origin + along * depth`; both are linear in the pixel's place in clip space
    // (constant, times x, times y).
    origin: array<vec4<f32>, 3>,
    along: array<vec4<f32>, 3>,
    // Voxel-space half spaces: visible where dot(plane, (v, 1)) >= 0.
    clip_planes: array<vec4<f32>, 6>,
    // What can be seen at all, voxel coordinates.
    low: vec3<f32>,
    step_m: f32,
    high: vec3<f32>,
    near_m: f32,
    size: vec3<f32>,
    clip_plane_count: u32,
    // Where the viewport lies in its target, and its size, pixels.
    viewport: vec4<f32>,
    // Clip-space z is (x * -depth + y) / (z * -depth + w).
    depth_projection: vec4<f32>,
    // Depth of the volume's middle, and the length of a voxel's shortest edge in the world.
    middle_m: f32,
    spacing_m: f32,
    // Wet shading.
    edge_voxels: f32,
    shine: f32,
    shine_exponent: f32,
    diffuse_smoothing: f32,
    is_shaded: f32,
    lights: OrganLights,
}

@group(1) @binding(0) var<uniform> volume: VolumeUniform;

// Depth of a pixel that shows nothing, in `relief` textures.
const NOTHING: f32 = 60000.0;
// A pixel counts as covered, and writes depth, from this opacity on.
const SOLID: f32 = 0.5;

struct Ray {
    origin: vec3<f32>,
    along: vec3<f32>,
}

// The ray through a place of the viewport, pixels.
fn ray_through(pixel: vec2<f32>) -> Ray {
    let ndc = vec2(2.0, -2.0) * (pixel / volume.viewport.zw) + vec2(-1.0, 1.0);
    return Ray(
        volume.origin[0].xyz + volume.origin[1].xyz * ndc.x + volume.origin[2].xyz * ndc.y,
        volume.along[0].xyz + volume.along[1].xyz * ndc.x + volume.along[2].xyz * ndc.y,
    );
}

// Depth in metres for a number in the depth buffer.
fn depth_m_of(clip_z: f32) -> f32 {
    let p = volume.depth_projection;
    return (p.y - clip_z * p.w) / (p.x - clip_z * p.z);
}

// The number in the depth buffer for a depth in metres.
fn clip_z_of(depth_m: f32) -> f32 {
    let p = volume.depth_projection;
    return (p.y - p.x * depth_m) / (p.w - p.z * depth_m);
}

fn world_of(voxel: vec3<f32>) -> vec3<f32> {
    return (volume.world_from_voxel * vec4(voxel, 1.0)).xyz;
}

// Depth in voxels from the volume's middle: small numbers, which half precision holds well.
fn relative_depth(depth_m: f32) -> f32 {
    return (depth_m - volume.middle_m) / volume.spacing_m;
}

// The unit normal of a surface with a gradient of opacity, towards the eye.
fn normal_of(gradient: vec3<f32>, ray: Ray) -> vec3<f32> {
    let normal = (volume.world_from_voxel_normal * vec4(-gradient, 0.0)).xyz;
    let away = (volume.world_from_voxel * vec4(ray.along, 0.0)).xyz;
    let squared = dot(normal, normal);
    // Where nothing has a slope, the surface faces the eye.
    let unit = select(-normalize(away), normal * inverseSqrt(squared), squared > 1e-12);
    return select(unit, -unit, dot(unit, away) > 0.0);
}

// A triangle over the whole viewport.
fn covering_triangle(index: u32) -> vec4<f32> {
    return vec4(f32(index & 1u) * 4.0 - 1.0, f32(index >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
