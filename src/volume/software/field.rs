//! The voxels as the passes sample them.

use crate::volume::grid::linear_index;
use crate::volume::{Volume, VoxelBox};
use bevy::reflect::Reflect;
use glam::{IVec3, UVec3, Vec3, Vec3A};
use rayon::prelude::*;
use std::sync::LazyLock;

/// Dense voxels with what is left of them: the textures of the passes.
#[derive(Clone, Debug, PartialEq, Reflect)]
#[reflect(opaque)]
#[reflect(Clone, Debug, PartialEq)]
pub struct RenderField {
    size: UVec3,
    /// Normalized values, 0 to 65535.
    values: Vec<u16>,
    /// Remaining opacity, 0 to 255; empty while nothing is cut.
    remaining: Vec<u8>,
    /// Gradients of the values times what remains, as [`encoded`] writes them; the fourth number means nothing.
    gradients: Vec<[i8; 4]>,
    /// Colours (sRGB; alpha means nothing); empty where the table has the colours.
    colours: Vec<[u8; 4]>,
}

impl RenderField {
    /// A volume that is not cut, with colours from the transfer function's table.
    pub fn new(volume: &Volume) -> Self {
        let count = volume.grid().count();
        let values = (0..count).into_par_iter();
        let values = values.map(|index| (volume.normalized(index) * 65535.0 + 0.5) as u16).collect();
        let (size, gradients) = (volume.grid().size, vec![[0; 4]; count]);
        let mut made = Self { size, values, remaining: Vec::new(), gradients, colours: Vec::new() };
        made.take_gradients(volume.grid().bounds());
        made
    }

    /// With a colour (sRGB) of its own for each voxel, as [`colours`](crate::volume::transfer::colours) gives them, in place of
    /// the table's. `None` for another number of colours than there are voxels.
    pub fn with_colours(self, colours: Vec<[u8; 4]>) -> Option<Self> {
        (colours.len() == self.values.len()).then_some(Self { colours, ..self })
    }

    /// Voxels along each axis.
    pub fn size(&self) -> UVec3 {
        self.size
    }

    /// Takes the remaining opacities of a box over; `remaining` writes those of a box, 0 to 255 with x fastest.
    pub fn cut(&mut self, changed: VoxelBox, mut remaining: impl FnMut(VoxelBox, &mut [u8])) {
        let changed = changed.intersection(&VoxelBox { min: UVec3::ZERO, max: self.size });
        if changed.is_empty() {
            return;
        }
        if self.remaining.is_empty() {
            self.remaining = vec![255; self.values.len()];
        }
        let mut opacities = vec![0; changed.count()];
        remaining(changed, &mut opacities);
        let width = changed.size().x as usize;
        for (row, opacities) in opacities.chunks_exact(width).enumerate() {
            let (y, z) = (row as u32 % changed.size().y, row as u32 / changed.size().y);
            let start = self.place(changed.min + UVec3::new(0, y, z));
            self.remaining[start..start + width].copy_from_slice(opacities);
        }
        self.take_gradients(changed.grown(1, self.size));
    }

    /// Takes the gradients of a box anew: central differences of the voxels' values times what remains of each, as if nothing
    /// were beyond the grid: its sides, where they cut through tissue, are surfaces like others.
    fn take_gradients(&mut self, of: VoxelBox) {
        let (width, height) = (self.size.x as usize, self.size.y as usize);
        let last = self.size - 1;
        let (values, remaining) = (&self.values, &self.remaining);
        let product = |place: usize| match remaining.get(place) {
            Some(&remaining) => f32::from(values[place]) * f32::from(remaining) * (1.0 / 255.0),
            None => f32::from(values[place]),
        };
        let slice = width * height;
        let slices = self.gradients.par_chunks_mut(slice).enumerate();
        slices.skip(of.min.z as usize).take(of.size().z as usize).for_each(|(z, gradients)| {
            for y in of.min.y as usize..of.max.y as usize {
                for x in of.min.x as usize..of.max.x as usize {
                    let place = z * slice + y * width + x;
                    let slope = |at: usize, last: u32, stride: usize| {
                        let after = if at < last as usize { product(place + stride) } else { 0.0 };
                        after - if at > 0 { product(place - stride) } else { 0.0 }
                    };
                    let difference = Vec3::new(slope(x, last.x, 1), slope(y, last.y, width), slope(z, last.z, slice));
                    gradients[y * width + x] = encoded(difference * (0.5 / 65535.0));
                }
            }
        });
    }

    fn place(&self, voxel: UVec3) -> usize {
        linear_index(self.size, voxel)
    }

    /// Normalized value at voxel coordinates, 0 to 1.
    pub fn value(&self, at_voxel: Vec3) -> f32 {
        self.value_at(&self.corners(at_voxel))
    }

    /// Remaining opacity at voxel coordinates, 0 to 1.
    pub fn remaining(&self, at_voxel: Vec3) -> f32 {
        self.remaining_at(&self.corners(at_voxel))
    }

    /// Gradient of the voxels' values times what remains of each, interpolated, divided by the square root of its length at each
    /// voxel.
    pub fn gradient(&self, at_voxel: Vec3) -> Vec3 {
        self.gradient_at(&self.corners(at_voxel))
    }

    /// The eight voxels around a place and how near it is to the latter four of each axis.
    #[inline]
    pub(super) fn corners(&self, at_voxel: Vec3) -> Corners {
        let last = self.size.as_vec3() - 1.0;
        let at = at_voxel.clamp(Vec3::ZERO, last);
        let first = at.as_ivec3();
        let next = (first + 1).min(last.as_ivec3());
        let row = self.size.x as usize;
        let line = |y: i32, z: i32| (z as usize * self.size.y as usize + y as usize) * row;
        let IVec3 { x, y, z } = first;
        Corners {
            lines: [line(y, z), line(next.y, z), line(y, next.z), line(next.y, next.z)],
            x: [x as usize, next.x as usize],
            share: at - first.as_vec3(),
        }
    }

    #[inline]
    pub(super) fn value_at(&self, corners: &Corners) -> f32 {
        corners.interpolate(|place| f32::from(self.values[place])) * (1.0 / 65535.0)
    }

    #[inline]
    pub(super) fn remaining_at(&self, corners: &Corners) -> f32 {
        if self.remaining.is_empty() {
            return 1.0;
        }
        corners.interpolate(|place| f32::from(self.remaining[place])) * (1.0 / 255.0)
    }

    #[inline]
    pub(super) fn gradient_at(&self, corners: &Corners) -> Vec3 {
        let gradient = corners.interpolate_vectors(|place| {
            let [x, y, z, _] = self.gradients[place];
            Vec3A::new(x.into(), y.into(), z.into())
        });
        Vec3::from(gradient) * (1.0 / 127.0)
    }

    /// Colour (linear) of the voxels themselves, if they have any.
    pub(super) fn colour_at(&self, corners: &Corners) -> Option<Vec3> {
        if self.colours.is_empty() {
            return None;
        }
        let linear = &*LINEAR;
        let colour = corners.interpolate_vectors(|place| {
            let [r, g, b, _] = self.colours[place];
            Vec3A::new(linear[usize::from(r)], linear[usize::from(g)], linear[usize::from(b)])
        });
        Some(colour.into())
    }
}

/// Where eight voxels are in memory, and the weights among them.
pub(super) struct Corners {
    lines: [usize; 4],
    x: [usize; 2],
    share: Vec3,
}

impl Corners {
    #[inline]
    fn interpolate_vectors(&self, of: impl Fn(usize) -> Vec3A) -> Vec3A {
        let along_x = |line: usize| of(line + self.x[0]).lerp(of(line + self.x[1]), self.share.x);
        let [a, b, c, d] = self.lines;
        let (a, b, c, d) = (along_x(a), along_x(b), along_x(c), along_x(d));
        a.lerp(b, self.share.y).lerp(c.lerp(d, self.share.y), self.share.z)
    }

    #[inline]
    fn interpolate(&self, of: impl Fn(usize) -> f32) -> f32 {
        let along_x = |line: usize| {
            let (a, b) = (of(line + self.x[0]), of(line + self.x[1]));
            a + (b - a) * self.share.x
        };
        let [a, b, c, d] = self.lines;
        let (a, b, c, d) = (along_x(a), along_x(b), along_x(c), along_x(d));
        let (near, far) = (a + (b - a) * self.share.y, c + (d - c) * self.share.y);
        near + (far - near) * self.share.z
    }
}

/// A difference per voxel as eight bits hold it: divided by the square root of its length, so that gentle slopes keep their
/// direction.
pub(crate) fn encoded(difference: Vec3) -> [i8; 4] {
    let encoded = difference / difference.length().max(1e-6).sqrt() * 127.0;
    // Rounded by cutting off, which is quicker than `round`.
    let [x, y, z] = encoded.to_array().map(|part| (part + 0.5_f32.copysign(part)).clamp(-127.0, 127.0) as i8);
    [x, y, z, 0]
}

/// Linear light of the 256 sRGB numbers.
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|number| {
        let encoded = number as f64 / 255.0;
        let linear = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
        linear as f32
    })
});
