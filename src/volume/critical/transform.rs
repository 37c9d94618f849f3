//! Exact Euclidean distances on a grid, up to a band.

use super::super::grid::VoxelBox;
use glam::{UVec3, Vec3};
use rayon::prelude::*;

/// What stands for everything beyond the band.
pub(super) const BEYOND: u16 = u16::MAX;

/// Distances in hundredths of a millimetre from each voxel of a box to the nearest voxel that is there, [`BEYOND`] if none is
/// within the band; at least 1 for voxels that are not there. `x` runs fastest. `is_there` fills a row: from a voxel on, as
/// many as the slice has.
///
/// Separable: the square of a distance is a minimum over rows of the squares along the row plus the square across. A minimum
/// over a window as wide as the band takes the place of lower envelopes of parabolas (Felzenszwalb and Huttenlocher, "Distance
/// Transforms of Sampled Functions", 2012): it gives the same numbers, and whole rows at once.
pub(super) fn distances(
    of: VoxelBox,
    size: UVec3,
    spacing_mm: Vec3,
    band_mm: f32,
    is_there: &(impl Fn(UVec3, &mut [bool]) + Sync),
) -> Vec<u16> {
    let window = window(spacing_mm, band_mm);
    let seen = grown(of, window, size);
    let (width, height) = (of.size().x as usize, of.size().y as usize);
    // Squares along x and y, by slices; none where no voxel is near.
    let slices: Vec<Option<Vec<f32>>> =
        (seen.min.z..seen.max.z).into_par_iter().map(|z| slice(of, seen, z, spacing_mm, window.y, is_there)).collect();
    let mut distances = vec![BEYOND; of.count()];
    distances.par_chunks_mut(width * height).zip(of.min.z..of.max.z).for_each(|(distances, z)| {
        let mut nearest: Option<Vec<f32>> = None;
        for other in seen.min.z.max(z.saturating_sub(window.z))..seen.max.z.min(z + window.z + 1) {
            let Some(squares) = &slices[(other - seen.min.z) as usize] else { continue };
            let across = (other.abs_diff(z) as f32 * spacing_mm.z).powi(2);
            lower(nearest.get_or_insert_with(|| vec![f32::INFINITY; width * height]), squares, across);
        }
        for (distance, square) in distances.iter_mut().zip(nearest.into_iter().flatten()) {
            *distance = match square.sqrt() {
                0.0 => 0,
                mm if mm <= band_mm => (mm * 100.0).round().max(1.0) as u16,
                _ => BEYOND,
            };
        }
    });
    distances
}

/// Voxels that a band reaches along each axis.
pub(super) fn window(spacing_mm: Vec3, band_mm: f32) -> UVec3 {
    (Vec3::splat(band_mm) / spacing_mm).ceil().min(Vec3::splat(4096.0)).as_uvec3()
}

/// A box grown by as much on each side, within the grid.
pub(super) fn grown(of: VoxelBox, by: UVec3, size: UVec3) -> VoxelBox {
    VoxelBox { min: of.min.saturating_sub(by), max: (of.max + by).min(size) }
}

/// Lowers numbers to others plus a constant.
fn lower(numbers: &mut [f32], others: &[f32], plus: f32) {
    for (number, &other) in numbers.iter_mut().zip(others) {
        let other = other + plus;
        *number = if other < *number { other } else { *number };
    }
}

/// Squares of distances within a plane, for the box's part of it.
fn slice(
    of: VoxelBox,
    seen: VoxelBox,
    z: u32,
    spacing_mm: Vec3,
    window: u32,
    is_there: &(impl Fn(UVec3, &mut [bool]) + Sync),
) -> Option<Vec<f32>> {
    let width = of.size().x as usize;
    let mut there = vec![false; seen.size().x as usize];
    let mut rows: Vec<Option<Vec<f32>>> = Vec::with_capacity(seen.size().y as usize);
    for y in seen.min.y..seen.max.y {
        is_there(UVec3::new(seen.min.x, y, z), &mut there);
        rows.push(row(&there, (of.min.x - seen.min.x) as usize, width, spacing_mm.x));
    }
    if rows.iter().all(Option::is_none) {
        return None;
    }
    let mut squares = vec![f32::INFINITY; width * of.size().y as usize];
    for (nearest, y) in squares.chunks_mut(width).zip(of.min.y..of.max.y) {
        for other in seen.min.y.max(y.saturating_sub(window))..seen.max.y.min(y + window + 1) {
            if let Some(row) = &rows[(other - seen.min.y) as usize] {
                lower(nearest, row, (other.abs_diff(y) as f32 * spacing_mm.y).powi(2));
            }
        }
    }
    Some(squares)
}

/// Squares of distances within a row, for `width` voxels from `first` on.
fn row(there: &[bool], first: usize, width: usize, spacing_mm: f32) -> Option<Vec<f32>> {
    if !there.contains(&true) {
        return None;
    }
    let mut squares = vec![0.0; width];
    let mut away = f32::INFINITY;
    for (place, &is_there) in there[..first + width].iter().enumerate() {
        away = if is_there { 0.0 } else { away + 1.0 };
        if place >= first {
            squares[place - first] = away;
        }
    }
    away = f32::INFINITY;
    for (place, &is_there) in there.iter().enumerate().skip(first).rev() {
        away = if is_there { 0.0 } else { away + 1.0 };
        if let Some(square) = squares.get_mut(place - first) {
            *square = (square.min(away) * spacing_mm).powi(2);
        }
    }
    Some(squares)
}
