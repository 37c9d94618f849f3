//! Instruments that one feels: devices, the servo loop that runs a thousand times a second, models of force, and the safety that
//! stands between them and the hand.
//!
//! Nothing here knows the ECS but the plugin's own systems, and nothing needs a thread: the same loop steps by hand.

pub mod device;
pub mod energy;
pub mod exchange;
pub mod force;
pub mod safety;
pub mod servo;
pub mod stats;

/// Registers the data types of devices and loop, so that inspectors and scenes see them.
pub fn register_types(registry: &mut bevy::reflect::TypeRegistry) {
    registry.register::<device::DeviceInfo>();
    registry.register::<device::DeviceKind>();
    registry.register::<device::DeviceLimits>();
    registry.register::<device::DeviceSample>();
    registry.register::<device::DeviceOutput>();
    registry.register::<energy::PassivityObserver>();
    registry.register::<force::BurrContact>();
    registry.register::<force::ProxyContact>();
    registry.register::<force::SurfaceFeel>();
    registry.register::<force::ToolLoad>();
    registry.register::<force::TurningBurr>();
    registry.register::<safety::ForceState>();
    registry.register::<safety::SafetySettings>();
    registry.register::<servo::ServoContact>();
    registry.register::<servo::ServoRig>();
    registry.register::<servo::ServoSettings>();
    registry.register::<servo::ServoState>();
    registry.register::<servo::ServoTool>();
    registry.register::<stats::ServoTiming>();
}
