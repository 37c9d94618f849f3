//! One tick: device, models, safety, device.

use super::link::{ServoFault, ServoLink};
use super::scene::{MAX_BODIES, RigPose, ServoScene, ServoShape};
use super::state::{ServoContact, ServoState};
use crate::haptics::device::{DeviceFault, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice};
use crate::haptics::energy::PassivityObserver;
use crate::haptics::exchange::{Publisher, Subscriber, exchange};
use crate::haptics::force::{ContactPatch, ContactShape, Coupling, Obstacle, Proxy, SurfaceFeel};
use crate::haptics::safety::{SafetyChain, SafetySettings, Tracked, Tracking, Wanted};
use crate::haptics::stats::TimingMeter;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{SyncSender, sync_channel};

/// How the loop runs.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct ServoSettings {
    /// Seconds per tick in a thread; stiffness is limited for it.
    pub period_s: f64,
    /// For how long before a tick a thread spins instead of sleeping, seconds.
    pub spin_s: f64,
    /// Contact forces at which a rumble is at its full, newtons.
    pub full_rumble_n: f64,
    /// The safety's.
    pub safety: SafetySettings,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self { period_s: 1e-3, spin_s: 150e-6, full_rumble_n: 3.0, safety: SafetySettings::default() }
    }
}

impl ServoSettings {
    /// With a period that is one.
    pub(crate) fn period_s(&self) -> f64 {
        if self.period_s.is_finite() { self.period_s.clamp(1e-4, 0.02) } else { 1e-3 }
    }
}

/// Faults that wait to be read; more are dropped.
const FAULTS: usize = 64;
/// Ticks between two looks at the times measured.
const TIMING_TICKS: u64 = 128;
/// Stands where there is no obstacle: a plane without a direction.
static NOTHING: ContactPatch = ContactPatch {
    shape: ContactShape::Plane { point_m: DVec3::ZERO, normal: DVec3::ZERO, radius_m: 0.0 },
    moved_m: DVec3::ZERO,
    feel: SurfaceFeel::LIVER,
};

/// The loop. Owns the device; steps by hand, or in a [`ServoThread`](super::ServoThread).
pub struct ServoEngine {
    device: Box<dyn HapticDevice>,
    settings: ServoSettings,
    scenes: Subscriber<ServoScene>,
    states: Publisher<ServoState>,
    faults: SyncSender<ServoFault>,
    last_fault: Option<DeviceFault>,
    hand: Hand,
    state: ServoState,
    pub(super) meter: TimingMeter,
    is_over: bool,
}

/// What the loop remembers of hand and tool.
struct Hand {
    limits: DeviceLimits,
    tracking: Tracking,
    safety: SafetyChain,
    proxy: Proxy,
    observer: PassivityObserver,
    silent_s: f64,
    share: f64,
    rig_from: Option<RigPose>,
    rig_now: Option<RigPose>,
    rig_revision: Option<u64>,
    /// Out of the bone that held the burr in the tick before.
    bone_normal: Option<DVec3>,
    /// Turns of the vibration.
    phase: f64,
}

impl Hand {
    fn new(limits: DeviceLimits, safety: SafetySettings) -> Self {
        Self {
            limits,
            tracking: Tracking::new(safety),
            safety: SafetyChain::new(&limits, safety),
            proxy: Proxy::default(),
            observer: PassivityObserver::default(),
            silent_s: f64::INFINITY,
            share: 0.0,
            rig_from: None,
            rig_now: None,
            rig_revision: None,
            bone_normal: None,
            phase: 0.0,
        }
    }

    /// No force now; what was remembered of contact does not count any more.
    fn release(&mut self) {
        self.safety.trip();
        self.observer.reset();
        self.proxy.reset(self.proxy.place_m());
        self.bone_normal = None;
    }

    /// What the models reckon with: a device without motors has forces, too, that cut and are heard.
    fn felt_limits(&self) -> DeviceLimits {
        if self.limits.max_force_n > 0.0 { self.limits } else { DeviceLimits::INVERSE3 }
    }
}

impl ServoEngine {
    /// A loop for a device that is open, and the simulation's end of it.
    pub fn new(device: Box<dyn HapticDevice>, settings: ServoSettings) -> (Self, ServoLink) {
        let (scene_out, scenes) = exchange();
        let (states, state_in) = exchange();
        let (faults, fault_in) = sync_channel(FAULTS);
        let hand = Hand::new(device.info().limits, settings.safety);
        let engine = Self {
            device,
            settings,
            scenes,
            states,
            faults,
            last_fault: None,
            hand,
            state: ServoState::default(),
            meter: TimingMeter::default(),
            is_over: false,
        };
        (engine, ServoLink { scenes: scene_out, states: state_in, faults: fault_in })
    }

    /// How it runs.
    pub fn settings(&self) -> &ServoSettings {
        &self.settings
    }

    /// The device.
    pub fn device(&self) -> &dyn HapticDevice {
        &*self.device
    }

    /// The state after the last tick.
    pub fn state(&self) -> &ServoState {
        &self.state
    }

    /// Whether the device is gone or the loop was stopped: ticks do nothing until [`replace_device`](Self::replace_device).
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Another device, or the same one opened again; begins anew. Returns the old one, at zero force.
    pub fn replace_device(&mut self, device: Box<dyn HapticDevice>) -> Box<dyn HapticDevice> {
        self.stop();
        self.hand = Hand::new(device.info().limits, self.settings.safety);
        self.last_fault = None;
        (self.is_over, self.state.is_over) = (false, false);
        std::mem::replace(&mut self.device, device)
    }

    /// Zero force, and no more ticks.
    pub fn stop(&mut self) {
        self.hand.release();
        self.is_over = true;
        // Whatever happens, the device is told once.
        let told = catch_unwind(AssertUnwindSafe(|| self.device.write(&DeviceOutput::default())));
        if let Ok(Err(fault)) = told {
            self.tell(fault);
        }
        self.state.force_in_device_n = DVec3::ZERO;
        (self.state.is_over, self.state.is_held) = (true, false);
        self.states.publish(self.state);
    }

    /// Stops after a panic, with a message.
    pub(super) fn stop_after_panic(&mut self, message: String) {
        self.stop();
        drop(self.faults.try_send(ServoFault::Panic(message)));
    }

    fn tell(&mut self, fault: DeviceFault) {
        if self.last_fault.as_ref() != Some(&fault) {
            drop(self.faults.try_send(ServoFault::Device(fault.clone())));
            self.last_fault = Some(fault);
        }
    }

    /// One tick of so many seconds. With the same device, scenes and times always the same.
    pub fn tick(&mut self, dt_s: f64) {
        if self.is_over || !(dt_s.is_finite() && dt_s > 0.0) {
            return;
        }
        self.state.tick += 1;
        self.state.time_s += dt_s;
        let is_fresh = self.scenes.take_newest();
        let sample = match self.device.read() {
            Ok(sample) => Some(sample),
            Err(fault) => {
                let is_over = fault.is_over();
                self.tell(fault);
                if is_over {
                    self.stop();
                    return;
                }
                None
            }
        };
        let (hand, state, settings) = (&mut self.hand, &mut self.state, &self.settings);
        let output = self.scenes.read(|scene| hand.tick(scene, is_fresh, sample.as_ref(), dt_s, settings, state));
        let written = self.device.write(&output.unwrap_or_default());
        if let Err(fault) = written {
            let is_over = fault.is_over();
            self.tell(fault);
            if is_over {
                self.stop();
                return;
            }
        }
        if self.state.tick.is_multiple_of(TIMING_TICKS) {
            self.state.timing = self.meter.timing();
        }
        self.states.publish(self.state);
    }
}

impl Drop for ServoEngine {
    fn drop(&mut self) {
        if !self.is_over {
            self.stop();
        }
    }
}

impl Hand {
    fn tick(
        &mut self,
        scene: &ServoScene,
        is_fresh: bool,
        sample: Option<&DeviceSample>,
        dt_s: f64,
        settings: &ServoSettings,
        state: &mut ServoState,
    ) -> DeviceOutput {
        let shares = self.advance(scene, is_fresh, dt_s);
        let tracked = self.tracking.follow(sample, dt_s);
        let moved_m = match tracked {
            Tracked::Moved { by_m } => by_m,
            Tracked::Began | Tracked::Lost => {
                self.release();
                DVec3::ZERO
            }
            Tracked::Dropped => DVec3::ZERO,
        };
        let rig = self.follow_rig(scene);
        let handle = self.tracking.sample().copied();
        state.is_tracked = handle.is_some();
        // Also with the clutch held: its button is in there.
        state.sample = handle.unwrap_or(state.sample);
        (state.scene_time_s, state.rig_revision) = (scene.time_s, scene.rig.revision);
        (state.dropped_samples, state.jumps) = (self.tracking.dropped(), self.tracking.jumps());
        let is_held = scene.rig.is_engaged && self.silent_s.is_finite();
        state.is_held = is_held && handle.is_some() && rig.is_some();
        let (Some(handle), Some(rig), true) = (handle, rig, is_held) else {
            self.release();
            state.force_in_world_n = DVec3::ZERO;
            state.contact_force_n = DVec3::ZERO;
            state.force_in_device_n = DVec3::ZERO;
            (state.contact_count, state.burr, state.burr_body) = (0, Default::default(), None);
            state.force_state = self.safety.state(false);
            return DeviceOutput::default();
        };
        let rotation = (rig.rotation * handle.device_from_handle).normalize();
        let tip_m = rig.place(handle.position_m) + rotation * scene.tool.tip_in_handle_m;
        let velocity = rig.rotation * (self.tracking.velocity_m_per_s() * rig.scale);
        state.tip_in_world_m = tip_m;
        state.world_from_tool = rotation;
        state.velocity_in_world_m_per_s = velocity;
        let force_scale = scene.rig.force_scale;
        let coupling = Coupling::new(&self.felt_limits(), settings.period_s(), rig.scale, force_scale);
        let (passive_n, active_n, lent_j) =
            self.feel(scene, tip_m, rotation, velocity, shares, &coupling, dt_s, settings, state);
        state.proxy_in_world_m = self.proxy.place_m();
        state.contact_force_n = passive_n;
        let to_hand = |force_n: DVec3| rig.rotation.inverse() * (force_n * force_scale);
        self.observer.observe(moved_m, lent_j * force_scale / rig.scale, dt_s);
        let passive_hand_n = self.observer.hold(
            to_hand(passive_n),
            self.tracking.velocity_m_per_s(),
            coupling.controller_damping_n_s_per_m(),
            dt_s,
        );
        let active_hand_n = to_hand(active_n);
        let wanted_n = passive_hand_n + active_hand_n;
        state.force_in_world_n = passive_n + active_n;
        state.excess_j = self.observer.excess_j();
        let wanted =
            Wanted { force_n: wanted_n, contact_n: passive_hand_n.length(), silent_s: self.silent_s, is_held: true };
        let told_n = self.safety.limit(wanted, dt_s);
        // What the device holds of the contact until the next tick, for the observer.
        let kept = told_n.dot(wanted_n) / wanted_n.length_squared().max(1e-12);
        self.observer.held(if passive_hand_n == DVec3::ZERO {
            DVec3::ZERO
        } else {
            told_n - active_hand_n * kept.clamp(0.0, 1.0)
        });
        state.force_in_device_n = told_n;
        state.force_state = self.safety.state(true);
        state.bad_forces = self.safety.not_numbers();
        let rumble = (passive_n.length() + active_n.length()) / settings.full_rumble_n.max(1e-3);
        let rumble = if rumble.is_finite() && state.force_state.is_on() { rumble.min(1.0) as f32 } else { 0.0 };
        DeviceOutput { force_n: told_n, torque_n_m: DVec3::ZERO, rumble }
    }

    /// How far things have moved between two scenes, before this tick and now. The tick at which a scene comes finds everything where
    /// the last one left it.
    fn advance(&mut self, scene: &ServoScene, is_fresh: bool, dt_s: f64) -> [f64; 2] {
        if is_fresh {
            (self.silent_s, self.share) = (0.0, 0.0);
            self.rig_from = self.rig_now;
            return [0.0; 2];
        }
        self.silent_s += dt_s;
        let before = self.share;
        let interval_s = if scene.interval_s.is_finite() { scene.interval_s.max(dt_s) } else { dt_s };
        self.share = (before + dt_s / interval_s).min(1.0);
        [before, self.share]
    }

    fn follow_rig(&mut self, scene: &ServoScene) -> Option<RigPose> {
        let aim = RigPose::new(&scene.rig);
        if self.rig_revision != Some(scene.rig.revision) {
            self.rig_revision = Some(scene.rig.revision);
            self.release();
            (self.rig_from, self.rig_now) = (aim, aim);
        }
        self.rig_now = match (self.rig_from, aim) {
            (Some(from), Some(aim)) => Some(from.towards(&aim, self.share)),
            _ => aim,
        };
        self.rig_now
    }

    /// The models: forces that store and take energy, forces that give it, and the work of what moves by itself.
    fn feel(
        &mut self,
        scene: &ServoScene,
        tip_m: DVec3,
        rotation: DQuat,
        velocity_m_per_s: DVec3,
        shares: [f64; 2],
        coupling: &Coupling,
        dt_s: f64,
        settings: &ServoSettings,
        state: &mut ServoState,
    ) -> (DVec3, DVec3, f64) {
        let turning = scene.tool.turning();
        let mut obstacles = [Obstacle::Contact(&NOTHING); MAX_BODIES];
        for (obstacle, body) in obstacles.iter_mut().zip(&scene.bodies) {
            match &body.shape {
                ServoShape::Surface(patch) => *obstacle = Obstacle::Surface(patch),
                // A burr that turns goes in.
                ServoShape::Bone(_) if turning.is_some() => {}
                ServoShape::Bone(bone) => *obstacle = Obstacle::Surface(&bone.surface),
                ServoShape::Contact(contact) => *obstacle = Obstacle::Contact(contact),
            }
        }
        let obstacles = &obstacles[..scene.bodies.len().min(MAX_BODIES)];
        let (parts, count) = scene.tool.parts(rotation);
        let was_m = self.proxy.place_m();
        // Bone that held the burr holds it again: what lies far behind that need not be searched.
        let held_m =
            self.bone_normal.take().filter(|_| turning.is_some()).map_or(DVec3::ZERO, |normal| {
                normal * ((was_m - tip_m).dot(normal) - scene.tool.tip_radius_m).max(0.0)
            });
        let step = self.proxy.step(tip_m + held_m, velocity_m_per_s, &parts[..count], obstacles, shares, coupling);
        state.contact_count = step.count;
        for (told, contact) in state.contacts.iter_mut().zip(&step.contacts[..step.count]) {
            *told = ServoContact {
                body: scene.bodies.get(contact.body as usize).map_or(0, |body| body.id),
                element: contact.element,
                point_m: contact.point_m,
                normal: contact.normal,
                force_n: contact.force_n,
                depth_m: contact.depth_m,
            };
        }
        state.sticks = step.sticks;
        let mut passive_n = step.force_n;
        let most_drag = coupling.drag_n_s_per_m();
        let mut active_n = scene.tool.load.force_n(velocity_m_per_s, most_drag);
        (state.burr, state.burr_body) = (Default::default(), None);
        let Some(burr) = turning.filter(|_| self.proxy.is_free()) else { return (passive_n, active_n, step.lent_j) };
        self.phase = (self.phase + burr.shown_hz(settings.period_s()) * dt_s).fract();
        let axis = rotation * super::ServoTool::BACK;
        state.burr.strikes_hz = burr.strikes_hz();
        for body in scene.bodies.iter().take(MAX_BODIES) {
            let ServoShape::Bone(bone) = &body.shape else { continue };
            let goal_m = self.proxy.place_m();
            let mut push = burr.push(&bone.brick, was_m, goal_m, goal_m - held_m, axis, coupling, self.phase);
            self.proxy.put(push.place_m);
            self.bone_normal = if push.is_held { Some(push.contact.normal) } else { self.bone_normal };
            if push.contact.depth_m <= 0.0 {
                continue;
            }
            passive_n += push.spring_n;
            active_n += push.turning_n;
            // No bone is pressed harder than a hand at this device can.
            push.contact.force_n = push.contact.force_n.min(self.felt_limits().max_force_n);
            if push.contact.force_n > state.burr.force_n {
                (state.burr, state.burr_body) = (push.contact, Some(body.id));
            }
        }
        state.burr_impulse_n_s += state.burr.force_n * dt_s;
        (passive_n, active_n, step.lent_j)
    }
}
