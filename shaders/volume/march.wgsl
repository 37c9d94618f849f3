// Walks a ray per pixel through a volume. CPU twin: `volume/software/march.rs`.
//
// One loop, and in each round one look at the blocks, one jump and two samples: pixels next to each other run in lockstep, and
// with loops inside the loop each waits where the others still jump or sample, which took half as long again. Rays begin where
// `start.wgsl` says that something may show; those through what is deformed jump more often, so they have a loop before that
// only jumps.

#import bevy_surgery::volume::{NOTHING, covering_triangle, normal_of, ray_through, relative_depth, volume}
#import bevy_surgery::volume_field::{gradient_at, place_of, sample_at, scene_depth_m}
#import bevy_surgery::volume_walk::{SQUARE_PX, drawn_range, inclined, look_at, pace_of}
#ifdef DEFORMED
#import bevy_surgery::volume_deform::{node_place_of, nodes, shown_gradient}
#import bevy_surgery::volume_field::linear_sampler
#endif

// Depth up to which nothing shows, by squares of pixels, metres.
@group(2) @binding(1) var starts_m: texture_2d<f32>;

const OPAQUE: f32 = 0.98;

struct Buffers {
    // Premultiplied, linear.
    @location(0) colour: vec4<f32>,
    // Unit normal in the world, relative depth.
    @location(1) relief: vec4<f32>,
    // Mean depth, depth where the ray ended; metres.
    @location(2) depth_m: vec2<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

// What a ray has gathered.
struct Gathered {
    colour: vec3<f32>,
    opacity: f32,
    gradient: vec3<f32>,
    // Sum of numbers of steps by weight.
    depth: f32,
}

fn gather(so_far: Gathered, place: vec3<f32>, k: f32, is_hidden: bool) -> Gathered {
    let here = sample_at(place);
#ifdef DEFORMED
    // A lattice may lead beyond the grid, where nothing is.
    let is_outside = any(place < vec3(0.0)) || any(place > vec3(1.0));
#else
    let is_outside = false;
#endif
    let weight = select((1.0 - so_far.opacity) * here.opacity, 0.0, is_hidden || is_outside || so_far.opacity > OPAQUE);
    var gathered = so_far;
#ifdef LIT
    if weight > 0.0 {
        gathered.gradient += weight * gradient_at(place);
    }
#endif
    gathered.colour += weight * here.colour;
    gathered.depth += weight * k;
    gathered.opacity += weight;
    return gathered;
}

@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> Buffers {
    let ray = ray_through(at.xy);
    let along = inclined(ray.along);
    let range = drawn_range(ray, along, 0.0);
    var first_m = range.x;
    var last_m = min(range.y, scene_depth_m(at.xy));
    for (var plane = 0u; plane < volume.clip_plane_count; plane++) {
        let p = volume.clip_planes[plane];
        let start = dot(p, vec4(ray.origin, 1.0));
        let slope = dot(p.xyz, along);
        let cut_m = -start / slope;
        first_m = select(first_m, max(first_m, cut_m), slope > 0.0);
        last_m = select(last_m, min(last_m, cut_m), slope < 0.0);
        last_m = select(last_m, -1.0, slope == 0.0 && start < 0.0);
    }
    let last = floor(last_m / volume.step_m);
    first_m = max(first_m, textureLoad(starts_m, vec2<i32>(at.xy / SQUARE_PX), 0).r);
    // The start is a whole number of steps, and ought to stay one.
    var k = ceil(first_m / volume.step_m - 1e-3);
    let end = min(last, k + 8192.0);
    let pace = pace_of(along);
    // Places by number of steps.
    let first_place = place_of(ray.origin);
    let step_place = along * volume.step_m / volume.size;
    let per_block = volume.size * 0.25;
    var seen = Gathered(vec3(0.0), 0.0, vec3(0.0), 0.0);
#ifdef DEFORMED
    // The translation of both samples is that between them, and goes on as it came from the pair before.
    let first_node = node_place_of(ray.origin);
    let step_node = node_place_of(ray.origin + along * volume.step_m) - first_node;
    var before = vec3(0.0);
    var is_next = false;
#endif
#ifdef DEFORMED
    // First to where something may show: rounds without samples cost half as much.
    loop {
        let translation = textureSampleLevel(nodes, linear_sampler, first_node + step_node * k, 0.0).xyz;
        let look = look_at((first_place + step_place * k + translation) * per_block, pace, 0.0);
        let is_over = !look.is_empty || k > end;
        k += select(max(ceil(look.steps), 1.0), 0.0, is_over);
        continuing {
            break if is_over;
        }
    }
#endif
    loop {
#ifdef DEFORMED
        let translation = textureSampleLevel(nodes, linear_sampler, first_node + step_node * (k + 0.5), 0.0).xyz;
        let middle = first_place + step_place * (k + 0.5) + translation;
        let look = look_at(middle * per_block, pace, 0.0);
        let half_way = 0.5 * step_place + 0.25 * select(vec3(0.0), translation - before, is_next);
        let is_empty = look.is_empty;
        seen = gather(seen, middle - half_way, k, is_empty || k > end);
        seen = gather(seen, middle + half_way, k + 1.0, is_empty || k + 1.0 > end);
        before = translation;
        is_next = !is_empty;
        k += select(2.0, max(ceil(look.steps), 1.0), is_empty);
#else
        let look = look_at((first_place + step_place * k) * per_block, pace, 0.0);
        k += select(0.0, max(ceil(look.steps), 1.0), look.is_empty);
        // After a jump it may show nothing; then the block that it is in is looked at next.
        let place = first_place + step_place * k;
        seen = gather(seen, place, k, k > end);
        seen = gather(seen, place + step_place, k + 1.0, k + 1.0 > end);
        k += 2.0;
#endif
        continuing {
            break if seen.opacity > OPAQUE || k > end;
        }
    }
    let end_m = min(k, end) * volume.step_m;
    let mean_m = seen.depth * volume.step_m / max(seen.opacity, 1e-6);
    let is_empty = seen.opacity < 1.0 / 512.0;
    var gradient = seen.gradient;
#ifdef DEFORMED
#ifdef LIT
    gradient = shown_gradient(gradient, ray.origin + ray.along * mean_m);
#endif
#endif
    return Buffers(
        vec4(seen.colour, seen.opacity),
        select(vec4(normal_of(gradient, ray), relative_depth(mean_m)), vec4(0.0, 0.0, 0.0, NOTHING), is_empty),
        vec2(mean_m, end_m),
    );
}
