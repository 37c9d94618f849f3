//! Drops against closed forms: walking straight, sliding, falling off, merging.

use super::organ_chart::{random_point, read};
use bevy_surgery::organ::atlas::{Atlas, FaceTable};
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::organ::planar::PlanarChart;
use bevy_surgery::organ::procedural::{ProceduralLiver, procedural_liver};
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::organ::sphere::{SphereMesh, SurfacePoint};
use bevy_surgery::organ::surface::Surface;
use bevy_surgery::reactions::drops::{
    DropCollisions, DropFate, DropHead, DropSettings, Walk, WalkError, WalkStop, walk,
};
use bevy_surgery::reactions::kind::KindId;
use bevy_surgery::reactions::snake::{Snake, Sprite};
use glam::{DQuat, DVec3, Vec2, Vec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

const GRAVITY: f64 = 9.81;
const DOWN: DVec3 = DVec3::new(0.0, -GRAVITY, 0.0);

/// A surface that owns what it is made of.
struct Stage {
    atlas: Atlas,
    table: FaceTable,
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
}

impl Stage {
    fn new(mesh: &SurfaceMesh, atlas: Atlas) -> Self {
        let (positions_m, normals) = (mesh.positions_m.clone(), mesh.vertex_normals());
        Self { atlas, table: FaceTable::default(), positions_m, normals }
    }

    /// A surface round the origin, seen from there.
    fn star_shaped(mesh: &SurfaceMesh) -> Self {
        let directions = mesh.positions_m.iter().map(|p| p.as_dvec3().normalize()).collect();
        Self::new(mesh, Atlas::Spherical(SphereMesh::new(directions, mesh.triangles.clone())))
    }

    fn surface(&self) -> Surface<'_> {
        Surface { atlas: &self.atlas, table: &self.table, positions_m: &self.positions_m, normals: &self.normals }
    }

    fn faces(&self) -> u32 {
        self.atlas.chart().triangles.len() as u32
    }

    /// Where a star-shaped surface shows a direction.
    fn towards(&self, direction: DVec3) -> SurfacePoint {
        self.atlas.chart().locate(0, direction.normalize())
    }

    fn position_m(&self, point: SurfacePoint) -> DVec3 {
        self.surface().position_m(point)
    }
}

const PLANE_SIDE_M: f64 = 4.0;

/// A plane of `n * n` cells of two faces, some corners moved within it, turned from facing +Z.
fn plane(n: u32, turn: DQuat) -> Stage {
    let mut rng = Pcg32::seed_from_u64(3);
    let side = n + 1;
    let uvs: Vec<Vec2> = (0..side * side)
        .map(|k| {
            let (i, j) = (k % side, k / side);
            let inner = |i: u32| if i > 0 && i < n { 0.2 } else { 0.0 };
            let jitter = [rng.random_range(-1.0..1.0f32) * inner(i), rng.random_range(-1.0..1.0f32) * inner(j)];
            (Vec2::new(i as f32, j as f32) + Vec2::from(jitter)) / n as f32
        })
        .collect();
    let place = |uv: &Vec2| (turn * ((uv.as_dvec2() - 0.5) * PLANE_SIDE_M).extend(0.0)).as_vec3();
    let positions_m = uvs.iter().map(place).collect();
    let triangles = (0..n * n)
        .flat_map(|k| {
            let a = k / n * side + k % n;
            [[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]
        })
        .collect();
    let mesh = SurfaceMesh { positions_m, triangles, uvs: Some(uvs) };
    Stage::new(&mesh, Atlas::Planar(PlanarChart::new(&mesh).unwrap()))
}

/// The place of a plane that lies this way from its middle, before it was turned.
fn on_plane(stage: &Stage, x_m: f64, y_m: f64) -> SurfacePoint {
    let uv = glam::DVec2::new(x_m, y_m) / PLANE_SIDE_M + 0.5;
    stage.atlas.locate_uv(uv, &stage.table).unwrap()
}

const SPHERE_RADIUS_M: f64 = 0.1;

static SPHERE: LazyLock<Stage> =
    LazyLock::new(|| Stage::star_shaped(&procedural_ellipsoid(Vec3::splat(SPHERE_RADIUS_M as f32), 32)));

static LIVER: LazyLock<Stage> = LazyLock::new(|| charted(&procedural_liver(&ProceduralLiver::default())));

static REAL_LIVER: LazyLock<Option<Stage>> = LazyLock::new(|| {
    let options = LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..Default::default() };
    read("liver-smooth.obj", &options).map(|mesh| charted(&mesh))
});

fn charted(mesh: &SurfaceMesh) -> Stage {
    let (sphere, _) = chart::build(mesh, &ChartOptions::default()).unwrap();
    Stage::new(mesh, Atlas::Spherical(sphere))
}

/// The livers that there are: the crate's own, and the real one where its file is present.
fn livers() -> Vec<&'static Stage> {
    std::iter::once(&*LIVER).chain(REAL_LIVER.as_ref()).collect()
}

/// Drops that nothing holds: no retention, no adhesion, and this friction at any size that [`round`] makes.
fn slippery(friction_per_s: f64) -> DropSettings {
    DropSettings {
        friction_at_1_mm_per_s: friction_per_s,
        retention_at_1_mm_m_per_s2: 0.0,
        adhesion_n_per_m: 0.0,
        ..Default::default()
    }
}

/// A drop at rest with a radius of a millimetre.
fn round(settings: &DropSettings, point: SurfacePoint) -> DropHead {
    DropHead { point, velocity_m_per_s: DVec3::ZERO, volume_m3: settings.volume_m3(1e-3) }
}

fn assert_is_place(stage: &Stage, point: SurfacePoint) {
    let w = point.barycentric;
    assert!(point.face < stage.faces());
    assert!(w.min_element() >= 0.0 && w.max_element() <= 1.0 && (w.element_sum() - 1.0).abs() < 1e-15, "{point:?}");
    let uv = stage.atlas.uv(point);
    assert!((0.0..=1.0).contains(&uv.x) && (0.0..=1.0).contains(&uv.y), "{uv}");
}

#[path = "reactions_drops/merging.rs"]
mod merging;
#[path = "reactions_drops/sliding.rs"]
mod sliding;
#[path = "reactions_drops/walking.rs"]
mod walking;
