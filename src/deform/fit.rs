//! A lattice from pairs of places: least squares with smoothness, as registration needs it (paper of 2001, section 6).

use super::lattice::{DeformLattice, Tree, corner};
use crate::deform::LatticeError;
use bevy::reflect::Reflect;
use glam::{DVec3, Vec3};

/// How much of the smoothness also pulls towards rest of the slopes, so that vertices far from all pairs have one answer.
const MEMBRANE: f64 = 1e-3;

/// How far the conjugate gradients go down, as a share of what they begin with.
const SETTLED: f64 = 1e-9;

/// How well a lattice fits its pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct FitReport {
    /// Root of the mean square of the distances that are left, in shares of the box.
    pub rms: f64,
    /// Largest distance that is left, in shares of the box.
    pub worst: f64,
    /// Steps of the solver.
    pub steps: usize,
}

impl DeformLattice {
    /// Sets the translations so that for each pair the matter of its first place, at rest, is shown at its second; both in shares
    /// of the box. The tree stays: it says how fine the answer can be.
    ///
    /// What is least is the mean squared distance plus `smoothness` times the field's squared second derivatives, integrated over
    /// the box. 1e-6 suits exact pairs, 1e-5 those that are known to a five hundredth of the box; with 1e-2 hardly more than an affine
    /// deformation is left, which costs next to nothing. Vertices far from all pairs go on as their neighbours do.
    ///
    /// # Errors
    /// [`LatticeError::NoPairs`], [`LatticeError::NoPlace`] for one that is not finite in single precision, and [`LatticeError::NotSmooth`] where
    /// `smoothness` is not a number above 0: vertices that no pair touches could then be anywhere. The lattice stays as it was.
    pub fn fit_points(&mut self, pairs: &[(DVec3, DVec3)], smoothness: f64) -> Result<FitReport, LatticeError> {
        if pairs.is_empty() {
            return Err(LatticeError::NoPairs);
        }
        let places = pairs.iter().flat_map(|&(rest, shown)| [rest, shown]);
        if let Some(place) = places.into_iter().find(|place| !place.as_vec3().is_finite()) {
            return Err(LatticeError::NoPlace { place });
        }
        if !(smoothness.is_finite() && smoothness > 0.0) {
            return Err(LatticeError::NotSmooth { smoothness });
        }
        let mut rows = Rows::new(self.tree());
        let per_pair = (1.0 / pairs.len() as f64).sqrt();
        for &(rest, shown) in pairs {
            rows.push_pair(self.tree(), rest, shown, per_pair);
        }
        push_smoothness(&mut rows, self.tree(), smoothness);
        let (solved, steps) = rows.solve();
        let mut translations = vec![Vec3::ZERO; self.tree().vertex_count()];
        for (translation, free) in translations.iter_mut().zip(&rows.free_of) {
            // Those of constrained vertices do not count.
            *translation = if let [(free, _)] = free[..] { solved[free as usize].as_vec3() } else { Vec3::ZERO };
        }
        self.set_translations(&translations)?;
        let left = pairs.iter().map(|&(rest, shown)| self.rest_from_shown(shown).distance(rest));
        let (sum, worst) = left.fold((0.0, 0.0_f64), |(sum, worst), one| (sum + one * one, worst.max(one)));
        Ok(FitReport { rms: (sum / pairs.len() as f64).sqrt(), worst, steps })
    }
}

/// Linear equations for the translations of free vertices, to be met as nearly as possible.
struct Rows {
    /// Free vertices that each vertex is a mean of, with their weights; itself where it is free.
    free_of: Vec<Vec<(u32, f64)>>,
    free: usize,
    /// First entry of each row, and the end of the last.
    starts: Vec<usize>,
    entries: Vec<(u32, f64)>,
    /// Right sides; those of the rows beyond are 0.
    targets: Vec<DVec3>,
}

impl Rows {
    fn new(tree: &Tree) -> Self {
        let mut free = 0;
        let mut free_of: Vec<Vec<(u32, f64)>> = (0..tree.vertex_count())
            .map(|vertex| {
                if tree.is_constrained(vertex) {
                    return Vec::new();
                }
                free += 1;
                vec![(free - 1, 1.0)]
            })
            .collect();
        for constraint in tree.constraints() {
            let share = 1.0 / constraint.of.len() as f64;
            free_of[constraint.vertex] = constraint.of.iter().map(|&master| (free_of[master][0].0, share)).collect();
        }
        Self { free_of, free: free as usize, starts: vec![0], entries: Vec::new(), targets: Vec::new() }
    }

    /// A row of vertices and their weights.
    fn push(&mut self, vertices: impl IntoIterator<Item = (usize, f64)>) {
        for (vertex, weight) in vertices {
            self.entries.extend(self.free_of[vertex].iter().map(|&(free, share)| (free, share * weight)));
        }
        self.starts.push(self.entries.len());
    }

    /// The translation at the shown place leads to the place at rest.
    fn push_pair(&mut self, tree: &Tree, rest: DVec3, shown: DVec3, weight: f64) {
        let number = tree.patch_at(shown);
        let patch = tree.patches()[number];
        let share = ((shown - patch.low()) / patch.side()).clamp(DVec3::ZERO, DVec3::ONE);
        let of_corner = |n: usize| {
            let upper = corner(n).as_dvec3();
            (upper * share + (1.0 - upper) * (1.0 - share)).element_product() * weight
        };
        let corners = tree.corners(number);
        self.push((0..8).map(|n| (corners[n], of_corner(n))));
        self.targets.push((rest - shown) * weight);
    }

    fn rows(&self) -> impl Iterator<Item = &[(u32, f64)]> {
        self.starts.windows(2).map(|ends| &self.entries[ends[0]..ends[1]])
    }

    /// The normal equations' matrix times a vector.
    fn apply(&self, of: &[DVec3], into: &mut [DVec3]) {
        into.fill(DVec3::ZERO);
        for row in self.rows() {
            let sum: DVec3 = row.iter().map(|&(free, weight)| of[free as usize] * weight).sum();
            for &(free, weight) in row {
                into[free as usize] += sum * weight;
            }
        }
    }

    /// Conjugate gradients on the normal equations, for the three axes at once, scaled by the diagonal; and how many steps.
    fn solve(&self) -> (Vec<DVec3>, usize) {
        let mut diagonal = vec![0.0; self.free];
        let mut residual = vec![DVec3::ZERO; self.free];
        for (number, row) in self.rows().enumerate() {
            let target = self.targets.get(number).copied().unwrap_or_default();
            for &(free, weight) in row {
                diagonal[free as usize] += weight * weight;
                residual[free as usize] += target * weight;
            }
        }
        let scaled = |residual: &[DVec3]| -> Vec<DVec3> {
            residual.iter().zip(&diagonal).map(|(residual, diagonal)| *residual / *diagonal).collect()
        };
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
        // An axis on which there is nothing left to do.
        let over = |a: DVec3, b: DVec3| DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO);
        let mut solved = vec![DVec3::ZERO; self.free];
        let mut direction = scaled(&residual);
        let mut image = vec![DVec3::ZERO; self.free];
        let mut left = dot(&residual, &direction);
        let enough = left * SETTLED * SETTLED;
        let most = 20 * self.free + 100;
        for step in 0..most {
            if left.cmple(enough).all() {
                return (solved, step);
            }
            self.apply(&direction, &mut image);
            let length = over(left, dot(&direction, &image));
            for n in 0..self.free {
                solved[n] += direction[n] * length;
                residual[n] -= image[n] * length;
            }
            let preconditioned = scaled(&residual);
            let now = dot(&residual, &preconditioned);
            let turn = over(now, left);
            for (direction, preconditioned) in direction.iter_mut().zip(preconditioned) {
                *direction = preconditioned + *direction * turn;
            }
            left = now;
        }
        (solved, most)
    }
}

/// Rows whose squares add up to the integral of the squared second derivatives, and a little of the first ones.
fn push_smoothness(rows: &mut Rows, tree: &Tree, smoothness: f64) {
    let sign = |n: usize, axes: usize| if (!n & axes).count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
    // Derivative along an axis in the middle of a patch.
    let slope = |number: usize, axis: usize, weight: f64| {
        let (corners, side) = (tree.corners(number), tree.patches()[number].side());
        (0..8).map(move |n| (corners[n], sign(n, 1 << axis) * weight * 0.25 / side))
    };
    for (number, &patch) in tree.patches().iter().enumerate() {
        let side = patch.side();
        let corners = tree.corners(number);
        // Mixed derivatives: along two axes they are constant along these, and change along the third.
        for axes in [0b011, 0b110, 0b101] {
            let weight = (2.0 * smoothness * side.powi(3)).sqrt() * 0.5 / side.powi(2);
            rows.push((0..8).map(|n| (corners[n], sign(n, axes) * weight)));
        }
        let weight = (0.5 * smoothness * side.powi(5)).sqrt() / side.powi(3);
        rows.push((0..8).map(|n| (corners[n], sign(n, 0b111) * weight)));
        for axis in 0..3 {
            // Slopes across this side and the next patch.
            let mut beyond = patch.low() + 0.5 * side;
            for direction in [-1.0, 1.0] {
                beyond[axis] = patch.low()[axis] + 0.5 * side + direction * 0.51 * side;
                if beyond[axis] < 0.0 || beyond[axis] > 1.0 {
                    continue;
                }
                let other = tree.patch_at(beyond);
                let other_side = tree.patches()[other].side();
                // Each pair once: from the finer one, or from the lower one.
                if other_side > side || (other_side == side && direction > 0.0) {
                    let apart = 0.5 * (side + other_side);
                    let weight = (smoothness * side * side / apart).sqrt();
                    rows.push(slope(number, axis, weight).chain(slope(other, axis, -weight)));
                }
            }
            for n in (0..8).filter(|n| n >> axis & 1 == 0) {
                let weight = (MEMBRANE * smoothness * 0.25 * side).sqrt();
                rows.push([(corners[n], -weight), (corners[n | 1 << axis], weight)]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum of the squared rows for a field.
    fn energy(lattice: &DeformLattice, field: impl Fn(DVec3) -> f64) -> f64 {
        let tree = lattice.tree();
        let mut rows = Rows::new(tree);
        push_smoothness(&mut rows, tree, 1.0);
        let free: Vec<f64> = (0..tree.vertex_count())
            .filter(|&vertex| !tree.is_constrained(vertex))
            .map(|vertex| field(tree.place_of(vertex)))
            .collect();
        rows.rows().map(|row| row.iter().map(|&(n, weight)| weight * free[n as usize]).sum::<f64>().powi(2)).sum()
    }

    #[test]
    fn smoothness_is_the_integral_of_squared_second_derivatives() {
        let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 3).expect("a lattice");
        for deeper in [false, true] {
            if deeper {
                let number = lattice.tree().patch_at(DVec3::splat(0.4));
                lattice.subdivide(lattice.tree().patches()[number]).expect("it is there");
            }
            let close = |found: f64, expected: f64, share: f64| {
                assert!((found - expected).abs() < share * expected, "{found} instead of {expected}");
            };
            // Affine fields cost what the slopes do, and that is little.
            close(energy(&lattice, |p| 3.0 * p.x - p.y + 2.0), MEMBRANE * 10.0, 1e-9);
            let no_slopes = |found: f64, slopes: f64| found - MEMBRANE * slopes;
            close(no_slopes(energy(&lattice, |p| p.x * p.y), 2.0 / 3.0), 2.0, 0.01);
            close(no_slopes(energy(&lattice, |p| p.y * p.z), 2.0 / 3.0), 2.0, 0.01);
            close(no_slopes(energy(&lattice, |p| p.x * p.y * p.z), 1.0 / 3.0), 2.0, 0.01);
            // Half a patch at each side has no second difference; where patches are finer the square is not met exactly.
            for axis in 0..3 {
                close(no_slopes(energy(&lattice, |p| p[axis] * p[axis]), 4.0 / 3.0), 4.0 * 0.875, 0.01);
            }
        }
    }
}
