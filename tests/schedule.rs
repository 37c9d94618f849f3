//! The order of a step: stages, ambiguities, determinism, members of the group.

use crate::support::sphere_organ;
use bevy::ecs::schedule::{LogLevel, ScheduleBuildSettings};
use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderSystems};
use bevy_surgery::diagnostics::SurgeryDiagnosticsPlugin;
use bevy_surgery::organ::procedural::{ProceduralLiver, procedural_liver};
use bevy_surgery::organ::texture_mesh::SecondaryVertices;
use bevy_surgery::prelude::*;
use bevy_surgery::skin::tiles::assign_tiles;
use bevy_surgery::testing::{TestApp, headless_render_plugins};
use std::collections::BTreeMap;

#[derive(Resource, Default)]
struct Log(Vec<SurgerySystems>);

#[test]
fn stages_run_in_their_order() {
    use SurgerySystems::{Cut, Deform, Flow, Judge, Publish, React, Sense, Touch};
    let order = [Sense, Touch, Cut, Deform, React, Flow, Judge, Publish];
    let mut app = TestApp::cpu();
    app.init_resource::<Log>();
    // Added back to front, so that the order can only come from the sets.
    for stage in order.into_iter().rev() {
        app.add_systems(FixedUpdate, (move |mut log: ResMut<Log>| log.0.push(stage)).in_set(stage));
    }
    app.step(2);
    assert_eq!(app.world().resource::<Log>().0, [order, order].concat());
}

#[test]
fn the_step_rate_is_60_hz_unless_set() {
    let rate = |app: &App| 1.0 / app.world().resource::<Time<Fixed>>().timestep().as_secs_f64();
    assert!((rate(&TestApp::cpu()) - 60.0).abs() < 1e-3);
    let mut app = App::new();
    app.insert_resource(Time::<Fixed>::from_hz(250.0)).add_plugins((MinimalPlugins, SurgerySchedulePlugin::default()));
    assert!((rate(&app) - 250.0).abs() < 1e-3, "an app's own rate is kept");
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, SurgerySchedulePlugin { steps_per_second: Some(120.0) }));
    assert!((rate(&app) - 120.0).abs() < 1e-3);
    let mut app = App::new();
    app.insert_resource(Time::<Fixed>::from_hz(250.0));
    app.add_plugins((MinimalPlugins, SurgerySchedulePlugin { steps_per_second: Some(120.0) }));
    assert!((rate(&app) - 120.0).abs() < 1e-3, "a rate that is asked for counts");
}

#[test]
fn members_can_be_left_out() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()))
        .add_plugins(SurgeryPlugins.build().disable::<SkinPlugin>().disable::<OrganPlugin>());
    app.finish();
    app.cleanup();
    app.update();
    assert!(app.world().get_resource::<Assets<OrganModel>>().is_none());
}

/// How many pairs of systems share data in an order that is left open, per schedule.
fn ambiguities(app: &mut SubApp) -> BTreeMap<String, usize> {
    let world = app.world_mut();
    let labels: Vec<_> = world.resource::<Schedules>().iter().map(|(_, schedule)| schedule.label()).collect();
    let mut found = BTreeMap::new();
    for label in labels {
        world.schedule_scope(label, |world, schedule| {
            let mut settings: ScheduleBuildSettings = schedule.get_build_settings();
            settings.ambiguity_detection = LogLevel::Warn;
            schedule.set_build_settings(settings);
            schedule.initialize(world).expect("the schedule builds").expect("it was not built before");
            found.insert(format!("{label:?}"), schedule.graph().conflicting_systems().len());
        });
    }
    found
}

/// Bevy's plugins with or without ours; both worlds' open orders.
fn both_worlds(add: impl FnOnce(&mut App)) -> [BTreeMap<String, usize>; 2] {
    let mut app = App::new();
    app.add_plugins(headless_render_plugins())
        .add_plugins((bevy::pbr::PbrPlugin::default(), bevy::audio::AudioPlugin::default()));
    add(&mut app);
    app.finish();
    app.cleanup();
    let main = ambiguities(app.main_mut());
    let render = app.sub_app_mut(RenderApp);
    render.init_resource::<bevy::render::MainWorld>();
    [main, ambiguities(render)]
}

/// Schedules that have more open orders than Bevy's own, and how many more.
fn more_than(bevys: &BTreeMap<String, usize>, ours: &BTreeMap<String, usize>) -> Vec<String> {
    let own = |label: &String| bevys.get(label).copied().unwrap_or_default();
    ours.iter()
        .filter(|(label, count)| **count > own(label))
        .map(|(label, count)| format!("{label}: {}", count - own(label)))
        .collect()
}

// Which systems they are Bevy tells only with its feature `debug`.
#[test]
fn no_order_is_left_open_in_either_world() {
    let bevys = both_worlds(|_| {});
    let ours = both_worlds(|app| {
        app.add_plugins((SurgeryPlugins, SurgeryDiagnosticsPlugin));
    });
    for (bevys, ours) in bevys.iter().zip(&ours) {
        assert_eq!(more_than(bevys, ours), Vec::<String>::new());
    }
}

#[test]
fn an_open_order_is_noticed() {
    let bevys = both_worlds(|_| {});
    let ours = both_worlds(|app| {
        app.add_plugins(SurgeryPlugins).init_resource::<Log>();
        let clear = |mut log: ResMut<Log>| log.0.clear();
        let push = |mut log: ResMut<Log>| log.0.push(SurgerySystems::Touch);
        app.add_systems(FixedUpdate, (clear.in_set(SurgerySystems::Touch), push.in_set(SurgerySystems::Touch)));
        let render = app.sub_app_mut(RenderApp);
        render.init_resource::<Log>();
        render.add_systems(Render, (clear.in_set(RenderSystems::Queue), push.in_set(RenderSystems::Queue)));
    });
    assert_eq!(more_than(&bevys[0], &ours[0]), ["FixedUpdate: 1"]);
    assert_eq!(more_than(&bevys[1], &ours[1]), ["Render: 1"]);
}

/// A scene in which everything of this crate moves; returns the bits of its state after 600 steps: the shape, and what
/// is drawn of it.
fn run_600_steps(seed: u64) -> Vec<u32> {
    let mut app = TestApp::cpu();
    let organ = app.world_mut().resource_mut::<Assets<OrganModel>>().add(sphere_organ(0.1));
    app.world_mut().spawn((Organ(organ), Skin { seed, ..Skin::liver() }));
    app.add_systems(
        FixedUpdate,
        (move |time: Res<Time>, mut shapes: Query<&mut OrganShape>| {
            for mut shape in &mut shapes {
                for position in shape.move_vertices() {
                    let wave = (40.0 * position.x + time.elapsed_secs() + seed as f32).sin();
                    *position *= 1.0 + 0.001 * wave;
                }
            }
        })
        .in_set(SurgerySystems::Deform),
    );
    app.step(600);
    let mut organs = app.world_mut().query::<(&Organ, &OrganShape)>();
    let (organ, shape) = organs.single(app.world()).expect("one organ");
    let model = app.world().resource::<Assets<OrganModel>>().get(&organ.0).expect("its model");
    let secondary = SecondaryVertices::new(&model.skin_mesh.secondary);
    let (mut positions, mut normals) = (vec![Vec3::ZERO; secondary.len()], vec![Vec3::ZERO; secondary.len()]);
    secondary.update(shape.positions_m(), shape.normals(), &mut positions, &mut normals).expect("long enough");
    let vectors = [shape.positions_m(), shape.normals(), &positions, &normals].into_iter().flatten();
    vectors.flat_map(|vector| vector.to_array()).map(f32::to_bits).collect()
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let first = run_600_steps(7);
    assert_eq!(first, run_600_steps(7), "two runs in one process differ: something is not deterministic");
    assert_ne!(first, run_600_steps(8), "the scene does not depend on its seed: this test would see nothing");
}

#[test]
fn an_organ_built_anew_has_the_same_bits() {
    // The crate's own liver is not star-shaped, so that every step of the chart is taken. Built past the cache.
    let build = |seed| {
        let mut options = OrganOptions { table_width_px: 256, ..default() };
        options.texture_mesh.seed = seed;
        let mesh = procedural_liver(&ProceduralLiver::default());
        let organ = OrganModel::from_mesh(mesh, "liver", &options).expect("an organ");
        let choices = assign_tiles(&organ.texture_mesh.triangulation.neighbours, seed);
        let tiles: Vec<[u8; 2]> = choices.iter().map(|choice| [choice.tile, choice.rotation]).collect();
        // Numbers are written in full, so that equal text means equal bits.
        let parts = (&organ.mesh, organ.atlas.chart(), &organ.texture_mesh, &organ.skin_mesh, &organ.report);
        serde_json::to_string(&(parts, &organ.table.faces, tiles)).expect("plain numbers")
    };
    let first = build(3);
    assert!(first == build(3), "two organs built in one process differ");
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    assert!(first == alone.install(|| build(3)), "the organ depends on the number of threads");
    assert!(first != build(4), "the organ does not depend on its seed: this test would see nothing");
}
