//! Smooth functions that are worth evaluating only once per millimetre.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// A smooth function on a lattice in a box.
pub(super) struct Interpolated {
    low: Vec3,
    count: UVec3,
    values: Vec<f32>,
}

/// Step of lattices, millimetres.
const LATTICE_MM: f32 = 1.0;

impl Interpolated {
    pub(super) fn of(low: Vec3, high: Vec3, value: impl Fn(Vec3) -> f32 + Sync) -> Self {
        let count = ((high - low) / LATTICE_MM).ceil().as_uvec3() + 1;
        let row = |row: u32| {
            let (j, k) = (row % count.y, row / count.y);
            (0..count.x).map(|i| value(low + UVec3::new(i, j, k).as_vec3() * LATTICE_MM)).collect::<Vec<f32>>()
        };
        let values = (0..count.y * count.z).into_par_iter().flat_map_iter(row).collect();
        Self { low, count, values }
    }

    /// The value between lattice points; outside the box it grows with the distance from it.
    pub(super) fn at(&self, p: Vec3) -> f32 {
        let place = (p - self.low) / LATTICE_MM;
        let last = (self.count - 1).as_vec3();
        let inside = place.clamp(Vec3::ZERO, last);
        let outside = (place - inside).length() * LATTICE_MM;
        let cell = inside.as_uvec3().min(self.count - 2);
        let f = inside - cell.as_vec3();
        let at = |i, j, k| {
            let node = cell + UVec3::new(i, j, k);
            self.values[((node.z * self.count.y + node.y) * self.count.x + node.x) as usize]
        };
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        let row = |j, k| mix(at(0, j, k), at(1, j, k), f.x);
        let face = |k| mix(row(0, k), row(1, k), f.y);
        mix(face(0), face(1), f.z) + outside
    }
}
