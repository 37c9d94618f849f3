//! Rays of a view in a volume's voxels.

use bevy::reflect::Reflect;
use glam::{Affine3A, DAffine3, DVec3, Mat3, Mat4, UVec2, Vec3, Vec4};

/// The rays of all pixels of a view. A ray's voxel coordinates are affine in the view depth: the distance in metres from the
/// camera's plane along its direction of view.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct ViewRays {
    size_px: UVec2,
    /// Voxel coordinates at depth 0: constant part, per unit of clip space along x, along y.
    origin_voxel: [Vec3; 3],
    /// Voxels per metre of depth, in the same three parts.
    along_voxel: [Vec3; 3],
    world_from_voxel: Affine3A,
    world_from_gradient: Mat3,
    middle_depth_m: f32,
    voxel_edge_m: f32,
}

/// The ray of one pixel: voxel coordinates `origin + along * depth`.
#[derive(Clone, Copy, Debug, PartialEq, Reflect)]
pub struct VoxelRay {
    /// Voxel coordinates where the ray crosses the camera's plane.
    pub origin: Vec3,
    /// Voxels per metre of view depth.
    pub along: Vec3,
}

impl VoxelRay {
    /// Voxel coordinates at a view depth.
    pub fn at(&self, depth_m: f32) -> Vec3 {
        self.origin + self.along * depth_m
    }
}

impl ViewRays {
    /// The rays of a camera.
    ///
    /// `clip_from_view` is any perspective or orthographic projection, also off-centre; `world_from_view` is rigid (the camera
    /// looks along -z); `world_from_volume` is the volume's transform. `None` where a matrix has no inverse.
    pub fn new(
        size_px: UVec2,
        clip_from_view: Mat4,
        world_from_view: Affine3A,
        world_from_volume: Affine3A,
        volume_from_voxel: Affine3A,
    ) -> Option<Self> {
        let wide = |affine: Affine3A| DAffine3::from_cols_array(&affine.to_cols_array().map(f64::from));
        let world_from_voxel = wide(world_from_volume) * wide(volume_from_voxel);
        let view_from_world = wide(world_from_view).inverse();
        let voxel_from_view = (view_from_world * world_from_voxel).inverse();
        let p = clip_from_view.as_dmat4();
        // A point (x, y) at depth d has w = w_per_depth d + w_constant and clip_x = scale_x x - skew_x d + shift_x.
        let (w_per_depth, w_constant) = (-p.z_axis.w, p.w_axis.w);
        let (scale_x, scale_y) = (p.x_axis.x, p.y_axis.y);
        let origin_view = [
            DVec3::new(-p.w_axis.x / scale_x, -p.w_axis.y / scale_y, 0.0),
            DVec3::new(w_constant / scale_x, 0.0, 0.0),
            DVec3::new(0.0, w_constant / scale_y, 0.0),
        ];
        let along_view = [
            DVec3::new(p.z_axis.x / scale_x, p.z_axis.y / scale_y, -1.0),
            DVec3::new(w_per_depth / scale_x, 0.0, 0.0),
            DVec3::new(0.0, w_per_depth / scale_y, 0.0),
        ];
        let [constant, by_x, by_y] = origin_view;
        let turned = |vector: DVec3| voxel_from_view.transform_vector3(vector).as_vec3();
        let origin_voxel = [voxel_from_view.transform_point3(constant).as_vec3(), turned(by_x), turned(by_y)];
        let matrix = world_from_voxel.matrix3;
        let edges = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.length());
        let middle = wide(world_from_volume).translation;
        let made = Self {
            size_px,
            origin_voxel,
            along_voxel: along_view.map(turned),
            world_from_voxel: world_from_voxel.as_affine3a(),
            world_from_gradient: matrix.inverse().transpose().as_mat3(),
            middle_depth_m: -view_from_world.transform_point3(middle).z as f32,
            voxel_edge_m: edges.into_iter().fold(f64::INFINITY, f64::min) as f32,
        };
        let is_finite = made.origin_voxel.iter().chain(&made.along_voxel).all(|part| part.is_finite())
            && made.world_from_gradient.is_finite();
        is_finite.then_some(made)
    }

    /// Pixels of the view.
    pub fn size_px(&self) -> UVec2 {
        self.size_px
    }

    /// The ray through the middle of a pixel; rows run downwards.
    pub fn ray(&self, pixel: UVec2) -> VoxelRay {
        let share = (pixel.as_vec2() + 0.5) / self.size_px.as_vec2();
        let (x, y) = (share.x * 2.0 - 1.0, 1.0 - share.y * 2.0);
        let sum = |[constant, by_x, by_y]: [Vec3; 3]| constant + by_x * x + by_y * y;
        VoxelRay { origin: sum(self.origin_voxel), along: sum(self.along_voxel) }
    }

    /// Voxel coordinates to the world in metres.
    pub fn world_from_voxel(&self) -> Affine3A {
        self.world_from_voxel
    }

    /// The unit vector in the world from where a ray goes to the viewer.
    pub fn to_viewer(&self, ray: VoxelRay) -> Vec3 {
        -self.world_from_voxel.transform_vector3(ray.along).normalize_or_zero()
    }

    /// The unit normal in the world, facing the viewer, of a surface with a gradient per voxel (of any length); towards the viewer
    /// where there is no slope.
    pub fn normal_of(&self, ray: VoxelRay, gradient: Vec3) -> Vec3 {
        let normal = self.world_from_gradient * -gradient;
        let to_viewer = self.to_viewer(ray);
        let unit = if normal.length_squared() > 1e-12 { normal.normalize() } else { to_viewer };
        if unit.dot(to_viewer) < 0.0 { -unit } else { unit }
    }

    /// View depth of the volume's middle, metres.
    pub fn middle_depth_m(&self) -> f32 {
        self.middle_depth_m
    }

    /// Shortest edge of a voxel in the world, metres.
    pub fn voxel_edge_m(&self) -> f32 {
        self.voxel_edge_m
    }
}

/// A clip plane of the volume's space (metres, `normal . p + offset >= 0` inside) for voxel coordinates.
pub fn plane_in_voxels(plane: Vec4, volume_from_voxel: &Affine3A) -> Vec4 {
    let normal = plane.truncate();
    let matrix = volume_from_voxel.matrix3;
    let per_voxel = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| normal.dot(axis.into()));
    Vec3::from_array(per_voxel).extend(normal.dot(volume_from_voxel.translation.into()) + plane.w)
}
