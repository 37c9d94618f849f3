// Polygons that slices cut out of the patches of a lattice (paper of 2001, sections 4 and 4.1). Space: shares of the lattice's
// box. Rust twins: `volume/aligned/polygons.rs`, `volume/render/aligned`.
#define_import_path bevy_surgery::volume_patches

struct AlignedUniform {
    clip_from_box: mat4x4<f32>,
    texture_from_box: mat4x4<f32>,
    // Depth in voxels from the volume's middle.
    depth_from_box: vec4<f32>,
    // Slices per step of the table along a pixel's ray: constant, per pixel to the right, per pixel down.
    slices_per_step: vec4<f32>,
    // The nearest slice, and how the numbers go on.
    first: f32,
    direction: f32,
    spacing: f32,
    axis: u32,
}

// A patch between its faces across an axis. Components in the order u, v, along the axis.
struct PatchFrames {
    low_uva: vec3<f32>,
    side: f32,
    front: vec4<u32>,
    back: vec4<u32>,
}

struct PatchRect {
    // Least u and v, greatest u and v.
    span: vec4<f32>,
    frames: u32,
}

struct PolygonVertex {
    place: vec3<f32>,
    rest: vec3<f32>,
}

@group(1) @binding(7) var<uniform> aligned: AlignedUniform;
@group(1) @binding(8) var<storage, read> all_frames: array<PatchFrames>;
@group(1) @binding(9) var<storage, read> rects: array<PatchRect>;
@group(1) @binding(10) var<storage, read> translations: array<vec4<f32>>;
// Slice and rectangle.
@group(1) @binding(11) var<storage, read> polygons: array<u32>;

const RECT_BITS: u32 = 20u;

fn on_face(face: vec4<u32>, weights: vec4<f32>) -> vec3<f32> {
    return translations[face.x].xyz * weights.x + translations[face.y].xyz * weights.y
        + translations[face.z].xyz * weights.z + translations[face.w].xyz * weights.w;
}

// Vertex `n` of a polygon: 0 to 3 its corners, u fastest, 4 its middle. The translation lies between those of the patch's front
// and back.
fn polygon_vertex(polygon: u32, n: u32) -> PolygonVertex {
    let slice = f32(polygon >> RECT_BITS);
    let rect = rects[polygon & ((1u << RECT_BITS) - 1u)];
    let frames = all_frames[rect.frames];
    let low = rect.span.xy;
    let high = rect.span.zw;
    let corner = vec2(f32(n & 1u), f32(n >> 1u & 1u));
    let across = select(low + (high - low) * corner, (low + high) * 0.5, n == 4u);
    let along = (aligned.first + aligned.direction * slice + 0.5) * aligned.spacing;
    let uva = vec3(across, along);
    let share = clamp((uva - frames.low_uva) / frames.side, vec3(0.0), vec3(1.0));
    let other = 1.0 - share;
    let weights = vec4(other.x * other.y, share.x * other.y, other.x * share.y, share.x * share.y);
    let moved = mix(on_face(frames.front, weights), on_face(frames.back, weights), share.z);
    let place = select(select(uva, uva.yzx, aligned.axis == 1u), uva.zxy, aligned.axis == 0u);
    return PolygonVertex(place, place + moved);
}
