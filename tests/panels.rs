//! Panels, as a person uses them: egui's own test harness presses, drags and types.

#[path = "panels/controls.rs"]
mod controls;
#[path = "panels/history.rs"]
mod history;
#[path = "panels/runs.rs"]
mod runs;
#[path = "panels/volumes.rs"]
mod volumes;

use bevy::prelude::*;
use bevy_egui::egui;
use bevy_surgery::panels::{PanelsPlugin, entity_panel, settle_when_idle};
use bevy_surgery::testing::TestApp;
use egui_kittest::Harness;

/// An app whose panels are used.
pub fn app() -> TestApp {
    let mut app = TestApp::cpu();
    app.add_plugins(PanelsPlugin);
    app.step(0);
    app
}

/// An entity's panel, wide enough for everything.
pub fn panel(app: TestApp, entity: Entity) -> Harness<'static, TestApp> {
    shown(app, move |ui, world| entity_panel(ui, world, entity))
}

/// Anything of panels in a window of its own.
pub fn shown(app: TestApp, mut show: impl FnMut(&mut egui::Ui, &mut World) + 'static) -> Harness<'static, TestApp> {
    Harness::builder().with_size(egui::vec2(420.0, 2400.0)).with_max_steps(64).build_ui_state(
        move |ui, app: &mut TestApp| {
            show(ui, app.world_mut());
            let context = ui.ctx().clone();
            settle_when_idle(app.world_mut(), &context);
        },
        app,
    )
}
