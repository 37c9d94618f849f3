// Draws a volume as slices that are aligned with its lattice, front to back, each under those before it (paper of 2001, section
// 4). Spaces: shares of the lattice's box, texture. CPU twin: `volume/software/aligned.rs`.

#import bevy_surgery::volume::{volume}
#import bevy_surgery::volume_field::{gradient_at, sample_at}
#import bevy_surgery::volume_patches::{aligned, polygon_vertex, polygons}

struct Varying {
    @builtin(position) clip: vec4<f32>,
    // Texture coordinates, and depth in voxels from the volume's middle.
    @location(0) place: vec4<f32>,
#ifdef CLIPPED
    @location(1) shown: vec3<f32>,
#endif
}

struct Blended {
    @location(0) colour: vec4<f32>,
    // Only the first component is a depth; the last one is what blending goes by.
    @location(1) depth: vec4<f32>,
#ifdef NORMALS
    @location(2) gradient: vec4<f32>,
#endif
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Varying {
    let corner = polygon_vertex(polygons[index / 5u], index % 5u);
    let place = vec4(corner.place, 1.0);
    let texture = (aligned.texture_from_box * vec4(corner.rest, 1.0)).xyz;
    let clip = aligned.clip_from_box * place;
#ifdef CLIPPED
    let shown = (aligned.texture_from_box * place).xyz * volume.size - 0.5;
    return Varying(clip, vec4(texture, dot(aligned.depth_from_box, place)), shown);
#else
    return Varying(clip, vec4(texture, dot(aligned.depth_from_box, place)));
#endif
}

@fragment
fn fragment(in: Varying) -> Blended {
    let place = in.place.xyz;
    let here = sample_at(place);
    // The table has the opacity of a step along the view; slices are met at an angle.
    let per_step = dot(aligned.slices_per_step.xyz, vec3(1.0, in.clip.xy));
    var opacity = 1.0 - pow(1.0 - here.opacity, 1.0 / max(per_step, 0.05));
    // Nothing is beyond the grid.
    var is_hidden = any(place != saturate(place));
#ifdef CLIPPED
    for (var plane = 0u; plane < volume.clip_plane_count; plane++) {
        is_hidden = is_hidden || dot(volume.clip_planes[plane], vec4(in.shown, 1.0)) < 0.0;
    }
#endif
    opacity = select(opacity, 0.0, is_hidden);
    return Blended(
        vec4(opacity * here.colour, opacity),
        vec4(opacity * in.place.w, 0.0, 0.0, opacity),
#ifdef NORMALS
        vec4(opacity * gradient_at(place), opacity),
#endif
    );
}
