//! Lattices that move by themselves: key frames and functions (the paper's carp).

use super::elastic::StepBodies;
use super::lattice::{DeformLattice, Tree};
use super::{DeformBodies, LatticeError};
use bevy::ecs::VariantDefaults;
use bevy::ecs::entity::EntityHashSet;
use bevy::prelude::*;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Moves the [`DeformLattice`] of its entity, step by step, by simulated time; beside a lattice alone it does nothing.
#[derive(Component, Clone, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct LatticeAnimation {
    /// How it moves.
    pub motion: LatticeMotion,
    /// How fast: 1 as the motion says, 0 stands still, below 0 backwards.
    pub speed: f32,
    /// Where in the motion simulated time begins, seconds.
    pub offset_s: f32,
}

/// A motion of a lattice.
#[derive(Clone, Debug, PartialEq, Reflect, Serialize, Deserialize, VariantDefaults)]
#[reflect(Default)]
pub enum LatticeMotion {
    /// Given positions, and what lies between.
    KeyFrames(KeyFrames),
    /// A wave that runs along the body, as through a swimming fish.
    Wave(TravellingWave),
}

/// Translations at certain times.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct KeyFrames {
    /// One after another in time.
    pub frames: Vec<KeyFrame>,
    /// What lies between two of them.
    pub interpolation: KeyInterpolation,
    /// Whether the first comes again at the time of the last, so those two should be the same. If not, the first holds before
    /// its time and the last after it.
    pub loops: bool,
}

/// Translations at a time.
#[derive(Clone, Debug, Default, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
pub struct KeyFrame {
    /// When, seconds.
    pub time_s: f32,
    /// One for each vertex of the lattice, in shares of the box; those of constrained ones do not count.
    pub translations: Vec<Vec3>,
}

/// How translations go from one key frame to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Reflect, Serialize, Deserialize, VariantDefaults)]
pub enum KeyInterpolation {
    /// Straight, with a jerk at every frame.
    Linear,
    /// Along Catmull and Rom's spline through all frames: velocities do not jump.
    #[default]
    Smooth,
}

/// A wave that runs along a body and bends it to and fro. Lengths are shares of the box.
#[derive(Clone, Copy, Debug, PartialEq, Reflect, Serialize, Deserialize)]
#[reflect(Default)]
#[serde(default)]
pub struct TravellingWave {
    /// How far matter goes to either side where the wave is largest: at the end that it runs to.
    pub amplitude: f32,
    /// Length of one wave; the body is 1 long.
    pub wavelength: f32,
    /// How often matter goes to and fro in a second.
    pub frequency_hz: f32,
    /// Where the wave runs to, of any length: from the head to the tail.
    pub along: Vec3,
    /// Where matter goes, of any length.
    pub across: Vec3,
    /// Amplitude where the wave begins, as a share of that where it ends. Between them it rises with the square of the way.
    pub head: f32,
}

impl Default for TravellingWave {
    fn default() -> Self {
        Self { amplitude: 0.06, wavelength: 0.9, frequency_hz: 1.0, along: Vec3::Z, across: Vec3::X, head: 0.15 }
    }
}

impl Default for LatticeMotion {
    fn default() -> Self {
        Self::Wave(TravellingWave::default())
    }
}

impl Default for LatticeAnimation {
    fn default() -> Self {
        Self::new(LatticeMotion::default())
    }
}

impl LatticeAnimation {
    /// A motion at its own speed.
    pub fn new(motion: LatticeMotion) -> Self {
        Self { motion, speed: 1.0, offset_s: 0.0 }
    }

    /// Translations of the vertices of a tree at a simulated time, seconds.
    ///
    /// # Errors
    /// [`LatticeError`] where key frames are missing, out of order or of another lattice, and where something is not finite.
    pub fn translations_at(&self, tree: &Tree, time_s: f64) -> Result<Vec<Vec3>, LatticeError> {
        let time_s = time_s * f64::from(self.speed) + f64::from(self.offset_s);
        let made = match &self.motion {
            LatticeMotion::KeyFrames(frames) => frames.translations_at(tree, time_s)?,
            LatticeMotion::Wave(wave) => (0..tree.vertex_count())
                .map(|vertex| wave.translation_at(tree.place_of(vertex), time_s).as_vec3())
                .collect(),
        };
        let bad = made.iter().position(|translation| !translation.is_finite());
        match bad.filter(|&vertex| !tree.is_constrained(vertex)) {
            Some(vertex) => Err(LatticeError::NotFinite { vertex, translation: made[vertex] }),
            None => Ok(made),
        }
    }
}

impl TravellingWave {
    /// The translation at a place of the box at a time, seconds; both in shares of the box. Matter goes the other way (equation 3).
    pub fn translation_at(&self, place: DVec3, time_s: f64) -> DVec3 {
        let along = self.along.as_dvec3();
        // From 0 to 1 between the corners of the box that are farthest apart along it.
        let way = (place - 0.5).dot(along) / along.abs().element_sum() + 0.5;
        let head = f64::from(self.head);
        let amplitude = f64::from(self.amplitude) * (head + (1.0 - head) * way * way);
        let phase = way / f64::from(self.wavelength) - f64::from(self.frequency_hz) * time_s;
        -self.across.as_dvec3().normalize_or_zero() * amplitude * (TAU * phase).sin()
    }
}

impl KeyFrames {
    fn translations_at(&self, tree: &Tree, time_s: f64) -> Result<Vec<Vec3>, LatticeError> {
        let expected = tree.vertex_count();
        let mut before = f32::NEG_INFINITY;
        for (frame, KeyFrame { time_s, translations }) in self.frames.iter().enumerate() {
            if !(time_s.is_finite() && *time_s > before) {
                return Err(LatticeError::KeyFrameTime { frame, time_s: *time_s });
            }
            if translations.len() != expected {
                return Err(LatticeError::KeyFrameCount { frame, found: translations.len(), expected });
            }
            before = *time_s;
        }
        let (Some(first), Some(last)) = (self.frames.first(), self.frames.last()) else {
            return Err(LatticeError::NoKeyFrames);
        };
        let (start, end) = (f64::from(first.time_s), f64::from(last.time_s));
        let time_s = if self.loops && end > start {
            start + (time_s - start).rem_euclid(end - start)
        } else {
            time_s.clamp(start, end)
        };
        let behind = self.frames.partition_point(|frame| f64::from(frame.time_s) <= time_s).min(self.frames.len() - 1);
        if behind == 0 {
            return Ok(first.translations.clone());
        }
        let (from, to) = (&self.frames[behind - 1], &self.frames[behind]);
        let length = to.time_s - from.time_s;
        let share = ((time_s - f64::from(from.time_s)) / f64::from(length)) as f32;
        Ok(match self.interpolation {
            KeyInterpolation::Linear => {
                from.translations.iter().zip(&to.translations).map(|(from, to)| from.lerp(*to, share)).collect()
            }
            KeyInterpolation::Smooth => {
                let [leave, arrive] = [self.velocity(behind - 1), self.velocity(behind)];
                let (square, cube) = (share * share, share * share * share);
                (0..expected)
                    .map(|vertex| {
                        (2.0 * cube - 3.0 * square + 1.0) * from.translations[vertex]
                            + (3.0 * square - 2.0 * cube) * to.translations[vertex]
                            + (cube - 2.0 * square + share) * length * leave(vertex)
                            + (cube - square) * length * arrive(vertex)
                    })
                    .collect()
            }
        })
    }

    /// Velocity of each vertex at a frame: from the frame before it to the one after, as far as there are such.
    fn velocity(&self, frame: usize) -> impl Fn(usize) -> Vec3 + '_ {
        let frames = &self.frames;
        let last = frames.len() - 1;
        let duration = frames[last].time_s - frames[0].time_s;
        let (before, shift_before) = match frame {
            0 if self.loops => (last - 1, -duration),
            0 => (0, 0.0),
            _ => (frame - 1, 0.0),
        };
        let (after, shift_after) = match frame {
            _ if frame < last => (frame + 1, 0.0),
            _ if self.loops => (1, duration),
            _ => (last, 0.0),
        };
        let time = (frames[after].time_s + shift_after) - (frames[before].time_s + shift_before);
        move |vertex| (frames[after].translations[vertex] - frames[before].translations[vertex]) / time
    }
}

/// Sets lattices to where their animations are by simulated time. What cannot be played is told once, and the lattice stays.
fn animate_lattices(
    time: Res<Time<Fixed>>,
    mut told: Local<EntityHashSet>,
    mut lattices: Query<(Entity, &LatticeAnimation, &mut DeformLattice)>,
) {
    for (entity, animation, mut lattice) in &mut lattices {
        let set = animation
            .translations_at(lattice.tree(), time.elapsed_secs_f64())
            .and_then(|translations| lattice.bypass_change_detection().set_translations(&translations));
        match set {
            Ok(()) => {
                lattice.set_changed();
                told.remove(&entity);
            }
            Err(error) => {
                if told.insert(entity) {
                    tracing::warn!(
                        "the animation of the lattice {entity} cannot be played, and it stays as it is: {error}"
                    );
                }
            }
        }
    }
}

pub(super) fn build(app: &mut App) {
    app.register_type::<LatticeAnimation>()
        .register_type::<LatticeMotion>()
        .register_type::<KeyFrames>()
        .register_type::<KeyFrame>()
        .register_type::<KeyInterpolation>()
        .register_type::<TravellingWave>()
        .add_systems(FixedUpdate, animate_lattices.in_set(DeformBodies).before(StepBodies));
}
