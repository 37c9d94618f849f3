//! A connection with the service, and the thread that keeps it.

use super::wire::{Arm, Frame, Order, message, version};
use super::{HaplyFormat, HaplySettings, info};
use crate::haptics::device::link::Link;
use crate::haptics::device::{DeviceFault, DeviceInfo, DeviceSample, device_clock_s};
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket};

/// Connecting, shaking hands and asking for the version take no longer than this each.
const PATIENCE: Duration = Duration::from_millis(500);
/// An answer is awaited this long before the next message goes out all the same: the newest force must not wait.
const ANSWER: Duration = Duration::from_millis(20);
/// Without an open device there is no hurry.
const IDLE: Duration = Duration::from_millis(20);
/// No frame of the service is nearly as long.
const LONGEST_MESSAGE: usize = 1 << 20;
/// So many messages that are none, one after another, are not this service.
const MOST_GARBAGE: u32 = 100;

/// A connection that is kept until its last device is closed and it is dropped.
pub(super) struct Session(Arc<Shared>);

struct Shared {
    settings: HaplySettings,
    /// Whether the service is of version 3.5 or newer.
    is_new: bool,
    known: Mutex<Known>,
    closing: AtomicBool,
    ended: AtomicBool,
}

#[derive(Default)]
struct Known {
    has_answered: bool,
    /// In the order in which the service has them.
    arms: Vec<KnownArm>,
    grips: Vec<KnownGrip>,
    open: BTreeMap<String, Open>,
}

struct KnownArm {
    id: String,
    is_minverse: bool,
    seen: Instant,
}

struct KnownGrip {
    id: String,
    orientation: DQuat,
    buttons: u32,
    seen: Instant,
}

struct Open {
    link: Arc<Link>,
    /// Whether the service was told what workspace to use.
    is_set_up: bool,
    /// Whether its handle may be pushed.
    is_ready: bool,
}

/// What is said when the service is not there.
pub(super) fn unanswered(settings: &HaplySettings, reason: String) -> DeviceFault {
    let address = format!("ws://{}:{}", settings.host, settings.port);
    DeviceFault::Service { service: "Haply's service".into(), address, reason }
}

impl Session {
    pub fn connect(settings: &HaplySettings) -> Result<Self, DeviceFault> {
        let failed = |reason: String| unanswered(settings, reason);
        let stream = reach(settings).map_err(|error| failed(error.to_string()))?;
        let address = stream.peer_addr().map_err(|error| failed(error.to_string()))?;
        let is_new = match settings.format {
            HaplyFormat::Vector => true,
            HaplyFormat::Values => false,
            HaplyFormat::Auto => ask_version(address, settings).is_some_and(|version| version >= (3, 5)),
        };
        let url = format!("ws://{}:{}/", settings.host, settings.port);
        let config =
            WebSocketConfig::default().max_message_size(Some(LONGEST_MESSAGE)).max_frame_size(Some(LONGEST_MESSAGE));
        let (socket, _) = tungstenite::client::client_with_config(url, stream, Some(config))
            .map_err(|error| failed(error.to_string()))?;
        let shared = Arc::new(Shared {
            settings: settings.clone(),
            is_new,
            known: Mutex::default(),
            closing: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let kept = shared.clone();
        let thread = std::thread::Builder::new().name("haptics-haply".into());
        thread.spawn(move || kept.keep(socket)).map_err(|error| failed(error.to_string()))?;
        Ok(Self(shared))
    }

    pub fn has_ended(&self) -> bool {
        self.0.ended.load(Ordering::Acquire)
    }

    /// The arms that are there; waits a little for the first answer.
    pub fn devices(&self) -> Vec<DeviceInfo> {
        let end = Instant::now() + PATIENCE;
        while !self.0.known().has_answered && !self.has_ended() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(1));
        }
        let known = self.0.known();
        let lost_after = self.0.lost_after();
        let arms = known.arms.iter().filter(|arm| arm.seen.elapsed() < lost_after);
        arms.map(|arm| info(&arm.id, arm.is_minverse, self.0.grip_of(&known, &arm.id).is_some())).collect()
    }

    pub fn open(&self, id: &str) -> Arc<Link> {
        let waiting =
            DeviceFault::Warning { id: format!("haply:{id}"), reason: "it has not said where it is yet".into() };
        let link = Link::new(Err(waiting), seconds(self.0.settings.hold_s));
        let open = Open { link: link.clone(), is_set_up: false, is_ready: false };
        if let Some(before) = self.0.known().open.insert(id.into(), open) {
            let reason = "it was opened a second time".into();
            before.link.put(Err(DeviceFault::Gone { id: format!("haply:{id}"), reason }));
            before.link.set_closed();
        }
        // The thread that would have served it may just have ended.
        if self.has_ended() {
            self.0.lose_all("the connection has ended");
        }
        link
    }
}

impl Drop for Session {
    /// Lets the thread end, and waits a little where nothing is open, so that the service hears of it.
    fn drop(&mut self) {
        self.0.closing.store(true, Ordering::Release);
        let end = Instant::now() + Duration::from_millis(200);
        while self.0.known().open.is_empty() && !self.has_ended() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds).unwrap_or_default()
}

fn reach(settings: &HaplySettings) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::new(ErrorKind::NotFound, "this machine is not known");
    for address in (settings.host.as_str(), settings.port).to_socket_addrs()? {
        match connect(address) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

fn connect(address: SocketAddr) -> std::io::Result<TcpStream> {
    let stream = TcpStream::connect_timeout(&address, PATIENCE)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    Ok(stream)
}

/// Services from 3.5 on answer questions at the same port; older ones do not.
fn ask_version(address: SocketAddr, settings: &HaplySettings) -> Option<(u32, u32)> {
    let mut stream = connect(address).ok()?;
    let host = &settings.host;
    write!(stream, "GET /version HTTP/1.1\r\nHost: {host}\r\nAccept: */*\r\nConnection: close\r\n\r\n").ok()?;
    let (mut answer, mut buffer) = (Vec::new(), [0; 1024]);
    let end = Instant::now() + PATIENCE;
    // What has come until the service closes, says enough, or falls silent.
    while answer.len() < 16 * 1024 && Instant::now() < end {
        match stream.read(&mut buffer) {
            Ok(0) | Err(_) => break,
            Ok(length) => answer.extend(&buffer[..length]),
        }
    }
    version(&String::from_utf8_lossy(&answer))
}

impl Shared {
    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn lost_after(&self) -> Duration {
        seconds(self.settings.lost_after_s)
    }

    /// The thread: exchanges messages until nobody needs it, or the service is gone.
    fn keep(&self, mut socket: WebSocket<TcpStream>) {
        let reason = match self.exchange(&mut socket) {
            Ok(()) => "the session was closed".into(),
            Err(Error::ConnectionClosed | Error::AlreadyClosed) => "the service has closed the connection".into(),
            Err(error) => error.to_string(),
        };
        self.ended.store(true, Ordering::Release);
        self.lose_all(&reason);
    }

    fn lose_all(&self, reason: &str) {
        for (id, open) in std::mem::take(&mut self.known().open) {
            open.link.put(Err(DeviceFault::Gone { id: format!("haply:{id}"), reason: reason.into() }));
            open.link.set_closed();
        }
    }

    fn exchange(&self, socket: &mut WebSocket<TcpStream>) -> Result<(), Error> {
        let period = seconds(self.settings.exchange_period_s);
        let mut profile = self.is_new.then_some(self.settings.profile.as_str());
        let mut inbox = Inbox { answered: Instant::now(), garbage: 0 };
        loop {
            let begun = Instant::now();
            // What came late is older than what the next message will be answered with.
            socket.get_ref().set_nonblocking(true)?;
            while self.receive(socket, &mut inbox)? {}
            socket.get_ref().set_nonblocking(false)?;
            let (text, closing) = self.message(profile.take());
            socket.send(Message::text(text))?;
            for id in closing {
                // It may have been opened anew in the meantime.
                let mut known = self.known();
                if known.open.get(&id).is_some_and(|open| open.link.is_closing())
                    && let Some(open) = known.open.remove(&id)
                {
                    open.link.set_closed();
                }
            }
            let is_idle = self.known().open.is_empty();
            if is_idle && self.closing.load(Ordering::Acquire) {
                let _ = socket.close(None);
                return Ok(());
            }
            socket.get_ref().set_read_timeout(Some(ANSWER))?;
            self.receive(socket, &mut inbox)?;
            if inbox.answered.elapsed() > self.lost_after() {
                return Err(Error::Io(ErrorKind::TimedOut.into()));
            }
            self.drop_lost();
            std::thread::sleep((if is_idle { IDLE } else { period }).saturating_sub(begun.elapsed()));
        }
    }

    /// Takes one message in, if there is one.
    fn receive(&self, socket: &mut WebSocket<TcpStream>, inbox: &mut Inbox) -> Result<bool, Error> {
        let text = match socket.read() {
            Ok(Message::Text(text)) => text,
            Ok(Message::Close(_)) => return Err(Error::ConnectionClosed),
            Ok(_) => return Ok(true),
            Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                return Ok(false);
            }
            Err(error) => return Err(error),
        };
        match Frame::read(&text) {
            Ok(frame) => {
                *inbox = Inbox { answered: Instant::now(), garbage: 0 };
                self.take(&frame);
            }
            Err(error) => {
                inbox.garbage += 1;
                if inbox.garbage >= MOST_GARBAGE {
                    let reason = format!("what answers is not Haply's service: {error}");
                    return Err(Error::Io(std::io::Error::new(ErrorKind::InvalidData, reason)));
                }
            }
        }
        Ok(true)
    }

    /// The next message, and the devices that it leaves without force for good.
    fn message(&self, profile: Option<&str>) -> (String, Vec<String>) {
        let mut known = self.known();
        let haply_from_device = self.settings.device_from_haply.inverse();
        let order = |(id, open): (_, &mut Open)| {
            let force_n = if open.is_ready { open.link.output().force_n } else { DVec3::ZERO };
            let preset =
                (self.is_new && !std::mem::replace(&mut open.is_set_up, true)).then_some(&*self.settings.preset);
            Order { device_id: id, force_n: haply_from_device * force_n, preset }
        };
        // Asked before the forces are: who closes from now on is left without force by the next message.
        let closing: Vec<_> =
            known.open.iter().filter(|(_, open)| open.link.is_closing()).map(|(id, _)| id.clone()).collect();
        let orders: Vec<_> = known.open.iter_mut().map(|(id, open)| order((id.as_str(), open))).collect();
        (message(&orders, self.is_new, profile), closing)
    }

    /// Takes a frame in.
    fn take(&self, frame: &Frame) {
        let (now, time_s) = (Instant::now(), device_clock_s());
        let device_from_haply = self.settings.device_from_haply;
        let mut known = self.known();
        known.has_answered |= frame.inverse3.is_some();
        for grip in frame.grips() {
            let place = known.grips.iter().position(|known| known.id == grip.device_id).unwrap_or_else(|| {
                let id = grip.device_id.clone();
                known.grips.push(KnownGrip { id, orientation: DQuat::IDENTITY, buttons: 0, seen: now });
                known.grips.len() - 1
            });
            let known = &mut known.grips[place];
            if let Some(orientation) = grip.orientation() {
                known.orientation = device_from_haply * orientation * device_from_haply.inverse();
            }
            (known.buttons, known.seen) = (grip.buttons(), now);
        }
        for arm in frame.inverse3.iter().flatten() {
            let is_minverse = arm.is_minverse();
            match known.arms.iter_mut().find(|known| known.id == arm.device_id) {
                Some(known) => {
                    known.seen = now;
                    known.is_minverse = is_minverse.unwrap_or(known.is_minverse);
                }
                None => {
                    let is_minverse = is_minverse.unwrap_or(false);
                    known.arms.push(KnownArm { id: arm.device_id.clone(), is_minverse, seen: now });
                }
            }
            let grip = self.grip_of(&known, &arm.device_id).map(|grip| (grip.orientation, grip.buttons, grip.seen));
            if let Some(open) = known.open.get_mut(&arm.device_id) {
                self.tell(open, arm, grip, time_s);
            }
        }
    }

    /// Tells an open device what the service says of it.
    fn tell(&self, open: &mut Open, arm: &Arm, grip: Option<(DQuat, u32, Instant)>, time_s: f64) {
        let id = || format!("haply:{}", arm.device_id);
        if let Some(status) = &arm.status {
            open.is_ready = status.calibrated != Some(false);
            if !open.is_ready {
                let how = "put its handle into its holder and wait until its lamp says that it is ready".into();
                open.link.put(Err(DeviceFault::Uncalibrated { id: id(), how }));
                return;
            }
            if status.power_supply == Some(false) {
                open.link.warn(DeviceFault::Warning { id: id(), reason: "it has no power supply, so no force".into() });
            }
        } else {
            open.is_ready = true;
        }
        let Some(state) = &arm.state else { return };
        let Some(position) = state.cursor_position else { return };
        let middle_m = if self.is_new { DVec3::ZERO } else { self.settings.middle_before_3_5_m };
        let turn = self.settings.device_from_haply;
        let mut sample = DeviceSample {
            time_s,
            position_m: turn * (position.vector() - middle_m),
            velocity_m_per_s: state.cursor_velocity.map(|velocity| turn * velocity.vector()),
            ..DeviceSample::default()
        };
        if let Some((orientation, buttons, seen)) = grip {
            // A grip that sleeps keeps its rotation, and lets go of its buttons.
            let is_awake = seen.elapsed() < self.lost_after();
            (sample.device_from_handle, sample.buttons) = (orientation, if is_awake { buttons } else { 0 });
        }
        open.link.put(Ok(sample));
    }

    /// The grip that belongs to an arm: as set, or in order; the only grip to the only open arm.
    fn grip_of<'a>(&self, known: &'a Known, arm: &str) -> Option<&'a KnownGrip> {
        let pairs = &self.settings.grips;
        if let Some((_, grip)) = pairs.iter().find(|(paired, _)| paired == arm) {
            return known.grips.iter().find(|known| known.id == *grip);
        }
        if let ([grip], 1, true) = (&known.grips[..], known.open.len(), known.open.contains_key(arm)) {
            return Some(grip);
        }
        let free_arm = |arm: &&KnownArm| pairs.iter().all(|(paired, _)| *paired != arm.id);
        let place = known.arms.iter().filter(free_arm).position(|known| known.id == arm)?;
        known.grips.iter().filter(|grip| pairs.iter().all(|(_, paired)| *paired != grip.id)).nth(place)
    }

    /// Tells devices that the service no longer speaks of that they are gone.
    fn drop_lost(&self) {
        let mut known = self.known();
        let known = &mut *known;
        let is_lost = |id: &str| known.arms.iter().all(|arm| arm.id != id || arm.seen.elapsed() > self.lost_after());
        known.open.retain(|id, open| {
            if !is_lost(id) {
                return true;
            }
            let reason = "the service does not speak of it any more".into();
            open.link.put(Err(DeviceFault::Gone { id: format!("haply:{id}"), reason }));
            open.link.set_closed();
            false
        });
    }
}

/// What is counted of the messages that come in.
struct Inbox {
    /// When the service last said something that it could have meant.
    answered: Instant,
    garbage: u32,
}
