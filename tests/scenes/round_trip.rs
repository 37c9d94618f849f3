//! Scenes with all that hangs together in them.

use super::saved_and_loaded;
use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::{SceneComponents, SceneError, SceneVersion, author_scene, scene_text};
use bevy_surgery::testing::TestApp;
use bevy_surgery::tools::{RigFrame, ToolRig};

#[test]
fn lattices_and_bodies_come_back() {
    let mut app = TestApp::cpu();
    let mut lattice = DeformLattice::new(Vec3::splat(-0.1), Vec3::new(0.1, 0.2, 0.3), 1).expect("a lattice");
    lattice.subdivide(lattice.tree().patches()[3]).expect("a patch");
    let tissues = [ElasticTissue::FAT, ElasticTissue::KIDNEY];
    let body = ElasticBody::new(&lattice, |place_m| bevy_surgery::deform::elastic::ElasticCell {
        tissue: tissues[usize::from(place_m.x > 0.0)],
        fill: if place_m.y > 0.1 { 0.25 } else { 1.0 },
    });
    let mut body = body.expect("a body").pinned_where(|rest_m| rest_m.z < 0.0);
    (body.substeps, body.drag_per_s, body.publishes) = (7, 2.5, false);
    body.rests_under_m_per_s2 = Vec3::new(0.0, -9.81, 0.5);
    lattice.set_from(|place| 0.01 * (place - 0.5)).expect("they are finite");
    let soft = app.world_mut().spawn((lattice.clone(), body.clone())).id();
    let uniform = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 2).expect("a lattice");
    let plain = app.world_mut().spawn(uniform.clone()).id();
    let (text, fresh, map) = saved_and_loaded(&app);
    let (soft, plain) = (map[&soft], map[&plain]);
    let loaded = fresh.world().get::<DeformLattice>(soft).expect("it is back");
    assert_eq!(loaded.tree(), lattice.tree());
    assert_eq!(loaded.translations(), lattice.translations());
    assert_eq!(loaded.body_from_box(), lattice.body_from_box());
    assert_eq!(fresh.world().get::<DeformLattice>(plain), Some(&uniform));
    let again = fresh.world().get::<ElasticBody>(soft).expect("it is back");
    assert_eq!((again.substeps, again.drag_per_s, again.publishes), (7, 2.5, false));
    assert_eq!(again.rests_under_m_per_s2, body.rests_under_m_per_s2);
    assert_eq!(again.tree(), body.tree());
    for cell in 0..body.tree().patches().len() {
        assert_eq!(again.cell(cell), body.cell(cell));
    }
    let pins = |body: &ElasticBody| (0..body.tree().vertex_count()).map(|n| body.is_pinned(n)).collect::<Vec<_>>();
    assert_eq!(pins(again), pins(&body));
    assert!(pins(again).contains(&true) && pins(again).contains(&false));
    // Both go on alike.
    let (mut before, mut after) = (body.clone(), again.clone());
    for _ in 0..10 {
        before.step(1.0 / 60.0, Vec3::NEG_X, &[], &[]);
        after.step(1.0 / 60.0, Vec3::NEG_X, &[], &[]);
    }
    for vertex in 0..before.tree().vertex_count() {
        assert_eq!(before.displacement_m(vertex), after.displacement_m(vertex));
    }
    assert!((0..before.tree().vertex_count()).any(|vertex| before.displacement_m(vertex) != Vec3::ZERO));
    assert!(text.len() < 20_000, "{} bytes", text.len());
}

#[test]
fn entities_are_those_of_the_new_world() {
    let mut app = TestApp::cpu();
    let world = app.world_mut();
    // So that the numbers differ.
    let empty: Vec<Entity> = (0..5).map(|_| world.spawn_empty().id()).collect();
    empty.into_iter().for_each(|entity| assert!(world.despawn(entity)));
    let volume = world.spawn((Name::new("bone"), MakePhantom::default())).id();
    let camera = world.spawn((Name::new("eye"), Transform::from_xyz(0.0, 0.0, 1.0))).id();
    let pool = Pool { cell_m: 2e-4, size: UVec2::new(8, 9), ..Pool::new(volume) };
    let pool = world.spawn((pool, ChildOf(volume))).id();
    let rig = ToolRig { scale: 0.5, ..ToolRig::before_camera(camera, 0.3) };
    let tool = world.spawn((Tool::default(), rig)).id();
    #[cfg(feature = "render")]
    let monitor = world.spawn(MonitorView { of: camera }).id();
    let (_, fresh, map) = saved_and_loaded(&app);
    let world = fresh.world();
    let wanted = Pool { volume: map[&volume], size: UVec2::new(8, 9), cell_m: 2e-4 };
    assert_eq!(world.get::<Pool>(map[&pool]), Some(&wanted));
    assert_eq!(world.get::<Name>(map[&volume]), Some(&Name::new("bone")));
    let parent = world.get::<ChildOf>(map[&pool]).map(ChildOf::parent);
    assert_eq!(parent, Some(map[&volume]));
    let children: Vec<Entity> = world.get::<Children>(map[&volume]).expect("it has one").iter().collect();
    assert_eq!(children, [map[&pool]]);
    let loaded = world.get::<ToolRig>(map[&tool]).expect("a rig");
    assert_eq!(*loaded, ToolRig { frame: RigFrame::Of(map[&camera]), ..rig });
    #[cfg(feature = "render")]
    assert_eq!(world.get::<MonitorView>(map[&monitor]), Some(&MonitorView { of: map[&camera] }));
    assert!(map.iter().any(|(before, after)| before != after), "all had the same numbers: this shows nothing");
}

#[test]
fn what_is_not_saved_is_not_referred_to() {
    let mut app = TestApp::cpu();
    let nobody = app.world_mut().spawn_empty().id();
    let rig = app.world_mut().spawn((Name::new("drill"), ToolRig::before_camera(nobody, 0.1))).id();
    let told = author_scene(app.world()).err().expect("it cannot be kept").to_string();
    assert!(told.starts_with("drill (") && told.contains("ToolRig refers to an entity that is not saved"), "{told}");
    // A group without anything of its own is saved with what hangs from it, and not without.
    app.world_mut().entity_mut(rig).despawn();
    let group = app.world_mut().spawn(Transform::from_xyz(1.0, 0.0, 0.0)).id();
    let bare = app.world_mut().spawn(Transform::default()).id();
    let tool = app.world_mut().spawn((Tool::default(), ChildOf(group))).id();
    let (_, fresh, map) = saved_and_loaded(&app);
    assert!(map.contains_key(&group) && map.contains_key(&tool) && !map.contains_key(&bare));
    assert_eq!(fresh.world().get::<Transform>(map[&group]), Some(&Transform::from_xyz(1.0, 0.0, 0.0)));
}

#[test]
fn handles_lead_to_the_same_files() {
    let mut app = TestApp::cpu();
    let assets = app.world().resource::<AssetServer>().clone();
    let organ = app.world_mut().spawn(Organ(assets.load("nowhere/liver.obj"))).id();
    let volume = app.world_mut().spawn(CtVolume(assets.load("nowhere/bone.nrrd"))).id();
    let (_, fresh, map) = saved_and_loaded(&app);
    let organ = fresh.world().get::<Organ>(map[&organ]).expect("an organ");
    assert_eq!(organ.0.path().map(ToString::to_string).as_deref(), Some("nowhere/liver.obj"));
    let volume = fresh.world().get::<CtVolume>(map[&volume]).expect("a volume");
    assert_eq!(volume.0.path().map(ToString::to_string).as_deref(), Some("nowhere/bone.nrrd"));
}

#[test]
fn an_asset_that_a_program_made_must_be_described() {
    let mut app = TestApp::cpu();
    let options = OrganOptions::default();
    let liver = OrganModel::procedural_liver(&options).expect("a liver");
    let liver = app.world_mut().resource_mut::<Assets<OrganModel>>().add(liver);
    let organ = app.world_mut().spawn((Name::new("liver"), Organ(liver))).id();
    let error = author_scene(app.world()).err().expect("no file has it");
    assert!(matches!(&error, SceneError::NotInAFile { .. }), "{error}");
    let told = error.to_string();
    assert!(told.starts_with("liver (") && told.contains("Organ") && told.contains("put a LoadOrgan"), "{told}");
    app.world_mut().entity_mut(organ).insert(LoadOrgan::default());
    author_scene(app.world()).expect("now it is described");
}

/// A running scene is saved as it was set up, and opens in a fresh program.
#[test]
fn a_running_scene_is_saved_as_it_was_set_up() {
    let mut app = TestApp::cpu();
    let source = OrganSource::Ellipsoid { semi_axes_m: Vec3::new(0.05, 0.04, 0.06), subdivisions: 6 };
    let wanted = LoadOrgan { source, ..default() };
    let organ = app.world_mut().spawn((wanted.clone(), Skin::kidney(), Reactions::default())).id();
    let phantom = MakePhantom(PhantomOptions { size: 32, ..default() });
    let soft = SoftVolume { level: 2, tissue: Some(ElasticTissue::MUSCLE), ..default() };
    let place = Transform::from_xyz(1.0, 0.0, 0.0);
    let volume = app.world_mut().spawn((phantom, soft, WatchCritical::default(), place)).id();
    let is_there = move |app: &mut App, organ: Entity, volume: Entity| {
        let world = app.world();
        world.get::<ReactionModel>(organ).is_some()
            && world.get::<CriticalDistances>(volume).is_some()
            && world.get::<ElasticBody>(volume).is_some()
    };
    app.idle_until("the scene", |app| is_there(app, organ, volume));
    let tool = app.world_mut().spawn(Tool::new(ToolKind::Probe)).id();
    app.world_mut().entity_mut(tool).insert(ToolPose::at(Vec3::new(0.0, 0.0, 0.2), Quat::IDENTITY));
    app.step(5);
    let (text, mut fresh, map) = saved_and_loaded(&app);
    assert!(text.len() < 50_000, "{} bytes", text.len());
    for path in SceneComponents::derived_of_crate() {
        assert!(!text.contains(path), "{path} follows from the rest");
    }
    for made in ["shape::Organ\"", "component::CtVolume\"", "DeformLattice", "ElasticBody", "TransferFunction"] {
        assert!(!text.contains(made), "{made} is made by what asks for it");
    }
    assert!(text.contains("\"bevy_surgery::scenes::version::SceneVersion\": ("));
    let (organ, volume) = (map[&organ], map[&volume]);
    assert_eq!(fresh.world().get::<LoadOrgan>(organ), Some(&wanted));
    fresh.idle_until("the scene again", |app| is_there(app, organ, volume));
    assert_eq!(fresh.world().resource::<SceneVersion>(), &SceneVersion::NOW);
    let model = |app: &TestApp, organ: Entity| {
        let handle = &app.world().get::<Organ>(organ).expect("an organ").0;
        app.world().resource::<Assets<OrganModel>>().get(handle).expect("a model").clone()
    };
    let before = app.world_mut().query_filtered::<Entity, With<LoadOrgan>>().single(app.world()).expect("one");
    assert_eq!(model(&app, before).mesh, model(&fresh, organ).mesh);
    // Saved once more, it is the same: nothing of what was made since came in.
    let again = scene_text(fresh.world()).expect("it can be saved");
    let lines = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(|line| line.trim().to_string()).collect();
        lines.retain(|line| !line.ends_with(": (") || line.contains("::"));
        lines.sort();
        lines
    };
    assert_eq!(lines(&text), lines(&again));
}

/// Components of an app are saved where it asks for it.
#[test]
fn apps_save_what_they_want() {
    #[derive(Component, Reflect, Default, Debug, PartialEq)]
    #[reflect(Component, Default)]
    struct Ward(u32);
    let mut app = TestApp::cpu();
    app.register_type::<Ward>();
    let ward = app.world_mut().spawn((Ward(4), Tool::default())).id();
    assert!(!scene_text(app.world()).expect("a scene").contains("Ward"));
    app.world_mut().resource_mut::<SceneComponents>().author::<Ward>().leave_out::<Tool>();
    let text = scene_text(app.world()).expect("a scene");
    assert!(text.contains("Ward") && !text.contains("tool::Tool\""), "{text}");
    let mut fresh = TestApp::cpu();
    fresh.register_type::<Ward>();
    let map = bevy_surgery::scenes::load_scene(fresh.world_mut(), "test", &text).expect("it loads");
    assert_eq!(fresh.world().get::<Ward>(map[&ward]), Some(&Ward(4)));
}
