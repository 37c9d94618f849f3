//! The fixed stages of one step of the world, their order, and nothing else.

use bevy::prelude::*;

/// One step of the world, chained in [`FixedUpdate`].
///
/// Put a system of your own into the stage whose inputs it reads; a system that must see a stage's results runs in
/// the next stage or `.after(..)` it. Everything here is deterministic: the same inputs give the same bits.
///
/// | stage | reads | writes |
/// |---|---|---|
/// | [`Sense`](Self::Sense) | devices, mouse, a recording | tool poses and commands |
/// | [`Touch`](Self::Touch) | poses, organs, volumes | contacts |
/// | [`Cut`](Self::Cut) | contacts with a running burr | cut volumes |
/// | [`Deform`](Self::Deform) | contacts, grasps | lattice nodes, organ vertices |
/// | [`React`](Self::React) | contacts, cuts, heat | blood, burns, whitening |
/// | [`Flow`](Self::Flow) | cuts, tools, bleeders | the fluid pool |
/// | [`Judge`](Self::Judge) | everything above | event log, goals, metrics |
/// | [`Publish`](Self::Publish) | dirty regions | what the render world takes next frame |
#[derive(SystemSet, Debug, Clone, Copy, PartialEq, Eq, Hash, Reflect)]
#[reflect(Debug, Clone, PartialEq, Hash)]
pub enum SurgerySystems {
    /// Devices, mouse or a recording become tool poses and commands. Write poses of your own device here; nothing
    /// that reads a pose may run before this stage.
    Sense,
    /// Poses meet organs and volumes: contacts with point, normal, depth and structure. Move organs before it.
    Touch,
    /// Running burrs remove material at their contacts. Runs before deformation, so that a cut is where the tool was.
    Cut,
    /// Contacts and grasps move lattice nodes and organ vertices. Systems that displace vertices by hand run here.
    Deform,
    /// The organ answers: bleeding, burning, whitening. Sees moved vertices; may not move them.
    React,
    /// One step of the fluid pool: sources, suction, level, solver.
    Flow,
    /// Goals, rules, metrics and the event log. Reads every earlier stage and changes none of their state.
    Judge,
    /// Collects dirty regions for the GPU. Nothing may change a model after this stage within the step.
    Publish,
}

/// Chains [`SurgerySystems`] in [`FixedUpdate`] and sets the step rate.
///
/// Members of the same stage are ordered among themselves by their own plugins.
#[derive(Default)]
pub struct SurgerySchedulePlugin {
    /// Steps per second. With `None`, the default, a rate that the app has set before is kept, and Bevy's own
    /// default of 64 Hz becomes 60 Hz.
    pub steps_per_second: Option<f64>,
}

impl Plugin for SurgerySchedulePlugin {
    fn build(&self, app: &mut App) {
        use SurgerySystems::{Cut, Deform, Flow, Judge, Publish, React, Sense, Touch};
        app.register_type::<SurgerySystems>();
        app.configure_sets(FixedUpdate, crate::checkpoint::BeginMessages.before(Sense));
        app.configure_sets(FixedUpdate, (Sense, Touch, Cut, Deform, React, Flow, Judge, Publish).chain());
        let bevys_own = Time::<Fixed>::default().timestep();
        let current = app.world().get_resource::<Time<Fixed>>().map(Time::<Fixed>::timestep);
        let is_unset = current.is_none_or(|timestep| timestep == bevys_own);
        if let Some(hz) = self.steps_per_second.or(is_unset.then_some(60.0)) {
            app.insert_resource(Time::<Fixed>::from_hz(hz));
        }
        crate::pacing::build(app);
    }
}
