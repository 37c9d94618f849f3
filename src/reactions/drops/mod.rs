//! Drops that run over the organ: how their heads move, and what happens where they meet.
//!
//! - [`walk`]: straight on over the triangles; the one way in which anything moves on the surface.
//! - [`DropSettings`]: the liquid, and how it clings. [`DropSettings::step`] moves a [`DropHead`] for a fixed step.
//! - [`DropCollisions`]: merging heads, cancelled tails, wet ground.
//!
//! The physics is in metres and seconds on the surface itself. The paper (Neyret, Heiss and Senegas 2002, section 5.3)
//! takes the velocity through the Jacobian into the texture and moves the drop there, which is exact only for small
//! steps and has to treat the date line and the poles; walking on the faces needs neither, and texture coordinates
//! follow from where the drop is.

mod merge;
mod motion;
mod settings;
mod walk;

pub use merge::DropCollisions;
pub use motion::{DropFate, DropHead};
pub use settings::DropSettings;
pub use walk::{Walk, WalkError, WalkStop, walk};
