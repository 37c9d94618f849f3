//! Composes a scene by eye: organs and volumes are opened and placed, everything about them is set in panels, tried at once, and saved.
//!
//! Open files with Ctrl+O or by dropping them on the window: organs (OBJ, STL, PLY, glTF), volumes (NRRD, NIfTI, MetaImage, DICOM, or a
//! folder of slices), scenes (`.scn.ron`) and runs (`.mcap`), which are shown on a timeline. Everything can be undone. F1 lists the
//! keys: all of it can be done without a mouse.
//!
//! `cargo run --features panels --example designer`; with `--features panels,dev` shaders and assets are read again when their files
//! change. `--mesh`, `--volume`, `--scene` and `--replay` open a file at the start; without any there is a liver.

// Queries spell out what they touch.
#![allow(clippy::too_many_arguments, clippy::type_complexity)]

mod common;
#[path = "designer/files.rs"]
mod files;
#[path = "designer/handles.rs"]
mod handles;
#[path = "designer/keys.rs"]
mod keys;
#[path = "designer/layout.rs"]
mod layout;
#[path = "designer/menu.rs"]
mod menu;
#[path = "designer/pointer.rs"]
mod pointer;
#[path = "designer/replay.rs"]
mod replay;
#[path = "designer/rest.rs"]
mod rest;
#[path = "designer/signs.rs"]
mod signs;
#[path = "designer/view.rs"]
mod view;

use bevy::app::TaskPoolOptions;
use bevy::asset::UnapprovedPathMode;
use bevy::gizmos::transform_gizmo::TransformGizmoPlugin;
use bevy::gizmos_render::GizmoRenderPlugin;
use bevy::prelude::*;
use bevy_egui::EguiPlugin;
use bevy_surgery::panels::PanelsPlugin;
use bevy_surgery::prelude::*;
use clap::Parser;
use common::{Args, Stage, Viewer};
use serde_json::json;
use std::path::PathBuf;
use std::process::ExitCode;

/// What the program is about just now.
#[derive(Resource, Default)]
struct Designer {
    /// What is edited.
    chosen: Option<Entity>,
    /// The scene's file.
    file: Option<PathBuf>,
    /// What was done last, for the status line.
    status: String,
    /// Whether the list of keys is shown.
    shows_help: bool,
    /// What a click in the picture does.
    hand: pointer::Hand,
    /// The camera of the scene that is looked through; none for the designer's own.
    through: Option<Entity>,
    /// The picture's place in the window, points.
    picture: Rect,
    /// Something to be done before what is not saved would be lost, and after that was asked.
    asks: Option<files::Pending>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    if !common::opens_window(&args) {
        return common::main_with("designer", add, |world| {
            let count = bevy_surgery::panels::outline(world).len();
            json!({ "entities": count }).as_object().cloned().unwrap_or_default()
        });
    }
    // Unlike other examples it opens files wherever they are, and goes on when one cannot be read.
    let window = Window { title: "designer".into(), resolution: (args.size.x, args.size.y).into(), ..default() };
    let assets = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    // Bevy compiles shaders where organs are built, and has one thread for both on four cores: the window would stay black meanwhile.
    let mut threads = TaskPoolOptions::default();
    threads.async_compute.min_threads = 2;
    let threads = TaskPoolPlugin { task_pool_options: threads };
    let mut app = App::new();
    app.add_plugins((
        DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }).set(assets).set(threads),
        SurgeryPlugins,
    ));
    app.insert_resource(Stage { target: default(), viewer: Viewer::Person }).insert_resource(args);
    common::devices::build(&mut app);
    add(&mut app);
    match app.run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(_) => ExitCode::FAILURE,
    }
}

fn add(app: &mut App) {
    if !app.is_plugin_added::<GizmoRenderPlugin>() {
        app.add_plugins(GizmoRenderPlugin);
    }
    app.add_plugins((TransformGizmoPlugin, EguiPlugin::default(), PanelsPlugin))
        .insert_resource(ClearColor(Color::srgb(0.09, 0.10, 0.11)))
        .init_resource::<Designer>();
    // A scene is composed at rest, and played to try it.
    app.world_mut().resource_mut::<Time<Virtual>>().pause();
    files::build(app);
    handles::build(app);
    keys::build(app);
    layout::build(app);
    pointer::build(app);
    replay::build(app);
    rest::build(app);
    signs::build(app);
    view::build(app);
}
