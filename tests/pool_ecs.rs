//! Pools in apps without a renderer: filled, bled into, sucked out, in exact steps.

use bevy::prelude::*;
use bevy_surgery::pool::{
    Bleeder, BleedingControl, BleedingRules, Cavity, Dissolved, FluidSolver, Hiding, Pool, PoolError, PoolFault,
    PoolFluid, PoolLevel, PoolState, SuctionGurgled, SuctionIrrigator, SuctionState, TreatBleeders, VesselOpened,
    WaterBudget,
};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use glam::DVec3;

/// Half of the side of a cube of bone in a grid of 64^3 voxels of 0.25 mm, voxels.
const HALF: u32 = 30;
/// Where its sides lie, metres.
pub const SIDE_M: f32 = 7.5e-3;

/// A cube of bone (label 1) with a vessel (label 2) 4 mm under the side at +z.
pub fn bone() -> Volume {
    let grid = VolumeGrid::upright(UVec3::splat(64), DVec3::splat(0.25));
    let (mut labels, mut solid) = (vec![0; grid.count()], vec![0; grid.count()]);
    for place in 0..grid.count() as u32 {
        let voxel = UVec3::new(place % 64, place / 64 % 64, place / 4096);
        let is_within = |side: u32, from: u32, to: u32| (from..to).contains(&side);
        if (0..3).all(|axis| is_within(voxel[axis], 32 - HALF, 32 + HALF)) {
            let is_vessel = is_within(voxel.z, 38, 44) && is_within(voxel.y, 28, 36);
            (labels[place as usize], solid[place as usize]) = (if is_vessel { 2 } else { 1 }, 255);
        }
    }
    let list = vec![
        Structure::new("bone", [230, 220, 200], Tissue::CorticalBone),
        Structure::new("vein", [40, 60, 200], Tissue::Vessel),
    ];
    let structures = Structures::new(list, labels, solid.clone()).expect("two structures");
    let volume = Volume::new(grid, Voxels::U8(solid), 1.0, 0.0).expect("a volume");
    volume.with_structures(structures).expect("of the same size")
}

struct Scene {
    app: TestApp,
    volume: Entity,
    pool: Entity,
}

impl Scene {
    fn new() -> Self {
        let mut app = TestApp::cpu();
        let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(bone());
        let volume = app.world_mut().spawn(CtVolume(handle)).id();
        let pool = Pool { size: UVec2::splat(192), cell_m: 8e-5, ..Pool::new(volume) };
        let pool = app.world_mut().spawn((pool, Pool::facing(Vec3::Z * SIDE_M, Vec3::Z))).id();
        app.step(3);
        Self { app, volume, pool }
    }

    fn get<T: Component>(&self) -> &T {
        self.app.world().get::<T>(self.pool).expect("it belongs to a pool")
    }

    fn set<T: Component>(&mut self, what: T) {
        self.app.world_mut().entity_mut(self.pool).insert(what);
    }

    fn state(&self) -> &PoolState {
        self.get()
    }

    /// Drills with a ball of 6 mm between two places over a number of steps.
    fn drill(&mut self, from_m: Vec3, to_m: Vec3, steps: u32) {
        let pose = |share: f32| BurrPose { centre_m: from_m.lerp(to_m, share), axis: Vec3::Z };
        for step in 0..steps {
            let (from, to) = (step as f32 / steps as f32, (step + 1) as f32 / steps as f32);
            self.app.world_mut().write_message(DrillVolume {
                volume: self.volume,
                tool: None,
                burr: Burr { diameter_m: 6e-3, ..default() },
                from_world: pose(from),
                to_world: pose(to),
                force_n: 1e6,
                speed_rpm: 60_000.0,
                begins_stroke: step == 0,
            });
            self.app.step(1);
        }
    }

    /// A hemisphere of 3 mm in bone that does not bleed.
    fn hollow(&mut self) {
        self.set(BleedingRules { ooze_s: 0.0, ..default() });
        self.drill(Vec3::Z * SIDE_M, Vec3::Z * SIDE_M, 1);
        self.app.step(8);
    }

    fn tool(&mut self, tool: SuctionIrrigator, tip_m: Vec3) -> Entity {
        let place = Transform::from_translation(tip_m).looking_to(Vec3::NEG_Z, Vec3::Y);
        self.app.world_mut().spawn((tool, place)).id()
    }

    fn assert_balanced(&self) {
        let water = self.get::<WaterBudget>();
        assert!((water.held_ml - water.balance_ml()).abs() < 1e-9, "{water:?}");
        let level_m = self.state().level_m.expect("drilled");
        let in_cavity = self.get::<Cavity>().volume_ml(level_m);
        assert!((in_cavity - water.held_ml).abs() < 1e-4 * water.held_ml.max(1e-4), "{in_cavity} of {water:?}");
    }
}

/// Volume of a cap of a sphere of 3 mm, millilitres.
fn cap_ml(height_m: f64) -> f64 {
    std::f64::consts::PI * height_m * height_m * (3.0 * 3e-3 - height_m) / 3.0 * 1e6
}

#[test]
fn a_drilled_hemisphere_fills_runs_over_and_empties() {
    let mut scene = Scene::new();
    assert!(scene.app.world().get::<PoolFault>(scene.pool).is_none());
    assert_eq!(scene.state().level_m, None);
    scene.hollow();
    let rim_m = scene.state().rim_m.expect("drilled");
    assert!(rim_m.abs() < 1.5e-4, "{rim_m}");
    let tool = SuctionIrrigator { irrigation_ml_s: 0.03, ..default() };
    let tool = scene.tool(tool, Vec3::new(0.0, 0.0, SIDE_M + 5e-3));
    let whole = scene.get::<Cavity>().volume_ml(rim_m);
    assert!((whole / cap_ml(3e-3) - 1.0).abs() < 0.05, "{whole} ml");
    for step in 1..=60 {
        scene.app.step(1);
        scene.assert_balanced();
        let water = *scene.get::<WaterBudget>();
        assert!((water.irrigated_ml - 0.03 * f64::from(step) / 60.0).abs() < 1e-6, "{water:?}");
        // What the sphere says about a level that is neither at the bottom nor at the rim.
        let level_m = f64::from(scene.state().level_m.expect("drilled"));
        if (20..60).contains(&step) {
            let expected = cap_ml(3e-3 + level_m - f64::from(rim_m));
            assert!((water.held_ml / expected - 1.0).abs() < 0.06, "step {step}: {} of {expected}", water.held_ml);
        }
    }
    assert_eq!(scene.get::<WaterBudget>().overflowed_ml, 0.0);
    scene.app.step(90);
    let water = *scene.get::<WaterBudget>();
    assert!((water.held_ml / whole - 1.0).abs() < 1e-6 && water.overflowed_ml > 0.01, "{water:?}");
    scene.assert_balanced();
    // It sucks more than it irrigates, from the bottom.
    let mut entity = scene.app.world_mut().entity_mut(tool);
    entity.get_mut::<Transform>().expect("a place").translation.z = SIDE_M - 2.6e-3;
    *entity.get_mut::<SuctionIrrigator>().expect("a tool") =
        SuctionIrrigator { irrigation_ml_s: 0.0, is_sucking: true, suction_ml_s: 0.2, tip_radius_m: 2e-4, ..default() };
    scene.app.step(10);
    assert_eq!(scene.app.world().get::<SuctionState>(tool).expect("a tool").air_share, 0.0);
    scene.app.step(60);
    scene.assert_balanced();
    let water = *scene.get::<WaterBudget>();
    assert!(water.held_ml < 0.05 * whole, "{water:?}");
    let came_and_went = water.irrigated_ml - water.sucked_ml - water.overflowed_ml;
    assert!((came_and_went - water.held_ml).abs() < 0.01 * whole);
    assert!(scene.app.world().get::<SuctionState>(tool).expect("a tool").air_share > 0.5);
}

#[test]
fn suckers_gurgle_between_air_and_water() {
    let mut scene = Scene::new();
    scene.hollow();
    scene.set(PoolLevel::Fixed(-5e-4));
    let sucker = SuctionIrrigator { irrigation_ml_s: 0.0, is_sucking: true, tip_radius_m: 5e-4, ..default() };
    let tool = scene.tool(sucker, Vec3::Z);
    scene.app.step(2);
    for (height_m, air) in [(5e-3, 1.0), (-5e-4, 0.5), (-2e-3, 0.0)] {
        scene.app.world_mut().entity_mut(tool).insert(Transform::from_xyz(0.0, 0.0, SIDE_M + height_m));
        scene.app.step(2);
        scene.app.world_mut().resource_mut::<Messages<SuctionGurgled>>().clear();
        scene.app.step(1);
        let share = scene.app.world().get::<SuctionState>(tool).expect("a tool").air_share;
        assert!((share - air).abs() < 0.05, "{share} of air at {height_m} m");
        let gurgles: Vec<SuctionGurgled> =
            scene.app.world_mut().resource_mut::<Messages<SuctionGurgled>>().drain().collect();
        assert_eq!(gurgles.len(), usize::from(air == 0.5), "at {height_m} m: {gurgles:?}");
        assert!(gurgles.iter().all(|gurgle| gurgle.tool == tool && gurgle.air_share == share));
    }
    scene.assert_balanced();
    let water = scene.get::<WaterBudget>();
    assert!(water.sucked_ml > 0.0 && (water.adjusted_ml - water.sucked_ml - water.held_ml).abs() < 1e-9, "{water:?}");
}

#[test]
fn vessels_that_were_opened_bleed_until_they_are_sealed() {
    let mut scene = Scene::new();
    scene.drill(Vec3::Z * SIDE_M, Vec3::Z * (SIDE_M - 1.5e-3), 5);
    assert_eq!(scene.app.world_mut().query::<&Bleeder>().iter(scene.app.world()).count(), 0);
    // Into the vessel.
    scene.app.world_mut().resource_mut::<Messages<VesselOpened>>().clear();
    scene.drill(Vec3::Z * (SIDE_M - 1.5e-3), Vec3::Z * (SIDE_M - 3e-3), 5);
    let opened: Vec<VesselOpened> = scene.app.world_mut().resource_mut::<Messages<VesselOpened>>().drain().collect();
    assert!(!opened.is_empty() && opened.iter().all(|it| it.label == 2 && it.volume == scene.volume), "{opened:?}");
    let mut bleeders = scene.app.world_mut().query::<(Entity, &Bleeder)>();
    let (entity, bleeder) = bleeders.single(scene.app.world()).expect("one place, opened ever wider");
    let (rate_ml_s, mut lost_ml) = (bleeder.rate_ml_s, bleeder.lost_ml);
    assert!(rate_ml_s > 0.02 && opened.iter().all(|it| it.bleeder == entity), "{bleeder:?}");
    let seal = |scene: &mut Scene, control, radius_m| {
        let place_world_m = Vec3::Z * (SIDE_M - 5.5e-3);
        scene.app.world_mut().write_message(TreatBleeders { place_world_m, radius_m, control });
        scene.app.step(30);
        scene.app.world().get::<Bleeder>(entity).expect("it stays").lost_ml
    };
    // Out of reach, packed, open again, sealed, and no longer to be opened.
    for (control, radius_m, bleeds) in [
        (BleedingControl::Packed, 1e-4, true),
        (BleedingControl::Packed, 5e-3, false),
        (BleedingControl::Open, 5e-3, true),
        (BleedingControl::Cauterized, 5e-3, false),
        (BleedingControl::Open, 5e-3, false),
    ] {
        let after_ml = seal(&mut scene, control, radius_m);
        assert_eq!(after_ml > lost_ml, bleeds, "{control:?}: {lost_ml} and then {after_ml} ml");
        if bleeds {
            let per_s = (after_ml - lost_ml) * 2.0;
            assert!(
                per_s > 0.7 * f64::from(rate_ml_s) && per_s < 1.01 * f64::from(rate_ml_s),
                "{per_s} of {rate_ml_s}"
            );
        }
        lost_ml = after_ml;
    }
    let water = *scene.get::<WaterBudget>();
    assert!(water.bled_ml >= lost_ml, "{water:?}");
    scene.assert_balanced();
    // Nothing but blood flowed in: nearly all that is held is blood, and it hides the field.
    let state = scene.state().clone();
    assert!(state.blood_ml > 0.5 * water.held_ml && state.blood_ml < 1.2 * water.held_ml, "{state:?} {water:?}");
    assert!(state.hidden_share > 0.3, "{state:?}");
    // Irrigation thins it, and the field can be seen again.
    let tool = SuctionIrrigator { irrigation_ml_s: 0.2, ..default() };
    scene.tool(tool, Vec3::Z * (SIDE_M + 3e-3));
    scene.app.step(240);
    assert!(scene.state().blood_ml < 0.3 * state.blood_ml, "{:?}", scene.state());
    scene.app.step(720);
    assert!(scene.state().hidden_share < 0.1, "{:?}", scene.state());
    scene.assert_balanced();
}

#[test]
fn dust_hides_the_field_too_and_more_where_it_is_deep() {
    let mut scene = Scene::new();
    scene.hollow();
    let jet = scene.tool(SuctionIrrigator { irrigation_ml_s: 1.0, ..default() }, Vec3::Z * (SIDE_M + 3e-3));
    // Longer than the dust of the hollow takes to settle.
    scene.app.step(2400);
    assert_eq!(scene.state().hidden_share, 0.0, "clear water hides nothing");
    scene.app.world_mut().despawn(jet);
    // Not so deep that the vein is opened.
    scene.drill(Vec3::Z * SIDE_M, Vec3::Z * (SIDE_M - 7e-4), 20);
    scene.app.step(30);
    let state = scene.state().clone();
    assert_eq!(state.blood_ml, 0.0);
    assert!(state.hidden_share > 0.2, "{state:?}");
    // What hides the ground of a pool by depth and shares.
    let fluid = *scene.get::<PoolFluid>();
    let by_depth = [0.5e-3, 5e-3].map(|depth_m| Hiding::new(&fluid, depth_m));
    assert_eq!(by_depth.map(|hiding| hiding.hides(0.1, 0.0)), [false, true]);
    assert_eq!(by_depth.map(|hiding| hiding.hides(0.0, 0.2)), [false, true]);
    scene.set(PoolFluid { dust_hides: 0.0, ..fluid });
    scene.app.step(1);
    assert_eq!(scene.state().hidden_share, 0.0);
}

#[test]
fn bleeders_run_dry_clot_and_feel_the_water_over_them() {
    let vein = Bleeder { rate_ml_s: 1.0, reserve_ml: 2.0, clotting_s: f32::INFINITY, ..default() };
    let mut dry = vein.clone();
    let lost: f64 = (0..6000).map(|_| dry.bleed(0.0, 0.01)).sum();
    assert!((lost - 2.0).abs() < 0.01 && dry.pressure_mmhg < 1e-3, "{lost} ml of 2");
    let mut clots = Bleeder { reserve_ml: f32::INFINITY, clotting_s: 3.0, ..vein.clone() };
    let lost: f64 = (0..6000).map(|_| clots.bleed(0.0, 0.01)).sum();
    assert!((lost - 3.0).abs() < 0.02, "{lost} ml of 3");
    // 12 mmHg are 163 mm of water.
    assert!((vein.flow_ml_s(0.0816) - 0.5).abs() < 0.005 && vein.flow_ml_s(0.17) == 0.0 && vein.flow_ml_s(-1.0) == 1.0);
    for odd in [f32::NAN, f32::INFINITY, -1.0, 0.0] {
        let mut bleeder = Bleeder { rate_ml_s: odd, ..vein.clone() };
        assert!(bleeder.bleed(0.0, 0.01) == 0.0, "a rate of {odd}");
        let mut bleeder = Bleeder { full_pressure_mmhg: odd, ..vein.clone() };
        assert!(bleeder.bleed(0.0, 0.01) == 0.0, "a pressure of {odd}");
    }
}

/// A whole run: what is drilled under irrigation, with a vein that bleeds and is sealed.
fn run() -> (String, Vec<u32>) {
    let mut scene = Scene::new();
    scene.tool(SuctionIrrigator::default(), Vec3::new(2e-3, 0.0, SIDE_M + 4e-3));
    scene.drill(Vec3::Z * SIDE_M, Vec3::new(1e-3, 5e-4, SIDE_M - 3e-3), 40);
    scene.app.step(30);
    scene.app.world_mut().write_message(TreatBleeders {
        place_world_m: Vec3::Z * (SIDE_M - 5e-3),
        radius_m: 6e-3,
        control: BleedingControl::Cauterized,
    });
    scene.drill(Vec3::new(-2e-3, 0.0, SIDE_M), Vec3::new(-2e-3, 2e-3, SIDE_M - 1e-3), 20);
    let fluid = scene.get::<FluidSolver>();
    let bits = (0..192 * 192)
        .flat_map(|place| {
            let cell = UVec2::new(place % 192, place / 192);
            let velocity = fluid.side_velocity_m_s(cell);
            [velocity.x, velocity.y, fluid.share(Dissolved::Blood, cell), fluid.share(Dissolved::Dust, cell)]
        })
        .map(f32::to_bits)
        .collect();
    (format!("{:?} {:?}", scene.state(), scene.get::<WaterBudget>()), bits)
}

#[test]
fn a_whole_run_is_the_same_twice() {
    let (first, bits) = run();
    let (second, again) = run();
    assert_eq!(first, second);
    assert!(bits == again, "the fluid differs");
    assert!(bits.iter().filter(|bits| **bits != 0).count() > 20_000, "something flows");
    println!("{first}");
}

#[test]
fn burrs_stir_raise_dust_and_foam() {
    let mut scene = Scene::new();
    scene.hollow();
    scene.set(PoolLevel::Fixed(-2e-4));
    scene.app.step(3);
    let energy = |scene: &Scene| {
        let fluid = scene.get::<FluidSolver>();
        (0..192 * 192).map(|k| fluid.velocity_m_s(UVec2::new(k % 192, k / 192)).length_squared()).sum::<f32>()
    };
    assert_eq!((energy(&scene), scene.state().foam.len()), (0.0, 0));
    scene.drill(Vec3::Z * SIDE_M, Vec3::Z * (SIDE_M - 2e-4), 10);
    assert!(energy(&scene) > 0.0);
    let dust = scene.get::<FluidSolver>().total(Dissolved::Dust);
    assert!(dust > 0.0 && !scene.state().foam.is_empty());
    // It settles, and the foam goes.
    scene.app.step(600);
    assert!(scene.get::<FluidSolver>().total(Dissolved::Dust) < 0.5 * dust && scene.state().foam.is_empty());
    // Away from the water a burr does nothing to it.
    scene.set(PoolFluid { foam_from_m_s: 1e-9, ..default() });
    scene.drill(Vec3::Z * 0.05, Vec3::Z * 0.05, 3);
    assert!(scene.state().foam.is_empty());
}

#[test]
fn the_mask_follows_drilling_and_nothing_else() {
    let mut scene = Scene::new();
    scene.set(PoolLevel::Fixed(-1e-3));
    scene.hollow();
    let wet = scene.state().wet_cells;
    let disk = std::f64::consts::PI * (9e-6 - 1e-6) / 6.4e-9;
    assert!((f64::from(wet) / disk - 1.0).abs() < 0.12, "{wet} cells of {disk}");
    // A camera more or less, turned and moved, is nothing to it.
    scene.app.world_mut().spawn((Transform::from_xyz(1.0, 2.0, 3.0), GlobalTransform::default()));
    scene.app.step(5);
    assert_eq!(scene.state().wet_cells, wet);
    let looks = scene.get::<Cavity>().looks();
    let whole = 192 * 192;
    assert!((whole..whole + whole / 2).contains(&looks), "{looks} looks at {whole} columns");
    // Turned together with its volume it stays as well.
    scene.app.world_mut().entity_mut(scene.pool).insert(ChildOf(scene.volume));
    let steps = scene.state().steps;
    for turn in 1..5 {
        let turned = Transform::from_rotation(Quat::from_rotation_y(0.1 * turn as f32));
        scene.app.world_mut().entity_mut(scene.volume).insert(turned);
        scene.app.step(1);
    }
    assert_eq!((scene.state().wet_cells, scene.state().steps), (wet, steps + 4));
    assert_eq!(scene.get::<Cavity>().looks(), looks, "nothing is measured again");
    scene.app.world_mut().entity_mut(scene.volume).insert(Transform::IDENTITY);
    scene.app.step(1);
    scene.drill(Vec3::new(3e-3, 0.0, SIDE_M), Vec3::new(3e-3, 0.0, SIDE_M), 1);
    scene.app.step(1);
    assert!(scene.state().wet_cells > wet + 100);
    let more = scene.get::<Cavity>().looks() - looks;
    assert!((1000..whole / 2).contains(&more), "{more} columns for a burr");
}

#[test]
fn bad_pools_say_what_is_wrong() {
    let mut scene = Scene::new();
    scene.hollow();
    let (volume, pool) = (scene.volume, scene.pool);
    let good = *scene.get::<Pool>();
    let fault = |scene: &Scene| scene.app.world().get::<PoolFault>(pool).map(|fault| fault.0.clone());
    let assert_bad = |scene: &mut Scene, expected: &str| {
        scene.app.step(2);
        let found = fault(scene).expect("it has a fault").to_string();
        assert!(found.contains(expected), "{found}");
        assert!(
            scene.app.world().get::<FluidSolver>(pool).is_none() && scene.app.world().get::<PoolState>(pool).is_none()
        );
        assert_eq!(*scene.get::<WaterBudget>(), WaterBudget::default());
    };
    for (size, cell_m, expected) in [
        (UVec2::ZERO, 1e-4, "size"),
        (UVec2::new(1 << 31, 8), 1e-4, "size"),
        (UVec2::splat(64), f32::NAN, "cell_m"),
        (UVec2::splat(64), 0.0, "cell_m"),
    ] {
        scene.set(Pool { size, cell_m, ..good });
        assert_bad(&mut scene, expected);
    }
    scene.set(Pool { volume: pool, ..good });
    assert_bad(&mut scene, "is no volume");
    scene.set(good);
    scene.app.step(2);
    assert_eq!(fault(&scene), None);
    for (level_m, expected) in
        [(f32::NAN, "no level"), (f32::INFINITY, "no level"), (0.5, "no volume"), (-1.0, "no volume")]
    {
        scene.set(PoolLevel::Fixed(level_m));
        assert_bad(&mut scene, expected);
    }
    scene.set(PoolLevel::Balanced);
    for (place, expected) in [
        (Transform::from_xyz(5.0, 0.0, 0.0), "beside"),
        (Transform::from_scale(Vec3::ZERO), "no inverse"),
        (Transform::from_translation(Vec3::NAN), "no inverse"),
    ] {
        scene.set(place);
        assert_bad(&mut scene, expected);
    }
    scene.set(Pool::facing(Vec3::Z * SIDE_M, Vec3::Z));
    scene.app.step(10);
    assert_eq!(fault(&scene), None);
    assert!(scene.state().field_cells > 0);
    // Sources beside the grid and tools with odd numbers do nothing; drilling goes on.
    for odd in [f32::NAN, f32::INFINITY, -1.0] {
        let tool = SuctionIrrigator {
            irrigation_ml_s: odd,
            jet_m_s: odd,
            suction_ml_s: odd,
            tip_radius_m: odd,
            is_sucking: true,
        };
        scene.tool(tool, Vec3::Z * (SIDE_M + 1e-3));
        scene.tool(SuctionIrrigator { is_sucking: true, ..default() }, Vec3::splat(odd));
        scene.app.world_mut().spawn((Bleeder::default(), Transform::from_translation(Vec3::splat(odd))));
    }
    scene.app.world_mut().spawn((Bleeder::default(), Transform::from_xyz(1.0, 0.0, 0.0)));
    scene.drill(Vec3::Z * SIDE_M, Vec3::Z * SIDE_M, 5);
    let water = *scene.get::<WaterBudget>();
    assert!(water.held_ml == 0.0 && water.bled_ml.is_finite() && water.irrigated_ml == 0.0, "{water:?}");
    // Exchanged in the middle of it: all begins anew. Gone: nothing is left.
    scene.set(PoolLevel::Fixed(-5e-4));
    scene.app.step(2);
    assert!(scene.state().wet_cells > 0);
    let other = scene.app.world_mut().resource_mut::<Assets<Volume>>().add(bone());
    scene.app.world_mut().entity_mut(volume).insert(CtVolume(other));
    scene.app.step(4);
    assert_eq!((scene.state().wet_cells, scene.state().field_cells, scene.state().level_m), (0, 0, None));
    scene.app.world_mut().entity_mut(volume).despawn();
    scene.app.step(2);
    assert_eq!(fault(&scene), Some(PoolError::NoVolume { volume }));
    assert!(scene.app.world().get::<FluidSolver>(pool).is_none());
}
