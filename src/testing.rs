//! A test harness for this crate and for scenarios built with it.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_surgery::testing::TestApp;
//!
//! #[derive(Resource, Default)]
//! struct Steps(u32);
//!
//! let mut app = TestApp::cpu();
//! app.init_resource::<Steps>().add_systems(FixedUpdate, |mut steps: ResMut<Steps>| steps.0 += 1);
//! app.step(10);
//! assert_eq!(app.world().resource::<Steps>().0, 10);
//! ```
//!
//! [`TestApp::cpu`] runs on `MinimalPlugins`; `TestApp::gpu` draws into an image without a window. Time moves only in
//! [`TestApp::step`], by exact fixed steps. A harness fault (a broken shader, a wgpu error, a step that Bevy did not
//! run) panics with its reason, so that it fails the test.

use crate::SurgeryPlugins;
use bevy::app::PluginsState;
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::ops::{Deref, DerefMut};
use std::time::Duration;

#[cfg(feature = "render")]
mod gpu;
#[cfg(feature = "render")]
pub use gpu::{GpuTarget, headless_render_plugins};

/// An [`App`] under test; everything that an app can do, it can do.
pub struct TestApp {
    app: App,
    is_ready: bool,
    #[cfg(feature = "render")]
    target: Option<GpuTarget>,
}

/// Counts fixed steps, so that the harness can tell whether Bevy ran as many as were asked for.
#[derive(Resource, Default)]
struct StepCount(u64);

impl Deref for TestApp {
    type Target = App;

    fn deref(&self) -> &App {
        &self.app
    }
}

impl DerefMut for TestApp {
    fn deref_mut(&mut self) -> &mut App {
        &mut self.app
    }
}

impl TestApp {
    /// The models without a renderer: `MinimalPlugins`, assets, transforms and [`SurgeryPlugins`].
    pub fn cpu() -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin, assets(), SurgeryPlugins));
        Self::around(app)
    }

    fn around(mut app: App) -> Self {
        app.init_resource::<StepCount>()
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO))
            .add_systems(FixedLast, |mut count: ResMut<StepCount>| count.0 += 1);
        Self {
            app,
            is_ready: false,
            #[cfg(feature = "render")]
            target: None,
        }
    }

    /// Finishes the plugins and runs Bevy's first update, in which no fixed step ever happens.
    fn make_ready(&mut self) {
        if self.is_ready {
            return;
        }
        self.is_ready = true;
        while self.app.plugins_state() == PluginsState::Adding {
            bevy::tasks::tick_global_task_pools_on_main_thread();
        }
        self.app.finish();
        self.app.cleanup();
        self.app.update();
    }

    /// One update of the app in which no fixed step runs: for loading, capture and warm-up.
    pub fn idle(&mut self) {
        self.make_ready();
        self.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
        self.update_checked();
    }

    /// Runs exactly `count` fixed steps, one in each update.
    ///
    /// # Panics
    /// Where Bevy ran another number of steps, or drawing failed.
    pub fn step(&mut self, count: u32) {
        self.make_ready();
        for _ in 0..count {
            let before = self.app.world().resource::<StepCount>().0;
            self.app.insert_resource(TimeUpdateStrategy::FixedTimesteps(1));
            self.update_checked();
            let ran = self.app.world().resource::<StepCount>().0 - before;
            assert_eq!(ran, 1, "one fixed step was asked for and {ran} ran: is virtual time paused or scaled?");
        }
        self.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    }

    fn update_checked(&mut self) {
        self.app.update();
        #[cfg(feature = "render")]
        if self.target.is_some() {
            gpu::check(&mut self.app);
        }
        if let Some(exit) = self.app.should_exit() {
            assert!(exit.is_success(), "the app asked to exit: {exit:?}");
        }
    }

    /// Updates without stepping until `is_done` says so.
    ///
    /// # Panics
    /// After five minutes; the message says what was waited for.
    pub fn idle_until(&mut self, what: &str, mut is_done: impl FnMut(&mut App) -> bool) {
        let started = std::time::Instant::now();
        loop {
            self.idle();
            if is_done(&mut self.app) {
                return;
            }
            assert!(started.elapsed() < Duration::from_secs(300), "waited five minutes for {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Files outside the asset folder may be loaded where a caller insists (`LoadBuilder::override_unapproved`): tests
/// read real data from where it lies.
fn assets() -> AssetPlugin {
    AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Deny, ..default() }
}
