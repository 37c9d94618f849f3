//! Scenes and a device whose handle is where a test puts it.

use bevy_surgery::haptics::device::{
    DeviceFault, DeviceInfo, DeviceKind, DeviceLimits, DeviceOutput, DeviceSample, HapticDevice,
};
use bevy_surgery::haptics::force::{BoneBrick, SurfaceFeel, SurfacePatch};
use bevy_surgery::haptics::safety::SafetySettings;
use bevy_surgery::haptics::servo::{ServoBody, ServoEngine, ServoLink, ServoScene, ServoSettings, ServoShape};
use glam::{DAffine3, DVec3, UVec3, Vec3};
use std::sync::{Arc, Mutex};

/// What a test puts in and looks at.
#[derive(Default)]
pub struct Bench {
    pub sample: DeviceSample,
    pub fault: Option<DeviceFault>,
    pub panics: bool,
    pub told: DeviceOutput,
    pub writes: u64,
}

/// A handle on the bench.
pub struct BenchDevice {
    info: DeviceInfo,
    bench: Arc<Mutex<Bench>>,
}

impl BenchDevice {
    pub fn new(limits: DeviceLimits) -> (Self, Arc<Mutex<Bench>>) {
        let bench = Arc::new(Mutex::new(Bench::default()));
        let info = DeviceInfo {
            id: "bench:1".into(),
            name: "bench".into(),
            kind: DeviceKind::Simulated,
            limits,
            has_force: true,
            has_rotation: true,
            has_grip: false,
            buttons: 1,
        };
        (Self { info, bench: bench.clone() }, bench)
    }
}

impl HapticDevice for BenchDevice {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn read(&mut self) -> Result<DeviceSample, DeviceFault> {
        let (sample, fault, panics) = {
            let bench = self.bench.lock().expect("the bench");
            (bench.sample, bench.fault.clone(), bench.panics)
        };
        assert!(!panics, "the driver is broken");
        fault.map_or(Ok(sample), Err)
    }

    fn write(&mut self, output: &DeviceOutput) -> Result<(), DeviceFault> {
        let mut bench = self.bench.lock().expect("the bench");
        (bench.told, bench.writes) = (*output, bench.writes + 1);
        Ok(())
    }
}

/// An engine, its link, and the bench.
pub fn engine(limits: DeviceLimits) -> (ServoEngine, ServoLink, Arc<Mutex<Bench>>) {
    let safety = SafetySettings { ramp_s: 0.05, ..SafetySettings::default() };
    let (device, bench) = BenchDevice::new(limits);
    let (engine, link) = ServoEngine::new(Box::new(device), ServoSettings { safety, ..ServoSettings::default() });
    (engine, link, bench)
}

/// A square of two triangles, 0.2 m wide, at a height; solid below.
pub fn floor(height_m: f32, feel: SurfaceFeel) -> SurfacePatch {
    let corner = |x: f32, z: f32| Vec3::new(0.1 * x, height_m, 0.1 * z);
    let corners = vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    SurfacePatch::new(corners, vec![[0, 1, 2], [0, 2, 3]], feel)
}

/// A ball about the origin from an octahedron, its faces split so many times.
pub fn ball(radius_m: f32, splits: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut places = vec![Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    let mut faces: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    let mut middles = std::collections::BTreeMap::new();
    for _ in 0..splits {
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let mut middle = |p: u32, q: u32| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    places.push((places[p as usize] + places[q as usize]).normalize());
                    places.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        faces = finer;
    }
    (places.into_iter().map(|place| place * radius_m).collect(), faces)
}

/// Bone below a plane through the origin with a normal, in voxels of a size around the origin.
pub fn bone_below(normal: Vec3, side: u32, voxel_m: f32) -> BoneBrick {
    let half = (side as f32 - 1.0) * 0.5;
    let mut solid = Vec::new();
    for z in 0..side {
        for y in 0..side {
            for x in 0..side {
                let place = Vec3::new(x as f32, y as f32, z as f32) - half;
                solid.push((255.0 * (0.5 - place.dot(normal)).clamp(0.0, 1.0)).round() as u8);
            }
        }
    }
    let label = vec![1; solid.len()];
    let scale = f64::from(voxel_m);
    let map =
        DAffine3::from_translation(DVec3::splat(-f64::from(half) * scale)) * DAffine3::from_scale(DVec3::splat(scale));
    BoneBrick::new(UVec3::splat(side), solid, label, [1.0; 256], map).expect("a brick")
}

/// A scene with these bodies, numbered from 7.
pub fn scene(shapes: Vec<ServoShape>) -> ServoScene {
    let bodies = shapes.into_iter().zip(7..).map(|(shape, id)| ServoBody { id, shape }).collect();
    ServoScene { bodies, ..ServoScene::default() }
}

/// Puts the handle somewhere and takes a tick.
pub fn tick_at(engine: &mut ServoEngine, bench: &Mutex<Bench>, place_m: DVec3) {
    bench.lock().expect("the bench").sample.position_m = place_m;
    engine.tick(1e-3);
}

/// Publishes and takes ticks while the handle goes along a straight way.
pub fn go(
    engine: &mut ServoEngine,
    link: &mut ServoLink,
    bench: &Mutex<Bench>,
    to: &ServoScene,
    way: [DVec3; 2],
    ticks: u32,
) {
    for tick in 1..=ticks {
        if tick % 16 == 1 {
            link.publish(to.clone());
        }
        tick_at(engine, bench, way[0].lerp(way[1], f64::from(tick) / f64::from(ticks)));
    }
}
