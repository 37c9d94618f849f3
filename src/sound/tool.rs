//! The voice of a tool, whatever it does.

use super::cautery::{CauteryDials, CauteryVoice};
use super::drill::{DrillDials, DrillSound, DrillVoice};
use super::parts::{Smooth, within};
use super::suction::{SuctionDials, SuctionVoice};
use super::voice::Voice;
use crate::tools::ToolWork;
use bevy::prelude::*;

/// Lets a tool be heard: put it beside a [`ToolWork`]. Whatever the tool does it has one voice, and one thing fades into the next.
///
/// All but the seed and the distance may be changed while it sounds. See the [module](super) for what else is needed.
#[derive(Component, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Component, Default, Clone)]
pub struct ToolSound {
    /// What it sounds like where it drills.
    pub drill: DrillSound,
    /// Loudness of the tool, from 0 to 1.
    pub gain: f32,
    /// As loud as it gets at this distance from an ear; four times as soft at twice the distance. Nearer than this Bevy's sound
    /// pans to the wrong side, so that it is at most the least distance between tools and ears.
    pub full_within_m: f32,
    /// Two tools of the same seed make the same noise.
    pub seed: u64,
}

impl Default for ToolSound {
    fn default() -> Self {
        Self { drill: DrillSound::default(), gain: 1.0, full_within_m: 0.05, seed: 0 }
    }
}

/// What changes while a tool works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone)]
pub struct ToolDials {
    /// What it does.
    pub work: ToolWork,
    /// What it sounds like where it drills.
    pub drill: DrillSound,
    /// Loudness, from 0 to 1.
    pub gain: f32,
}

/// The samples of a tool, from -1 to 1.
#[derive(Clone, Debug, TypePath)]
pub struct ToolVoice {
    drill: DrillVoice,
    suction: SuctionVoice,
    cautery: CauteryVoice,
    gain: Smooth,
}

impl ToolVoice {
    /// A tool that does nothing. The same seed and dials give the same samples.
    pub fn new(rate_hz: u32, seed: u64) -> Self {
        let drill = DrillVoice::new(DrillSound::default(), rate_hz, seed);
        let gain = Smooth::new(0.0, 0.02, drill.rate_hz() as f32);
        Self { drill, suction: SuctionVoice::new(rate_hz, seed), cautery: CauteryVoice::new(rate_hz, seed), gain }
    }
}

impl Voice for ToolVoice {
    type Dials = ToolDials;

    fn turn(&mut self, dials: ToolDials) {
        let (mut drill, mut suction, mut cautery) =
            (DrillDials::default(), SuctionDials::default(), CauteryDials::default());
        match dials.work {
            ToolWork::Idle => {}
            ToolWork::Drilling { speed_rpm, force_n, contact, hardness } => {
                drill = DrillDials { speed_rpm, force_n, contact, hardness };
            }
            ToolWork::Sucking { strength, liquid } => suction = SuctionDials { strength, liquid },
            ToolWork::Burning { heat, water } => cautery = CauteryDials { heat, water },
        }
        self.drill.rebuild(dials.drill);
        self.drill.turn(drill);
        self.suction.turn(suction);
        self.cautery.turn(cautery);
        self.gain.aim(within(dials.gain, 0.0, 1.0), 0.0, 1.0);
    }

    fn rate_hz(&self) -> u32 {
        self.drill.rate_hz()
    }

    fn is_silent(&self) -> bool {
        self.gain.is_silent() || (self.drill.is_silent() && self.suction.is_silent() && self.cautery.is_silent())
    }
}

impl Iterator for ToolVoice {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        let gain = self.gain.next();
        // Each that is silent costs next to nothing.
        let sum = [self.drill.next(), self.suction.next(), self.cautery.next()].into_iter().flatten().sum::<f32>();
        Some((gain * sum).clamp(-1.0, 1.0))
    }
}
