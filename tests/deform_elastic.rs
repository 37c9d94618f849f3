//! Elastic bodies against closed forms, and against what would break them.

#[path = "deform_elastic/ecs.rs"]
mod ecs;
#[path = "deform_elastic/layers.rs"]
mod layers;
#[path = "deform_elastic/range.rs"]
mod range;
#[path = "deform_elastic/solids.rs"]
mod solids;
#[path = "deform_elastic/violence.rs"]
mod violence;

use bevy::prelude::*;
use bevy_surgery::deform::DeformLattice;
use bevy_surgery::deform::elastic::{ElasticBody, ElasticTissue};

const STEP_S: f64 = 1.0 / 60.0;
const DOWN: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// A block of one tissue with a corner at the origin.
fn block(sides_m: Vec3, level: u32, tissue: ElasticTissue) -> (DeformLattice, ElasticBody) {
    let lattice = DeformLattice::new(Vec3::ZERO, sides_m, level).expect("a box");
    let body = ElasticBody::uniform(&lattice, tissue).expect("a body");
    (lattice, body)
}

fn run(body: &mut ElasticBody, steps: u32, gravity: Vec3) {
    (0..steps).for_each(|_| drop(body.step(STEP_S, gravity, &[], &[])));
}

/// All bits of where a body's vertices are and how they move.
fn bits(body: &ElasticBody) -> Vec<u32> {
    (0..body.tree().vertex_count())
        .flat_map(|vertex| [body.displacement_m(vertex), body.velocity_m_per_s(vertex)])
        .flat_map(|vector| vector.to_array().map(f32::to_bits))
        .collect()
}

/// Numbers that are random and always the same.
struct Random(u64);

impl Random {
    /// From -1 to 1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}
