//! What deforms, in an app.

use super::{AffineField, DeformLattice, FitReport, LatticeError, NormalDeformation, Patch, Subdivision, lattice};
use crate::checkpoint::KeepState;
use crate::schedule::SurgerySystems;
use bevy::prelude::*;

/// The crate's systems that move lattices, bodies and the organs that ride in them, in [`SurgerySystems::Deform`]: first the
/// animations, then the bodies, then the organs. A system of your own that moves a lattice by hand runs before it; what reads
/// lattices belongs behind it.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeformBodies;

/// Lattices, elastic bodies, and the organs that ride in them. See the [module](super).
pub struct DeformPlugin;

impl Plugin for DeformPlugin {
    fn build(&self, app: &mut App) {
        app.configure_sets(FixedUpdate, DeformBodies.in_set(SurgerySystems::Deform));
        super::animate::build(app);
        super::elastic::build(app);
        super::organs::build(app);
        app.register_type::<DeformLattice>()
            .register_type::<LatticeError>()
            .register_type::<Patch>()
            .register_type::<Subdivision>()
            .register_type::<lattice::Constraint>()
            .register_type::<lattice::Tree>()
            .register_type::<AffineField>()
            .register_type::<NormalDeformation>()
            .register_type::<FitReport>()
            .keep_large_component(|lattice: &DeformLattice| size_of_val(lattice.translations()) * 16);
    }
}
