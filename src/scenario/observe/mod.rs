//! From the world to [`Facts`](super::judge::Facts): what a scenario's goals and rules look at.

mod bodies;
mod exposure;
mod lesions;
mod scene;
mod step;
mod tools;
mod volumes;

pub use scene::ScenarioEye;

pub(super) use bodies::{Observed, begin};
pub(super) use scene::Scene;
pub(super) use step::Events;
