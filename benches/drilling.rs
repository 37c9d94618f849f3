//! Drilling: a burr of 8 voxels' radius in 256^3, beside what other programs need for their steps.
//!
//! "leaps" places the burr at a thousand random points, each lap in bone made whole again outside the measured time, as
//! `e_drill.py` of our collection of peers does with numba (0.04 to 0.08 ms) and CHAI3D with a hard edge (0.02 ms). "a groove"
//! moves it steadily through fresh bone, once with force to spare and once so gently that the body has to be shrunk each step.

use bevy_surgery::volume::cut::{Burr, BurrPose, BurrShape, BurrStroke, CutVolume};
use bevy_surgery::volume::structures::{Structure, Structures, Tissue};
use bevy_surgery::volume::{Volume, VolumeGrid, Voxels};
use criterion::{Criterion, criterion_group, criterion_main};
use glam::{DVec3, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::hint::black_box;
use std::time::{Duration, Instant};

const SIDE: u32 = 256;
const SPACING_MM: f64 = 0.2;
const RADIUS_VOXELS: f32 = 8.0;
const STEP_S: f64 = 1.0 / 60.0;

/// Bone everywhere, in layers of two structures.
fn bone() -> (Volume, Structures) {
    let grid = VolumeGrid::upright(UVec3::splat(SIDE), DVec3::splat(SPACING_MM));
    let structure = |name: &str, tissue, hardness| Structure {
        name: name.into(),
        colour: [230, 220, 200],
        tissue,
        hardness,
        bleeding_ml_per_s_mm3: 0.0,
        is_critical: false,
    };
    let list = vec![structure("cortex", Tissue::CorticalBone, 1.0), structure("marrow", Tissue::CancellousBone, 0.4)];
    let labels = (0..grid.count()).map(|index| 1 + (index / 50 % 2) as u8).collect();
    let structures = Structures::new(list, labels, vec![255; grid.count()]).expect("two structures");
    (Volume::new(grid, Voxels::U8(vec![255; grid.count()]), 1.0, 0.0).expect("a volume"), structures)
}

fn drilling(c: &mut Criterion) {
    let (volume, structures) = bone();
    let volume_from_voxel = volume.grid().volume_from_voxel();
    let burr = |shape| Burr { diameter_m: 2.0 * RADIUS_VOXELS * SPACING_MM as f32 * 1e-3, shape, ..Burr::default() };
    let pose = |voxel: Vec3| BurrPose {
        centre_m: volume_from_voxel.transform_point3(voxel),
        axis: Vec3::new(0.3, 1.0, 0.2).normalize(),
    };
    let mut group = c.benchmark_group("drill step, 256^3, radius 8 voxels");

    let mut rng = Pcg32::seed_from_u64(0);
    let places: Vec<Vec3> =
        (0..1000).map(|_| Vec3::from_array([0; 3].map(|_| rng.random_range(20.0..235.0)))).collect();
    let mut cut = CutVolume::new(volume.grid().size);
    group.bench_function("leaps", |b| {
        b.iter_custom(|steps| {
            let mut spent = Duration::ZERO;
            for step in 0..steps as usize {
                if step % places.len() == 0 {
                    cut = CutVolume::new(volume.grid().size);
                }
                let at = pose(places[step % places.len()]);
                let stroke =
                    BurrStroke { burr: burr(BurrShape::Sphere), from: at, to: at, force_n: 1e6, speed_rpm: 40_000.0 };
                let start = Instant::now();
                black_box(cut.drill(&volume, &structures, black_box(&stroke), STEP_S));
                spent += start.elapsed();
            }
            spent
        });
    });

    let shapes = [
        ("ball", BurrShape::Sphere),
        ("cylinder of 5 mm", BurrShape::Cylinder { length_m: 5e-3 }),
        ("matchstick of 5 mm", BurrShape::Matchstick { length_m: 5e-3 }),
    ];
    for (name, shape) in shapes {
        for (way, force_n) in [("all of it", 1e6), ("as far as the force goes", 3.0)] {
            group.bench_function(format!("a groove, {name}, {way}"), |b| {
                b.iter_custom(|steps| {
                    let mut spent = Duration::ZERO;
                    let mut cut = CutVolume::new(volume.grid().size);
                    // 1 voxel a step: 12 mm/s.
                    let at = |step: u64| {
                        let lap = step / 200;
                        pose(Vec3::new(
                            28.3 + (step % 200) as f32,
                            30.7 + (lap % 10 * 20) as f32,
                            30.2 + (lap / 10 % 10 * 20) as f32,
                        ))
                    };
                    for step in 0..steps {
                        if step % 20_000 == 0 {
                            cut = CutVolume::new(volume.grid().size);
                        }
                        if step % 200 == 199 {
                            continue;
                        }
                        let stroke = BurrStroke {
                            burr: burr(shape),
                            from: at(step),
                            to: at(step + 1),
                            force_n,
                            speed_rpm: 40_000.0,
                        };
                        let start = Instant::now();
                        black_box(cut.drill(&volume, &structures, black_box(&stroke), STEP_S));
                        spent += start.elapsed();
                    }
                    spent
                });
            });
        }
    }
    group.finish();
}

criterion_group! { name = benches; config = Criterion::default().measurement_time(Duration::from_secs(2)).warm_up_time(Duration::from_millis(500)).sample_size(20); targets = drilling }
criterion_main!(benches);
