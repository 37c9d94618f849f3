//! Carrying quantities with the flow.

use super::field::{At, FRAME, Field, for_rows_of_two, row_sum, rows_at_once};
use super::places::Places;
use super::vectors::{Lanes, Vectors, Work};
use super::{Advection, MAX_CELLS_PER_STEP};
use rayon::prelude::*;

/// What carries, and where.
#[derive(Clone, Copy)]
pub(super) struct Flow<'a> {
    pub places: &'a Places,
    pub vectors: Vectors,
    /// Cells that a velocity of 1 goes in a step.
    pub cells_per_velocity: f32,
}

impl Flow<'_> {
    /// Carries a velocity, the reflected one if there is one and otherwise the velocity itself, with the velocity.
    pub fn carry_velocity(
        &self,
        velocity: &[Field; 2],
        reflected: Option<&[Field; 2]>,
        next: &mut [Field; 2],
        other: &mut [Field; 2],
        advection: Advection,
    ) {
        let from = reflected.unwrap_or(velocity);
        let carry = |into: &mut [Field; 2], carried: Option<&[Field; 2]>| {
            for_rows_of_two(into, |y, [u, v]| {
                for (axis, at, out) in [(0, At::Left, u), (1, At::Below, v)] {
                    let carried = carried.map(|carried| [carried[axis].values()]);
                    let quantities =
                        Quantities { from: [from[axis].values()], carried, factors: [1.0], are_summed: false };
                    self.vectors.run(Row { flow: *self, by: velocity, at, y, quantities, into: [out] });
                }
            });
        };
        carry(next, None);
        if advection == Advection::MacCormack {
            carry(other, Some(next));
            std::mem::swap(next, other);
        }
    }

    /// Carries what is dissolved, times factors, and returns the sums.
    pub fn carry_dissolved(
        &self,
        dissolved: &mut [Field; 2],
        factors: [f32; 2],
        velocity: &[Field; 2],
        [next, other]: [&mut [Field; 2]; 2],
        advection: Advection,
    ) -> [f64; 2] {
        let from = dissolved.each_ref().map(Field::values);
        let carry = |into: &mut [Field; 2], carried: Option<&[Field; 2]>, factors: [f32; 2]| {
            let carried = carried.map(|carried| carried.each_ref().map(Field::values));
            let at_once = rows_at_once(into[0].stride());
            let [a, b] = into;
            let rows = a.rows_mut().zip(b.rows_mut()).enumerate().with_min_len(at_once);
            let sums = rows.map(|(y, (a, b))| {
                let quantities = Quantities { from, carried, factors, are_summed: true };
                self.vectors.run(Row { flow: *self, by: velocity, at: At::Middle, y, quantities, into: [a, b] })
            });
            sums.collect::<Vec<_>>()
        };
        let sums = match advection {
            Advection::SemiLagrangian => carry(next, None, factors),
            Advection::MacCormack => {
                carry(next, None, [1.0; 2]);
                let sums = carry(other, Some(next), factors);
                std::mem::swap(next, other);
                sums
            }
        };
        std::mem::swap(dissolved, next);
        sums.iter().fold([0.0; 2], |sum, row| [sum[0] + row[0], sum[1] + row[1]])
    }
}

/// What goes the same ways.
#[derive(Clone, Copy)]
struct Quantities<'a, const N: usize> {
    from: [&'a [f32]; N],
    /// What they were carried to before; then it is corrected.
    carried: Option<[&'a [f32]; N]>,
    factors: [f32; N],
    are_summed: bool,
}

/// A row of cells to carry to.
struct Row<'a, const N: usize> {
    flow: Flow<'a>,
    by: &'a [Field; 2],
    at: At,
    y: usize,
    quantities: Quantities<'a, N>,
    into: [&'a mut [f32]; N],
}

impl<const N: usize> Work for Row<'_, N> {
    type Output = [f64; N];

    #[inline(always)]
    fn run<L: Lanes>(mut self) -> [f64; N] {
        let spans = &self.flow.places.spans;
        for span in spans.of_row(self.y) {
            for x in (span.start..span.end).step_by(L::COUNT) {
                let numbers = match self.quantities.carried {
                    None => self.carried::<L>(x),
                    Some(carried) => self.corrected::<L>(x, carried),
                };
                for (numbers, into) in numbers.into_iter().zip(&mut self.into) {
                    L::store(numbers, &mut into[FRAME + x..]);
                }
            }
        }
        let mut sums = [0.0; N];
        if self.quantities.are_summed {
            for (sum, row) in sums.iter_mut().zip(self.into) {
                *sum = row_sum(row, spans, self.y);
            }
        }
        sums
    }
}

/// Where the flow goes from some numbers of a field.
struct Ways<L: Lanes> {
    /// The numbers, in cells from the field's first.
    here: [L::Numbers; 2],
    way: [L::Numbers; 2],
    longest: L::Numbers,
    /// Whether no wall is near the way there or back.
    is_free: L::Mask,
    are_all_free: bool,
}

impl<const N: usize> Row<'_, N> {
    /// In memory.
    #[inline(always)]
    fn place(&self, x: usize) -> usize {
        (self.y + 1) * self.by[0].stride() + FRAME + x
    }

    #[inline(always)]
    fn ways<L: Lanes>(&self, x: usize) -> Ways<L> {
        let [u, v] = [self.by[0].values(), self.by[1].values()];
        let (place, stride) = (self.place(x), self.by[0].stride());
        let [u, v] = match self.at {
            At::Left => {
                let v = [sum_of::<L>(v, place - 1, place), sum_of::<L>(v, place + stride - 1, place + stride)];
                [L::load(&u[place..]), L::mul(L::splat(0.25), L::add(v[0], v[1]))]
            }
            At::Below => {
                let u = [sum_of::<L>(u, place - stride, place - stride + 1), sum_of::<L>(u, place, place + 1)];
                [L::mul(L::splat(0.25), L::add(u[0], u[1])), L::load(&v[place..])]
            }
            At::Middle => {
                let half = L::splat(0.5);
                let (u, v) = (sum_of::<L>(u, place, place + 1), sum_of::<L>(v, place, place + stride));
                [L::mul(half, u), L::mul(half, v)]
            }
        };
        let way = [limited::<L>(u, self.flow.cells_per_velocity), limited::<L>(v, self.flow.cells_per_velocity)];
        let (along, across) = (magnitude::<L>(way[0]), magnitude::<L>(way[1]));
        let longest = L::max(along, across);
        let clearance = L::load_bytes(&self.flow.places.clearance[place..]);
        // Nothing that is read lies farther from the cell than that. What is no number is never free.
        let far = L::add(longest, L::splat(2.0));
        let is_free = L::and(L::is_less(far, clearance), L::is_less(along, clearance));
        let here = [L::add(L::splat(x as f32), L::steps()), L::splat(self.y as f32)];
        Ways { here, way, longest, is_free, are_all_free: !L::any(L::not(is_free)) }
    }

    #[inline(always)]
    fn carried<L: Lanes>(&self, x: usize) -> [L::Numbers; N] {
        let place = self.place(x);
        let Quantities { from, factors, .. } = self.quantities;
        let ways = self.ways::<L>(x);
        let origin = self.origin::<L>(&ways, false);
        let corners = Corners::<L>::new(origin, self.by[0].stride());
        let mut numbers = [L::splat(0.0); N];
        if ways.are_all_free {
            for k in 0..N {
                numbers[k] = L::mul(corners.interpolate(corners.values(from[k])), L::splat(factors[k]));
            }
            return numbers;
        }
        let [known, open] = self.flow.places.known_and_open(self.at);
        let is_open = L::is_less(L::splat(0.0), L::load(&open.values()[place..]));
        if !L::any(is_open) {
            return numbers;
        }
        let known = corners.known(known.values());
        for k in 0..N {
            let values = corners.values(from[k]);
            let beside_walls = known.interpolate(values, L::load(&from[k][place..]));
            let number = L::select(ways.is_free, corners.interpolate(values), beside_walls);
            numbers[k] = L::select(is_open, L::mul(number, L::splat(factors[k])), L::splat(0.0));
        }
        numbers
    }

    /// What was carried, without half of what comes back wrong when it is carried back, within the numbers that it was made of.
    #[inline(always)]
    fn corrected<L: Lanes>(&self, x: usize, carried: [&[f32]; N]) -> [L::Numbers; N] {
        let place = self.place(x);
        let Quantities { from, factors, .. } = self.quantities;
        let ways = self.ways::<L>(x);
        let stride = self.by[0].stride();
        let corners = Corners::<L>::new(self.origin::<L>(&ways, false), stride);
        let back = Corners::<L>::new(self.origin::<L>(&ways, true), stride);
        let mut numbers = [L::splat(0.0); N];
        if ways.are_all_free {
            for k in 0..N {
                let own = L::load(&carried[k][place..]);
                let returned = back.interpolate(back.values(carried[k]));
                let corrected = less_half_the_error::<L>(own, L::load(&from[k][place..]), returned);
                let [a, b, c, d] = corners.values(from[k]);
                let least = L::min(L::min(a, b), L::min(c, d));
                let most = L::max(L::max(a, b), L::max(c, d));
                numbers[k] = L::mul(L::min(most, L::max(least, corrected)), L::splat(factors[k]));
            }
            return numbers;
        }
        let [known, open] = self.flow.places.known_and_open(self.at);
        let is_open = L::is_less(L::splat(0.0), L::load(&open.values()[place..]));
        if !L::any(is_open) {
            return numbers;
        }
        let (known_there, known_back) = (corners.known(known.values()), back.known(known.values()));
        let (low, high) = (L::splat(f32::NEG_INFINITY), L::splat(f32::INFINITY));
        for k in 0..N {
            let own = L::load(&carried[k][place..]);
            let values = back.values(carried[k]);
            let returned = L::select(ways.is_free, back.interpolate(values), known_back.interpolate(values, own));
            let corrected = less_half_the_error::<L>(own, L::load(&from[k][place..]), returned);
            let (mut least, mut most) = (high, low);
            let values = corners.values(from[k]);
            for (value, factor) in values.into_iter().zip(known_there.factors) {
                let counts = L::is_less(L::splat(0.0), factor);
                least = L::min(least, L::select(counts, value, high));
                most = L::max(most, L::select(counts, value, low));
            }
            let limited = L::select(L::is_less(most, least), own, L::min(most, L::max(least, corrected)));
            numbers[k] = L::select(is_open, L::mul(limited, L::splat(factors[k])), L::splat(0.0));
        }
        numbers
    }

    /// Where the flow comes from, or goes to, in cells from the first number of the field.
    #[inline(always)]
    fn origin<L: Lanes>(&self, ways: &Ways<L>, is_back: bool) -> [L::Numbers; 2] {
        let Ways { here, way: [along, across], .. } = *ways;
        let zero = L::splat(0.0);
        let way = if is_back { [L::sub(zero, along), L::sub(zero, across)] } else { [along, across] };
        let origin = [L::sub(here[0], way[0]), L::sub(here[1], way[1])];
        if ways.are_all_free {
            return origin;
        }
        let stopped = self.origin_beside_walls::<L>(ways, way);
        [L::select(ways.is_free, origin[0], stopped[0]), L::select(ways.is_free, origin[1], stopped[1])]
    }

    /// The same where walls may be in the way: it stops before them. Here where none are.
    #[inline(always)]
    fn origin_beside_walls<L: Lanes>(&self, ways: &Ways<L>, way: [L::Numbers; 2]) -> [L::Numbers; 2] {
        let wet = &self.flow.places.wet;
        let (values, stride, size) = (wet.values(), wet.stride() as f32, wet.size.as_vec2());
        let offset = self.at.offset() + 0.5;
        let zero = L::splat(0.0);
        // Whole steps of a cell at most.
        let one = L::splat(1.0);
        let steps = L::max(L::sub(zero, L::floor(L::sub(zero, ways.longest))), one);
        let mut reached = ways.here;
        let mut goes_on = L::not(ways.is_free);
        let mut step = one;
        loop {
            goes_on = L::and(goes_on, L::not(L::is_less(steps, step)));
            if !L::any(goes_on) {
                return reached;
            }
            let share = L::div(step, steps);
            let next = [L::sub(ways.here[0], L::mul(way[0], share)), L::sub(ways.here[1], L::mul(way[1], share))];
            let column = L::floor(L::add(next[0], L::splat(offset.x)));
            let row = L::floor(L::add(next[1], L::splat(offset.y)));
            // Beyond the grid there are walls; no way ends beyond the frame's rows, and the frame is dry.
            let is_below = L::and(L::is_less(column, L::splat(size.x)), L::is_less(row, L::splat(size.y)));
            let is_above = L::and(L::is_less(L::splat(-1.0), column), L::is_less(L::splat(-1.0), row));
            let place = L::add(L::mul(L::add(row, one), L::splat(stride)), L::add(column, L::splat(FRAME as f32)));
            let [is_wet, _] = L::pairs(values, place);
            goes_on = L::and(goes_on, L::and(L::and(is_below, is_above), L::is_less(zero, is_wet)));
            reached = [L::select(goes_on, next[0], reached[0]), L::select(goes_on, next[1], reached[1])];
            step = L::add(step, one);
        }
    }
}

/// Sum of the numbers at two places, and the same for those that follow.
#[inline(always)]
fn sum_of<L: Lanes>(of: &[f32], a: usize, b: usize) -> L::Numbers {
    L::add(L::load(&of[a..]), L::load(&of[b..]))
}

#[inline(always)]
fn magnitude<L: Lanes>(numbers: L::Numbers) -> L::Numbers {
    L::max(L::sub(L::splat(0.0), numbers), numbers)
}

/// What a velocity goes in a step, cells. What is no number stays it.
#[inline(always)]
fn limited<L: Lanes>(velocity: L::Numbers, cells_per_velocity: f32) -> L::Numbers {
    let way = L::mul(velocity, L::splat(cells_per_velocity));
    L::min(L::splat(MAX_CELLS_PER_STEP), L::max(L::splat(-MAX_CELLS_PER_STEP), way))
}

#[inline(always)]
fn less_half_the_error<L: Lanes>(carried: L::Numbers, from: L::Numbers, returned: L::Numbers) -> L::Numbers {
    L::add(carried, L::mul(L::splat(0.5), L::sub(from, returned)))
}

/// Four neighbours of places, in memory, and their weights.
struct Corners<L: Lanes> {
    places: L::Squares,
    stride: usize,
    weights: [L::Numbers; 4],
}

/// Which of them mean something.
struct Known<L: Lanes> {
    factors: [L::Numbers; 4],
    /// Weights of those alone, and their sum.
    weights: [L::Numbers; 4],
    weight: L::Numbers,
}

impl<L: Lanes> Corners<L> {
    /// Around places that lie in the grid or less than a cell beside it, in cells from the first number of the field.
    #[inline(always)]
    fn new(at: [L::Numbers; 2], stride: usize) -> Self {
        let one = L::splat(1.0);
        let (x, y) = (L::add(at[0], one), L::add(at[1], one));
        let (column, row) = (L::floor(x), L::floor(y));
        let (a, b) = (L::sub(x, column), L::sub(y, row));
        let (a_left, b_left) = (L::sub(one, a), L::sub(one, b));
        let weights = [L::mul(a_left, b_left), L::mul(a, b_left), L::mul(a_left, b), L::mul(a, b)];
        // Exact: no grid has more than 2^24 numbers.
        let row = L::add(L::mul(row, L::splat(stride as f32)), L::splat((FRAME - 1) as f32));
        Self { places: L::to_squares(L::add(row, column), stride), stride, weights }
    }

    #[inline(always)]
    fn values(&self, of: &[f32]) -> [L::Numbers; 4] {
        L::squares(of, &self.places, self.stride)
    }

    #[inline(always)]
    fn interpolate(&self, [a, b, c, d]: [L::Numbers; 4]) -> L::Numbers {
        let [wa, wb, wc, wd] = self.weights;
        L::add(L::add(L::mul(a, wa), L::mul(b, wb)), L::add(L::mul(c, wc), L::mul(d, wd)))
    }

    #[inline(always)]
    fn known(&self, known: &[f32]) -> Known<L> {
        let factors = self.values(known);
        let mut weights = self.weights;
        for k in 0..4 {
            weights[k] = L::mul(weights[k], factors[k]);
        }
        let [a, b, c, d] = weights;
        Known { factors, weights, weight: L::add(L::add(L::add(a, b), c), d) }
    }
}

impl<L: Lanes> Known<L> {
    /// From those numbers alone that mean something, or another number where there is none.
    #[inline(always)]
    fn interpolate(&self, [a, b, c, d]: [L::Numbers; 4], other: L::Numbers) -> L::Numbers {
        let [wa, wb, wc, wd] = self.weights;
        let sum = L::add(L::add(L::add(L::mul(wa, a), L::mul(wb, b)), L::mul(wc, c)), L::mul(wd, d));
        L::select(L::is_less(L::splat(1e-6), self.weight), L::div(sum, self.weight), other)
    }
}
