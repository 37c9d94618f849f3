//! What goes wrong with devices, told to the person who must mend it.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a device does not do what it should.
#[derive(Clone, Debug, PartialEq, Error, Reflect, Serialize, Deserialize)]
pub enum DeviceFault {
    /// The driver's library is not installed, or is not the one that is meant.
    #[error("{library} cannot be used: {reason}. Install the driver of {maker}, or choose another device")]
    Library {
        /// Its file name.
        library: String,
        /// Whose driver has it.
        maker: String,
        /// What the system says.
        reason: String,
    },
    /// The service that speaks for the device does not answer.
    #[error("{service} does not answer at {address}: {reason}")]
    Service {
        /// For people.
        service: String,
        /// Where it was looked for.
        address: String,
        /// What happened.
        reason: String,
    },
    /// There is no such device.
    #[error("there is no device {id}; there are: {there}")]
    NotFound {
        /// What was asked for.
        id: String,
        /// What there is.
        there: String,
    },
    /// It must be calibrated first.
    #[error("{id} is not calibrated: {how}")]
    Uncalibrated {
        /// Which device.
        id: String,
        /// What to do.
        how: String,
    },
    /// It was there and is gone.
    #[error("{id} is gone: {reason}")]
    Gone {
        /// Which device.
        id: String,
        /// What happened.
        reason: String,
    },
    /// It was there and is gone, and its keeper looks for it: go on calling, without force, until it answers again.
    #[error("{id} is away ({reason}); it is taken up again when it is back")]
    Away {
        /// Which device.
        id: String,
        /// What happened.
        reason: String,
    },
    /// It goes on, but not as well as it should: warm motors, one late frame.
    #[error("{id}: {reason}")]
    Warning {
        /// Which device.
        id: String,
        /// What happened.
        reason: String,
    },
    /// What it had to tell is told, as of a recording that is played: it stays where it is, without force, and is not looked for.
    #[error("{id} is at its end")]
    Ended {
        /// Which device.
        id: String,
    },
}

impl DeviceFault {
    /// Whether the device is lost and must be opened again.
    pub fn is_over(&self) -> bool {
        !matches!(self, Self::Warning { .. } | Self::Uncalibrated { .. } | Self::Away { .. } | Self::Ended { .. })
    }
}
