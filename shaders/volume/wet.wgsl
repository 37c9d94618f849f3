// Wet shading: the colour that a volume shows under its lights, diffuse by its own normals, shiny by smoothed ones, as if a
// thin film of fluid lay over it (paper of 2009, section 5.4). CPU twin: `volume/software/shade.rs`.

#import bevy_render::view::View
#import bevy_surgery::lights::incident
#import bevy_surgery::volume::{NOTHING, covering_triangle, ray_through, volume, world_of}

@group(0) @binding(0) var<uniform> view: View;
@group(2) @binding(0) var colours: texture_2d<f32>;
@group(2) @binding(1) var relief: texture_2d<f32>;
@group(2) @binding(2) var smoothed: texture_2d<f32>;
@group(2) @binding(3) var depths_m: texture_2d<f32>;

const PI: f32 = 3.141592653589793;

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return covering_triangle(index);
}

// Radiance times the view's exposure, or the volume's own colour; premultiplied.
@fragment
fn fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let texel = vec2<i32>(at.xy);
    let colour = textureLoad(colours, texel, 0);
    let own = textureLoad(relief, texel, 0);
    let film = textureLoad(smoothed, texel, 0).xyz;
    let ray = ray_through(at.xy);
    let position_world_m = world_of(ray.origin + ray.along * textureLoad(depths_m, texel, 0).r);
    let eye = -normalize((volume.world_from_voxel * vec4(ray.along, 0.0)).xyz);
    let normal = normalize(mix(own.xyz, film, volume.diffuse_smoothing));
    var diffuse = volume.lights.ambient * PI;
    var shine = vec3(0.0);
    // Pixels that show nothing leave after one light.
    var k = select(0u, volume.lights.count, own.w == NOTHING);
    loop {
        let light = volume.lights.lights[min(k, 9u)];
        let beam = incident(light, position_world_m);
        diffuse += beam.illuminance_lux * (max(dot(normal, beam.to_light), 0.0) + light.ambient_fraction);
        let halfway = normalize(beam.to_light + eye);
        let lobe = pow(max(dot(film, halfway), 0.0), volume.shine_exponent) * (volume.shine_exponent + 2.0) * 0.125;
        let facing = 1.0 - max(dot(eye, halfway), 0.0);
        let fresnel = 0.02 + 0.98 * facing * facing * facing * facing * facing;
        shine += beam.illuminance_lux * max(dot(film, beam.to_light), 0.0) * lobe * fresnel;
        k++;
        continuing {
            break if k >= volume.lights.count;
        }
    }
    let radiance = (colour.rgb * diffuse + colour.a * volume.shine * shine) / PI;
    // What no light falls on is shown as it is.
    let shown = select(colour.rgb, radiance * view.exposure, volume.is_shaded > 0.5);
    return select(vec4(shown, colour.a), vec4(0.0), own.w == NOTHING);
}
