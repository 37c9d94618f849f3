//! Which slices a view takes.

use bevy::reflect::Reflect;
use glam::{Mat3, Vec3};

/// Most slices of a stack.
pub const MAX_SLICES: u32 = 4096;

/// The slices across one axis of a lattice's box, from the eye away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct SliceStack {
    /// The axis that they lie across.
    pub axis: usize,
    /// Whether those farther away are at greater places.
    pub is_forward: bool,
    /// Distance of the planes along the axis.
    pub spacing: f32,
    /// Number of the nearest plane; plane `k` is at `(k + 0.5) * spacing`.
    pub first: i32,
    /// How many there are.
    pub count: u32,
}

impl SliceStack {
    /// The stack for rays that go `along` (shares of the box per metre of view depth): of the three the one whose planes they
    /// meet in the shortest steps. Planes are `step_m` apart in the world, or more where there would be more than
    /// [`MAX_SLICES`] of them, and reach from `low` to `high`.
    pub fn new(along: Vec3, box_from_world: Mat3, step_m: f32, low: Vec3, high: Vec3) -> Self {
        // How much of the box a metre across the planes of an axis is.
        let shares_per_m = Vec3::from_array(std::array::from_fn(|axis| box_from_world.row(axis).length()));
        let steps = (along / shares_per_m).abs();
        let axis = (0..3).fold(0, |best, axis| if steps[axis] > steps[best] { axis } else { best });
        let length = (high[axis] - low[axis]).max(0.0);
        let spacing = (step_m * shares_per_m[axis]).max(length / (MAX_SLICES - 2) as f32);
        // The planes lie between whole multiples of the spacing: where it is a voxel, in the middle of voxels.
        let number = |at: f32| at / spacing - 0.5;
        let (lowest, highest) = (number(low[axis]).ceil() as i32, number(high[axis]).floor() as i32);
        let is_forward = along[axis] >= 0.0;
        let count = (i64::from(highest) - i64::from(lowest) + 1).clamp(0, i64::from(MAX_SLICES)) as u32;
        Self { axis, is_forward, spacing, first: if is_forward { lowest } else { highest }, count }
    }

    /// Place along the axis of the slice `n`, counted from the eye.
    pub fn position(&self, n: u32) -> f32 {
        let number = if self.is_forward { self.first + n as i32 } else { self.first - n as i32 };
        (number as f32 + 0.5) * self.spacing
    }
}
