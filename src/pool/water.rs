//! How much fluid a pool holds, and where it came from and went.

use bevy::ecs::VariantDefaults;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use serde::{Deserialize, Serialize};

/// What decides how high a pool stands.
#[derive(Clone, Component, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
#[reflect(Component, Default, Clone)]
pub enum PoolLevel {
    /// What flows in and out: irrigation and bleeding raise it, suction and what runs over the rim lower it.
    #[default]
    Balanced,
    /// So high over the pool's origin, metres, whatever flows.
    Fixed(f32),
}

/// Fluid that came and went since the pool began, millilitres. What came in less what went out is what is held.
#[derive(Clone, Copy, Component, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
pub struct WaterBudget {
    /// In the cavity now.
    pub held_ml: f64,
    /// From irrigators.
    pub irrigated_ml: f64,
    /// From bleeders and cut tissue.
    pub bled_ml: f64,
    /// Into suckers.
    pub sucked_ml: f64,
    /// Over the rim.
    pub overflowed_ml: f64,
    /// Added (or, below 0, taken away) to keep a [`PoolLevel::Fixed`].
    pub adjusted_ml: f64,
}

impl WaterBudget {
    /// What came in less what went out, millilitres: what should be held.
    pub fn balance_ml(&self) -> f64 {
        self.irrigated_ml + self.bled_ml + self.adjusted_ml - self.sucked_ml - self.overflowed_ml
    }

    /// Takes out what there is of an amount, and returns how much that was.
    pub(super) fn suck(&mut self, wanted_ml: f64) -> f64 {
        let taken = wanted_ml.clamp(0.0, self.held_ml);
        self.held_ml -= taken;
        self.sucked_ml += taken;
        taken
    }

    pub(super) fn irrigate(&mut self, ml: f64) {
        self.held_ml += ml;
        self.irrigated_ml += ml;
    }

    pub(super) fn bleed(&mut self, ml: f64) {
        self.held_ml += ml;
        self.bled_ml += ml;
    }

    /// What is more than a capacity runs over; returns how much that was.
    pub(super) fn overflow(&mut self, capacity_ml: f64) -> f64 {
        let over = (self.held_ml - capacity_ml).max(0.0);
        self.held_ml -= over;
        self.overflowed_ml += over;
        over
    }

    /// Adds or takes what is needed to hold so much.
    pub(super) fn adjust(&mut self, held_ml: f64) {
        self.adjusted_ml += held_ml - self.held_ml;
        self.held_ml = held_ml;
    }
}
