//! Menus: files, edits, views, and what can be added.

use crate::files::{self, Pending};
use crate::pointer::Hand;
use crate::{Designer, view};
use bevy::gizmos::transform_gizmo::{TransformGizmoMode, TransformGizmoSettings, TransformGizmoSpace};
use bevy::prelude::*;
use bevy_egui::egui;
use bevy_surgery::organ::{LoadOrgan, OrganSource};
use bevy_surgery::panels::{EditHistory, Problems, note_added, outline, ready_tools, redo, remove, undo};
use bevy_surgery::pool::SuctionIrrigator;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::ScenarioEye;
use bevy_surgery::scenes::{abdominal_wall, liver, mastoid_scene, soft_volume_scene};
use bevy_surgery::tools::{ToolKind, ToolRig};
use bevy_surgery::volume::phantom::PhantomOptions;
use bevy_surgery::volume::{MakePhantom, WatchCritical};

/// A line of a menu; whether it was chosen.
fn item(ui: &mut egui::Ui, can: bool, name: &str, keys: &str, told: &str) -> bool {
    let button = egui::Button::new(name).shortcut_text(keys);
    let is_chosen = ui.add_enabled(can, button).on_hover_text(told).on_disabled_hover_text(told).clicked();
    if is_chosen {
        ui.close();
    }
    is_chosen
}

pub fn menu(ui: &mut egui::Ui, world: &mut World, designer: &mut Designer) {
    let file = ui.menu_button("File", |ui| {
        if item(ui, true, "New", "Ctrl+N", "An empty scene") {
            files::when_safe(world, designer, Pending::New);
        }
        if item(ui, true, "Open…", "Ctrl+O", "An organ, a volume, a scene or a run") {
            files::ask_what(world, false);
        }
        if item(ui, true, "Open folder…", "", "A folder of DICOM, PNG or JPEG slices") {
            files::ask_what(world, true);
        }
        ui.separator();
        if item(ui, true, "Save", "Ctrl+S", "To the scene's file") {
            files::save(world, designer);
        }
        if item(ui, true, "Save as…", "Ctrl+Shift+S", "To another file") {
            files::ask_where(world);
        }
        if item(ui, designer.file.is_some(), "Revert", "", "Back to what the scene's file has") {
            files::when_safe(world, designer, Pending::Revert);
        }
        let kept = files::kept_beside().filter(|kept| kept.exists());
        if item(ui, kept.is_some(), "Recover", "", "Opens what was kept of a scene that was not saved")
            && let Some(kept) = kept
        {
            files::when_safe(world, designer, Pending::Open(kept));
        }
        ui.separator();
        if item(ui, true, "Quit", "Ctrl+Q", "Ends the designer") {
            files::when_safe(world, designer, Pending::Quit);
        }
    });
    file.response.on_hover_text("Opens and saves");
    let edit = ui.menu_button("Edit", |ui| {
        let history = world.resource::<EditHistory>();
        let (before, after) = (history.undo_title().map(str::to_owned), history.redo_title().map(str::to_owned));
        let name = |what: &str, title: &Option<String>| format!("{what} {}", title.as_deref().unwrap_or_default());
        if item(ui, before.is_some(), &name("Undo", &before), "Ctrl+Z", "Takes the last edit back") {
            undo(world);
        }
        if item(ui, after.is_some(), &name("Redo", &after), "Ctrl+Shift+Z", "Does again what was taken back") {
            redo(world);
        }
        ui.separator();
        if item(ui, designer.chosen.is_some(), "Remove", "Delete", "Removes what is chosen and all that hangs from it")
        {
            remove_chosen(world, designer);
        }
    });
    edit.response.on_hover_text("Undo, redo, remove");
    let view = ui.menu_button("View", |ui| {
        if item(ui, true, "Frame", "F", "Turns the designer's eye to what is chosen, or to everything") {
            view::frame(world, designer.chosen);
        }
        if item(ui, true, "Next camera", "C", "Looks through the next camera of the scene, or the designer's own eye") {
            view::next_camera(world, designer);
        }
    });
    view.response.on_hover_text("Where the picture is taken from");
    if ui.button("?").on_hover_text("All keys (F1)").clicked() {
        designer.shows_help = !designer.shows_help;
    }
}

pub fn remove_chosen(world: &mut World, designer: &mut Designer) {
    let Some(chosen) = designer.chosen.take() else { return };
    let name = world.get::<Name>(chosen).map_or_else(|| chosen.to_string(), Name::to_string);
    remove(world, chosen, &format!("Remove {name}"));
    designer.status = format!("Removed {name}: Ctrl+Z brings it back");
}

/// What a click does, and how the gizmo moves what is chosen.
pub fn hands(ui: &mut egui::Ui, world: &mut World, designer: &mut Designer) {
    for (hand, name, told) in Hand::ALL {
        if ui.selectable_label(designer.hand == hand, name).on_hover_text(told).clicked() {
            designer.hand = hand;
        }
    }
    ui.separator();
    let mut settings = world.resource_mut::<TransformGizmoSettings>();
    for (mode, name, told) in [
        (TransformGizmoMode::Translate, "Move", "Arrows move what is chosen along an axis (W)"),
        (TransformGizmoMode::Rotate, "Turn", "Rings turn what is chosen about an axis (E)"),
        (TransformGizmoMode::Scale, "Scale", "Cubes scale what is chosen along an axis (R)"),
    ] {
        if ui.selectable_label(settings.mode == mode, name).on_hover_text(told).clicked() {
            settings.mode = mode;
        }
    }
    let mut is_local = settings.space == TransformGizmoSpace::Local;
    if ui.checkbox(&mut is_local, "own axes").on_hover_text("Along its own axes instead of the world's (X)").changed() {
        settings.space = if is_local { TransformGizmoSpace::Local } else { TransformGizmoSpace::World };
    }
}

/// What can be added.
pub fn add(ui: &mut egui::Ui, world: &mut World, designer: &mut Designer) {
    let menu = ui.menu_button("Add", |ui| {
        ui.weak("Scenes");
        let scenes: [(&str, &str, fn(&mut World) -> Result<Entity, String>); 5] = [
            ("Liver under an endoscope", "The liver that ships with the crate, in the abdomen", |world| {
                scene(world, liver_scene())
            }),
            ("Mastoid under a microscope", "The phantom of a temporal bone with drill, suction and pool", |world| {
                scene(world, mastoid_scene())
            }),
            ("Soft volume", "A phantom that gives way", |world| scene(world, soft_volume_scene())),
            ("Liver alone", "Without wall and endoscope", |world| scene(world, liver())),
            ("Abdominal wall", "A cavity seen from inside", |world| scene(world, abdominal_wall())),
        ];
        for (name, told, make) in scenes {
            if item(ui, true, name, "", told) {
                match make(world) {
                    Ok(entity) => added(world, designer, entity, name),
                    Err(reason) => world.resource_mut::<Problems>().note(reason),
                }
            }
        }
        ui.separator();
        ui.weak("Bodies");
        if item(ui, true, "Ellipsoid", "", "An organ of 10 x 7 x 7 cm that reacts") {
            let source = OrganSource::Ellipsoid { semi_axes_m: Vec3::new(0.05, 0.035, 0.035), subdivisions: 5 };
            let organ = LoadOrgan { source, ..default() };
            let organ = (Name::new("Ellipsoid"), organ, Skin::liver(), Reactions::default(), Highlights::default());
            let entity = world.spawn(organ).id();
            added(world, designer, entity, "Ellipsoid");
        }
        if item(ui, true, "Temporal bone", "", "A phantom of the mastoid of 160 voxels along each side") {
            let bone = MakePhantom(PhantomOptions { size: 160, ..default() });
            let entity =
                world.spawn((Name::new("Temporal bone"), bone, Transform::IDENTITY, WatchCritical::default())).id();
            added(world, designer, entity, "Temporal bone");
        }
        let volume = designer.chosen.filter(|chosen| world.get::<CtVolume>(*chosen).is_some());
        if item(ui, volume.is_some(), "Pool", "", "Irrigation fluid and blood in the chosen volume's cavity")
            && let Some(volume) = volume
        {
            let place = Pool::facing(Vec3::ZERO, Vec3::Z);
            let entity = world.spawn((Name::new("Pool"), Pool::new(volume), place, ChildOf(volume))).id();
            added(world, designer, entity, "Pool");
        }
        ui.separator();
        ui.weak("Instruments");
        for (name, told, kind) in ready_tools() {
            if item(ui, true, name, "", told) {
                let entity = world.spawn((Name::new(name), Tool::new(kind), ToolRig::default())).id();
                if kind == ToolKind::SuctionIrrigator {
                    world.entity_mut(entity).insert(SuctionIrrigator::default());
                }
                added(world, designer, entity, name);
            }
        }
        ui.separator();
        ui.weak("Views and lights");
        let place = Transform::from_xyz(0.0, 0.09, 0.18).looking_at(Vec3::ZERO, Vec3::Y);
        if item(ui, true, "Endoscope", "", "A camera with its ring of light") {
            let entity = world.spawn((Name::new("Endoscope"), Endoscope::default(), ScenarioEye, place)).id();
            added(world, designer, entity, "Endoscope");
        }
        if item(ui, true, "Microscope", "", "A camera with magnifications; its lamp hangs from it") {
            let place = Transform::from_xyz(0.0, 0.0, 0.25);
            let entity = world.spawn((Name::new("Microscope"), Microscope::default(), ScenarioEye, place)).id();
            world.spawn((Name::new("Lamp"), bevy_surgery::view::MicroscopeLamp::default(), ChildOf(entity)));
            added(world, designer, entity, "Microscope");
        }
        if item(ui, true, "Lamp", "", "A directional light of 5000 lx") {
            let light = DirectionalLight { illuminance: 5000.0, ..default() };
            let entity = world.spawn((Name::new("Lamp"), light, place)).id();
            added(world, designer, entity, "Lamp");
        }
    });
    menu.response.on_hover_text("Adds something to the scene");
}

fn scene(world: &mut World, scene: impl Scene) -> Result<Entity, String> {
    world.spawn_scene(scene).map(|entity| entity.id()).map_err(|reason| reason.to_string())
}

fn added(world: &mut World, designer: &mut Designer, entity: Entity, name: &str) {
    let is_first = outline(world).iter().all(|it| *it == entity || world.get::<ChildOf>(*it).is_some());
    if is_first {
        view::begin(world);
    }
    note_added(world, &[entity], &format!("Add {}", name.to_lowercase()));
    designer.chosen = Some(entity);
    designer.status = format!("Added: {name}");
}
