//! The noise with which a burr stirs (paper of 2009, section 4.3).

use bevy::reflect::Reflect;
use glam::{UVec2, Vec2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Directions and strengths that repeat in both directions: two numbers of mean 0 per texel, of which none is beyond 1.
///
/// Clones share the texels.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct StirNoise {
    side: u32,
    period_m: f32,
    texels: Arc<[Vec2]>,
}

impl StirNoise {
    /// Texels along a side.
    pub const SIDE: u32 = 64;
    /// Length after which it repeats, metres.
    pub const PERIOD_M: f32 = 8e-3;

    /// Perlin's gradient noise of 2002, twice: a lattice of 8 x 8 gradients and half as much of one of 16 x 16.
    pub fn perlin(seed: u64) -> Self {
        let mut random = Pcg32::seed_from_u64(seed);
        let mut texels = vec![Vec2::ZERO; (Self::SIDE * Self::SIDE) as usize];
        for (lattice, strength) in [(8_u32, 1.0), (16, 0.5)] {
            for channel in 0..2 {
                let gradients: Vec<Vec2> =
                    (0..lattice * lattice).map(|_| Vec2::from_angle(random.random_range(0.0..TAU))).collect();
                for (place, texel) in texels.iter_mut().enumerate() {
                    let at = UVec2::new(place as u32 % Self::SIDE, place as u32 / Self::SIDE).as_vec2();
                    // Off the lattice, on which gradient noise is 0.
                    let at = (at + 0.5) * lattice as f32 / Self::SIDE as f32;
                    texel[channel] += strength * perlin(&gradients, lattice, at);
                }
            }
        }
        let count = texels.len() as f32;
        let mean = texels.iter().sum::<Vec2>() / count;
        let most = texels.iter().map(|texel| (*texel - mean).abs().max_element()).fold(1e-6, f32::max);
        texels.iter_mut().for_each(|texel| *texel = (*texel - mean) / most);
        Self { side: Self::SIDE, period_m: Self::PERIOD_M, texels: texels.into() }
    }

    /// A noise of one's own: side x side texels, row by row. Nothing if there are not so many, the side is not within 1 and 1024,
    /// a number lies beyond 1, or the period is no length from 1e-5 to 10 metres.
    pub fn new(side: u32, period_m: f32, texels: Vec<Vec2>) -> Option<Self> {
        let is_good = (1..=1024).contains(&side)
            && texels.len() == (side * side) as usize
            && texels.iter().all(|texel| texel.abs().max_element() <= 1.0)
            && (1e-5..=10.0).contains(&period_m);
        is_good.then(|| Self { side, period_m, texels: texels.into() })
    }

    /// Texels along a side.
    pub fn side(&self) -> u32 {
        self.side
    }

    /// Length after which it repeats, metres.
    pub fn period_m(&self) -> f32 {
        self.period_m
    }

    /// The texels, row by row.
    pub fn texels(&self) -> &[Vec2] {
        &self.texels
    }

    /// Interpolated at a place, metres.
    pub fn at(&self, place_m: Vec2) -> Vec2 {
        let at = place_m / self.period_m * self.side as f32;
        let floor = at.floor();
        let share = at - floor;
        let texel = |x: i32, y: i32| {
            let cell = floor.as_ivec2() + glam::IVec2::new(x, y);
            let side = self.side as i32;
            self.texels[(cell.y.rem_euclid(side) * side + cell.x.rem_euclid(side)) as usize]
        };
        texel(0, 0).lerp(texel(1, 0), share.x).lerp(texel(0, 1).lerp(texel(1, 1), share.x), share.y)
    }
}

impl Default for StirNoise {
    fn default() -> Self {
        Self::perlin(1)
    }
}

fn perlin(gradients: &[Vec2], lattice: u32, at: Vec2) -> f32 {
    let floor = at.floor();
    let share = at - floor;
    let corner = |offset: Vec2| {
        let node = (floor + offset).as_uvec2() % lattice;
        gradients[(node.y * lattice + node.x) as usize].dot(share - offset)
    };
    let fade = share * share * share * (share * (share * 6.0 - 15.0) + 10.0);
    let along = |y: f32| corner(Vec2::new(0.0, y)) * (1.0 - fade.x) + corner(Vec2::new(1.0, y)) * fade.x;
    along(0.0) * (1.0 - fade.y) + along(1.0) * fade.y
}
