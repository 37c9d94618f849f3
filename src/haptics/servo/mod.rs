//! The loop that joins a hand to the world, a thousand times a second.
//!
//! The simulation publishes a [`ServoScene`] through a [`ServoLink`] whenever it has a new one: where the device stands in the
//! world, what the tool is, and the few things near it. The [`ServoEngine`] reads the device, works out the force, sends it through
//! the safety chain to the device, and publishes a [`ServoState`]. Neither ever waits for the other.
//!
//! ```
//! use bevy_surgery::haptics::servo::{ServoEngine, ServoScene, ServoSettings, ServoThread};
//! # use bevy_surgery::haptics::device::*;
//! # struct Still(DeviceInfo);
//! # impl HapticDevice for Still {
//! #     fn info(&self) -> &DeviceInfo { &self.0 }
//! #     fn read(&mut self) -> Result<DeviceSample, DeviceFault> { Ok(DeviceSample::default()) }
//! #     fn write(&mut self, _: &DeviceOutput) -> Result<(), DeviceFault> { Ok(()) }
//! # }
//! # let info = DeviceInfo { id: "own:1".into(), name: "own".into(), kind: DeviceKind::Other, limits: DeviceLimits::OMNI,
//! #     has_force: true, has_rotation: false, has_grip: false, buttons: 0 };
//! let (mut engine, mut link) = ServoEngine::new(Box::new(Still(info)), ServoSettings::default());
//! link.publish(ServoScene::default());
//! // By hand, always with the same result:
//! engine.tick(1e-3);
//! assert_eq!(link.state().tick, 1);
//! // Or in a thread of its own:
//! let thread = ServoThread::start(engine)?;
//! let engine = thread.stop();
//! # Ok::<(), std::io::Error>(())
//! ```

mod engine;
mod link;
mod pace;
mod scene;
mod state;
mod thread;

pub use engine::{ServoEngine, ServoSettings};
pub use link::{ServoFault, ServoLink};
pub use pace::{ServoBeat, ServoPace};
pub use scene::{MAX_BODIES, ServoBody, ServoRig, ServoScene, ServoShape, ServoTool};
pub use state::{ServoContact, ServoState};
pub use thread::ServoThread;
