//! A tool joined to a device of the hand: the [`ServoSession`] beside it runs the servo loop.
//!
//! In [`SurgerySystems::Sense`] the newest state of the loop becomes the tool's pose, command and force; in
//! [`SurgerySystems::Publish`] the loop is told what is near: organs, what is left of bone, how soft bodies answered. In between
//! neither waits for the other. A session that is *stepped* has no thread: its ticks are done in `Sense`, always the same.

mod bones;
mod controls;
mod kept;
mod open;
mod organs;
mod publish;
mod read;
mod soft;

pub use controls::{DeviceControl, ToolControls};
pub use open::{DeviceRefused, Devices, HoldDevice};

use kept::Kept;

use crate::haptics::device::{DeviceInfo, HapticDevice};
use crate::haptics::servo::{ServoEngine, ServoFault, ServoLink, ServoSettings, ServoState, ServoThread};
use crate::schedule::SurgerySystems;
use crate::tools::ToolRig;
use bevy::platform::cell::SyncCell;
use bevy::prelude::*;
use std::io;

/// Joins the [`Tool`](super::Tool) beside it to a device.
#[derive(Component)]
#[require(ToolRig, ToolControls, ServoReading)]
pub struct ServoSession {
    // Only ever used by who has it alone: devices need not be shared between threads.
    runner: SyncCell<Runner>,
    link: SyncCell<ServoLink>,
    is_threaded: bool,
    device: DeviceInfo,
    settings: ServoSettings,
    memory: Memory,
}

enum Runner {
    /// Ends when it is dropped.
    Thread(#[allow(dead_code, reason = "kept alive")] ServoThread),
    /// The loop, and the time that it has not lived through yet, seconds.
    Steps(Box<ServoEngine>, f64),
}

/// What is remembered between steps.
#[derive(Default)]
struct Memory {
    last: ServoState,
    organs: Kept<organs::ToldOrgan>,
    bones: Kept<bones::ToldBone>,
    soft: Kept<soft::Answer>,
}

/// The newest state of a tool's servo loop, for panels and reports.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ServoReading {
    /// The device, `backend:serial`.
    pub device: String,
    /// The loop after its last tick.
    pub state: ServoState,
}

/// Something went wrong in the servo loop of a tool. Written in
/// [`SurgerySystems::Sense`], once per fault; also told in the log.
#[derive(Message, Clone, Debug, PartialEq, Reflect)]
pub struct ServoFaulted {
    /// The tool.
    pub tool: Entity,
    /// What.
    pub fault: ServoFault,
}

impl ServoSession {
    /// Starts the loop in a thread of its own.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn start(device: Box<dyn HapticDevice>, settings: ServoSettings) -> io::Result<Self> {
        let info = device.info().clone();
        let (engine, link) = ServoEngine::new(device, settings);
        let thread = ServoThread::start(engine)?;
        Ok(Self::new(Runner::Thread(thread), link, info, settings))
    }

    /// A loop that is stepped by the simulation: as many ticks per step as fit into its time, deterministically.
    pub fn stepped(device: Box<dyn HapticDevice>, settings: ServoSettings) -> Self {
        let info = device.info().clone();
        let (engine, link) = ServoEngine::new(device, settings);
        Self::new(Runner::Steps(Box::new(engine), 0.0), link, info, settings)
    }

    fn new(runner: Runner, link: ServoLink, device: DeviceInfo, settings: ServoSettings) -> Self {
        let is_threaded = matches!(runner, Runner::Thread(_));
        let (runner, link) = (SyncCell::new(runner), SyncCell::new(link));
        Self { runner, link, is_threaded, device, settings, memory: Memory::default() }
    }

    /// The device.
    pub fn device(&self) -> &DeviceInfo {
        &self.device
    }

    /// Whether it has a thread.
    pub fn is_threaded(&self) -> bool {
        self.is_threaded
    }

    /// Lives through a step, where that is ours to do.
    fn advance(&mut self, dt_s: f64) {
        let Runner::Steps(engine, owed_s) = self.runner.get() else { return };
        let period_s = self.settings.period_s();
        *owed_s += dt_s;
        // Half a period is not worth a tick; so rounding never costs one.
        while *owed_s >= 0.5 * period_s {
            engine.tick(period_s);
            *owed_s -= period_s;
        }
    }
}

/// In [`SurgerySystems::Sense`]: devices become poses, commands and forces.
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SenseDevices;

/// What a tool is called in messages.
fn called(tool: Entity, name: Option<&Name>) -> String {
    name.map_or_else(|| format!("tool {tool}"), |name| format!("tool \"{name}\""))
}

pub(super) fn build(app: &mut App) {
    app.register_type::<ServoReading>()
        .register_type::<ToolControls>()
        .register_type::<DeviceControl>()
        .register_type::<ServoFaulted>()
        .add_message::<ServoFaulted>()
        .add_systems(FixedUpdate, read::read_devices.in_set(SenseDevices).in_set(SurgerySystems::Sense));
    publish::build(app);
    open::build(app);
}
