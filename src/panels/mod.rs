//! Panels for designers, in egui: what a scene is made of, set by hand, undone and done again. Behind the feature `panels`.
//!
//! Each panel is a function that draws into an [`egui::Ui`](bevy_egui::egui::Ui), so that they fit into any layout; the example
//! `designer` puts all of them round a picture.
//!
//! - [`outline_panel`] shows the scene as a tree, [`entity_panel`] all that an entity is made of: skins with their presets, reactions,
//!   the profile of highlights, transfer functions over their histogram, structures, pools, lattices, instruments and devices,
//!   microscopes and stereo. Names, units and tooltips of fields come from the components themselves ([`fields`]).
//! - What is changed there can be undone ([`EditHistory`], [`undo`], [`redo`]); a program's own edits too: [`edit`],
//!   [`note_added`], [`remove`].
//! - [`time_panel`] plays, pauses and steps; [`timeline_panel`] shows a run's log; [`problems_panel`] what went wrong.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_egui::{EguiContexts, EguiPlugin, EguiPrimaryContextPass, PrimaryEguiContext, EguiContext, egui};
//! use bevy_surgery::panels::{PanelsPlugin, entity_panel, outline_panel, settle_when_idle};
//! use bevy_surgery::prelude::*;
//!
//! fn panels(world: &mut World, mut chosen: Local<Option<Entity>>) -> Result {
//!     let mut contexts = world.query_filtered::<&mut EguiContext, With<PrimaryEguiContext>>();
//!     let context = contexts.single_mut(world)?.get_mut().clone();
//!     egui::Window::new("Scene").show(&context, |ui| {
//!         outline_panel(ui, world, &mut chosen);
//!         if let Some(entity) = *chosen {
//!             entity_panel(ui, world, entity);
//!         }
//!     });
//!     settle_when_idle(world, &context);
//!     Ok(())
//! }
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, SurgeryPlugins, EguiPlugin::default(), PanelsPlugin))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         commands.queue(|world: &mut World| world.spawn_scene(liver_scene()).map(|_| ()));
//!     })
//!     .add_systems(EguiPrimaryContextPass, panels)
//!     .run();
//! ```

mod camera;
pub mod fields;
mod history;
mod lattice;
mod organ;
mod outline;
mod plot;
mod pool;
mod problems;
mod selection;
mod structures;
mod time;
mod timeline;
mod tools;
mod transfer;

pub use history::{
    EditHistory, clear, edit, edit_component, note_added, note_change, redo, remove, settle, settle_when_idle, undo,
};
pub use outline::{outline, outline_panel};
pub use problems::{Problems, problems_panel};
pub use selection::entity_panel;
pub use time::{change_speed, single_step, time_panel, toggle_pause};
pub use timeline::{Timeline, TimelineEvent, TimelineKind, timeline_panel};
pub use tools::ready_tools;

use bevy::prelude::*;
use bevy_inspector_egui::DefaultInspectorConfigPlugin;

/// What panels need beside egui itself: the history of edits, the list of problems. Add it after
/// [`SurgeryPlugins`](crate::SurgeryPlugins); `EguiPlugin` is the program's.
pub struct PanelsPlugin;

impl Plugin for PanelsPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<DefaultInspectorConfigPlugin>() {
            app.add_plugins(DefaultInspectorConfigPlugin);
        }
        app.init_resource::<EditHistory>()
            .init_resource::<Problems>()
            .init_resource::<transfer::Histograms>()
            .init_resource::<tools::FoundDevices>()
            .register_type::<Problems>()
            .add_systems(PreUpdate, (problems::collect, transfer::forget_changed));
    }
}
