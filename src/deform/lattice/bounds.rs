//! What can be said of the field without looking at every place: where matter may be shown, and how fast the field changes.

use super::DeformLattice;
use super::tree::corner;
use glam::{DMat3, DVec3};

impl DeformLattice {
    /// Boxes of places, each with its lower and upper corner, outside of which nothing is shown of the matter that rests in a
    /// box; all in shares of the lattice's box. One for each patch that may show some of it, and patches on the box's sides
    /// reach beyond it.
    pub fn shown_bounds(&self, rest_low: DVec3, rest_high: DVec3) -> impl Iterator<Item = (DVec3, DVec3)> {
        (0..self.tree().patches().len()).filter_map(move |number| {
            let patch = self.tree().patches()[number];
            let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for vertex in self.tree().corners(number) {
                let translation = self.translations()[vertex].as_dvec3();
                (least, most) = (least.min(translation), most.max(translation));
            }
            let (low, high) = (patch.low(), patch.low() + patch.side());
            let beyond = |side: DVec3, end: f64, far: f64| {
                DVec3::from_array(side.to_array().map(|at| if at == end { far } else { at }))
            };
            let low = beyond(low, 0.0, f64::NEG_INFINITY).max(rest_low - most);
            let high = beyond(high, 1.0, f64::INFINITY).min(rest_high - least);
            low.cmple(high).all().then_some((low, high))
        })
    }

    /// Least and greatest value of each entry of the Jacobian of [`DeformLattice::rest_from_shown`], over all places.
    pub fn slope_bounds(&self) -> (DMat3, DMat3) {
        // Beyond the box the field does not change along the way out.
        let (mut least, mut most) = (DMat3::ZERO, DMat3::ZERO);
        for (number, patch) in self.tree().patches().iter().enumerate() {
            let corners = self.tree().corners(number);
            let cells = 1.0 / patch.side();
            for axis in 0..3 {
                for n in (0..8).filter(|n| corner(*n)[axis] == 0) {
                    let [from, to] = [n, n | 1 << axis].map(|n| self.translations()[corners[n]].as_dvec3());
                    // Derivatives are bilinear between those along the four edges.
                    let slope = (to - from) * cells;
                    *least.col_mut(axis) = least.col(axis).min(slope);
                    *most.col_mut(axis) = most.col(axis).max(slope);
                }
            }
        }
        (least + DMat3::IDENTITY, most + DMat3::IDENTITY)
    }

    /// Translations on a full grid of the deepest level's vertices, x fastest; and how many cells it has along a side. Between
    /// them the field is trilinear, also where patches are coarser.
    pub fn dense(&self) -> (Vec<glam::Vec3>, u32) {
        let tree = self.tree();
        let cells = 1_u32 << tree.deepest();
        if tree.is_uniform() {
            return (self.translations().to_vec(), cells);
        }
        let at = |part: u32| f64::from(part) / f64::from(cells);
        let nodes = (0..=cells).flat_map(|z| (0..=cells).flat_map(move |y| (0..=cells).map(move |x| (x, y, z))));
        let translation = |(x, y, z)| self.translation_at(DVec3::new(at(x), at(y), at(z))).as_vec3();
        (nodes.map(translation).collect(), cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A lattice with patches of three levels and lively translations.
    fn lively() -> DeformLattice {
        let mut lattice = DeformLattice::new(Vec3::ZERO, Vec3::ONE, 1).expect("a box");
        let number = lattice.tree().patch_at(DVec3::splat(0.4));
        lattice.subdivide(lattice.tree().patches()[number]).expect("a patch");
        let number = lattice.tree().patch_at(DVec3::splat(0.3));
        lattice.subdivide(lattice.tree().patches()[number]).expect("a patch");
        let wave =
            |at: DVec3| DVec3::new((9.0 * at.y).sin(), (7.0 * at.z + at.x).cos(), (8.0 * at.x * at.y).sin()) * 0.04;
        lattice.set_from(wave).expect("finite numbers");
        lattice
    }

    fn places() -> impl Iterator<Item = DVec3> {
        let at = |n: i32| f64::from(n) / 20.0 - 0.1;
        (0..25 * 25 * 25).map(move |n| DVec3::new(at(n % 25), at(n / 25 % 25), at(n / 625)) + 0.001)
    }

    #[test]
    fn matter_is_shown_within_its_bounds_only() {
        let lattice = lively();
        let (low, high) = (DVec3::new(0.2, 0.3, 0.85), DVec3::new(0.5, 0.9, 1.0));
        let bounds: Vec<_> = lattice.shown_bounds(low, high).collect();
        let mut found = 0;
        for place in places() {
            let rest = lattice.rest_from_shown(place);
            if rest.cmpge(low).all() && rest.cmple(high).all() {
                found += 1;
                assert!(
                    bounds.iter().any(|(low, high)| place.cmpge(*low).all() && place.cmple(*high).all()),
                    "{place}"
                );
            }
        }
        assert!(found > 100 && bounds.len() < lattice.tree().patches().len());
    }

    #[test]
    fn slopes_keep_to_their_bounds() {
        let lattice = lively();
        let (least, most) = lattice.slope_bounds();
        for place in places() {
            let slope = lattice.jacobian_at(place);
            for axis in 0..3 {
                assert!(slope.col(axis).cmpge(least.col(axis) - 1e-9).all(), "{slope} at {place}");
                assert!(slope.col(axis).cmple(most.col(axis) + 1e-9).all(), "{slope} at {place}");
            }
        }
    }

    #[test]
    fn a_full_grid_holds_the_same_field() {
        let lattice = lively();
        let (nodes, cells) = lattice.dense();
        let mut uniform = DeformLattice::new(Vec3::ZERO, Vec3::ONE, cells.ilog2()).expect("a box");
        uniform.set_translations(&nodes).expect("as many as vertices");
        for place in places() {
            let away = (uniform.translation_at(place) - lattice.translation_at(place)).length();
            assert!(away < 1e-6, "{away} at {place}");
        }
    }
}
