//! A chain of hashes over what the simulation's state is: two runs with the same hash of a second were the same until then.

use super::observe::{Observed, Scene};
use crate::organ::sphere::SurfacePoint;
use crate::volume::{CutVolume, VoxelBox};
use bevy::prelude::*;
use blake3::Hasher;

/// The chain so far.
#[derive(Clone, Default)]
pub(super) struct HashChain {
    before: [u8; 32],
    step: Hasher,
    /// Revisions of the volumes' cuts up to which they are in the chain.
    cuts: Vec<Option<u64>>,
}

fn number(hasher: &mut Hasher, number: f64) {
    // Zero is zero, whatever its sign.
    hasher.update(&(number + 0.0).to_bits().to_le_bytes());
}

fn numbers<N: Into<f64>, const COUNT: usize>(hasher: &mut Hasher, of: [N; COUNT]) {
    of.into_iter().for_each(|part| number(hasher, part.into()));
}

fn point(hasher: &mut Hasher, point: &SurfacePoint) {
    hasher.update(&point.face.to_le_bytes());
    numbers(hasher, point.barycentric.to_array());
}

impl HashChain {
    /// Takes what instruments do in a step, and what they touch.
    pub fn take_step(&mut self, observed: &Observed, scene: &Scene) {
        let hasher = &mut self.step;
        for &entity in &observed.tools {
            let Ok((_, _, _, _, motion, command, _, contacts, _)) = scene.tools.get(entity) else { continue };
            hasher.update(&[u8::from(motion.to.is_some())]);
            if let Some(to) = motion.to {
                numbers(hasher, to.tip_in_world_m.to_array());
                numbers(hasher, to.world_from_tool.to_array());
            }
            numbers(hasher, [command.pedal, command.second_pedal, command.grip]);
            // Only where it is asked for: runs without it have the hashes that they had before there were other burrs.
            if command.next_burr {
                hasher.update(b"next burr");
            }
            let by_body = observed.bodies.iter().flat_map(|body| contacts.list.iter().filter(|at| at.body == *body));
            for contact in by_body {
                numbers(hasher, contact.point_world_m.to_array());
                number(hasher, contact.force_n.into());
            }
        }
    }

    /// Ends a second: the state as it is now, and the hash of all up to here.
    pub fn end_second(&mut self, observed: &Observed, scene: &Scene) -> String {
        let mut hasher = std::mem::take(&mut self.step);
        hasher.update(&self.before);
        self.cuts.resize(observed.bodies.len(), None);
        for (&body, told) in observed.bodies.iter().zip(&mut self.cuts) {
            if let Ok((_, _, _, Some(cut), _, Some(removed), transform, ..)) = scene.volumes.get(body) {
                take_cut(&mut hasher, cut, told);
                (0..=255).for_each(|label| number(&mut hasher, removed.of_label_mm3(label)));
                numbers(&mut hasher, transform.affine().to_cols_array());
            }
            let Ok((_, _, _, Some(shape), _, reactions, transform)) = scene.organs.get(body) else { continue };
            hasher.update(bytemuck::cast_slice(shape.positions_m()));
            numbers(&mut hasher, transform.affine().to_cols_array());
            let Some(reactions) = reactions else { continue };
            let tally = reactions.tally();
            numbers(&mut hasher, [tally.bled_m3, tally.fallen_m3, tally.dried_m3, tally.lost_m3]);
            number(&mut hasher, reactions.heat().total_energy_j());
            number(&mut hasher, reactions.heat().vented_energy_j());
            for wound in reactions.wounds() {
                point(&mut hasher, &wound.point);
                number(&mut hasher, wound.age_s);
            }
            for sprite in reactions.snakes().iter().flat_map(|snake| &snake.sprites) {
                point(&mut hasher, &sprite.point);
                number(&mut hasher, sprite.radius_m.into());
                number(&mut hasher, sprite.volume_m3);
            }
        }
        for (state, water) in &scene.pools {
            let level_m = state.level_m.map_or(-1.0, f64::from);
            let parts = [level_m, state.blood_ml, state.hidden_share.into(), water.held_ml, water.sucked_ml];
            numbers(&mut hasher, parts);
        }
        for lattice in &scene.lattices {
            hasher.update(bytemuck::cast_slice(lattice.translations()));
        }
        self.before = *hasher.finalize().as_bytes();
        blake3::Hash::from_bytes(self.before).to_hex().to_string()
    }
}

/// What has changed of a cut since the last second.
fn take_cut(hasher: &mut Hasher, cut: &CutVolume, told: &mut Option<u64>) {
    if *told == Some(cut.revision()) {
        return;
    }
    let everything = || vec![VoxelBox { min: UVec3::ZERO, max: cut.size() }];
    let changed = told.and_then(|revision| cut.changes_since(revision)).unwrap_or_else(everything);
    *told = Some(cut.revision());
    let mut left = Vec::new();
    for part in changed.iter().filter(|part| !part.is_empty() && !cut.is_untouched(**part)) {
        left.resize(part.count(), 0);
        cut.copy_remaining(*part, &mut left);
        for corner in [part.min, part.max] {
            hasher.update(bytemuck::cast_slice(&corner.to_array()));
        }
        hasher.update(&left);
    }
}
