//! Devices by name: looked for, opened and joined to tools without anything having to wait for a driver.

use super::{ServoSession, called};
use crate::haptics::device::hand::{Hand, HandBackend};
use crate::haptics::device::{DeviceBackend, DeviceFault, DeviceInfo, DeviceManager, DeviceNews, ManagedDevice};
use crate::haptics::servo::ServoSettings;
use crate::tools::Tool;
use bevy::prelude::*;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tracing::warn;

/// How often a device that is lost is looked for.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// All devices that this program can use. Insert it to use [`HoldDevice`]; clones are the same devices.
#[derive(Resource, Clone)]
pub struct Devices {
    manager: Arc<DeviceManager>,
    /// The program's end of the hand `hand:mouse`.
    pub mouse: Hand,
    /// The program's end of the hand `hand:gamepad`.
    pub gamepad: Hand,
}

impl Devices {
    /// All backends that the crate was built with.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn new() -> Result<Self, DeviceFault> {
        Self::with(Vec::new())
    }

    /// The same, and backends of your own.
    ///
    /// # Errors
    /// The system has no thread left.
    pub fn with(own: Vec<Box<dyn DeviceBackend>>) -> Result<Self, DeviceFault> {
        let hands = HandBackend::default();
        let (mouse, gamepad) = (hands.hand("mouse").unwrap_or_default(), hands.hand("gamepad").unwrap_or_default());
        let mut backends = DeviceManager::backends();
        backends.retain(|backend| backend.name() != hands.name());
        backends.push(Box::new(hands));
        backends.extend(own);
        Ok(Self { manager: Arc::new(DeviceManager::new(backends, LOOK_EVERY)?), mouse, gamepad })
    }

    /// The devices that are there now. Waits for drivers.
    pub fn list(&self) -> Vec<DeviceInfo> {
        self.manager.list()
    }

    /// Opens a device by its id, `haply:A14`; a backend's name alone is its first device. Waits for drivers.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn open(&self, id: &str) -> Result<ManagedDevice, DeviceFault> {
        self.manager.open(id)
    }

    /// What has happened with devices since the last call.
    pub fn news(&self) -> Vec<DeviceNews> {
        self.manager.news()
    }
}

/// A [`Tool`] beside which this stands is joined to a device as soon as that is open: then a [`ServoSession`] stands there, in a thread
/// of its own. Where it cannot be opened there is a [`DeviceRefused`], and the program goes on.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct HoldDevice {
    /// Its id: `haply:A14`, `openhaptics`, `hand:mouse`.
    pub id: String,
    /// How the loop runs.
    pub settings: ServoSettings,
}

impl HoldDevice {
    /// A device by its id.
    pub fn new(id: impl Into<String>) -> Self {
        Self { id: id.into(), settings: ServoSettings::default() }
    }
}

/// Why the device of a [`HoldDevice`] is not in use.
#[derive(Component, Clone, Debug, PartialEq, Reflect)]
#[reflect(Component, Clone)]
pub struct DeviceRefused(pub DeviceFault);

/// A device that is being opened.
#[derive(Component)]
struct Opening(Mutex<Receiver<Result<ManagedDevice, DeviceFault>>>);

pub(super) fn build(app: &mut App) {
    app.register_type::<HoldDevice>()
        .register_type::<DeviceRefused>()
        .add_observer(let_go)
        .add_systems(PreUpdate, (begin_opening, end_opening).chain().run_if(resource_exists::<Devices>));
}

/// Another device, or none: the old one is put down first.
fn let_go(removed: On<Remove, HoldDevice>, mut commands: Commands) {
    if let Ok(mut tool) = commands.get_entity(removed.entity) {
        tool.try_remove::<(ServoSession, Opening, DeviceRefused)>();
    }
}

fn begin_opening(
    mut commands: Commands,
    tools: Query<(Entity, &HoldDevice), (With<Tool>, Changed<HoldDevice>)>,
    devices: Res<Devices>,
) {
    for (entity, hold) in &tools {
        let (sender, receiver) = channel();
        let (devices, id) = (devices.clone(), hold.id.clone());
        let opens = std::thread::Builder::new().name("haptics-open".into()).spawn(move || {
            // Nobody may wait for it any more.
            drop(sender.send(devices.open(&id)));
        });
        let mut tool = commands.entity(entity);
        tool.try_remove::<(ServoSession, DeviceRefused)>();
        match opens {
            Ok(_) => tool.try_insert(Opening(Mutex::new(receiver))),
            Err(error) => tool.try_insert(DeviceRefused(no_thread(&hold.id, &error))),
        };
    }
}

fn no_thread(id: &str, error: &std::io::Error) -> DeviceFault {
    DeviceFault::Gone { id: id.into(), reason: error.to_string() }
}

fn end_opening(mut commands: Commands, tools: Query<(Entity, &Opening, &HoldDevice, Option<&Name>)>) {
    for (entity, Opening(receiver), hold, name) in &tools {
        let opened = match receiver.lock().unwrap_or_else(PoisonError::into_inner).try_recv() {
            Ok(opened) => opened,
            Err(TryRecvError::Empty) => continue,
            Err(TryRecvError::Disconnected) => {
                Err(DeviceFault::Gone { id: hold.id.clone(), reason: "its driver has panicked".into() })
            }
        };
        let started = opened.and_then(|device| {
            ServoSession::start(Box::new(device), hold.settings).map_err(|error| no_thread(&hold.id, &error))
        });
        let mut tool = commands.entity(entity);
        tool.try_remove::<Opening>();
        match started {
            Ok(session) => tool.try_insert(session),
            Err(fault) => {
                warn!("{} has no device: {fault}", called(entity, name));
                tool.try_insert(DeviceRefused(fault))
            }
        };
    }
}
