//! The reaction stage with 10 and with 100 rolling drops, and the passes that show it.
//!
//! What is compared takes turns, step by step or frame by frame, so that a machine that slows down slows all of it.

mod turns;

use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::prelude::*;
use bevy_surgery::reactions::drops::DropSettings;
use bevy_surgery::reactions::kinds::Blood;
use bevy_surgery::reactions::model::{StepContext, Touch};
use bevy_surgery::testing::TestApp;
use criterion::{Criterion, criterion_group, criterion_main};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

fn liver() -> OrganModel {
    OrganModel::procedural_liver(&OrganOptions::default()).expect("the crate's own liver")
}

/// Blood that does not come to rest, with trails of 30 sprites while a drop is there, which are soon gone after it.
fn running_blood() -> Blood {
    let drops = DropSettings { retention_at_1_mm_m_per_s2: 0.0, ..default() };
    Blood { drops, fading_time_s: 2.0, stains: false, ..default() }
}

/// A liver on which as many drops are always on their way.
struct Rain {
    organ: OrganModel,
    shape: OrganShape,
    kinds: ReactionKinds,
    model: ReactionModel,
    drops: usize,
    random: Pcg32,
}

impl Rain {
    fn new(drops: usize) -> Self {
        let organ = liver();
        let mut kinds = ReactionKinds::default();
        kinds.replace(KindId::BLOOD, running_blood());
        let settings = Reactions { max_touches_per_step: 1000, ..default() };
        let model = ReactionModel::new(&organ, &settings);
        let shape = OrganShape::at_rest(&organ);
        let mut rain = Self { organ, shape, kinds, model, drops, random: Pcg32::seed_from_u64(5) };
        for _ in 0..240 {
            rain.step();
        }
        rain
    }

    /// A place that looks up.
    fn place(mesh: &SurfaceMesh, random: &mut Pcg32) -> SurfacePoint {
        loop {
            let face = random.random_range(0..mesh.triangles.len() as u32);
            let [a, b, c] = mesh.corners(face);
            if (b - a).cross(c - a).normalize_or_zero().y > 0.2 {
                return SurfacePoint { face, barycentric: DVec3::splat(1.0 / 3.0) };
            }
        }
    }

    fn step(&mut self) {
        let missing = self.drops.saturating_sub(self.model.drop_count(&self.kinds));
        let touches: Vec<Touch> = (0..missing)
            .map(|_| Touch {
                point: Self::place(&self.organ.mesh, &mut self.random),
                instrument: 0,
                action: ReactionAction::Bleed { volume_m3: 1.3e-8 },
            })
            .collect();
        let surface = self.organ.surface(&self.shape);
        let context = StepContext {
            kinds: &self.kinds,
            surface: &surface,
            surface_moved: false,
            is_inside: false,
            gravity_m_per_s2: DVec3::new(0.0, -9.81, 0.0),
            dt_s: 1.0 / 60.0,
        };
        self.model.step(&context, &touches);
    }
}

fn steps(c: &mut Criterion) {
    let counts = [10, 100];
    let mut rains = counts.map(Rain::new);
    let mut sprites = [0, 0];
    let medians = turns::medians_ms(300, &mut rains, |rain| {
        rain.step();
        sprites[usize::from(rain.drops == counts[1])] += rain.model.sprite_count();
    });
    for ((count, median), sprites) in counts.iter().zip(&medians).zip(sprites) {
        println!("{count} drops, {} sprites: {median:.3} ms a step", sprites / 300);
    }
    println!("ratio {:.2}", medians[1] / medians[0]);
    let mut group = c.benchmark_group("reaction step");
    turns::bench_each(&mut group, &["10 drops", "100 drops"], &mut rains, Rain::step);
    group.finish();
}

/// Which layers the liver has.
#[derive(Clone, Copy, PartialEq)]
enum Layers {
    None,
    Skin,
    All,
}

fn app(layers: Layers) -> TestApp {
    let mut app = TestApp::gpu(800, 600);
    let view = Transform::from_xyz(0.0, 0.1, 0.22).looking_at(Vec3::ZERO, Vec3::Y);
    app.spawn_camera(view);
    app.world_mut().spawn((ScopeLight::default(), view));
    if layers != Layers::None {
        let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver());
        let organ = app.world_mut().spawn((Organ(organ), Skin::liver())).id();
        if layers == Layers::All {
            app.world_mut().entity_mut(organ).insert((Reactions::default(), Highlights::default()));
            app.idle_until("the organ", |app| app.world().get::<ReactionModel>(organ).is_some());
            // Ten drops that roll while the frames are drawn.
            let mesh = liver();
            let mut random = Pcg32::seed_from_u64(5);
            app.world_mut().resource_mut::<ReactionKinds>().replace(KindId::BLOOD, running_blood());
            let rain = move |mut touches: MessageWriter<OrganTouch>,
                             kinds: Res<ReactionKinds>,
                             models: Query<&ReactionModel>| {
                let drops: usize = models.iter().map(|model| model.drop_count(&kinds)).sum();
                for _ in drops..10 {
                    let point = Rain::place(&mesh.mesh, &mut random);
                    let action = ReactionAction::Bleed { volume_m3: 1.3e-8 };
                    touches.write(OrganTouch { organ, point, instrument: 0, action });
                }
            };
            app.add_systems(FixedUpdate, rain.in_set(SurgerySystems::Touch));
        }
    }
    app.warm_up();
    app.step(60);
    app
}

fn frames(c: &mut Criterion) {
    let scenes = [(Layers::None, "empty scene"), (Layers::Skin, "skin"), (Layers::All, "all layers")];
    let mut apps: Vec<TestApp> = scenes.iter().map(|(layers, _)| app(*layers)).collect();
    let medians = turns::medians_ms(60, &mut apps, |app| app.step(1));
    let (empty, skin, all) = (medians[0], medians[1], medians[2]);
    println!("empty {empty:.2} ms a frame, skin {:+.2}, reactions and highlights {:+.2}", skin - empty, all - skin);
    let mut group = c.benchmark_group("frame 800x600 with a step");
    group.sample_size(20);
    turns::bench_each(&mut group, &scenes.map(|(_, name)| name), &mut apps, |app| app.step(1));
    group.finish();
}

criterion_group!(benches, steps, frames);
criterion_main!(benches);
