//! The paper's table 1 (of 2001): a head whose lattice moves in every frame, at 800x600, in all ways of rendering, with and without
//! light, beside an empty Bevy scene. Scan, transfer function, share of the picture and distance between samples are those of the
//! bench `volume_pass`. The scenes take turns frame by frame.

mod head;
mod turns;

use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::prelude::*;
use bevy_surgery::render::Uploads;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::transfer::TransferFunction;
use criterion::{Criterion, criterion_group, criterion_main};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// One cell of the table; without a level the volume has no lattice, without a side there is no volume.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Scene {
    side: u32,
    level: Option<u32>,
    method: VolumeMethod,
    is_shaded: bool,
}

struct Bench {
    app: TestApp,
    volume: Option<Entity>,
    camera: Entity,
    random: Pcg32,
}

type Heads = [(u32, (Volume, TransferFunction))];

fn bench(scene: Option<Scene>, heads: &Heads, size_px: UVec2) -> Bench {
    let (mut app, camera) = head::stage(0.032, size_px);
    let mut body = None;
    if let Some(scene) = scene {
        let (_, (volume, transfer)) = heads.iter().find(|(side, _)| *side == scene.side).expect("it was loaded");
        let mut look = VolumeLook { method: scene.method, ..default() };
        look.wet.is_shaded = scene.is_shaded;
        if !scene.is_shaded {
            look.wet.smoothed = SmoothedNormals::None;
        }
        let lattice = scene.level.map(|level| volume.grid().lattice(level).expect("a level that can be"));
        let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(volume.clone());
        let mut entity = app.world_mut().spawn((CtVolume(handle), transfer.clone(), look));
        if let Some(lattice) = lattice {
            entity.insert(lattice);
        }
        body = Some(entity.id());
    }
    for _ in 0..3 {
        app.idle();
    }
    app.warm_up();
    for _ in 0..6 {
        app.idle();
    }
    Bench { app, volume: body, camera, random: Pcg32::seed_from_u64(2001) }
}

/// Moves all inner vertices at random, by up to a quarter of a patch's side. Without a lattice the view is turned a little, so that
/// the volume is drawn anew as well.
fn frame(bench: &mut Bench) {
    if let Some(volume) = bench.volume {
        if let Some(mut lattice) = bench.app.world_mut().get_mut::<DeformLattice>(volume) {
            let tree = lattice.tree();
            let most = 0.25 / (1 << tree.deepest()) as f32;
            let mut part = || bench.random.random_range(-most..most);
            let moved: Vec<Vec3> = (0..tree.vertex_count())
                .map(|vertex| if tree.is_on_side(vertex) { Vec3::ZERO } else { Vec3::new(part(), part(), part()) })
                .collect();
            lattice.set_translations(&moved).expect("as many as vertices");
        } else {
            turn_view(bench);
        }
    }
    bench.app.idle();
}

fn turn_view(bench: &mut Bench) {
    let mut view = bench.app.world_mut().get_mut::<Transform>(bench.camera).expect("it was spawned");
    view.rotate_around(Vec3::ZERO, Quat::from_rotation_z(1_f32.to_radians()));
}

/// What a frame takes for a lattice of level 3 that moved, beyond drawing: the difference of two scenes in a picture too small to
/// count, of which one moves its lattice and one its view.
fn sending(heads: &Heads) {
    let scene = Scene { side: 128, level: Some(3), method: VolumeMethod::Rays, is_shaded: true };
    let mut benches = [true, false].map(|moves| (moves, bench(Some(scene), heads, UVec2::new(8, 6))));
    let medians = turns::medians_ms(600, &mut benches, |(moves, bench)| {
        if *moves {
            frame(bench);
        } else {
            turn_view(bench);
            bench.app.idle();
        }
    });
    println!("moving and sending level 3: {:.3} ms a frame", medians[0] - medians[1]);
}

fn name_of(scene: &Option<Scene>) -> String {
    let Some(scene) = scene else { return "empty scene".into() };
    let level = scene.level.map_or("no lattice".into(), |level| format!("level {level}"));
    let light = if scene.is_shaded { "lit" } else { "unlit" };
    format!("{:?}, {}^3, {level}, {light}", scene.method, scene.side)
}

fn frames(c: &mut Criterion) {
    // Only what the first argument after `--` names is timed, as in Criterion itself.
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();
    let heads: Vec<_> = [128, 256].map(|side| (side, head::head(side))).into_iter().collect();
    let mut scenes = vec![None];
    for side in [128, 256] {
        for method in [VolumeMethod::Rays, VolumeMethod::Slices, VolumeMethod::PatchSlices] {
            for is_shaded in [false, true] {
                for level in [None, Some(1), Some(2), Some(3)] {
                    scenes.push(Some(Scene { side, level, method, is_shaded }));
                }
            }
        }
    }
    scenes.retain(|scene| scene.is_none() || name_of(scene).contains(&wanted));
    let mut benches: Vec<Bench> = scenes.iter().map(|scene| bench(*scene, &heads, UVec2::new(800, 600))).collect();
    let medians = turns::medians_ms(15, &mut benches, frame);
    for ((scene, bench), median) in scenes.iter().zip(&benches).zip(&medians) {
        let sent = bench.app.sub_app(RenderApp).world().resource::<Uploads>().bytes() as f64 / 1024.0;
        println!("{}: {median:.2} ms a frame, {:.1} a second, {sent:.1} KiB sent", name_of(scene), 1e3 / median);
    }
    drop(benches);
    if "moving and sending".contains(&wanted) {
        sending(&heads);
    }
    let _ = c;
}

criterion_group!(benches, frames);
criterion_main!(benches);
