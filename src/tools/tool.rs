//! What an instrument is: its kind, its outline, the hand that holds it.

use super::{ToolCommand, ToolContacts, ToolForce, ToolMotion, ToolPose, ToolWork};
use crate::reactions::{Wound, burn::Cautery};
use crate::volume::cut::Burr;
use bevy::ecs::VariantDefaults;
use bevy::prelude::*;
use serde::{Deserialize, Serialize};

/// An instrument. Its [`ToolPose`] and [`ToolCommand`] say where it is and what is pressed; what it touches is in
/// [`ToolContacts`], what it does in [`ToolWork`]. Its transform follows the pose: the origin is the middle of the tip, the
/// tool points along its forward direction (-Z), the shaft goes back along +Z.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone)]
#[require(Transform, ToolPose, ToolCommand, ToolMotion, ToolContacts, ToolForce, ToolWork)]
#[serde(default, deny_unknown_fields)]
pub struct Tool {
    /// What it is.
    pub kind: ToolKind,
    /// How large it is.
    pub geometry: ToolGeometry,
    /// Which hand holds it.
    pub hand: ToolHand,
    /// Other burrs of a drill, in the order in which they can be put on ([`ToolCommand::next_burr`]). The one that was on takes the last
    /// place.
    pub burrs: Vec<Burr>,
}

/// A hand of the surgeon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum ToolHand {
    /// The right one.
    #[default]
    Right,
    /// The left one.
    Left,
}

/// Kinds of instruments, and what the [`ToolCommand`] makes them do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum ToolKind {
    /// Presses: the skin turns pale under it.
    #[default]
    Probe,
    /// Jaws: closed by the grip, they hold what is between them.
    Grasper(Jaws),
    /// Jaws with an edge: each bite (pedal, or grip that closes) in tissue opens a vessel.
    BiopsyNeedle(Wound),
    /// An electrode: coagulates with the pedal, cuts with the second pedal.
    CauteryHook(Electrodes),
    /// A burr that turns with the pedal.
    Drill(DrillHead),
    /// Irrigates all the time, sucks with the pedal. The [`SuctionIrrigator`](crate::pool::SuctionIrrigator) is a component beside
    /// the tool.
    SuctionIrrigator,
    /// Holds a camera, and touches nothing.
    Scope,
}

/// Jaws of a grasper.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default, deny_unknown_fields)]
pub struct Jaws {
    /// They hold tissue within this distance of the tip, metres.
    pub radius_m: f32,
    /// Force that closes them when the grip is fully closed, newtons.
    pub grip_force_n: f32,
    /// Friction of their inner sides.
    pub friction: f32,
}

impl Default for Jaws {
    /// Toothed jaws of 1 cm that grip with 12 N.
    fn default() -> Self {
        Self { radius_m: 0.01, grip_force_n: 12.0, friction: 0.8 }
    }
}

/// What an electrode gives under each pedal.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default, deny_unknown_fields)]
pub struct Electrodes {
    /// Under the pedal.
    pub coagulation: Cautery,
    /// Under the second pedal.
    pub cut: Cautery,
}

impl Default for Electrodes {
    fn default() -> Self {
        Self { coagulation: Cautery::coagulate(30.0), cut: Cautery::cut(40.0) }
    }
}

/// A burr and its motor.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default, deny_unknown_fields)]
pub struct DrillHead {
    /// The burr.
    pub burr: Burr,
    /// Turns per minute with the pedal fully down.
    pub full_speed_rpm: f32,
    /// Cutting edges.
    pub flutes: u32,
    /// Tangential over normal force.
    pub friction: f32,
    /// Vibration as a share of the normal force.
    pub vibration: f32,
}

impl Default for DrillHead {
    /// A cutting ball of 4 mm at 60,000 turns a minute.
    fn default() -> Self {
        Self { burr: Burr::default(), full_speed_rpm: 60_000.0, flutes: 8, friction: 0.2, vibration: 0.05 }
    }
}

/// Outline of an instrument: a ball at the tip and a straight shaft. The tip of a drill is its burr.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default, deny_unknown_fields)]
pub struct ToolGeometry {
    /// Radius of the ball at the tip, metres.
    pub tip_radius_m: f32,
    /// Length of the shaft behind the tip's middle, metres; 0 for one that touches nothing.
    pub shaft_length_m: f32,
    /// Radius of the shaft, metres.
    pub shaft_radius_m: f32,
    /// What is felt of its own mass, kilograms; 0 where the device's handle weighs as much.
    pub mass_kg: f32,
}

impl Default for ToolGeometry {
    /// A laparoscopic probe of 4.4 mm.
    fn default() -> Self {
        Self { tip_radius_m: 2.2e-3, shaft_length_m: 0.2, shaft_radius_m: 2.2e-3, mass_kg: 0.0 }
    }
}

impl Tool {
    /// A tool of a kind, with the outline that suits it, in the right hand.
    pub fn new(kind: ToolKind) -> Self {
        let outline = |tip_radius_m, shaft_radius_m, shaft_length_m| ToolGeometry {
            tip_radius_m,
            shaft_length_m,
            shaft_radius_m,
            mass_kg: 0.0,
        };
        let geometry = match kind {
            ToolKind::Probe | ToolKind::Grasper(_) => ToolGeometry::default(),
            ToolKind::BiopsyNeedle(_) => outline(1e-3, 1e-3, 0.2),
            ToolKind::CauteryHook(_) => outline(1e-3, 2.5e-3, 0.2),
            // The thin neck behind the burr.
            ToolKind::Drill(head) => outline(0.5 * head.burr.diameter_m, 0.75e-3, 0.03),
            ToolKind::SuctionIrrigator => outline(1e-3, 1e-3, 0.03),
            ToolKind::Scope => outline(0.0, 0.0, 0.0),
        };
        Self { kind, geometry, hand: ToolHand::Right, burrs: Vec::new() }
    }

    /// Puts the next burr on, where there is one.
    pub(super) fn put_next_burr_on(&mut self) {
        let ToolKind::Drill(head) = &mut self.kind else { return };
        if !self.burrs.is_empty() {
            let next = self.burrs.remove(0);
            self.burrs.push(std::mem::replace(&mut head.burr, next));
        }
    }

    /// The same in the other hand.
    pub fn in_hand(mut self, hand: ToolHand) -> Self {
        self.hand = hand;
        self
    }

    /// Radius of its tip, metres: the burr's, for a drill. Numbers that are none count as 0.
    pub fn tip_radius_m(&self) -> f32 {
        let radius_m = match self.kind {
            ToolKind::Drill(head) => 0.5 * head.burr.diameter_m,
            _ => self.geometry.tip_radius_m,
        };
        if radius_m.is_finite() { radius_m.clamp(0.0, 0.1) } else { 0.0 }
    }

    /// Whether it touches anything.
    pub fn is_solid(&self) -> bool {
        self.kind != ToolKind::Scope
    }
}
