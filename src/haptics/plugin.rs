//! Haptics in an app.

use super::{device, energy, force, safety, servo, stats};
use bevy::prelude::*;

/// Makes the types of [`haptics`](super) known to reflection, so that scenes and panels show them. The loop itself is started by
/// hand: [`servo::ServoThread`], or [`servo::ServoEngine`] stepped by a system of your own.
pub struct HapticsPlugin;

impl Plugin for HapticsPlugin {
    fn build(&self, app: &mut App) {
        device::register_device_types(app);
        app.register_type::<energy::PassivityObserver>()
            .register_type::<force::BurrContact>()
            .register_type::<force::ProxyContact>()
            .register_type::<force::SurfaceFeel>()
            .register_type::<force::ToolLoad>()
            .register_type::<force::TurningBurr>()
            .register_type::<safety::ForceState>()
            .register_type::<safety::SafetySettings>()
            .register_type::<servo::ServoContact>()
            .register_type::<servo::ServoFault>()
            .register_type::<servo::ServoRig>()
            .register_type::<servo::ServoSettings>()
            .register_type::<servo::ServoState>()
            .register_type::<servo::ServoTool>()
            .register_type::<stats::ServoTiming>();
    }
}
