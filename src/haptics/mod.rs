//! Instruments that one feels: devices, the servo loop that runs a thousand times a second, models of force, and the safety that
//! stands between them and the hand.
//!
//! Nothing here knows the ECS but the plugin's own systems, and nothing needs a thread: the same loop steps by hand.

pub mod device;
pub mod energy;
pub mod exchange;
pub mod force;
mod plugin;
pub mod safety;
pub mod servo;
pub mod stats;

pub use plugin::HapticsPlugin;
