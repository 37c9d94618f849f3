//! Time, timelines, problems.

use super::{app, shown};
use crate::scenario_runs::{empty_run, mastoid_run, push, removal, remove_cells, sample};
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_surgery::panels::*;
use bevy_surgery::scenario::log::{EndReason, EndRecord, GoalRecord, LogRecord};
use bevy_surgery::volume::LoadVolume;
use egui::accesskit::Role;
use egui_kittest::kittest::Queryable;

#[derive(Resource, Default)]
struct Steps(u32);

#[test]
fn a_single_step_is_one() {
    let mut app = app();
    app.init_resource::<Steps>().add_systems(FixedUpdate, |mut steps: ResMut<Steps>| steps.0 += 1);
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    app.update();
    assert_eq!(app.world().resource::<Steps>().0, 0);
    for count in 1..4 {
        single_step(app.world_mut());
        app.update();
        app.update();
        assert_eq!(app.world().resource::<Steps>().0, count);
    }
}

#[test]
fn buttons_play_and_slow_down() {
    let mut harness = shown(app(), |ui, world| {
        ui.horizontal(|ui| time_panel(ui, world));
    });
    harness.run_ok();
    harness.get_by_role_and_label(Role::Button, "⏸").click();
    harness.run_ok();
    assert!(harness.state().world().resource::<Time<Virtual>>().is_paused());
    harness.get_by_role_and_label(Role::Button, "▶").click();
    harness.run_ok();
    let world = harness.state_mut().world_mut();
    assert!(!world.resource::<Time<Virtual>>().is_paused());
    change_speed(world, -1);
    assert_eq!(world.resource::<Time<Virtual>>().relative_speed(), 0.5);
    for _ in 0..9 {
        change_speed(world, -1);
    }
    assert_eq!(world.resource::<Time<Virtual>>().relative_speed(), 0.1);
    for _ in 0..9 {
        change_speed(world, 1);
    }
    assert_eq!(world.resource::<Time<Virtual>>().relative_speed(), 4.0);
}

#[test]
fn a_timeline_tells_what_a_log_holds() {
    let mut run = empty_run(10.0, vec![remove_cells()], Vec::new(), Vec::new());
    for step in 0..35 {
        push(&mut run, step, LogRecord::Sample(sample(0, Vec3::ZERO)));
    }
    push(&mut run, 4, removal(0, 1, 2.0, Vec3::ZERO, None));
    push(&mut run, 7, removal(0, 1, 3.0, Vec3::ZERO, None));
    push(&mut run, 12, removal(0, 1, 4.0, Vec3::ZERO, None));
    let goal = remove_cells();
    let reached = GoalRecord { goal: goal.id.clone(), progress: 1.0, is_reached: true };
    push(&mut run, 20, LogRecord::Goal(GoalRecord { is_reached: false, progress: 0.5, ..reached.clone() }));
    push(&mut run, 25, LogRecord::Goal(reached));
    push(&mut run, 34, LogRecord::End(EndRecord { reason: EndReason::Done, score: 87.0, is_passed: true }));
    let timeline = Timeline::of(&run);
    assert_eq!(timeline.duration_s, 3.5);
    assert_eq!(timeline.removed_mm3, [5.0, 4.0, 0.0, 0.0]);
    let told: Vec<_> = timeline.events.iter().map(|event| (event.time_s, event.what.as_str(), event.kind)).collect();
    assert_eq!(told, [(2.5, goal.title.as_str(), TimelineKind::Goal), (3.4, "87 points", TimelineKind::End)]);
    assert_eq!(timeline.next(0.0, true).map(|event| event.time_s), Some(2.5));
    assert_eq!(timeline.next(2.5, true).map(|event| event.time_s), Some(3.4));
    assert_eq!(timeline.next(2.5, false), None);
}

#[test]
fn a_click_on_the_timeline_asks_for_its_time() {
    #[derive(Resource, Default)]
    struct Asked(Option<f64>);
    let timeline = Timeline::of(&mastoid_run(0.9, 3, Vec::new()));
    let duration_s = timeline.duration_s;
    assert!(timeline.events.len() > 3);
    let mut app = app();
    app.init_resource::<Asked>();
    let mut harness = shown(app, move |ui, world| {
        if let Some(asked_s) = timeline_panel(ui, &timeline, 1.0) {
            world.resource_mut::<Asked>().0 = Some(asked_s);
        }
    });
    harness.run_ok();
    // The plot takes the whole width.
    let at = egui::pos2(8.0 + 0.25 * (420.0 - 16.0), 50.0);
    harness.hover_at(at);
    harness.run_ok();
    for pressed in [true, false] {
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        harness.run_ok();
    }
    let asked_s = harness.state().world().resource::<Asked>().0.expect("it asks");
    assert!((asked_s / duration_s - 0.25).abs() < 0.02, "{asked_s} of {duration_s}");
}

#[test]
fn problems_are_collected_and_told_once() {
    let mut app = app();
    app.world_mut().spawn((Name::new("gone"), LoadVolume { path: "no/such/file.nrrd".into(), ..default() }));
    app.idle_until("the problem", |app| app.world().resource::<Problems>().count() > 0);
    app.step(5);
    let problems: Vec<String> = app.world().resource::<Problems>().list().map(str::to_owned).collect();
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].contains("no/such/file.nrrd"), "{problems:?}");
    let mut harness = shown(app, |ui, world| problems_panel(ui, &mut world.resource_mut::<Problems>()));
    harness.run_ok();
    harness.get_by_role_and_label(Role::Button, "Clear").click();
    harness.run_ok();
    assert_eq!(harness.state().world().resource::<Problems>().list().count(), 0);
    let _ = harness.get_by_label("No problems.");
}
