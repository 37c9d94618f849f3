// The shadow map of a lamp: depth of the tools as the lamp sees them. Spaces: mesh, and clip space of the lamp (reversed
// depth without a far end: near distance over distance). Rust twin: `view/tool_shadows/map.rs`.

struct ToolCasterUniform {
    clip_from_mesh: mat4x4<f32>,
}

@group(0) @binding(0) var<uniform> caster: ToolCasterUniform;

@vertex
fn vertex(@location(0) position: vec3<f32>) -> @builtin(position) vec4<f32> {
    return caster.clip_from_mesh * vec4(position, 1.0);
}
