// An organ's vertices, shared by every layer that is drawn on it. Spaces: organ (at rest or moved), world, clip.
// Rust twin: `organ/render`.
#define_import_path bevy_surgery::organ

#import bevy_render::view::View
#import bevy_surgery::lights::OrganLights
#ifdef TONEMAP_IN_SHADER
#import bevy_core_pipeline::tonemapping::tone_mapping
#endif

struct OrganUniform {
    world_from_organ: mat4x4<f32>,
    world_from_organ_normal: mat4x4<f32>,
    lights: OrganLights,
    handedness: f32,
    is_planar: u32,
}

struct PrimaryVertex {
    position_m: vec4<f32>,
    normal: vec4<f32>,
}

@group(0) @binding(0) var<uniform> view: View;
@group(1) @binding(0) var<uniform> organ: OrganUniform;
@group(1) @binding(1) var<storage, read> primaries: array<PrimaryVertex>;

struct CornerVertex {
    @location(0) primaries: vec3<u32>,
    @location(1) weights: vec3<f32>,
    @location(2) tile_barycentric: vec2<f32>,
    @location(3) texture_triangle: u32,
    @location(4) rest_position_m: vec3<f32>,
    @location(5) chart_direction: vec3<f32>,
}

// A secondary vertex: the fixed combination of its primary vertices, wherever they are now.
struct SecondaryVertex {
    position_world_m: vec3<f32>,
    // Not normalised: interpolates like the normals of the geometric mesh.
    normal_world: vec3<f32>,
}

fn secondary_vertex(corner: CornerVertex) -> SecondaryVertex {
    var position = vec3(0.0);
    var normal = vec3(0.0);
    for (var k = 0u; k < 3u; k++) {
        let primary = primaries[corner.primaries[k]];
        position += corner.weights[k] * primary.position_m.xyz;
        normal += corner.weights[k] * primary.normal.xyz;
    }
    var out: SecondaryVertex;
    out.position_world_m = (organ.world_from_organ * vec4(position, 1.0)).xyz;
    out.normal_world = (organ.world_from_organ_normal * vec4(normal, 0.0)).xyz;
    return out;
}

// Texture coordinates of the reaction map from the interpolated `chart_direction`. Rust twin: `Atlas::uv_from_direction`.
fn map_uv(chart_direction: vec3<f32>) -> vec2<f32> {
    if organ.is_planar != 0u {
        return chart_direction.xy;
    }
    let u = atan2(chart_direction.x, chart_direction.z) / 6.283185307179586;
    let v = atan2(length(chart_direction.xz), chart_direction.y) / 3.141592653589793;
    return vec2(fract(u), v);
}

// The normal of a surface that is raised by `height_m` over this one (Mikkelsen 2010, "Bump mapping unparametrized
// surfaces on the GPU"): the differences to the neighbouring pixels are all that it needs.
fn raised(normal: vec3<f32>, position_world_m: vec3<f32>, height_m: f32) -> vec3<f32> {
    let along_x = dpdx(position_world_m);
    let along_y = dpdy(position_world_m);
    let across_x = cross(along_y, normal);
    let across_y = cross(normal, along_x);
    let area = dot(along_x, across_x);
    let slope = sign(area) * (dpdxFine(height_m) * across_x + dpdyFine(height_m) * across_y);
    // At silhouettes the neighbouring pixel lies elsewhere: no cell is steeper than this.
    let steepest = 0.7 * abs(area) / max(length(slope), 1e-20);
    return normalize(abs(area) * normal - slope * min(steepest, 1.0));
}

// Unit vector from a point towards the eye, for perspective and parallel views.
fn to_eye(position_world_m: vec3<f32>) -> vec3<f32> {
    let is_parallel = view.clip_from_view[3].w == 1.0;
    return normalize(select(view.world_position - position_world_m, view.world_from_view[2].xyz, is_parallel));
}

// What a layer writes for a radiance in the world: exposed, and tonemapped where the camera does not do so later.
fn to_target(radiance: vec3<f32>, opacity: f32) -> vec4<f32> {
    return exposed_to_target(vec4(radiance * view.exposure, opacity));
}

// The same for what is exposed already.
fn exposed_to_target(exposed: vec4<f32>) -> vec4<f32> {
#ifdef TONEMAP_IN_SHADER
    return tone_mapping(exposed, view.color_grading);
#else
    return exposed;
#endif
}
