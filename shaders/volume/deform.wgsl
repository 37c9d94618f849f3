// The lattice that a volume is deformed by. At a place of the picture the matter is shown that rests at the place plus a
// translation (paper of 2001, section 4.2: the translations lie in a small texture, whose values lead into the volume). Spaces:
// voxel, shown or at rest; node (the lattice's vertices at whole numbers). Rust twin: `volume/lattice.rs`.
#define_import_path bevy_surgery::volume_deform

#import bevy_surgery::volume::volume

struct DeformUniform {
    node_from_voxel: mat4x4<f32>,
    // Least and greatest slope of the voxel coordinates at rest by those that are shown, in columns by axis.
    slope_low: array<vec4<f32>, 3>,
    slope_high: array<vec4<f32>, 3>,
    // Lattice cells along a side.
    cells: f32,
    // Which matrix leads gradients to the picture: 0 the patch's, 1 those between the vertices, 2 that of the field itself.
    normals: u32,
}

@group(3) @binding(0) var<uniform> deform: DeformUniform;
// Translations in texture coordinates of the field.
@group(3) @binding(1) var nodes: texture_3d<f32>;
// Matrices of the modes 0 (in the cells) and 1 (at the nodes), a layer of rows over the next one along z.
@group(3) @binding(2) var matrices: texture_3d<f32>;

// Texture coordinates among the nodes.
fn node_place_of(voxel: vec3<f32>) -> vec3<f32> {
    return ((deform.node_from_voxel * vec4(voxel, 1.0)).xyz + 0.5) / (deform.cells + 1.0);
}

struct Speeds {
    low: vec3<f32>,
    high: vec3<f32>,
}

// Bounds of how matter at rest goes by when the shown place moves along a way.
fn rest_speeds(along: vec3<f32>) -> Speeds {
    var low = vec3(0.0);
    var high = vec3(0.0);
    for (var axis = 0; axis < 3; axis++) {
        let a = deform.slope_low[axis].xyz * along[axis];
        let b = deform.slope_high[axis].xyz * along[axis];
        low += min(a, b);
        high += max(a, b);
    }
    return Speeds(low, high);
}

// How far apart matter at rest may be whose shown places are so far apart along each axis.
fn slack_of(aside: vec3<f32>) -> f32 {
    var most = vec3(0.0);
    for (var axis = 0; axis < 3; axis++) {
        most += max(abs(deform.slope_low[axis].xyz), abs(deform.slope_high[axis].xyz)) * aside[axis];
    }
    return max(most.x, max(most.y, most.z));
}

fn translation_of(node: vec3<i32>) -> vec3<f32> {
    return textureLoad(nodes, node, 0).xyz;
}

fn matrix_column(node: vec3<i32>, column: i32, size: i32) -> vec3<f32> {
    return textureLoad(matrices, node + vec3(0, 0, column * size), 0).xyz;
}

// The transpose of the field's derivative, times a gradient.
fn by_slopes(gradient: vec3<f32>, node: vec3<f32>) -> vec3<f32> {
    let last = vec3<i32>(i32(deform.cells) - 1);
    let first = clamp(vec3<i32>(floor(node)), vec3(0), last);
    let s = clamp(node - vec3<f32>(first), vec3(0.0), vec3(1.0));
    let a = translation_of(first);
    let b = translation_of(first + vec3(1, 0, 0));
    let c = translation_of(first + vec3(0, 1, 0));
    let d = translation_of(first + vec3(1, 1, 0));
    let e = translation_of(first + vec3(0, 0, 1));
    let f = translation_of(first + vec3(1, 0, 1));
    let g = translation_of(first + vec3(0, 1, 1));
    let h = translation_of(first + vec3(1, 1, 1));
    let near_low = mix(a, b, s.x);
    let near_high = mix(c, d, s.x);
    let far_low = mix(e, f, s.x);
    let far_high = mix(g, h, s.x);
    let weighted = gradient * volume.size;
    let slopes = vec3(
        dot(weighted, mix(mix(b - a, d - c, s.y), mix(f - e, h - g, s.y), s.z)),
        dot(weighted, mix(near_high - near_low, far_high - far_low, s.z)),
        dot(weighted, mix(far_low, far_high, s.y) - mix(near_low, near_high, s.y)),
    );
    // Beyond the lattice the translation does not change any more along the way out.
    let is_in = (node >= vec3(0.0)) & (node <= vec3(deform.cells));
    let by_node = select(vec3(0.0), slopes, is_in);
    return gradient + (vec4(by_node, 0.0) * deform.node_from_voxel).xyz;
}

// Transposed matrices between the vertices, or the patch's own, times a gradient (paper of 2001, section 5).
fn by_matrices(gradient: vec3<f32>, node: vec3<f32>) -> vec3<f32> {
    let is_smoothed = deform.normals == 1u;
    let last = vec3<i32>(i32(deform.cells) - 1);
    let first = clamp(vec3<i32>(floor(node)), vec3(0), last);
    // A patch's own matrix is that of its cell alone.
    let s = select(vec3(0.0), clamp(node - vec3<f32>(first), vec3(0.0), vec3(1.0)), is_smoothed);
    let size = i32(deform.cells) + select(0, 1, is_smoothed);
    var sum = vec3(0.0);
    for (var n = 0; n < 8; n++) {
        let corner = vec3(n & 1, n >> 1u & 1, n >> 2u & 1);
        let weights = select(1.0 - s, s, corner == vec3(1));
        let at = min(first + corner, vec3(size - 1));
        let product = vec3(
            dot(matrix_column(at, 0, size), gradient),
            dot(matrix_column(at, 1, size), gradient),
            dot(matrix_column(at, 2, size), gradient),
        );
        sum += weights.x * weights.y * weights.z * product;
    }
    // Beyond the box the field goes on unchanged.
    let is_in = (node >= vec3(0.0)) & (node <= vec3(deform.cells));
    return select(gradient, sum, is_in);
}

// A gradient per voxel at rest, as it is where the matter is shown.
fn shown_gradient(gradient: vec3<f32>, voxel: vec3<f32>) -> vec3<f32> {
    let node = (deform.node_from_voxel * vec4(voxel, 1.0)).xyz;
    if deform.normals == 2u {
        return by_slopes(gradient, node);
    }
    return by_matrices(gradient, node);
}
