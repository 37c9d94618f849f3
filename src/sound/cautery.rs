//! The voice of cautery: tissue that sizzles.

use super::parts::{Filter, Noise, SILENCE, Smooth, sane_rate_hz};
use super::voice::Voice;
use bevy::prelude::*;

/// Crackles a second at full heat in wet tissue, and pops: steam that breaks out from deeper.
const CRACKLES_PER_S: f32 = 420.0;
const POPS_PER_S: f32 = 9.0;
/// Sparks a second over tissue that has no water left.
const SPARKS_PER_S: f32 = 35.0;
/// Each crackle rings at one of these, hertz.
const CRACKLE_HZ: [f32; 3] = [2300.0, 4100.0, 7200.0];

/// What changes while it works.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone)]
pub struct CauteryDials {
    /// From 0, cold, to 1, as hot as it gets.
    pub heat: f32,
    /// From 0, charred and dry, to 1, full of water: water is what sizzles.
    pub water: f32,
}

/// The samples of cautery, from -1 to 1.
#[derive(Clone, Debug, TypePath)]
pub struct CauteryVoice {
    rate_hz: f32,
    heat: Smooth,
    water: Smooth,
    crackles: [f32; CRACKLE_HZ.len()],
    rings: [Filter; CRACKLE_HZ.len()],
    pop: f32,
    pops: Filter,
    steam: Filter,
    noise: Noise,
}

impl CauteryVoice {
    /// An electrode without power. The same seed and dials give the same samples.
    pub fn new(rate_hz: u32, seed: u64) -> Self {
        let rate_hz = sane_rate_hz(rate_hz);
        Self {
            rate_hz,
            heat: Smooth::new(0.0, 0.03, rate_hz),
            water: Smooth::new(0.0, 0.05, rate_hz),
            crackles: [0.0; CRACKLE_HZ.len()],
            rings: CRACKLE_HZ.map(|hz| Filter::new(hz, 0.5, rate_hz)),
            pop: 0.0,
            pops: Filter::new(650.0, 0.8, rate_hz),
            steam: Filter::new(5200.0, 1.0, rate_hz),
            noise: Noise::new(seed),
        }
    }
}

impl Voice for CauteryVoice {
    type Dials = CauteryDials;

    fn turn(&mut self, dials: CauteryDials) {
        self.heat.aim(dials.heat, 0.0, 1.0);
        self.water.aim(dials.water, 0.0, 1.0);
    }

    fn rate_hz(&self) -> u32 {
        self.rate_hz as u32
    }

    fn is_silent(&self) -> bool {
        self.heat.is_silent()
    }
}

impl Iterator for CauteryVoice {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        let (heat, water) = (self.heat.next(), self.water.next());
        if self.is_silent() {
            return Some(0.0);
        }
        let noise = &mut self.noise;
        let per_s = heat * (CRACKLES_PER_S * water + SPARKS_PER_S * (1.0 - water));
        if noise.share() < per_s / self.rate_hz {
            // Most are faint, some are loud.
            let loud = noise.share();
            let which = (noise.share() * CRACKLE_HZ.len() as f32) as usize;
            if let Some(crackle) = self.crackles.get_mut(which) {
                *crackle = crackle.max(0.12 + 0.88 * loud * loud * loud);
            }
        }
        if noise.share() < heat * heat * water * POPS_PER_S / self.rate_hz {
            self.pop = self.pop.max(0.4 + 0.6 * noise.share());
        }
        let hiss = noise.next();
        let mut burst = 0.0;
        for (n, (crackle, ring)) in self.crackles.iter_mut().zip(&mut self.rings).enumerate() {
            burst += ring.next(hiss * *crackle).band;
            // The higher it rings the sooner it is over.
            *crackle *= 1.0 - (350.0 + 350.0 * n as f32) / self.rate_hz;
        }
        let pop = self.pops.next(hiss * self.pop).band;
        self.pop *= 1.0 - 140.0 / self.rate_hz;
        let steam = self.steam.next(hiss).high * (0.015 + 0.085 * water);
        let mixed = heat * (steam + 1.5 * burst + 1.3 * pop);
        Some(if mixed.abs() < SILENCE { 0.0 } else { mixed.tanh() })
    }
}
