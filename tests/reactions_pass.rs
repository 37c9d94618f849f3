//! The reactions pass against the map on the CPU, and layers of a user's own between the crate's.

mod elastic;

use crate::support::{place_towards, plain_skin, real_mesh, sphere_organ, told};
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{OrthographicProjection, RenderTarget, ScalingMode, Viewport};
use bevy::core_pipeline::schedule::Core3d;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::render::render_resource::{BindGroup, BindGroupLayoutDescriptor, BlendState, PipelineCache};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems};
use bevy_surgery::organ::render::{
    OrganDraw, OrganGloss, OrganLayer, OrganLayerView, OrganLayouts, PrepareOrgans, prepare_layer_pipelines,
};
use bevy_surgery::organ::texture_mesh::TextureMeshOptions;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::kind::{Ageing, SpriteFate, SpriteLook};
use bevy_surgery::reactions::snake::Sprite;
use bevy_surgery::testing::TestApp;
use image::RgbaImage;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

const SIZE: u32 = 96;
const RADIUS_M: f32 = 0.1;

/// A disk of one colour that stays as it is.
struct Paint {
    colour: [u8; 3],
    opacity: u8,
}

impl ReactionKind for Paint {
    fn name(&self) -> &str {
        "paint"
    }

    fn profile(&self, _: f32) -> f32 {
        1.0
    }

    fn look(&self, _: &Sprite) -> SpriteLook {
        SpriteLook { colour: self.colour, gloss: 255, opacity: self.opacity }
    }

    fn age(&self, _: &mut Sprite, _: &Ageing) -> SpriteFate {
        SpriteFate::Stays
    }
}

/// A grey sphere under light from all sides only, with a camera on a direction.
fn sphere_app(eye: Vec3) -> (TestApp, Entity) {
    told("");
    let mut app = TestApp::gpu(SIZE, SIZE);
    app.insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight { brightness: 1000.0, ..GlobalAmbientLight::NONE });
    app.spawn_camera(Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Y));
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    let organ = app.world_mut().spawn((Organ(organ), plain_skin([128, 128, 128]), Reactions::default())).id();
    app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
    (app, organ)
}

fn model_of(app: &TestApp, organ: Entity) -> OrganModel {
    let handle = app.world().get::<Organ>(organ).expect("an organ").0.clone();
    app.world().resource::<Assets<OrganModel>>().get(&handle).expect("it is loaded").clone()
}

fn start(app: &mut TestApp, organ: Entity, kind: KindId, direction: DVec3, radius_m: f32) {
    let point = place_towards(app, organ, direction);
    let action = ReactionAction::Start { kind, radius_m, volume_m3: 1e-8 };
    app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
}

/// Premultiplied colour of the map at texture coordinates, between texels, in shares of 255.
fn sampled(map: &ReactionModel, uv: bevy::math::DVec2) -> [f64; 4] {
    let size = map.size();
    let (x, y) = (uv.x * f64::from(size.width_px) - 0.5, uv.y * f64::from(size.height_px) - 0.5);
    let mut sum = [0.0; 4];
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (column, row) = (x.floor() as i64 + dx, y.floor() as i64 + dy);
        let share = |from: f64, one: i64| if one == 1 { from - from.floor() } else { 1.0 - (from - from.floor()) };
        let column = column.rem_euclid(i64::from(size.width_px)) as usize;
        let row = row.clamp(0, i64::from(size.height_px) - 1) as usize;
        let texel = map.map().colour()[row * size.width_px as usize + column];
        for (sum, value) in sum.iter_mut().zip(texel) {
            *sum += share(x, dx) * share(y, dy) * f64::from(value) / 255.0;
        }
    }
    sum
}

fn linear(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Every pixel of the sphere shows what the CPU's map has there, blended over the skin.
fn assert_shows_the_map(app: &mut TestApp, organ: Entity, eye: Vec3) {
    let picture = app.capture();
    let model = model_of(app, organ);
    let shape = app.world().get::<OrganShape>(organ).expect("a shape");
    let picker = bevy_surgery::organ::pick::OrganPicker::build(&model.mesh.triangles, shape.positions_m());
    let map = app.world().get::<ReactionModel>(organ).expect("it reacts");
    let camera = Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Y);
    // What the plain skin alone shows, from a pixel far from all paint.
    let extent = (std::f32::consts::PI / 8.0).tan();
    let exposure = f64::from(bevy::camera::Exposure::default().exposure());
    let light = 1000.0 * exposure;
    let skin = linear(128.0 / 255.0);
    let (mut painted, mut compared) = (0, 0);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let ndc = |at: u32| (at as f32 + 0.5) / SIZE as f32 * 2.0 - 1.0;
        let along = camera.rotation * Vec3::new(ndc(x) * extent, -ndc(y) * extent, -1.0).normalize();
        let Some(hit) = picker.cast_ray(eye.as_dvec3(), along.as_dvec3(), 10.0) else { continue };
        if hit.face_normal.dot(-along.as_dvec3()) < 0.3 {
            continue;
        }
        let [red, green, blue, alpha] = sampled(map, model.atlas.uv(hit.point));
        for (channel, value) in [red, green, blue].into_iter().enumerate() {
            let albedo = if alpha > 0.002 { linear((value / alpha).min(1.0)) } else { 0.0 };
            let wanted = light * (alpha * albedo + (1.0 - alpha) * skin);
            let got = linear(f64::from(pixel.0[channel]) / 255.0);
            assert!(
                (got - wanted).abs() < 0.02 * wanted + 0.006,
                "pixel {x},{y} channel {channel}: {got} instead of {wanted} (opacity {alpha})"
            );
        }
        painted += u32::from(alpha > 0.3);
        compared += 1;
    }
    assert!(compared > 1500 && painted > 100, "{painted} of {compared} pixels show paint: this test sees too little");
}

#[test]
fn the_gpu_shows_the_map_of_the_cpu() {
    // From the side, over the date line, and on both poles.
    for eye in
        [Vec3::new(0.4, 0.0, 0.05), Vec3::new(0.02, 0.1, 0.4), Vec3::new(0.0, 0.41, 0.01), Vec3::new(0.0, -0.41, 0.01)]
    {
        let (mut app, organ) = sphere_app(eye);
        let red = app.add_reaction_kind(Paint { colour: [200, 20, 10], opacity: 255 });
        let pale = app.add_reaction_kind(Paint { colour: [250, 230, 200], opacity: 120 });
        let towards = eye.as_dvec3().normalize();
        start(&mut app, organ, red, towards, 0.02);
        start(&mut app, organ, pale, towards + DVec3::new(0.15, 0.1, 0.2), 0.03);
        start(&mut app, organ, red, towards + DVec3::new(-0.3, 0.3, -0.2), 0.008);
        app.step(1);
        assert_shows_the_map(&mut app, organ, eye);
    }
}

#[test]
fn what_changes_later_arrives_as_well() {
    let eye = Vec3::new(0.3, 0.2, 0.2);
    let (mut app, organ) = sphere_app(eye);
    let toward = eye.as_dvec3().normalize();
    for k in 0..5 {
        let aside = DVec3::new(0.0, 0.2, 0.1 * f64::from(k) - 0.2);
        start(&mut app, organ, KindId::BLOOD, toward + aside, 0.0);
        // Several steps between two frames that are looked at.
        app.step(7);
        app.capture();
    }
    start(&mut app, organ, KindId::WHITENING, toward, 0.02);
    app.step(25);
    let red = app.add_reaction_kind(Paint { colour: [200, 20, 10], opacity: 200 });
    start(&mut app, organ, red, toward, 0.02);
    app.step(1);
    assert_shows_the_map(&mut app, organ, eye);
}

#[test]
fn an_exchanged_organ_shows_nothing_old() {
    let eye = Vec3::new(0.0, 0.0, 0.4);
    let (mut app, organ) = sphere_app(eye);
    let clean = app.capture();
    let red = app.add_reaction_kind(Paint { colour: [200, 20, 10], opacity: 255 });
    start(&mut app, organ, red, DVec3::Z, 0.02);
    app.step(1);
    assert_ne!(app.capture(), clean);
    let again = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
    app.world_mut().entity_mut(organ).insert(Organ(again));
    app.step(2);
    assert_eq!(app.capture(), clean);
    // And what nobody shows any more is freed.
    start(&mut app, organ, red, DVec3::Z, 0.02);
    app.step(1);
    app.idle();
    let maps = |app: &TestApp| app.sub_app(RenderApp).world().resource::<OrganGloss>().maps.len();
    assert_eq!(maps(&app), 1);
    app.world_mut().entity_mut(organ).remove::<Reactions>();
    app.step(2);
    assert!(app.world().get::<ReactionModel>(organ).is_none());
    assert_eq!(maps(&app), 0);
    assert_eq!(app.capture(), clean);
    app.world_mut().entity_mut(organ).insert(Reactions::default());
    app.step(1);
    start(&mut app, organ, red, DVec3::Z, 0.02);
    app.step(1);
    assert_eq!(maps(&app), 1);
    app.world_mut().despawn(organ);
    app.step(2);
    assert_eq!(maps(&app), 0);
}

/// A layer of a user: paints the whole organ in one colour.
struct Film;

#[derive(Resource)]
struct FilmGroup(BindGroup);

const FILM_WGSL: &str = "
#import bevy_surgery::organ::{CornerVertex, secondary_vertex, view}
@vertex
fn vertex(corner: CornerVertex) -> @invariant @builtin(position) vec4<f32> {
    return view.clip_from_world * vec4(secondary_vertex(corner).position_world_m, 1.0);
}
@fragment
fn fragment() -> @location(0) vec4<f32> {
    return vec4(0.0, 1.0, 0.0, 1.0);
}";

/// Puts [`Film`] between the skin and the reactions.
fn add_film(app: &mut TestApp, is_under_reactions: bool) {
    let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(Shader::from_wgsl(FILM_WGSL, "film.wgsl"));
    let init = move |mut commands: Commands, layouts: Res<OrganLayouts>| {
        let own = BindGroupLayoutDescriptor::new("film_layout", &[]);
        let blend = Some(BlendState::ALPHA_BLENDING);
        commands.insert_resource(OrganLayer::<Film>::new("film", &layouts, vec![own], shader.clone(), blend));
    };
    let group =
        |mut commands: Commands, layer: Res<OrganLayer<Film>>, cache: Res<PipelineCache>, device: Res<RenderDevice>| {
            let layout = cache.get_bind_group_layout(&layer.own_groups[0]);
            let entries: &[bevy::render::render_resource::BindGroupEntry] = &[];
            commands.insert_resource(FilmGroup(device.create_bind_group("film", &layout, entries)));
        };
    let draw =
        |view: ViewQuery<OrganLayerView<Film>>, organs: OrganDraw, own: Res<FilmGroup>, mut ctx: RenderContext| {
            organs.draw("film", view, &mut ctx, |_| Some(&own.0));
        };
    let render_app = app.sub_app_mut(RenderApp);
    render_app
        .add_systems(RenderStartup, init.after(PrepareOrgans))
        .add_systems(Render, prepare_layer_pipelines::<Film>.in_set(RenderSystems::PrepareResources))
        .add_systems(Render, group.in_set(RenderSystems::PrepareBindGroups));
    if is_under_reactions {
        render_app.add_systems(Core3d, draw.after(OrganPasses::Skin).before(OrganPasses::Reactions));
    } else {
        render_app.add_systems(Core3d, draw.after(OrganPasses::Reactions).before(OrganPasses::Highlights));
    }
}

#[test]
fn a_layer_of_ones_own_goes_between_two_of_the_crate() {
    for is_under in [true, false] {
        let mut app = TestApp::gpu(SIZE, SIZE);
        add_film(&mut app, is_under);
        app.insert_resource(GlobalAmbientLight { brightness: 1000.0, ..GlobalAmbientLight::NONE });
        app.spawn_camera(Transform::from_xyz(0.0, 0.0, 0.4));
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(RADIUS_M));
        let organ = app.world_mut().spawn((Organ(organ), plain_skin([128, 128, 128]), Reactions::default())).id();
        app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
        let red = app.add_reaction_kind(Paint { colour: [255, 0, 0], opacity: 255 });
        start(&mut app, organ, red, DVec3::Z, 0.02);
        app.step(1);
        let picture = app.capture();
        let (middle, aside) = (picture.get_pixel(SIZE / 2, SIZE / 2).0, picture.get_pixel(SIZE / 2, SIZE / 3).0);
        assert_eq!(aside[..3], [0, 255, 0], "the film covers the skin");
        if is_under {
            assert!(middle[0] > 40 && middle[1] < 10, "blood covers the film: {middle:?}");
        } else {
            assert_eq!(middle[..3], [0, 255, 0], "the film covers the blood");
        }
    }
}

/// Sites seen at a time, each along its normal in a picture of its own.
const COLUMNS: u32 = 10;
const ROWS: u32 = 5;
const VIEW_PX: u32 = 64;
const DISK_M: f32 = 0.002;

/// Axis ratio and share of the asked area of disks of 2 mm at random sites, as they look along the normal.
fn rendered_disks(model: &OrganModel, sites: usize) -> Vec<(f64, f64)> {
    let mut random = Pcg32::seed_from_u64(7);
    let areas: Vec<f64> = (0..model.mesh.triangles.len() as u32).map(|face| model.mesh.face_area_m2(face)).collect();
    let total: f64 = areas.iter().sum();
    let shape = OrganShape::at_rest(model);
    let surface = model.surface(&shape);
    let mut site = move || {
        let mut left = random.random_range(0.0..total);
        let face = areas.iter().position(|area| {
            left -= area;
            left < 0.0
        });
        let (a, b): (f64, f64) = (random.random(), random.random());
        let (a, b) = if a + b > 1.0 { (1.0 - a, 1.0 - b) } else { (a, b) };
        SurfacePoint { face: face.unwrap_or(0) as u32, barycentric: DVec3::new(a, b, 1.0 - a - b) }
    };
    let view_m = 3.0 * DISK_M;
    let mut app = TestApp::gpu(COLUMNS * VIEW_PX, ROWS * VIEW_PX);
    app.insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight { brightness: 1000.0, ..GlobalAmbientLight::NONE });
    let white = app.add_reaction_kind(Paint { colour: [255, 255, 255], opacity: 255 });
    let handle = app.world_mut().resource_mut::<Assets<OrganModel>>().add(model.clone());
    let mut seen = Vec::new();
    while seen.len() < sites {
        let organ = app
            .world_mut()
            .spawn((
                Organ(handle.clone()),
                plain_skin([0, 0, 0]),
                Reactions { map_width_px: 2048, max_touches_per_step: 100, ..default() },
            ))
            .id();
        app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
        // Disks that do not reach into each other's pictures.
        let mut points: Vec<SurfacePoint> = Vec::new();
        for _ in 0..5000 {
            let point = site();
            let at = surface.position_m(point);
            if points.iter().all(|&other| surface.position_m(other).distance(at) > 1.2 * f64::from(view_m)) {
                points.push(point);
            }
            if points.len() == ((COLUMNS * ROWS) as usize).min(sites - seen.len()) {
                break;
            }
        }
        let mut cameras = Vec::new();
        for (number, &point) in points.iter().enumerate() {
            let action = ReactionAction::Start { kind: white, radius_m: DISK_M, volume_m3: 0.0 };
            app.world_mut().write_message(OrganTouch { organ, point, instrument: 0, action });
            let (at, normal) = (surface.position_m(point).as_vec3(), surface.normal(point).as_vec3());
            let projection = OrthographicProjection {
                near: 0.0,
                far: 0.004,
                scaling_mode: ScalingMode::Fixed { width: view_m, height: view_m },
                ..OrthographicProjection::default_3d()
            };
            let corner = UVec2::new(number as u32 % COLUMNS, number as u32 / COLUMNS) * VIEW_PX;
            let camera = Camera {
                order: number as isize,
                viewport: Some(Viewport {
                    physical_position: corner,
                    physical_size: UVec2::splat(VIEW_PX),
                    ..default()
                }),
                is_active: false,
                clear_color: if number == 0 { ClearColorConfig::Default } else { ClearColorConfig::None },
                ..default()
            };
            let target = RenderTarget::Image(app.target().image.into());
            let up = normal.any_orthonormal_vector();
            let place = Transform::from_translation(at + 0.002 * normal).looking_at(at, up);
            cameras.push(
                app.world_mut()
                    .spawn((
                        Camera3d::default(),
                        camera,
                        target,
                        Projection::Orthographic(projection),
                        Tonemapping::None,
                        Msaa::Off,
                        place,
                        RenderLayers::default(),
                    ))
                    .id(),
            );
        }
        app.step(1);
        if seen.is_empty() {
            app.warm_up();
        }
        // Drawn no oftener than is looked at: these are many views of large organs.
        for &camera in &cameras {
            app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = true;
        }
        let picture = app.capture_next_frame();
        for number in 0..points.len() as u32 {
            let corner = UVec2::new(number % COLUMNS, number / COLUMNS) * VIEW_PX;
            seen.push(disk(&picture, corner, f64::from(view_m)));
        }
        for entity in cameras.into_iter().chain([organ]) {
            app.world_mut().despawn(entity);
        }
        app.idle();
    }
    seen
}

/// Axis ratio and share of the asked area of the white disk in a part of a picture.
fn disk(picture: &RgbaImage, corner: UVec2, view_m: f64) -> (f64, f64) {
    let full = (0..VIEW_PX * VIEW_PX)
        .map(|k| picture.get_pixel(corner.x + k % VIEW_PX, corner.y + k / VIEW_PX).0[0])
        .max()
        .unwrap_or(0);
    let (mut sum, mut first, mut second) = (0.0, bevy::math::DVec2::ZERO, [0.0; 3]);
    for y in 0..VIEW_PX {
        for x in 0..VIEW_PX {
            let value = picture.get_pixel(corner.x + x, corner.y + y).0[0];
            let share = linear(f64::from(value) / 255.0) / linear(f64::from(full.max(1)) / 255.0);
            let at = bevy::math::DVec2::new(f64::from(x), f64::from(y));
            sum += share;
            first += share * at;
            for (second, product) in second.iter_mut().zip([at.x * at.x, at.x * at.y, at.y * at.y]) {
                *second += share * product;
            }
        }
    }
    let middle = first / sum;
    let (xx, xy, yy) = (
        second[0] / sum - middle.x * middle.x,
        second[1] / sum - middle.x * middle.y,
        second[2] / sum - middle.y * middle.y,
    );
    let (mean, root) = (0.5 * (xx + yy), (0.25 * (xx - yy).powi(2) + xy * xy).sqrt());
    let pixel_m = view_m / f64::from(VIEW_PX);
    let asked = std::f64::consts::PI * f64::from(DISK_M).powi(2);
    (((mean + root) / (mean - root).max(1e-9)).sqrt(), sum * pixel_m * pixel_m / asked)
}

#[test]
fn disks_look_round_all_over_real_organs() {
    for (name, extent_m) in [("liver-smooth.obj", 0.2), ("gallbladder.stl", 0.1)] {
        let Some(mut mesh) = real_mesh(name) else { continue };
        // Loaded at 20 cm; a gallbladder is half as long.
        mesh.positions_m.iter_mut().for_each(|place| *place *= extent_m / 0.2);
        let texture_mesh = TextureMeshOptions { iterations: 5, tile_sweeps: 2, ..default() };
        let model =
            OrganModel::from_mesh(mesh, name, &OrganOptions { texture_mesh, ..default() }).expect("a real organ");
        let disks = rendered_disks(&model, 500);
        let share = |test: &dyn Fn(&(f64, f64)) -> bool| {
            disks.iter().filter(|disk| test(disk)).count() as f64 / disks.len() as f64
        };
        let round = share(&|(ratio, _)| *ratio < 1.1);
        let right = share(&|(_, area)| (area - 1.0).abs() < 0.1);
        let both = share(&|(ratio, area)| *ratio < 1.1 && (area - 1.0).abs() < 0.1);
        println!("{name}: {round:.3} round, {right:.3} of the right size, {both:.3} both");
        assert!(both >= 0.95, "{name}: {round:.3} round, {right:.3} of the right size, {both:.3} both");
    }
}
