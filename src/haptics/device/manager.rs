//! All backends under one roof: lists what there is, opens it, and takes up again what comes back.
//!
//! Listing and opening take their time, and drivers may hang, so that a thread of its own does both. A [`ManagedDevice`] that is
//! lost says so, and goes on when the thread has found it again.

use super::{DeviceBackend, DeviceFault, DeviceInfo, DeviceOutput, DeviceSample, HapticDevice, serial};
use bevy::reflect::Reflect;
use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

/// What happened with devices, for people. Each is told once.
#[derive(Clone, Debug, PartialEq, Reflect, thiserror::Error)]
pub enum DeviceNews {
    /// A library or service is missing; the others go on.
    #[error("no {backend} devices: {fault}")]
    BackendMissing {
        /// Which backend.
        backend: String,
        /// Why.
        fault: DeviceFault,
    },
    /// It answers now.
    #[error("{backend} devices can be used now")]
    BackendFound {
        /// Which backend.
        backend: String,
    },
    /// An open device is lost and looked for.
    #[error("{fault}; looking for {id} until it is back")]
    Lost {
        /// Which device.
        id: String,
        /// Why.
        fault: DeviceFault,
    },
    /// It is back and in use again.
    #[error("{id} is back")]
    Found {
        /// Which device.
        id: String,
    },
}

enum Request {
    List(Sender<Vec<DeviceInfo>>),
    /// With an end of the channel for the device, by which it can say that it is lost.
    Open(String, Sender<Request>, Sender<Result<ManagedDevice, DeviceFault>>),
    Lost(Lost),
}

/// A device that is looked for.
struct Lost {
    id: String,
    fault: DeviceFault,
    /// What is left of it: dropped here, because drivers take their time to close.
    device: Option<Box<dyn HapticDevice>>,
    back: Sender<Box<dyn HapticDevice>>,
    /// Whether anyone waits for it.
    waiting: Weak<()>,
}

type News = Arc<Mutex<VecDeque<DeviceNews>>>;

/// News that nobody asks for do not pile up.
const NEWS: usize = 256;

/// Keeps the backends. Open devices outlive it, and are still looked for when they are lost.
pub struct DeviceManager {
    requests: Sender<Request>,
    news: News,
}

impl DeviceManager {
    /// Keeps these backends; looks for what is lost once in a while.
    ///
    /// # Errors
    /// [`DeviceFault::Service`] where the system gives no thread.
    pub fn new(backends: Vec<Box<dyn DeviceBackend>>, look_every: Duration) -> Result<Self, DeviceFault> {
        let (requests, received) = channel();
        let news = News::default();
        let keeper = Keeper { backends, news: news.clone(), missing: BTreeMap::new(), lost: Vec::new() };
        let keeper =
            std::thread::Builder::new().name("haptics-devices".into()).spawn(move || keeper.run(&received, look_every));
        match keeper {
            Ok(_) => Ok(Self { requests, news }),
            Err(error) => Err(DeviceFault::Service {
                service: "the keeper of devices".into(),
                address: "this program".into(),
                reason: error.to_string(),
            }),
        }
    }

    /// All backends that this program was built with, as they are set from the start.
    pub fn backends() -> Vec<Box<dyn DeviceBackend>> {
        vec![
            Box::new(super::NoBackend),
            Box::new(super::hand::HandBackend::default()),
            Box::new(super::simulated::SimulatedBackend::default()),
            Box::new(super::recording::ReplayBackend),
            #[cfg(feature = "haply")]
            Box::new(super::haply::HaplyBackend::default()),
            #[cfg(feature = "openhaptics")]
            Box::new(super::openhaptics::OpenHapticsBackend::default()),
            #[cfg(feature = "force_dimension")]
            Box::new(super::force_dimension::ForceDimensionBackend::default()),
            #[cfg(feature = "spacemouse")]
            Box::new(super::spacemouse::SpaceMouseBackend::default()),
        ]
    }

    /// The devices that are there now, of all backends. A backend that is missing is in the news, once, and leaves the others
    /// be. Waits for drivers: not for the servo loop.
    pub fn list(&self) -> Vec<DeviceInfo> {
        let (reply, answer) = channel();
        let _ = self.requests.send(Request::List(reply));
        answer.recv().unwrap_or_default()
    }

    /// Opens a device by its id, `haply:A14`; a backend's name alone is its first device. Waits for drivers.
    ///
    /// # Errors
    /// [`DeviceFault`]; [`DeviceFault::NotFound`] names the nearest spelling first.
    pub fn open(&self, id: &str) -> Result<ManagedDevice, DeviceFault> {
        let (reply, answer) = channel();
        let _ = self.requests.send(Request::Open(id.into(), self.requests.clone(), reply));
        answer.recv().unwrap_or_else(|_| {
            Err(DeviceFault::Gone { id: id.into(), reason: "the keeper of devices has ended".into() })
        })
    }

    /// What has happened since the last call, oldest first.
    pub fn news(&self) -> Vec<DeviceNews> {
        self.news.lock().unwrap_or_else(PoisonError::into_inner).drain(..).collect()
    }
}

/// A device of a [`DeviceManager`]: when it is lost, it says [`DeviceFault::Away`] until it is back, and then goes on.
pub struct ManagedDevice {
    info: DeviceInfo,
    device: Option<Box<dyn HapticDevice>>,
    requests: Sender<Request>,
    back: Receiver<Box<dyn HapticDevice>>,
    back_for_keeper: Sender<Box<dyn HapticDevice>>,
    waiting: Arc<()>,
    away: DeviceFault,
}

impl ManagedDevice {
    fn new(device: Box<dyn HapticDevice>, requests: Sender<Request>) -> Self {
        let info = device.info().clone();
        let (back_for_keeper, back) = channel();
        let away = DeviceFault::Away { id: info.id.clone(), reason: String::new() };
        Self { info, device: Some(device), requests, back, back_for_keeper, waiting: Arc::new(()), away }
    }

    /// The device, taken up again if it is back.
    fn device(&mut self) -> Result<&mut Box<dyn HapticDevice>, DeviceFault> {
        if self.device.is_none() {
            self.device = self.back.try_recv().ok();
        }
        self.device.as_mut().ok_or_else(|| self.away.clone())
    }

    /// Gives a device that is lost to the keeper.
    fn checked<T>(&mut self, result: Result<T, DeviceFault>) -> Result<T, DeviceFault> {
        let Err(fault) = &result else { return result };
        if !fault.is_over() {
            return result;
        }
        let Some(device) = self.device.take() else { return result };
        let id = self.info.id.clone();
        self.away = DeviceFault::Away { id: id.clone(), reason: fault.to_string() };
        let lost = Lost {
            id,
            fault: fault.clone(),
            device: Some(device),
            back: self.back_for_keeper.clone(),
            waiting: Arc::downgrade(&self.waiting),
        };
        let _ = self.requests.send(Request::Lost(lost));
        Err(self.away.clone())
    }
}

impl HapticDevice for ManagedDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let read = self.device()?.read();
        self.checked(read)
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let written = self.device()?.write(output);
        self.checked(written)
    }
}

/// The thread's side.
struct Keeper {
    backends: Vec<Box<dyn DeviceBackend>>,
    news: News,
    /// Backends that gave a fault when they were last asked, and which.
    missing: BTreeMap<&'static str, DeviceFault>,
    lost: Vec<Lost>,
}

impl Keeper {
    /// Serves until the manager and all its devices are gone.
    fn run(mut self, requests: &Receiver<Request>, look_every: Duration) {
        let mut look_at = Instant::now();
        loop {
            let request = if self.lost.is_empty() {
                requests.recv().map_err(|_| RecvTimeoutError::Disconnected)
            } else {
                requests.recv_timeout(look_at.saturating_duration_since(Instant::now()))
            };
            match request {
                Ok(Request::List(reply)) => {
                    let _ = reply.send(self.list());
                }
                Ok(Request::Open(id, requests, reply)) => {
                    let _ = reply.send(self.open(&id).map(|device| ManagedDevice::new(device, requests)));
                }
                Ok(Request::Lost(mut lost)) => {
                    lost.device = None;
                    self.tell(DeviceNews::Lost { id: lost.id.clone(), fault: lost.fault.clone() });
                    self.lost.push(lost);
                    look_at = Instant::now() + look_every;
                }
                Err(RecvTimeoutError::Timeout) => {
                    self.look();
                    look_at = Instant::now() + look_every;
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }

    fn tell(&self, news: DeviceNews) {
        match news {
            DeviceNews::Lost { .. } | DeviceNews::BackendMissing { .. } => tracing::warn!("{news}"),
            _ => tracing::info!("{news}"),
        }
        let mut all = self.news.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() >= NEWS {
            all.pop_front();
        }
        all.push_back(news);
    }

    fn list(&mut self) -> Vec<DeviceInfo> {
        let mut devices = Vec::new();
        let mut news = Vec::new();
        for backend in &mut self.backends {
            let name = backend.name();
            match backend.list() {
                Ok(found) => {
                    devices.extend(found);
                    if self.missing.remove(name).is_some() {
                        news.push(DeviceNews::BackendFound { backend: name.into() });
                    }
                }
                Err(fault) => {
                    if self.missing.insert(name, fault.clone()).as_ref() != Some(&fault) {
                        news.push(DeviceNews::BackendMissing { backend: name.into(), fault });
                    }
                }
            }
        }
        news.into_iter().for_each(|news| self.tell(news));
        devices
    }

    fn open(&mut self, id: &str) -> Result<Box<dyn HapticDevice>, DeviceFault> {
        let name = id.split(':').next().unwrap_or(id);
        let Some(backend) = self.backends.iter_mut().find(|backend| backend.name() == name) else {
            return Err(self.not_found(id));
        };
        let mut wanted = id.to_string();
        if serial(id, name).is_empty() || serial(id, name) == name {
            match backend.list()?.into_iter().next() {
                Some(first) => wanted = first.id,
                None => return Err(self.not_found(id)),
            }
        }
        match backend.open(&wanted) {
            Err(DeviceFault::NotFound { .. }) => Err(self.not_found(id)),
            opened => opened,
        }
    }

    /// Says what there is, the nearest spelling first.
    fn not_found(&mut self, id: &str) -> DeviceFault {
        let mut there: Vec<_> = self.list().into_iter().map(|device| device.id).collect();
        there.sort_by_cached_key(|candidate| distance(id, candidate));
        let nearest = there.first_mut().filter(|first| distance(id, first) <= 1 + id.chars().count() / 3);
        if let Some(nearest) = nearest {
            *nearest += " (did you mean this one?)";
        }
        DeviceFault::NotFound { id: id.into(), there: if there.is_empty() { "none".into() } else { there.join(", ") } }
    }

    /// Takes up again what is back.
    fn look(&mut self) {
        let mut still = Vec::new();
        for lost in std::mem::take(&mut self.lost) {
            if lost.waiting.strong_count() == 0 {
                continue;
            }
            match self.open_again(&lost.id) {
                Some(device) => {
                    if lost.back.send(device).is_ok() {
                        self.tell(DeviceNews::Found { id: lost.id });
                    }
                }
                None => still.push(lost),
            }
        }
        self.lost = still;
    }

    fn open_again(&mut self, id: &str) -> Option<Box<dyn HapticDevice>> {
        let name = id.split(':').next()?;
        self.backends.iter_mut().find(|backend| backend.name() == name)?.open(id).ok()
    }
}

/// Letters to change, add or leave out to make one word of the other.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, other) in b.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
