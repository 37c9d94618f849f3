//! Slices that are aligned with a deformed volume: the picture is that of their twin, and near to that of the field itself.

use super::stage::{Difference, EYE, SIZE_PX, Shot, Stage};
use super::{SIZE, points, specimen, veil, volume_of};
use bevy::math::{DVec3, UVec3};
use bevy::prelude::*;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::deform::lattice::Patch;
use bevy_surgery::render::SHADERS;
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::aligned::{PatchPolygons, SliceStack};
use bevy_surgery::volume::{AlignedUniform, PatchFramesTexel, PatchRectTexel, VolumeMethod};

/// A smooth deformation; that of the sides as well.
fn waves(lattice: &mut DeformLattice, most: f64) {
    let wave = |at: DVec3| DVec3::new((at.y * 6.0).sin(), (at.z * 5.0 + 1.0).sin(), (at.x * 7.0 + 2.0).cos());
    lattice.set_from(|at| wave(at) * most).expect("finite");
}

fn stage() -> Stage {
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), veil());
    stage.look().method = VolumeMethod::PatchSlices;
    stage.look().wet.is_shaded = false;
    stage
}

fn check(stage: &mut Stage, what: &str, least_covered: usize) {
    let shot = stage.shot();
    let edge_m = stage.rays(Vec3::ZERO).voxel_edge_m();
    let twin = stage.twin();
    let difference = Difference::between(&shot, &twin, edge_m);
    println!("{what}: {difference:?}");
    assert!(difference.covered > least_covered, "{what}: {difference:?} shows too little");
    assert!(difference.is_small(), "{what}: {difference:?}");
}

/// Likeness of two pictures as they are shown, decibels, among the pixels that either shows.
fn psnr(a: &Shot, b: &[[f32; 4]]) -> f32 {
    let shown = |linear: f32| {
        let linear = linear.clamp(0.0, 1.0);
        if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
    };
    let covered = a.colour.iter().zip(b).filter(|(a, b)| a[3] > 0.0 || b[3] > 0.0);
    let squares: Vec<f32> = covered
        .flat_map(|(a, b)| std::array::from_fn::<f32, 3, _>(|channel| (shown(a[channel]) - shown(b[channel])).powi(2)))
        .collect();
    assert!(squares.len() > 3 * 1_000, "only {} values", squares.len());
    -10.0 * (squares.iter().sum::<f32>() / squares.len() as f32).log10()
}

#[test]
fn the_picture_is_that_of_the_twin() {
    let mut stage = stage();
    let volume = stage.volume;
    check(&mut stage, "without a lattice", 1500);
    for level in 0..=3 {
        let mut lattice = stage.source().grid().lattice(level).expect("a level that can be");
        waves(&mut lattice, 0.04);
        stage.set(volume, lattice);
        check(&mut stage, &format!("level {level}"), 1500);
    }
    let mut lattice = stage.source().grid().lattice(1).expect("a level that can be");
    lattice.subdivide(Patch { level: 1, cell: UVec3::new(1, 0, 1) }).expect("a patch");
    lattice.subdivide(Patch { level: 2, cell: UVec3::new(2, 1, 2) }).expect("a patch");
    waves(&mut lattice, 0.05);
    stage.set(volume, lattice);
    check(&mut stage, "adaptive", 1500);
    stage.look().clip_planes = vec![Vec4::new(1.0, 0.3, -0.4, 0.004)];
    check(&mut stage, "clipped", 1000);
    stage.look().clip_planes.clear();
    stage.look().step_voxels = 0.5;
    check(&mut stage, "half steps", 1500);
    stage.look().step_voxels = 1.0;
    stage.drill(Vec3::new(-0.012, -0.002, 0.012), Vec3::new(-0.004, -0.006, 0.004), 6e-3);
    check(&mut stage, "drilled", 1500);
    stage.set(volume, Transform::from_rotation(Quat::from_euler(EulerRot::XYZ, 0.5, 2.1, -0.8)));
    check(&mut stage, "turned", 1500);
}

/// All six ways to go through the stacks, and light.
#[test]
fn every_side_is_the_twins() {
    let mut stage = stage();
    stage.look().wet.smoothed = bevy_surgery::volume::SmoothedNormals::None;
    stage.look().wet.is_shaded = true;
    let mut taken = std::collections::BTreeSet::new();
    for direction in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
        let eye = (direction + Vec3::new(0.21, 0.12, 0.17)).normalize() * EYE.length();
        stage.aim(eye, Vec3::ZERO);
        check(&mut stage, &format!("from {direction}"), 800);
        let stack = stage.stack(&stage.rays(Vec3::ZERO), 1e-3, 0.0);
        taken.insert((stack.axis, stack.is_forward));
    }
    assert_eq!(taken.len(), 6);
}

/// The same matter, whether its slices are met head on or at an angle.
#[test]
fn opacity_does_not_depend_on_the_angle() {
    // A mist in which no ray ends before it has gone through.
    let mist = points(&[(0.1, [200, 120, 60], 0.0), (0.6, [220, 200, 190], 0.05)]);
    let mut stage = Stage::new(volume_of(SIZE, DVec3::ONE, specimen), mist);
    stage.look().wet.is_shaded = false;
    for angle in [0.0_f32, 0.2, 0.4, 0.6, 0.78] {
        stage.aim(Quat::from_rotation_y(angle) * Vec3::new(0.0, 0.02, 0.095), Vec3::ZERO);
        stage.look().method = VolumeMethod::Rays;
        let rays = stage.shot();
        stage.look().method = VolumeMethod::PatchSlices;
        let slices = stage.shot();
        let opacity = |shot: &Shot| shot.colour.iter().map(|texel| f64::from(texel[3])).sum::<f64>();
        let likeness = psnr(&slices, &rays.colour);
        let ratio = opacity(&slices) / opacity(&rays);
        println!("at {angle}: {likeness:.1} dB, opacity {ratio:.4} of the rays'");
        assert!(likeness > 35.0 && (ratio - 1.0).abs() < 5e-3, "at {angle}: {likeness} dB, {ratio}");
    }
}

/// A lattice of patches of several sizes leaves no holes in what is solid.
#[test]
fn patches_of_different_sizes_leave_no_gaps() {
    let solid = volume_of(SIZE, DVec3::ONE, |voxel| 0.9 + voxel.x * 1e-3);
    let mut stage = Stage::new(solid, veil());
    stage.look().method = VolumeMethod::PatchSlices;
    stage.look().wet.is_shaded = false;
    let mut lattice = stage.source().grid().lattice(1).expect("a level that can be");
    lattice.subdivide(Patch { level: 1, cell: UVec3::new(1, 0, 1) }).expect("a patch");
    lattice.subdivide(Patch { level: 2, cell: UVec3::new(2, 1, 2) }).expect("a patch");
    let count = lattice.tree().vertex_count();
    let moved: Vec<Vec3> = (0..count)
        .map(|vertex| {
            let is_inner = !lattice.tree().is_on_side(vertex);
            if is_inner { Vec3::new(0.03, -0.04, 0.05) * ((vertex % 5) as f32 * 0.5 - 1.0) } else { Vec3::ZERO }
        })
        .collect();
    lattice.set_translations(&moved).expect("as many as vertices");
    let volume = stage.volume;
    stage.set(volume, lattice);
    for eye in [EYE, Vec3::new(-0.08, 0.03, 0.02), Vec3::new(0.01, -0.09, 0.03)] {
        stage.aim(eye, Vec3::ZERO);
        let shot = stage.shot();
        let size = SIZE_PX.as_ivec2();
        let is_solid = |at: IVec2| {
            let is_in = at.cmpge(IVec2::ZERO).all() && at.cmplt(size).all();
            is_in && shot.colour[(at.y * size.x + at.x) as usize][3] > 0.5
        };
        let solid = (0..size.x * size.y).filter(|k| is_solid(IVec2::new(k % size.x, k / size.x))).count();
        assert!(solid > 1000, "{solid} pixels are solid from {eye}");
        for at in (0..size.x * size.y).map(|k| IVec2::new(k % size.x, k / size.x)).filter(|at| !is_solid(*at)) {
            // Something solid within two pixels on all four sides.
            let sides = [IVec2::X, IVec2::NEG_X, IVec2::Y, IVec2::NEG_Y];
            let is_hole = sides.iter().all(|&side| is_solid(at + side) || is_solid(at + 2 * side));
            assert!(!is_hole, "a hole at {at} from {eye}");
        }
    }
}

/// The shader's vertices are those of the CPU.
#[test]
fn the_shader_cuts_the_vertices_that_the_cpu_cuts() {
    let library = SHADERS.iter().find(|shader| shader.path == "volume/patches.wgsl").expect("it is embedded").source;
    let source = library.replace("#define_import_path bevy_surgery::volume_patches", "")
        + "@group(0) @binding(0) var<storage, read_write> made: array<vec4<f32>>;\n\
           @compute @workgroup_size(64)\n\
           fn main(@builtin(global_invocation_id) id: vec3<u32>) {\n\
               if id.x >= arrayLength(&polygons) * 5u { return; }\n\
               let corner = polygon_vertex(polygons[id.x / 5u], id.x % 5u);\n\
               made[id.x * 2u] = vec4(corner.place, 0.0);\n\
               made[id.x * 2u + 1u] = vec4(corner.rest, f32(aligned.axis));\n\
           }\n";
    let mut app = TestApp::gpu(16, 16);
    app.spawn_camera(Transform::default());
    app.warm_up();
    let (device, queue) =
        (app.world().resource::<RenderDevice>().clone(), app.world().resource::<RenderQueue>().clone());
    let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a box");
    lattice.subdivide(Patch { level: 1, cell: UVec3::new(1, 0, 1) }).expect("a patch");
    waves(&mut lattice, 0.07);
    let polygons = PatchPolygons::new(lattice.tree(), 0.125);
    let wgpu = device.wgpu_device();
    let module =
        wgpu.create_shader_module(ShaderModuleDescriptor { label: None, source: ShaderSource::Wgsl(source.into()) });
    let pipeline = wgpu.create_compute_pipeline(&RawComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: PipelineCompilationOptions::default(),
        cache: None,
    });
    for (axis, direction) in [(0, 1.0_f32), (1, -1.0), (2, 1.0)] {
        let mut along = Vec3::splat(0.1);
        along[axis] = direction;
        let stack = SliceStack::new(along, bevy::math::Mat3::IDENTITY, 0.037, Vec3::splat(-0.125), Vec3::splat(1.125));
        let numbers = AlignedUniform {
            first: stack.first as f32,
            direction,
            spacing: stack.spacing,
            axis: axis as u32,
            ..default()
        };
        let mut wanted = Vec::new();
        let mut numbered = Vec::new();
        for n in 0..stack.count {
            let at = stack.position(n);
            for k in 0..60 {
                let uva = Vec3::new((k % 10) as f32 * 0.12 - 0.1, (k / 10) as f32 * 0.2 - 0.1, at);
                let Some(rect) = polygons.rect_at(axis, uva) else { continue };
                numbered.push(n << 20 | rect);
                wanted.extend((0..5).map(|corner| polygons.vertex(rect, axis, at, lattice.translations(), corner)));
            }
        }
        let translations: Vec<Vec4> = lattice.translations().iter().map(|t| t.extend(0.0)).collect();
        let buffer = |contents: &[u8], usage| {
            device.create_buffer_with_data(&BufferInitDescriptor { label: None, contents, usage })
        };
        let made = device.create_buffer(&BufferDescriptor {
            label: None,
            size: (wanted.len() * 32) as u64,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let read = device.create_buffer(&BufferDescriptor {
            label: None,
            size: (wanted.len() * 32) as u64,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let uniform = buffer(&uniform_bytes(&numbers), BufferUsages::UNIFORM);
        let frames: Vec<PatchFramesTexel> = polygons.frames().iter().map(Into::into).collect();
        let rects: Vec<PatchRectTexel> = polygons.rects().iter().map(Into::into).collect();
        let frames = buffer(&stored_bytes(&frames), BufferUsages::STORAGE);
        let rects = buffer(&stored_bytes(&rects), BufferUsages::STORAGE);
        let moved = buffer(bytemuck::cast_slice(&translations), BufferUsages::STORAGE);
        let numbered = buffer(bytemuck::cast_slice(&numbered), BufferUsages::STORAGE);
        let entry = |binding, buffer: &Buffer| (binding, buffer.clone());
        let group = |index: u32, entries: Vec<(u32, Buffer)>| {
            let entries: Vec<_> = entries
                .iter()
                .map(|(binding, buffer)| BindGroupEntry { binding: *binding, resource: buffer.as_entire_binding() })
                .collect();
            let layout = pipeline.get_bind_group_layout(index);
            wgpu.create_bind_group(&BindGroupDescriptor { label: None, layout: &layout, entries: &entries })
        };
        let groups = [
            group(0, vec![entry(0, &made)]),
            group(
                1,
                vec![entry(7, &uniform), entry(8, &frames), entry(9, &rects), entry(10, &moved), entry(11, &numbered)],
            ),
        ];
        let mut encoder = wgpu.create_command_encoder(&CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            for (index, group) in groups.iter().enumerate() {
                pass.set_bind_group(index as u32, group, &[]);
            }
            pass.dispatch_workgroups((wanted.len() as u32).div_ceil(64), 1, 1);
        }
        encoder.copy_buffer_to_buffer(&made, 0, &read, 0, (wanted.len() * 32) as u64);
        queue.submit([encoder.finish()]);
        read.slice(..).map_async(MapMode::Read, |result| result.expect("it can be read"));
        device.poll(PollType::wait_indefinitely()).expect("the device answers");
        let bytes = read.slice(..).get_mapped_range().to_vec();
        let found: &[[f32; 8]] = bytemuck::cast_slice(&bytes);
        assert!(wanted.len() > 5000, "{}", wanted.len());
        for (found, wanted) in found.iter().zip(&wanted) {
            let (place, rest) = (Vec3::from_slice(found), Vec3::from_slice(&found[4..]));
            let far = (place - wanted.place).length().max((rest - wanted.rest).length());
            assert!(far < 1e-6, "{found:?} instead of {wanted:?}");
        }
    }
}

fn uniform_bytes(of: &AlignedUniform) -> Vec<u8> {
    let mut bytes = encase::UniformBuffer::new(Vec::<u8>::new());
    bytes.write(of).expect("memory takes it");
    bytes.into_inner()
}

fn stored_bytes<T: ShaderType + ShaderSize + WriteInto>(of: &Vec<T>) -> Vec<u8> {
    let mut bytes = encase::StorageBuffer::new(Vec::<u8>::new());
    bytes.write(of).expect("memory takes it");
    bytes.into_inner()
}

/// The deformed volume as slices, against the rays of a volume that was warped voxel by voxel in double precision.
#[test]
fn a_deformed_volume_is_the_warped_one() {
    let size = UVec3::new(80, 64, 48);
    let smooth = |voxel: Vec3| specimen(voxel * 0.5);
    for level in [2, 3] {
        let rest = volume_of(size, DVec3::splat(0.5), smooth);
        let mut lattice = rest.grid().lattice(level).expect("a level that can be");
        waves(&mut lattice, 0.03);
        let warped = rest.warped(&lattice).expect("a volume of the same grid");
        let mut exact = Stage::new(warped, veil());
        exact.look().wet.is_shaded = false;
        let mut stage = Stage::new(rest, veil());
        stage.look().wet.is_shaded = false;
        stage.look().method = VolumeMethod::PatchSlices;
        let volume = stage.volume;
        stage.set(volume, lattice);
        for eye in [EYE, Vec3::new(0.08, 0.04, 0.05), Vec3::new(-0.02, -0.09, 0.03)] {
            for stage in [&mut exact, &mut stage] {
                stage.aim(eye, Vec3::ZERO);
            }
            let likeness = psnr(&stage.shot(), &exact.shot().colour);
            println!("level {level} from {eye}: {likeness:.1} dB");
            assert!(likeness > 35.0, "level {level} from {eye}: {likeness} dB");
        }
    }
}
