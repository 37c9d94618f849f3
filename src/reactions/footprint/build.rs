//! From a disk to its cells: one where the chart is even enough, otherwise as many as it takes.

use super::super::texels::{MapSize, TexelRect};
use super::cell::{Cell, Patch};
use super::probe::{Line, Probe};
use crate::organ::surface::Surface;
use glam::{DMat2, DVec2, DVec3};

/// How far interpolation may be off, in shares of the radius.
const TOLERANCE: f64 = 0.025;

/// Cells of up to this many texels a side are not split: each of their texels is looked up.
const LEAF_PX: i32 = 8;

/// Cells of up to this many texels are looked up without asking whether fewer places would do.
const SMALL_AREA_PX: i32 = 16;

/// A cell of this size shows nothing where none of its nine nodes does, texels.
const BLIND_PX: i32 = 16;

/// Most cells of one footprint; beyond them interpolation is taken as it is.
const MOST_CELLS: usize = 4096;

/// Most places looked up for one footprint; beyond them interpolation is taken as it is.
const MOST_LOOKUPS: usize = 1 << 18;

/// Most times that the searched box is widened: each time by half at least.
const MOST_GROWTHS: usize = 32;

/// A box of texels, ends excluded. Columns go on over the date line: they may be negative or beyond the map's width.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Span {
    x0: i32,
    y0: i32,
    x1: i32,
    y1: i32,
}

impl Span {
    fn is_empty(self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }
}

/// What a footprint is made of.
pub(super) struct Parts {
    pub(super) cells: Vec<Cell>,
    pub(super) samples: Vec<f32>,
    pub(super) rects: [TexelRect; 2],
}

struct Builder<'a> {
    probe: Probe<'a>,
    size: MapSize,
    wraps: bool,
    /// Texel coordinates of the middle; texel centres are whole numbers.
    middle_px: DVec2,
    lookups: usize,
    cells: Vec<Cell>,
    samples: Vec<f32>,
    /// The texels found, in the columns west of the date line, in the map's own, and east of it.
    found: [TexelRect; 3],
}

pub(super) fn build(surface: &Surface, size: MapSize, probe: Probe) -> Parts {
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let middle_px = probe.uv() * DVec2::new(width, height) - 0.5;
    let mut builder = Builder {
        probe,
        size,
        wraps: surface.atlas.is_spherical(),
        middle_px,
        lookups: 0,
        cells: Vec::new(),
        samples: Vec::new(),
        found: [TexelRect::default(); 3],
    };
    if !builder.add_ellipse() {
        builder.add_searched();
    }
    let mut parts = Parts { cells: builder.cells, samples: builder.samples, rects: [TexelRect::default(); 2] };
    for (to, from) in parts.rects.iter_mut().zip(builder.found.into_iter().filter(|rect| !rect.is_empty())) {
        *to = from;
    }
    parts
}

impl Builder<'_> {
    /// Local coordinates by texel: change along a row (first column) and down a column.
    fn jacobian_per_px(&mut self) -> DMat2 {
        let jacobian = self.probe.jacobian();
        DMat2::from_cols(
            jacobian.x_axis / f64::from(self.size.width_px),
            jacobian.y_axis / f64::from(self.size.height_px),
        )
    }

    /// Half width and half height of the ellipse that the Jacobian makes of the disk, texels; not finite where it makes
    /// none.
    fn half_extent_px(&mut self) -> DVec2 {
        let jacobian = self.jacobian_per_px();
        let inverse = jacobian.inverse();
        let half = DVec2::new(inverse.row(0).length(), inverse.row(1).length());
        if jacobian.determinant().abs() > f64::MIN_POSITIVE { half } else { DVec2::INFINITY }
    }

    fn column(&self, x: f64) -> Line {
        self.probe.column((x - self.middle_px.x) / f64::from(self.size.width_px))
    }

    fn row(&self, y: f64) -> Line {
        self.probe.row((y - self.middle_px.y) / f64::from(self.size.height_px))
    }

    fn at(&mut self, column: Line, row: Line) -> Option<DVec2> {
        self.lookups += 1;
        self.probe.at(column, row)
    }

    fn node(&mut self, column: Line, row: Line) -> DVec2 {
        self.at(column, row).unwrap_or(DVec2::NAN)
    }

    /// The ellipse of the Jacobian, where it is the disk: the chart is even over all of it. Says whether it is.
    fn add_ellipse(&mut self) -> bool {
        let half = self.half_extent_px();
        let (width, height) = (f64::from(self.size.width_px), f64::from(self.size.height_px));
        let is_within = half.x < 0.25 * width
            && self.middle_px.y - half.y >= 0.0
            && self.middle_px.y + half.y <= height - 1.0
            && (self.wraps || (self.middle_px.x - half.x >= 0.0 && self.middle_px.x + half.x <= width - 1.0));
        if !is_within {
            return false;
        }
        let jacobian = self.jacobian_per_px();
        let inverse = jacobian.inverse();
        for (x, y) in ELLIPSE_PROBES {
            let local = DVec2::new(x, y);
            let place = self.middle_px + inverse * local;
            // Written so that what faces away is not even.
            let is_even = self
                .at(self.column(place.x), self.row(place.y))
                .is_some_and(|found| found.distance(local) <= TOLERANCE);
            if !is_even {
                return false;
            }
        }
        let span = Span {
            x0: (self.middle_px.x - half.x).ceil() as i32,
            y0: (self.middle_px.y - half.y).ceil() as i32,
            x1: (self.middle_px.x + half.x).floor() as i32 + 1,
            y1: (self.middle_px.y + half.y).floor() as i32 + 1,
        };
        let middle_px = self.middle_px;
        self.for_pieces(span, |builder, piece| {
            let corner = |x: i32, y: i32| jacobian * (DVec2::new(f64::from(x), f64::from(y)) - middle_px);
            builder.add_bilinear(piece, corners_of(piece).map(|(x, y)| corner(x, y)));
        });
        true
    }

    /// Looks for the disk's texels, from the box that the Jacobian makes likely outwards.
    fn add_searched(&mut self) {
        let (width, height) = (self.size.width_px as i32, self.size.height_px as i32);
        let half = self.half_extent_px();
        // A little more than the ellipse, so that mostly nothing has to be widened; casts saturate.
        let reach = |half: f64, most: i32| ((1.1 * half) as i32).saturating_add(1).min(most);
        let middle = self.middle_px.round();
        let (x, y) = (middle.x as i32, middle.y as i32);
        let (reach_x, reach_y) = (reach(half.x, width), reach(half.y, height));
        let mut searched =
            self.bounded(Span { x0: x - reach_x, y0: y - reach_y, x1: x + reach_x + 1, y1: y + reach_y + 1 });
        searched = self.over_poles(searched);
        self.search(searched);
        for _ in 0..MOST_GROWTHS {
            let Some(found) = self.found_span() else { return };
            let grow = |length: i32| 2.max(length / 2);
            let (by_x, by_y) = (grow(searched.x1 - searched.x0), grow(searched.y1 - searched.y0));
            let mut wider = searched;
            if found.x0 <= searched.x0 {
                wider.x0 -= by_x;
            }
            if found.x1 >= searched.x1 {
                wider.x1 += by_x;
            }
            if found.y0 <= searched.y0 {
                wider.y0 -= by_y;
            }
            if found.y1 >= searched.y1 {
                wider.y1 += by_y;
            }
            // Never more than once round.
            wider.x0 = wider.x0.max(searched.x1 - width);
            wider.x1 = wider.x1.min(wider.x0 + width);
            let wider = Span { y0: wider.y0.max(0), y1: wider.y1.min(height), ..wider };
            let wider = if self.wraps { wider } else { Span { x0: wider.x0.max(0), x1: wider.x1.min(width), ..wider } };
            let wider = self.over_poles(wider);
            if wider == searched {
                return;
            }
            self.search(Span { x1: searched.x0, y0: searched.y0, y1: searched.y1, ..wider });
            self.search(Span { x0: searched.x1, y0: searched.y0, y1: searched.y1, ..wider });
            self.search(Span { y1: searched.y0, ..wider });
            self.search(Span { y0: searched.y1, ..wider });
            searched = wider;
        }
    }

    /// Within the map: at most once round where it wraps.
    fn bounded(&self, span: Span) -> Span {
        let (width, height) = (self.size.width_px as i32, self.size.height_px as i32);
        let span = Span { y0: span.y0.max(0), y1: span.y1.min(height), ..span };
        if !self.wraps {
            Span { x0: span.x0.max(0), x1: span.x1.min(width), ..span }
        } else if span.x1 - span.x0 >= width {
            Span { x0: 0, x1: width, ..span }
        } else {
            span
        }
    }

    /// A box that reaches a pole inside the disk covers whole rows: all columns meet there.
    fn over_poles(&mut self, span: Span) -> Span {
        let (width, height) = (self.size.width_px as i32, self.size.height_px as i32);
        if !self.wraps || span.x1 - span.x0 >= width {
            return span;
        }
        let mut is_over = |is_reached: bool, pole: DVec3| {
            is_reached && self.probe.at_direction(pole).is_some_and(|local| local.length_squared() < 1.0)
        };
        if is_over(span.y0 == 0, DVec3::Y) || is_over(span.y1 == height, DVec3::NEG_Y) {
            // Once round from where it starts, so that what was searched already stays a part of it.
            Span { x1: span.x0 + width, ..span }
        } else {
            span
        }
    }

    /// Box round all texels found, columns counted over the date line.
    fn found_span(&self) -> Option<Span> {
        let width = self.size.width_px as i32;
        let spans = (-1..).zip(&self.found).filter(|(_, rect)| !rect.is_empty()).map(|(turn, rect)| Span {
            x0: rect.x as i32 + turn * width,
            y0: rect.y as i32,
            x1: rect.right() as i32 + turn * width,
            y1: rect.bottom() as i32,
        });
        spans.reduce(|a, b| Span { x0: a.x0.min(b.x0), y0: a.y0.min(b.y0), x1: a.x1.max(b.x1), y1: a.y1.max(b.y1) })
    }

    /// Cuts a box at the date line.
    fn for_pieces(&mut self, span: Span, mut visit: impl FnMut(&mut Self, Span)) {
        let width = self.size.width_px as i32;
        let mut start = span.x0;
        while start < span.x1 && span.y0 < span.y1 {
            let end = span.x1.min(start + width - start.rem_euclid(width));
            visit(self, Span { x0: start, x1: end, ..span });
            start = end;
        }
    }

    fn search(&mut self, span: Span) {
        if span.is_empty() {
            return;
        }
        self.for_pieces(span, |builder, piece| {
            if is_leaf(piece) {
                builder.add_sampled(piece);
                return;
            }
            let [west, east] = [piece.x0, piece.x1].map(|x| builder.column(f64::from(x)));
            let [north, south] = [piece.y0, piece.y1].map(|y| builder.row(f64::from(y)));
            let corners = [(west, north), (east, north), (west, south), (east, south)];
            let corners = corners.map(|(column, row)| builder.node(column, row));
            builder.refine(piece, corners);
        });
    }

    /// Adds a box whose corner values are known, in parts where they do not tell the rest.
    fn refine(&mut self, span: Span, corners: [DVec2; 4]) {
        let (width, height) = (span.x1 - span.x0, span.y1 - span.y0);
        if width * height <= SMALL_AREA_PX {
            self.add_sampled(span);
            return;
        }
        let (xm, ym) = (span.x0 + width / 2, span.y0 + height / 2);
        let [west, middle, east] = [span.x0, xm, span.x1].map(|x| self.column(f64::from(x)));
        let [north, equator, south] = [span.y0, ym, span.y1].map(|y| self.row(f64::from(y)));
        let [top, bottom] = [north, south].map(|row| self.node(middle, row));
        let [left, right] = [west, east].map(|column| self.node(column, equator));
        let centre = self.node(middle, equator);
        let share_x = f64::from(width / 2) / f64::from(width);
        let share_y = f64::from(height / 2) / f64::from(height);
        let [c00, c10, c01, c11] = corners;
        let off_x = top.distance(c00.lerp(c10, share_x)).max(bottom.distance(c01.lerp(c11, share_x)));
        let off_y = left.distance(c00.lerp(c01, share_y)).max(right.distance(c10.lerp(c11, share_y)));
        let off_centre = centre.distance(c00.lerp(c10, share_x).lerp(c01.lerp(c11, share_x), share_y));
        // Maxima forget what is no number, sums do not.
        let is_seen =
            (off_centre + top.x + bottom.x + left.x + right.x).is_finite() && corners.iter().all(|c| c.is_finite());
        let off = off_x.max(off_y).max(off_centre);
        let nodes = [c00, c10, c01, c11, top, bottom, left, right, centre];
        if is_seen {
            // All of it beyond a straight line that leaves the disk on the other side.
            let away = centre.normalize_or_zero();
            if nodes.iter().all(|node| node.dot(away) >= 1.0 + 2.0 * off) {
                return;
            }
        } else if width <= BLIND_PX && height <= BLIND_PX && nodes.iter().all(|node| node.is_nan()) {
            return;
        }
        if is_seen && off <= TOLERANCE {
            self.add_bilinear(span, corners);
            return;
        }
        if is_leaf(span) {
            self.add_sampled(span);
            return;
        }
        if self.cells.len() >= MOST_CELLS || self.lookups >= MOST_LOOKUPS {
            if corners.iter().all(|corner| corner.is_finite()) {
                self.add_bilinear(span, corners);
            }
            return;
        }
        let splits_x = if height <= LEAF_PX || width <= LEAF_PX {
            width > LEAF_PX
        } else if is_seen && off_x != off_y {
            off_x > off_y
        } else {
            width >= height
        };
        if splits_x {
            self.refine(Span { x1: xm, ..span }, [c00, top, c01, bottom]);
            self.refine(Span { x0: xm, ..span }, [top, c10, bottom, c11]);
        } else {
            self.refine(Span { y1: ym, ..span }, [c00, c10, left, right]);
            self.refine(Span { y0: ym, ..span }, [left, right, c01, c11]);
        }
    }

    fn add_bilinear(&mut self, span: Span, corners: [DVec2; 4]) {
        let rect = self.rect_of(span);
        let cell = Cell::cropped(rect, Patch::between(corners, rect.width, rect.height));
        self.add(span, cell);
    }

    fn add_sampled(&mut self, span: Span) {
        let rect = self.rect_of(span);
        let mut columns = [(0.0, 0.0); LEAF_PX as usize];
        for (column, x) in columns.iter_mut().zip(span.x0..span.x1) {
            *column = self.column(f64::from(x));
        }
        let mut r_squared = [f32::INFINITY; (LEAF_PX * LEAF_PX) as usize];
        for (y, to) in (span.y0..span.y1).zip(r_squared.chunks_exact_mut(rect.width as usize)) {
            let row = self.row(f64::from(y));
            for (to, &column) in to.iter_mut().zip(&columns) {
                *to = self.at(column, row).map_or(f32::INFINITY, |local| local.length_squared() as f32);
            }
        }
        let cell = Cell::sampled(rect, &r_squared[..rect.area() as usize], &mut self.samples);
        self.add(span, cell);
    }

    /// A box that does not cross the date line, in the map's own columns.
    fn rect_of(&self, span: Span) -> TexelRect {
        TexelRect {
            x: span.x0.rem_euclid(self.size.width_px as i32) as u32,
            y: span.y0 as u32,
            width: (span.x1 - span.x0) as u32,
            height: (span.y1 - span.y0) as u32,
        }
    }

    fn add(&mut self, span: Span, cell: Option<Cell>) {
        if let Some(cell) = cell {
            let turn = span.x0.div_euclid(self.size.width_px as i32).clamp(-1, 1);
            let found = &mut self.found[(turn + 1) as usize];
            *found = found.union(cell.rect);
            self.cells.push(cell);
        }
    }
}

/// Where the ellipse is held against the chart: eight places on its border and four half way in.
const ELLIPSE_PROBES: [(f64, f64); 12] = {
    const DIAGONAL: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [
        (1.0, 0.0),
        (-1.0, 0.0),
        (0.0, 1.0),
        (0.0, -1.0),
        (DIAGONAL, DIAGONAL),
        (-DIAGONAL, DIAGONAL),
        (DIAGONAL, -DIAGONAL),
        (-DIAGONAL, -DIAGONAL),
        (0.5, 0.0),
        (-0.5, 0.0),
        (0.0, 0.5),
        (0.0, -0.5),
    ]
};

/// Nodes of a box in the order of [`Patch::between`]; the far ones lie on the next texel's centre, so that neighbours
/// share them.
fn corners_of(span: Span) -> [(i32, i32); 4] {
    [(span.x0, span.y0), (span.x1, span.y0), (span.x0, span.y1), (span.x1, span.y1)]
}

fn is_leaf(span: Span) -> bool {
    span.x1 - span.x0 <= LEAF_PX && span.y1 - span.y0 <= LEAF_PX
}
