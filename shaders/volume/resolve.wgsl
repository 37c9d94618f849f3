// Turns blended slices into what a ray leaves behind. Spaces: as in `march.wgsl`.

#import bevy_surgery::volume::{NOTHING, covering_triangle, normal_of, ray_through, volume}
#ifdef DEFORMED
#import bevy_surgery::volume_deform::shown_gradient
#endif

@group(2) @binding(0) var colours: texture_2d<f32>;
@group(2) @binding(1) var gradients: texture_2d<f32>;
@group(2) @binding(2) var depths: texture_2d<f32>;

struct Buffers {
    @location(0) relief: vec4<f32>,
    @location(1) depth_m: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> Buffers {
    let texel = vec2<i32>(at.xy);
    let opacity = textureLoad(colours, texel, 0).a;
    let gradient = textureLoad(gradients, texel, 0).xyz;
    let relative = textureLoad(depths, texel, 0).r / max(opacity, 1e-6);
    let mean_m = volume.middle_m + relative * volume.spacing_m;
    let ray = ray_through(at.xy);
#ifdef DEFORMED
    let relief = vec4(normal_of(shown_gradient(gradient, ray.origin + ray.along * mean_m), ray), relative);
#else
    let relief = vec4(normal_of(gradient, ray), relative);
#endif
    return Buffers(select(relief, vec4(0.0, 0.0, 0.0, NOTHING), opacity < 1.0 / 512.0), vec2(mean_m, mean_m));
}
