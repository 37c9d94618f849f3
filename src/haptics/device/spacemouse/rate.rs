//! A cap that springs back moves a handle by rate: how far it is pushed says how fast the handle goes.

use super::SpaceMouseReport;
use crate::haptics::device::DeviceSample;
use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};

/// How deflections of the cap become motion of the handle.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct RateControl {
    /// Speed at full deflection, metres per second.
    pub full_speed_m_per_s: f64,
    /// Turning at full deflection, radians per second.
    pub full_turn_rad_per_s: f64,
    /// Share of full deflection below which nothing moves: caps do not spring back quite to their middle.
    pub dead_zone: f64,
    /// The handle stays within this radius, metres.
    pub reach_m: f64,
}

impl Default for RateControl {
    fn default() -> Self {
        Self { full_speed_m_per_s: 0.1, full_turn_rad_per_s: 1.5, dead_zone: 0.03, reach_m: 0.1 }
    }
}

/// A handle that is moved by rate.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct RateHandle {
    /// How it is moved.
    pub control: RateControl,
    push: DVec3,
    turn: DVec3,
    buttons: u32,
    position_m: DVec3,
    device_from_handle: DQuat,
}

impl RateHandle {
    /// A handle in the middle, not turned.
    pub fn new(control: RateControl) -> Self {
        Self {
            control,
            push: DVec3::ZERO,
            turn: DVec3::ZERO,
            buttons: 0,
            position_m: DVec3::ZERO,
            device_from_handle: DQuat::IDENTITY,
        }
    }

    /// Takes a report in.
    pub fn take(&mut self, report: SpaceMouseReport) {
        match report {
            SpaceMouseReport::Push(push) => self.push = push,
            SpaceMouseReport::Turn(turn) => self.turn = turn,
            SpaceMouseReport::PushAndTurn(push, turn) => (self.push, self.turn) = (push, turn),
            SpaceMouseReport::Buttons(buttons) => self.buttons = buttons,
        }
    }

    /// Deflections beyond the dead zone, which begin there from nothing.
    fn beyond(&self, deflection: DVec3) -> DVec3 {
        let dead = self.control.dead_zone.clamp(0.0, 0.9);
        let share = |along: f64| along.signum() * (along.abs() - dead).max(0.0) / (1.0 - dead);
        DVec3::from_array(deflection.to_array().map(share))
    }

    /// Lets time pass, and says where the handle is.
    pub fn step(&mut self, dt_s: f64, time_s: f64) -> DeviceSample {
        let dt_s = if dt_s.is_finite() { dt_s.clamp(0.0, 0.1) } else { 0.0 };
        let before_m = self.position_m;
        let way_m = self.beyond(self.push) * self.control.full_speed_m_per_s * dt_s;
        self.position_m = (before_m + way_m).clamp_length_max(self.control.reach_m.max(0.0));
        let turned = self.beyond(self.turn) * self.control.full_turn_rad_per_s * dt_s;
        self.device_from_handle = (DQuat::from_scaled_axis(turned) * self.device_from_handle).normalize();
        let velocity_m_per_s = if dt_s > 0.0 { Some((self.position_m - before_m) / dt_s) } else { None };
        DeviceSample {
            time_s,
            position_m: self.position_m,
            device_from_handle: self.device_from_handle,
            velocity_m_per_s,
            buttons: self.buttons,
            ..DeviceSample::default()
        }
    }
}
