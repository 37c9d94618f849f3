//! The voice of suction: air, liquid, and the gurgle of both.

use super::parts::{Filter, Noise, Phase, SILENCE, Smooth, sane_rate_hz, within};
use super::voice::Voice;
use bevy::prelude::*;

/// How often a second what is in the tip is drawn anew, where it draws as much air as liquid: half of the slugs follow one of their kind.
const SLUGS_PER_S: f32 = 48.0;
/// Bubbles a second in such a draught.
const BUBBLES_PER_S: f32 = 70.0;
const MOST_BUBBLES: usize = 8;
/// The lowest tone of the tube, open at both ends, some 20 cm long.
const TUBE_HZ: f32 = 850.0;

/// What changes while it sucks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone)]
pub struct SuctionDials {
    /// From 0, off, to 1, all that it can.
    pub strength: f32,
    /// Share of liquid in what is drawn, from 0 to 1.
    pub liquid: f32,
}

/// A bubble that rings and dies away, its tone rising as it shrinks.
#[derive(Clone, Copy, Debug, Default)]
struct Bubble {
    phase: Phase,
    hz: f32,
    loudness: f32,
    dying: f32,
}

/// The samples of suction, from -1 to 1.
#[derive(Clone, Debug, TypePath)]
pub struct SuctionVoice {
    rate_hz: f32,
    strength: Smooth,
    liquid: Smooth,
    /// What is in the tip now, 0 air or 1 liquid.
    slug: Smooth,
    air: Filter,
    tube: [Filter; 3],
    flow: [Filter; 2],
    bubbles: [Bubble; MOST_BUBBLES],
    noise: Noise,
}

impl SuctionVoice {
    /// Suction that is off. The same seed and dials give the same samples.
    pub fn new(rate_hz: u32, seed: u64) -> Self {
        let rate_hz = sane_rate_hz(rate_hz);
        Self {
            rate_hz,
            strength: Smooth::new(0.0, 0.03, rate_hz),
            liquid: Smooth::new(0.0, 0.03, rate_hz),
            slug: Smooth::new(0.0, 0.007, rate_hz),
            air: Filter::new(2600.0, 1.5, rate_hz),
            tube: [1.0, 2.0, 3.0].map(|times| Filter::new(times * TUBE_HZ, 0.16, rate_hz)),
            flow: [Filter::new(520.0, 1.2, rate_hz), Filter::new(230.0, 0.7, rate_hz)],
            bubbles: [Bubble::default(); MOST_BUBBLES],
            noise: Noise::new(seed),
        }
    }

    /// One more, in a place where another has died away: it begins at the zero of its sine, so that nothing jumps.
    fn add_bubble(&mut self) {
        let size = self.noise.share();
        let Some(bubble) = self.bubbles.iter_mut().find(|bubble| bubble.loudness < 1e-3) else { return };
        // Small ones ring higher, softer and shorter.
        let hz = 320.0 + 1100.0 * size * size;
        *bubble = Bubble { phase: Phase::default(), hz, loudness: 1.0 - 0.6 * size, dying: 25.0 + 45.0 * size };
    }
}

impl Voice for SuctionVoice {
    type Dials = SuctionDials;

    fn turn(&mut self, dials: SuctionDials) {
        self.strength.aim(dials.strength, 0.0, 1.0);
        self.liquid.aim(dials.liquid, 0.0, 1.0);
    }

    fn rate_hz(&self) -> u32 {
        self.rate_hz as u32
    }

    fn is_silent(&self) -> bool {
        self.strength.is_silent() && self.bubbles.iter().all(|bubble| bubble.loudness < SILENCE)
    }
}

impl Iterator for SuctionVoice {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        let (strength, liquid) = (self.strength.next(), self.liquid.next());
        if self.is_silent() {
            return Some(0.0);
        }
        // Air and liquid come in slugs, not as a froth: that is the gurgle.
        let mixed = 4.0 * liquid * (1.0 - liquid);
        if self.noise.share() < (SLUGS_PER_S * mixed + 20.0 * (1.0 - mixed)) / self.rate_hz {
            let is_liquid = self.noise.share() < liquid;
            self.slug.aim(if is_liquid { 1.0 } else { 0.0 }, 0.0, 1.0);
        }
        // Between slugs that are nearly all air or all liquid the share itself is heard.
        let slug = mixed * self.slug.next() + (1.0 - mixed) * liquid;
        if self.noise.share() < mixed * strength * BUBBLES_PER_S / self.rate_hz {
            self.add_bubble();
        }
        let hiss = self.noise.next();
        let air = self.air.next(hiss);
        let [low, middle, high] = self.tube.each_mut().map(|filter| filter.next(hiss).band);
        let tube = 1.3 * low + 0.9 * middle + 0.6 * high;
        let slow = self.flow[0].next(hiss).low;
        let flow = self.flow[1].next(slow).band;
        let mut gurgle = 0.0;
        for bubble in &mut self.bubbles {
            bubble.phase.advance(bubble.hz / self.rate_hz);
            gurgle += bubble.loudness * bubble.phase.sin();
            bubble.loudness *= 1.0 - bubble.dying / self.rate_hz;
            bubble.hz *= 1.0 + 6.0 / self.rate_hz;
        }
        let air = (0.38 * air.band + 0.04 * air.high + 0.55 * tube) * within(1.0 - 0.94 * slug, 0.0, 1.0);
        let drawn = strength * (0.75 * air + (0.1 + 2.2 * slug) * flow);
        Some((drawn + 0.2 * gurgle).tanh())
    }
}
