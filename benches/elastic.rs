//! A step of an elastic body, telling its lattice, and carrying an organ's vertices; on one thread.

use bevy::math::Vec3;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::deform::elastic::{ElasticBody, ElasticTissue, Press, ToolShape};
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

const DOWN: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// A block of liver that hangs from its upper side, and has swung for a while.
fn hanging(level: u32) -> (DeformLattice, ElasticBody) {
    let lattice = DeformLattice::new(Vec3::ZERO, Vec3::new(0.22, 0.15, 0.12), level).expect("a box");
    let body = ElasticBody::uniform(&lattice, ElasticTissue::LIVER).expect("a body");
    let mut body = body.pinned_where(|rest_m| rest_m.y > 0.149);
    (0..30).for_each(|_| drop(body.step(1.0 / 60.0, DOWN, &[], &[])));
    (lattice, body)
}

fn step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("elastic");
    group.sample_size(20);
    for level in 2..=4 {
        let (mut lattice, mut body) = hanging(level);
        let mut swing = 0.0_f32;
        group.bench_function(format!("step, level {level}"), |bench| {
            bench.iter(|| {
                // Gravity that turns keeps it awake.
                swing += 0.1;
                black_box(body.step(1.0 / 60.0, DOWN + Vec3::X * swing.sin(), &[], &[]))
            });
        });
        group.bench_function(format!("tell the lattice, level {level}"), |bench| {
            bench.iter(|| body.publish(&mut lattice));
        });
    }
    let (_, mut body) = hanging(3);
    let mut deep = 0.0_f32;
    group.bench_function("step with a probe, level 3", |bench| {
        bench.iter(|| {
            deep += 0.1;
            let tip_m = Vec3::new(0.11, 0.005 + 0.002 * deep.sin(), 0.06);
            let shape = ToolShape::Capsule { tip_m, back_m: tip_m - 0.2 * Vec3::Y, radius_m: 0.0022 };
            black_box(body.step(1.0 / 60.0, DOWN, &[Press { tool: 0, shape, friction: 0.1 }], &[]))
        });
    });
    group.finish();
}

criterion_group!(benches, step);
criterion_main!(benches);
