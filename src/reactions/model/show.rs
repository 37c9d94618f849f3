//! Brings the map up to date where something changed, and notes which rectangles that were (paper of 2002, sections 4.2.1
//! and 4.2.5).

use super::{ReactionModel, StepContext};
use crate::reactions::burn::BurnLook;
use crate::reactions::footprint::Footprint;
use crate::reactions::kind::{ReactionKinds, RegisteredKind, SpriteLook};
use crate::reactions::paint::{Profile, Stroke, paint, restore};
use crate::reactions::regions::group_snake;
use crate::reactions::snake::{Painted, Snake};
use crate::reactions::texels::{TILE_PX, TexelRect, TileMask};
use std::ops::Range;

/// A sprite that grows gets a footprint this much larger, so that it is not made anew in every step.
const HEADROOM: f32 = 1.15;

/// Buffers that are kept between steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Scratch {
    pub texels: Vec<(u32, u32, f32)>,
    /// Rectangles of sprites painted for good in this step.
    pub baked: Vec<TexelRect>,
    rects: Vec<TexelRect>,
    items: Vec<Range<usize>>,
    changed: Vec<TexelRect>,
}

impl ReactionModel {
    pub(super) fn show(&mut self, context: &StepContext) {
        let mut scratch = std::mem::take(&mut self.scratch);
        self.mask.clear();
        scratch.changed.clear();
        self.show_burns(&mut scratch);
        for rect in scratch.baked.drain(..) {
            self.mask.mark(rect);
            scratch.changed.push(rect);
        }
        let mut snakes = std::mem::take(&mut self.snakes);
        for snake in &mut snakes {
            self.find_changes(context, snake, &mut scratch);
        }
        snakes.retain(|snake| !snake.sprites.is_empty());
        self.snakes = snakes;
        if !self.mask.is_empty() {
            self.is_blank = false;
            restore(&mut self.shown, &self.permanent, &self.mask);
            let strokes = strokes(&self.snakes, context.kinds);
            paint(&mut self.shown, &self.mask, &strokes);
            self.log.push(&scratch.changed);
            self.find_seen_tiles();
        }
        self.scratch = scratch;
    }

    /// Looks again at the tiles that were painted.
    fn find_seen_tiles(&mut self) {
        let row_px = self.size.width_px as usize;
        for (column, row) in self.mask.marked() {
            let rect = TileMask::tile_rect(column, row);
            let is_seen = (rect.y as usize..rect.bottom() as usize).any(|y| {
                let start = y * row_px + rect.x as usize;
                let texels = &self.shown.colour()[start..start + TILE_PX as usize];
                texels.iter().fold(0, |opacity, texel| opacity | texel[3]) > 0
            });
            self.seen.set(column, row, is_seen);
        }
    }

    /// Texels whose burn looks different now.
    fn show_burns(&mut self, scratch: &mut Scratch) {
        let first = scratch.changed.len();
        // Grains of half a millimetre or so, whatever the map's width.
        let grain = (self.size.width_px / 1024).max(1).ilog2();
        self.heat.changed(&self.settings.burns, &mut self.mask, &mut scratch.changed);
        for place in first..scratch.changed.len() {
            let rect = scratch.changed[place];
            let Some(looks) = self.heat.looks(rect.x / TILE_PX, rect.y / TILE_PX) else { continue };
            for y in rect.y..rect.bottom() {
                for x in rect.x..rect.right() {
                    let index = looks[(y % TILE_PX) as usize][(x % TILE_PX) as usize];
                    let (stain, stain_gloss) = self.stains.texel(x, y);
                    let (colour, gloss) =
                        burnt(self.settings.burns.look(grained(index, x >> grain, y >> grain)), stain, stain_gloss);
                    self.permanent.set_texel(x, y, colour, gloss);
                }
            }
        }
    }

    /// Finds the sprites of a snake that look different now, and the rectangles that hold them and what has gone.
    fn find_changes(&mut self, context: &StepContext, snake: &mut Snake, scratch: &mut Scratch) {
        let registered = context.kinds.registered(snake.kind);
        scratch.rects.clear();
        scratch.items.clear();
        let Snake { sprites, erased, .. } = snake;
        // What a head has left lies beside it; what has gone at the end, beside the tail.
        let mut add = |rects: &[TexelRect]| {
            let start = scratch.rects.len();
            scratch.rects.extend_from_slice(rects);
            scratch.items.push(start..scratch.rects.len());
        };
        for rect in erased.drain(..) {
            add(&[rect]);
        }
        for sprite in sprites.iter_mut() {
            let Some(RegisteredKind { kind, version, .. }) = registered else { break };
            let now = Painted { look: kind.look(sprite), radius_m: sprite.radius_m, version: *version };
            let is_seen = now.look.opacity > 0;
            if sprite.painted == Some(now) || (sprite.painted.is_none() && !is_seen) {
                continue;
            }
            let fits = sprite.footprint.as_ref().is_some_and(|footprint| footprint.radius_m() >= sprite.radius_m);
            if !fits {
                let grows = sprite.painted.is_some();
                if let Some(old) = sprite.footprint.take().filter(|_| grows) {
                    add(old.rects());
                }
                let radius_m = if grows { HEADROOM * sprite.radius_m } else { sprite.radius_m };
                sprite.footprint = Footprint::new(context.surface, self.size, sprite.point, radius_m);
            }
            if let Some(footprint) = &sprite.footprint {
                add(footprint.rects());
            }
            sprite.painted = Some(now);
        }
        if scratch.items.is_empty() {
            return;
        }
        for &rect in &scratch.rects {
            self.mask.mark(rect);
        }
        group_snake(scratch.items.iter().map(|item| &scratch.rects[item.clone()]), &mut scratch.changed);
    }
}

/// How a sprite that looks like this is painted.
pub(super) fn stroke<'a>(
    footprint: &'a Footprint,
    radius_m: f32,
    profile: &'a Profile,
    look: SpriteLook,
) -> Stroke<'a> {
    let opacity = f32::from(look.opacity) / 255.0;
    Stroke { footprint, radius_m, profile, colour: look.colour, gloss: look.gloss, opacity }
}

/// Every sprite as it is painted: kinds by their order, old snakes before young ones, tails before heads.
fn strokes<'a>(snakes: &'a [Snake], kinds: &'a ReactionKinds) -> Vec<Stroke<'a>> {
    let mut order: Vec<(i32, usize)> =
        snakes.iter().enumerate().filter_map(|(place, snake)| Some((kinds.get(snake.kind)?.order(), place))).collect();
    order.sort_unstable();
    let mut strokes = Vec::with_capacity(snakes.iter().map(|snake| snake.sprites.len()).sum());
    for (_, place) in order {
        let snake = &snakes[place];
        let Some(registered) = kinds.registered(snake.kind) else { continue };
        for sprite in snake.sprites.iter().rev() {
            if let (Some(footprint), Some(Painted { look, radius_m, .. })) = (&sprite.footprint, sprite.painted)
                && look.opacity > 0
            {
                strokes.push(stroke(footprint, radius_m, &registered.profile, look));
            }
        }
    }
    strokes
}

/// Flesh does not burn evenly: a place in the ramp, moved by up to a fifth. What is not burnt stays so.
fn grained(index: u8, x: u32, y: u32) -> u8 {
    let mut hash = x.wrapping_mul(0x8da6_b343) ^ y.wrapping_mul(0xd816_3841);
    hash = (hash ^ hash >> 15).wrapping_mul(0x2c1b_3c6d);
    hash ^= hash >> 12;
    let offset = (hash % 103) as i32 - 51;
    (i32::from(index) * (256 + offset) / 256).min(255) as u8
}

/// A burn over what was there before it.
fn burnt(burn: BurnLook, stain: [u8; 4], stain_gloss: u8) -> ([u8; 4], u8) {
    let rest = 255 - u32::from(burn.colour[3]);
    let over = |k: usize| burn.colour[k].saturating_add(((u32::from(stain[k]) * rest + 127) / 255) as u8);
    let gloss = (u32::from(burn.gloss) * (255 - rest) + u32::from(stain_gloss) * rest + 127) / 255;
    (std::array::from_fn(over), gloss as u8)
}
