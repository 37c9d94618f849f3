//! What went wrong: in one list, and never the end of a program.

use crate::organ::OrganLoadFailed;
use crate::pool::PoolFault;
use crate::tools::DeviceRefused;
use crate::volume::VolumeLoadFailed;
use bevy::asset::{AssetLoadError, UntypedAssetLoadFailedEvent};
use bevy::prelude::*;
use bevy_egui::egui;
use std::collections::VecDeque;

/// Most problems that are kept.
const MOST: usize = 200;

/// What went wrong, the oldest first. Files that cannot be read, organs and volumes that cannot be made, pools that cannot flow and
/// devices that refuse are noted by themselves.
#[derive(Resource, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone)]
pub struct Problems {
    list: VecDeque<String>,
    /// Problems since the beginning.
    count: u64,
}

impl Problems {
    /// Notes a problem, by the first line of it; one like the last few is not noted again.
    pub fn note(&mut self, problem: impl Into<String>) {
        let problem: String = problem.into();
        // What follows is where in the program it came up.
        let problem = problem.lines().next().unwrap_or_default().to_owned();
        if self.list.iter().rev().take(5).any(|last| last.contains(&problem)) {
            return;
        }
        self.list.push_back(problem);
        self.count += 1;
        if self.list.len() > MOST {
            self.list.pop_front();
        }
    }

    /// The problems, the oldest first.
    pub fn list(&self) -> impl DoubleEndedIterator<Item = &str> {
        self.list.iter().map(String::as_str)
    }

    /// Forgets all of them.
    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// Problems since the beginning, to tell whether there is a new one.
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// Notes what other parts of the crate and Bevy's assets complain of.
pub(super) fn collect(
    mut problems: ResMut<Problems>,
    mut assets: MessageReader<UntypedAssetLoadFailedEvent>,
    organs: Query<(&OrganLoadFailed, Option<&Name>), Added<OrganLoadFailed>>,
    volumes: Query<(&VolumeLoadFailed, Option<&Name>), Added<VolumeLoadFailed>>,
    pools: Query<(&PoolFault, Option<&Name>), Changed<PoolFault>>,
    devices: Query<(&DeviceRefused, Option<&Name>), Added<DeviceRefused>>,
) {
    let of = |name: Option<&Name>| name.map_or_else(String::new, |name| format!("{name}: "));
    // These name their file.
    for (failed, _) in &organs {
        problems.note(failed.0.to_string());
    }
    for (failed, _) in &volumes {
        problems.note(failed.0.to_string());
    }
    for failed in assets.read() {
        problems.note(match &failed.error {
            AssetLoadError::AssetLoaderError(error) => error.error().to_string(),
            other => format!("{}: {other}", failed.path),
        });
    }
    for (fault, name) in &pools {
        problems.note(format!("{}{}", of(name), fault.0));
    }
    for (refused, name) in &devices {
        problems.note(format!("{}{}", of(name), refused.0));
    }
}

/// The list, the newest first.
pub fn problems_panel(ui: &mut egui::Ui, problems: &mut Problems) {
    if problems.list.is_empty() {
        ui.weak("No problems.");
        return;
    }
    ui.horizontal(|ui| {
        ui.strong(format!("{} problems", problems.list.len()));
        if ui.small_button("Clear").on_hover_text("Forgets these problems").clicked() {
            problems.clear();
        }
    });
    for problem in problems.list().rev() {
        ui.colored_label(ui.visuals().error_fg_color, problem).on_hover_text(problem);
    }
}
