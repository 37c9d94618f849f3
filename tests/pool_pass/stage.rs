//! A pool of 8 x 8 cm in the plane `z = LEVEL_M`, what stands in it, and a camera.

use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::GlobalAmbientLight;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy_surgery::pool::software::PoolMixture;
use bevy_surgery::pool::{PoolGrid, PoolLook, PoolSurface, WetMask};
use bevy_surgery::testing::TestApp;
use half::f16;

/// Height of the surface, metres.
pub const LEVEL_M: f32 = 5e-3;

pub struct Stage {
    pub app: TestApp,
    pub camera: Entity,
    pub pool: Entity,
}

impl Stage {
    /// No floor and no light yet.
    pub fn new(width: u32, height: u32) -> Self {
        let mut app = TestApp::gpu_with(width, height, |app| {
            app.add_plugins(PbrPlugin::default());
        });
        app.insert_resource(ClearColor(Color::BLACK)).insert_resource(GlobalAmbientLight::NONE);
        let camera = app.spawn_camera(Transform::from_xyz(0.01, -0.03, 0.06).looking_at(Vec3::ZERO, Vec3::Z));
        let lens = PerspectiveProjection { fov: 0.4, near: 0.001, ..default() };
        app.world_mut().entity_mut(camera).insert((Projection::Perspective(lens), Tonemapping::None));
        let grid = PoolGrid::new(UVec2::splat(200), 4e-4).expect("a good grid");
        let surface = PoolSurface::calm(grid, LEVEL_M, &WetMask::from_fn(&grid, |_| true));
        let pool = app.world_mut().spawn(surface).id();
        Self { app, camera, pool }
    }

    pub fn add_box(&mut self, middle: Vec3, size: Vec3, [r, g, b]: [u8; 3]) -> Entity {
        let world = self.app.world_mut();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::from_size(size));
        let material = StandardMaterial { base_color: Color::srgb_u8(r, g, b), unlit: true, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        world.spawn((Mesh3d(mesh), MeshMaterial3d(material), Transform::from_translation(middle))).id()
    }

    /// Its upper side is the plane `z = 0`.
    pub fn add_floor(&mut self, colour: [u8; 3]) {
        self.add_box(Vec3::new(0.0, 0.0, -0.01), Vec3::new(0.4, 0.4, 0.02), colour);
    }

    pub fn look(&mut self) -> Mut<'_, PoolLook> {
        self.app.world_mut().get_mut(self.pool).expect("it comes with the surface")
    }

    pub fn change_surface(&mut self, change: impl FnOnce(&mut PoolSurface)) {
        let mut surface = self.app.world_mut().get_mut::<PoolSurface>(self.pool).expect("a surface");
        change(&mut surface);
        surface.revision += 1;
    }

    /// Looks at the origin.
    pub fn aim(&mut self, eye: Vec3) {
        let up = if eye.truncate().length() < 1e-6 { Vec3::Y } else { Vec3::Z };
        self.app
            .world_mut()
            .entity_mut(self.camera)
            .insert(Transform::from_translation(eye).looking_at(Vec3::ZERO, up));
    }

    /// Where the ray of a place in the picture begins, and its direction.
    pub fn ray(&self, pixel: Vec2) -> (Vec3, Vec3) {
        let camera = self.app.world().entity(self.camera);
        let (camera, place) = (camera.get::<Camera>().expect("a camera"), camera.get::<GlobalTransform>());
        let ray = camera.viewport_to_world(place.expect("it is placed"), pixel).expect("a ray");
        (ray.origin, *ray.direction)
    }
}

pub fn linear([r, g, b]: [u8; 3]) -> Vec3 {
    Color::srgb_u8(r, g, b).to_linear().to_vec3()
}

pub fn channels(pixel: &image::Rgba<u8>) -> Vec3 {
    Vec3::new(f32::from(pixel.0[0]), f32::from(pixel.0[1]), f32::from(pixel.0[2]))
}

/// The same in every cell.
pub fn set_all(surface: &mut PoolSurface, height_mm: f32, mixture: PoolMixture) {
    surface.texels.fill([height_mm, mixture.blood, mixture.dust, 1.0].map(|number| f16::from_f32(number).to_bits()));
}
