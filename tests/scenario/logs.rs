//! Logs: what is written is read, also what is left of one that was cut off.

use super::short_run;
use bevy_surgery::prelude::*;
use bevy_surgery::scenario::log::{LogEntry, LogError, LogHeader, LogRecord, LogWriter, RunLog, ToolSample};
use proptest::prelude::*;
use std::path::Path;
use std::time::{Duration, Instant};

fn sample(step: u64, number: f32) -> LogEntry {
    let record = LogRecord::Sample(ToolSample {
        tool: 0,
        pose: ToolPose::at(bevy::math::Vec3::new(number, -number, 0.1), bevy::math::Quat::IDENTITY),
        is_dropped: false,
        command: ToolCommand { pedal: number.fract().abs(), ..Default::default() },
        forces_n: Some(vec![(0, bevy::math::Vec3::splat(number))]),
        drilling_n: Some(number),
        contact_n: number,
        critical_m: None,
    });
    LogEntry { step, record }
}

fn header() -> LogHeader {
    short_run().header
}

fn write(file: &Path, header: &LogHeader, entries: &[LogEntry]) {
    let mut writer = LogWriter::create(file, header).expect("it can be written");
    for entry in entries {
        writer.write(vec![entry.clone()]).expect("it is written");
    }
    writer.finish().expect("it is ended");
}

#[test]
fn a_run_is_read_as_it_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let run = short_run();
    write(&file, &run.header, &run.entries);
    let read = RunLog::read(&file).expect("it is a log");
    assert_eq!(read, run);
    // It is MCAP, as anyone's tools read it.
    let bytes = std::fs::read(&file).expect("it is there");
    let summary = mcap::Summary::read(&bytes).expect("it is whole").expect("it has a summary");
    let topics: Vec<&str> = summary.channels.values().map(|channel| channel.topic.as_str()).collect();
    assert!(topics.contains(&"/sample") && topics.contains(&"/hash"), "{topics:?}");
    let raw: usize = run.entries.iter().map(|entry| serde_json::to_vec(entry).expect("text").len()).sum();
    assert!(bytes.len() * 3 < raw, "{} bytes of {raw}", bytes.len());
}

#[test]
fn runs_are_not_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    write(&file, &header(), &[sample(0, 1.0)]);
    let fault = LogWriter::create(&file, &header()).expect_err("it is there already");
    assert!(matches!(fault, LogError::Exists { .. }), "{fault}");
    assert_eq!(RunLog::read(&file).expect("it is still there").entries.len(), 1);
    let nowhere = LogWriter::create(&folder.path().join("no/run.mcap"), &header()).expect_err("no such folder");
    assert!(nowhere.to_string().contains("no/run.mcap"), "{nowhere}");
}

#[test]
fn what_is_no_log_is_said_to_be_none() {
    for bytes in [&b""[..], b"hello", b"\x89MCAP0\r\n"] {
        let fault = RunLog::from_bytes(bytes, "x.mcap").expect_err("it is none");
        assert!(matches!(&fault, LogError::NotALog { file, .. } if file == "x.mcap"), "{fault}");
    }
    assert!(matches!(RunLog::read(Path::new("/nowhere.mcap")), Err(LogError::Io { .. })));
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("new.mcap");
    write(&file, &LogHeader { version: 99, ..header() }, &[]);
    assert!(matches!(RunLog::read(&file), Err(LogError::Newer { version: 99, .. })));
}

/// The other end of `a_program_that_is_killed_leaves_its_run`: writes until it is ended.
#[test]
fn child_that_writes() {
    let Some(file) = std::env::var_os("BEVY_SURGERY_TEST_LOG") else { return };
    let mut writer = LogWriter::create(Path::new(&file), &header()).expect("it can be written");
    for step in 0.. {
        writer.write(vec![sample(step, step as f32)]).expect("it is written");
        std::thread::sleep(Duration::from_millis(2));
    }
}

#[test]
fn a_program_that_is_killed_leaves_its_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("killed.mcap");
    let mut child = std::process::Command::new(std::env::current_exe().expect("this program"))
        .args(["scenario::logs::child_that_writes", "--exact"])
        .env("BEVY_SURGERY_TEST_LOG", &file)
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("it can be started again");
    // Until two seconds of it are on the disk, however slow the machine is.
    let begun = Instant::now();
    let mut steps = 0;
    while steps < 200 && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(100));
        steps = RunLog::read(&file).map_or(0, |run| run.entries.len());
    }
    child.kill().expect("it can be killed");
    child.wait().expect("it is gone");
    let run = RunLog::read(&file).expect("what was written can be read");
    assert!(!run.is_complete && run.entries.len() >= 200, "{}", run.entries.len());
    for (step, entry) in run.entries.iter().enumerate() {
        assert_eq!(*entry, sample(step as u64, step as f32));
    }
}

fn bytes() -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("run.mcap");
    let entries: Vec<LogEntry> = (0..40).map(|step| sample(step, step as f32 * 0.37)).collect();
    write(&file, &header(), &entries);
    std::fs::read(&file).expect("it is there")
}

proptest! {
    #[test]
    fn numbers_come_back_to_the_bit(bits in any::<u32>()) {
        let number = f32::from_bits(bits);
        prop_assume!(number.is_finite());
        let entry = sample(3, number);
        let text = serde_json::to_string(&entry).expect("text");
        let again: LogEntry = serde_json::from_str(&text).expect("the same");
        let of = |entry: &LogEntry| match &entry.record {
            LogRecord::Sample(sample) => sample.pose.place.tip_in_world_m.to_array().map(f32::to_bits),
            _ => [0; 3],
        };
        prop_assert_eq!(of(&again), of(&entry));
    }

    #[test]
    fn spoilt_logs_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8), cut in any::<prop::sample::Index>()) {
        thread_local!(static GOOD: Vec<u8> = bytes());
        let mut spoilt = GOOD.with(Clone::clone);
        for (at, byte) in &changes {
            let at = at.index(spoilt.len());
            spoilt[at] = *byte;
        }
        let _ = RunLog::from_bytes(&spoilt, "spoilt");
        let end = cut.index(spoilt.len());
        if let Ok(run) = RunLog::from_bytes(&spoilt[..end], "cut off") {
            prop_assert!(!run.is_complete && run.entries.len() <= 40);
        }
    }
}
