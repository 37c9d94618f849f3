//! Where the organ is too thin for full-sized texture triangles.
//!
//! A tube that is less than three edges round (a duct, say) would disappear inside a single texture triangle, smearing
//! one tile over all of it. There the edges are made shorter, with a gradual passage to the full length.

use super::{super::sphere::SurfacePoint, walk::ChartedSurface};
use glam::DVec3;
use std::f64::consts::PI;

/// Directions in which opposite rays are sent, over half a turn.
const DIRECTIONS: u32 = 8;
/// Steps of a ray per full edge length. A tube that is less than 0.4 of an edge round could slip between them.
const STEPS_PER_EDGE: f64 = 10.0;
/// Opposite rays have met when they are nearer to each other than this share of the way each has gone. On a plane they
/// are two ways apart; round a tube, up to 0.4 ways, as the nearest of the directions misses the round by 11 degrees.
const MEETING: f64 = 0.5;
/// Edges that surround a tube; three are possible, but five bend less each.
const EDGES_AROUND: f64 = 5.0;
/// Least share of the full edge length.
const LEAST_SHARE: f64 = 0.2;
/// By how much edges may grow per length away from where they are short.
pub(super) const GROWTH: f64 = 0.5;

/// Edge length that suits a place, metres: the full one, or a fifth of the way round the organ if that is shorter.
///
/// The way round is found by going straight ahead in opposite directions at once until both meet on the far side.
pub(super) fn edge_length_at(surface: &ChartedSurface, start: SurfacePoint, full_m: f64) -> f64 {
    let corners = surface.corners_m(start.face);
    let normal = surface.normal(start.face);
    let x = (corners[1] - corners[0]).normalize_or_zero();
    let y = normal.cross(x);
    let steps = (0.5 * EDGES_AROUND * STEPS_PER_EDGE) as usize;
    let step_m = full_m / STEPS_PER_EDGE;
    let mut shortest_m = full_m;
    for k in 0..DIRECTIONS {
        let angle = PI * f64::from(k) / f64::from(DIRECTIONS);
        let along = (x * angle.cos() + y * angle.sin()) * step_m;
        let mut ends = [(start, along), (start, -along)];
        for step in 1..=steps {
            let way_m = step as f64 * step_m;
            if 2.0 * way_m / EDGES_AROUND >= shortest_m {
                break;
            }
            ends = ends.map(|(point, along)| surface.go_on(point, along));
            let far_side = ends.iter().all(|(point, _)| surface.normal(point.face).dot(normal) < 0.0);
            let apart: DVec3 = surface.position_m(ends[0].0) - surface.position_m(ends[1].0);
            if far_side
                && apart.length() < MEETING * way_m
                && surface.normal(ends[0].0.face).dot(surface.normal(ends[1].0.face)) > 0.0
            {
                shortest_m = shortest_m.min((2.0 * way_m + apart.length()) / EDGES_AROUND);
                break;
            }
        }
    }
    shortest_m.max(LEAST_SHARE * full_m)
}

#[cfg(test)]
mod tests {
    use super::{super::walk::tests::sphere, *};

    /// Edge length wanted at a direction from the centre of a stretched sphere with a waist radius of 1.
    fn wanted(stretch: f64, direction: DVec3, full_m: f64) -> f64 {
        let chart = sphere(5);
        let positions_m: Vec<DVec3> = chart.directions.iter().map(|d| *d * DVec3::new(1.0, 1.0, stretch)).collect();
        let surface = ChartedSurface { positions_m: &positions_m, chart: &chart };
        edge_length_at(&surface, chart.locate(0, direction.normalize()), full_m)
    }

    #[test]
    fn a_tube_gets_a_fifth_of_its_round_and_a_fat_organ_the_full_length() {
        let waist = DVec3::new(0.3, 0.9, 0.01);
        let round_share = 2.0 * PI / EDGES_AROUND;
        let tube = wanted(20.0, waist, 3.0);
        assert!((0.9..1.1).contains(&(tube / round_share)), "{tube} for {round_share}");
        assert_eq!(wanted(20.0, waist, 1.0), 1.0);
        assert_eq!(wanted(1.0, waist, 0.3), 0.3);
        // Nothing gets arbitrarily small.
        assert_eq!(wanted(200.0, waist, 12.0), LEAST_SHARE * 12.0);
    }

    #[test]
    fn the_rim_of_a_thin_disc_is_no_tube() {
        assert_eq!(wanted(0.05, DVec3::new(0.98, 0.1, 0.01), 0.3), 0.3);
        assert_eq!(wanted(0.05, DVec3::new(0.1, 0.2, 0.01), 0.3), 0.3);
    }
}
