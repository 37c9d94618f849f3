//! `bsn!` and the scenes that are ready, without a renderer.

use super::saved_and_loaded;
use bevy::prelude::*;
use bevy_surgery::deform::TravellingWave;
use bevy_surgery::haptics::servo::ServoSettings;
use bevy_surgery::organ::procedural::ProceduralLiver;
use bevy_surgery::prelude::*;
use bevy_surgery::scenes::rig_of;
use bevy_surgery::testing::TestApp;
use bevy_surgery::tools::{DeviceControl, HoldDevice, RigFrame, ToolControls, ToolRig};

fn spawned(app: &mut TestApp, scene: impl Scene) -> Entity {
    app.world_mut().spawn_scene(scene).expect("it can be spawned").id()
}

fn named(app: &mut TestApp, name: &str) -> Entity {
    let mut names = app.world_mut().query::<(Entity, &Name)>();
    let found: Vec<Entity> = names.iter(app.world()).filter(|(_, it)| it.as_str() == name).map(|(id, _)| id).collect();
    assert_eq!(found.len(), 1, "{name}: {found:?}");
    found[0]
}

#[test]
fn organs_are_patched() {
    let mut app = TestApp::cpu();
    let base = || {
        bsn! {
            LoadOrgan { source: OrganSource::Liver({ ProceduralLiver { seed: 3, ..default() } }) }
            Skin { mottle: 0.5 }
            Reactions { max_sprites: 10 }
            Highlights { strength: 2.0 }
            SurfaceFeel { dynamic_friction: 0.01 }
            Hollow
        }
    };
    let organ = spawned(
        &mut app,
        bsn! {
            base()
            LoadOrgan { options: OrganOptions { centre: true } }
            Skin { seed: 4, tiles: TileSource::Generated({ TileOptions { resolution_px: 128, ..default() } }) }
            Reactions { map_width_px: 512 }
            Highlights { cover: HighlightCover::UnderDrops }
        },
    );
    let world = app.world();
    let source = OrganSource::Liver(ProceduralLiver { seed: 3, ..default() });
    assert_eq!(world.get(organ), Some(&LoadOrgan { source, options: OrganOptions::default().centred() }));
    let tiles = TileSource::Generated(TileOptions { resolution_px: 128, ..default() });
    assert_eq!(world.get(organ), Some(&Skin { mottle: 0.5, seed: 4, tiles, ..default() }));
    assert_eq!(world.get(organ), Some(&Reactions { max_sprites: 10, map_width_px: 512, ..default() }));
    let shine = Highlights { strength: 2.0, cover: HighlightCover::UnderDrops, ..default() };
    assert_eq!(world.get(organ), Some(&shine));
    assert_eq!(world.get(organ), Some(&SurfaceFeel { dynamic_friction: 0.01, ..default() }));
    assert_eq!(world.get(organ), Some(&Hollow));
    // Handles by their path.
    let organ = spawned(&mut app, bsn! { Organ("nowhere/liver.obj") });
    let path = app.world().get::<Organ>(organ).and_then(|organ| organ.0.path().map(ToString::to_string));
    assert_eq!(path.as_deref(), Some("nowhere/liver.obj"));
}

#[test]
fn volumes_and_pools_are_patched() {
    let mut app = TestApp::cpu();
    let bone = || {
        bsn! {
            #Bone
            CtVolume("nowhere/bone.nrrd")
            VolumeLook { step_voxels: 0.5 }
            TransferFunction { reference_length_m: 0.002 }
            WatchCritical { band_mm: 3.0 }
            SoftVolume { level: 1 }
            LatticeAnimation { motion: LatticeMotion::Wave({ TravellingWave { amplitude: 0.01, ..default() } }) }
        }
    };
    let bone = spawned(
        &mut app,
        bsn! {
            bone()
            #Patient
            VolumeLook { method: VolumeMethod::Slices, wet: WetShading { passes: 2 } }
            Children [
                Pool { volume: #Patient, cell_m: 2e-4 }
                PoolLevel::Fixed(0.001)
                PoolFluid { foam_from_m_s: 1.0 }
                PoolBackend::Cpu
                SolverSettings { pressure_iterations: 5 }
                BleedingRules { ooze_s: 1.0 }
                PoolLook { bubble_m: 2e-4 },
                Bleeder { rate_ml_s: 0.2 },
            ]
        },
    );
    let wet = WetShading { passes: 2, ..default() };
    let look = VolumeLook { step_voxels: 0.5, method: VolumeMethod::Slices, wet, ..default() };
    assert_eq!(app.world().get(bone), Some(&look));
    let path = app.world().get::<CtVolume>(bone).and_then(|volume| volume.0.path().map(ToString::to_string));
    assert_eq!(path.as_deref(), Some("nowhere/bone.nrrd"));
    let wave = TravellingWave { amplitude: 0.01, ..default() };
    assert_eq!(app.world().get(bone), Some(&LatticeAnimation::new(LatticeMotion::Wave(wave))));
    assert_eq!(app.world().get(bone), Some(&SoftVolume { level: 1, ..default() }));
    let mut pools = app.world_mut().query::<(&Pool, &PoolLevel, &PoolBackend, &SolverSettings, &ChildOf)>();
    let (pool, level, backend, settings, parent) = pools.single(app.world()).expect("a pool");
    assert_eq!(*pool, Pool { cell_m: 2e-4, ..Pool::new(bone) });
    assert_eq!((*level, *backend, settings.pressure_iterations), (PoolLevel::Fixed(0.001), PoolBackend::Cpu, 5));
    assert_eq!(parent.parent(), bone);
    // A pool over nothing is an error, and no panic.
    assert!(app.world_mut().spawn_scene(bsn! { Pool { cell_m: 1e-4 } }).is_err());
}

#[test]
fn instruments_are_patched() {
    let mut app = TestApp::cpu();
    let drill = spawned(
        &mut app,
        bsn! {
            #Table
            Transform
            Children [
                #Drill
                Tool { hand: ToolHand::Left, kind: ToolKind::Drill({ DrillHead { flutes: 5, ..default() } }) }
                rig_of(#Table)
                ToolRig { scale: 0.5 }
                ToolControls { clutch: DeviceControl::Button(7) }
                ToolSound { gain: 0.5 }
                ToolPose { is_tracked: true }
                HoldDevice { id: "hand:mouse", settings: ServoSettings { period_s: 0.002 } }
                SuctionIrrigator { jet_m_s: 0.25 }
            ]
        },
    );
    let tool = named(&mut app, "Drill");
    let world = app.world();
    let head = DrillHead { flutes: 5, ..default() };
    let wanted = Tool { kind: ToolKind::Drill(head), hand: ToolHand::Left, ..default() };
    assert_eq!(world.get(tool), Some(&wanted));
    assert_eq!(world.get(tool), Some(&ToolRig { frame: RigFrame::Of(drill), scale: 0.5, ..default() }));
    let controls = ToolControls { clutch: DeviceControl::Button(7), ..default() };
    assert_eq!(world.get(tool), Some(&controls));
    let settings = ServoSettings { period_s: 0.002, ..default() };
    assert_eq!(world.get(tool), Some(&HoldDevice { id: "hand:mouse".into(), settings }));
}

#[cfg(feature = "render")]
#[test]
fn views_are_patched() {
    let mut app = TestApp::cpu();
    let microscope = spawned(
        &mut app,
        bsn! {
            #Scope
            Microscope { step: 2 }
            StereoPair { is_crossed: true }
            ScopeMask { radius: 0.5 }
            Children [
                (MicroscopeLamp { offset_m: {Vec2::X} } ScopeLight { intensity_cd: 5.0 } ToolShadows { strength: 0.1 }),
                MonitorView { of: #Scope },
                (Endoscope { near_m: 0.004 } ToolShadow),
            ]
        },
    );
    let world = app.world_mut();
    assert_eq!(world.get(microscope), Some(&Microscope { step: 2, ..default() }));
    let monitor = *world.query::<&MonitorView>().single(world).expect("a monitor");
    assert_eq!(monitor, MonitorView { of: microscope });
    let endoscope = world.query::<&Endoscope>().single(world).expect("an endoscope").clone();
    assert_eq!(endoscope, Endoscope { near_m: 0.004, ..default() });
    let light = world.query_filtered::<&ScopeLight, With<MicroscopeLamp>>().single(world).expect("a lamp").clone();
    assert_eq!(light, ScopeLight { intensity_cd: 5.0, ..default() });
}

#[test]
fn the_liver_scene_bleeds() {
    let mut app = TestApp::cpu();
    let liver = spawned(&mut app, liver_scene());
    app.idle_until("the liver", |app| app.world().get::<ReactionModel>(liver).is_some());
    let wall = named(&mut app, "AbdominalWall");
    app.idle_until("the wall", |app| app.world().get::<OrganShape>(wall).is_some());
    assert!(app.world().get::<Hollow>(wall).is_some());
    let shape = app.world().get::<OrganShape>(liver).expect("a shape");
    let reach_m = shape.positions_m().iter().map(|place| place.abs().max_element()).fold(0.0, f32::max);
    assert!((reach_m - 0.11).abs() < 1e-4, "22 cm wide about its middle: {reach_m}");
    let above = Ray3d::new(Vec3::new(0.02, 0.2, 0.0), Dir3::NEG_Y);
    app.add_systems(
        FixedUpdate,
        (move |picking: OrganPicking, mut touches: MessageWriter<OrganTouch>| {
            let Some(hit) = picking.cast_ray(above, 1.0).filter(|hit| hit.organ == liver) else { return };
            let action = ReactionAction::Bleed { volume_m3: 1e-9 };
            touches.write(OrganTouch { organ: hit.organ, point: hit.point, instrument: 0, action });
        })
        .in_set(SurgerySystems::Touch),
    );
    app.step(30);
    let bled_m3 = app.world().get::<ReactionModel>(liver).expect("it reacts").tally().bled_m3;
    assert!((bled_m3 / 30e-9 - 1.0).abs() < 1e-9, "{bled_m3}");
    #[cfg(feature = "render")]
    assert_eq!(app.world_mut().query::<&Endoscope>().iter(app.world()).count(), 1);
}

#[test]
fn the_mastoid_scene_is_drilled_under_water() {
    let mut app = TestApp::cpu();
    let options = PhantomOptions { size: 64, ..default() };
    let scene = bsn! { mastoid_scene() MakePhantom(PhantomOptions { size: 64 }) };
    let bone = spawned(&mut app, scene);
    assert_eq!(app.world().get::<MakePhantom>(bone), Some(&MakePhantom(options)));
    app.idle_until("the bone", |app| app.world().get::<CriticalDistances>(bone).is_some());
    let (pool, drill, suction) = (named(&mut app, "Pool"), named(&mut app, "Drill"), named(&mut app, "Suction"));
    app.step(2);
    assert_eq!(app.world().get::<PoolFault>(pool), None);
    assert!(app.world().get::<Cavity>(pool).is_some_and(Cavity::has_bone), "the pool lies over the bone");
    // Half a second into the mastoid from outside, with the irrigator beside it.
    let back = Vec3::Z;
    for step in 0..90 {
        let tip_m = Vec3::new(0.0, 0.0, 0.024 - 0.0002 * step as f32);
        let pose = ToolPose::with_shaft_towards(tip_m, tip_m + back);
        app.world_mut().entity_mut(drill).insert((pose, ToolCommand { pedal: 1.0, ..default() }));
        let beside = ToolPose::with_shaft_towards(tip_m + 0.003 * Vec3::X, tip_m + back);
        app.world_mut().entity_mut(suction).insert(beside);
        app.step(1);
    }
    let removed_mm3 = app.world().get::<RemovedTissue>(bone).map_or(0.0, RemovedTissue::total_mm3);
    assert!(removed_mm3 > 1.0, "{removed_mm3} mm3");
    let budget = app.world().get::<WaterBudget>(pool).expect("a budget");
    // The irrigator gives 0.3 ml in a second from when there is something to fill, and one and a half have passed.
    assert!((0.3..0.45).contains(&budget.irrigated_ml), "{budget:?}");
    assert!((budget.balance_ml() - budget.held_ml).abs() < 1e-9, "{budget:?}");
    assert!(app.world().get::<PoolState>(pool).is_some_and(|pool| pool.field_cells > 10));
}

#[test]
fn the_soft_volume_gives_way() {
    let mut app = TestApp::cpu();
    let scene = bsn! { soft_volume_scene() MakePhantom(PhantomOptions { size: 32 }) SoftVolume { level: 2 } };
    let soft = spawned(&mut app, scene);
    app.idle_until("the body", |app| app.world().get::<ElasticBody>(soft).is_some());
    app.step(20);
    let reach_mm = |app: &TestApp| {
        let body = app.world().get::<ElasticBody>(soft).expect("a body");
        let way = |vertex| body.displacement_m(vertex).length();
        (0..body.tree().vertex_count()).map(way).fold(0.0, f32::max) * 1e3
    };
    assert!(reach_mm(&app) < 1e-3, "it lay under gravity when it was made: {} mm", reach_mm(&app));
    app.world_mut().resource_mut::<SurgeryGravity>().world_m_per_s2 *= 5.0;
    app.step(60);
    assert!(reach_mm(&app) > 0.05, "it gives way: {} mm", reach_mm(&app));
    let body = app.world().get::<ElasticBody>(soft).expect("a body");
    let held = (0..body.tree().vertex_count()).filter(|&vertex| body.is_pinned(vertex));
    let held: Vec<f32> = held.map(|vertex| body.rest_m(vertex).z).collect();
    assert_eq!(held.len(), 25, "the back of four cells along each side");
    assert!(held.iter().all(|z| (z + 0.024).abs() < 1e-6));
    // Changed, it is made anew.
    app.world_mut().get_mut::<SoftVolume>(soft).expect("it is there").level = 1;
    app.step(1);
    let body = app.world().get::<ElasticBody>(soft).expect("a body");
    assert_eq!(body.tree().patches().len(), 8);
}

#[test]
fn ready_scenes_come_back() {
    let mut app = TestApp::cpu();
    let roots = [
        spawned(&mut app, liver_scene()),
        spawned(&mut app, bsn! { mastoid_scene() MakePhantom(PhantomOptions { size: 32 }) }),
        spawned(&mut app, bsn! { soft_volume_scene() MakePhantom(PhantomOptions { size: 32 }) }),
    ];
    let (text, mut fresh, map) = saved_and_loaded(&app);
    let roots = roots.map(|root| map[&root]);
    let [liver, bone, soft] = roots;
    fresh.idle_until("the scenes", |app| {
        app.world().get::<OrganShape>(liver).is_some()
            && app.world().get::<CutVolume>(bone).is_some()
            && app.world().get::<ElasticBody>(soft).is_some()
    });
    let pool = named(&mut fresh, "Pool");
    assert_eq!(fresh.world().get::<Pool>(pool).map(|pool| pool.volume), Some(roots[1]));
    let drill = named(&mut fresh, "Drill");
    assert_eq!(fresh.world().get::<ToolRig>(drill).map(|rig| rig.frame), Some(RigFrame::Of(roots[1])));
    assert!(text.len() < 100_000, "{} bytes", text.len());
}
