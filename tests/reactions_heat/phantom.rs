//! Surfaces to heat, and tools to heat them with.

use crate::organ_chart::read;
use bevy_surgery::organ::atlas::{Atlas, FaceTable};
use bevy_surgery::organ::chart::{self, ChartOptions};
use bevy_surgery::organ::load::{LoadOptions, MeshUnit};
use bevy_surgery::organ::mesh::SurfaceMesh;
use bevy_surgery::organ::planar::PlanarChart;
use bevy_surgery::organ::procedural_ellipsoid;
use bevy_surgery::organ::surface::Surface;
use bevy_surgery::reactions::burn::Cautery;
use bevy_surgery::reactions::heat::{HeatMap, HeatSettings};
use bevy_surgery::reactions::texels::MapSize;
use glam::{DMat3, DVec2, DVec3, Vec2, Vec3};
use std::sync::OnceLock;

pub(super) const STEP_S: f64 = 1.0 / 60.0;

/// No cooling, and heat followed down to a ten-thousandth of a kelvin.
pub(super) fn lossless() -> HeatSettings {
    HeatSettings { cooling_time_s: f64::INFINITY, cold_rise_k: 1e-4, ceiling_rise_k: 2000.0, ..Default::default() }
}

/// A surface at rest with its chart.
pub(super) struct Phantom {
    pub(super) atlas: Atlas,
    pub(super) table: FaceTable,
    pub(super) positions_m: Vec<Vec3>,
    pub(super) normals: Vec<Vec3>,
    pub(super) size: MapSize,
}

impl Phantom {
    pub(super) fn new(mesh: &SurfaceMesh, atlas: Atlas, size: MapSize) -> Self {
        let table = atlas.table(size.width_px, size.height_px);
        Self { atlas, table, positions_m: mesh.positions_m.clone(), normals: mesh.vertex_normals(), size }
    }

    /// A parallelogram spanned by two vectors, `u` along the first.
    pub(super) fn plane(side_u_m: Vec2, side_v_m: Vec2, size: MapSize) -> Self {
        let n = 6u32;
        let uvs: Vec<Vec2> =
            (0..=n).flat_map(|j| (0..=n).map(move |i| Vec2::new(i as f32, j as f32) / n as f32)).collect();
        let positions_m = uvs.iter().map(|uv| (side_u_m * uv.x + side_v_m * uv.y).extend(0.0)).collect();
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let triangles = (0..n)
            .flat_map(|j| (0..n).map(move |i| (i, j)))
            .flat_map(|(i, j)| {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let mesh = SurfaceMesh { positions_m, triangles, uvs: Some(uvs) };
        let chart = PlanarChart::new(&mesh).expect("a plane is a chart of itself");
        Self::new(&mesh, Atlas::Planar(chart), size)
    }

    /// A plane with square texels of this size, 256 x 128.
    pub(super) fn grid(texel_m: f32) -> Self {
        let size = MapSize::from_width(256);
        Self::plane(Vec2::new(256.0 * texel_m, 0.0), Vec2::new(0.0, 128.0 * texel_m), size)
    }

    pub(super) fn spherical(mesh: &SurfaceMesh, width_px: u32) -> Self {
        let (chart, _) = chart::build(mesh, &ChartOptions::default()).expect("a closed surface of genus 0");
        Self::new(mesh, Atlas::Spherical(chart), MapSize::from_width(width_px))
    }

    pub(super) fn ellipsoid(width_px: u32) -> Self {
        Self::spherical(&procedural_ellipsoid(Vec3::new(0.06, 0.04, 0.05), 12), width_px)
    }

    pub(super) fn surface(&self) -> Surface<'_> {
        Surface { atlas: &self.atlas, table: &self.table, positions_m: &self.positions_m, normals: &self.normals }
    }

    pub(super) fn uv(&self, x: u32, y: u32) -> DVec2 {
        self.table.centre_uv(x, y)
    }

    pub(super) fn position_m(&self, uv: DVec2) -> DVec3 {
        let point = self.atlas.locate_uv(uv, &self.table).expect("a place on the surface");
        self.surface().position_m(point)
    }

    pub(super) fn area_m2(&self, x: u32, y: u32) -> f64 {
        let point = self.atlas.locate_uv(self.uv(x, y), &self.table).expect("a place on the surface");
        self.surface().frame(point).texel_area_m2(self.size.width_px, self.size.height_px)
    }

    pub(super) fn texels(&self) -> impl Iterator<Item = (u32, u32)> + use<> {
        let size = self.size;
        (0..size.height_px).flat_map(move |y| (0..size.width_px).map(move |x| (x, y)))
    }

    /// Texels within a radius about a place, weighted by what a function makes of distance over radius.
    pub(super) fn spot(&self, centre: DVec2, radius_m: f64, weight: impl Fn(f32) -> f32) -> Vec<(u32, u32, f32)> {
        let point = self.atlas.locate_uv(centre, &self.table).expect("a place on the surface");
        let frame = self.surface().frame(point);
        let reach = |per_unit: f64, count: u32| (1.5 * radius_m / per_unit * f64::from(count)).ceil() as i64 + 1;
        // A generous box; about the poles the whole rows.
        let reach_y = reach(frame.dposition_dv_m.length(), self.size.height_px);
        let (width, height) = (i64::from(self.size.width_px), i64::from(self.size.height_px));
        let (middle_x, middle_y) = ((centre.x * width as f64) as i64, (centre.y * height as f64) as i64);
        let is_at_pole = self.atlas.is_spherical() && (middle_y < 2 * reach_y || middle_y >= height - 2 * reach_y);
        let reach_x = if is_at_pole {
            width / 2
        } else {
            reach(frame.dposition_du_m.length(), self.size.width_px).min(width / 2)
        };
        let rows = (middle_y - reach_y).max(0)..=(middle_y + reach_y).min(height - 1);
        rows.flat_map(|y| (middle_x - reach_x..middle_x + reach_x).map(move |x| (x, y)))
            .filter(|&(x, _)| self.atlas.is_spherical() || (0..width).contains(&x))
            .filter_map(|(x, y)| {
                let (x, y) = (x.rem_euclid(width) as u32, y as u32);
                let distance_m = self.position_m(self.uv(x, y)).distance(frame.position_m);
                (distance_m <= radius_m).then(|| (x, y, weight((distance_m / radius_m) as f32)))
            })
            .collect()
    }

    /// A Gaussian of this deviation, cut off at six of them.
    pub(super) fn gaussian(&self, centre: DVec2, deviation_m: f64) -> Vec<(u32, u32, f32)> {
        self.spot(centre, 6.0 * deviation_m, |share| (-0.5 * (6.0 * share).powi(2)).exp())
    }

    /// Heat, mean place and covariance (m2) of the temperatures, with areas from the chart's frames.
    pub(super) fn moments(&self, heat: &HeatMap) -> (f64, DVec3, DMat3) {
        let warm: Vec<(f64, DVec3)> = self
            .texels()
            .filter(|&(x, y)| heat.temperature_rise_k(x, y) > 0.0)
            .map(|(x, y)| {
                let amount = f64::from(heat.temperature_rise_k(x, y)) * self.area_m2(x, y);
                (amount, self.position_m(self.uv(x, y)))
            })
            .collect();
        let total: f64 = warm.iter().map(|(amount, _)| amount).sum();
        let mean = warm.iter().map(|&(amount, place)| place * amount).sum::<DVec3>() / total;
        let mut covariance = DMat3::ZERO;
        for (amount, place) in warm {
            let d = place - mean;
            covariance += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * (amount / total);
        }
        (total * heat.settings().areal_capacity_j_per_m2_k(), mean, covariance)
    }

    /// Runs a unit from place to place at a speed in m/s, sixty steps a second; the map goes on meanwhile.
    pub(super) fn pass(&self, heat: &mut HeatMap, unit: &Cautery, from: DVec2, to: DVec2, speed_m_per_s: f64) {
        let samples: Vec<DVec2> = (0..=200).map(|k| from.lerp(to, f64::from(k) / 200.0)).collect();
        let length_m: f64 =
            samples.windows(2).map(|pair| self.position_m(pair[0]).distance(self.position_m(pair[1]))).sum();
        let steps = (length_m / speed_m_per_s / STEP_S).round() as u32;
        for step in 0..steps {
            let uv = from.lerp(to, (f64::from(step) + 0.5) / f64::from(steps));
            self.hold(heat, unit, uv, 1);
        }
    }

    pub(super) fn hold(&self, heat: &mut HeatMap, unit: &Cautery, uv: DVec2, steps: u32) {
        let texels = self.spot(uv, unit.heat_radius_m(), Cautery::weight);
        for _ in 0..steps {
            heat.deposit(&self.surface(), &texels, unit.heat_j(STEP_S));
            heat.step(&self.surface(), STEP_S);
        }
    }

    pub(super) fn rest(&self, heat: &mut HeatMap, seconds: f64) {
        for _ in 0..(seconds / STEP_S).round() as u32 {
            heat.step(&self.surface(), STEP_S);
        }
    }

    pub(super) fn dose_at(&self, heat: &HeatMap, uv: DVec2) -> f32 {
        let (x, y) = self.table.texel(uv);
        heat.dose(x, y)
    }

    /// The greatest dose within a distance.
    pub(super) fn peak_dose(&self, heat: &HeatMap, uv: DVec2, radius_m: f64) -> f32 {
        self.spot(uv, radius_m, |_| 1.0).iter().map(|&(x, y, _)| heat.dose(x, y)).fold(0.0, f32::max)
    }

    /// Texture coordinates at a distance in metres along `u` and `v` from others.
    pub(super) fn beside(&self, uv: DVec2, offset_m: DVec2) -> DVec2 {
        let point = self.atlas.locate_uv(uv, &self.table).expect("a place on the surface");
        let frame = self.surface().frame(point);
        uv + offset_m / DVec2::new(frame.dposition_du_m.length(), frame.dposition_dv_m.length())
    }
}

pub(super) fn sphere() -> &'static Phantom {
    static SPHERE: OnceLock<Phantom> = OnceLock::new();
    SPHERE.get_or_init(|| Phantom::spherical(&procedural_ellipsoid(Vec3::splat(0.05), 24), 512))
}

pub(super) fn real_organ(name: &str, width_px: u32) -> Option<Phantom> {
    let mesh = read(name, &LoadOptions { unit: MeshUnit::LargestExtent(0.2), ..Default::default() })?;
    Some(Phantom::spherical(&mesh, width_px))
}

pub(super) fn all_doses(phantom: &Phantom, heat: &HeatMap) -> Vec<f32> {
    phantom.texels().map(|(x, y)| heat.dose(x, y)).collect()
}
