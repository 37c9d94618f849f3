//! Opening and saving, with progress, and without losing anything.

use crate::{Designer, replay, rest, view};
use bevy::prelude::*;
use bevy::window::{FileDragAndDrop, WindowCloseRequested};
use bevy_egui::egui;
use bevy_surgery::organ::{LoadOrgan, OrganLoadFailed, OrganShape, OrganSource};
use bevy_surgery::panels::{EditHistory, Problems, clear, note_added, outline};
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::{NotAuthored, load_scene, scene_text};
use bevy_surgery::volume::{LoadVolume, MakePhantom, VolumeLoadFailed};
use egui_file_dialog::FileDialog;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

const ORGANS: [&str; 5] = ["obj", "stl", "ply", "gltf", "glb"];
const VOLUMES: [&str; 9] = ["nrrd", "nhdr", "nii", "gz", "hdr", "img", "mhd", "mha", "dcm"];
/// How often what is not saved is kept beside.
const KEEP_EVERY: Duration = Duration::from_secs(20);

/// What is done when nothing is lost by it.
#[derive(Clone, Debug, PartialEq)]
pub enum Pending {
    /// An empty scene.
    New,
    /// Another scene.
    Open(PathBuf),
    /// The scene as its file has it.
    Revert,
    /// The end.
    Quit,
}

/// The dialog, and what the chosen file is for.
#[derive(Resource, Default)]
pub struct Dialogs {
    dialog: FileDialog,
    saves: bool,
    /// What was waiting for the scene to be saved.
    then: Option<Pending>,
}

/// Since when something is loaded, and when files were last seen to change.
#[derive(Resource, Default)]
struct Loads {
    since: BTreeMap<Entity, Instant>,
    /// What is turned to when it is there.
    opened: Option<Entity>,
    changed: BTreeMap<PathBuf, SystemTime>,
    kept: Option<Instant>,
}

pub fn build(app: &mut App) {
    app.insert_resource(Dialogs { dialog: dialog(), ..default() })
        .init_resource::<Loads>()
        .add_systems(PostStartup, begin)
        .add_systems(Update, (take_dropped, watch_volumes, keep_beside, ask_before_closing));
}

fn dialog() -> FileDialog {
    FileDialog::new()
        .add_file_filter_extensions("Organs", ORGANS.to_vec())
        .add_file_filter_extensions("Volumes", VOLUMES.to_vec())
        .add_file_filter_extensions("Scenes", vec!["ron"])
        .add_file_filter_extensions("Runs", vec!["mcap"])
        .default_file_name("scene.surgery.scn.ron")
        .default_size([620.0, 420.0])
}

/// What the arguments name; a liver where they name nothing.
fn begin(world: &mut World) {
    // What is there before anything is opened is the program's: handles, gizmos, cameras.
    let own: Vec<Entity> = outline(world);
    for entity in own {
        world.entity_mut(entity).insert(NotAuthored);
    }
    let args = world.resource::<crate::common::Args>().clone();
    world.resource_scope(|world, mut designer: Mut<Designer>| {
        let files = [args.mesh, args.volume, args.scene, args.replay];
        let mut is_empty = true;
        for file in files.into_iter().flatten() {
            is_empty = false;
            open(world, &mut designer, &file);
        }
        if is_empty {
            match world.spawn_scene(liver_scene()) {
                Ok(root) => designer.chosen = Some(root.id()),
                Err(reason) => world.resource_mut::<Problems>().note(reason.to_string()),
            }
        }
    });
    world.resource_mut::<EditHistory>().mark_saved();
    view::begin(world);
}

/// Opens a file or folder by its name.
pub fn open(world: &mut World, designer: &mut Designer, file: &Path) {
    let name = file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let lower = name.to_lowercase();
    let extension = lower.rsplit('.').next().unwrap_or_default();
    // The asset server would look for a relative path among its own.
    let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    if lower.ends_with(".scn.ron") || lower.ends_with(".scn") {
        return when_safe(world, designer, Pending::Open(absolute));
    }
    if extension == "mcap" {
        return replay::open(world, designer, &absolute);
    }
    let stem = name.split('.').next().unwrap_or("opened").to_owned();
    let opened = if ORGANS.contains(&extension) {
        let source = OrganSource::File(absolute.to_string_lossy().into_owned());
        let organ = LoadOrgan { source, ..default() };
        world.spawn((Name::new(stem), organ, Skin::liver(), Reactions::default(), Highlights::default())).id()
    } else if absolute.is_dir() || VOLUMES.contains(&extension) {
        let volume = LoadVolume { path: absolute, ..default() };
        world.spawn((Name::new(stem), volume, Transform::IDENTITY)).id()
    } else {
        let known = "organs (obj, stl, ply, gltf, glb), volumes (nrrd, nhdr, nii, nii.gz, mhd, mha, dcm, a folder), scenes \
                     (scn.ron) and runs (mcap)";
        world.resource_mut::<Problems>().note(format!("{name} is no file that can be opened here: there are {known}"));
        return;
    };
    note_added(world, &[opened], &format!("Open {name}"));
    designer.chosen = Some(opened);
    designer.status = format!("Opening {name}");
    world.resource_mut::<Loads>().opened = Some(opened);
}

/// Does something that would lose what is not saved, or asks before.
pub fn when_safe(world: &mut World, designer: &mut Designer, pending: Pending) {
    if world.resource::<EditHistory>().has_unsaved() {
        designer.asks = Some(pending);
    } else {
        perform(world, designer, pending);
    }
}

fn perform(world: &mut World, designer: &mut Designer, pending: Pending) {
    match pending {
        Pending::New => {
            empty(world, designer);
            designer.file = None;
            designer.status = "A new scene".into();
        }
        Pending::Open(file) => open_scene(world, designer, &file),
        Pending::Revert => match designer.file.clone() {
            Some(file) => open_scene(world, designer, &file),
            None => designer.status = "The scene was never saved".into(),
        },
        Pending::Quit => {
            world.write_message(AppExit::Success);
        }
    }
}

fn empty(world: &mut World, designer: &mut Designer) {
    clear(world);
    for entity in outline(world) {
        if let Ok(entity) = world.get_entity_mut(entity) {
            entity.despawn();
        }
    }
    rest::forget(world);
    (designer.chosen, designer.through) = (None, None);
    world.resource_mut::<EditHistory>().mark_saved();
}

/// Opens a scene in place of what is there; where it cannot be read nothing changes.
fn open_scene(world: &mut World, designer: &mut Designer, file: &Path) {
    let text = std::fs::read_to_string(file).map_err(|error| format!("{}: {error}", file.display()));
    let before = outline(world);
    let loaded =
        text.and_then(|text| load_scene(world, &file.to_string_lossy(), &text).map_err(|reason| reason.to_string()));
    match loaded {
        Ok(entities) => {
            clear(world);
            for entity in before {
                if let Ok(entity) = world.get_entity_mut(entity) {
                    entity.despawn();
                }
            }
            rest::forget(world);
            (designer.chosen, designer.through) = (None, None);
            designer.file = Some(file.to_owned());
            view::begin(world);
            designer.status = format!("Opened {} with {} entities", file.display(), entities.len());
            world.resource_mut::<EditHistory>().mark_saved();
        }
        Err(reason) => world.resource_mut::<Problems>().note(reason),
    }
}

/// Saves to the scene's file, or asks for one.
pub fn save(world: &mut World, designer: &mut Designer) -> bool {
    let Some(file) = designer.file.clone() else {
        ask_where(world);
        return false;
    };
    let written = rest::with_rest(world, |world| scene_text(world).map_err(|reason| reason.to_string()))
        .and_then(|text| replace(&file, &text).map_err(|error| format!("{}: {error}", file.display())));
    match written {
        Ok(()) => {
            designer.status = format!("Saved {}", file.display());
            world.resource_mut::<EditHistory>().mark_saved();
            if let Some(kept) = kept_beside() {
                let _ = std::fs::remove_file(kept);
            }
            true
        }
        Err(reason) => {
            world.resource_mut::<Problems>().note(reason);
            false
        }
    }
}

/// Writes a file whole or not at all.
fn replace(file: &Path, text: &str) -> std::io::Result<()> {
    let beside = file.with_extension("ron.new");
    std::fs::write(&beside, text)?;
    std::fs::rename(&beside, file)
}

pub fn ask_where(world: &mut World) {
    let mut dialogs = world.resource_mut::<Dialogs>();
    dialogs.saves = true;
    dialogs.dialog.save_file();
}

pub fn ask_what(world: &mut World, is_folder: bool) {
    let mut dialogs = world.resource_mut::<Dialogs>();
    dialogs.saves = false;
    if is_folder { dialogs.dialog.pick_directory() } else { dialogs.dialog.pick_file() }
}

/// The dialogs that are open.
pub fn dialogs(context: &egui::Context, world: &mut World, designer: &mut Designer) {
    let picked = world.resource_scope(|_, mut dialogs: Mut<Dialogs>| {
        dialogs.dialog.update(context);
        dialogs.dialog.take_picked()
    });
    if let Some(picked) = picked {
        if world.resource::<Dialogs>().saves {
            let is_named = picked.to_string_lossy().ends_with(".scn.ron");
            designer.file = Some(if is_named { picked } else { picked.with_extension("surgery.scn.ron") });
            if save(world, designer)
                && let Some(then) = world.resource_mut::<Dialogs>().then.take()
            {
                perform(world, designer, then);
            }
        } else {
            open(world, designer, &picked);
        }
    }
    let Some(pending) = designer.asks.clone() else { return };
    let mut answer = None;
    egui::Modal::new("unsaved".into()).show(context, |ui| {
        ui.heading("Not everything is saved");
        ui.label(match &pending {
            Pending::Open(file) => format!("before {} is opened.", file.display()),
            Pending::Revert => "and reverting takes it back.".into(),
            Pending::New => "before a new scene begins.".into(),
            Pending::Quit => "before the designer is closed.".into(),
        });
        ui.horizontal(|ui| {
            for (choice, name, told) in [
                (0, "Save", "Saves the scene, then goes on"),
                (1, "Do not save", "Goes on; what was edited is lost"),
                (2, "Cancel", "Stays here (Escape)"),
            ] {
                if ui.button(name).on_hover_text(told).clicked() {
                    answer = Some(choice);
                }
            }
        });
        if ui.input(|input| input.key_pressed(egui::Key::Escape)) {
            answer = Some(2);
        }
    });
    let Some(answer) = answer else { return };
    designer.asks = None;
    match answer {
        0 if save(world, designer) => perform(world, designer, pending),
        // When the file is chosen.
        0 => world.resource_mut::<Dialogs>().then = Some(pending),
        1 => perform(world, designer, pending),
        _ => {}
    }
}

/// What is still being loaded, and a way to give it up.
pub fn progress(context: &egui::Context, world: &mut World, designer: &mut Designer) {
    let mut waiting: Vec<(Entity, String)> = Vec::new();
    let mut organs = world.query_filtered::<(Entity, &LoadOrgan), (Without<OrganShape>, Without<OrganLoadFailed>)>();
    for (entity, organ) in organs.iter(world) {
        let what = match &organ.source {
            OrganSource::File(file) => Path::new(file).file_name().map(|name| name.to_string_lossy().into_owned()),
            _ => world.get::<Name>(entity).map(Name::to_string),
        };
        waiting.push((entity, what.unwrap_or_else(|| "an organ".into())));
    }
    let mut volumes = world.query_filtered::<
        (Entity, Option<&LoadVolume>),
        (Or<(With<LoadVolume>, With<MakePhantom>)>, Without<CtVolume>, Without<VolumeLoadFailed>),
    >();
    for (entity, file) in volumes.iter(world) {
        let name = file.and_then(|file| Some(file.path.file_name()?.to_string_lossy().into_owned()));
        waiting.push((entity, name.unwrap_or_else(|| "a phantom".into())));
    }
    waiting.sort();
    let opened = world.resource::<Loads>().opened;
    if let Some(opened) = opened.filter(|opened| waiting.iter().all(|(waits, _)| waits != opened)) {
        view::frame(world, Some(opened));
        world.resource_mut::<Loads>().opened = None;
        designer.status = designer.status.replace("Opening", "Opened");
    }
    let mut cancelled = None;
    world.resource_scope(|_, mut loads: Mut<Loads>| {
        loads.since.retain(|entity, _| waiting.iter().any(|(waits, _)| waits == entity));
        if waiting.is_empty() {
            return;
        }
        let corner = egui::pos2(designer.picture.min.x + 8.0, designer.picture.min.y + 8.0);
        egui::Window::new("Loading").fixed_pos(corner).collapsible(false).resizable(false).show(context, |ui| {
            for (entity, name) in &waiting {
                let since = *loads.since.entry(*entity).or_insert_with(Instant::now);
                ui.horizontal(|ui| {
                    ui.spinner().on_hover_text("It is being loaded off the main thread");
                    ui.label(format!("{name}, {:.1} s", since.elapsed().as_secs_f32()))
                        .on_hover_text("What is loaded, and for how long, seconds");
                    if ui.button("Cancel").on_hover_text(format!("Gives {name} up")).clicked() {
                        cancelled = Some((*entity, name.clone()));
                    }
                });
            }
        });
    });
    if let Some((entity, name)) = cancelled {
        // Its task goes with it.
        world.despawn(entity);
        designer.status = format!("{name} was given up");
        if designer.chosen == Some(entity) {
            designer.chosen = None;
        }
    }
}

/// Files that are dropped on the window.
fn take_dropped(world: &mut World, mut read: Local<bevy::ecs::message::MessageCursor<FileDragAndDrop>>) {
    let Some(messages) = world.get_resource::<Messages<FileDragAndDrop>>() else { return };
    let dropped: Vec<PathBuf> = read
        .read(messages)
        .filter_map(|event| match event {
            FileDragAndDrop::DroppedFile { path_buf, .. } => Some(path_buf.clone()),
            _ => None,
        })
        .collect();
    world.resource_scope(|world, mut designer: Mut<Designer>| {
        for file in dropped {
            open(world, &mut designer, &file);
        }
    });
}

/// Volumes whose files change are loaded anew; what the asset server loads it watches itself.
fn watch_volumes(mut loads: ResMut<Loads>, mut volumes: Query<&mut LoadVolume>, mut last: Local<Option<Instant>>) {
    if last.is_some_and(|last| last.elapsed() < Duration::from_secs(1)) {
        return;
    }
    *last = Some(Instant::now());
    for mut volume in &mut volumes {
        let Ok(now) = std::fs::metadata(&volume.path).and_then(|file| file.modified()) else { continue };
        let before = loads.changed.insert(volume.path.clone(), now);
        if before.is_some_and(|before| before != now) {
            volume.set_changed();
        }
    }
}

/// Where a scene is kept that was not saved.
pub fn kept_beside() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("bevy_surgery").join("designer-unsaved.surgery.scn.ron"))
}

/// Keeps what is not saved, in case the program ends.
fn keep_beside(world: &mut World) {
    let is_due = world.resource::<Loads>().kept.is_none_or(|kept| kept.elapsed() > KEEP_EVERY);
    if !is_due || !world.resource::<EditHistory>().has_unsaved() || !crate::common::opens_window(world.resource()) {
        return;
    }
    world.resource_mut::<Loads>().kept = Some(Instant::now());
    let Some(file) = kept_beside() else { return };
    // Something that is still made cannot be written down yet: next time.
    if let Ok(text) = rest::with_rest(world, |world| scene_text(world)) {
        let _ = file.parent().map(std::fs::create_dir_all);
        let _ = replace(&file, &text);
    }
}

fn ask_before_closing(world: &mut World, mut read: Local<bevy::ecs::message::MessageCursor<WindowCloseRequested>>) {
    let Some(messages) = world.get_resource::<Messages<WindowCloseRequested>>() else { return };
    if read.read(messages).count() > 0 {
        world.resource_scope(|world, mut designer: Mut<Designer>| when_safe(world, &mut designer, Pending::Quit));
    }
}
