//! What a second of each voice costs.

use bevy_surgery::sound::{
    CauteryDials, CauteryVoice, DrillDials, DrillSound, DrillVoice, SuctionDials, SuctionVoice, ToolVoice, Voice,
};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

const RATE_HZ: u32 = 48_000;

fn voice<V: Voice>(c: &mut Criterion, name: &str, mut voice: V, dials: V::Dials) {
    voice.turn(dials);
    let mut group = c.benchmark_group("sound");
    group.throughput(Throughput::Elements(RATE_HZ.into()));
    group.bench_function(name, |b| b.iter(|| voice.by_ref().take(RATE_HZ as usize).sum::<f32>()));
    group.finish();
}

fn voices(c: &mut Criterion) {
    let dials = DrillDials { speed_rpm: 40_000.0, force_n: 2.0, contact: 0.8, hardness: 1.0 };
    voice(c, "drill", DrillVoice::new(DrillSound::default(), RATE_HZ, 1), dials);
    voice(c, "suction", SuctionVoice::new(RATE_HZ, 1), SuctionDials { strength: 1.0, liquid: 0.5 });
    voice(c, "cautery", CauteryVoice::new(RATE_HZ, 1), CauteryDials { heat: 1.0, water: 1.0 });
    voice(c, "idle tool", ToolVoice::new(RATE_HZ, 1), Default::default());
}

criterion_group!(benches, voices);
criterion_main!(benches);
