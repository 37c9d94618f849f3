//! Elastic bodies: lattices that respond to gravity, pins and instruments.
//!
//! - [`ElasticBody`] is the component and the model: patches of a [`DeformLattice`](super::DeformLattice) are its cells, made of
//!   [`ElasticTissue`]
//! - [`PressBody`] and [`GraspBody`] are what instruments do; [`BodyContact`], [`GraspHeld`], [`GraspSlipped`] and [`TissueTorn`]
//!   are the answers
//!
//! A body lives in its entity's space: where the entity is moved, the body is moved rigidly along, without inertia. Where its
//! transform scales, lengths and forces are those of the body's own space. Whoever wants a model without Bevy's schedule calls
//! [`ElasticBody::step`].
//!
//! The solver is XPBD in small substeps over hexahedral cells: each cell relaxes its even deformation, bending and twisting towards
//! the nearest rotation (fixed corotated elasticity) by a matrix made beforehand, eight cells at a time, and then its volume; forth
//! and back over all cells. It is stable for any stiffness, force and length of step, and deterministic; see the source of `solver`
//! for why it was chosen.

mod body;
mod contact;
mod error;
pub(super) mod inverse;
mod measure;
mod messages;
mod saved;
mod solver;
mod surface;
mod systems;
mod tissue;
mod touch;
mod touching;

pub use body::{BodyFaults, ElasticBody, ElasticCell};
pub use error::ElasticError;
pub use messages::{BodyContact, GraspBody, GraspHeld, GraspSlipped, PressBody, TissueTorn};
pub use systems::StepBodies;
pub use tissue::ElasticTissue;
pub use touch::{BodyEvent, Hold, Press, ToolShape};

pub(super) use surface::Embedded;
pub(super) use systems::build;
