//! Which metrics there are: names, units, formulas.

use bevy::reflect::Reflect;
use serde::{Deserialize, Serialize};

/// A metric. Distances that a kind has are in metres; critical structures are known as far as the volume watches them.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
pub enum MetricKind {
    /// How long it took.
    Time,
    /// Way of the tips.
    PathLength,
    /// How straight single movements were.
    Economy,
    /// Way along the instruments' axes.
    Depth,
    /// Speed in the mean.
    MeanSpeed,
    /// Highest speed.
    MaxSpeed,
    /// Time in which nothing moved.
    Idle,
    /// Smoothness of movements: spectral arc length.
    Sparc,
    /// Smoothness of movements: logarithm of the dimensionless jerk.
    LogJerk,
    /// Strokes of the drill per second of drilling.
    StrokeRate,
    /// How long a stroke takes in the mean.
    StrokeTime,
    /// Length of a stroke in the mean.
    StrokeLength,
    /// Share of strokes that are curved.
    CurvedStrokes,
    /// Force of a stroke in the mean.
    StrokeForce,
    /// Force in the mean while something presses.
    MeanForce,
    /// Largest force.
    MaxForce,
    /// Force times time.
    Impulse,
    /// Force in the mean near critical structures.
    MeanForceNear {
        /// How near, metres.
        within_m: f32,
    },
    /// Largest force near critical structures.
    MaxForceNear {
        /// How near, metres.
        within_m: f32,
    },
    /// Speed in the mean near critical structures.
    MeanSpeedNear {
        /// How near, metres.
        within_m: f32,
    },
    /// Time near critical structures.
    TimeNear {
        /// How near, metres.
        within_m: f32,
    },
    /// How often critical structures were touched.
    CriticalContacts,
    /// Share of what was removed that could be seen.
    SeenRemoval,
    /// Share of the pool under which nothing could be seen, over time.
    HiddenView,
    /// Blood that was lost.
    BloodLoss,
    /// All that was removed.
    Removed,
    /// What was removed of what is to be removed.
    RemovedInside,
    /// What was removed of anything else.
    RemovedOutside,
    /// How far the suction was from the burr.
    SuctionDistance,
}

impl MetricKind {
    /// All of them, in the order of reports; those near structures for 2 mm and 4 mm.
    pub const ALL: [Self; 33] = [
        Self::Time,
        Self::PathLength,
        Self::Economy,
        Self::Depth,
        Self::MeanSpeed,
        Self::MaxSpeed,
        Self::Idle,
        Self::Sparc,
        Self::LogJerk,
        Self::StrokeRate,
        Self::StrokeTime,
        Self::StrokeLength,
        Self::CurvedStrokes,
        Self::StrokeForce,
        Self::MeanForce,
        Self::MaxForce,
        Self::Impulse,
        Self::MeanForceNear { within_m: 2e-3 },
        Self::MeanForceNear { within_m: 4e-3 },
        Self::MaxForceNear { within_m: 2e-3 },
        Self::MaxForceNear { within_m: 4e-3 },
        Self::MeanSpeedNear { within_m: 2e-3 },
        Self::MeanSpeedNear { within_m: 4e-3 },
        Self::TimeNear { within_m: 2e-3 },
        Self::TimeNear { within_m: 4e-3 },
        Self::CriticalContacts,
        Self::SeenRemoval,
        Self::HiddenView,
        Self::BloodLoss,
        Self::Removed,
        Self::RemovedInside,
        Self::RemovedOutside,
        Self::SuctionDistance,
    ];

    /// The same with a distance that is a number; one that is none is 0, and nothing is that near.
    pub(super) fn checked(mut self) -> Self {
        if let Self::MeanForceNear { within_m }
        | Self::MaxForceNear { within_m }
        | Self::MeanSpeedNear { within_m }
        | Self::TimeNear { within_m } = &mut self
            && !within_m.is_finite()
        {
            *within_m = 0.0;
        }
        self
    }

    /// Its usual name in reports.
    pub fn name(&self) -> String {
        let near =
            |what: &str, within_m: f32| format!("{what} within {} mm of critical structures", millimetres(within_m));
        let name = match self {
            Self::Time => "Time",
            Self::PathLength => "Path length",
            Self::Economy => "Economy of movements",
            Self::Depth => "Way in depth",
            Self::MeanSpeed => "Mean speed",
            Self::MaxSpeed => "Highest speed",
            Self::Idle => "Idle time",
            Self::Sparc => "Smoothness (SPARC)",
            Self::LogJerk => "Smoothness (LDLJ)",
            Self::StrokeRate => "Strokes per second",
            Self::StrokeTime => "Time of a stroke",
            Self::StrokeLength => "Length of a stroke",
            Self::CurvedStrokes => "Curved strokes",
            Self::StrokeForce => "Force of a stroke",
            Self::MeanForce => "Mean force",
            Self::MaxForce => "Largest force",
            Self::Impulse => "Impulse",
            Self::MeanForceNear { within_m } => return near("Mean force", *within_m),
            Self::MaxForceNear { within_m } => return near("Largest force", *within_m),
            Self::MeanSpeedNear { within_m } => return near("Mean speed", *within_m),
            Self::TimeNear { within_m } => return near("Time", *within_m),
            Self::CriticalContacts => "Contacts with critical structures",
            Self::SeenRemoval => "Removed in sight",
            Self::HiddenView => "View hidden by the pool",
            Self::BloodLoss => "Blood loss",
            Self::Removed => "Removed",
            Self::RemovedInside => "Removed of targets",
            Self::RemovedOutside => "Removed outside targets",
            Self::SuctionDistance => "Distance of suction from burr",
        };
        name.to_string()
    }

    /// A key for files and programs: small letters, digits and underscores.
    pub fn key(&self) -> String {
        let near = |what: &str, within_m: f32| format!("{what}_near_{}mm", millimetres(within_m)).replace('.', "_");
        let key = match self {
            Self::Time => "time",
            Self::PathLength => "path_length",
            Self::Economy => "economy",
            Self::Depth => "depth",
            Self::MeanSpeed => "mean_speed",
            Self::MaxSpeed => "max_speed",
            Self::Idle => "idle",
            Self::Sparc => "sparc",
            Self::LogJerk => "log_jerk",
            Self::StrokeRate => "stroke_rate",
            Self::StrokeTime => "stroke_time",
            Self::StrokeLength => "stroke_length",
            Self::CurvedStrokes => "curved_strokes",
            Self::StrokeForce => "stroke_force",
            Self::MeanForce => "mean_force",
            Self::MaxForce => "max_force",
            Self::Impulse => "impulse",
            Self::MeanForceNear { within_m } => return near("mean_force", *within_m),
            Self::MaxForceNear { within_m } => return near("max_force", *within_m),
            Self::MeanSpeedNear { within_m } => return near("mean_speed", *within_m),
            Self::TimeNear { within_m } => return near("time", *within_m),
            Self::CriticalContacts => "critical_contacts",
            Self::SeenRemoval => "seen_removal",
            Self::HiddenView => "hidden_view",
            Self::BloodLoss => "blood_loss",
            Self::Removed => "removed",
            Self::RemovedInside => "removed_inside",
            Self::RemovedOutside => "removed_outside",
            Self::SuctionDistance => "suction_distance",
        };
        key.to_string()
    }

    /// Unit of its value; `1` for shares and counts.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Time | Self::Idle | Self::StrokeTime | Self::TimeNear { .. } => "s",
            Self::PathLength | Self::Depth | Self::StrokeLength | Self::SuctionDistance => "m",
            Self::MeanSpeed | Self::MaxSpeed | Self::MeanSpeedNear { .. } => "m/s",
            Self::StrokeRate => "1/s",
            Self::StrokeForce
            | Self::MeanForce
            | Self::MaxForce
            | Self::MeanForceNear { .. }
            | Self::MaxForceNear { .. } => "N",
            Self::Impulse => "N·s",
            Self::BloodLoss => "ml",
            Self::Removed | Self::RemovedInside | Self::RemovedOutside => "mm³",
            Self::Economy
            | Self::Sparc
            | Self::LogJerk
            | Self::CurvedStrokes
            | Self::CriticalContacts
            | Self::SeenRemoval
            | Self::HiddenView => "1",
        }
    }

    /// How it is computed, in a line.
    pub fn formula(&self) -> &'static str {
        match self {
            Self::Time => "last step / steps per second",
            Self::PathLength => "Σ |p(k+1) − p(k)|, all instruments",
            Self::Economy => "Σ straight distance / Σ path over movements of 0.25 to 5 s between rests (< 5 mm/s)",
            Self::Depth => "Σ |(p(k+1) − p(k)) · axis|, all instruments",
            Self::MeanSpeed => "path / time held, all instruments",
            Self::MaxSpeed => "max |p(k+1) − p(k)| · steps per second",
            Self::Idle => "time in which every held instrument is slower than 5 mm/s",
            Self::Sparc => "median of SPARC over movements of 0.25 to 5 s; nearer to 0 is smoother",
            Self::LogJerk => "median of −ln|DLJ| over movements of 0.25 to 5 s; larger is smoother",
            Self::StrokeRate => {
                "strokes / time with the drill's pedal down; cut where the k-cosine over 100 ms exceeds 0"
            }
            Self::StrokeTime => "mean time of strokes",
            Self::StrokeLength => "mean path of strokes",
            Self::CurvedStrokes => "strokes whose ends are nearer than 0.9 of their path / strokes",
            Self::StrokeForce => "mean over strokes of the mean force while pressing",
            Self::MeanForce => "mean of |F| over samples with |F| > 0",
            Self::MaxForce => "max |F|",
            Self::Impulse => "Σ |F| · dt, all instruments",
            Self::MeanForceNear { .. } => "mean of |F| over samples that near with |F| > 0",
            Self::MaxForceNear { .. } => "max |F| over samples that near",
            Self::MeanSpeedNear { .. } => "mean speed over samples that near",
            Self::TimeNear { .. } => "time of samples that near, all instruments",
            Self::CriticalContacts => "contacts with critical structures that begin",
            Self::SeenRemoval => "Σ mm³ · share seen / Σ mm³; seen: nothing solid between voxel and eye (Sewell 2008)",
            Self::HiddenView => "time mean of the hidden share of the pool",
            Self::BloodLoss => "largest blood loss logged",
            Self::Removed => "Σ mm³",
            Self::RemovedInside => "Σ mm³ of structures that goals ask to remove, or to expose where not critical",
            Self::RemovedOutside => "Σ mm³ of all other structures",
            Self::SuctionDistance => "mean distance of the nearest suction's tip from the burr while its pedal is down",
        }
    }
}

/// A distance in millimetres, without the digits that it does not have.
fn millimetres(distance_m: f32) -> f64 {
    (f64::from(distance_m) * 1e6).round() / 1e3
}
