//! A simulated device, pressed into things for ten seconds: nothing builds up, and no energy comes out.

use super::scene::{bone_below, floor, scene};
use bevy_surgery::haptics::device::{
    DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy_surgery::haptics::energy::PassivityObserver;
use bevy_surgery::haptics::force::{BonePatch, Coupling, SurfaceFeel, TurningBurr};
use bevy_surgery::haptics::servo::{ServoEngine, ServoScene, ServoSettings, ServoShape};
use glam::{DVec3, Vec3};
use std::sync::{Arc, Mutex};

const PRESETS: [(&str, DeviceLimits); 7] = [
    ("Touch", DeviceLimits::TOUCH),
    ("Omni", DeviceLimits::OMNI),
    ("Desktop", DeviceLimits::DESKTOP),
    ("Falcon", DeviceLimits::FALCON),
    ("omega", DeviceLimits::OMEGA),
    ("sigma", DeviceLimits::SIGMA),
    ("Inverse3", DeviceLimits::INVERSE3),
];

/// Mass, damping and Coulomb friction along Y, and a steady push of a hand; the force is held between two ticks.
struct Handle {
    limits: DeviceLimits,
    coulomb_n: f64,
    push_n: f64,
    place_m: f64,
    speed: f64,
    force_n: f64,
    /// Work of the held force on the handle, less what its own damping ate: what came out to the hand, joules.
    out_j: f64,
    peak_out_j: f64,
}

impl Handle {
    fn pass(&mut self, dt_s: f64) {
        const PARTS: u32 = 20;
        let h = dt_s / f64::from(PARTS);
        for _ in 0..PARTS {
            let drive = self.force_n + self.push_n;
            let mut speed =
                self.speed + (drive - self.limits.own_damping_n_s_per_m * self.speed) / self.limits.own_mass_kg * h;
            // Dry friction takes speed away, but never turns it round.
            let taken = self.coulomb_n / self.limits.own_mass_kg * h;
            speed -= speed.clamp(-taken, taken);
            self.out_j += (self.force_n - self.limits.own_damping_n_s_per_m * speed) * speed * h;
            self.peak_out_j = self.peak_out_j.max(self.out_j);
            self.speed = speed;
            self.place_m += speed * h;
        }
    }
}

struct SimulatedDevice(DeviceInfo, Arc<Mutex<Handle>>);

impl HapticDevice for SimulatedDevice {
    fn info(&self) -> &DeviceInfo {
        &self.0
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let handle = self.1.lock().expect("the handle");
        let step_m = handle.limits.encoder_step_m;
        let position_m = DVec3::Y * (handle.place_m / step_m).round() * step_m;
        Ok(DeviceSample { position_m, ..DeviceSample::default() })
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        self.1.lock().expect("the handle").force_n = output.force_n.y;
        Ok(())
    }
}

/// What became of ten seconds.
struct Outcome {
    /// Swing of the handle in the third second and in the last, metres.
    early_m: f64,
    late_m: f64,
    peak_out_j: f64,
    depth_m: f64,
    /// In the mean of the last second: a step of the encoder is a tenth of a newton at the stiffest walls.
    force_n: f64,
}

fn press(limits: DeviceLimits, coulomb_n: f64, to: &ServoScene, start_m: f64) -> Outcome {
    let handle = Handle {
        limits,
        coulomb_n,
        push_n: 0.0,
        place_m: start_m,
        speed: 0.0,
        force_n: 0.0,
        out_j: 0.0,
        peak_out_j: 0.0,
    };
    let handle = Arc::new(Mutex::new(handle));
    let info = DeviceInfo {
        id: "simulated:1".into(),
        name: "simulated".into(),
        kind: DeviceKind::Simulated,
        limits,
        has_force: true,
        has_rotation: false,
        has_grip: false,
        buttons: 0,
    };
    let device = SimulatedDevice(info, handle.clone());
    let (mut engine, mut link) = ServoEngine::new(Box::new(device), ServoSettings::default());
    let mut swing = [[f64::INFINITY, f64::NEG_INFINITY]; 10];
    let mut force_n = 0.0;
    for tick in 0..10_000_usize {
        if tick.is_multiple_of(16) {
            link.publish(to.clone());
        }
        engine.tick(1e-3);
        let mut handle = handle.lock().expect("the handle");
        // It waits until the force is whole, then a hand pushes it in.
        handle.push_n = if tick < 500 { 0.0 } else { -1.0 };
        handle.pass(1e-3);
        force_n += if tick < 9000 { 0.0 } else { handle.force_n * 1e-3 };
        let [least, greatest] = &mut swing[tick / 1000];
        (*least, *greatest) = (least.min(handle.place_m), greatest.max(handle.place_m));
    }
    let handle = handle.lock().expect("the handle");
    let state = engine.state();
    let of = |second: usize| swing[second][1] - swing[second][0];
    Outcome {
        early_m: of(3),
        late_m: of(9),
        peak_out_j: handle.peak_out_j,
        depth_m: state.contacts().first().map_or(state.burr.depth_m, |contact| contact.depth_m),
        force_n,
    }
}

fn is_quiet(name: &str, what: &str, limits: &DeviceLimits, found: &Outcome) {
    let step_m = limits.encoder_step_m;
    let told = format!(
        "{name} in {what}: swings {:.1} then {:.1} steps, {:.2e} J out, {:.2} N at {:.2} mm",
        found.early_m / step_m,
        found.late_m / step_m,
        found.peak_out_j,
        found.force_n,
        found.depth_m * 1e3
    );
    println!("{told}");
    assert!(found.late_m <= found.early_m.max(2.0 * step_m) && found.late_m < 4.0 * step_m, "{told}");
    // Half a step of the encoder at the force of the hand: what cannot be told from nothing.
    assert!(found.peak_out_j <= 1.0 * 0.5 * step_m, "{told}");
    assert!((found.force_n - 1.0).abs() < 0.1 && found.depth_m > 0.0, "{told}");
}

#[test]
fn no_device_hums_at_a_wall() {
    let mut wall = SurfaceFeel::BONE;
    (wall.static_friction, wall.dynamic_friction) = (0.0, 0.0);
    let to = scene(vec![ServoShape::Surface(Arc::new(floor(0.0, wall)))]);
    for (name, limits) in PRESETS {
        is_quiet(name, "a wall", &limits, &press(limits, 0.05, &to, 0.005));
    }
}

#[test]
fn no_device_hums_in_bone() {
    let bone = Arc::new(BonePatch::new(bone_below(Vec3::Y, 48, 0.25e-3), SurfaceFeel::BONE));
    let mut to = scene(vec![ServoShape::Bone(bone)]);
    for (name, limits) in PRESETS {
        is_quiet(name, "bone", &limits, &press(limits, 0.05, &to, 0.005));
    }
    to.tool.burr = Some(TurningBurr { speed_rpm: 1.0, flutes: 1, stiffness_n_per_m: 5000.0, ..TurningBurr::default() });
    for (name, limits) in PRESETS {
        is_quiet(name, "bone under a burr", &limits, &press(limits, 0.05, &to, 0.005));
    }
}

#[test]
fn walls_are_as_stiff_as_devices_are_published_to_be() {
    for (name, limits) in PRESETS {
        let coupling = Coupling::new(&limits, 1e-3, 1.0, 1.0);
        let (stiffness, _) = coupling.limited(&SurfaceFeel { stiffness_n_per_m: 1e6, ..SurfaceFeel::BONE });
        assert!((stiffness / limits.max_stiffness_n_per_m - 1.0).abs() < 1e-9, "{name}: {stiffness}");
        assert!((limits.stable_stiffness_n_per_m(1e-3) / limits.max_stiffness_n_per_m - 1.0).abs() < 1e-9, "{name}");
    }
    // A loop half as fast shows half of that, if the device has no more damping than it needs.
    let slow = Coupling::new(&DeviceLimits::OMEGA, 2e-3, 1.0, 1.0).max_stiffness_n_per_m();
    assert!((slow / 2500.0 - 1.0).abs() < 1e-9, "{slow}");
}

#[test]
fn springs_and_dampers_keep_colgates_condition() {
    for (name, limits) in PRESETS {
        for scale in [0.25, 1.0, 4.0] {
            let coupling = Coupling::new(&limits, 1e-3, scale, 0.5);
            for damping in [0.0, 1.0, 100.0] {
                let feel = SurfaceFeel { stiffness_n_per_m: 1e6, damping_n_s_per_m: damping, ..SurfaceFeel::BONE };
                let (stiffness, damping) = coupling.limited(&feel);
                let at_the_hand = [stiffness, damping].map(|of| of * scale * 0.5);
                assert!(at_the_hand[0] > 0.0 && at_the_hand[0] <= limits.max_stiffness_n_per_m * (1.0 + 1e-12));
                assert!(at_the_hand[1] <= limits.max_damping_n_s_per_m);
                let needed = at_the_hand[0] * 1e-3 / 2.0 + at_the_hand[1];
                assert!(needed < limits.own_damping_n_s_per_m, "{name}: {needed}");
            }
        }
    }
    let none = Coupling::new(&DeviceLimits::OMNI, 1e-3, f64::NAN, 1.0);
    assert_eq!(none.limited(&SurfaceFeel::BONE), (0.0, 0.0));
}

#[test]
fn the_observer_tells_work_and_takes_it_back() {
    let mut observer = PassivityObserver::default();
    // In and out of a spring that is held: stiffness times the square of the step comes out.
    let place = |tick: i32| if tick < 10 { f64::from(tick) } else { f64::from(20 - tick) } * 1e-4;
    let mut exact_j = 0.0;
    for tick in 0..20 {
        let force_n = DVec3::NEG_X * 1000.0 * place(tick);
        let moved_m = DVec3::X * (place(tick + 1) - place(tick));
        exact_j += force_n.dot(moved_m);
        observer.held(force_n);
        observer.observe(moved_m, 0.0, 1e-3);
    }
    assert!(exact_j > 0.0 && (observer.excess_j() - exact_j).abs() < 1e-15);
    let velocity = DVec3::NEG_X * 0.1;
    let damped_n = observer.hold(DVec3::NEG_X, velocity, 3.0, 1e-3);
    assert!((damped_n - DVec3::X * (0.3 - 1.0)).length() < 1e-12, "as strong as it may: {damped_n}");
    // What is lent by what moves by itself does not count.
    let mut lent = PassivityObserver::default();
    lent.held(DVec3::X);
    lent.observe(DVec3::X * 1e-3, 1e-3, 1e-3);
    assert!(lent.excess_j().abs() < 1e-15 && (lent.total_out_j() - 1e-3).abs() < 1e-15);
    assert_eq!(lent.hold(DVec3::X, velocity, 3.0, 1e-3), DVec3::X);
    // Long out of contact the sum begins anew.
    observer.held(DVec3::ZERO);
    (0..60).for_each(|_| observer.observe(DVec3::X, 0.0, 1e-3));
    assert_eq!(observer.excess_j(), 0.0);
}
