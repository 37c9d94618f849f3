//! What can be seen through a pool's fluid.

use super::PoolFluid;
use bevy::reflect::Reflect;

/// From which shares on blood and bone dust hide the ground of a pool. One pair for all of it: the fluid is taken to be as deep
/// everywhere as it is on the average.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct Hiding {
    /// Share of blood in a cell from which on its ground is hidden.
    pub from: f32,
    /// How much the same share of dust hides.
    pub dust: f32,
}

impl Hiding {
    /// In fluid that is so deep on the average, metres.
    pub fn new(fluid: &PoolFluid, mean_depth_m: f32) -> Self {
        Self { from: fluid.hides_from_m / mean_depth_m.max(1e-6), dust: fluid.dust_hides }
    }

    /// Whether the ground of a cell is hidden, by its shares of blood and dust.
    pub fn hides(&self, blood: f32, dust: f32) -> bool {
        blood + self.dust * dust >= self.from
    }
}
