//! Undo and redo.

use super::app;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_surgery::panels::*;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::scene_text;
use proptest::prelude::*;
use std::any::TypeId;

#[test]
fn what_is_removed_comes_back_as_it_was() {
    let mut app = app();
    let world = app.world_mut();
    let root = world.spawn((Name::new("root"), Transform::from_xyz(1.0, 0.0, 0.0), Skin::liver())).id();
    let child = world.spawn((Name::new("child"), Skin::kidney(), ChildOf(root))).id();
    let before = scene_text(world).expect("a scene");
    assert!(before.contains("child"));

    remove(world, root, "Remove root");
    assert!(world.get::<Disabled>(child).is_some(), "what hangs from it goes too");
    assert!(outline(world).is_empty());
    let empty = scene_text(world).expect("a scene");
    assert!(!empty.contains("child") && !empty.contains("root"), "what is removed is not saved");

    assert!(undo(world));
    assert_eq!(outline(world), [root, child]);
    assert_eq!(scene_text(world).expect("a scene"), before);
    assert!(redo(world));
    assert!(outline(world).is_empty());
}

#[test]
fn what_was_removed_for_good_is_gone() {
    let mut app = app();
    let world = app.world_mut();
    let kept = world.spawn((Name::new("kept"), Skin::liver())).id();
    let removed = world.spawn((Name::new("removed"), Skin::liver())).id();
    remove(world, removed, "Remove");
    for step in 0..600 {
        edit(world, kept, Transform::from_xyz(step as f32 + 1.0, 0.0, 0.0), "Move");
        settle(world);
    }
    assert!(world.get_entity(removed).is_err(), "no edit that is remembered brings it back");
    assert_eq!(world.resource::<EditHistory>().titles().count(), 500);
}

#[test]
fn what_was_added_and_undone_is_gone_with_the_next_edit() {
    let mut app = app();
    let world = app.world_mut();
    let one = world.spawn((Name::new("one"), Skin::liver())).id();
    let added = world.spawn((Name::new("added"), Skin::liver())).id();
    note_added(world, &[added], "Add");
    assert!(undo(world));
    assert!(world.get::<Disabled>(added).is_some());
    edit(world, one, Skin::kidney(), "Skin");
    assert!(world.get_entity(added).is_err());
    assert!(!redo(world));
}

#[test]
fn unsaved_work_is_known() {
    let mut app = app();
    let world = app.world_mut();
    let entity = world.spawn((Name::new("one"), Skin::liver())).id();
    let unsaved = |world: &World| world.resource::<EditHistory>().has_unsaved();
    assert!(!unsaved(world));
    edit(world, entity, Skin::kidney(), "Skin");
    assert!(unsaved(world));
    settle(world);
    world.resource_mut::<EditHistory>().mark_saved();
    assert!(!unsaved(world));
    undo(world);
    assert!(unsaved(world), "the file has the kidney");
    redo(world);
    assert!(!unsaved(world));
    undo(world);
    edit(world, entity, Skin::spleen(), "Skin");
    settle(world);
    assert!(unsaved(world), "as many edits, but others");
}

#[test]
fn components_are_added_and_taken_away() {
    let mut app = app();
    let world = app.world_mut();
    let entity = world.spawn(Name::new("one")).id();
    edit(world, entity, Reactions::default(), "Add reactions");
    settle(world);
    edit_component(world, entity, TypeId::of::<Reactions>(), None, "Take reactions away");
    assert!(world.get::<Reactions>(entity).is_none());
    undo(world);
    assert!(world.get::<Reactions>(entity).is_some());
    undo(world);
    assert!(world.get::<Reactions>(entity).is_none());
}

#[test]
fn an_edit_that_changes_nothing_is_none() {
    let mut app = app();
    let world = app.world_mut();
    let entity = world.spawn((Name::new("one"), Transform::default())).id();
    edit(world, entity, Transform::default(), "Move");
    assert_eq!(world.resource::<EditHistory>().undo_title(), None);
    // Dragged there and back.
    edit(world, entity, Transform::from_xyz(1.0, 0.0, 0.0), "Move");
    edit(world, entity, Transform::default(), "Move");
    settle(world);
    assert_eq!(world.resource::<EditHistory>().undo_title(), None);
}

#[derive(Clone, Debug)]
enum Act {
    Set(usize, i8),
    Settle,
    Undo,
    Redo,
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let act = prop_oneof![
        4 => (0..3usize, any::<i8>()).prop_map(|(entity, to)| Act::Set(entity, to)),
        3 => Just(Act::Settle),
        2 => Just(Act::Undo),
        2 => Just(Act::Redo),
    ];
    prop::collection::vec(act, 0..60)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..default() })]

    /// The history against one that remembers every state whole.
    #[test]
    fn it_is_as_if_every_state_were_remembered(acts in acts()) {
        let mut app = app();
        let world = app.world_mut();
        let entities: Vec<Entity> = (0..3).map(|n| world.spawn((Name::new(format!("{n}")), Transform::default())).id()).collect();
        let state = |world: &World| entities.iter().map(|entity| world.get::<Transform>(*entity).expect("there").translation.x).collect::<Vec<_>>();
        let mut states = vec![state(world)];
        let mut at = 0;
        for act in acts {
            match act {
                // Each edit is settled: what drags join is tested elsewhere.
                Act::Set(entity, to) => {
                    edit(world, entities[entity], Transform::from_xyz(f32::from(to), 0.0, 0.0), "Move");
                    settle(world);
                    if state(world) != states[at] {
                        states.truncate(at + 1);
                        states.push(state(world));
                        at += 1;
                    }
                }
                Act::Settle => settle(world),
                Act::Undo => {
                    prop_assert_eq!(undo(world), at > 0);
                    at = at.saturating_sub(1);
                }
                Act::Redo => {
                    prop_assert_eq!(redo(world), at + 1 < states.len());
                    at = (at + 1).min(states.len() - 1);
                }
            }
            prop_assert_eq!(state(world), states[at].clone());
        }
    }
}
