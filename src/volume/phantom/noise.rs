//! Smooth random fields in space.

use glam::{IVec3, Vec3};

/// A random number per lattice point and seed, all 32 bits of it (a finalizer after Murmur3).
fn hash(cell: IVec3, seed: u32) -> u32 {
    let mut h = (cell.x as u32).wrapping_mul(0x9E37_79B1)
        ^ (cell.y as u32).wrapping_mul(0x85EB_CA77)
        ^ (cell.z as u32).wrapping_mul(0xC2B2_AE3D)
        ^ seed.wrapping_mul(0x27D4_EB2F);
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    h ^ (h >> 16)
}

/// A smooth field with values from -1 to 1 and features of a lattice step's size (Perlin's gradient noise, "Improving noise",
/// 2002: quintic weights, so its gradient is continuous and shading shows no lattice).
pub(super) fn field(p: Vec3, seed: u32) -> f32 {
    let floor = p.floor();
    let cell = floor.as_ivec3();
    let f = p - floor;
    let weight = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let step = IVec3::new(dx, dy, dz);
        let h = hash(cell + step, seed);
        // Ten bits per component; the gradients fill a cube, which is even enough at such amplitudes.
        let gradient = Vec3::new((h & 1023) as f32, ((h >> 10) & 1023) as f32, ((h >> 20) & 1023) as f32) / 511.5 - 1.0;
        gradient.dot(f - step.as_vec3())
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), weight.x);
    let face = |dz| mix(row(0, dz), row(1, dz), weight.y);
    mix(face(0), face(1), weight.z)
}

/// The same random number for a pair of indices in either order, 0 to 1.
pub(super) fn of_pair(a: u32, b: u32, seed: u32) -> f32 {
    hash(IVec3::new(a.min(b) as i32, a.max(b) as i32, 0), seed) as f32 / u32::MAX as f32
}
