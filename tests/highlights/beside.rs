//! Highlights beside other layers, cameras, lights and settings.

use super::*;

/// A layer of the test's own between the others: covers the organ in green.
struct Green;

const GREEN: &str = "
#import bevy_surgery::organ::{CornerVertex, secondary_vertex, view}
@vertex
fn vertex(corner: CornerVertex) -> @invariant @builtin(position) vec4<f32> {
    return view.clip_from_world * vec4(secondary_vertex(corner).position_world_m, 1.0);
}
@fragment
fn fragment() -> @location(0) vec4<f32> {
    return vec4(0.0, 1.0, 0.0, 1.0);
}
";

#[derive(Resource)]
struct GreenShader(Handle<Shader>);

#[derive(Resource)]
struct GreenGroup(BindGroup);

fn add_green_layer(app: &mut TestApp) {
    let shader = Shader::from_wgsl(GREEN, "tests/green.wgsl");
    let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(shader);
    let init = |mut commands: Commands,
                shader: Res<GreenShader>,
                layouts: Res<OrganLayouts>,
                cache: Res<PipelineCache>,
                device: Res<RenderDevice>,
                done: Option<Res<GreenGroup>>| {
        if done.is_some() {
            return;
        }
        let layout = BindGroupLayoutDescriptor::new("green_layout", &[]);
        let cover = BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::Zero, ..default() };
        let blend = Some(BlendState { color: cover, alpha: cover });
        commands.insert_resource(GreenGroup(device.create_bind_group(
            "green",
            &cache.get_bind_group_layout(&layout),
            &[],
        )));
        commands.insert_resource(OrganLayer::<Green>::new("green", &layouts, vec![layout], shader.0.clone(), blend));
    };
    let draw =
        |view: ViewQuery<OrganLayerView<Green>>, organs: OrganDraw, group: Res<GreenGroup>, mut ctx: RenderContext| {
            organs.draw("green", view, &mut ctx, |_| Some(&group.0));
        };
    app.sub_app_mut(RenderApp)
        .insert_resource(GreenShader(shader))
        .add_systems(Render, init.in_set(RenderSystems::ExtractCommands))
        .add_systems(Render, prepare_layer_pipelines::<Green>.in_set(RenderSystems::PrepareResources))
        .add_systems(Core3d, draw.in_set(OrganPasses::Reactions));
}

#[test]
fn a_layer_between_hides_what_is_under_the_drops_only() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.1), lamp(0.004), at(0.3), 0.3);
    add_green_layer(&mut scene.app);
    let over = scene.picture();
    let middle = (SIZE * SIZE / 2 + SIZE / 2) as usize;
    let green = 1.0 / Exposure::default().exposure();
    assert!(over[middle].x > 1.0 && over[middle].y > green, "the highlight lies over the layer: {}", over[middle]);
    scene.highlights(Highlights { cover: HighlightCover::UnderDrops, ..smooth(0.1) });
    let under = scene.picture();
    assert!((under[middle] - Vec3::Y * green).length() < 1e-3 * green, "the layer hides it: {}", under[middle]);
}

#[test]
fn each_camera_has_its_own_ring() {
    // Two cameras with their lamps at different distances, one picture beside the other.
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.002), lamp(0.01), at(0.25), 0.12);
    let world = scene.app.world_mut();
    let half =
        |x| Viewport { physical_position: UVec2::new(x, 0), physical_size: UVec2::new(SIZE / 2, SIZE), ..default() };
    let image = RenderTarget::Image(scene.image.clone().into());
    let organ = world.get::<Organ>(scene.organ).expect("an organ").0.clone();
    world.entity_mut(scene.scope).insert(Camera { viewport: Some(half(0)), ..default() });
    // The second sees an organ of its own by its own lamp.
    world.spawn((Organ(organ), smooth(0.002), RenderLayers::layer(1)));
    let lens = PerspectiveProjection { fov: 0.12, near: 0.001, ..default() };
    let camera = Camera { viewport: Some(half(SIZE / 2)), order: 1, clear_color: ClearColorConfig::None, ..default() };
    world.spawn((
        (Camera3d::default(), camera, Hdr, Projection::Perspective(lens), image, Tonemapping::None, Msaa::Off),
        (at(0.4), lamp(0.01), RenderLayers::layer(1)),
    ));
    let picture = scene.picture();
    let radius_px = |left: u32| {
        let (mut sum, mut moment) = (0.0, 0.0);
        for (place, pixel) in picture.iter().enumerate() {
            let (x, y) = (place as u32 % SIZE, place as u32 / SIZE);
            if (left..left + SIZE / 2).contains(&x) {
                let away = Vec2::new(x as f32 + 0.5 - (left + SIZE / 4) as f32, y as f32 + 0.5 - (SIZE / 2) as f32);
                (sum, moment) = (sum + pixel.x / away.length(), moment + pixel.x);
            }
        }
        moment / sum
    };
    let wanted = |distance_m: f32| {
        let on_sphere_rad = ring_tilt_rad(0.01, distance_m) / (1.0 + RADIUS_M / distance_m);
        RADIUS_M * on_sphere_rad / distance_m / 0.06 * 0.5 * SIZE as f32
    };
    for (left, distance_m) in [(0, 0.15), (SIZE / 2, 0.3)] {
        let (got, wanted) = (radius_px(left), wanted(distance_m));
        assert!((got / wanted - 1.0).abs() < 0.05, "from {distance_m} m: {got} px instead of {wanted}");
    }
}

#[test]
fn odd_settings_give_a_finite_picture() {
    let mut scene = Scene::new(sphere_organ(RADIUS_M), smooth(0.1), lamp(0.004), at(0.3), 0.5);
    scene.gloss(4, 2, &[0, 255, 128, 200, 255, 0, 64, 255]);
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e-30, 1e30] {
        let highlights = Highlights {
            strength: value.min(1.0),
            dry_roughness: value,
            wet_roughness: value,
            reflectance: value,
            film_relief_m: value,
            grain_tilt: value,
            grain_size_m: value,
            cover: HighlightCover::OverDrops,
        };
        scene.highlights(highlights);
        for ring_radius_m in [value, 0.004] {
            let scope = scene.scope;
            scene.app.world_mut().entity_mut(scope).insert(ScopeLight { ring_radius_m, ..lamp(0.004) });
            // The picture itself is looked at for numbers that are not finite.
            scene.picture();
        }
        scene.app.world_mut().entity_mut(scene.scope).insert(lamp(0.004));
        for scale in [value, 1.0] {
            scene.app.world_mut().entity_mut(scene.organ).insert(Transform::from_scale(Vec3::splat(scale)));
            scene.app.step(1);
        }
    }
    // A lamp on the surface itself, and inside the organ.
    scene.highlights(smooth(0.1));
    for z in [RADIUS_M, 0.0] {
        scene.app.world_mut().spawn((lamp(0.004), at(z)));
        assert!(total(&scene.picture()) > 0.0);
    }
}

#[test]
fn grain_breaks_the_reflection_up_and_keeps_its_light() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.05), lamp(0.004), at(0.3), 0.4);
    let plain = scene.picture();
    scene.highlights(Highlights { grain_tilt: 0.05, grain_size_m: 0.004, ..smooth(0.05) });
    let grainy = scene.picture();
    assert!((total(&grainy) / total(&plain) - 1.0).abs() < 0.2, "{} of {}", total(&grainy), total(&plain));
    let rough = |picture: &[Vec3]| -> f32 {
        picture
            .as_chunks::<{ SIZE as usize }>()
            .0
            .iter()
            .flat_map(|row| row.windows(2))
            .map(|p| (p[0].x - p[1].x).abs())
            .sum()
    };
    assert!(rough(&grainy) > 1.5 * rough(&plain), "{} over {}", rough(&grainy), rough(&plain));
}

#[test]
fn mirrored_and_hollow_organs_reflect_as_well() {
    let mut scene = Scene::new(fine_sphere(RADIUS_M), smooth(0.1), lamp(0.004), at(0.3), 0.5);
    let plain = scene.picture();
    scene.app.world_mut().entity_mut(scene.organ).insert(Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
    let mirrored = scene.picture();
    assert!((total(&mirrored) / total(&plain) - 1.0).abs() < 0.01, "{} of {}", total(&mirrored), total(&plain));
    // From inside, looking at the far wall.
    scene.app.world_mut().entity_mut(scene.organ).insert((Transform::default(), Hollow));
    scene.look(at(0.05), 1.0);
    let inside = scene.picture();
    let middle = inside[(SIZE * SIZE / 2 + SIZE / 2) as usize].x;
    let wall = LightUniform { position_world_m: Vec3::new(0.0, 0.0, 0.05), ..scene.light() };
    let wanted = highlight_radiance(&smooth(0.1), &wall, scene.eye.translation, Vec3::NEG_Z * RADIUS_M, Vec3::Z, 0.5).x;
    assert!((middle / wanted - 1.0).abs() < 0.02, "{middle} instead of {wanted}");
}

#[test]
fn multisampled_and_plain_cameras_show_it() {
    // The same highlight on a dark organ, in 8 bits, with and without HDR and with four samples.
    let mut peaks = Vec::new();
    for (is_hdr, msaa) in [(false, Msaa::Off), (true, Msaa::Off), (false, Msaa::Sample4), (true, Msaa::Sample4)] {
        let mut app = TestApp::gpu(64, 64);
        app.insert_resource(ClearColor(Color::BLACK)).insert_resource(GlobalAmbientLight::NONE);
        let camera = app.spawn_camera(at(0.3));
        app.world_mut().entity_mut(camera).insert((msaa, Tonemapping::Reinhard, lamp(0.004)));
        if is_hdr {
            app.world_mut().entity_mut(camera).insert(Hdr);
        }
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
        let organ = app.world_mut().spawn((Organ(organ), plain_skin([0, 0, 0]), smooth(0.1))).id();
        peaks.push(app.capture().get_pixel(32, 32).0[0]);
        app.world_mut().entity_mut(organ).remove::<Highlights>();
        assert_eq!(app.capture_even_if_black().get_pixel(32, 32).0[0], 0, "a removed component is still drawn");
    }
    assert!(peaks[0] > 60 && peaks[0] < 250, "{peaks:?}");
    assert!(peaks.iter().all(|peak| peak.abs_diff(peaks[0]) <= 3), "{peaks:?}");
}

#[test]
fn a_scope_that_stands_still_sends_nothing() {
    let mut scene = Scene::new(sphere_organ(RADIUS_M), smooth(0.1), lamp(0.004), at(0.3), 0.5);
    scene.app.warm_up();
    let sent = |app: &mut TestApp| {
        app.idle();
        let uploads = app.sub_app(RenderApp).world().resource::<Uploads>();
        (uploads.rectangles(), uploads.bytes())
    };
    let still = sent(&mut scene.app);
    assert_eq!(still.0, 0);
    scene.look(at(0.31), 0.5);
    let moved = sent(&mut scene.app);
    assert_eq!(moved.0, 1, "one table");
    // Rows of 256 half floats, for wet and dry and a few distances.
    assert!((2 * 2 * 512..=2 * 17 * 512 + 512).contains(&(moved.1 - still.1)), "{moved:?}");
    let organ = scene.organ;
    scene.app.world_mut().entity_mut(organ).despawn();
    assert_eq!(total(&scene.picture()), 0.0);
}
