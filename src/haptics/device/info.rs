//! What devices are and what they bear.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// What a device is.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// `backend:serial`, as `--device` takes it.
    pub id: String,
    /// For people.
    pub name: String,
    /// Make and model, as far as they matter.
    pub kind: DeviceKind,
    /// What it bears.
    pub limits: DeviceLimits,
    /// Whether its handle can push.
    pub has_force: bool,
    /// Whether it knows how its handle is turned.
    pub has_rotation: bool,
    /// Whether it has a gripper.
    pub has_grip: bool,
    /// How many buttons it has.
    pub buttons: u32,
}

/// Kinds of devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize)]
pub enum DeviceKind {
    /// No device.
    None,
    /// Mouse and keyboard.
    Mouse,
    /// A gamepad.
    Gamepad,
    /// A path that a program follows.
    Scripted,
    /// A recording that is played again.
    Replay,
    /// A model of a device: mass, friction, encoder.
    Simulated,
    /// Haply Inverse3 or Minverse.
    Haply,
    /// 3D Systems Touch, Phantom Omni or Desktop.
    OpenHaptics,
    /// Force Dimension devices and the Novint Falcon.
    ForceDimension,
    /// 3Dconnexion SpaceMouse.
    SpaceMouse,
    /// Something of the user's own.
    Other,
}

/// What a device bears. Stiffness and damping are those of a wall that it can show without humming at 1000 ticks a second.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub struct DeviceLimits {
    /// Greatest force, newtons.
    pub max_force_n: f64,
    /// Greatest stiffness, newtons per metre.
    pub max_stiffness_n_per_m: f64,
    /// Greatest damping, newton seconds per metre.
    pub max_damping_n_s_per_m: f64,
    /// Greatest change of the force, newtons per second.
    pub max_slew_n_per_s: f64,
    /// Radius of the workspace, metres.
    pub workspace_radius_m: f64,
    /// The device's own friction that grows with speed, newton seconds per metre. No maker tells it. Of the devices here it is the
    /// least that explains the greatest stiffness they are published to show at 1000 ticks a second: by Colgate's condition
    /// `b > K T / 2` such a wall would hum with less. Dry friction does a part of that work in truth, and is not counted anew.
    pub own_damping_n_s_per_m: f64,
    /// Mass that one feels at the handle, kilograms.
    pub own_mass_kg: f64,
    /// Smallest step of position that it tells apart, metres.
    pub encoder_step_m: f64,
}

/// Share of what is passive in theory that the loop uses; a device's friction is not known better.
pub(crate) const PASSIVE_SHARE: f64 = 0.9;

/// What a device must have of its own to show a wall of this stiffness at 1000 ticks a second, with that margin; never taken for less
/// than that of the lightest arms.
const fn damping_for(stiffness_n_per_m: f64) -> f64 {
    (stiffness_n_per_m * 1e-3 / (2.0 * PASSIVE_SHARE)).max(0.5)
}

impl DeviceLimits {
    const fn new(
        max_force_n: f64,
        max_stiffness_n_per_m: f64,
        max_damping_n_s_per_m: f64,
        workspace_radius_m: f64,
    ) -> Self {
        Self {
            max_force_n,
            max_stiffness_n_per_m,
            max_damping_n_s_per_m,
            max_slew_n_per_s: 100.0 * max_force_n,
            workspace_radius_m,
            own_damping_n_s_per_m: damping_for(max_stiffness_n_per_m),
            own_mass_kg: 0.1,
            encoder_step_m: 50e-6,
        }
    }

    /// 3D Systems Touch; as CHAI3D 3.3.0 limits it.
    pub const TOUCH: Self = Self { own_mass_kg: 0.045, encoder_step_m: 55e-6, ..Self::new(3.3, 400.0, 4.0, 0.075) };
    /// Phantom Omni; as CHAI3D 3.3.0 limits it.
    pub const OMNI: Self = Self { own_mass_kg: 0.045, encoder_step_m: 55e-6, ..Self::new(3.3, 700.0, 5.0, 0.1) };
    /// Phantom Desktop; as CHAI3D 3.3.0 limits it.
    pub const DESKTOP: Self = Self { own_mass_kg: 0.045, encoder_step_m: 23e-6, ..Self::new(7.9, 1000.0, 5.0, 0.1) };
    /// Novint Falcon; as CHAI3D 3.3.0 limits it.
    pub const FALCON: Self = Self::new(8.0, 3000.0, 20.0, 0.04);
    /// Force Dimension omega.3, .6 and .7; as CHAI3D 3.3.0 limits them.
    pub const OMEGA: Self = Self { encoder_step_m: 10e-6, ..Self::new(12.0, 5000.0, 30.0, 0.075) };
    /// Force Dimension sigma.7; as CHAI3D 3.3.0 limits it.
    pub const SIGMA: Self = Self { encoder_step_m: 10e-6, ..Self::new(12.0, 4000.0, 30.0, 0.075) };
    /// Haply Inverse3: no source gives its stiffness, so that of the softest device here.
    pub const INVERSE3: Self = Self::new(4.0, 400.0, 4.0, 0.1);
    /// What has no motors.
    pub const NO_FORCE: Self = Self::new(0.0, 0.0, 0.0, 0.1);

    /// The stiffest wall that stays passive with the device's own friction alone at a period of the loop: `K < 2 b / T`
    /// (Colgate's condition), and never more than the device's published limit.
    pub fn stable_stiffness_n_per_m(&self, period_s: f64) -> f64 {
        self.max_stiffness_n_per_m.min(2.0 * self.own_damping_n_s_per_m / period_s.max(1e-6))
    }
}
