//! Exchanges between threads, and the counting of times.

use bevy_surgery::haptics::exchange::exchange;
use bevy_surgery::haptics::stats::{DurationHistogram, TimingMeter};
use proptest::prelude::*;

#[test]
fn the_newest_is_read_and_the_old_come_back() {
    let (mut publisher, mut subscriber) = exchange::<u32>();
    assert!(!subscriber.take_newest());
    assert_eq!(subscriber.read(|value| *value), Some(0));
    let mut back = vec![publisher.publish(1), publisher.publish(2)];
    assert!(subscriber.take_newest() && !subscriber.take_newest());
    assert_eq!(subscriber.read(|value| *value), Some(2));
    back.extend((3..8).map(|value| publisher.publish(value)));
    assert!(subscriber.take_newest());
    assert_eq!(subscriber.read(|value| *value), Some(7));
    // Nothing is lost and nothing comes twice: three are still in the slots.
    back.retain(|&value| value > 0);
    assert_eq!(back, vec![1, 3, 4, 5], "2 was being read, 6 and 7 are in the slots");
}

#[test]
fn threads_never_see_half_a_value_nor_an_older_one() {
    let (mut publisher, mut subscriber) = exchange::<[u64; 32]>();
    let writer = std::thread::spawn(move || {
        for count in 1..200_000 {
            publisher.publish([count; 32]);
        }
    });
    let mut newest = 0;
    loop {
        let is_over = writer.is_finished();
        subscriber.take_newest();
        let (first, is_whole) = subscriber
            .read(|value| (value[0], value.iter().all(|count| *count == value[0])))
            .expect("the slot is the reader's own");
        assert!(is_whole && first >= newest, "{first} after {newest}");
        newest = first;
        if is_over {
            break;
        }
    }
    assert_eq!(newest, 199_999, "the last one arrives");
    writer.join().expect("the writer");
}

proptest! {
    #[test]
    fn quantiles_are_within_an_eighth(mut times_ns in prop::collection::vec(0_u64..20_000_000_000, 1..300), share in 0.0..1.0_f64) {
        let mut histogram = DurationHistogram::default();
        times_ns.iter().for_each(|&ns| histogram.record_s(ns as f64 * 1e-9));
        times_ns.sort_unstable();
        let rank = ((share * times_ns.len() as f64).ceil() as usize).clamp(1, times_ns.len());
        let exact_s = times_ns[rank - 1] as f64 * 1e-9;
        let told_s = histogram.quantile_s(share);
        prop_assert!(told_s >= exact_s * (1.0 - 1e-9) - 2e-9 || exact_s > 17.0, "{told_s} {exact_s}");
        prop_assert!(told_s <= exact_s * 1.1251 + 2e-9, "{told_s} {exact_s}");
        prop_assert!((histogram.max_s() - *times_ns.last().expect("one") as f64 * 1e-9).abs() < 2e-9);
    }
}

#[test]
fn rates_and_missed_ticks_are_counted() {
    let mut meter = TimingMeter::default();
    assert_eq!(meter.timing().rate_hz, 0.0);
    (0..99).for_each(|_| meter.record(10e-6, 1e-3, 5e-6, 1e-3));
    meter.record(4e-3, 5e-3, 50e-6, 1e-3);
    let timing = meter.timing();
    assert!((timing.rate_hz - 100.0 / 0.104).abs() < 1e-6, "{timing:?}");
    assert_eq!((timing.missed, timing.ticks), (1, 100));
    assert!((timing.late_max_s - 4e-3).abs() < 1e-8 && (timing.compute_max_s - 50e-6).abs() < 1e-8);
    assert!(timing.late_p50_s < 12e-6 && timing.compute_p99_s < 6e-6);
    let mut histogram = DurationHistogram::default();
    [f64::NAN, -1.0, f64::INFINITY].into_iter().for_each(|odd| histogram.record_s(odd));
    assert_eq!(histogram.count(), 3);
}
