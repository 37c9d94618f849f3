// The dark frame around an endoscope's round picture. Space: clip space of the frame; radii in shares of half its
// height. Instance 0 is the soft edge, instance 1 everything beyond. Rust twin: `view/mask.rs`.

struct ScopeMaskUniform {
    colour: vec4<f32>,
    radii: vec2<f32>,
    aspect: f32,
}

@group(0) @binding(0) var<uniform> mask: ScopeMaskUniform;

const SEGMENTS: f32 = 96.0;
const TAU: f32 = 6.283185307179586;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) opacity: f32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) ring: u32) -> Varying {
    let angle = f32(index >> 1u) / SEGMENTS * TAU;
    let is_outer = (index & 1u) == 1u;
    // Chords cut inside their circle: widen the outermost ring so that it covers the frame's corners.
    let beyond = 2.0 * (mask.aspect + 1.0 / mask.aspect + mask.radii.y);
    let inner = select(mask.radii.x, mask.radii.y, ring == 1u);
    let outer = select(mask.radii.y, beyond, ring == 1u);
    let radius = select(inner, outer, is_outer);
    let place = vec2(cos(angle) / mask.aspect, sin(angle)) * radius;
    let opacity = select(select(0.0, 1.0, is_outer), 1.0, ring == 1u);
    // At the near plane (Bevy's depth is reversed), for the pass that keeps hidden pixels from being shaded.
    return Varying(vec4(place, 1.0, 1.0), opacity);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return vec4(mask.colour.rgb, mask.colour.a * in.opacity);
}
