//! What acts on the fluid in a step: burrs that stir, jets, suction, blood and dust (paper of 2009, section 4.3).

use bevy::reflect::Reflect;
use glam::Vec2;

/// Beyond so many radii from its middle a source does nothing.
pub const SOURCE_REACH: f32 = 3.0;
/// The same for what flows in and out, which is felt farther away.
pub const FLOW_REACH: f32 = 16.0;
/// Most sources of a step.
pub const MAX_SOURCES: usize = 64;

/// Something that acts on the fluid around a place, with weights that fall like Gauss's bell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct FluidSource {
    /// Its middle in the pool's plane, metres.
    pub place_m: Vec2,
    /// Standard deviation of its weights, metres; nothing happens unless it is above 0.
    pub radius_m: f32,
    /// Velocity that it adds in its middle, metres per second.
    pub push_m_s: Vec2,
    /// Velocity that it adds in its middle where the noise is 1, metres per second.
    pub stir_m_s: f32,
    /// What is added to places before the noise is looked up, metres: a burr's noise moves.
    pub stir_offset_m: Vec2,
    /// What flows in (above 0) or out, as area per second: volume by depth. Felt as a velocity away from it or towards it, which
    /// lasts as long as the source.
    pub flow_m2_s: f32,
    /// Blood and dust that it brings, in cells full of it.
    pub amount: [f32; 2],
    /// Share of all that is dissolved which it takes away in its middle, 0 to 1.
    pub clear: f32,
}

impl FluidSource {
    /// Whether all its numbers are finite and it has a size.
    pub fn is_good(&self) -> bool {
        let numbers = [self.radius_m, self.stir_m_s, self.flow_m2_s, self.clear, self.amount[0], self.amount[1]];
        self.radius_m > 0.0
            && numbers.iter().all(|number| number.is_finite())
            && [self.place_m, self.push_m_s, self.stir_offset_m].iter().all(|vector| vector.is_finite())
    }

    /// Its weight at an offset from its middle, metres: 1 in the middle, 0 beyond [`SOURCE_REACH`].
    pub fn weight(&self, offset_m: Vec2) -> f32 {
        let square = offset_m.length_squared() / (self.radius_m * self.radius_m);
        if square > SOURCE_REACH * SOURCE_REACH { 0.0 } else { (-0.5 * square).exp() }
    }

    /// The velocity at an offset from its middle, metres, of what flows in or out: that of a source in the plane, smooth in its
    /// middle and fading towards [`FLOW_REACH`].
    pub fn flow_m_s(&self, offset_m: Vec2) -> Vec2 {
        let square = offset_m.length_squared() / (self.radius_m * self.radius_m);
        let fade = 1.0 - square / (FLOW_REACH * FLOW_REACH);
        if fade <= 0.0 || self.flow_m2_s == 0.0 {
            return Vec2::ZERO;
        }
        // (1 - exp(-s/2)) / s, which is 1/2 in the middle. Far away the bell is less than half of the last digit of 1.
        let core = match square {
            _ if square < 1e-3 => 0.5 - square / 8.0,
            _ if square < 36.0 => (1.0 - (-0.5 * square).exp()) / square,
            _ => 1.0 / square,
        };
        let per_m = self.flow_m2_s / (std::f32::consts::TAU * self.radius_m * self.radius_m);
        offset_m * (per_m * core * fade)
    }
}

/// What becomes of the fluid in a step.
#[derive(Clone, Debug, PartialEq, Reflect)]
pub struct FluidAction {
    /// Sources in the order in which they act; those beyond [`MAX_SOURCES`] and those that are not good do nothing.
    pub sources: Vec<FluidSource>,
    /// Share of all blood and all dust that is there at the end: below 1 what dilutes, clots or settles takes some away.
    pub keep: [f32; 2],
}

impl Default for FluidAction {
    fn default() -> Self {
        Self { sources: Vec::new(), keep: [1.0; 2] }
    }
}

impl FluidAction {
    /// The sources that do something.
    pub fn good_sources(&self) -> impl Iterator<Item = &FluidSource> {
        self.sources.iter().filter(|source| source.is_good()).take(MAX_SOURCES)
    }

    /// The shares that are kept, within reason.
    pub fn keep(&self) -> [f32; 2] {
        self.keep.map(|share| if share.is_finite() { share.clamp(0.0, 2.0) } else { 1.0 })
    }
}

/// Blood and dust that a step brought and took, in cells full of it; blood first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct StepAmounts {
    /// What sources brought.
    pub brought: [f64; 2],
    /// What sources took away.
    pub cleared: [f64; 2],
    /// What the shares that are kept took away.
    pub faded: [f64; 2],
}
