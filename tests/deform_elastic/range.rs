//! All stiffnesses: nothing gains energy by itself, and what was beaten comes back.

use super::*;
use bevy_surgery::deform::elastic::{Press, ToolShape};

const SIDES_M: Vec3 = Vec3::new(0.2, 0.14, 0.1);

/// A block that hangs from its upper side, at rest under gravity.
fn hanging(youngs_modulus_pa: f32, poisson_ratio: f32, level: u32) -> ElasticBody {
    let tissue = ElasticTissue { youngs_modulus_pa, poisson_ratio, ..ElasticTissue::LIVER };
    let (_, body) = block(SIDES_M, level, tissue);
    let mut body = body.pinned_where(|rest_m| rest_m.y > 0.139);
    body.rests_under_m_per_s2 = DOWN;
    body
}

/// How far a vertex is from where it rests at most, as a share of the longest side.
fn farthest(body: &ElasticBody) -> f32 {
    let vertices = 0..body.tree().vertex_count();
    vertices.map(|vertex| body.displacement_m(vertex).length()).fold(0.0, f32::max) / SIDES_M.max_element()
}

/// A rod that is driven to and fro through the block, up to 1.5 metres per second.
fn beat(body: &mut ElasticBody, step: u32) {
    let time_s = step as f32 * STEP_S as f32;
    let swing = Vec3::new((11.0 * time_s).sin(), (17.0 * time_s).sin(), (23.0 * time_s).cos());
    let tip_m = SIDES_M * 0.5 + swing * Vec3::new(0.1, 0.06, 0.06);
    let shape = ToolShape::Capsule { tip_m, back_m: tip_m + Vec3::new(0.05, -0.1, 0.1), radius_m: 0.01 };
    body.step(STEP_S, DOWN, &[Press { tool: 0, shape, friction: 0.2 }], &[]);
}

/// Forces of up to this size at random places.
fn shake(body: &mut ElasticBody, force_n: f32, random: &mut Random) {
    for _ in 0..5 {
        let at = (random.vector() * 0.5 + 0.5) * SIDES_M;
        body.apply_force(at, random.vector() * force_n);
    }
    run(body, 1, DOWN);
}

#[test]
fn no_stiffness_gains_energy_by_itself() {
    for (level, poisson_ratio) in [(2, 0.45), (3, 0.3), (3, 0.45), (3, 0.495)] {
        for stiffness_pa in [3e4, 1e5, 2e5, 5e5, 1e6, 3e6, 1e7, 1e9, 1e12] {
            let mut body = hanging(stiffness_pa, poisson_ratio, level);
            let mut random = Random(7);
            (0..60).for_each(|_| shake(&mut body, 1.0, &mut random));
            let (shaken, mut most) = (farthest(&body), 0.0_f32);
            for _ in 0..120 {
                run(&mut body, 1, DOWN);
                most = most.max(farthest(&body));
            }
            let what = format!("level {level}, {poisson_ratio}, {stiffness_pa} Pa");
            assert!(shaken < 0.12, "{what}: a newton moves it by {shaken} of its length");
            assert!(most < 2.0 * shaken + 1e-3 && farthest(&body) < 0.01, "{what}: {shaken}, then {most}");
        }
    }
}

#[test]
fn what_was_beaten_comes_back_from_the_softest_tissue_to_bone() {
    for level in [2, 3] {
        for stiffness_pa in [1e3, 5e3, 1e5, 1e6, 1e8, 1e10, 1e12] {
            for force_n in [None, Some(1e3)] {
                let what = format!("level {level}, {stiffness_pa} Pa, {force_n:?}");
                let mut body = hanging(stiffness_pa, 0.45, level);
                let (mut random, mut most) = (Random(7), 0.0_f32);
                for step in 0..300 {
                    match force_n {
                        None => beat(&mut body, step),
                        Some(force_n) => shake(&mut body, force_n, &mut random),
                    }
                    most = most.max(farthest(&body));
                }
                // The rod shoves matter as far as it goes. Forces would tear soft tissue off; it is bounded by its own pull all the same.
                assert!(most < if force_n.is_none() { 4.0 } else { 200.0 }, "{what}: as far as {most} of its length");
                run(&mut body, 600, DOWN);
                let off = farthest(&body);
                assert!(off < 0.05, "{what}: after ten seconds it is off by {off} of its length");
                assert_eq!(body.faults().restored_steps, 0, "{what}");
            }
        }
    }
}

#[test]
fn what_is_as_soft_as_foam_or_a_breath_is_not_lost() {
    for stiffness_pa in [1.0, 10.0, 100.0] {
        for level in [2, 3] {
            let what = format!("level {level}, {stiffness_pa} Pa");
            let mut body = hanging(stiffness_pa, 0.45, level);
            let mut most = 0.0_f32;
            for step in 0..300 {
                beat(&mut body, step);
                most = most.max(farthest(&body));
            }
            // A substep of the rod throws it as fast as speeds may be.
            assert!(most < 200.0, "{what}: as far as {most} of its length");
            run(&mut body, 600, DOWN);
            assert!(farthest(&body) < most.max(1.5) && body.faults().restored_steps == 0, "{what}");
            assert!(bits(&body).iter().all(|bits| f32::from_bits(*bits).is_finite()), "{what}");
        }
    }
}
