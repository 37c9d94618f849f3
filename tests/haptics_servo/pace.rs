//! When ticks are due, on a clock that the tests turn.

use bevy_surgery::haptics::servo::ServoPace;
use proptest::prelude::*;
use std::time::Duration;

const PERIOD: Duration = Duration::from_millis(1);

/// Ticks that begin so many microseconds after they are due: when each began.
fn run(late_us: impl IntoIterator<Item = u64>) -> Vec<Duration> {
    let start = Duration::from_secs(77);
    let mut pace = ServoPace::new(PERIOD, start);
    let mut last = start;
    let mut begin = |late_us| {
        let late = Duration::from_micros(late_us);
        let began = pace.due() + late;
        let beat = pace.begin(began);
        assert!((beat.late_s - late.as_secs_f64()).abs() < 1e-12);
        // What the models get is the time that has passed.
        assert!((beat.since_last_s - (began - last).as_secs_f64()).abs() < 1e-12);
        last = began;
        began - start
    };
    late_us.into_iter().map(&mut begin).collect()
}

fn mean_hz(began: &[Duration]) -> f64 {
    began.len() as f64 / began.last().expect("ticks").as_secs_f64()
}

fn least_gap(began: &[Duration]) -> Duration {
    began.windows(2).map(|pair| pair[1] - pair[0]).min().expect("two ticks")
}

#[test]
fn a_steady_clock_beats_at_its_period() {
    let began = run((0..1000).map(|_| 0));
    assert_eq!(*began.last().expect("ticks"), PERIOD * 1000);
    assert_eq!(least_gap(&began), PERIOD);
}

#[test]
fn what_comes_late_is_made_up_for() {
    // Systems that always wake late, and such that stall for several periods every now and then.
    for late_us in [[300, 300, 300], [900, 0, 450], [9000, 0, 0], [6000, 1500, 1000]] {
        let began = run((0..30_000).map(|tick| if tick % 100 < 3 { late_us[tick % 3] } else { late_us[2] % 1000 }));
        let rate_hz = mean_hz(&began);
        assert!((rate_hz / 1000.0 - 1.0).abs() < 5e-4, "{late_us:?}: {rate_hz} Hz");
        assert!(least_gap(&began) >= PERIOD / 2, "{late_us:?}");
    }
}

#[test]
fn after_a_long_pause_the_count_begins_anew() {
    let began = run((0..2000).map(|tick| if tick == 1000 { 3_000_000 } else { 0 }));
    assert_eq!(began[1000] - began[999], PERIOD + Duration::from_secs(3));
    assert!(began[1000..].windows(2).all(|pair| pair[1] - pair[0] == PERIOD), "nothing is made up for");
}

proptest! {
    #[test]
    fn ticks_are_on_their_count_again_after_any_lateness(late_us in proptest::collection::vec(0..3000_u64, 1..200)) {
        let count = late_us.len() as u32;
        let behind: u64 = late_us.iter().sum();
        let began = run(late_us.into_iter().chain((0..2 * behind / 1000 + 2).map(|_| 0)));
        prop_assert!(least_gap(&began) >= PERIOD / 2);
        let last = *began.last().expect("ticks");
        // Whoever falls behind by more than ten periods loses whole ticks, and never gains one.
        prop_assert!(last >= PERIOD * began.len() as u32);
        prop_assert!(behind > 10_000 || last == PERIOD * began.len() as u32, "{count} ticks, {behind} us behind");
    }
}
