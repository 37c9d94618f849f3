//! Sprites give their heat, age and end.

use super::show::stroke;
use super::{MAX_RADIUS_M, ReactionModel, StepContext};
use crate::organ::surface::NEUTRAL_GLOSS;
use crate::reactions::burn::Cautery;
use crate::reactions::footprint::Footprint;
use crate::reactions::kind::{Ageing, KindId, ReactionKind, SpriteFate};
use crate::reactions::settings::ReactionFault;
use crate::reactions::snake::{Snake, Sprite};

impl ReactionModel {
    /// Lays the heat of this step's sprites into the heat map, and lets it spread.
    pub(super) fn heat_up(&mut self, context: &StepContext) {
        let mut texels = std::mem::take(&mut self.scratch.texels);
        let mut snakes = std::mem::take(&mut self.snakes);
        for sprite in snakes.iter_mut().flat_map(|snake| &mut snake.sprites).filter(|sprite| sprite.heat_j > 0.0) {
            let heat_j = std::mem::take(&mut sprite.heat_j);
            if let Some(footprint) = Footprint::new(context.surface, self.size, sprite.point, sprite.radius_m) {
                texels.clear();
                footprint.for_each_texel(|x, y, square| texels.push((x, y, Cautery::weight(square.sqrt()))));
                if texels.is_empty() {
                    // Narrower than a texel: the one in the middle takes all.
                    let (x, y) = self.texel(context.surface.atlas.uv(sprite.point));
                    texels.push((x, y, 1.0));
                }
                self.heat.deposit(context.surface, &texels, heat_j);
            }
        }
        self.snakes = snakes;
        self.scratch.texels = texels;
        self.heat.step(context.surface, context.dt_s);
    }

    pub(super) fn age(&mut self, context: &StepContext) {
        let mut snakes = std::mem::take(&mut self.snakes);
        for snake in &mut snakes {
            match context.kinds.get(snake.kind) {
                Some(kind) => self.age_snake(context, kind, snake),
                // The list of kinds was exchanged for one without it.
                None => self.drop_snake(snake),
            }
        }
        snakes.retain(|snake| !snake.sprites.is_empty() || !snake.erased.is_empty());
        self.snakes = snakes;
    }

    fn drop_snake(&mut self, snake: &mut Snake) {
        self.blame(ReactionFault::UnknownKind);
        self.tally.dried_m3 += snake.volume_m3();
        (snake.is_active, snake.shed_m3) = (false, 0.0);
        for mut sprite in snake.sprites.drain(..) {
            sprite.erase(&mut snake.erased);
        }
    }

    fn age_snake(&mut self, context: &StepContext, kind: &dyn ReactionKind, snake: &mut Snake) {
        let dt_s = context.dt_s as f32;
        let is_kept = kind.liquid().is_some() || snake.cause > 0.0;
        let mut place = 0;
        while place < snake.sprites.len() {
            let is_head = place == 0 && snake.is_active;
            let sprite = &mut snake.sprites[place];
            sprite.age_s += dt_s;
            let fate = kind.age(sprite, &Ageing { dt_s, is_head, cause: snake.cause });
            // A user's kind may compute anything.
            let bounded = |value: f32, most: f32| if value.is_nan() { 0.0 } else { value.clamp(0.0, most) };
            sprite.radius_m = bounded(sprite.radius_m, MAX_RADIUS_M as f32);
            sprite.opacity = bounded(sprite.opacity, 1.0);
            if fate == SpriteFate::Stays {
                place += 1;
                continue;
            }
            if is_head {
                snake.is_active = false;
            }
            let Some(sprite) = snake.sprites.remove(place) else { break };
            self.end_sprite(context, kind, snake, sprite, fate);
        }
        while snake.sprites.len() > kind.longest().max(1) {
            let Some(sprite) = snake.sprites.pop_back() else { break };
            let fate = kind.oldest_ends(&sprite);
            self.end_sprite(context, kind, snake, sprite, fate);
        }
        // An instrument that was lifted keeps nothing up; drops go on by themselves.
        if !is_kept && snake.kind == KindId::WHITENING {
            snake.is_active = false;
        }
        if snake.sprites.is_empty() {
            self.tally.dried_m3 += std::mem::take(&mut snake.shed_m3);
        }
    }

    fn end_sprite(
        &mut self,
        context: &StepContext,
        kind: &dyn ReactionKind,
        snake: &mut Snake,
        mut sprite: Sprite,
        fate: SpriteFate,
    ) {
        self.tally.dried_m3 += sprite.volume_m3;
        if fate == SpriteFate::Bakes {
            self.bake(context, kind, snake, &sprite);
        }
        sprite.erase(&mut snake.erased);
    }

    /// Paints a sprite for good.
    fn bake(&mut self, context: &StepContext, kind: &dyn ReactionKind, snake: &Snake, sprite: &Sprite) {
        let Some(profile) = context.kinds.registered(snake.kind).map(|registered| &*registered.profile) else { return };
        let made;
        let footprint = match &sprite.footprint {
            Some(footprint) => footprint,
            None => match Footprint::new(context.surface, self.size, sprite.point, sprite.radius_m) {
                Some(footprint) => {
                    made = footprint;
                    &made
                }
                None => return,
            },
        };
        let mut look = kind.look(sprite);
        // What stays has dried.
        look.gloss = look.gloss.min(NEUTRAL_GLOSS);
        let stroke = stroke(footprint, sprite.radius_m, profile, look);
        self.stains.bake(&stroke);
        self.permanent.bake(&stroke);
        self.tally.baked_sprites += 1;
        self.scratch.baked.extend_from_slice(footprint.rects());
    }

    /// The oldest sprites go where there are too many.
    pub(super) fn keep_within_budget(&mut self, context: &StepContext) {
        let most = self.settings.max_sprites.clamp(1, 100_000) as usize;
        let mut surplus = self.sprite_count().saturating_sub(most);
        if surplus == 0 {
            return;
        }
        self.blame(ReactionFault::TooMany);
        let mut snakes = std::mem::take(&mut self.snakes);
        for snake in &mut snakes {
            if surplus == 0 {
                break;
            }
            let Some(kind) = context.kinds.get(snake.kind) else { continue };
            while surplus > 0
                && let Some(sprite) = snake.sprites.pop_back()
            {
                let fate = kind.oldest_ends(&sprite);
                self.end_sprite(context, kind, snake, sprite, fate);
                surplus -= 1;
            }
            if snake.sprites.is_empty() {
                snake.is_active = false;
                self.tally.dried_m3 += std::mem::take(&mut snake.shed_m3);
            }
        }
        snakes.retain(|snake| !snake.sprites.is_empty() || !snake.erased.is_empty());
        self.snakes = snakes;
    }
}
