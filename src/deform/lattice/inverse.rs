//! The way back: where the matter is shown that rests at a place (the exact inverse of equation 2, and equation 3).

use super::field::DeformLattice;
use crate::deform::LatticeError;
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// A residual below this is none, in shares of the box (of the place's distance, where that is longer).
const EXACT: f64 = 1e-14;

/// Newton's steps before the search takes over. Where the map is smooth three or four are enough.
const MOST_STEPS: usize = 24;

/// Points that one thread takes at once.
const CHUNK: usize = 256;

impl DeformLattice {
    /// The exact way back. Folds are looked for once, here.
    ///
    /// # Errors
    /// [`LatticeError::Folded`] where two places show the same matter.
    pub fn inverse(&self) -> Result<LatticeInverse<'_>, LatticeError> {
        self.check_folds()?;
        let pieces = (0..self.tree().patches().len()).map(|number| Piece::new(self.patch(number))).collect();
        let bound = |pick: fn(Vec3, Vec3) -> Vec3| {
            self.translations().iter().copied().reduce(pick).unwrap_or_default().as_dvec3()
        };
        Ok(LatticeInverse { lattice: self, pieces, least: bound(Vec3::min), most: bound(Vec3::max) })
    }

    /// Where matter is shown, nearly: with negated translations (equation 3), in shares of the box. The error grows with the
    /// square of the translations (equation 4).
    pub fn approximate_shown_from_rest(&self, rest: DVec3) -> DVec3 {
        rest - self.translation_at(rest)
    }
}

/// The exact inverse of [`DeformLattice::rest_from_shown`], from [`DeformLattice::inverse`].
///
/// Newton's method goes from patch to patch, with shorter steps where the residual would grow. Where that gets stuck, patches whose
/// image may hold the place are searched: the image of a box in a patch lies between the images of its corners, so the box
/// around those tells which to halve and which to leave.
#[derive(Clone, Debug)]
pub struct LatticeInverse<'a> {
    lattice: &'a DeformLattice,
    pieces: Vec<Piece>,
    /// Bounds of all translations.
    least: DVec3,
    most: DVec3,
}

impl LatticeInverse<'_> {
    /// The lattice that it undoes.
    pub fn lattice(&self) -> &DeformLattice {
        self.lattice
    }

    /// Where the matter is shown that rests at a place; both in shares of the box, and also beyond it. What is no number stays
    /// none.
    pub fn shown_from_rest(&self, rest: DVec3) -> DVec3 {
        self.shown_from_rest_near(rest, rest - self.at(rest).0)
    }

    /// The same from a guess, such as where it was shown a frame ago; a good one saves a step or two.
    pub fn shown_from_rest_near(&self, rest: DVec3, guess: DVec3) -> DVec3 {
        if !rest.is_finite() {
            return DVec3::NAN;
        }
        let guess = if guess.is_finite() { guess } else { rest };
        let (shown, residual) = self.newton(rest, guess);
        if residual <= exact(rest) { shown } else { self.search(rest).unwrap_or(shown) }
    }

    /// Where the matter is shown that rests at a place; both in the body's own space, metres.
    pub fn shown_from_rest_m(&self, rest_m: Vec3) -> Vec3 {
        let rest = self.lattice.box_from_body().transform_point3(rest_m).as_dvec3();
        self.lattice.body_from_box().transform_point3(self.shown_from_rest(rest).as_vec3())
    }

    /// [`LatticeInverse::shown_from_rest`] of many places, on all threads; each result is the same on any number of them.
    pub fn all_shown_from_rest(&self, rests: &[DVec3]) -> Vec<DVec3> {
        let mut shown = vec![DVec3::ZERO; rests.len()];
        shown.par_chunks_mut(CHUNK).zip(rests.par_chunks(CHUNK)).for_each(|(shown, rests)| {
            for (shown, rest) in shown.iter_mut().zip(rests) {
                *shown = self.shown_from_rest(*rest);
            }
        });
        shown
    }

    /// Translation and Jacobian at a place.
    #[inline]
    fn at(&self, place: DVec3) -> (DVec3, DMat3) {
        self.pieces[self.lattice.tree().patch_at(place)].at(place)
    }

    /// Where Newton's method ends, and how far the image of that is from the place.
    fn newton(&self, rest: DVec3, guess: DVec3) -> (DVec3, f64) {
        let enough = exact(rest);
        let mut shown = guess;
        let (translation, mut jacobian) = self.at(shown);
        let mut away = shown + translation - rest;
        let mut residual = away.length();
        for _ in 0..MOST_STEPS {
            if residual <= enough {
                break;
            }
            let step = solve(&jacobian, away);
            let mut share = 1.0;
            let better = loop {
                let next = shown - step * share;
                let (translation, jacobian) = self.at(next);
                let away = next + translation - rest;
                let length = away.length();
                if length < residual * (1.0 - 0.1 * share) {
                    break Some((next, jacobian, away, length));
                }
                share *= 0.5;
                if share < 0.05 {
                    break None;
                }
            };
            let Some(better) = better else { break };
            (shown, jacobian, away, residual) = better;
        }
        (shown, residual)
    }

    /// Looks through all patches, and the space beyond those on the box's sides, for the place whose image is wanted.
    fn search(&self, rest: DVec3) -> Option<DVec3> {
        // Nothing is shown farther from where it rests than the largest translation.
        let slack = 1e-9 * (1.0 + rest.abs().max_element());
        let (first, last) = (rest - self.most - slack, rest - self.least + slack);
        for piece in &self.pieces {
            let (low, high) = (piece.low, piece.low + piece.side);
            // Along each axis: before the box, in the patch, beyond the box.
            let from = |axis: usize| [f64::NEG_INFINITY, low[axis], 1.0];
            let to = |axis: usize| [0.0, high[axis], f64::INFINITY];
            let is_there = |axis: usize, n: usize| [low[axis] == 0.0, true, high[axis] == 1.0][n];
            for n in 0..27 {
                let pick = [n % 3, n / 3 % 3, n / 9];
                let part = |bound: &dyn Fn(usize) -> [f64; 3]| {
                    DVec3::from_array(std::array::from_fn(|axis| bound(axis)[pick[axis]]))
                };
                let (low, high) = (part(&from).max(first), part(&to).min(last));
                if (0..3).all(|axis| is_there(axis, pick[axis]))
                    && low.cmple(high).all()
                    && let Some(found) = self.search_in(piece, low, high, rest)
                {
                    return Some(found);
                }
            }
        }
        None
    }

    /// Looks in a box in which the map is trilinear.
    fn search_in(&self, piece: &Piece, low: DVec3, high: DVec3, rest: DVec3) -> Option<DVec3> {
        let mut waiting = vec![(low, high)];
        while let Some((low, high)) = waiting.pop() {
            let size = high - low;
            let images = (0..8).map(|n| {
                let at = low + size * super::tree::corner(n).as_dvec3();
                at + piece.at(at).0 - rest
            });
            let (least, most) =
                images.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), image| (a.min(image), b.max(image)));
            let slack = DVec3::splat(4.0 * exact(rest));
            if least.cmpgt(slack).any() || most.cmplt(-slack).any() {
                continue;
            }
            let (found, residual) = self.newton(rest, low + size * 0.5);
            if residual <= exact(rest) {
                return Some(found);
            }
            if size.max_element() > 1e-13 {
                // Halved along its longest side.
                let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
                let (mut before, mut behind) = (high, low);
                before[axis] = low[axis] + 0.5 * size[axis];
                behind[axis] = before[axis];
                waiting.extend([(behind, high), (low, before)]);
            }
        }
        None
    }
}

/// What counts as no residual at a place.
fn exact(rest: DVec3) -> f64 {
    EXACT * rest.abs().max_element().max(1.0)
}

/// Solves by Cramer's rule.
fn solve(matrix: &DMat3, right: DVec3) -> DVec3 {
    let (a, b, c) = (matrix.x_axis, matrix.y_axis, matrix.z_axis);
    let bc = b.cross(c);
    let per_determinant = 1.0 / a.dot(bc);
    let along = right.cross(a);
    DVec3::new(right.dot(bc), -along.dot(c), along.dot(b)) * per_determinant
}

/// The field in one patch as a polynomial of the shares.
#[derive(Clone, Copy, Debug)]
struct Piece {
    low: DVec3,
    side: f64,
    per_side: f64,
    /// Of 1, x, y, xy, z, xz, yz, xyz.
    terms: [DVec3; 8],
}

impl Piece {
    fn new((corners, low, side): ([DVec3; 8], DVec3, f64)) -> Self {
        let mut terms = corners;
        for bit in [1, 2, 4] {
            for n in (0..8).filter(|n| n & bit != 0) {
                terms[n] -= terms[n ^ bit];
            }
        }
        Self { low, side, per_side: 1.0 / side, terms }
    }

    /// Translation and Jacobian of the map at a place in the patch, or beyond the box next to it.
    #[inline]
    fn at(&self, place: DVec3) -> (DVec3, DMat3) {
        let [o, x, y, xy, z, xz, yz, xyz] = self.terms;
        let unclamped = (place - self.low) * self.per_side;
        let s = unclamped.clamp(DVec3::ZERO, DVec3::ONE);
        let (y_of_x, y_of_z) = (xy + xyz * s.z, yz + xyz * s.x);
        let along_y = y + xy * s.x + y_of_z * s.z;
        let along_x = x + y_of_x * s.y + xz * s.z;
        let along_z = z + xz * s.x + y_of_z * s.y;
        let translation = o + x * s.x + z * s.z + xz * (s.x * s.z) + along_y * s.y;
        // Beyond the box nothing changes any more.
        let slope = |axis: usize| if s[axis] == unclamped[axis] { self.per_side } else { 0.0 };
        let jacobian = DMat3::from_cols(
            DVec3::X + along_x * slope(0),
            DVec3::Y + along_y * slope(1),
            DVec3::Z + along_z * slope(2),
        );
        (translation, jacobian)
    }
}
