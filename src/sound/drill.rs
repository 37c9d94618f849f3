//! The voice of a drill: motor, bearing, and bone under the burr.

use super::parts::{Filter, Noise, Phase, Smooth, Wander, sane_rate_hz, within};
use super::voice::Voice;
use bevy::prelude::*;

/// How loud the tone and its overtones are. The sixth is that of a motor with three windings and one pair of poles.
const OVERTONES: [f32; 8] = [1.0, 0.5, 0.33, 0.2, 0.12, 0.3, 0.1, 0.14];

/// Turns of a ball bearing's cage, and balls that pass a place, for each turn of the shaft.
const CAGE_TURNS: f32 = 0.39;
const BALLS_PASSING: f32 = 3.1;

/// Filters are tuned once in so many samples.
const TUNED_EVERY: u32 = 32;

/// How a drill is built.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Default, Clone)]
pub struct DrillSound {
    /// Hertz of the tone per turn a second: 1 for a motor that one hears once a turn.
    pub tones_per_turn: f32,
    /// How much higher the tone gets per newton, as a share: 0.04 for the drill of the paper of 2009, where pressure raises the pitch.
    /// Below 0 for one that a load slows down.
    pub pitch_per_n: f32,
    /// No force changes the pitch by more than this share.
    pub most_pitch: f32,
    /// Flutes of the burr, whose strikes roughen the rasp.
    pub flutes: f32,
    /// From 0, a bearing that is not heard, to 1, a worn one.
    pub bearing: f32,
    /// Loudness of all, from 0 to 1.
    pub gain: f32,
}

impl Default for DrillSound {
    fn default() -> Self {
        Self { tones_per_turn: 1.0, pitch_per_n: 0.04, most_pitch: 0.3, flutes: 8.0, bearing: 0.4, gain: 0.6 }
    }
}

impl DrillSound {
    /// The fundamental at a speed and a force, hertz.
    pub fn fundamental_hz(&self, speed_rpm: f32, force_n: f32) -> f32 {
        let most = within(self.most_pitch, 0.0, 0.9);
        let bend = (self.pitch_per_n * force_n.max(0.0)).clamp(-most, most);
        speed_rpm / 60.0 * self.tones_per_turn * (1.0 + bend)
    }
}

/// What changes while it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
#[reflect(Default, Clone)]
pub struct DrillDials {
    /// Turns a minute; 0 is silent.
    pub speed_rpm: f32,
    /// Force of the burr against what it drills, newtons.
    pub force_n: f32,
    /// Share of the burr that is in bone, from 0 to 1.
    pub contact: f32,
    /// From 0, soft, to 1, cortical bone: harder sounds brighter and rings longer.
    pub hardness: f32,
}

/// The samples of a drill, from -1 to 1.
#[derive(Clone, Debug, TypePath)]
pub struct DrillVoice {
    sound: DrillSound,
    rate_hz: f32,
    until_tuned: u32,
    tone_hz: Smooth,
    loudness: Smooth,
    rasp: Smooth,
    hardness: Smooth,
    wander: [Wander; 2],
    motor: Phase,
    cage: Phase,
    balls: Phase,
    bearing: Filter,
    flutes: Phase,
    strike: f32,
    grain: Wander,
    bone: [Filter; 3],
    noise: Noise,
}

impl DrillVoice {
    /// A drill at rest. The same seed and dials give the same samples.
    pub fn new(sound: DrillSound, rate_hz: u32, seed: u64) -> Self {
        let rate_hz = sane_rate_hz(rate_hz);
        let smooth = |time_s| Smooth::new(0.0, time_s, rate_hz);
        Self {
            sound,
            rate_hz,
            until_tuned: 0,
            tone_hz: smooth(0.04),
            loudness: smooth(0.03),
            rasp: smooth(0.012),
            hardness: smooth(0.02),
            wander: [Wander::new(3.0, rate_hz), Wander::new(25.0, rate_hz)],
            motor: Phase::default(),
            cage: Phase::default(),
            balls: Phase::default(),
            bearing: Filter::default(),
            flutes: Phase::default(),
            strike: 0.0,
            grain: Wander::new(35.0, rate_hz),
            bone: [Filter::default(); 3],
            noise: Noise::new(seed),
        }
    }

    /// Another drill, from the next turn of its dials on.
    pub(super) fn rebuild(&mut self, sound: DrillSound) {
        self.sound = sound;
    }

    fn tune(&mut self, tone_hz: f32, hardness: f32) {
        self.until_tuned = TUNED_EVERY;
        self.bearing.tune((6.0 * tone_hz).clamp(2500.0, 9000.0), 0.5, self.rate_hz);
        // What is hard rings higher, and damps less.
        let low_hz = 380.0 + 1500.0 * hardness;
        let width = 0.9 - 0.5 * hardness;
        for (filter, (times, wider)) in self.bone.iter_mut().zip([(1.0, 1.0), (2.3, 0.8), (4.6, 1.2)]) {
            filter.tune(times * low_hz, wider * width, self.rate_hz);
        }
    }
}

impl Voice for DrillVoice {
    type Dials = DrillDials;

    fn turn(&mut self, dials: DrillDials) {
        let speed_rpm = dials.speed_rpm.clamp(0.0, 200_000.0);
        let force_n = dials.force_n.clamp(0.0, 100.0);
        // Where it comes to rest the tone falls with it, as motors do.
        self.tone_hz.aim(self.sound.fundamental_hz(speed_rpm, force_n), 0.0, 0.2 * self.rate_hz);
        self.loudness.aim((speed_rpm / 60_000.0).sqrt(), 0.0, 1.0);
        self.rasp.aim(
            if speed_rpm > 0.0 { dials.contact * (0.3 + 0.7 * force_n / (1.0 + force_n)) } else { 0.0 },
            0.0,
            1.0,
        );
        self.hardness.aim(dials.hardness, 0.0, 1.0);
    }

    fn rate_hz(&self) -> u32 {
        self.rate_hz as u32
    }

    fn is_silent(&self) -> bool {
        self.loudness.is_silent()
    }
}

impl Iterator for DrillVoice {
    type Item = f32;

    fn next(&mut self) -> Option<f32> {
        let (tone_hz, loudness) = (self.tone_hz.next(), self.loudness.next());
        let (rasp, hardness) = (self.rasp.next(), self.hardness.next());
        if self.is_silent() {
            return Some(0.0);
        }
        if self.until_tuned == 0 {
            self.tune(tone_hz, hardness);
        }
        self.until_tuned -= 1;
        let noise = &mut self.noise;
        let [slow, fast] = &mut self.wander;
        // No motor holds its speed; bone under the burr shakes it more.
        let shaken = 1.0 + 0.0012 * slow.next(noise) + (0.0004 + 0.002 * rasp) * fast.next(noise);
        let turn = tone_hz * shaken / self.rate_hz;
        self.motor.advance(turn);
        self.cage.advance(CAGE_TURNS * turn);
        self.balls.advance(BALLS_PASSING * turn);
        // Overtones share one phase, and sines of its multiples come from one another: sin (n + 1) x = 2 cos x sin n x - sin (n - 1) x.
        // They fade before half of the sampling rate, so that none comes back as another tone.
        let (base, cos) = self.motor.sin_cos();
        let (mut before, mut sine, mut motor) = (0.0, base, 0.0);
        for (n, loud) in (1_u8..).zip(OVERTONES) {
            let place = f32::from(n) * turn / 0.45;
            // A load roughens the current, so that the overtones come forth.
            let forth = if n == 1 { 1.0 } else { 0.7 + 0.9 * rasp };
            motor += sine * loud * forth * (1.0 - place).clamp(0.0, 1.0);
            (before, sine) = (sine, 2.0 * cos * sine - before);
        }
        let worn = within(self.sound.bearing, 0.0, 1.0);
        motor *= 1.0 + 0.35 * worn * self.cage.sin();
        let hiss = noise.next();
        let balls = self.bearing.next(hiss).band * (1.0 + 0.7 * self.balls.sin());

        // The flutes strike so often that one hears them as roughness: no two strikes are alike.
        let flutes_per_turn = within(self.sound.flutes, 1.0, 64.0);
        if self.flutes.advance((flutes_per_turn * turn).min(0.5)) {
            self.strike = 0.25 + 1.5 * noise.share() * noise.share();
        }
        let dying = (1.0 - self.flutes.turns()).powi(2);
        let grain = (0.8 + 0.3 * self.grain.next(noise)).clamp(0.15, 1.6);
        let rough = grain * (0.4 * hiss + self.strike * (0.9 * hiss * dying + 0.35 * (dying - 1.0 / 3.0)));
        let [low, middle, high] = self.bone.each_mut().map(|filter| filter.next(rough).band);
        let bone = (1.1 - 0.3 * hardness) * low + (0.25 + 0.55 * hardness) * middle + (0.05 + 0.5 * hardness) * high;

        let mixed = loudness * (0.26 * motor + 0.30 * worn * balls + 1.5 * rasp * bone);
        Some((within(self.sound.gain, 0.0, 1.0) * mixed).tanh())
    }
}
