//! Volumes at 800x600 beside an empty Bevy scene: a full redraw, an unchanged view, drilling with the redraw.
//!
//! A head of 256^3 voxels of 8 bits with the transfer function, the share of the picture and the distance between samples that
//! `../shared/peers/b_volume_vtk.py` has, where the scan is at hand; otherwise the phantom. The scenes take turns frame by
//! frame, so that a machine that slows down slows all of them.

mod head;
mod turns;

use bevy::prelude::*;
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::PickedVolume;
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrPose, BurrShape};
use bevy_surgery::volume::transfer::TransferFunction;
use criterion::{Criterion, criterion_group, criterion_main};
use std::f32::consts::TAU;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Scene {
    Empty,
    /// The view turns: everything is drawn again.
    Turned,
    /// The same without light.
    TurnedUnshaded,
    /// The same as slices.
    TurnedSlices,
    /// Nothing changes.
    Unchanged,
    /// A burr of a radius of 8 voxels is drawn over the bone.
    Drilled,
}

const SCENES: [(Scene, &str); 6] = [
    (Scene::Empty, "empty scene"),
    (Scene::Unchanged, "unchanged view"),
    (Scene::Turned, "full redraw, wet shading"),
    (Scene::TurnedUnshaded, "full redraw, unshaded"),
    (Scene::Drilled, "drilling and its redraw"),
    (Scene::TurnedSlices, "full redraw, slices"),
];

struct Bench {
    app: TestApp,
    scene: Scene,
    camera: Entity,
    volume: Option<Entity>,
    frame: u32,
}

fn bench(scene: Scene, volume: &Volume, transfer: &TransferFunction) -> Bench {
    let (mut app, camera) = head::stage(volume.grid().half_axes_m()[0].length(), UVec2::new(800, 600));
    let mut body = None;
    if scene != Scene::Empty {
        let mut look = VolumeLook::default();
        look.wet.is_shaded = scene != Scene::TurnedUnshaded;
        if scene == Scene::TurnedUnshaded {
            look.wet.smoothed = SmoothedNormals::None;
        }
        if scene == Scene::TurnedSlices {
            look.method = VolumeMethod::Slices;
        }
        let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(volume.clone());
        body = Some(app.world_mut().spawn((CtVolume(handle), transfer.clone(), look)).id());
    }
    for _ in 0..3 {
        app.idle();
    }
    app.warm_up();
    for _ in 0..6 {
        app.idle();
    }
    Bench { app, scene, camera, volume: body, frame: 0 }
}

fn frame(bench: &mut Bench) {
    bench.frame += 1;
    match bench.scene {
        Scene::Turned | Scene::TurnedUnshaded | Scene::TurnedSlices => {
            let mut view = bench.app.world_mut().get_mut::<Transform>(bench.camera).expect("it was spawned");
            view.rotate_around(Vec3::ZERO, Quat::from_rotation_z(1_f32.to_radians()));
            bench.app.idle();
        }
        Scene::Drilled => {
            let volume = bench.volume.expect("it was spawned");
            let world = bench.app.world_mut();
            let body = world.get::<CtVolume>(volume).expect("it was spawned").0.clone();
            let grid = *world.resource::<Assets<Volume>>().get(&body).expect("it was added").grid();
            let radius_m = 8.0 * grid.spacing_mm().min_element() as f32 * 1e-3;
            let burr = Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m: 2.0 * radius_m };
            let picker = &world.get::<PickedVolume>(volume).expect("it has structures").0;
            // On a small circle in the picture, always as deep into the bone that was there in the beginning.
            let at = |frame: u32| {
                let turn = frame as f32 * 0.05 % TAU;
                let from = head::towards_eye() + 0.005 * Vec3::new(turn.cos(), 0.0, turn.sin());
                let hit = picker.pick(from, -head::towards_eye(), 2.0, |_| 1.0).expect("the burr meets the head");
                let depth_m = 0.02 * radius_m * (frame % 40) as f32;
                BurrPose { centre_m: hit.position_m - head::towards_eye() * depth_m, axis: Vec3::Z }
            };
            let (from_world, to_world) = (at(bench.frame), at(bench.frame + 1));
            world.write_message(DrillVolume {
                volume,
                tool: None,
                burr,
                from_world,
                to_world,
                force_n: 1e4,
                speed_rpm: 4e4,
                begins_stroke: bench.frame == 1,
            });
            bench.app.step(1);
        }
        Scene::Empty | Scene::Unchanged => bench.app.idle(),
    }
}

/// Share of the picture that the volume takes up.
fn cover(bench: &mut Bench) -> f32 {
    let shown = bench.app.capture();
    let volume = bench.volume.expect("it was spawned");
    bench.app.world_mut().entity_mut(volume).insert(Visibility::Hidden);
    bench.app.idle();
    let empty = bench.app.capture_even_if_black();
    bench.app.world_mut().entity_mut(volume).insert(Visibility::Inherited);
    bench.app.idle();
    let differing = shown.pixels().zip(empty.pixels()).filter(|(a, b)| a != b).count();
    differing as f32 / (shown.width() * shown.height()) as f32
}

fn frames(c: &mut Criterion) {
    let (volume, transfer) = head::head(256);
    let mut benches: Vec<Bench> = SCENES.iter().map(|(scene, _)| bench(*scene, &volume, &transfer)).collect();
    println!("the volume covers {:.3} of the picture", cover(&mut benches[1]));
    let medians = turns::medians_ms(30, &mut benches, frame);
    for ((_, name), median) in SCENES.iter().zip(&medians) {
        println!("{name}: {median:.2} ms a frame, {:+.2} ms over the empty scene", median - medians[0]);
    }
    let drilled = &benches[4];
    let removed =
        drilled.volume.and_then(|volume| drilled.app.world().get::<RemovedTissue>(volume)).expect("it was drilled");
    println!("drilled: {:.0} mm3", removed.total_mm3());
    let mut group = c.benchmark_group("volume 256^3, 800x600");
    group.sample_size(10);
    turns::bench_each(&mut group, &SCENES.map(|(_, name)| name), &mut benches, frame);
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
