//! A scripted hand drills the real temporal bone for a minute, with the servo loop in a thread of its own.

use super::*;
use bevy_surgery::haptics::device::recording::{Recording, RecordingDevice, ReplayDevice};
use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedDevice, ScriptedPath, Tremor};
use bevy_surgery::haptics::device::{DeviceFault, DeviceInfo, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice};
use bevy_surgery::haptics::servo::ServoSettings;
use bevy_surgery::tools::{ServoFaulted, ServoReading, ServoSession};
use std::f64::consts::TAU;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const LIMITS: DeviceLimits = DeviceLimits::OMNI;
/// How wide the saucer is and how much deeper the hand presses each second, metres.
const SAUCER_M: f64 = 6e-3;
const DEEPER_M_PER_S: f64 = 0.15e-3;

/// An app with the temporal bone, its outer side up.
fn with_temporal_bone(volume: &Volume) -> (TestApp, Entity) {
    let mut app = TestApp::cpu();
    let volume = app.world_mut().resource_mut::<Assets<Volume>>().add(volume.clone());
    let upright = Quat::from_mat3(&Mat3::from_cols(Vec3::NEG_X, Vec3::NEG_Z, Vec3::NEG_Y));
    let placed = Transform::from_rotation(Quat::from_rotation_y(0.45) * upright);
    let bone = app.world_mut().spawn((CtVolume(volume), placed)).id();
    app.step(2);
    (app, bone)
}

/// Winds over the bone in circles that grow and shrink, and presses ever deeper; lifted now and then.
fn path(app: &mut TestApp, seconds: f64) -> ScriptedPath {
    use bevy::ecs::system::RunSystemOnce;
    let height_m = |app: &mut TestApp, at: Vec2| {
        let ray = Ray3d::new(at.extend(0.1), Dir3::NEG_Z);
        let hit = app.world_mut().run_system_once(move |picking: VolumePicking| picking.cast_ray(ray, 0.2));
        hit.expect("it runs").map(|hit| hit.position_world_m.z)
    };
    let mut keys = Vec::new();
    for tenth in 0..=(seconds * 10.0) as u32 {
        let time_s = f64::from(tenth) * 0.1;
        let out = 0.5 - 0.5 * (TAU * time_s / 20.0).cos();
        let at = DVec2::from_angle(TAU * time_s / 2.5) * (SAUCER_M * out.sqrt());
        let Some(height_m) = height_m(app, at.as_vec2()) else { continue };
        let is_lifted = time_s < 0.6 || (time_s % 15.0) > 14.5;
        let burr_m = 2e-3;
        let depth_m = if is_lifted { -2e-3 } else { 0.6e-3 + DEEPER_M_PER_S * time_s };
        let position_m = at.extend(f64::from(height_m) + burr_m - depth_m);
        keys.push(KeyPose { axes: [1.0, 0.0], ..KeyPose::at(time_s, position_m) });
    }
    ScriptedPath::new(keys, Some(Tremor::default()))
}

/// What a device saw of the loop.
#[derive(Clone, Default)]
struct Seen {
    greatest_n: f64,
    not_numbers: u64,
    /// Time between reading and writing in each tick, seconds.
    ticks_s: Vec<f64>,
}

/// A device that watches what it is told, and how long that takes.
struct Watched {
    device: Box<dyn HapticDevice>,
    began: Instant,
    seen: Arc<Mutex<Seen>>,
}

impl HapticDevice for Watched {
    fn info(&self) -> &DeviceInfo {
        self.device.info()
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.began = Instant::now();
        self.device.read()
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let mut seen = self.seen.lock().expect("nobody panics with it");
        seen.ticks_s.push(self.began.elapsed().as_secs_f64());
        seen.not_numbers += u64::from(!output.force_n.is_finite());
        seen.greatest_n = seen.greatest_n.max(output.force_n.length());
        drop(seen);
        self.device.write(output)
    }
}

/// What was cut, and how much that is, mm3.
fn removed(app: &TestApp, bone: Entity) -> (Vec<u8>, f64) {
    let cut = app.world().get::<CutVolume>(bone).expect("a cut").save([0; 32]);
    (cut, app.world().get::<RemovedTissue>(bone).expect("counted").total_mm3())
}

/// Drills with a recording in stepped mode: what was cut, and how long each tick took, seconds.
fn replay(volume: &Volume, file: &Path, seconds: f64) -> ((Vec<u8>, f64), Vec<f64>) {
    let (mut app, bone) = with_temporal_bone(volume);
    let recording = Recording::load(file).expect("it was just written");
    let seen = Arc::new(Mutex::new(Seen::default()));
    let replay = Box::new(ReplayDevice::new(recording, "replay:test"));
    let device = Box::new(Watched { device: replay, began: Instant::now(), seen: seen.clone() });
    app.world_mut().spawn((drill(), ServoSession::stepped(device, ServoSettings::default())));
    app.step((seconds * 60.0) as u32);
    let cut = removed(&app, bone);
    let ticks_s = std::mem::take(&mut seen.lock().expect("nobody panics with it").ticks_s);
    (cut, ticks_s)
}

/// The real temporal bone, where it is at hand.
fn temporal_bone() -> Option<Volume> {
    let path = crate::support::real_file("ct/temporal-bone-png")?;
    let spacing_mm = [49.2 / 256.0, 49.2 / 256.0, 48.5 / 252.0];
    let mut app = TestApp::cpu();
    let options = VolumeLoadOptions { spacing_mm: Some(spacing_mm), ..default() };
    let bone = app.world_mut().spawn(LoadVolume { path, options }).id();
    app.idle_until("the bone", |app| app.world().get::<CutVolume>(bone).is_some());
    let handle = &app.world().get::<CtVolume>(bone).expect("loaded").0;
    app.world().resource::<Assets<Volume>>().get(handle).cloned()
}

fn drill_in_a_thread(seconds: f64) {
    let Some(volume) = temporal_bone() else { return };
    let (mut app, bone) = with_temporal_bone(&volume);
    let scripted = ScriptedDevice::new(path(&mut app, seconds), 1e-3, LIMITS);
    let seen = Arc::new(Mutex::new(Seen::default()));
    let watched = Watched { device: Box::new(scripted), began: Instant::now(), seen: seen.clone() };
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("hand.rec");
    let recorded = RecordingDevice::new(Box::new(watched), &file).expect("a file");
    let session = ServoSession::start(Box::new(recorded), ServoSettings::default()).expect("a thread");
    let tool = app.world_mut().spawn((drill(), session)).id();
    let started = Instant::now();
    let mut faults = Vec::new();
    for step in 0..(seconds * 60.0) as u32 {
        app.step(1);
        faults.extend(written::<ServoFaulted>(&app));
        let state = app.world().get::<ServoReading>(tool).expect("a session").state;
        assert!(
            state.force_in_device_n.is_finite() && state.proxy_in_world_m.is_finite() && state.excess_j.is_finite()
        );
        assert_eq!((state.bad_forces, state.dropped_samples, state.jumps), (0, 0, 0));
        // In real time: the hand does not wait.
        let due = Duration::from_secs_f64(f64::from(step + 1) / 60.0);
        std::thread::sleep(due.saturating_sub(started.elapsed()));
    }
    assert_eq!(faults, []);
    let (_, removed_mm3) = removed(&app, bone);
    let timing = app.world().get::<ServoReading>(tool).expect("a session").state.timing;
    app.world_mut().entity_mut(tool).despawn();
    let seen = seen.lock().expect("nobody panics with it").clone();
    println!("{removed_mm3:.2} mm3; {} ticks, greatest force {:.2} N; {timing:?}", seen.ticks_s.len(), seen.greatest_n);
    assert!(seen.ticks_s.len() > 1000 && seen.not_numbers == 0);
    assert!(seen.greatest_n > 0.5 && seen.greatest_n <= LIMITS.max_force_n + 1e-9, "{} N", seen.greatest_n);
    assert!(removed_mm3 > 0.1 * seconds, "{removed_mm3} mm3");
    let ((first, first_s), (second, second_s)) = (replay(&volume, &file, seconds), replay(&volume, &file, seconds));
    println!("replayed: {:.2} mm3", first.1);
    assert!(first.1 > 0.1 * seconds, "{} mm3", first.1);
    assert!(first == second, "the same hand, the same cut: {} and {} mm3", first.1, second.1);
    // A tick that is late because of us takes long each time; one from which the system took the processor does not.
    assert_eq!(first_s.len(), second_s.len());
    let longest_s = first_s.iter().zip(&second_s).map(|(a, b)| a.min(*b)).fold(0.0, f64::max);
    println!("longest tick {:.0} us", longest_s * 1e6);
    assert!(longest_s < 5e-3, "a tick takes {} ms", longest_s * 1e3);
}

#[test]
fn a_minute_of_drilling_is_safe_and_replays_to_the_bit() {
    drill_in_a_thread(60.0);
}
