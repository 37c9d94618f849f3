//! Recordings: bit for bit what happened, whatever happens to the file.

use bevy_surgery::haptics::device::recording::{
    RecordedEvent, Recording, RecordingDevice, RecordingError, ReplayBackend, ReplayDevice,
};
use bevy_surgery::haptics::device::scripted::{KeyPose, ScriptedDevice, ScriptedPath, Tremor};
use bevy_surgery::haptics::device::{
    DeviceBackend, DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceManager, DeviceOutput, DeviceSample,
    HapticDevice, NoDevice,
};
use bevy_surgery::haptics::force::{SurfaceFeel, SurfacePatch};
use bevy_surgery::haptics::servo::{ServoBody, ServoEngine, ServoFault, ServoScene, ServoSettings, ServoShape};
use glam::{DQuat, DVec3, Vec3};
use proptest::prelude::*;
use std::sync::Arc;
use std::time::Duration;

fn info() -> DeviceInfo {
    NoDevice::default().info().clone()
}

fn trembling() -> Box<ScriptedDevice> {
    let keys = vec![KeyPose::at(0.0, DVec3::ZERO), KeyPose::at(3.0, DVec3::new(0.03, -0.02, 0.05))];
    Box::new(ScriptedDevice::new(ScriptedPath::new(keys, Some(Tremor::default())), 1e-3, DeviceLimits::TOUCH))
}

/// A loop that pulls its device to the middle.
fn run(device: &mut dyn HapticDevice, ticks: usize) -> Vec<(DeviceSample, DeviceOutput)> {
    let tick = |_| {
        let sample = device.read().expect("a state");
        let output = DeviceOutput { force_n: -100.0 * sample.position_m, ..DeviceOutput::default() };
        device.write(&output).expect("written");
        (sample, output)
    };
    (0..ticks).map(tick).collect()
}

#[test]
fn a_recorded_device_is_played_back_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hand.bsurdev");
    let mut recorder = RecordingDevice::new(trembling(), &path).expect("it records");
    let handle = recorder.handle();
    let lived = run(&mut recorder, 3000);
    drop(recorder);
    let progress = handle.progress();
    assert!(progress.is_finished && progress.error.is_none() && progress.events == 6000, "{progress:?}");
    let length = std::fs::metadata(&path).expect("the file").len();
    assert_eq!(progress.bytes, length);
    assert!(length < 3000 * 120, "{length} bytes for 3000 ticks");
    let mut replay = ReplayBackend.open(&format!("replay:{}", path.display())).expect("it plays");
    assert_eq!((replay.info().kind, replay.info().limits), (DeviceKind::Replay, DeviceLimits::TOUCH));
    assert_eq!(run(&mut *replay, 3000), lived);
    for _ in 0..3 {
        let fault = replay.read().expect_err("it ends");
        assert!(matches!(fault, DeviceFault::Ended { .. }) && !fault.is_over(), "{fault}");
    }
}

#[test]
fn a_replay_that_has_ended_stays_where_it_is_without_force_and_says_so_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("hand.bsurdev");
    // A hand that goes into a wall and stays there.
    let keys = vec![KeyPose::at(0.0, DVec3::Y * 0.004), KeyPose::at(0.6, DVec3::Y * -0.004)];
    let hand = ScriptedDevice::new(ScriptedPath::new(keys, None), 1e-3, DeviceLimits::OMEGA);
    run(&mut RecordingDevice::new(Box::new(hand), &path).expect("it records"), 1500);
    let backends: Vec<Box<dyn DeviceBackend>> = vec![Box::new(ReplayBackend)];
    let manager = DeviceManager::new(backends, Duration::from_millis(1)).expect("a thread");
    let id = format!("replay:{}", path.display());
    let device = manager.open(&id).expect("it plays");
    let (mut engine, mut link) = ServoEngine::new(Box::new(device), ServoSettings::default());
    let wall = [Vec3::new(-1.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, -1.0)];
    let wall = Arc::new(SurfacePatch::new(wall.to_vec(), vec![[0, 1, 2]], SurfaceFeel::LIVER));
    let wall = ServoBody { id: 1, shape: ServoShape::Surface(wall) };
    let scene = ServoScene { bodies: vec![wall], ..ServoScene::default() };
    let mut tick = |ticks: u64, engine: &mut ServoEngine| {
        for tick in 0..ticks {
            if tick.is_multiple_of(16) {
                link.publish(scene.clone());
            }
            engine.tick(1e-3);
        }
        link.faults().collect::<Vec<_>>()
    };
    assert_eq!(tick(1500, &mut engine), []);
    let before = *engine.state();
    assert!(before.force_in_device_n.y > 0.5, "it presses: {before:?}");
    let faults = tick(200, &mut engine);
    assert_eq!(faults, [ServoFault::Device(DeviceFault::Ended { id: id.clone() })]);
    assert_eq!(faults[0].to_string(), format!("{id} is at its end"));
    // Time for a manager to look for it again.
    std::thread::sleep(Duration::from_millis(30));
    assert_eq!(tick(500, &mut engine), [], "said once");
    let after = engine.state();
    assert_eq!((after.force_in_device_n, after.is_over), (DVec3::ZERO, false));
    assert_eq!(after.sample, before.sample, "it stays");
    assert_eq!(manager.news(), [], "and nobody looks for it");
}

#[test]
fn a_replay_counts_what_the_loop_does_otherwise() {
    let force = |x| RecordedEvent::Write(DeviceOutput { force_n: DVec3::X * x, ..DeviceOutput::default() });
    let sample = |x| RecordedEvent::Read(DeviceSample { position_m: DVec3::X * x, ..DeviceSample::default() });
    let away = DeviceFault::Gone { id: "a".into(), reason: "b".into() };
    let events = vec![sample(1.0), force(-100.0), RecordedEvent::ReadFault(away.clone()), sample(2.0), force(7.0)];
    let mut replay = ReplayDevice::new(Recording { info: info(), events, ended_early: false }, "replay:x");
    let handle = replay.handle();
    let write = |replay: &mut ReplayDevice, x: f64| {
        replay.write(&DeviceOutput { force_n: DVec3::X * x, ..DeviceOutput::default() }).expect("taken");
    };
    assert_eq!(replay.read().expect("a state").position_m, DVec3::X);
    write(&mut replay, -100.0);
    assert_eq!(replay.read(), Err(away));
    assert_eq!(replay.read().expect("a state").position_m.x, 2.0);
    assert_eq!(handle.progress().other_forces, 0);
    write(&mut replay, 8.0);
    let progress = handle.progress();
    assert_eq!((progress.other_forces, progress.events, progress.of), (1, 5, 5));
}

#[test]
fn what_was_written_before_the_end_of_the_program_is_kept() {
    let whole = Recording { info: info(), events: many(2500), ended_early: false };
    let bytes = whole.bytes();
    assert_eq!(Recording::read(&bytes, "a").expect("whole"), whole);
    let mut complete = std::collections::BTreeSet::new();
    let ends = (0..600).chain((600..bytes.len()).step_by(701)).chain(bytes.len() - 9..bytes.len());
    for length in ends {
        match Recording::read(&bytes[..length], "a") {
            Ok(part) => {
                assert_eq!(part.events[..], whole.events[..part.events.len()]);
                complete.insert(part.events.len());
                assert!(part.ended_early || [0, 1024, 2048].contains(&part.events.len()));
            }
            Err(RecordingError::NotARecording { .. }) => assert!(length < 8),
            Err(RecordingError::Damaged { place: 8, .. }) => {}
            Err(error) => panic!("{length} bytes: {error}"),
        }
    }
    assert_eq!(complete.into_iter().collect::<Vec<_>>(), [0, 1024, 2048]);
}

fn many(count: usize) -> Vec<RecordedEvent> {
    let path = ScriptedPath::new(Vec::new(), Some(Tremor::default()));
    (0..count).map(|i| RecordedEvent::Read(path.sample(i as f64 * 1e-3))).collect()
}

#[test]
fn damage_is_told_with_file_place_and_reason() {
    let bytes = Recording { info: info(), events: many(10), ended_early: false }.bytes();
    let error = |bytes: &[u8]| Recording::read(bytes, "hand.bsurdev").expect_err("damaged").to_string();
    assert_eq!(error(b"PNG"), "hand.bsurdev: this is no recording of a device");
    let mut other = bytes.clone();
    other[7] = 9;
    assert_eq!(error(&other), "hand.bsurdev: a recording of version 9; this program reads version 1");
    for at in [20, 30, bytes.len() - 1] {
        let mut other = bytes.clone();
        other[at] ^= 1;
        let text = error(&other);
        assert!(text.starts_with("hand.bsurdev: byte ") && text.contains("checksum"), "{text}");
    }
    let missing = Recording::load("/nowhere/hand.bsurdev").expect_err("there is none").to_string();
    assert!(missing.starts_with("/nowhere/hand.bsurdev: "), "{missing}");
}

/// A chunk as the file has it.
fn chunk(data: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::from((data.len() as u32).to_le_bytes());
    bytes.extend(&blake3::hash(data).as_bytes()[..8]);
    bytes.extend(data);
    bytes
}

#[test]
fn what_a_header_claims_takes_no_memory() {
    use std::io::Write;
    let deflate = |plain: &[u8]| {
        let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::best());
        deflated.write_all(plain).expect("memory");
        deflated.finish().expect("memory")
    };
    let head = Recording { info: info(), events: Vec::new(), ended_early: false }.bytes();
    let with = |data: &[u8]| [head.clone(), chunk(data)].concat();
    let bomb = Recording::read(&with(&deflate(&vec![0; 64 << 20])), "a").expect_err("too much").to_string();
    assert!(bomb.contains("inflates to more"), "{bomb}");
    // Four thousand million events, and none of them there.
    let claim =
        Recording::read(&with(&deflate(&[0xff, 0xff, 0xff, 0xff, 0x0f])), "a").expect_err("a claim").to_string();
    assert!(claim.contains("events in a chunk"), "{claim}");
    let few = Recording::read(&with(&deflate(&[200, 1])), "a").expect_err("a claim").to_string();
    assert!(few.contains("damaged"), "{few}");
    let long = [head.clone(), u32::MAX.to_le_bytes().to_vec(), vec![0; 100]].concat();
    assert!(Recording::read(&long, "a").expect("what is there").ended_early);
}

fn any_event() -> impl Strategy<Value = RecordedEvent> {
    let number = || any::<u64>().prop_map(f64::from_bits);
    let vector = move || (number(), number(), number()).prop_map(|(x, y, z)| DVec3::new(x, y, z));
    let sample = (number(), vector(), (number(), vector()), proptest::option::of(vector()), any::<u32>());
    let rest = (proptest::option::of(number()), any::<[u32; 2]>());
    let read = (sample, rest).prop_map(|((time_s, position_m, (w, v), velocity, buttons), (grip_rad, axes))| {
        RecordedEvent::Read(DeviceSample {
            time_s,
            position_m,
            device_from_handle: DQuat::from_xyzw(v.x, v.y, v.z, w),
            velocity_m_per_s: velocity,
            buttons,
            grip_rad,
            axes: axes.map(f32::from_bits),
        })
    });
    let output = (vector(), vector(), any::<u32>()).prop_map(|(force_n, torque_n_m, rumble)| DeviceOutput {
        force_n,
        torque_n_m,
        rumble: f32::from_bits(rumble),
    });
    let fault = (".{0,20}", ".{0,20}").prop_map(|(id, reason)| DeviceFault::Warning { id, reason });
    prop_oneof![
        read,
        output.clone().prop_map(RecordedEvent::Write),
        fault.clone().prop_map(RecordedEvent::ReadFault),
        (output, fault).prop_map(|(output, fault)| RecordedEvent::WriteFault(output, fault)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Numbers that are none have bits too: what is written again must be the same file.
    #[test]
    fn any_events_come_back_to_the_bit(events in proptest::collection::vec(any_event(), 0..50)) {
        let bytes = Recording { info: info(), events, ended_early: false }.bytes();
        let read = Recording::read(&bytes, "a").expect("whole");
        prop_assert_eq!(read.bytes(), bytes);
    }

    #[test]
    fn any_bytes_are_read_or_refused(mut bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = Recording::read(&bytes, "a");
        bytes.splice(0..0, *b"BSURDEV\x01");
        let _ = Recording::read(&bytes, "a");
    }
}
