//! Which texels of a reaction map a disk on the surface covers, so that it looks round on the organ.
//!
//! Neyret, Heiss and Senegas (2002, section 4.2.3) draw the ellipse that the Jacobian at the disk's middle asks for. It
//! is exact while the disk stays in one face, and wrong where faces meet and near the poles. Here the local coordinates
//! of a texel are where the exact place that it shows lies on the plane square to the normal at the disk's middle: one
//! ellipse where that is as good, otherwise a few cells with bilinear local coordinates, or texel by texel.

mod build;
mod cell;
mod probe;

pub(crate) use cell::{Cell, Patch, RowQuadratic, Shape};

use super::texels::{MapSize, TexelRect};
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use bevy::reflect::Reflect;
use glam::{DVec2, Mat2, Vec2};
use probe::Probe;

/// The texels of a disk on the surface, each with its distance from the disk's middle.
///
/// A place belongs to the disk where its distance along the plane square to the middle's normal, or its height over that
/// plane where that is greater, is less than the radius. Faces that look away from the disk, as those on the other side
/// of a thin rim, do not belong to it. A disk smaller than a texel may hold no texel's centre, and covers nothing then.
///
/// A footprint belongs to the shape that the surface had when it was made, and serves any smaller radius too. The
/// default covers nothing of a map of no size.
#[derive(Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(opaque)]
pub struct Footprint {
    size: MapSize,
    radius_m: f32,
    rects: [TexelRect; 2],
    cells: Vec<Cell>,
    samples: Vec<f32>,
}

impl Footprint {
    /// The texels of a disk with its middle at `point`.
    ///
    /// `None` for a radius that is not finite or not above zero, a map without texels, a place that is none, and where
    /// the surface at `point` has positions that are no numbers or no area. Elsewhere such faces are left out. Time and
    /// memory are bounded for any radius: by 4096 cells.
    pub fn new(surface: &Surface, size: MapSize, point: SurfacePoint, radius_m: f32) -> Option<Self> {
        if !radius_m.is_finite() || radius_m <= 0.0 || size.area() == 0 {
            return None;
        }
        let probe = Probe::new(surface, point, radius_m.into())?;
        let build::Parts { cells, samples, rects } = build::build(surface, size, probe);
        Some(Self { size, radius_m, rects, cells, samples })
    }

    /// An ellipse in the map itself: the texels with `|jacobian * (centre - centre_px)| < 1`, where texel (x, y) has its
    /// centre at (x + 0.5, y + 0.5). It is clipped at the map's border, and its radius counts as one metre. `None` for
    /// what is not finite or has no area.
    pub fn ellipse(size: MapSize, centre_px: Vec2, jacobian_per_px: Mat2) -> Option<Self> {
        let (middle, jacobian) = (centre_px.as_dvec2() - 0.5, jacobian_per_px.as_dmat2());
        let inverse = jacobian.inverse();
        if !middle.is_finite() || !inverse.is_finite() || !jacobian.is_finite() {
            return None;
        }
        let half = DVec2::new(inverse.row(0).length(), inverse.row(1).length());
        let largest = DVec2::new(f64::from(size.width_px), f64::from(size.height_px));
        let low = (middle - half).ceil().clamp(DVec2::ZERO, largest);
        let high = ((middle + half).floor() + 1.0).clamp(low, largest);
        let rect = TexelRect {
            x: low.x as u32,
            y: low.y as u32,
            width: (high.x - low.x) as u32,
            height: (high.y - low.y) as u32,
        };
        let mut footprint = Self { size, radius_m: 1.0, ..Self::default() };
        if !rect.is_empty() {
            let corner = |x: u32, y: u32| jacobian * (DVec2::new(f64::from(x), f64::from(y)) - middle);
            let (right, bottom) = (rect.right(), rect.bottom());
            let corners =
                [corner(rect.x, rect.y), corner(right, rect.y), corner(rect.x, bottom), corner(right, bottom)];
            let patch = Patch::between(corners, rect.width, rect.height);
            footprint.rects[0] = rect;
            footprint.cells.push(Cell { rect, shape: Shape::Bilinear(patch) });
        }
        Some(footprint)
    }

    /// Size of the map that it belongs to.
    pub fn size(&self) -> MapSize {
        self.size
    }

    /// Radius on the surface, metres.
    pub fn radius_m(&self) -> f32 {
        self.radius_m
    }

    /// Rectangles round its texels: disjoint, within the map, two where it crosses the date line.
    pub fn rects(&self) -> &[TexelRect] {
        let count = self.rects.iter().take_while(|rect| !rect.is_empty()).count();
        &self.rects[..count]
    }

    /// Visits every texel of the disk once, always in the same order: column, row and the square of its distance from
    /// the middle in shares of the radius, which is less than one.
    pub fn for_each_texel(&self, mut visit: impl FnMut(u32, u32, f32)) {
        for cell in &self.cells {
            let rect = cell.rect;
            for y in 0..rect.height {
                let mut visit_at = |x: u32, r_squared: f32| {
                    if r_squared < 1.0 {
                        visit(rect.x + x, rect.y + y, r_squared.max(0.0));
                    }
                };
                match cell.shape {
                    Shape::Bilinear(patch) => {
                        let row = patch.row(y as f32);
                        let (start, end) = row.span(rect.width as i32);
                        (start..end).for_each(|x| visit_at(x as u32, row.at(x as f32)));
                    }
                    Shape::Sampled { first } => {
                        let row = &self.samples[(first + y * rect.width) as usize..][..rect.width as usize];
                        (0..).zip(row).for_each(|(x, &r_squared)| visit_at(x, r_squared));
                    }
                }
            }
        }
    }

    pub(crate) fn cells(&self) -> &[Cell] {
        &self.cells
    }

    pub(crate) fn samples(&self) -> &[f32] {
        &self.samples
    }
}
