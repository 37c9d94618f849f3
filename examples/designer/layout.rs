//! Where the panels are, and where the picture between them.

use crate::{Designer, files, keys, menu, replay, rest};
use bevy::prelude::*;
use bevy_egui::{EguiContext, EguiGlobalSettings, EguiPrimaryContextPass, PrimaryEguiContext, egui};
use bevy_surgery::panels::{
    EditHistory, Problems, entity_panel, outline_panel, problems_panel, settle_when_idle, time_panel,
};

pub fn build(app: &mut App) {
    app.insert_resource(EguiGlobalSettings { auto_create_primary_context: false, ..default() })
        .add_systems(EguiPrimaryContextPass, show);
}

/// Which of the lower panels is open.
#[derive(Clone, Copy, Default, PartialEq)]
enum Lower {
    #[default]
    None,
    Problems,
    Timeline,
}

fn show(world: &mut World, mut lower: Local<Lower>, mut seen: Local<u64>, mut is_styled: Local<bool>) -> Result {
    let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
    let Ok(mut context) = contexts.single_mut(world) else { return Ok(()) };
    let context = context.get_mut().clone();
    if !std::mem::replace(&mut *is_styled, true) {
        style(&context);
    }
    world.resource_scope(|world, mut designer: Mut<Designer>| {
        let layer = egui::UiBuilder::new().layer_id(egui::LayerId::background()).max_rect(context.viewport_rect());
        let mut all = egui::Ui::new(context.clone(), "designer".into(), layer);
        egui::Panel::top("menu").show_inside(&mut all, |ui| {
            ui.horizontal_wrapped(|ui| {
                menu::menu(ui, world, &mut designer);
                ui.separator();
                if time_panel(ui, world) {
                    rest::reset(world, &mut designer);
                }
                ui.separator();
                menu::hands(ui, world, &mut designer);
            });
        });
        let problems = world.resource::<Problems>().count();
        if problems != *seen {
            (*seen, *lower) = (problems, Lower::Problems);
        }
        if replay::has_opened(world) {
            *lower = Lower::Timeline;
        }
        egui::Panel::bottom("status").show_inside(&mut all, |ui| status(ui, world, &designer, &mut lower));
        if *lower != Lower::None {
            egui::Panel::bottom("lower").resizable(true).default_size(120.0).show_inside(&mut all, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| match *lower {
                    Lower::Timeline => replay::panel(ui, world, &mut designer),
                    _ => problems_panel(ui, &mut world.resource_mut::<Problems>()),
                });
            });
        }
        egui::Panel::left("outline").resizable(true).default_size(170.0).show_inside(&mut all, |ui| {
            ui.horizontal(|ui| {
                ui.strong("Scene");
                menu::add(ui, world, &mut designer);
            });
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                outline_panel(ui, world, &mut designer.chosen);
            });
        });
        egui::Panel::right("selection").resizable(true).default_size(340.0).show_inside(&mut all, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| match designer.chosen {
                Some(entity) => entity_panel(ui, world, entity),
                None => {
                    ui.weak("Choose something in the tree or in the picture.");
                }
            });
        });
        let left = all.available_rect_before_wrap();
        designer.picture = Rect::from_corners(
            Vec2::new(left.min.x, left.min.y),
            Vec2::new(left.max.x.max(left.min.x + 8.0), left.max.y.max(left.min.y + 8.0)),
        );
        files::progress(&context, world, &mut designer);
        files::dialogs(&context, world, &mut designer);
        if designer.shows_help {
            keys::help(&context, &mut designer.shows_help);
        }
    });
    keys::press(world, &context);
    settle_when_idle(world, &context);
    Ok(())
}

/// Smaller than egui's own, so that more of the picture is left.
fn style(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
    context.all_styles_mut(|style| {
        style.spacing.item_spacing = egui::vec2(5.0, 3.0);
        style.interaction.tooltip_delay = 0.3;
        for (kind, font) in &mut style.text_styles {
            font.size = match kind {
                egui::TextStyle::Small => 9.5,
                egui::TextStyle::Heading => 15.0,
                _ => 12.0,
            };
        }
    });
}

fn status(ui: &mut egui::Ui, world: &World, designer: &Designer, lower: &mut Lower) {
    ui.horizontal(|ui| {
        let history = world.resource::<EditHistory>();
        let star = if history.has_unsaved() { "*" } else { "" };
        let name = designer.file.as_deref().and_then(|file| file.file_name()?.to_str()).unwrap_or("not saved yet");
        ui.label(format!("{name}{star}"))
            .on_hover_text("The scene's file; a star: something was edited since it was saved");
        ui.separator();
        ui.add(egui::Label::new(&designer.status).truncate()).on_hover_text(&designer.status);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let count = world.resource::<Problems>().list().count();
            for (panel, name, told) in [
                (Lower::Problems, format!("Problems ({count})"), "Files that cannot be read and the like"),
                (Lower::Timeline, "Timeline".into(), "What happened in a run"),
            ] {
                if ui.selectable_label(*lower == panel, name).on_hover_text(told).clicked() {
                    *lower = if *lower == panel { Lower::None } else { panel };
                }
            }
        });
    });
}
