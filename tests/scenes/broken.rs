//! Files that are no scenes: one clear error, no panic, and a world that stays as it was.

use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::{SceneError, SceneVersion, load_scene, scene_text};
use bevy_surgery::testing::TestApp;

const FILE: &str = "theatre.scn.ron";

fn scene() -> String {
    let mut app = TestApp::cpu();
    app.world_mut().spawn((Skin::liver(), Highlights::default(), Name::new("liver")));
    app.world_mut().spawn((Tool::new(ToolKind::Drill(DrillHead::default())), Transform::default()));
    scene_text(app.world()).expect("a scene")
}

/// The error of a text, which has spawned nothing.
fn refused(app: &mut TestApp, text: &str) -> SceneError {
    let count = |app: &TestApp| app.world().entities().count_spawned();
    let before = count(app);
    let error = match load_scene(app.world_mut(), FILE, text) {
        Ok(_) => panic!("it was taken:\n{text}"),
        Err(error) => error,
    };
    assert_eq!(count(app), before, "{error}");
    assert!(error.to_string().starts_with(FILE), "{error}");
    error
}

#[test]
fn cut_files_are_refused_wherever_they_end() {
    let text = scene();
    let mut app = TestApp::cpu();
    let text = text.trim_end();
    for end in (0..text.len()).filter(|end| text.is_char_boundary(*end)) {
        assert!(matches!(refused(&mut app, &text[..end]), SceneError::Broken { .. }));
    }
    load_scene(app.world_mut(), FILE, text).expect("the whole of it is a scene");
}

#[test]
fn faults_are_named_with_file_component_and_reason() {
    let text = scene();
    let mut app = TestApp::cpu();
    let cases = [
        ("skin::Skin\"", "skin::Pelt\"", "skin::Pelt", "no registration found"),
        ("mottle: ", "mottle: \"much\" ,mottled: ", "skin::Skin", "Expected float"),
        ("mottle: ", "motley: ", "skin::Skin", "motley"),
        ("Generated((", "Woven((", "skin::Skin", "Woven"),
        ("kind: Drill((", "kind: Chisel((", "tools::tool::Tool", "Chisel"),
        ("flutes: 8", "flutes: -8", "tools::tool::Tool", "out of bounds"),
        ("\"liver\"", "7", "bevy_ecs::name::Name", "string"),
    ];
    for (from, to, component, reason) in cases {
        let broken = text.replacen(from, to, 1);
        assert_ne!(broken, text, "{from} is not in the scene");
        let error = refused(&mut app, &broken);
        let SceneError::Broken { line, component: Some(found), reason: told, .. } = &error else { panic!("{error:?}") };
        assert!(found.ends_with(component), "{error} should name {component}");
        assert!(told.contains(reason), "{error} should say {reason}");
        let place = 1 + text[..text.find(from).expect("it is there")].matches('\n').count();
        assert!(line.abs_diff(place) <= 1, "{error}: it is in line {place}");
    }
}

#[test]
fn what_cannot_be_spawned_is_refused() {
    let mut app = TestApp::cpu();
    let with = |components: &str| format!("(resources: {{}}, entities: {{3: (components: {{{components}}})}})");
    let pool = refused(&mut app, &with("\"bevy_surgery::pool::component::Pool\": (size: (8, 8), cell_m: 0.001)"));
    assert_eq!(
        pool.to_string(),
        "theatre.scn.ron: bevy_surgery::pool::component::Pool of entity 3 lacks the field volume"
    );
    let data = refused(&mut app, &with("\"bevy_surgery::tools::tool::Jaws\": ()"));
    assert!(data.to_string().ends_with("bevy_surgery::tools::tool::Jaws of entity 3 is no component"), "{data}");
    let lattice = "\"bevy_surgery::deform::lattice::field::DeformLattice\": ";
    let (identity, flat) = ("(1,0,0,0,1,0,0,0,1,0,0,0)", "(0,0,0,0,0,0,0,0,0,0,0,0)");
    for (value, reason) in [
        (format!("(body_from_box: {identity}, tree: Uniform(30))"), "level"),
        (format!("(body_from_box: {flat}, tree: Uniform(1))"), "box"),
        (format!("(body_from_box: {identity}, tree: Uniform(0), translations: [(0,0,0)])"), "translations"),
        (format!("(body_from_box: {identity}, tree: Patches([(level: 1, cell: (0, 0, 0))]))"), "patch"),
        (format!("(body_from_box: {identity}, tree: Patches([(level: 1, cell: (4, 0, 0))]))"), "patch"),
        (format!("(body_from_box: {identity}, tree: Patches([]))"), "patch"),
    ] {
        let told = refused(&mut app, &with(&format!("{lattice}{value}"))).to_string();
        assert!(told.contains("DeformLattice") && told.contains(reason), "{told} should speak of {reason}");
    }
}

#[test]
fn scenes_from_the_future_are_refused() {
    let newer = format!("minor: {}", SceneVersion::NOW.minor + 1);
    let text = scene().replacen(&format!("minor: {}", SceneVersion::NOW.minor), &newer, 1);
    let error = refused(&mut TestApp::cpu(), &text);
    assert!(matches!(error, SceneError::OtherVersion { .. }), "{error}");
    assert!(error.to_string().contains("use a version of the crate that wrote it"), "{error}");
}

/// Brackets without end must not end the program.
#[test]
fn deep_files_do_no_harm() {
    let deep = "(".repeat(200_000);
    refused(
        &mut TestApp::cpu(),
        &format!("(resources: {{}}, entities: {{1: (components: {{\"bevy_ecs::name::Name\": {deep}"),
    );
}
