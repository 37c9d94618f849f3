//! Heads move, leave trails and meet.

use super::{MAX_RADIUS_M, ReactionEvent, ReactionModel, StepContext};
use crate::organ::sphere::SurfacePoint;
use crate::organ::surface::Surface;
use crate::reactions::drops::{DropFate, DropHead};
use crate::reactions::kind::Motion;
use crate::reactions::settings::ReactionFault;
use crate::reactions::snake::{Snake, Sprite};
use crate::reactions::texels::TexelRect;
use glam::Vec3;

/// A drop of a smaller radius is only film, metres.
pub(super) const SMALLEST_DROP_M: f64 = 0.2e-3;

impl Sprite {
    /// Goes to another place: what was painted must be erased.
    pub(super) fn move_to(&mut self, point: SurfacePoint, erased: &mut Vec<TexelRect>) {
        self.erase(erased);
        self.point = point;
        self.footprint = None;
    }

    /// Notes the texels that it was painted on.
    pub(super) fn erase(&mut self, erased: &mut Vec<TexelRect>) {
        if self.painted.take().is_some()
            && let Some(footprint) = &self.footprint
        {
            erased.extend_from_slice(footprint.rects());
        }
    }
}

impl ReactionModel {
    pub(super) fn move_heads(&mut self, context: &StepContext) {
        if self.snakes.is_empty() {
            return;
        }
        // Drops in a hollow organ run on the side that is seen: their normals point inward.
        let turned: Vec<Vec3> = if context.is_inside {
            context.surface.normals.iter().map(|&normal| -normal).collect()
        } else {
            Vec::new()
        };
        let ground =
            Surface { normals: if context.is_inside { &turned } else { context.surface.normals }, ..*context.surface };
        let mut snakes = std::mem::take(&mut self.snakes);
        for snake in &mut snakes {
            self.move_head(context, &ground, snake);
        }
        for (id, kind) in context.kinds.iter() {
            let Some(drops) = kind.liquid() else { continue };
            let were_active: Vec<bool> = snakes.iter().map(|snake| snake.is_active).collect();
            self.collisions.settle(&ground, drops, id, &mut snakes);
            let places = self.collisions.is_wet.iter().zip(were_active);
            for (snake, (&is_wet, was_active)) in snakes.iter_mut().zip(places).filter(|(snake, _)| snake.kind == id) {
                snake.is_wet = is_wet;
                if let Some(head) = snake.sprites.front_mut() {
                    head.radius_m = head.radius_m.min(MAX_RADIUS_M as f32);
                }
                if was_active && !snake.is_active {
                    become_film(context, snake);
                }
            }
            self.tally.merged_drops += self.collisions.merges as u64;
            self.tally.cancelled_sprites += self.collisions.cancelled_sprites as u64;
        }
        self.snakes = snakes;
    }

    fn move_head(&mut self, context: &StepContext, ground: &Surface, snake: &mut Snake) {
        let Some(kind) = context.kinds.get(snake.kind).filter(|_| snake.is_active) else { return };
        let Some(sprite) = snake.sprites.front() else { return };
        let place = sprite.point;
        let mut head = DropHead { point: place, velocity_m_per_s: snake.velocity_m_per_s, volume_m3: sprite.volume_m3 };
        let motion = Motion {
            surface: ground,
            gravity_m_per_s2: context.gravity_m_per_s2,
            is_wet: snake.is_wet,
            dt_s: context.dt_s,
        };
        let mut fate = kind.move_head(&mut head, &motion);
        // A user's kind may say anything.
        if ground.checked(head.point).is_none() {
            fate = DropFate::Lost;
        }
        snake.velocity_m_per_s = head.velocity_m_per_s;
        match fate {
            DropFate::Sticks => snake.velocity_m_per_s = glam::DVec3::ZERO,
            DropFate::Slides { distance_m } => self.slide(context, snake, head, distance_m),
            DropFate::Falls | DropFate::Leaves => {
                self.tally.fallen_drops += 1;
                self.tally.fallen_m3 += head.volume_m3;
                self.note(ReactionEvent::DropFell {
                    position_m: ground.position_m(head.point),
                    velocity_m_per_s: head.velocity_m_per_s,
                    volume_m3: head.volume_m3,
                });
                // What clung to the surface stays behind as film.
                self.end_head(context, snake, head.point);
            }
            DropFate::Lost => {
                self.tally.lost_m3 += head.volume_m3;
                self.blame(ReactionFault::BrokenSurface);
                self.end_head(context, snake, place);
            }
        }
    }

    fn slide(&mut self, context: &StepContext, snake: &mut Snake, mut head: DropHead, distance_m: f64) {
        let Some(kind) = context.kinds.get(snake.kind) else { return };
        let drops = kind.liquid().map(|drops| drops.tamed());
        if let Some(drops) = &drops {
            snake.shed_m3 += head.shed(drops, distance_m);
        }
        snake.way_m += distance_m;
        let Some(sprite) = snake.sprites.front() else { return };
        let leaves = snake.way_m >= f64::from(kind.spacing() * sprite.radius_m);
        if leaves {
            let mut left = kind.trail(sprite);
            left.volume_m3 = snake.shed_m3;
            (snake.shed_m3, snake.way_m) = (0.0, 0.0);
            snake.sprites.insert(1, left);
        }
        let Snake { sprites, erased, .. } = snake;
        let Some(sprite) = sprites.front_mut() else { return };
        sprite.move_to(head.point, erased);
        sprite.volume_m3 = head.volume_m3;
        if let Some(drops) = &drops {
            sprite.radius_m = drops.radius_m(head.volume_m3).min(MAX_RADIUS_M) as f32;
            if f64::from(sprite.radius_m) < SMALLEST_DROP_M {
                become_film(context, snake);
            }
        }
    }

    /// The head becomes film; its liquid is elsewhere.
    fn end_head(&self, context: &StepContext, snake: &mut Snake, point: SurfacePoint) {
        let Snake { sprites, erased, .. } = snake;
        if let Some(sprite) = sprites.front_mut() {
            if sprite.point != point {
                sprite.move_to(point, erased);
            }
            sprite.volume_m3 = 0.0;
        }
        become_film(context, snake);
    }
}

/// The head ends and leaves a film where it was, with the liquid that it still has.
pub(super) fn become_film(context: &StepContext, snake: &mut Snake) {
    snake.is_active = false;
    let Some(kind) = context.kinds.get(snake.kind) else { return };
    if let Some(sprite) = snake.sprites.front_mut() {
        // Where another drop has swallowed it, it only fades out.
        let (volume_m3, painted, is_cancelled) =
            (sprite.volume_m3 + std::mem::take(&mut snake.shed_m3), sprite.painted, sprite.is_cancelled);
        *sprite = Sprite { volume_m3, painted, is_cancelled, ..kind.trail(sprite) };
    }
}
