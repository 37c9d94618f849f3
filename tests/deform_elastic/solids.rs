//! What solids do by the book.

use super::*;
use bevy_surgery::deform::Patch;
use bevy_surgery::deform::elastic::ElasticCell;

/// Soft, without drag, so that closed forms hold.
const PLAIN: ElasticTissue = ElasticTissue {
    youngs_modulus_pa: 5e3,
    poisson_ratio: 0.0,
    density_kg_per_m3: 1000.0,
    damping_s: 0.05,
    tears_at_stretch: 10.0,
    capsule_n_per_m: 0.0,
};

#[test]
fn what_rests_stays_at_rest_bit_for_bit() {
    for poisson_ratio in [0.0, 0.3, 0.49] {
        let (mut lattice, mut body) = block(Vec3::new(0.2, 0.13, 0.1), 2, ElasticTissue { poisson_ratio, ..PLAIN });
        lattice.subdivide(Patch { level: 2, cell: UVec3::ONE }).expect("it is there");
        body.follow_tree(&lattice).expect("the same box");
        // Awake: it takes half a second to fall asleep.
        run(&mut body, 20, Vec3::ZERO);
        assert!(!body.is_asleep() && bits(&body).iter().all(|bits| f32::from_bits(*bits) == 0.0));
        run(&mut body, 20, Vec3::ZERO);
        assert!(body.is_asleep() && !body.has_moved());
    }
}

#[test]
fn what_nothing_holds_falls_freely() {
    let (lattice, mut body) = block(Vec3::new(0.1, 0.12, 0.1), 2, ElasticTissue::LIVER);
    body.drag_per_s = 0.0;
    let steps = 30;
    run(&mut body, steps, DOWN);
    let time_s = STEP_S * f64::from(steps);
    for vertex in 0..lattice.tree().vertex_count() {
        let fallen_m = body.displacement_m(vertex);
        // Substeps are short, not infinitely so: they are behind by g t dt / 2.
        let expected_m = 0.5 * 9.81 * time_s * (time_s + STEP_S / f64::from(body.substeps));
        assert!((f64::from(-fallen_m.y) / expected_m - 1.0).abs() < 1e-3, "{fallen_m} instead of {expected_m}");
        assert!(fallen_m.x.abs() < 1e-5 && fallen_m.z.abs() < 1e-5, "{fallen_m}");
    }
}

/// How far the lower side of a hanging block comes down, over rho g L^2 / (2 E).
fn hanging_share(level: u32, youngs_modulus_pa: f32, substeps: u32) -> f64 {
    let length_m = 0.08_f32;
    let tissue = ElasticTissue { youngs_modulus_pa, damping_s: 0.2, ..PLAIN };
    let (_, body) = block(Vec3::new(0.08, length_m, 0.08), level, tissue);
    let mut body = body.pinned_where(|rest_m| rest_m.y > 0.0799);
    body.substeps = substeps;
    run(&mut body, 240, DOWN);
    let down_m = -body.displacement_m(0).y;
    f64::from(down_m) / (1000.0 * 9.81 * f64::from(length_m).powi(2) / (2.0 * f64::from(youngs_modulus_pa)))
}

#[test]
fn a_hanging_block_stretches_as_it_should() {
    // Without a Poisson ratio the stretch is linear, and lumped nodes have it exactly: what is left is the solver's.
    for (level, stiffness_pa, substeps) in [(1, 5e3, 16), (2, 5e3, 16), (3, 5e3, 16), (3, 2e4, 64), (4, 5e3, 64)] {
        let share = hanging_share(level, stiffness_pa, substeps);
        assert!((share - 1.0).abs() < 0.03, "level {level}, {stiffness_pa} Pa: {share} of the closed form");
    }
    // It converges with the square of the substeps' length, at least.
    let off = [8, 16, 32].map(|substeps| (hanging_share(3, 2e4, substeps) - 1.0).abs());
    assert!(off[1] < off[0] / 4.0 && off[2] < off[1] / 4.0, "{off:?}");
    // What is too stiff for the substeps comes out softer than it is, and hardly moves all the same: this would be 16 nm.
    let share = hanging_share(3, 1e9, 16);
    assert!(share * 1000.0 * 9.81 * 0.08 * 0.08 / 2e9 < 1e-3, "bone gives way by {share} times what it should");
}

#[test]
fn pulled_blocks_get_narrower_and_keep_their_volume() {
    // The nearer to 0.5, the faster sound is and the shorter substeps have to be.
    for (poisson_ratio, substeps) in [(0.0, 16), (0.3, 16), (0.45, 16), (0.49, 64), (0.499, 200)] {
        let tissue = ElasticTissue { poisson_ratio, damping_s: 0.2, ..PLAIN };
        let side_m = 0.08_f32;
        let (lattice, mut body) = block(Vec3::splat(side_m), 3, tissue);
        body.substeps = substeps;
        let tree = lattice.tree();
        let tension_pa = 0.05 * f64::from(tissue.youngs_modulus_pa);
        for _ in 0..200 {
            for vertex in 0..tree.vertex_count() {
                let place = tree.place_of(vertex);
                let on_edge = |part: f64| if part == 0.0 || part == 1.0 { 0.5 } else { 1.0 };
                let area_m2 = f64::from(side_m / 8.0).powi(2) * on_edge(place.x) * on_edge(place.z);
                let force_n = Vec3::Y * (tension_pa * area_m2) as f32;
                if place.y == 0.0 {
                    body.apply_force(body.rest_m(vertex), -force_n);
                } else if place.y == 1.0 {
                    body.apply_force(body.rest_m(vertex), force_n);
                }
            }
            run(&mut body, 1, Vec3::ZERO);
        }
        let width = |axis: usize| {
            let ends = [0.0_f32, 1.0].map(|end| {
                let mut rest_m = Vec3::splat(0.5 * side_m);
                rest_m[axis] = end * side_m;
                body.moved_m(rest_m)[axis]
            });
            (ends[1] - ends[0]) / side_m
        };
        let (long, across) = (width(1), 0.5 * (width(0) + width(2)));
        let ratio = (1.0 - across) / (long - 1.0);
        assert!((ratio - poisson_ratio).abs() < 0.03, "{poisson_ratio}: {ratio}, {long} x {across}");
        assert!((long - 1.05).abs() < 0.005, "{poisson_ratio}: {long} under a twentieth of its stiffness");
        let volume = long * across * across;
        assert!(poisson_ratio < 0.499 || (volume - 1.0).abs() < 2e-3, "its volume is {volume} of what it was");
    }
}

#[test]
fn energy_does_not_grow_and_momentum_stays() {
    let (_, mut body) = block(Vec3::new(0.1, 0.12, 0.09), 2, ElasticTissue { damping_s: 0.0, ..ElasticTissue::LIVER });
    body.drag_per_s = 0.0;
    let mut random = Random(3);
    body.displace(|_| (0.004 * random.vector(), 0.2 * random.vector() + 0.1 * Vec3::X));
    let momentum = |body: &ElasticBody| -> Vec3 {
        (0..body.tree().vertex_count()).map(|vertex| body.velocity_m_per_s(vertex) * body.mass_kg(vertex)).sum()
    };
    let first = momentum(&body);
    let mut energy_j = body.energy_j();
    for step in 0..120 {
        run(&mut body, 1, Vec3::ZERO);
        let now_j = body.energy_j();
        // Bending is not counted, and comes back into what is: a little more than there was may be.
        assert!(now_j < 1.05 * energy_j, "step {step}: {now_j} J after {energy_j} J");
        energy_j = energy_j.min(now_j);
        let off = (momentum(&body) - first).length() / first.length();
        assert!(off < 1e-3, "step {step}: momentum is off by {off}");
    }
}

#[test]
fn a_body_turns_freely() {
    // Half a turn a second for a second: cells follow, and nothing is strained or slowed but by the substeps.
    let (_, mut body) = block(Vec3::splat(0.1), 2, ElasticTissue::LIVER);
    body.drag_per_s = 0.0;
    let spin = Vec3::new(0.0, 0.0, std::f32::consts::PI);
    body.displace(|rest_m| (Vec3::ZERO, spin.cross(rest_m - Vec3::splat(0.05))));
    run(&mut body, 60, Vec3::ZERO);
    let corner = body.moved_m(Vec3::new(0.1, 0.05, 0.05)) - Vec3::splat(0.05);
    let angle = corner.y.atan2(corner.x).abs();
    assert!((angle - std::f32::consts::PI).abs() < 0.15, "it turned by {angle}");
    let strained = (0..64).map(|n| (body.stretch(n) - 1.0).abs()).fold(0.0, f32::max);
    assert!(strained < 0.02, "strained by {strained}");
}

#[test]
fn empty_cells_hold_nothing() {
    // A column through the middle of a box, hanging: as far down as if the box were no larger than the column.
    let share = |is_full: bool| {
        let lattice = DeformLattice::new(Vec3::ZERO, Vec3::splat(0.08), 3).expect("a box");
        let tissue = ElasticTissue { damping_s: 0.2, ..PLAIN };
        let body = ElasticBody::new(&lattice, |middle| {
            let is_in = (middle.x - 0.04).abs() < 0.02 && (middle.z - 0.04).abs() < 0.02;
            ElasticCell { tissue, fill: if is_in || is_full { 1.0 } else { 0.0 } }
        });
        let mut body = body.expect("a body").pinned_where(|rest_m| rest_m.y > 0.0799);
        run(&mut body, 240, DOWN);
        -body.moved_m(Vec3::new(0.04, 0.0, 0.04)).y
    };
    let (column, full) = (share(false), share(true));
    assert!((column / full - 1.0).abs() < 0.03, "{column} m and {full} m");
}

#[test]
fn what_hangs_in_finer_cells_hangs_as_in_coarse_ones() {
    let hang = |is_finer: bool| {
        let (mut lattice, body) =
            block(Vec3::splat(0.08), 2, ElasticTissue { poisson_ratio: 0.3, ..ElasticTissue::LIVER });
        let mut body = body.pinned_where(|rest_m| rest_m.y > 0.0799);
        if is_finer {
            let patches: Vec<Patch> =
                (0..8).map(|n| Patch { level: 2, cell: UVec3::new(n % 2, n / 2 % 2, n / 4) }).collect();
            lattice.subdivide_all(&patches).expect("they are there");
            body.follow_tree(&lattice).expect("the same box");
            assert!(!lattice.tree().constraints().is_empty());
        }
        run(&mut body, 300, DOWN);
        (body.moved_m(Vec3::new(0.04, 0.0, 0.04)), bits(&body))
    };
    let (coarse, finer) = (hang(false).0, hang(true).0);
    assert!((coarse.y / finer.y - 1.0).abs() < 0.1 && coarse.y < -0.002, "{coarse} and {finer}");
}

#[test]
fn even_deformations_are_published_exactly_and_others_ever_closer() {
    let stretch = Mat3::from_cols(Vec3::new(1.1, 0.05, 0.0), Vec3::new(-0.04, 0.95, 0.02), Vec3::new(0.03, 0.0, 1.04));
    let (mut lattice, mut body) = block(Vec3::new(0.2, 0.15, 0.1), 2, PLAIN);
    let middle = Vec3::new(0.1, 0.075, 0.05);
    body.displace(|rest_m| (stretch * (rest_m - middle) + middle - rest_m, Vec3::ZERO));
    body.publish(&mut lattice).expect("its own lattice");
    let back = |lattice: &DeformLattice, body: &ElasticBody, rest_m: Vec3| {
        let shown = lattice.box_from_body().transform_point3(body.moved_m(rest_m));
        let rest = lattice.rest_from_shown(shown.as_dvec3()).as_vec3();
        lattice.body_from_box().transform_point3(rest).distance(rest_m)
    };
    let mut random = Random(9);
    // Not at the sides: what is shown there rests beyond the box, where the field only goes on.
    let places: Vec<Vec3> = (0..200).map(|_| middle + 0.4 * random.vector() * middle).collect();
    let most = places.iter().map(|&rest_m| back(&lattice, &body, rest_m)).fold(0.0, f32::max);
    assert!(most < 1e-6, "an even deformation is off by {most} m");
    // A bend: the error falls with the square of the cells' size.
    let errors = [2, 3, 4].map(|level| {
        let (mut lattice, mut body) = block(Vec3::new(0.2, 0.15, 0.1), level, PLAIN);
        body.displace(|rest_m| {
            (Vec3::new(0.0, 0.008 * (20.0 * rest_m.x).sin(), 0.006 * (25.0 * rest_m.y).cos()), Vec3::ZERO)
        });
        body.publish(&mut lattice).expect("its own lattice");
        assert_eq!(body.faults().kept_translations, 0);
        places.iter().map(|&rest_m| back(&lattice, &body, rest_m)).sum::<f32>() / places.len() as f32
    });
    assert!(errors[0] < 1e-3 && errors[1] < errors[0] / 2.0 && errors[2] < errors[1] / 3.0, "{errors:?}");
}

#[test]
fn a_body_rests_under_the_gravity_that_it_was_scanned_under() {
    let (_, body) = block(Vec3::splat(0.1), 2, ElasticTissue::LIVER);
    let mut body = body.pinned_where(|rest_m| rest_m.x < 0.001);
    body.rests_under_m_per_s2 = DOWN;
    run(&mut body, 40, DOWN);
    assert!(body.is_asleep() && body.displacement_m(4) == Vec3::ZERO);
    // Turned over, it hangs twice as far the other way.
    run(&mut body, 200, -DOWN);
    assert!(body.displacement_m(4).y > 0.005, "{}", body.displacement_m(4));
}
