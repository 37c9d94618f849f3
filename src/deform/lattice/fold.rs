//! Whether a lattice folds over itself: the sign of the Jacobian's determinant everywhere.
//!
//! Inside a patch each column of the Jacobian is bilinear in the other two shares, so the determinant is a polynomial of degree
//! 2 along each axis. Its 27 coefficients in Bernstein's basis bound it from below and above, and halving the patch brings the
//! bounds together quadratically. Beyond the box the field is that of the box's side: there the minor along the side counts, which
//! is bilinear and least at a corner, and beyond the box's edges the slope along the edge.
//!
//! Where the determinant is above 0 in all of these, the map is a bijection of all space: around every edge lie at most four
//! pieces that each span less than half a turn, so they go round once; around every vertex they then cover all directions
//! once; and a map without branches that differs from the identity by a bounded translation is one to one.

use super::field::DeformLattice;
use super::tree::{Patch, corner};
use crate::deform::LatticeError;
use glam::{DMat3, DVec3};

/// A determinant below this counts as a fold: matter squeezed to a millionth cannot be told from matter turned inside out in
/// the precision that translations have.
const LEAST: f64 = 1e-6;

/// Parts of one patch that are looked at before it is given up. Patches in which the determinant is hardly above 0 along a
/// whole curved surface need many.
const MOST_PARTS: usize = 4096;

impl DeformLattice {
    /// Whether there is a way back from every place, also beyond the box: that is, whether the determinant of
    /// [`DeformLattice::jacobian_at`] is above 0 everywhere.
    ///
    /// # Errors
    /// [`LatticeError::Folded`] with the patch in which it is least.
    pub fn check_folds(&self) -> Result<(), LatticeError> {
        let mut worst: Option<(Patch, f64)> = None;
        for (number, &patch) in self.tree().patches().iter().enumerate() {
            if let Some(determinant) = self.fold_in(number, patch)
                && worst.is_none_or(|(_, least)| determinant < least)
            {
                worst = Some((patch, determinant));
            }
        }
        worst.map_or(Ok(()), |(patch, determinant)| Err(LatticeError::Folded { patch, determinant }))
    }

    /// Least determinant that was found in a patch, or beyond it where it lies on the box's side, if it folds.
    fn fold_in(&self, number: usize, patch: Patch) -> Option<f64> {
        let (corners, _, side) = self.patch(number);
        let edges = Edges::new(&corners, side);
        if edges.are_short() {
            return None;
        }
        let last = (1 << patch.level) - 1;
        let is_on_side = |axis: usize, end: usize| patch.cell[axis] == [0, last][end];
        edges.least_inside().into_iter().chain(edges.least_beyond(is_on_side)).min_by(f64::total_cmp)
    }
}

/// Columns of the Jacobian along the twelve edges of a patch: `along[a]` has the four edges of axis `a`, numbered by their ends
/// along the next axis and the one after it.
struct Edges {
    along: [[DVec3; 4]; 3],
}

impl Edges {
    fn new(corners: &[DVec3; 8], side: f64) -> Self {
        let per_side = 1.0 / side;
        let edge = |axis: usize, n: usize| {
            let low = (n & 1) << ((axis + 1) % 3) | (n >> 1) << ((axis + 2) % 3);
            DVec3::AXES[axis] + (corners[low | 1 << axis] - corners[low]) * per_side
        };
        Self { along: std::array::from_fn(|axis| std::array::from_fn(|n| edge(axis, n))) }
    }

    /// Whether the Jacobian differs so little from the identity that nothing can fold. Between the edges it is a mean of
    /// theirs, so its difference from the identity is nowhere longer than the longest ones together; below 1, no vector can
    /// be mapped to 0. The same holds beyond the box, where columns are those of the identity.
    fn are_short(&self) -> bool {
        let longest = |axis: usize| {
            let away = self.along[axis].map(|edge| (edge - DVec3::AXES[axis]).length_squared());
            away[0].max(away[1]).max(away[2].max(away[3]))
        };
        longest(0) + longest(1) + longest(2) < 0.9
    }

    /// Least determinant inside, if it is not above 0.
    fn least_inside(&self) -> Option<f64> {
        let mut waiting = vec![Quadratic(self.bernstein())];
        let mut least = f64::INFINITY;
        let mut folds = false;
        let mut parts = 0;
        while let Some(part) = waiting.pop() {
            let at_corners = (0..8).map(|n| part.at_corner(n)).fold(f64::INFINITY, f64::min);
            least = least.min(at_corners);
            folds |= at_corners <= LEAST;
            parts += 1;
            if parts >= MOST_PARTS {
                return Some(least);
            }
            let lower = part.lower();
            // Once it folds, only what may be lower still is of interest, and a hundredth more or less is not.
            let is_settled = if folds { lower > least - 0.01 } else { lower > 0.0 };
            if !is_settled {
                waiting.extend(part.halved());
            }
        }
        folds.then_some(least)
    }

    /// Coefficients of the determinant: a product of linear functions has the mean of their products.
    fn bernstein(&self) -> [f64; 27] {
        let mut coefficients = [0.0; 27];
        for x in 0..4 {
            for y in 0..4 {
                let cross = self.along[0][x].cross(self.along[1][y]);
                for z in 0..4 {
                    // Along x the edges of y and of z count, and so on round the axes.
                    let i = (y >> 1) + (z & 1);
                    let j = (x & 1) + (z >> 1);
                    let k = (x >> 1) + (y & 1);
                    let share = [1.0, 0.5, 1.0];
                    coefficients[(k * 3 + j) * 3 + i] += share[i] * share[j] * share[k] * cross.dot(self.along[2][z]);
                }
            }
        }
        coefficients
    }

    /// Least determinant beyond the sides and edges of the box that the patch lies on, if it is not above 0.
    fn least_beyond(&self, is_on_side: impl Fn(usize, usize) -> bool) -> Option<f64> {
        let mut least = f64::INFINITY;
        // Corners of the patch: the determinants of the pieces of space that meet there.
        for n in 0..8 {
            let at = corner(n);
            let ends: [usize; 3] = std::array::from_fn(|axis| at[axis] as usize);
            let beyond: [bool; 3] = std::array::from_fn(|axis| is_on_side(axis, ends[axis]));
            let own: [DVec3; 3] =
                std::array::from_fn(|axis| self.along[axis][ends[(axis + 1) % 3] | ends[(axis + 2) % 3] << 1]);
            for outside in 1..8 {
                if (0..3).all(|axis| outside >> axis & 1 == 0 || beyond[axis]) {
                    let column = |axis: usize| if outside >> axis & 1 == 1 { DVec3::AXES[axis] } else { own[axis] };
                    least = least.min(DMat3::from_cols(column(0), column(1), column(2)).determinant());
                }
            }
        }
        (least <= LEAST).then_some(least)
    }
}

/// A polynomial of degree 2 along each axis of the unit cube, by its coefficients in Bernstein's basis, x fastest.
struct Quadratic([f64; 27]);

impl Quadratic {
    const STRIDES: [usize; 3] = [1, 3, 9];

    /// It is nowhere less.
    fn lower(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Its value at a corner of the cube.
    fn at_corner(&self, n: usize) -> f64 {
        let at = corner(n) * 2;
        self.0[((at.z * 3 + at.y) * 3 + at.x) as usize]
    }

    /// Coefficients along an axis, by the places of the first of three.
    fn lines(axis: usize) -> impl Iterator<Item = usize> {
        (0..27).filter(move |place| place / Self::STRIDES[axis] % 3 == 0)
    }

    /// Its two halves along the axis along which it is bent most (de Casteljau).
    fn halved(&self) -> [Self; 2] {
        let bend = |axis: usize| {
            let stride = Self::STRIDES[axis];
            Self::lines(axis)
                .map(|first| (self.0[first] - 2.0 * self.0[first + stride] + self.0[first + 2 * stride]).abs())
                .fold(0.0, f64::max)
        };
        let bends = [bend(0), bend(1), bend(2)];
        let axis = if bends[0] >= bends[1] && bends[0] >= bends[2] { 0 } else { 1 + usize::from(bends[2] > bends[1]) };
        let stride = Self::STRIDES[axis];
        let (mut low, mut high) = (self.0, self.0);
        for first in Self::lines(axis) {
            let [a, b, c] = [self.0[first], self.0[first + stride], self.0[first + 2 * stride]];
            let (ab, bc) = (0.5 * (a + b), 0.5 * (b + c));
            let middle = 0.5 * (ab + bc);
            (low[first + stride], low[first + 2 * stride]) = (ab, middle);
            (high[first], high[first + stride]) = (middle, bc);
        }
        [Self(low), Self(high)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deform::lattice::field::trilinear_slopes;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg32;

    #[test]
    fn folds_in_the_middle_of_a_patch_are_found() {
        let mut random = Pcg32::seed_from_u64(5);
        let mut hidden = 0;
        for n in 0..3000 {
            let corners: [DVec3; 8] =
                std::array::from_fn(|_| DVec3::from_array(std::array::from_fn(|_| random.random_range(-0.7..0.7))));
            let edges = Edges::new(&corners, 1.0);
            let determinant = |share: DVec3| {
                let [x, y, z] = trilinear_slopes(corners, share);
                (DMat3::from_cols(x, y, z) + DMat3::IDENTITY).determinant()
            };
            let sample = |along: usize| {
                let part = |at: usize| (at % along) as f64 / (along - 1) as f64;
                (0..along.pow(3))
                    .map(|at| determinant(DVec3::new(part(at), part(at / along), part(at / along.pow(2)))))
                    .fold(f64::INFINITY, f64::min)
            };
            let (at_corners, dense) = (sample(2), sample(17));
            let bernstein = edges.bernstein();
            assert!(Quadratic(bernstein).lower() <= dense + 1e-9, "a lower bound");
            match edges.least_inside() {
                Some(least) => assert!(least <= dense + 0.01 && dense < least + 0.05, "{n}: {least} and {dense}"),
                None => assert!(dense > 0.0, "{n}: {dense}"),
            }
            hidden += usize::from(at_corners > 0.01 && dense < 0.0);
        }
        assert!(hidden > 10, "{hidden} folds that no corner shows");
    }
}
