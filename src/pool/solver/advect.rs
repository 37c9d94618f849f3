//! Carrying quantities with the flow.

use super::field::{At, Field, Places, for_rows, for_rows_of_two};
use super::spans::Spans;
use super::{Advection, MAX_CELLS_PER_STEP};
use glam::{UVec2, Vec2};

/// What carries, and where.
pub(super) struct Flow<'a> {
    pub places: &'a Places,
    pub spans: &'a Spans,
    /// Cells that a velocity of 1 goes in a step.
    pub cells_per_velocity: f32,
}

/// Four neighbours of a place in memory, and their weights.
struct Corners {
    place: usize,
    stride: usize,
    weights: [f32; 4],
}

impl Corners {
    /// Around a place that lies in the grid, in cells from the first number of the field.
    #[inline(always)]
    fn new(at: Vec2, stride: usize) -> Self {
        // Never negative: the frame of one cell is counted.
        let (x, y) = (at.x + 1.0, at.y + 1.0);
        let (column, row) = (x as usize, y as usize);
        let (a, b) = (x - column as f32, y - row as f32);
        let weights = [(1.0 - a) * (1.0 - b), a * (1.0 - b), (1.0 - a) * b, a * b];
        Self { place: row * stride + column, stride, weights }
    }

    #[inline(always)]
    fn values(&self, of: &[f32]) -> [f32; 4] {
        let (low, high) = (&of[self.place..self.place + 2], &of[self.place + self.stride..][..2]);
        [low[0], low[1], high[0], high[1]]
    }

    #[inline(always)]
    fn interpolate(&self, of: &[f32]) -> f32 {
        let [a, b, c, d] = self.values(of);
        let [wa, wb, wc, wd] = self.weights;
        (a * wa + b * wb) + (c * wc + d * wd)
    }

    /// The same from those numbers alone that mean something; none if there is none.
    #[inline(always)]
    fn interpolate_known(&self, of: &[f32], known: &[f32]) -> Option<f32> {
        let known = self.values(known);
        let weights: [f32; 4] = std::array::from_fn(|k| self.weights[k] * known[k]);
        let weight: f32 = weights.iter().sum();
        let values = self.values(of);
        let sum: f32 = (0..4).map(|k| weights[k] * values[k]).sum();
        (weight > 1e-6).then(|| sum / weight)
    }

    /// Least and greatest of those that mean something.
    #[inline(always)]
    fn bounds(&self, of: &[f32], known: Option<&[f32]>) -> [f32; 2] {
        let (values, known) = (self.values(of), known.map_or([1.0; 4], |known| self.values(known)));
        let mut bounds = [f32::INFINITY, f32::NEG_INFINITY];
        for (value, _) in values.into_iter().zip(known).filter(|(_, known)| *known > 0.0) {
            bounds = [bounds[0].min(value), bounds[1].max(value)];
        }
        bounds
    }
}

impl Flow<'_> {
    /// Carries a velocity, the reflected one if there is one and otherwise the velocity itself, with the velocity.
    pub fn carry_velocity(
        &self,
        velocity: &mut [Field; 2],
        reflected: Option<&[Field; 2]>,
        next: &mut [Field; 2],
        other: &mut [Field; 2],
        advection: Advection,
    ) {
        for (axis, at) in [(0, At::Left), (1, At::Below)] {
            let (from, by) = (&reflected.unwrap_or(velocity)[axis], &*velocity);
            self.carry(from, &mut next[axis], by, at, 1.0);
            if advection == Advection::MacCormack {
                self.carry(&next[axis], &mut other[axis], by, at, -1.0);
                self.correct(from, &mut next[axis], &other[axis], by, at);
            }
        }
        std::mem::swap(velocity, next);
    }

    /// Carries what is dissolved, so that its amounts stay.
    pub fn carry_dissolved(
        &self,
        dissolved: &mut [Field; 2],
        velocity: &[Field; 2],
        next: &mut [Field; 2],
        other: &mut [Field; 2],
        advection: Advection,
    ) {
        match advection {
            Advection::SemiLagrangian => self.carry_both(dissolved, next, velocity),
            Advection::MacCormack => {
                for ((from, next), other) in dissolved.iter().zip(next.iter_mut()).zip(other) {
                    self.carry(from, next, velocity, At::Middle, 1.0);
                    self.carry(next, other, velocity, At::Middle, -1.0);
                    self.correct(from, next, other, velocity, At::Middle);
                }
            }
        }
        std::mem::swap(dissolved, next);
    }

    /// Both dissolved quantities on the same ways.
    fn carry_both(&self, from: &[Field; 2], into: &mut [Field; 2], velocity: &[Field; 2]) {
        let stride = from[0].stride();
        let [a, b] = [&from[0].values, &from[1].values];
        let wet = &self.places.wet.values;
        for_rows_of_two(into, self.spans, |y, [out_a, out_b], start, end, _| {
            for x in start..end {
                let place = (y + 1) * stride + x + 1;
                if wet[place] == 0.0 {
                    (out_a[x + 1], out_b[x + 1]) = (0.0, 0.0);
                    continue;
                }
                let (at, is_free) = self.origin(velocity, At::Middle, x, y, place, stride, 1.0);
                let corners = Corners::new(at, stride);
                (out_a[x + 1], out_b[x + 1]) = if is_free {
                    (corners.interpolate(a), corners.interpolate(b))
                } else {
                    let known = |of: &[f32]| corners.interpolate_known(of, wet).unwrap_or(of[place]);
                    (known(a), known(b))
                };
            }
        });
    }

    /// Each number from where the flow comes from (or goes to, for a sign of -1).
    fn carry(&self, from: &Field, into: &mut Field, velocity: &[Field; 2], at: At, sign: f32) {
        let (stride, [known, open]) = (from.stride(), self.places.known_and_open(at));
        for_rows(into, self.spans, |y, row, start, end, _| {
            for x in start..end {
                let place = (y + 1) * stride + x + 1;
                if open.values[place] == 0.0 {
                    row[x + 1] = 0.0;
                    continue;
                }
                let (origin, is_free) = self.origin(velocity, at, x, y, place, stride, sign);
                let corners = Corners::new(origin, stride);
                row[x + 1] = if is_free {
                    corners.interpolate(&from.values)
                } else {
                    corners.interpolate_known(&from.values, &known.values).unwrap_or(from.values[place])
                };
            }
        });
    }

    /// Takes half of what came back wrong off what was carried, within the numbers that it was made of.
    fn correct(&self, from: &Field, carried: &mut Field, returned: &Field, velocity: &[Field; 2], at: At) {
        let (stride, [known, open]) = (from.stride(), self.places.known_and_open(at));
        for_rows(carried, self.spans, |y, row, start, end, _| {
            for x in start..end {
                let place = (y + 1) * stride + x + 1;
                if open.values[place] == 0.0 {
                    continue;
                }
                let (origin, is_free) = self.origin(velocity, at, x, y, place, stride, 1.0);
                let corners = Corners::new(origin, stride);
                let [least, most] = corners.bounds(&from.values, (!is_free).then_some(&known.values[..]));
                if least <= most {
                    let corrected = row[x + 1] + 0.5 * (from.values[place] - returned.values[place]);
                    row[x + 1] = corrected.clamp(least, most);
                }
            }
        });
    }

    /// Where the flow at a number of a field comes from, in cells from the first number of that field; and whether no wall is
    /// near the way.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "the inner loop hands over what it knows already")]
    fn origin(
        &self,
        [u, v]: &[Field; 2],
        at: At,
        x: usize,
        y: usize,
        place: usize,
        stride: usize,
        sign: f32,
    ) -> (Vec2, bool) {
        let (u, v) = (&u.values, &v.values);
        let velocity = match at {
            At::Left => {
                Vec2::new(u[place], 0.25 * ((v[place - 1] + v[place]) + (v[place + stride - 1] + v[place + stride])))
            }
            At::Below => {
                Vec2::new(0.25 * ((u[place - stride] + u[place - stride + 1]) + (u[place] + u[place + 1])), v[place])
            }
            At::Middle => Vec2::new(0.5 * (u[place] + u[place + 1]), 0.5 * (v[place] + v[place + stride])),
        };
        let way = (velocity * (self.cells_per_velocity * sign))
            .clamp(Vec2::splat(-MAX_CELLS_PER_STEP), Vec2::splat(MAX_CELLS_PER_STEP));
        let here = Vec2::new(x as f32, y as f32);
        // Nothing that is read lies farther from the cell than that.
        let is_free = f32::from(self.places.clearance[place]) > way.abs().max_element() + 2.0;
        (if is_free { here - way } else { self.origin_beside_walls(here, way, at) }, is_free)
    }

    /// The same where walls may be in the way: it stops before them.
    fn origin_beside_walls(&self, here: Vec2, way: Vec2, at: At) -> Vec2 {
        let offset = at.offset();
        let steps = way.abs().max_element().ceil().max(1.0);
        let is_wet = |number: Vec2| {
            let cell = (number + offset + 0.5).floor();
            let size = self.places.wet.size;
            cell.cmpge(Vec2::ZERO).all()
                && cell.cmplt(size.as_vec2()).all()
                && self.places.wet.at(UVec2::new(cell.x as u32, cell.y as u32)) > 0.0
        };
        let mut reached = here;
        for step in 1..=steps as u32 {
            let next = here - way * (step as f32 / steps);
            if !is_wet(next) {
                break;
            }
            reached = next;
        }
        reached
    }
}
