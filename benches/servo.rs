//! What a tick of the servo loop costs, and how well its thread keeps time.

use bevy_surgery::haptics::device::{
    DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy_surgery::haptics::force::{
    BoneBrick, BonePatch, Coupling, Obstacle, Proxy, SurfaceFeel, SurfacePatch, ToolCapsule, TurningBurr, overlap,
};
use bevy_surgery::haptics::servo::{ServoBody, ServoEngine, ServoScene, ServoSettings, ServoShape, ServoThread};
use bevy_surgery::haptics::stats::DurationHistogram;
use bevy_surgery::volume::cut::Burr;
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use std::hint::black_box;
use std::sync::Arc;
use std::time::{Duration, Instant};

const TIP: [ToolCapsule; 1] = [ToolCapsule { ends_m: [DVec3::ZERO; 2], radius_m: 1.5e-3 }];
/// With a shaft that lies aslant, so that a box around it would hold most of an organ.
const PROBE: [ToolCapsule; 2] =
    [TIP[0], ToolCapsule { ends_m: [DVec3::ZERO, DVec3::new(0.08, 0.06, 0.03)], radius_m: 2e-3 }];
const RADIUS_M: f32 = 0.07;
/// Half a millimetre.
const SWING: f32 = 0.007;

/// Rings and spokes of some 15,000 vertices.
const FINE: [u32; 2] = [87, 172];
/// Of some 2,200.
const COARSE: [u32; 2] = [34, 66];

/// A bumpy ball, as large as a liver, that swings by a share of its radius.
fn organ([rings, spokes]: [u32; 2], swing: f32) -> SurfacePatch {
    let place = |ring: u32, spoke: u32, swing: f32| {
        let (polar, turn) = (
            std::f32::consts::PI * (ring as f32 + 0.5) / rings as f32,
            std::f32::consts::TAU * spoke as f32 / spokes as f32,
        );
        let bump = 1.0 + 0.02 * (9.0 * polar).sin() * (7.0 * turn).sin() + swing;
        Vec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin()) * RADIUS_M * bump
    };
    let all = |swing: f32| -> Vec<Vec3> {
        (0..rings * spokes).map(|index| place(index / spokes, index % spokes, swing)).collect()
    };
    let mut triangles = Vec::new();
    for (ring, spoke) in (0..rings - 1).flat_map(|ring| (0..spokes).map(move |spoke| (ring, spoke))) {
        let next = (spoke + 1) % spokes;
        let at = |ring: u32, spoke: u32| ring * spokes + spoke;
        triangles.push([at(ring, spoke), at(ring, next), at(ring + 1, spoke)]);
        triangles.push([at(ring, next), at(ring + 1, next), at(ring + 1, spoke)]);
    }
    SurfacePatch::moving(all(0.0), all(swing), triangles, SurfaceFeel::LIVER)
}

/// Bone with cells.
fn bone(side: u32, voxel_m: f64) -> BoneBrick {
    let solid = (0..side.pow(3))
        .map(|i| {
            let [x, y, z] = [i % side, i / side % side, i / side / side].map(|at| at as f32);
            let cells = (x * 0.4).sin() * (y * 0.37).sin() * (z * 0.43).sin();
            if y < side as f32 * 0.5 && cells > -0.5 { 255 } else { 0 }
        })
        .collect();
    let map = DAffine3::from_scale(DVec3::splat(voxel_m));
    BoneBrick::new(UVec3::splat(side), solid, vec![1; side.pow(3) as usize], [1.0; 256], map).expect("a brick")
}

/// A path of a hand that presses and rubs.
fn rub(tick: u32) -> DVec3 {
    let turn = f64::from(tick) * 2e-3;
    let aside = DVec3::new(turn.cos(), 3.0, turn.sin() * 0.7).normalize();
    // It comes from outside.
    let above_m = 20e-3 * (1.0 - f64::from(tick) / 500.0).max(0.0);
    aside * (f64::from(RADIUS_M) - 2e-3 + above_m + 1e-3 * (turn * 3.1).sin())
}

/// Median, 99th percentile and greatest of many single steps.
fn spread(what: &str, mut step: impl FnMut(u32)) {
    let mut times = DurationHistogram::default();
    for tick in 0..20_000 {
        let began = Instant::now();
        step(tick);
        times.record_s(began.elapsed().as_secs_f64());
    }
    let us = |seconds: f64| seconds * 1e6;
    println!(
        "{what}: median {:.2} us, p99 {:.2} us, max {:.1} us of {} steps",
        us(times.quantile_s(0.5)),
        us(times.quantile_s(0.99)),
        us(times.max_s()),
        times.count()
    );
}

fn forces(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("servo");
    group.sample_size(20);
    let coupling = Coupling::new(&DeviceLimits::OMEGA, 1e-3, 1.0, 1.0);
    let mut tick = 0;
    // Triangles as many as in the meshes that others are measured with: 30,726 and 4,384.
    for (name, size, swing, tool) in [
        ("proxy on 29,584 moving triangles", FINE, SWING, &TIP[..]),
        ("proxy on 29,584 triangles", FINE, 0.0, &TIP[..]),
        ("proxy on 4,356 moving triangles", COARSE, SWING, &TIP[..]),
        ("proxy on 4,356 triangles", COARSE, 0.0, &TIP[..]),
        ("tip and shaft on 29,584 moving triangles", FINE, SWING, &PROBE[..]),
        ("tip and shaft on 4,356 moving triangles", COARSE, SWING, &PROBE[..]),
    ] {
        let patch = organ(size, swing);
        let obstacles = [Obstacle::Surface(&patch)];
        let mut proxy = Proxy::default();
        proxy.step(DVec3::Y * 0.2, DVec3::ZERO, tool, &obstacles, [0.0; 2], &coupling);
        let mut rubbing = |tick: u32| {
            let shares = [tick % 16, tick % 16 + 1].map(|at| f64::from(at) / 16.0);
            black_box(proxy.step(rub(tick), DVec3::ZERO, tool, &obstacles, shares, &coupling));
        };
        spread(name, &mut rubbing);
        group.bench_function(name, |bench| {
            bench.iter(|| {
                tick += 1;
                rubbing(tick);
            });
        });
    }
    for across in [8.0, 12.0, 16.0] {
        let name = format!("{across} voxels across");
        let burr = Burr { diameter_m: 6e-3, ..Burr::default() };
        let voxel_m = f64::from(burr.diameter_m) / across;
        let brick = bone(256, voxel_m);
        let middle_m = |tick: u32| {
            let dips = 129.0 - 2.0 * (f64::from(tick) * 0.01).sin();
            DVec3::new(128.0, dips, 128.0 + 0.002 * f64::from(tick % 9999)) * voxel_m
        };
        let mut cover = |tick: u32| {
            black_box(overlap(&brick, &burr, middle_m(tick), DVec3::X));
        };
        spread(&format!("burr {name} in 256^3"), &mut cover);
        group.bench_function(format!("burr {name} in 256^3"), |bench| {
            bench.iter(|| {
                tick += 1;
                cover(tick);
            });
        });
    }
    for side in [32, 40, 48] {
        let patch = bone(side, 0.5e-3);
        group.bench_function(format!("surface of {side}^3 voxels, by the simulation"), |bench| {
            bench.iter(|| black_box(BonePatch::new(patch.clone(), SurfaceFeel::BONE)));
        });
    }
    for (name, size) in [("29,584", FINE), ("1,920", [25, 40])] {
        group.bench_function(format!("patch of {name} moving triangles, by the simulation"), |bench| {
            bench.iter(|| black_box(organ(size, SWING)));
        });
    }
    group.finish();
}

/// A hand that rubs, against the clock of its own ticks.
struct Rubbing {
    info: DeviceInfo,
    tick: u32,
}

impl HapticDevice for Rubbing {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        self.tick += 1;
        Ok(DeviceSample { position_m: rub(self.tick), ..DeviceSample::default() })
    }

    fn write(&mut self, _: &DeviceOutput) -> Result<(), DeviceFault> {
        Ok(())
    }
}

fn loop_of(burr: bool) -> (ServoEngine, bevy_surgery::haptics::servo::ServoLink, ServoScene) {
    let info = DeviceInfo {
        id: "bench:1".into(),
        name: "bench".into(),
        kind: DeviceKind::Scripted,
        limits: DeviceLimits::OMEGA,
        has_force: true,
        has_rotation: false,
        has_grip: false,
        buttons: 0,
    };
    let (engine, link) = ServoEngine::new(Box::new(Rubbing { info, tick: 0 }), ServoSettings::default());
    let mut scene = ServoScene::default();
    let mut add = |shape| scene.bodies.push(ServoBody { id: 1, shape });
    add(ServoShape::Surface(Arc::new(organ(FINE, SWING))));
    if burr {
        let plain = bone(256, 0.5e-3);
        let lowered = DAffine3::from_translation(DVec3::new(-0.064, -0.0005, -0.064)) * plain.world_from_voxel();
        let count = 256_usize.pow(3);
        let solid = (0..count as u32).map(|i| plain.solid(UVec3::new(i & 255, i >> 8 & 255, i >> 16))).collect();
        let brick = BoneBrick::new(UVec3::splat(256), solid, vec![1; count], [1.0; 256], lowered).expect("a brick");
        add(ServoShape::Bone(Arc::new(BonePatch::voxels_only(brick, SurfaceFeel::BONE))));
        let burr = TurningBurr {
            speed_rpm: 4e4,
            flutes: 8,
            friction: 0.2,
            vibration: 0.1,
            stiffness_n_per_m: 900.0,
            ..Default::default()
        };
        scene.tool.burr = Some(burr);
        scene.tool.tip_in_handle_m = DVec3::ZERO;
    }
    (engine, link, scene)
}

fn ticks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tick");
    group.sample_size(20);
    for (name, burr) in [("mesh", false), ("mesh and burr in 256^3", true)] {
        let (mut engine, mut link, scene) = loop_of(burr);
        let mut step = |tick: u32| {
            if tick.is_multiple_of(16) {
                link.publish(scene.clone());
            }
            engine.tick(1e-3);
        };
        spread(&format!("whole tick, {name}"), &mut step);
        let mut tick = 0;
        group.bench_function(name, |bench| {
            bench.iter(|| {
                tick += 1;
                step(tick);
            });
        });
    }
    group.finish();
    let (engine, mut link, scene) = loop_of(true);
    let thread = ServoThread::start(engine).expect("a thread");
    let until = Instant::now() + Duration::from_secs(5);
    while Instant::now() < until {
        link.publish(scene.clone());
        std::thread::sleep(Duration::from_millis(16));
    }
    let Some(engine) = thread.stop() else { return };
    println!("thread, 5 s: {:#?}", engine.state().timing);
}

criterion_group!(benches, forces, ticks);
criterion_main!(benches);
