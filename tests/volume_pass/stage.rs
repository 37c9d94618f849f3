//! A volume, a camera and lights; what the GPU draws of them, as numbers; and what the CPU works out.

use bevy::camera::{Exposure, Hdr, RenderTarget};
use bevy::core_pipeline::schedule::Core3d;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, MapMode, Origin3d, PollType, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TexelCopyTextureInfo, Texture, TextureAspect, TextureUsages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewDepthTexture, ViewTarget};
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::render::{LightUniform, OrganPasses, Uploads, VolumePasses};
use bevy_surgery::testing::TestApp;
use bevy_surgery::volume::aligned::{PatchPolygons, SliceStack};
use bevy_surgery::volume::cut::{Burr, BurrKind, BurrPose, BurrShape, BurrStroke};
use bevy_surgery::volume::software::{
    AlignedField, IncidentLight, MarchScene, RenderField, ViewRays, VolumeImage, composite_aligned, composite_slices,
    march, plane_in_voxels, shade,
};
use bevy_surgery::volume::structures::Structures;
use bevy_surgery::volume::transfer::{ColourSource, TransferFunction, colours};
use bevy_surgery::volume::{CtVolume, CutVolume, Volume, VolumeLook, VolumeMethod, VolumeRedraws, VoxelLattice};
use half::f16;
use std::f32::consts::PI;

/// Pixels of the picture. A row of them has a multiple of 256 bytes in both textures that are read back.
pub const SIZE_PX: UVec2 = UVec2::new(128, 96);

/// What a view shows: one entry per pixel, row by row from the top.
#[derive(Clone, PartialEq)]
pub struct Shot {
    /// Linear, premultiplied, exposed, before tonemapping; and the opacity.
    pub colour: Vec<[f32; 4]>,
    /// View depth in the depth buffer, metres; infinite where nothing wrote any.
    pub depth_m: Vec<f32>,
}

/// What the CPU works out for the same view.
pub struct Twin {
    pub image: VolumeImage,
    /// As [`Shot::colour`].
    pub colour: Vec<[f32; 4]>,
}

/// Copies of the textures of the only HDR camera, as they are between volumes and organs.
#[derive(Resource, Default)]
struct Probe(Option<[Buffer; 2]>);

fn probe(
    view: ViewQuery<(&ExtractedCamera, &ViewTarget, &ViewDepthTexture, &Msaa)>,
    mut probe: ResMut<Probe>,
    mut ctx: RenderContext,
) {
    let (camera, target, depth, msaa) = view.into_inner();
    if !camera.hdr || *msaa != Msaa::Off || camera.physical_target_size != Some(SIZE_PX) {
        return;
    }
    let mut copy = |texture: &Texture, aspect, bytes_per_texel: u32| {
        let bytes_per_row = SIZE_PX.x * bytes_per_texel;
        let buffer = ctx.render_device().create_buffer(&BufferDescriptor {
            label: Some("probe"),
            size: u64::from(bytes_per_row * SIZE_PX.y),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        ctx.command_encoder().copy_texture_to_buffer(
            TexelCopyTextureInfo { texture, mip_level: 0, origin: Origin3d::ZERO, aspect },
            TexelCopyBufferInfo {
                buffer: &buffer,
                layout: TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(bytes_per_row),
                    rows_per_image: Some(SIZE_PX.y),
                },
            },
            Extent3d { width: SIZE_PX.x, height: SIZE_PX.y, depth_or_array_layers: 1 },
        );
        buffer
    };
    let colour = copy(target.main_texture(), TextureAspect::All, 8);
    let depth = copy(&depth.texture, TextureAspect::DepthOnly, 4);
    probe.0 = Some([colour, depth]);
}

fn read(device: &RenderDevice, buffer: &Buffer) -> Vec<u8> {
    buffer.slice(..).map_async(MapMode::Read, |result| result.expect("the buffer can be read"));
    device.poll(PollType::wait_indefinitely()).expect("the device answers");
    buffer.slice(..).get_mapped_range().to_vec()
}

/// A volume in front of a camera.
pub struct Stage {
    pub app: TestApp,
    pub camera: Entity,
    pub volume: Entity,
    pub lights: Vec<LightUniform>,
}

/// Where the camera is unless a test says otherwise.
pub const EYE: Vec3 = Vec3::new(0.02, 0.03, 0.09);

impl Stage {
    /// A volume in its middle, seen from [`EYE`], under two lights; nothing behind it.
    pub fn new(volume: Volume, transfer: TransferFunction) -> Self {
        Self::with(volume, transfer, |_| {})
    }

    /// The same with Bevy's materials beside it.
    pub fn with_materials(volume: Volume, transfer: TransferFunction) -> Self {
        Self::with(volume, transfer, |app| {
            app.add_plugins(PbrPlugin::default());
        })
    }

    fn with(volume: Volume, transfer: TransferFunction, add_plugins: impl FnOnce(&mut App)) -> Self {
        let mut app = TestApp::gpu_with(SIZE_PX.x, SIZE_PX.y, add_plugins);
        let render_app = app.sub_app_mut(RenderApp);
        render_app.init_resource::<Probe>().add_systems(Core3d, probe.after(VolumePasses).before(OrganPasses::Skin));
        app.insert_resource(ClearColor(Color::NONE)).insert_resource(GlobalAmbientLight::NONE);
        let usages = TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
        let target = RenderTarget::Image(app.target().image.into());
        let place = Transform::from_translation(EYE).looking_at(Vec3::ZERO, Vec3::Y);
        let camera = Camera3d { depth_texture_usages: usages.into(), ..default() };
        let camera = app.world_mut().spawn((camera, target, lens(), Hdr, Tonemapping::None, Msaa::Off, place)).id();
        let volume = add_volume(&mut app, volume, transfer);
        let mut stage = Self { app, camera, volume, lights: Vec::new() };
        stage.add_sun(Vec3::new(-0.3, -0.5, -1.0), 2500.0);
        stage.add_bulb(Vec3::new(0.05, 0.01, 0.06), 1.5);
        stage
    }

    pub fn add_sun(&mut self, direction: Vec3, illuminance: f32) {
        let place = Transform::default().looking_to(direction, Vec3::Y);
        self.app.world_mut().spawn((DirectionalLight { illuminance, ..default() }, place));
        self.lights.push(LightUniform {
            colour: Vec3::splat(illuminance),
            kind: LightUniform::DIRECTIONAL,
            direction_world: place.forward().into(),
            ..default()
        });
    }

    fn add_bulb(&mut self, position_world_m: Vec3, candela: f32) {
        let bulb = PointLight { intensity: candela * 4.0 * PI, range: 20.0, ..default() };
        self.app.world_mut().spawn((bulb, Transform::from_translation(position_world_m)));
        self.lights.push(LightUniform {
            colour: Vec3::splat(candela),
            kind: LightUniform::POINT,
            position_world_m,
            inverse_range_squared: 1.0 / 400.0,
            ..default()
        });
    }

    pub fn set<C: Component>(&mut self, entity: Entity, component: C) {
        self.app.world_mut().entity_mut(entity).insert(component);
    }

    pub fn look(&mut self) -> Mut<'_, VolumeLook> {
        self.app.world_mut().get_mut::<VolumeLook>(self.volume).expect("it comes with the volume")
    }

    /// Looks at a place.
    pub fn aim(&mut self, eye: Vec3, at: Vec3) {
        let camera = self.camera;
        self.set(camera, Transform::from_translation(eye).looking_at(at, Vec3::Y));
    }

    /// Drills along a line of the volume's space, deep enough to leave a hole.
    pub fn drill(&mut self, from_m: Vec3, to_m: Vec3, diameter_m: f32) {
        self.app.warm_up();
        let source = self.source();
        let structures = super::one_structure(&source);
        let mut cut = self.app.world_mut().get_mut::<CutVolume>(self.volume).expect("it was warmed up");
        drill(&mut cut, &source, &structures, from_m, to_m, diameter_m);
    }

    pub fn cut(&mut self) -> Mut<'_, CutVolume> {
        self.app.world_mut().get_mut::<CutVolume>(self.volume).expect("it was warmed up")
    }

    pub fn source(&self) -> Volume {
        let world = self.app.world();
        let handle = &world.get::<CtVolume>(self.volume).expect("a volume").0;
        world.resource::<Assets<Volume>>().get(handle).expect("it is loaded").clone()
    }

    /// What the GPU draws, once everything is there.
    pub fn shot(&mut self) -> Shot {
        self.app.warm_up();
        self.next_shot()
    }

    /// What the GPU draws in the next frame.
    pub fn next_shot(&mut self) -> Shot {
        self.app.sub_app_mut(RenderApp).world_mut().resource_mut::<Probe>().0 = None;
        self.app.idle();
        let render_world = self.app.sub_app(RenderApp).world();
        let [colour, depth] = render_world.resource::<Probe>().0.as_ref().expect("the camera drew");
        let device = self.app.world().resource::<RenderDevice>();
        let colour = read(device, colour);
        let depth = read(device, depth);
        let halves: Vec<f32> = colour.chunks(2).map(|half| f16::from_le_bytes([half[0], half[1]]).to_f32()).collect();
        let clip = self.clip_from_view();
        let depth_m = depth.chunks(4).map(|number| {
            let z = f32::from_le_bytes([number[0], number[1], number[2], number[3]]);
            let depth_m = (clip.w_axis.z - z * clip.w_axis.w) / (clip.z_axis.z - z * clip.z_axis.w);
            if z > 0.0 { depth_m } else { f32::INFINITY }
        });
        Shot {
            colour: halves.chunks(4).map(|texel| [texel[0], texel[1], texel[2], texel[3]]).collect(),
            depth_m: depth_m.collect(),
        }
    }

    /// Pixels whose rays were walked, and that were shaded, in the next frame.
    pub fn redrawn(&mut self) -> [u64; 2] {
        self.app.idle();
        let redraws = self.app.sub_app(RenderApp).world().resource::<VolumeRedraws>();
        [redraws.walked_px(), redraws.shaded_px()]
    }

    /// Bytes that went to the GPU in the last frame.
    pub fn uploaded(&self) -> u64 {
        self.app.sub_app(RenderApp).world().resource::<Uploads>().bytes()
    }

    pub fn clip_from_view(&self) -> Mat4 {
        self.app.world().get::<Camera>(self.camera).expect("a camera").clip_from_view()
    }

    /// The rays of the view.
    pub fn rays(&self, moved: Vec3) -> ViewRays {
        let world = self.app.world();
        let place = |entity| world.get::<GlobalTransform>(entity).expect("it is placed").affine();
        let world_from_volume = bevy::math::Affine3A::from_translation(moved) * place(self.volume);
        let volume_from_voxel = self.source().grid().volume_from_voxel();
        ViewRays::new(SIZE_PX, self.clip_from_view(), place(self.camera), world_from_volume, volume_from_voxel)
            .expect("a camera and a volume that are not flat")
    }

    /// What the CPU works out.
    pub fn twin(&self) -> Twin {
        self.twin_moved(Vec3::ZERO)
    }

    /// The same with the volume somewhere else.
    pub fn twin_moved(&self, by: Vec3) -> Twin {
        self.twin_before(by, None)
    }

    /// The same in front of an opaque scene.
    pub fn twin_before(&self, moved: Vec3, scene_depth_m: Option<&[f32]>) -> Twin {
        let world = self.app.world();
        let (volume, rays) = (self.source(), self.rays(moved));
        let transfer = world.get::<TransferFunction>(self.volume).expect("it came with the volume");
        let look = world.get::<VolumeLook>(self.volume).expect("it comes with the volume");
        let cut = world.get::<CutVolume>(self.volume).expect("it was warmed up");
        let mut field = RenderField::new(&volume);
        if transfer.colour_source == ColourSource::Voxels {
            let colours = colours(&volume, volume.structures().map(AsRef::as_ref));
            field = field.with_colours(colours).expect("one for each voxel");
        }
        field.cut(volume.grid().bounds(), |of, into| cut.copy_remaining(of, into));
        let step_voxels = look.sane_step_voxels();
        let step_m = f64::from(step_voxels) * volume.grid().spacing_mm().min_element() * 1e-3;
        let table = transfer.bake(volume.range(), step_m);
        let volume_from_voxel = volume.grid().volume_from_voxel();
        let planes: Vec<Vec4> =
            look.clip_planes.iter().map(|plane| plane_in_voxels(*plane, &volume_from_voxel)).collect();
        let clip = self.clip_from_view();
        let lattice = world.get::<DeformLattice>(self.volume);
        let lattice = lattice.map(|lattice| {
            let field = VoxelLattice::new(lattice, volume.grid());
            field.with_normals(look.deformed_normals, lattice, volume.grid())
        });
        let scene = MarchScene {
            field: &field,
            lattice: lattice.as_ref(),
            table: table.entries(),
            distances: None,
            step_m: step_voxels * rays.voxel_edge_m(),
            near_m: (clip.w_axis.z - clip.w_axis.w) / (clip.z_axis.z - clip.z_axis.w),
            clip_planes: &planes,
            scene_depth_m,
        };
        let image = match look.method {
            VolumeMethod::Rays => march(&rays, &scene),
            VolumeMethod::Slices => composite_slices(&rays, &scene),
            VolumeMethod::PatchSlices => self.twin_aligned(&rays, &scene),
        };
        let (exposure, lights) = (Exposure::default().exposure(), &self.lights);
        let mut colour = shade(&image, &rays, &look.wet, Vec3::ZERO, |at, arriving| {
            arriving.extend(lights.iter().map(|light| IncidentLight {
                to_light: match light.kind {
                    LightUniform::DIRECTIONAL => -light.direction_world,
                    _ => (light.position_world_m - at).normalize(),
                },
                illuminance_lux: light.illuminance_lux(at) * exposure,
                ambient_fraction: light.ambient_fraction,
            }));
        });
        if !look.wet.is_shaded {
            colour.clone_from(&image.colour);
        }
        Twin { image, colour }
    }
}

impl Stage {
    /// Shares of the box of the volume's lattice, or of all voxels where it has none, to voxel coordinates; and the lattice.
    pub fn lattice(&self) -> (bevy::math::Affine3A, DeformLattice) {
        let source = self.source();
        let grid = source.grid();
        let none = || grid.lattice(0).expect("a level that can be");
        let lattice = self.app.world().get::<DeformLattice>(self.volume).cloned().unwrap_or_else(none);
        (grid.volume_from_voxel().inverse() * lattice.body_from_box(), lattice)
    }

    /// The slices that a view through the middle of the picture takes.
    pub fn stack(&self, rays: &ViewRays, step_m: f32, margin: f32) -> SliceStack {
        let (voxel_from_box, _) = self.lattice();
        let world_from_box = rays.world_from_voxel() * voxel_from_box;
        let along = voxel_from_box.inverse().transform_vector3(rays.ray(SIZE_PX / 2).along);
        let box_from_world = world_from_box.inverse().matrix3.into();
        SliceStack::new(along, box_from_world, step_m, Vec3::splat(-margin), Vec3::splat(1.0 + margin))
    }

    fn twin_aligned(&self, rays: &ViewRays, scene: &MarchScene) -> VolumeImage {
        let (voxel_from_box, lattice) = self.lattice();
        let translations = lattice.translations();
        let on_sides = (0..translations.len()).filter(|vertex| lattice.tree().is_on_side(*vertex));
        let reach = on_sides.map(|vertex| translations[vertex].abs().max_element()).fold(0.0, f32::max);
        let margin = (reach * 16.0).ceil() / 16.0;
        let polygons = PatchPolygons::new(lattice.tree(), margin);
        let stack = self.stack(rays, scene.step_m, margin);
        composite_aligned(rays, scene, &AlignedField { polygons: &polygons, translations, voxel_from_box, stack })
    }
}

/// The lens of the camera.
pub fn lens() -> Projection {
    Projection::Perspective(PerspectiveProjection { fov: 0.5, near: 0.005, ..default() })
}

pub fn add_volume(app: &mut TestApp, volume: Volume, transfer: TransferFunction) -> Entity {
    let volume = app.world_mut().resource_mut::<Assets<Volume>>().add(volume);
    app.world_mut().spawn((CtVolume(volume), transfer)).id()
}

/// Drills along a line of the volume's space.
pub fn drill(cut: &mut CutVolume, volume: &Volume, structures: &Structures, from_m: Vec3, to_m: Vec3, diameter_m: f32) {
    let burr = Burr { kind: BurrKind::Cutting, shape: BurrShape::Sphere, diameter_m };
    let pose = |centre_m| BurrPose { centre_m, axis: Vec3::Y };
    let steps = 8;
    cut.begin_stroke();
    let mut removed_mm3 = 0.0;
    for k in 0..steps {
        let at = |k: i32| pose(from_m.lerp(to_m, k as f32 / steps as f32));
        let stroke = BurrStroke { burr, from: at(k), to: at(k + 1), force_n: 1000.0, speed_rpm: 40_000.0 };
        removed_mm3 += cut.drill(volume, structures, &stroke, 0.2).total_mm3;
    }
    assert!(removed_mm3 > 0.0, "the burr took nothing");
}

/// How unlike two pictures are.
#[derive(Debug)]
pub struct Difference {
    /// Pixels that either shows.
    pub covered: usize,
    /// Mean difference of a channel, opacity among them, over these.
    pub mean: f32,
    /// Share of these in which a channel differs by more than 0.04.
    pub share_off: f32,
    /// Share of these that only one of them lets write depth.
    pub share_of_masks: f32,
    /// Median and 98th percentile of the difference in depth, in lengths of a voxel's shortest edge.
    pub depth_voxels: [f32; 2],
}

impl Difference {
    /// Between what the GPU draws and what the CPU works out.
    pub fn between(shot: &Shot, twin: &Twin, voxel_edge_m: f32) -> Self {
        let (mut covered, mut sum, mut off, mut masks) = (0, 0.0, 0, 0);
        let mut depths = Vec::new();
        for (place, (gpu, cpu)) in shot.colour.iter().zip(&twin.colour).enumerate() {
            if gpu[3] < 1.0 / 255.0 && cpu[3] < 1.0 / 255.0 {
                continue;
            }
            covered += 1;
            let differences: [f32; 4] = std::array::from_fn(|channel| (gpu[channel] - cpu[channel]).abs());
            sum += differences.iter().sum::<f32>() / 4.0;
            off += usize::from(differences.iter().any(|difference| difference.is_nan() || *difference >= 0.04));
            match (shot.depth_m[place].is_finite(), cpu[3] >= 0.5) {
                (true, true) => depths.push((shot.depth_m[place] - twin.image.depth_m[place]).abs() / voxel_edge_m),
                (false, false) => {}
                _ => masks += 1,
            }
        }
        depths.sort_by(f32::total_cmp);
        let depth = |share: usize| depths.get(depths.len() * share / 100).copied().unwrap_or_default();
        let share = |of: usize| of as f32 / covered.max(1) as f32;
        Self {
            covered,
            mean: sum / covered.max(1) as f32,
            share_off: share(off),
            share_of_masks: share(masks),
            depth_voxels: [depth(50), depth(98)],
        }
    }

    /// Whether a tenth of a voxel or some colour is wrong.
    pub fn is_small(&self) -> bool {
        self.mean < 0.004
            && self.share_off < 0.01
            && self.share_of_masks < 0.01
            && self.depth_voxels[0] < 0.05
            && self.depth_voxels[1] < 0.5
    }
}
