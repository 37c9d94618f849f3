//! The flow of a pool on the GPU, held against its twin on the processor.

use super::pool_ecs::{SIDE_M, bone};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, MapMode, PollType, TexelCopyBufferInfo, TexelCopyBufferLayout,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_surgery::pool::render::flow::{FlowSurface, FlowSurfaces, GpuFlow, MAX_WAITING_STEPS, PoolReadings};
use bevy_surgery::pool::{
    Advection, BleedingRules, Dissolved, FluidAction, FluidSolver, FluidSource, Hiding, Pool, PoolBackend, PoolGrid,
    PoolState, SolverSettings, SuctionIrrigator, WetMask,
};
use bevy_surgery::prelude::*;
use bevy_surgery::testing::TestApp;
use image::RgbaImage;

const STEP_S: f32 = 1.0 / 60.0;
const SIZE: UVec2 = UVec2::new(210, 170);

/// A basin with an island and a thin wall. Some tiles have no wall near them.
fn basin(grid: &PoolGrid) -> WetMask {
    WetMask::from_fn(grid, |cell| {
        let at = cell.as_vec2() - Vec2::new(105.0, 85.0);
        (at / Vec2::new(103.0, 84.0)).length() < 1.0
            && (at - Vec2::new(75.0, -10.0)).length() > 9.0
            && !(cell.x == 24 && cell.y > 50)
    })
}

/// A jet that stirs and wanders, an inflow of blood, and suction.
fn action(step: u64) -> FluidAction {
    let turn = step as f32 * 0.05;
    let jet = FluidSource {
        place_m: Vec2::from_angle(turn) * 0.004,
        radius_m: 0.001,
        push_m_s: Vec2::new(0.001, 0.0005),
        stir_m_s: 0.004,
        stir_offset_m: Vec2::new(turn * 0.001, -turn * 0.002),
        amount: [0.0, 4.0],
        ..default()
    };
    let bleeding = FluidSource {
        place_m: Vec2::new(-0.0075, 0.002),
        radius_m: 0.0008,
        flow_m2_s: 2e-6,
        amount: [8.0, 0.0],
        ..default()
    };
    let suction =
        FluidSource { place_m: Vec2::new(0.0072, -0.003), radius_m: 0.0008, flow_m2_s: -2e-6, clear: 0.2, ..default() };
    FluidAction { sources: vec![jet, bleeding, suction], keep: [0.999, 1.0] }
}

/// A pool on the GPU beside its twin.
struct Twins {
    app: TestApp,
    pool: Entity,
    fluid: FluidSolver,
    settings: SolverSettings,
    step: u64,
}

impl Twins {
    fn new(settings: SolverSettings, mask: impl FnOnce(&PoolGrid) -> WetMask) -> Self {
        let grid = PoolGrid::new(SIZE, 1e-4).expect("a good grid");
        let mut fluid = FluidSolver::new(grid);
        fluid.set_mask(&mask(&grid)).expect("a mask of the grid's size");
        let mut app = TestApp::gpu(16, 16);
        app.warm_up();
        let pool = app.world_mut().spawn(GpuFlow::default()).id();
        Self { app, pool, fluid, settings, step: 0 }
    }

    /// Steps both; the GPU's step waits for the next frame.
    fn push(&mut self, count: u32) {
        for _ in 0..count {
            self.step += 1;
            let action = action(self.step);
            let mut flow = self.app.world_mut().get_mut::<GpuFlow>(self.pool).expect("a pool on the GPU");
            assert_eq!(flow.push(&self.fluid, STEP_S, &self.settings, &action), self.step);
            self.fluid.step_with(STEP_S, &self.settings, &action);
        }
    }

    fn frame(&mut self) {
        self.app.idle();
    }

    fn surface(&self) -> Option<FlowSurface> {
        let surfaces = self.app.sub_app(RenderApp).world().resource::<FlowSurfaces>();
        surfaces.0.get(&self.pool.into()).cloned()
    }

    fn readings(&self) -> PoolReadings {
        *self.app.world().get::<PoolReadings>(self.pool).expect("readings come with the pool")
    }

    fn read(&self, buffer: &Buffer) -> Vec<f32> {
        let (device, queue) = (self.app.world().resource::<RenderDevice>(), self.app.world().resource::<RenderQueue>());
        let copy = device.create_buffer(&BufferDescriptor {
            label: None,
            size: buffer.size(),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&default());
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, buffer.size());
        queue.submit([encoder.finish()]);
        copy.slice(..).map_async(MapMode::Read, |result| result.expect("the buffer can be read"));
        device.poll(PollType::wait_indefinitely()).expect("the device answers");
        bytemuck::cast_slice(&copy.slice(..).get_mapped_range()).to_vec()
    }

    /// Relative errors of the GPU: velocity, blood, dust, height.
    fn errors(&self) -> [f64; 4] {
        let fields = self.surface().expect("the pool has a surface").fields;
        let [velocity, dissolved, pressure, scale] =
            [&fields.velocity, &fields.dissolved, &fields.pressure, &fields.scale].map(|buffer| self.read(buffer));
        let cell_m = self.fluid.grid().cell_m();
        let share = if self.settings.advection == Advection::MacCormack { 0.5 } else { 1.0 };
        let mut sums = [[0.0; 2]; 4];
        for cell in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y))) {
            let place = ((cell.y + 1) * fields.stride + cell.x + 4) as usize;
            let side = self.fluid.side_velocity_m_s(cell);
            let height_m = self.fluid.height_m(cell, STEP_S, 9.81);
            let pairs = [
                (0, velocity[2 * place], side.x),
                (0, velocity[2 * place + 1], side.y),
                (1, dissolved[2 * place] * scale[0], self.fluid.share(Dissolved::Blood, cell)),
                (2, dissolved[2 * place + 1] * scale[1], self.fluid.share(Dissolved::Dust, cell)),
                (3, pressure[place] * cell_m / (share * STEP_S * 9.81), height_m),
            ];
            for (what, found, expected) in pairs {
                sums[what][0] += f64::from(found - expected).powi(2);
                sums[what][1] += f64::from(expected).powi(2);
            }
        }
        sums.map(|[error, whole]| {
            assert!(whole > 0.0, "nothing moves: the comparison is worth nothing");
            (error / whole).sqrt()
        })
    }

    fn assert_agree(&self, tolerance: f64, what: &str) {
        let errors = self.errors();
        println!(
            "{what}: velocity {:.1e}, blood {:.1e}, dust {:.1e}, height {:.1e}",
            errors[0], errors[1], errors[2], errors[3]
        );
        assert!(errors.iter().all(|error| *error < tolerance), "{what}: {errors:?}");
    }
}

fn settings(advection: Advection) -> SolverSettings {
    SolverSettings { advection, ..default() }
}

#[test]
fn the_gpu_does_what_the_processor_does() {
    for advection in [Advection::SemiLagrangian, Advection::MacCormack] {
        for blur_m2_s in [0.0, 1e-6] {
            let settings =
                SolverSettings { viscosity_m2_s: blur_m2_s, diffusion_m2_s: blur_m2_s, ..settings(advection) };
            let mut twins = Twins::new(settings, basin);
            for (steps, tolerance) in [(10, 1e-5), (90, 5e-4)] {
                for _ in 0..steps {
                    twins.push(1);
                    twins.frame();
                }
                twins.assert_agree(tolerance, &format!("{advection:?}, blur {blur_m2_s}, {} steps", twins.step));
            }
        }
    }
}

#[test]
fn any_number_of_steps_per_frame_is_the_same() {
    let run = |frames: &[u32]| {
        let mut twins = Twins::new(settings(Advection::MacCormack), basin);
        for steps in frames {
            twins.push(*steps);
            twins.frame();
            assert_eq!(twins.surface().map_or(0, |surface| surface.step), twins.step);
        }
        twins.assert_agree(1e-5, &format!("{frames:?} steps per frame"));
        let fields = twins.surface().expect("a surface").fields;
        [&fields.velocity, &fields.dissolved, &fields.pressure].map(|buffer| twins.read(buffer))
    };
    let one_by_one = run(&[1; 12]);
    assert!(run(&[0, 3, 0, 0, 7, 2, 0]) == one_by_one, "the same bits");
}

#[test]
fn steps_wait_for_their_pipelines() {
    let mut twins = Twins::new(settings(Advection::SemiLagrangian), basin);
    // An app whose pipelines nobody has waited for.
    twins.app = TestApp::gpu(16, 16);
    twins.pool = twins.app.world_mut().spawn(GpuFlow::default()).id();
    twins.push(6);
    twins.frame();
    twins.push(6);
    twins.app.warm_up();
    assert_eq!(twins.surface().map(|surface| surface.step), Some(12));
    twins.assert_agree(1e-5, "steps that waited");
}

#[test]
fn readings_arrive_and_agree() {
    let mut twins = Twins::new(settings(Advection::SemiLagrangian), basin);
    assert_eq!(twins.readings(), PoolReadings::default());
    let hiding = Hiding { from: 0.03, dust: 0.6 };
    twins.app.world_mut().get_mut::<GpuFlow>(twins.pool).expect("a pool").hiding = hiding;
    twins.push(40);
    twins.frame();
    for _ in 0..4 {
        twins.frame();
    }
    let found = twins.readings();
    let cells = || (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y)));
    let wet: Vec<UVec2> = cells().filter(|cell| twins.fluid.is_wet(*cell)).collect();
    let shares = |cell: UVec2| [Dissolved::Blood, Dissolved::Dust].map(|what| twins.fluid.share(what, cell));
    let hides = |cell: UVec2| shares(cell)[0] + hiding.dust * shares(cell)[1] >= hiding.from;
    let hidden = wet.iter().filter(|cell| hides(**cell)).count();
    let by_blood = wet.iter().filter(|cell| shares(**cell)[0] >= hiding.from).count();
    assert!(by_blood + 20 < hidden, "dust hides, too: {by_blood} of {hidden}");
    let fastest = wet.iter().map(|cell| twins.fluid.velocity_m_s(*cell).length()).fold(0.0, f32::max);
    let is_near = |found: f32, expected: f32, relative: f32| (found - expected).abs() <= relative * expected.abs();
    assert_eq!((found.step, found.wet_cells), (40, wet.len() as u32));
    assert!(is_near(found.blood, twins.fluid.total(Dissolved::Blood) as f32, 1e-5), "{found:?}");
    assert!(is_near(found.dust, twins.fluid.total(Dissolved::Dust) as f32, 1e-5), "{found:?}");
    assert!(is_near(found.fastest_m_s, fastest, 1e-4) && fastest > 0.0, "{found:?}, {fastest}");
    let share = hidden as f32 / wet.len() as f32;
    assert!(hidden > 100 && is_near(found.hidden_share, share, 0.01), "{found:?}, {share}");
    assert!((found.blood - 40.0 * 8.0).abs() < 20.0, "blood is kept: {found:?}");
}

/// A number of 16 bits.
fn number(bits: u16) -> f32 {
    let (exponent, fraction) = (i32::from((bits >> 10) & 31), f32::from(bits & 1023));
    let size =
        if exponent == 0 { fraction * 2_f32.powi(-24) } else { (1.0 + fraction / 1024.0) * 2_f32.powi(exponent - 15) };
    if bits >> 15 == 1 { -size } else { size }
}

#[test]
fn the_surface_shows_what_is_there() {
    let mut twins = Twins::new(settings(Advection::MacCormack), basin);
    twins.push(25);
    twins.frame();
    // What became wall is no longer shown.
    let grid = *twins.fluid.grid();
    let narrow = WetMask::from_fn(&grid, |cell| basin(&grid).is_wet(cell) && cell.x < 150);
    twins.fluid.set_mask(&narrow).expect("a mask of the grid's size");
    twins.push(1);
    twins.frame();
    let surface = twins.surface().expect("a surface");
    let row_bytes = (SIZE.x * 8).next_multiple_of(256);
    let (device, queue) = (twins.app.world().resource::<RenderDevice>(), twins.app.world().resource::<RenderQueue>());
    let copy = device.create_buffer(&BufferDescriptor {
        label: None,
        size: u64::from(row_bytes * SIZE.y),
        usage: BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    });
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes), rows_per_image: None };
    let mut encoder = device.create_command_encoder(&default());
    encoder.copy_texture_to_buffer(
        surface.texture.as_image_copy(),
        TexelCopyBufferInfo { buffer: &copy, layout },
        Extent3d { width: SIZE.x, height: SIZE.y, depth_or_array_layers: 1 },
    );
    queue.submit([encoder.finish()]);
    let halves: Vec<u16> = bytemuck::cast_slice(&twins.read(&copy)).to_vec();
    let mut greatest = [0.0_f32; 3];
    for cell in (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y))) {
        let first = (cell.y * row_bytes / 2 + cell.x * 4) as usize;
        let found = [0, 1, 2, 3].map(|channel| number(halves[first + channel]));
        let is_wet = twins.fluid.is_wet(cell);
        let height_mm = 1000.0 * twins.fluid.height_m(cell, STEP_S, 9.81);
        let shares = [Dissolved::Blood, Dissolved::Dust].map(|what| twins.fluid.share(what, cell));
        let expected = [height_mm, shares[0], shares[1], f32::from(u8::from(is_wet))];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= 2e-3 * expected.abs() + 1e-6, "{cell}: {found} is not {expected}");
        }
        greatest = std::array::from_fn(|k| greatest[k].max(found[k].abs()));
    }
    assert!(greatest.iter().all(|number| *number > 1e-3), "too little is to be seen: {greatest:?}");
}

#[test]
fn a_new_mask_takes_what_is_in_its_walls() {
    let mut twins = Twins::new(settings(Advection::MacCormack), basin);
    twins.push(15);
    twins.frame();
    // The pool shrinks, while steps wait, and grows again.
    twins.push(2);
    let grid = *twins.fluid.grid();
    let narrow = WetMask::from_fn(&grid, |cell| basin(&grid).is_wet(cell) && cell.x > 30 && cell.x < 150);
    let lost = twins.fluid.set_mask(&narrow).expect("a mask of the grid's size");
    assert!(lost[0] > 10.0, "{lost:?}");
    twins.push(3);
    twins.frame();
    twins.assert_agree(2e-5, "a smaller pool");
    twins.fluid.set_mask(&basin(&grid)).expect("a mask of the grid's size");
    twins.push(10);
    twins.frame();
    twins.assert_agree(2e-5, "a larger pool");
}

#[test]
fn another_grid_begins_at_rest() {
    let mut twins = Twins::new(settings(Advection::SemiLagrangian), basin);
    twins.push(3);
    twins.frame();
    let small = FluidSolver::new(PoolGrid::new(UVec2::new(33, 20), 2e-4).expect("a good grid"));
    let mut flow = twins.app.world_mut().get_mut::<GpuFlow>(twins.pool).expect("a pool");
    flow.push(&small, STEP_S, &settings(Advection::SemiLagrangian), &default());
    for _ in 0..5 {
        twins.frame();
    }
    let surface = twins.surface().expect("a surface");
    assert_eq!((surface.size, surface.step), (UVec2::new(33, 20), 4));
    let found = twins.readings();
    assert_eq!((found.blood, found.fastest_m_s, found.wet_cells, found.step), (0.0, 0.0, 660, 4));
}

#[test]
fn an_exchanged_component_begins_at_rest() {
    let mut twins = Twins::new(settings(Advection::SemiLagrangian), basin);
    twins.push(6);
    twins.frame();
    let mut flow = GpuFlow::default();
    for _ in 0..2 {
        flow.push(&twins.fluid, STEP_S, &twins.settings, &default());
    }
    twins.push(2);
    twins.app.world_mut().entity_mut(twins.pool).insert(flow);
    for _ in 0..5 {
        twins.frame();
    }
    let found = twins.readings();
    assert_eq!((found.step, found.blood, found.dust, found.fastest_m_s), (2, 0.0, 0.0, 0.0));
}

#[test]
fn a_pool_that_is_gone_leaves_nothing() {
    let mut twins = Twins::new(settings(Advection::SemiLagrangian), basin);
    twins.push(5);
    twins.frame();
    assert!(twins.surface().is_some());
    // Readings of it are still on their way.
    twins.push(5);
    twins.app.world_mut().despawn(twins.pool);
    for _ in 0..5 {
        twins.frame();
    }
    assert!(twins.surface().is_none());
}

#[test]
fn steps_do_not_pile_up() {
    let fluid = FluidSolver::new(PoolGrid::new(UVec2::splat(8), 1e-3).expect("a good grid"));
    let mut flow = GpuFlow::default();
    for number in 1..=MAX_WAITING_STEPS as u64 + 7 {
        assert_eq!(flow.push(&fluid, STEP_S, &default(), &default()), number);
    }
    assert_eq!(flow.waiting(), MAX_WAITING_STEPS);
    assert_eq!(flow.push(&fluid, 0.0, &default(), &default()), 0);
    assert_eq!(flow.push(&fluid, f32::NAN, &default(), &default()), 0);
}

#[test]
fn without_a_graphics_device_the_processor_flows() {
    let mut app = TestApp::cpu();
    let fluid = FluidSolver::new(PoolGrid::new(UVec2::splat(8), 1e-3).expect("a good grid"));
    let pool = app.world_mut().spawn((GpuFlow::default(), fluid)).id();
    app.step(2);
    assert!(app.world().get::<GpuFlow>(pool).is_none());
    assert!(app.world().get::<FluidSolver>(pool).is_some());
}

/// A cavity that is drilled under irrigation, seen from above, after so many steps; and what is known of its blood.
fn drilled(backend: PoolBackend, steps: u32) -> (RgbaImage, PoolState) {
    let mut app = TestApp::gpu(160, 120);
    let handle = app.world_mut().resource_mut::<Assets<Volume>>().add(bone());
    let volume = app.world_mut().spawn(CtVolume(handle)).id();
    let pool = Pool { size: UVec2::splat(128), cell_m: 1.2e-4, ..Pool::new(volume) };
    let place = Pool::facing(Vec3::Z * SIDE_M, Vec3::Z);
    let pool = app.world_mut().spawn((pool, backend, BleedingRules { ooze_s: 200.0, ..default() }, place)).id();
    let camera = app.spawn_camera(Transform::from_xyz(0.0, 0.0, 0.04).looking_at(Vec3::ZERO, Vec3::Y));
    let near = Projection::Perspective(PerspectiveProjection { near: 1e-3, ..default() });
    app.world_mut().entity_mut(camera).insert((near, ScopeLight { intensity_cd: 1.0, ..default() }));
    let jet = Transform::from_xyz(2e-3, 0.0, SIDE_M + 4e-3).looking_to(Vec3::NEG_Z, Vec3::Y);
    app.world_mut().spawn((SuctionIrrigator { irrigation_ml_s: 0.1, ..default() }, jet));
    app.step(2);
    // Until the pipelines of the flow are there nothing may happen that only one of the two sees late.
    let pose = |at_m: Vec3| BurrPose { centre_m: at_m, axis: Vec3::Z };
    for step in 0..steps {
        let at_m = Vec3::new(1e-3 * (step as f32 * 0.1).sin(), 0.0, SIDE_M - 5e-5 * step as f32);
        app.world_mut().write_message(DrillVolume {
            volume,
            tool: None,
            burr: Burr { diameter_m: 6e-3, ..default() },
            from_world: pose(at_m),
            to_world: pose(at_m),
            force_n: 1e6,
            speed_rpm: 3_000.0,
            begins_stroke: step == 0,
        });
        app.step(1);
    }
    let picture = app.capture();
    // What is read back comes late.
    (0..8).for_each(|_| app.idle());
    app.step(1);
    let has_flow = app.world().get::<GpuFlow>(pool).is_some();
    assert_eq!(has_flow, backend == PoolBackend::Gpu, "software is not worth it");
    (picture, app.world().get::<PoolState>(pool).expect("it is there").clone())
}

#[test]
fn pools_on_the_gpu_and_on_the_processor_look_alike() {
    let (on_processor, known) = drilled(PoolBackend::Auto, 30);
    let (on_gpu, read_back) = drilled(PoolBackend::Gpu, 30);
    let difference = |a: &RgbaImage, b: &RgbaImage| {
        let sum: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
        sum as f64 / a.as_raw().len() as f64
    };
    let (dry, _) = drilled(PoolBackend::Auto, 1);
    let (twins, wet) = (difference(&on_processor, &on_gpu), difference(&on_processor, &dry));
    println!("{twins:.3} of 255 between them, {wet:.3} from a dry cavity; {known:?} {read_back:?}");
    assert!(twins < 0.1 && wet > 1.0, "{twins} and {wet}");
    assert_eq!((known.level_m, known.wet_cells), (read_back.level_m, read_back.wet_cells));
    assert!(known.blood_ml > 1e-3 && (read_back.blood_ml / known.blood_ml - 1.0).abs() < 0.05);
    assert!(known.hidden_share > 0.0 && (read_back.hidden_share - known.hidden_share).abs() < 0.05);
}
