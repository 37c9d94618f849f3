// Draws a volume as slices, back to front, blended over one another (paper of 2009, section 5). Spaces: world, voxel.
// CPU twin: `volume/software/slices.rs`.

#import bevy_surgery::volume::{ray_through, relative_depth, volume}
#import bevy_surgery::volume_field::{gradient_at, place_of, sample_at, scene_depth_m}
#import bevy_render::view::View
#ifdef DEFORMED
#import bevy_surgery::volume_deform::{node_place_of, nodes}
#import bevy_surgery::volume_field::linear_sampler
#endif

@group(0) @binding(0) var<uniform> view: View;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    // Number of the slice, counted from the eye.
    @location(0) @interpolate(flat) k: f32,
}

struct Blended {
    @location(0) colour: vec4<f32>,
    @location(1) gradient: vec4<f32>,
    // Counted from the volume's middle, so that half precision does. Only the first component is kept; the last one is what
    // blending goes by.
    @location(2) depth: vec4<f32>,
}

@vertex
fn vertex(@location(0) corner: vec4<f32>) -> Varying {
    var clip = view.clip_from_world * vec4(corner.xyz, 1.0);
    // Hidden by the scene's depth below, and never by the near plane.
    clip.z = 0.5 * clip.w;
    return Varying(clip, corner.w);
}

@fragment
fn fragment(in: Varying) -> Blended {
    // The buffers begin where the viewport does.
    let pixel = in.clip.xy;
    let depth_m = in.k * volume.step_m;
    let ray = ray_through(pixel);
    let voxel = ray.origin + ray.along * depth_m;
#ifdef DEFORMED
    let place = place_of(voxel) + textureSampleLevel(nodes, linear_sampler, node_place_of(voxel), 0.0).xyz;
#else
    let place = place_of(voxel);
#endif
    let sample = sample_at(place);
    // The polygons are a little larger than the box: it ends for slices where it ends for rays.
    var is_hidden = depth_m > scene_depth_m(pixel) || any(voxel < volume.low) || any(voxel > volume.high);
#ifdef DEFORMED
    is_hidden = is_hidden || any(place < vec3(0.0)) || any(place > vec3(1.0));
#endif
    for (var plane = 0u; plane < volume.clip_plane_count; plane++) {
        is_hidden = is_hidden || dot(volume.clip_planes[plane], vec4(voxel, 1.0)) < 0.0;
    }
    let opacity = select(sample.opacity, 0.0, is_hidden);
    return Blended(
        vec4(opacity * sample.colour, opacity),
        vec4(opacity * gradient_at(place), opacity),
        vec4(opacity * relative_depth(depth_m), 0.0, 0.0, opacity),
    );
}
