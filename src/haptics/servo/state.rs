//! What the loop tells the simulation.

use crate::haptics::device::DeviceSample;
use crate::haptics::force::{BurrContact, MAX_CONTACTS};
use crate::haptics::safety::ForceState;
use crate::haptics::stats::ServoTiming;
use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};

/// A place at which the tool touches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct ServoContact {
    /// The body's, from the scene.
    pub body: u64,
    /// Which triangle of its patch.
    pub element: u32,
    /// Where, world, metres.
    pub point_m: DVec3,
    /// Away from the body.
    pub normal: DVec3,
    /// Force of the body on the tool, newtons, without friction.
    pub force_n: DVec3,
    /// How far the handle is behind the surface, metres.
    pub depth_m: f64,
}

/// The loop after a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct ServoState {
    /// Ticks so far.
    pub tick: u64,
    /// Time of the loop, seconds.
    pub time_s: f64,
    /// Time of the scene that it knew, seconds.
    pub scene_time_s: f64,
    /// The revision of the rig that it knew.
    pub rig_revision: u64,
    /// The newest good state of the device.
    pub sample: DeviceSample,
    /// Whether the device knows where its handle is.
    pub is_tracked: bool,
    /// Whether the hand moves the tool: not before the first scene, and not while a clutch is held. Where the tool is below is of
    /// the last time when it did.
    pub is_held: bool,
    /// Where the hand has the tool's tip, world, metres.
    pub tip_in_world_m: DVec3,
    /// Where the tip is shown: outside of what is solid.
    pub proxy_in_world_m: DVec3,
    /// How the tool is turned: it points along -Z of its own axes.
    pub world_from_tool: DQuat,
    /// How fast the hand moves the tip, world, smoothed.
    pub velocity_in_world_m_per_s: DVec3,
    /// What the models want the hand to feel, world, newtons.
    pub force_in_world_n: DVec3,
    /// What the device was told, device space, newtons.
    pub force_in_device_n: DVec3,
    /// What of it comes of contact, world, newtons.
    pub contact_force_n: DVec3,
    /// Where the tool touches; the first [`contact_count`](Self::contact_count) count.
    pub contacts: [ServoContact; MAX_CONTACTS],
    /// How many there are.
    pub contact_count: usize,
    /// Whether the tip rests on what it touches instead of sliding.
    pub sticks: bool,
    /// What a running burr does.
    pub burr: BurrContact,
    /// The body that it is in, from the scene.
    pub burr_body: Option<u64>,
    /// Force of a running burr on bone, summed over time since the beginning, newton seconds: the difference of two states by that of
    /// their times is the mean force between them, however few of them one has seen.
    pub burr_impulse_n_s: f64,
    /// What the safety does.
    pub force_state: ForceState,
    /// Samples that were no poses.
    pub dropped_samples: u64,
    /// Jumps of the handle.
    pub jumps: u64,
    /// Forces that were no numbers.
    pub bad_forces: u64,
    /// Work that this contact did on the hand beyond the hand's own, joules.
    pub excess_j: f64,
    /// Whether the device is gone, or the loop has stopped.
    pub is_over: bool,
    /// How the loop keeps time.
    pub timing: ServoTiming,
}

impl ServoState {
    /// Where the tool touches.
    pub fn contacts(&self) -> &[ServoContact] {
        &self.contacts[..self.contact_count.min(MAX_CONTACTS)]
    }
}
