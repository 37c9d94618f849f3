//! The loop in a thread of its own.

use super::ServoEngine;
use super::pace::Waiter;
use std::any::Any;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

/// Runs a [`ServoEngine`] until it is stopped or dropped; then the device is at zero force.
///
/// A panic, in a device's driver say, stops the loop with zero force and a [`ServoFault::Panic`](super::ServoFault::Panic); it never
/// leaves the thread.
pub struct ServoThread {
    stops: Arc<AtomicBool>,
    thread: Option<JoinHandle<ServoEngine>>,
}

impl ServoThread {
    /// Starts it.
    ///
    /// # Errors
    /// The system has no thread left; the engine is dropped at zero force then.
    pub fn start(engine: ServoEngine) -> io::Result<Self> {
        let stops = Arc::new(AtomicBool::new(false));
        let flag = stops.clone();
        let thread = std::thread::Builder::new().name("haptics".into()).spawn(move || run(engine, &flag))?;
        Ok(Self { stops, thread: Some(thread) })
    }

    /// Whether it still runs: not after a panic, and not after the device was lost.
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Stops it, and gives back the engine, with the device at zero force.
    pub fn stop(mut self) -> Option<ServoEngine> {
        self.end()
    }

    fn end(&mut self) -> Option<ServoEngine> {
        self.stops.store(true, Ordering::Relaxed);
        self.thread.take().and_then(|thread| thread.join().ok())
    }
}

impl Drop for ServoThread {
    fn drop(&mut self) {
        drop(self.end());
    }
}

fn run(mut engine: ServoEngine, stops: &AtomicBool) -> ServoEngine {
    raise_priority();
    let period_s = engine.settings().period_s();
    let mut waiter = Waiter::new(period_s, engine.settings().spin_s);
    while !stops.load(Ordering::Relaxed) && !engine.is_over() {
        let (began, beat) = waiter.wait();
        if let Err(payload) = catch_unwind(AssertUnwindSafe(|| engine.tick(beat.since_last_s))) {
            engine.stop_after_panic(message(&*payload));
            break;
        }
        engine.meter.record(beat.late_s, beat.since_last_s, began.elapsed().as_secs_f64(), period_s);
    }
    if !engine.is_over() {
        engine.stop();
    }
    engine
}

fn message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<String>().map(String::as_str).or_else(|| payload.downcast_ref::<&str>().copied());
    text.unwrap_or("a panic without a message").to_string()
}

/// As high as the system lets a program without rights go; where it does not, the loop keeps its pace as well as it can.
fn raise_priority() {
    if let Err(why) = thread_priority::set_current_thread_priority(thread_priority::ThreadPriority::Max) {
        tracing::debug!("the servo thread keeps its usual priority: {why:?}");
    }
}
