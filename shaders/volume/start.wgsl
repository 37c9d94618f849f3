// How far the rays of a square of pixels pass over nothing that shows, found by one ray for all of them: the rays of the pixels
// begin there. Spaces: as in `march.wgsl`. CPU twin: none, as it changes no picture; `tests/volume_pass` hold that.

#import bevy_surgery::volume::{covering_triangle, ray_through, volume}
#import bevy_surgery::volume_walk::{SQUARE_PX, drawn_range, inclined, look_at, pace_of}
#import bevy_surgery::volume_field::place_of
#ifdef DEFORMED
#import bevy_surgery::volume_deform::{node_place_of, nodes, slack_of}
#import bevy_surgery::volume_field::linear_sampler
#endif

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) f32 {
    let ray = ray_through(at.xy * SQUARE_PX);
    let corner = ray_through((at.xy + 0.5) * SQUARE_PX);
    let along = inclined(ray.along);
    let apart = abs(corner.origin - ray.origin);
    let apart_per_m = abs(corner.along - ray.along);
    // How far a pixel's ray may be from this one, as deep as the volume's far end.
    let shift = 0.5 * (volume.low + volume.high - volume.size + 1.0);
    let depth_m = abs(volume.middle_m) + (length(shift) + length(volume.high - volume.low)) / max(length(along), 1e-9);
    let aside = apart + apart_per_m * depth_m;
    let voxels = max(aside.x, max(aside.y, aside.z));
    let range = drawn_range(ray, along, voxels);
#ifdef DEFORMED
    let margin = ceil(slack_of(aside) * 0.25);
#else
    let margin = ceil(voxels * 0.25);
#endif
    let pace = pace_of(along);
    let first_place = place_of(ray.origin);
    let step_place = along * volume.step_m / volume.size;
    let per_block = volume.size * 0.25;
    let last = floor(range.y / volume.step_m);
    var k = ceil(range.x / volume.step_m);
#ifdef DEFORMED
    let first_node = node_place_of(ray.origin);
    let step_node = node_place_of(ray.origin + along * volume.step_m) - first_node;
#endif
    loop {
        var place = first_place + step_place * k;
#ifdef DEFORMED
        place += textureSampleLevel(nodes, linear_sampler, first_node + step_node * k, 0.0).xyz;
#endif
        let seen = look_at(place * per_block, pace, margin);
        // What is met before the end of this round is seen by the pixels' own rays.
        let is_over = !seen.is_empty || k > last;
        k += select(max(ceil(seen.steps), 1.0), 0.0, is_over);
        continuing {
            break if is_over;
        }
    }
    return select(k * volume.step_m, 3e38, k > last);
}
