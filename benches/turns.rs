//! Times several things that take turns, so that a machine that slows down slows all of them.

use criterion::{BenchmarkGroup, measurement::WallTime};
use std::time::{Duration, Instant};

/// Runs each of them once and adds to its time.
fn turn<T>(items: &mut [T], run: &mut impl FnMut(&mut T), mut add: impl FnMut(usize, Duration)) {
    for (place, item) in items.iter_mut().enumerate() {
        let started = Instant::now();
        run(item);
        add(place, started.elapsed());
    }
}

/// Median of each in milliseconds.
pub fn medians_ms<T>(rounds: usize, items: &mut [T], mut run: impl FnMut(&mut T)) -> Vec<f64> {
    let mut times = vec![Vec::with_capacity(rounds); items.len()];
    for _ in 0..rounds {
        turn(items, &mut run, |place, time| times[place].push(time));
    }
    let median = |times: &mut Vec<Duration>| {
        times.sort();
        times[times.len() / 2].as_secs_f64() * 1e3
    };
    times.iter_mut().map(median).collect()
}

#[allow(dead_code, reason = "not every bench takes part in it")]
/// One bench for each of them, in which all run and its own time counts.
pub fn bench_each<T>(
    group: &mut BenchmarkGroup<WallTime>,
    names: &[&str],
    items: &mut [T],
    mut run: impl FnMut(&mut T),
) {
    for (place, name) in names.iter().enumerate() {
        group.bench_function(*name, |b| {
            b.iter_custom(|rounds| {
                let mut spent = Duration::ZERO;
                for _ in 0..rounds {
                    turn(items, &mut run, |other, time| {
                        if other == place {
                            spent += time
                        }
                    });
                }
                spent
            });
        });
    }
}
