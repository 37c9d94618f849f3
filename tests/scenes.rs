//! Saved scenes, `bsn!`, and the scenes that are ready.

#[path = "scenes/broken.rs"]
mod broken;
#[path = "scenes/components.rs"]
mod components;
#[path = "scenes/ready.rs"]
mod ready;
#[path = "scenes/round_trip.rs"]
mod round_trip;
#[path = "scenes/versions.rs"]
mod versions;

use bevy::ecs::entity::EntityHashMap;
use bevy::prelude::*;
use bevy_surgery::scenes::{load_scene, scene_text};
use bevy_surgery::testing::TestApp;

/// Saves a world and loads it into a fresh one.
fn saved_and_loaded(app: &TestApp) -> (String, TestApp, EntityHashMap<Entity>) {
    let text = scene_text(app.world()).expect("it can be saved");
    let mut fresh = TestApp::cpu();
    let entities =
        load_scene(fresh.world_mut(), "test.scn.ron", &text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    (text, fresh, entities)
}
