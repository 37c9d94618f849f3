//! Transfer functions, structures, bodies that give way.

use super::{app, panel};
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::deform::elastic::{ElasticBody, ElasticTissue};
use bevy_surgery::panels::{EditHistory, undo};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::phantom::{PhantomOptions, phantom};
use bevy_surgery::volume::structures::{Structure, StructureChanges};
use bevy_surgery::volume::transfer::TransferFunction;
use egui::accesskit::Role;
use egui_kittest::kittest::{NodeT, Queryable};

fn bone(app: &mut TestApp) -> Entity {
    let bone = phantom(&PhantomOptions { size: 64, ..default() }).expect("a phantom");
    let bone = app.world_mut().resource_mut::<Assets<Volume>>().add(bone);
    let entity = app.world_mut().spawn((Name::new("bone"), CtVolume(bone))).id();
    app.step(2);
    entity
}

fn structures(app: &TestApp, entity: Entity) -> Vec<Structure> {
    let body = app.world().get::<CtVolume>(entity).expect("a volume");
    let volume = app.world().resource::<Assets<Volume>>().get(&body.0).expect("loaded");
    volume.structures().expect("named").list().to_vec()
}

#[test]
fn changed_structures_are_those_of_the_volume() {
    let mut app = app();
    let entity = bone(&mut app);
    let before = structures(&app, entity);
    let nerve = before.iter().position(|it| it.name.to_lowercase().contains("facial")).expect("a facial nerve");
    let changed = Structure { hardness: 0.5, is_critical: false, ..before[nerve].clone() };
    app.world_mut().entity_mut(entity).insert(StructureChanges { changes: vec![changed.clone()] });
    app.step(2);
    let after = structures(&app, entity);
    assert_eq!(after[nerve], changed);
    assert_eq!(after[..nerve], before[..nerve], "the others stay");

    // Numbers that make no sense, and names that are none, change nothing.
    let bad = Structure { hardness: -1.0, ..before[nerve].clone() };
    let unknown = Structure { name: "Facial nerv".into(), ..before[nerve].clone() };
    app.world_mut().entity_mut(entity).insert(StructureChanges { changes: vec![bad, unknown] });
    app.step(2);
    assert_eq!(structures(&app, entity), before);

    app.world_mut().entity_mut(entity).insert(StructureChanges { changes: vec![changed] });
    app.step(2);
    app.world_mut().entity_mut(entity).remove::<StructureChanges>();
    app.step(2);
    assert_eq!(structures(&app, entity), before, "as they came");
}

#[test]
fn a_critical_structure_is_chosen_in_the_panel() {
    let mut app = app();
    let entity = bone(&mut app);
    let before = structures(&app, entity);
    let first = before.iter().position(|it| !it.is_critical).expect("one that is not critical");
    let mut harness = panel(app, entity);
    harness.run_ok();
    harness
        .query_all_by_role(Role::Label)
        .find(|node| node.accesskit_node().value().as_deref() == Some("Structures"))
        .expect("a section")
        .click();
    // Folding out is animated.
    harness.run_steps(40);
    let boxes: Vec<_> = harness.query_all_by_role(Role::CheckBox).map(|node| node.rect()).collect();
    assert_eq!(boxes.len(), before.len(), "one for each structure");
    let at = boxes[first].center();
    harness.hover_at(at);
    harness.run_ok();
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        harness.run_ok();
    }
    let app = harness.state_mut();
    app.step(2);
    assert!(structures(app, entity)[first].is_critical);
    assert_eq!(app.world().resource::<EditHistory>().titles().collect::<Vec<_>>(), ["Structures"]);
    undo(app.world_mut());
    app.step(2);
    assert_eq!(structures(app, entity), before);
}

#[test]
fn points_of_a_transfer_function_are_dragged() {
    let mut app = app();
    let entity = bone(&mut app);
    app.world_mut().entity_mut(entity).insert(TransferFunction::bone());
    let before = app.world().get::<TransferFunction>(entity).cloned().expect("one");
    let range = {
        let body = app.world().get::<CtVolume>(entity).expect("a volume");
        app.world().resource::<Assets<Volume>>().get(&body.0).expect("loaded").range()
    };
    let mut harness = panel(app, entity);
    harness.run_steps(40);
    // The plot is below the presets, as wide as the panel.
    let preset = harness.get_by_role_and_label(Role::Button, "Suited").rect();
    let hint = harness.get_by_label("Choose a point to set its colour.").rect();
    let plot = egui::Rect::from_min_max(
        egui::pos2(hint.left(), preset.bottom() + 3.0),
        egui::pos2(412.0 - (preset.left() - preset.left()), hint.top() - 3.0),
    );
    let point = before.sorted_points()[1];
    let share = ((point.value - range[0]) / (range[1] - range[0])) as f32;
    let at = egui::pos2(plot.left() + share * plot.width(), plot.bottom() - point.opacity * plot.height());
    let to = at + egui::vec2(-20.0, 15.0);
    harness.hover_at(at);
    harness.drag_at(at);
    harness.run_ok();
    harness.hover_at(to);
    harness.run_ok();
    harness.drop_at(to);
    harness.run_ok();
    let world = harness.state_mut().world_mut();
    let after = world.get::<TransferFunction>(entity).cloned().expect("one").sorted_points()[1];
    let moved = (after.value - point.value) / (range[1] - range[0]) * f64::from(plot.width());
    assert!((moved + 20.0).abs() < 4.0, "{moved} points to the right");
    assert!(after.opacity < point.opacity, "lower");
    undo(world);
    assert_eq!(world.get::<TransferFunction>(entity), Some(&before));
}

#[test]
fn tissue_is_changed_where_the_body_is() {
    let lattice = DeformLattice::new(Vec3::ZERO, Vec3::splat(0.1), 2).expect("a lattice");
    let mut body = ElasticBody::uniform(&lattice, ElasticTissue::LIVER).expect("a body");
    body = body.pinned_where(|rest_m| rest_m.y < 1e-6);
    for _ in 0..20 {
        body.step(1.0 / 60.0, Vec3::new(0.0, -9.81, 0.0), &[], &[]);
    }
    let before = body.clone();
    body.change_tissue(|_, _| ElasticTissue::MUSCLE);
    for vertex in 0..body.tree().vertex_count() {
        assert_eq!(body.displacement_m(vertex), before.displacement_m(vertex));
        assert_eq!(body.velocity_m_per_s(vertex), before.velocity_m_per_s(vertex));
        assert_eq!(body.is_pinned(vertex), before.is_pinned(vertex));
    }
    assert_eq!(body.cell(3).tissue, ElasticTissue::MUSCLE.bounded());
    // Three times as stiff: it sags less in the end.
    let mut liver = before;
    for _ in 0..600 {
        body.step(1.0 / 60.0, Vec3::new(0.0, -9.81, 0.0), &[], &[]);
        liver.step(1.0 / 60.0, Vec3::new(0.0, -9.81, 0.0), &[], &[]);
    }
    let sag = |body: &ElasticBody| {
        (0..body.tree().vertex_count()).map(|vertex| body.displacement_m(vertex).y).fold(0.0, f32::min)
    };
    assert!(sag(&body) > 0.6 * sag(&liver), "{} against {}", sag(&body), sag(&liver));
}

#[test]
fn the_lattice_is_subdivided_with_its_body() {
    let mut app = app();
    let lattice = DeformLattice::new(Vec3::ZERO, Vec3::splat(0.1), 1).expect("a lattice");
    let body = ElasticBody::uniform(&lattice, ElasticTissue::LIVER).expect("a body");
    let entity = app.world_mut().spawn((Name::new("body"), lattice, body, Transform::default())).id();
    let mut harness = panel(app, entity);
    harness.run_ok();
    harness
        .query_all_by_role(Role::Label)
        .find(|node| node.accesskit_node().value().as_deref() == Some("Deform lattice"))
        .expect("a section")
        .click();
    harness.run_steps(40);
    harness.get_by_role_and_label(Role::Button, "Subdivide").click();
    harness.run_ok();
    let world = harness.state_mut().world_mut();
    let patches = |world: &World| world.get::<DeformLattice>(entity).expect("one").tree().patches().len();
    assert_eq!(patches(world), 64);
    assert_eq!(world.get::<ElasticBody>(entity).expect("one").tree().patches().len(), 64);
    while undo(world) {}
    assert_eq!(patches(world), 8);
    assert_eq!(world.get::<ElasticBody>(entity).expect("one").tree().patches().len(), 8);
}
