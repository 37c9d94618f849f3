//! Between the servo loop and a driver's own thread: the newest state goes one way, the newest force the other, and the loop
//! never waits.

use super::{DeviceFault, DeviceOutput, DeviceSample};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// The same warning is passed on once in this time.
const WARN_EVERY: Duration = Duration::from_secs(2);

/// What the loop and the driver's thread share.
pub(crate) struct Link {
    state: Mutex<State>,
    order: Mutex<Order>,
    /// How long a force is held without a new one.
    hold: Duration,
    closing: AtomicBool,
    closed: AtomicBool,
}

struct State {
    read: Result<DeviceSample, DeviceFault>,
    warning: Option<DeviceFault>,
    warned: Option<(DeviceFault, Instant)>,
}

struct Order {
    output: DeviceOutput,
    at: Option<Instant>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What is free now; both sides hold a lock only while they copy.
fn try_lock<T>(mutex: &Mutex<T>) -> Option<MutexGuard<'_, T>> {
    match mutex.try_lock() {
        Ok(guard) => Some(guard),
        Err(TryLockError::Poisoned(guard)) => Some(guard.into_inner()),
        Err(TryLockError::WouldBlock) => None,
    }
}

impl Link {
    pub(crate) fn new(first: Result<DeviceSample, DeviceFault>, hold: Duration) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::new(State { read: first, warning: None, warned: None }),
            order: Mutex::new(Order { output: DeviceOutput::default(), at: None }),
            hold,
            closing: AtomicBool::new(false),
            closed: AtomicBool::new(false),
        })
    }

    // The driver's side.

    /// The newest state, or why there is none.
    pub(crate) fn put(&self, read: Result<DeviceSample, DeviceFault>) {
        lock(&self.state).read = read;
    }

    /// Passes a warning on, unless it was passed on just now.
    pub(crate) fn warn(&self, warning: DeviceFault) {
        let mut state = lock(&self.state);
        if state.warned.as_ref().is_none_or(|(last, at)| *last != warning || at.elapsed() > WARN_EVERY) {
            state.warned = Some((warning.clone(), Instant::now()));
            state.warning = Some(warning);
        }
    }

    /// The force to hold now: none when the loop has been silent for too long, or the device is being closed.
    pub(crate) fn output(&self) -> DeviceOutput {
        let order = lock(&self.order);
        let is_held = order.at.is_some_and(|at| at.elapsed() <= self.hold) && !self.is_closing();
        if is_held { order.output } else { DeviceOutput::default() }
    }

    pub(crate) fn is_closing(&self) -> bool {
        self.closing.load(Ordering::Acquire)
    }

    /// The driver has let go of the device, without force.
    pub(crate) fn set_closed(&self) {
        self.closed.store(true, Ordering::Release);
    }

    // The loop's side.

    /// The newest state; `last` serves where the driver is just writing it.
    pub(crate) fn read(&self, last: &mut Result<DeviceSample, DeviceFault>) -> Result<DeviceSample, DeviceFault> {
        if let Some(state) = try_lock(&self.state)
            && *last != state.read
        {
            last.clone_from(&state.read);
        }
        last.clone()
    }

    /// Leaves a force, limited; what is no number is none. Gives out a warning that has come up, or the fault.
    pub(crate) fn write(&self, output: &DeviceOutput, max_force_n: f64) -> Result<(), DeviceFault> {
        let mut output = *output;
        output.force_n =
            if output.force_n.is_finite() { output.force_n.clamp_length_max(max_force_n) } else { Default::default() };
        if !output.torque_n_m.is_finite() {
            output.torque_n_m = Default::default();
        }
        if let Some(mut order) = try_lock(&self.order) {
            *order = Order { output, at: Some(Instant::now()) };
        }
        match try_lock(&self.state) {
            Some(mut state) => match (state.warning.take(), &state.read) {
                (Some(warning), _) => Err(warning),
                (None, Err(fault)) => Err(fault.clone()),
                (None, Ok(_)) => Ok(()),
            },
            None => Ok(()),
        }
    }

    /// Lets the driver go to no force and close, and waits for it a little.
    pub(crate) fn close(&self) {
        self.closing.store(true, Ordering::Release);
        let end = Instant::now() + Duration::from_millis(300);
        while !self.closed.load(Ordering::Acquire) && Instant::now() < end {
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

/// The loop's end of a [`Link`]: all that devices with a driver's thread have in common.
pub(crate) struct Linked {
    pub(crate) link: Arc<Link>,
    last: Result<DeviceSample, DeviceFault>,
}

impl Linked {
    pub(crate) fn new(link: Arc<Link>, id: &str) -> Self {
        let reason = "it has not said where it is yet".into();
        Self { link, last: Err(DeviceFault::Warning { id: id.into(), reason }) }
    }

    pub(crate) fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.link.read(&mut self.last)
    }
}

impl Drop for Linked {
    fn drop(&mut self) {
        self.link.close();
    }
}
